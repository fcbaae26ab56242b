//! The real binary as a user meets it: answers, exit codes, errors, pipes.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

use assert_cmd::Command;
use hysteron_data::{Dataset, Overwrite, Record, Role, write_dataset};
use hysteron_plant::{Stage, preset};
use serde_json::Value;
use std::path::Path;

fn hysteron() -> Command {
    Command::new(env!("CARGO_BIN_EXE_hysteron"))
}

/// A small dataset of the simulated stage: two sines to identify, one to validate.
fn stage_dataset(folder: &Path) {
    let records = [
        (100.0, Role::Identify),
        (200.0, Role::Identify),
        (125.0, Role::Validate),
    ]
    .map(|(f, role)| {
        let period_s = 2e-5;
        let a_period = (1.0 / f / period_s) as usize;
        let drive = |k: usize| 13.0 - 13.0 * (std::f64::consts::TAU * k as f64 / a_period as f64).cos();
        let voltage_v: Vec<f64> = (0..3 * a_period).map(drive).collect();
        let mut stage = Stage::new(&preset::paper_rate(), 1).unwrap();
        let run = stage.run(&voltage_v, period_s).unwrap();
        Record {
            file: format!("sine-{f}hz.csv"),
            role,
            excitation: format!("sine {f} Hz"),
            start_s: 0.0,
            period_s,
            voltage_v,
            position_um: run.position_um,
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        }
    });
    let dataset = Dataset {
        name: "stage".into(),
        records: records.to_vec(),
        ..Dataset::default()
    };
    write_dataset(&dataset, folder, Overwrite::Refuse).unwrap();
}

/// A folder with `stage/` and `model.toml` in it.
fn fitted() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    stage_dataset(&folder.path().join("stage"));
    hysteron()
        .current_dir(&folder)
        .args(["fit", "stage", "--model", "mrpi", "-o", "model.toml"])
        .assert()
        .success();
    folder
}

fn stderr_of(folder: &Path, arguments: &[&str], code: i32) -> String {
    let output = hysteron()
        .current_dir(folder)
        .args(arguments)
        .assert()
        .code(code)
        .get_output()
        .clone();
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(!text.contains("panicked"), "{arguments:?}: {text}");
    // miette folds long lines.
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn val_help_of_every_command_has_an_example() {
    let help = hysteron().arg("--help").assert().success().get_output().stdout.clone();
    let help = String::from_utf8(help).unwrap();
    let listed = help
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|l| !l.is_empty());
    let commands: Vec<&str> = listed
        .filter_map(|line| line.split_whitespace().next())
        .filter(|c| *c != "help")
        .collect();
    for needed in ["import", "simulate", "fit", "compare", "paper", "demo"] {
        assert!(commands.contains(&needed), "{needed} is not in {commands:?}");
    }
    for command in commands {
        let text = hysteron()
            .args([command, "--help"])
            .assert()
            .success()
            .get_output()
            .stdout
            .clone();
        let text = String::from_utf8(text).unwrap();
        assert!(
            text.contains("Example") && text.contains(&format!("hysteron {command}")),
            "{command}: {text}"
        );
    }
}

#[test]
fn val_compare_json_has_what_programs_rely_on() {
    let folder = fitted();
    let output = hysteron()
        .current_dir(&folder)
        .args(["compare", "stage", "model.toml", "--json"])
        .assert()
        .success();
    let answer: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert!(answer["noise_rms_um"].as_f64().unwrap() > 0.0);
    assert!(answer["noise"]["words"].is_string());
    for role in ["identify", "validate"] {
        for figure in ["nrmse_percent", "fit_percent"] {
            assert!(answer[role][figure].is_f64(), "{role}.{figure}");
        }
    }
    let records = answer["records"].as_array().unwrap();
    assert_eq!(records.len(), 3);
    for key in [
        "file",
        "role",
        "nrmse_percent",
        "fit_percent",
        "rms_um",
        "max_um",
        "samples",
    ] {
        assert!(!records[0][key].is_null(), "{key}");
    }
    assert!(!answer["where"].as_array().unwrap().is_empty());
    // Pooled is the root mean square over records, here two.
    let percent: Vec<f64> = records[..2]
        .iter()
        .map(|r| r["nrmse_percent"].as_f64().unwrap())
        .collect();
    let pooled = ((percent[0].powi(2) + percent[1].powi(2)) / 2.0).sqrt();
    assert!((answer["identify"]["nrmse_percent"].as_f64().unwrap() - pooled).abs() < 1e-9);
}

#[test]
fn val_exit_codes() {
    let folder = fitted();
    let with_limit = |limit: &str, code: i32| {
        let arguments = ["compare", "stage", "model.toml", "--fail-above", limit];
        hysteron().current_dir(&folder).args(arguments).assert().code(code);
    };
    with_limit("50", 0);
    with_limit("0", 1);
    with_limit("-1", 2);
    with_limit("nan", 2);
    hysteron().assert().code(2);
    hysteron().arg("fitt").assert().code(2);
}

#[test]
fn val_pages_are_the_same_bytes_and_name_no_host() {
    let folder = fitted();
    let page = |name: &str| {
        hysteron()
            .current_dir(&folder)
            .args(["compare", "stage", "model.toml", "-o", "page.html"])
            .assert()
            .success();
        std::fs::rename(folder.path().join("page.html"), folder.path().join(name)).unwrap();
        std::fs::read_to_string(folder.path().join(name)).unwrap()
    };
    let (first, second) = (page("a.html"), page("b.html"));
    assert_eq!(first, second);
    assert!(first.contains("<svg") && first.matches("http").count() == first.matches("http://www.w3.org/").count());
}

#[test]
fn val_every_model_runs_both_ways() {
    let folder = fitted();
    for model in ["pi", "mpi", "wrpi", "mrpi", "play-polynomial"] {
        for direction in ["forward", "inverse"] {
            let arguments = [
                "fit",
                "stage",
                "--model",
                model,
                "--direction",
                direction,
                "-o",
                "m.toml",
                "--json",
            ];
            let output = hysteron().current_dir(&folder).args(arguments).assert().success();
            let answer: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
            assert_eq!(answer["model"], model);
            hysteron()
                .current_dir(&folder)
                .args(["compare", "stage", "m.toml", "--fail-above", "6"])
                .assert()
                .success();
        }
    }
}

#[test]
fn val_a_reader_that_has_gone_is_no_error() {
    use std::process::{Command, Stdio};
    let folder = fitted();
    let mut child = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(&folder)
        .args(["compare", "stage", "model.toml", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn val_import_fit_compare() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = String::from("Rig 7; 20 C\r\nZeit [ms];Spannung [V];Weg [nm]\r\n");
    for k in 0..400 {
        let x = f64::from(k) / 100.0 * std::f64::consts::TAU;
        let (v, y) = (10.0 - 10.0 * x.cos(), 1000.0 - 1000.0 * (x - 0.15).cos());
        table += &format!("{};{v:.6};{y:.4}\r\n", f64::from(k) * 0.02).replace('.', ",");
    }
    std::fs::write(folder.path().join("rig.csv"), table).unwrap();
    let run = |arguments: &[&str]| hysteron().current_dir(&folder).args(arguments).assert().success();
    run(&["import", "rig.csv", "--dry-run"]);
    assert!(!folder.path().join("stage").exists());
    run(&["import", "rig.csv", "-o", "stage"]);
    run(&["fit", "stage", "--model", "pi", "-o", "model.toml"]);
    run(&["compare", "stage", "model.toml"]);
    let refused = stderr_of(folder.path(), &["import", "rig.csv", "-o", "stage"], 2);
    assert!(
        refused.contains("--overwrite") || refused.contains("already"),
        "{refused}"
    );
}

#[test]
fn val_a_record_is_appended_to_a_dataset_that_is_there() {
    let folder = fitted();
    let before = std::fs::read(folder.path().join("stage/dataset.toml")).unwrap();
    let there = hysteron_data::read_dataset(&folder.path().join("stage")).unwrap();
    let first = there.records[0].file.clone();
    std::fs::copy(folder.path().join("stage").join(&first), folder.path().join(&first)).unwrap();
    let append = ["import", "--validate", first.as_str(), "--append", "-o"];
    // Nothing is appended to what is no dataset, and nothing is half appended.
    let refused = stderr_of(folder.path(), &[&append[..], &["elsewhere"]].concat(), 2);
    assert!(refused.contains("no dataset.toml"), "{refused}");
    assert_eq!(std::fs::read(folder.path().join("stage/dataset.toml")).unwrap(), before);
    assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(folder.path())
        .args([&append[..], &["stage"]].concat())
        .assert()
        .success();
    let now = hysteron_data::read_dataset(&folder.path().join("stage")).unwrap();
    assert_eq!(now.records[..there.records.len()], there.records[..]);
    let added = now.records.last().unwrap();
    assert_eq!(
        (added.file.as_str(), added.role, &added.position_um),
        (
            format!("{}-2.csv", first.trim_end_matches(".csv")).as_str(),
            hysteron_data::Role::Validate,
            &there.records[0].position_um
        )
    );
}

#[test]
fn refuse_bad_input_with_what_to_do() {
    let folder = fitted();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("broken.csv"), "time_s,voltage_v,position_um\n0,0,0\n0.1,x,0\n").unwrap();
    std::fs::write(at("short.csv"), "time_s,voltage_v,position_um\n0,0,0\n0.1,1,0\n").unwrap();
    std::fs::write(at("bad.toml"), "format = 1\n").unwrap();
    let check = |arguments: &[&str], parts: &[&str]| {
        let text = stderr_of(folder.path(), arguments, 2);
        for part in parts {
            assert!(text.contains(part), "{arguments:?}: `{part}` is not in: {text}");
        }
    };
    check(&["fit", "nowhere", "--model", "pi"], &["nowhere"]);
    check(
        &["fit", "broken.csv", "--model", "pi"],
        &["broken.csv", "line 3", "`x`"],
    );
    check(
        &["fit", "short.csv", "--model", "pi"],
        &["2 samples cannot determine 12 parameters"],
    );
    check(
        &["fit", "stage", "--model", "pi", "--plays", "65"],
        &["65 plays asked for; allowed are 1 to 64"],
    );
    check(&["fit", "stage", "--model", "xyz"], &["xyz", "play-polynomial"]);
    check(&["compare", "stage", "bad.toml"], &["bad.toml", "missing field"]);
    check(&["compare", "stage", "nowhere.toml"], &["nowhere.toml"]);
    check(
        &["compare", "stage", "model.toml", "-o", "model.toml/page.html"],
        &["page.html"],
    );
    check(&["import", "short.csv", "-o", "x", "--rate", "-5"], &["--rate"]);
}
