//! How recordings come into the workbench: a folder dropped, an archive, MATLAB; corrected where they are taken wrongly; found
//! again after a restart. And the stage with something hidden.

use crate::browser::{Browser, there};
use crate::server::Server;
use crate::way::{hysteron, in_browser};
use serde_json::json;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Four periods of a triangle with a loop: time, voltage, position.
pub(crate) fn rows(samples: u32) -> impl Iterator<Item = (f64, f64, f64)> {
    (0..samples).map(|k| {
        let phase = f64::from(k % 250) / 250.0;
        let voltage = 20.0 * (1.0 - (2.0 * phase - 1.0).abs());
        let opening = if phase < 0.5 { -0.3 } else { 0.3 };
        (f64::from(k) * 1e-3, voltage, 0.4 * voltage + opening)
    })
}

pub(crate) fn csv(samples: u32) -> String {
    let mut text = "time_s,voltage_v,position_um\n".to_owned();
    for (t, v, y) in rows(samples) {
        let _ = writeln!(text, "{t:.3},{v:.4},{y:.5}");
    }
    text
}

/// A MATLAB file of version 5 with columns of doubles, not compressed.
fn mat(columns: &[(&str, Vec<f64>)]) -> Vec<u8> {
    let element = |kind: u32, data: &[u8]| {
        let mut out = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        out.extend(data);
        out.resize(out.len().next_multiple_of(8), 0);
        out
    };
    let mut file = b"MATLAB 5.0 MAT-file, made by a test".to_vec();
    file.resize(124, b' ');
    file.extend([0, 1, b'I', b'M']);
    for (name, values) in columns {
        let size = [values.len() as i32, 1].map(i32::to_le_bytes).concat();
        let data: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        // Class 6 is double, type 6 unsigned, 5 signed, 1 bytes, 9 double.
        let array = [
            element(6, &[6, 0, 0, 0, 0, 0, 0, 0]),
            element(5, &size),
            element(1, name.as_bytes()),
            element(9, &data),
        ]
        .concat();
        file.extend(element(14, &array));
    }
    file
}

/// A folder with two recordings of one name, and what is none.
fn folder(place: &Path) -> PathBuf {
    let runs = place.join("runs");
    for (part, samples) in [("up", 1000), ("down", 750)] {
        std::fs::create_dir_all(runs.join(part)).unwrap();
        std::fs::write(runs.join(part).join("run.csv"), csv(samples)).unwrap();
    }
    std::fs::write(runs.join("notes.md"), "not a recording").unwrap();
    std::fs::write(runs.join(".hidden.csv"), "not to be seen").unwrap();
    runs
}

fn zipped(place: &Path) -> PathBuf {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, samples) in [("archive/first.csv", 500), ("archive/second.csv", 1250)] {
        archive
            .start_file(name, zip::write::SimpleFileOptions::default())
            .unwrap();
        archive.write_all(csv(samples).as_bytes()).unwrap();
    }
    let file = place.join("runs.zip");
    std::fs::write(&file, archive.finish().unwrap().into_inner()).unwrap();
    file
}

#[test]
fn val_a_folder_an_archive_and_a_matlab_file_are_dropped() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = Server::start(&session);
    let [t, v, y]: [Vec<f64>; 3] = [
        rows(1500).map(|r| r.0).collect(),
        rows(1500).map(|r| r.1).collect(),
        rows(1500).map(|r| r.2).collect(),
    ];
    let matlab = place.path().join("bench.mat");
    std::fs::write(&matlab, mat(&[("time_s", t), ("voltage_v", v), ("position_um", y)])).unwrap();
    in_browser(async {
        let browser = Browser::open(&server.address(), false).await;
        let dropped = [folder(place.path()), zipped(place.path()), matlab];
        browser.drop_files("#drop", &dropped).await;
        browser.see(".cards article:nth-of-type(5)").await;
        for (name, samples) in [
            ("bench.mat", "1500"),
            ("runs-down-run.csv", "750"),
            ("first.csv", "500"),
            ("second.csv", "1250"),
            ("runs-up-run.csv", "1000"),
        ] {
            let card = "return [...document.querySelectorAll('.cards article')].find((card) => card.querySelector('h3').textContent === arguments[0]).innerText";
            let card = browser.run(card, vec![json!(name)]).await;
            let said = card.as_str().unwrap().replace('\u{a0}', " ");
            assert!(said.contains(samples) && said.contains("0.250 s"), "{name}: {said}");
        }
        browser.picture("dropped").await;
        browser.accessible("dropped").await;
        browser.click("#use").await;
        browser.see_text("The data: data").await;
        browser.close().await;
    });
    let state = server.state();
    assert_eq!(
        state["data"]["records"].as_array().unwrap().len(),
        5,
        "and nothing else"
    );
}

#[test]
fn val_what_was_taken_wrongly_is_corrected_in_the_page() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    // A scope's columns: the monitor output of an amplifier of gain 20 in millivolts, a sensor in nanometres, no time.
    let mut text = "CH1,CH2\n".to_owned();
    for (_, v, y) in rows(1000) {
        let _ = writeln!(text, "{:.2},{:.2}", v * 1000.0 / 20.0, y * 1000.0);
    }
    let file = place.path().join("scope.csv");
    std::fs::write(&file, text).unwrap();
    let server = Server::start(&session);
    in_browser(async {
        let browser = Browser::open(&server.address(), false).await;
        browser.drop_files("#drop", &[file]).await;
        let said = browser.see(".card.bad .refused").await;
        assert!(said.len() > 20, "{said}");
        browser.see("#correct-0[open]").await;
        browser.see("#use[disabled]").await;
        browser.type_into("#column-voltage-0", "CH1:mV*20").await;
        browser.type_into("#column-position-0", "CH2:nm").await;
        browser.type_into("#rate-0", "1000").await;
        browser.picture("corrections").await;
        browser.click("#read-again-0").await;
        browser.see("#use:not([disabled])").await;
        let said = browser.see(".cards article").await.replace('\u{a0}', " ");
        assert!(said.contains("1000 Hz") && said.contains("0.250 s"), "{said}");
        browser.click("#use").await;
        browser.see("#to-fit").await;
        browser.close().await;
    });
    // The command beside it makes the same dataset.
    let command = server.state()["data"]["command"].as_str().unwrap().to_owned();
    let typed: Vec<String> = command
        .split(' ')
        .skip(1)
        .map(|word| word.trim_matches('\'').replace("data", "typed"))
        .collect();
    let said = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(&session)
        .args(&typed)
        .assert()
        .success();
    drop(said);
    let [own, same] = ["data", "typed"].map(|folder| std::fs::read(session.join(folder).join("scope.csv")).unwrap());
    assert!(own == same, "{command}");
    let read = hysteron_data::read_dataset(&session.join("data")).unwrap();
    let (low, high) = read.records[0]
        .voltage_v
        .iter()
        .fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
    assert!((low, high) == (0.0, 20.0), "volts at the stack: {low} to {high}");
}

#[test]
fn regress_files_that_were_brought_are_found_again() {
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let before = {
        let server = Server::start(&session);
        let brought = server.ask("POST", "api/upload?name=up/run.csv", csv(1000).as_bytes());
        assert_eq!(brought.status, 200, "{}", brought.text());
        let reading = br#"{"files":["up-run.csv"],"reading":{"columns":["position=position_um:nm"]}}"#;
        assert_eq!(server.ask("POST", "api/reading", reading).status, 200);
        let role = br#"{"file":"up-run.csv","role":"validate"}"#;
        assert_eq!(server.ask("POST", "api/use", role).status, 200);
        server.state()
    };
    let after = Server::start(&session).state();
    assert_eq!(before["files"], after["files"]);
    let file = &after["files"][0];
    assert_eq!(
        (&file["name"], &file["role"], &file["stands"]),
        (&json!("up-run.csv"), &json!("validate"), &json!("waits"))
    );
    assert_eq!(file["reading"]["columns"][0], "position=position_um:nm");
}

#[test]
fn val_a_stage_with_something_hidden_is_answered_and_shown() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = Server::start(&session);
    in_browser(async {
        let browser = Browser::open(&server.address(), true).await;
        browser.click("#start-challenge").await;
        browser.see_text("Something may be hidden in these data").await;
        browser.picture("challenge-data").await;
        browser.click("#to-fit").await;
        browser.choose("#model", "pi").await;
        browser.click("#fit").await;
        browser.see_text("Beside the measurement").await;
        browser.click("#way a[href='#diagnose']").await;
        browser.see("#riddle").await;
        // `none` stands alone: refused in words, where it was asked.
        browser.choose("#answer-1", "none").await;
        browser.choose("#answer-2", "delay").await;
        browser.click("#answer").await;
        let said = browser.see("#answer-form #fault:not([hidden])").await;
        assert!(said.contains("`none` stands alone"), "{said}");
        browser.choose("#answer-1", "delay").await;
        browser.choose("#answer-2", "first-order-lag").await;
        browser.click("#answer").await;
        browser.see_text("You answered delay and first-order lag").await;
        browser.click("#reveal").await;
        let judged = browser.see("#judgement").await;
        let said = hysteron(&session, &["challenge", "reveal", "data", "data.key", "--json"]);
        let because = said["judgement"]["because"].as_str().unwrap();
        assert!(judged.contains(because), "{judged}: {because}");
        browser.picture("challenge-shown").await;
        browser.accessible("challenge").await;
        browser.close().await;
    });
}

#[test]
fn val_a_diagnosis_is_stopped_in_the_page() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let server = Server::start(&place.path().join("session"));
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"pi","plays":6}"#);
    in_browser(async {
        let browser = Browser::open(&server.address(), false).await;
        browser.click("#way a[href='#diagnose']").await;
        browser.click("#diagnose").await;
        let doing = browser.see("#job:not([hidden]) #job-text:not(:empty)").await;
        assert!(doing.starts_with("Diagnosing") && doing.ends_with('%'), "{doing}");
        browser.picture("progress").await;
        browser.click("#job-stop").await;
        let said = browser.see("main #fault:not([hidden])").await;
        assert!(said.contains("was stopped; nothing was changed"), "{said}");
        browser.see("#diagnose:not([disabled])").await;
        browser.close().await;
    });
    assert_eq!(server.state()["diagnosed"][0], false);
}
