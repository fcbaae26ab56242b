//! The controller of a model with an effect: designed, run and exported with the digits and the bytes of the command line; refused
//! in sentences.

use crate::browser::{Browser, there};
use crate::server::Server;
use crate::way::in_browser;
use serde_json::{Value, json};
use std::path::Path;

/// What a command under a panel prints when it is typed in the session, its output in `typed.toml`.
async fn typed(browser: &Browser, session: &Path, panel: &str) -> String {
    let told = "return [...document.querySelectorAll(arguments[0])].map((e) => e.closest('section').querySelector('.command code').textContent)[0]";
    let told = browser.run(told, vec![json!(panel)]).await;
    let words: Vec<&str> = told.as_str().unwrap().split(' ').skip(1).collect();
    let output = words.iter().position(|word| *word == "-o").map(|at| at + 1);
    let words = words
        .iter()
        .enumerate()
        .map(|(k, word)| if Some(k) == output { "typed.toml" } else { word });
    let out = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(session)
        .args(words)
        .assert()
        .success();
    String::from_utf8(out.get_output().stdout.clone()).unwrap()
}

/// What is downloaded behind a link.
async fn downloaded(browser: &Browser, link: &str) -> String {
    let get =
        "const done = arguments[1]; fetch(document.querySelector(arguments[0]).href).then((r) => r.text()).then(done)";
    let text = browser.run_async(get, vec![json!(link)]).await;
    text.as_str().unwrap().to_owned()
}

/// Designs the controller of the current step with the fields as they are, until the page says `words`, and holds it against the command.
pub(crate) async fn design(browser: &Browser, session: &Path, words: &str) -> String {
    browser.click("#design").await;
    browser.see_text(words).await;
    let said = browser.see("#designed").await;
    let printed = typed(browser, session, "#designed").await;
    let (told, next) = printed.split_once("written to typed.toml\n").unwrap();
    assert_eq!(told.trim_end(), said.trim_end());
    let next = next
        .strip_prefix("next: hysteron track typed.toml --")
        .unwrap_or_else(|| panic!("{next}"));
    assert!(
        next.starts_with("model models/") || next.starts_with("board "),
        "{next}"
    );
    let file = std::fs::read_to_string(session.join("typed.toml")).unwrap();
    assert_eq!(downloaded(browser, "#export-controller").await, file);
    said
}

/// Makes the table, and holds it against the command.
pub(crate) async fn table(browser: &Browser, session: &Path) {
    browser.click("#table").await;
    browser.see("#export-table").await;
    let said = browser.see("#table-said").await;
    let printed = typed(browser, session, "#table-said").await;
    assert_eq!(printed, format!("{}\nwritten to typed.toml\n", said.trim_end()));
    let file = std::fs::read_to_string(session.join("typed.toml")).unwrap();
    assert_eq!(downloaded(browser, "#export-table").await, file);
}

/// Runs the law on the model, and holds the table against the command's.
async fn track(browser: &Browser, session: &Path) {
    browser.choose("#track-stage", "").await;
    browser.click("#track").await;
    let said = browser.see("#tracked").await;
    let printed = typed(browser, session, "#tracked").await;
    assert_eq!(printed.trim_end(), said.trim_end());
    assert!(said.contains("sine 100 Hz"), "{said}");
    // The picture has the figures of the table.
    for loops in dots(browser, "#tracked-plot").await {
        for error in loops.iter().skip(1).step_by(2).flatten() {
            assert!(said.contains(&format!("{error:.3}")), "{error} in {said}");
        }
    }
}

/// The values of a picture of errors, expected and found in turn for each loop.
async fn dots(browser: &Browser, host: &str) -> Vec<Vec<Vec<f64>>> {
    browser.see(&format!("{host} canvas")).await;
    let data = "return document.querySelector(arguments[0]).chart.data.slice(1).map((column) => column.filter((v) => v !== null))";
    let data: Vec<Vec<f64>> = serde_json::from_value(browser.run(data, vec![json!(host)]).await).unwrap();
    data.chunks(2).map(<[_]>::to_vec).collect()
}

/// Runs the law on a simulated stage, and holds what is said against the command's.
async fn track_on_stage(browser: &Browser, session: &Path) {
    browser.choose("#track-stage", "paper-rate").await;
    browser.click("#track").await;
    let said = browser.see("#on-stage").await;
    let printed = typed(browser, session, "#on-stage").await;
    assert_eq!(printed.trim_end(), said.trim_end());
    assert!(said.starts_with("STAGE paper-rate (simulated)"), "{said}");
    for loops in dots(browser, "#on-stage-plot").await {
        assert_eq!(
            (loops[0].len(), loops[1].len()),
            (3, 7),
            "expected of sines within the records, found of all"
        );
        for error in &loops[1] {
            assert!(said.contains(&format!("{error:.3}")), "{error} in {said}");
        }
    }
}

/// The lights of a design have the words that it prints for their reasons; what they say, by what they are about.
async fn lights(browser: &Browser, said: &str) -> Vec<(String, String)> {
    let flat = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let all = "return [...document.querySelectorAll('#lights li')].map((li) => [li.className, li.querySelector('strong').textContent, li.lastChild.textContent])";
    let all: Vec<[String; 3]> = serde_json::from_value(browser.run(all, vec![]).await).unwrap();
    assert!(all.len() > 2, "{all:?}");
    let said = flat(said).replace("um", "µm");
    for [_, about, text] in &all {
        let why = text.strip_prefix(&format!("{about}: ")).unwrap().replace("um", "µm");
        assert!(said.contains(&why), "{why}\n{said}");
    }
    all.into_iter().map(|[shine, about, _]| (about, shine)).collect()
}

/// Whether a light with this is among them.
fn shines(lights: &[(String, String)], about: &str, shine: &str) -> bool {
    lights.iter().any(|light| light.0 == about && light.1 == shine)
}

/// The way from the step that is looked at to its controller and its table, on the demo stage and on a user's own records, of whose
/// bench nothing is known.
pub(crate) async fn the_controller(browser: &Browser, session: &Path, name: &str) {
    browser.click("#way a[href='#controller']").await;
    let said = design(browser, session, "IDENTIFIED").await;
    assert!(said.starts_with("EFFECTS\n"), "the step has an effect: {said}");
    if name != "demo" {
        browser.click("#table").await;
        let said = browser.see("#table-form #fault:not([hidden])").await;
        assert!(said.contains("neither you nor the records say"), "{said}");
        assert!(said.contains("give --dac LOW,HIGH"), "{said}");
        for (field, value) in [
            ("#table-dac_min_v", "-10"),
            ("#table-dac_full_v", "10"),
            ("#table-adc_min_um", "-5"),
            ("#table-adc_full_um", "5"),
        ] {
            browser.type_into(field, value).await;
        }
    }
    table(browser, session).await;
    browser.picture(&format!("{name}-controller")).await;
    browser.accessible("controller").await;
}

#[test]
fn val_a_model_with_an_effect_gets_its_controller_with_the_digits_of_the_command_line() {
    if !there() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let server = Server::start(&session);
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"mpi","plays":6}"#);
    server.act(r#"{"what":"add","effect":"delay"}"#);
    in_browser(async {
        let browser = Browser::open(&format!("{}#controller", server.address()), false).await;
        browser.see("#no-response").await;
        let said = design(&browser, &session, "none: no record of small signals").await;
        let open = lights(&browser, &said).await;
        assert!(
            shines(&open, "Feedback", "cannot-tell") && shines(&open, "Delay", "pass"),
            "{open:?}"
        );
        assert_eq!(pictures(&browser).await, 0, "an open loop has no margins");
        track(&browser, &session).await;
        track_on_stage(&browser, &session).await;
        table(&browser, &session).await;
        browser.picture("controller-open").await;

        browser.type_into("#design-rigid_hz", "3000").await;
        let said = design(&browser, &session, "by --rigid, your word").await;
        let closed = lights(&browser, &said).await;
        assert!(
            shines(&closed, "Feedback", "pass") && shines(&closed, "A mode may be anywhere", "cannot-tell"),
            "{closed:?}"
        );
        let state = server.state();
        assert_eq!(
            (&state["tracked"], &state["on_stage"], &state["tables"]),
            (&json!({}), &json!({}), &json!({})),
            "of the controller before"
        );
        assert_eq!(pictures(&browser).await, 3);
        shows_the_margins(&browser, &session).await;
        track(&browser, &session).await;
        browser.picture("controller-closed").await;
        browser.accessible("the controller").await;
        browser.close().await;
    });
    // Found again after a restart, and in the session that is taken home.
    let before = server.state()["controllers"].clone();
    drop(server);
    let server = Server::start(&session);
    assert_eq!(server.state()["controllers"], before);
    assert_eq!(
        before["1"]["command"],
        "hysteron design models/2.toml --rigid=3000 -o controllers/2.toml"
    );
    let zip = server.ask("GET", "api/export/session", b"").body;
    let zip = zip::ZipArchive::new(std::io::Cursor::new(zip)).unwrap();
    assert!(zip.index_for_name("session/controllers/2.toml").is_some());
}

async fn pictures(browser: &Browser) -> u64 {
    let count =
        "return document.querySelectorAll('#loop-sensitivity canvas, #loop-gain canvas, #loop-phase canvas').length";
    browser.run(count, vec![]).await.as_u64().unwrap()
}

/// The curves say what the command line says of the loop: its peak, and up to where disturbances are below -3 dB.
async fn shows_the_margins(browser: &Browser, session: &Path) {
    let out = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(session)
        .args(["design", "models/2.toml", "--rigid=3000", "-o", "typed.toml", "--json"])
        .assert()
        .success();
    let said: Value = serde_json::from_slice(&out.get_output().stdout).unwrap();
    let curves = browser
        .run("return document.querySelector('#loop-sensitivity').chart.data", vec![])
        .await;
    let curve = |k: usize| -> Vec<f64> {
        curves[k]
            .as_array()
            .unwrap()
            .iter()
            .map(|value| value.as_f64().unwrap())
            .collect()
    };
    let (hz, nominal, worst) = (curve(0), curve(1), curve(2));
    let half = 0.5_f64.sqrt();
    let crossed = hz[nominal.iter().position(|left| *left > half).unwrap()];
    let told = said["feedback"]["rejection_hz"].as_f64().unwrap();
    // A step of the curve's grid and one of the design's.
    assert!(
        (crossed / told - 1.0).abs() < 0.06,
        "{crossed} Hz on the page, {told} Hz told"
    );
    let margins = browser.see("#margins").await;
    assert!(
        margins.contains("dB at") && !margins.contains("As measured") && margins.contains("No record of small signals"),
        "{margins}"
    );
    let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let peak = said["feedback"]["peak_sensitivity"].as_f64().unwrap();
    assert!(
        largest(&nominal) <= largest(&worst) && largest(&worst) <= 1.001 * peak,
        "{} of {peak}",
        largest(&worst)
    );
}

#[test]
fn refuse_a_design_beyond_the_records_in_a_sentence_with_what_to_do() {
    if !there() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let server = Server::start(&session);
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"pi","plays":4}"#);
    let asked = |deed: &str| {
        let told = server.act(deed);
        told.json()["error"].as_str().unwrap_or_default().to_owned()
    };
    assert!(asked(r#"{"what":"track","along":{}}"#).contains("design one first"));
    assert!(asked(r#"{"what":"table","bench":{}}"#).contains("design one first"));
    server.act(r#"{"what":"design","wishes":{"open":true}}"#);
    let unknown = asked(r#"{"what":"track","along":{"stage":"mine"}}"#);
    assert_eq!(
        unknown,
        "there is no stage `mine`; the simulated ones are paper-rate, paper-delay, 8k, 2.5k, 739"
    );
    assert!(
        asked(r#"{"what":"design","wishes":{"volts_min":0}}"#)
            .contains("the lowest and the highest voltage, or neither")
    );
    assert!(asked(r#"{"what":"design","wishes":{"open":true,"margin":2}}"#).contains("without feedback"));
    in_browser(async {
        let browser = Browser::open(&format!("{}#controller", server.address()), true).await;
        browser.type_into("#design-volts_min", "0").await;
        browser.type_into("#design-volts_max", "260").await;
        browser.click("#design").await;
        let said = browser.see("#design-form #fault:not([hidden])").await;
        let printed = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
            .current_dir(&session)
            .args(["design", "models/1.toml", "--volts=0,260"])
            .assert()
            .code(2);
        let printed = String::from_utf8_lossy(&printed.get_output().stderr).into_owned();
        let words = |text: &str| {
            text.replace(['×', '│'], " ")
                .split_whitespace()
                .collect::<Vec<_>>()
                .join(" ")
        };
        assert_eq!(words(&printed), words(&said));
        assert!(
            said.contains(
                "the records cover 0 to 200 V; stay within with --volts LOW,HIGH, or record up to that voltage"
            ),
            "{said}"
        );
        browser.picture("controller-refused").await;
        browser.accessible("a refused design").await;
        // What was typed is there still, and a word makes it so; the file says it.
        let typed = "return document.querySelector('#design-volts_max').value";
        assert_eq!(browser.run(typed, vec![]).await, json!("260"));
        browser.click("#design-beyond_records").await;
        let said = design(&browser, &session, "BEYOND THE RECORDS: voltage 260 V").await;
        assert!(shines(&lights(&browser, &said).await, "Beyond the records", "look"));
        browser.close().await;
    });
}
