//! `simulate`, `demo` and `paper` as a user meets them.

#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]

use assert_cmd::Command;
use hysteron_data::{Role, read_dataset};
use std::fs;
use std::path::Path;

fn hysteron() -> Command {
    Command::cargo_bin("hysteron").unwrap()
}

/// What a refused command says on standard error.
fn refused(args: &[&str]) -> String {
    let output = hysteron().args(args).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{args:?}");
    assert!(output.stdout.is_empty(), "{args:?}");
    // The error is wrapped to the terminal's width.
    let text = String::from_utf8(output.stderr).unwrap();
    text.replace(['│', '×'], " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn val_simulate_records_a_campaign_that_repeats() {
    let folder = tempfile::tempdir().unwrap();
    let (first, again) = (folder.path().join("a"), folder.path().join("b"));
    for place in [&first, &again] {
        hysteron()
            .args(["simulate", "--stage", "paper-rate", "-o"])
            .arg(place)
            .assert()
            .success();
    }
    let dataset = read_dataset(&first).unwrap();
    assert!(dataset.with_role(Role::Identify).count() >= 4 && dataset.with_role(Role::Validate).count() >= 2);
    // Half a sample of hold is all that the controller's builder knows of.
    assert!((dataset.known.delay_s.unwrap() - 10e-6).abs() < 1e-12);
    for record in &dataset.records {
        let bytes = |place: &Path| fs::read(place.join(&record.file)).unwrap();
        assert_eq!(bytes(&first), bytes(&again), "{}", record.file);
    }
}

#[test]
fn val_simulate_takes_what_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("stage");
    hysteron()
        .args([
            "simulate",
            "--stage",
            "paper-delay",
            "--rate",
            "10000",
            "--excitation",
            "sine:hz=100,periods=3",
        ])
        .args([
            "--excitation",
            "sine:hz=100,high_v=10,periods=2",
            "--validate",
            "rest:v=5,seconds=0.1",
            "-o",
        ])
        .arg(&place)
        .assert()
        .success();
    let dataset = read_dataset(&place).unwrap();
    let found: Vec<_> = dataset
        .records
        .iter()
        .map(|r| (r.file.as_str(), r.role, r.len(), r.period_s))
        .collect();
    assert_eq!(
        found,
        [
            ("sine-100hz.csv", Role::Identify, 300, 1e-4),
            ("sine-100hz-2.csv", Role::Identify, 200, 1e-4),
            // 20 ms of rise and 100 ms of rest.
            ("rest.csv", Role::Validate, 1200, 1e-4),
        ]
    );
    let sine = &dataset.records[0];
    let stroke_um = sine.position_um.iter().fold(0.0_f64, |most, &y| most.max(y));
    // The preset moves 2.6 um at 26 V.
    assert!((stroke_um - 2.6).abs() < 0.05, "{stroke_um}");
}

#[test]
fn refuse_simulate() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("stage").display().to_string();
    let simulate = |more: &[&str]| refused(&[&["simulate", "--stage", "paper-rate", "-o", &place], more].concat());
    assert_eq!(
        simulate(&["--rate", "1e6"]),
        "--rate 1000000: a number of hertz above 0 and at most 50000, the stage's controller"
    );
    assert!(simulate(&["--excitation", "saw"]).contains("`saw` is no excitation; there are sine, triangle"));
    assert!(simulate(&["--excitation", "sine:hz=20000"]).contains("sine.frequency_hz = 20000 must lie between"));
    assert!(!Path::new(&place).exists());
    hysteron()
        .args([
            "simulate",
            "--stage",
            "paper-rate",
            "--excitation",
            "sine",
            "-o",
            &place,
        ])
        .assert()
        .success();
    // A dataset that is there is not replaced unless that is asked for.
    simulate(&["--excitation", "sine"]);
    hysteron()
        .args([
            "simulate",
            "--stage",
            "paper-rate",
            "--excitation",
            "sine",
            "--overwrite",
            "-o",
            &place,
        ])
        .assert()
        .success();
}

/// The number behind a line's name.
fn figure(said: &str, line: &str, place: usize) -> f64 {
    let line = said.lines().find(|text| text.trim_start().starts_with(line)).unwrap();
    let percent: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    percent[percent.len() - 1 - place]
}

/// The demo hides creep, names it, and what it prints is what its page shows; the commands that it prints run.
#[test]
fn val_demo_finds_the_hidden_effect_and_undoes_it() {
    let folder = tempfile::tempdir().unwrap();
    let here = || {
        let mut command = hysteron();
        command.current_dir(folder.path()).env_remove("CARGO_MANIFEST_DIR");
        command
    };
    let output = here().arg("demo").output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8(output.stdout).unwrap();
    let page = fs::read_to_string(folder.path().join("hysteron-demo/demo.html")).unwrap();
    assert!(
        said.contains("+ creep") && said.contains("hidden was: creep of 3.54 %"),
        "{said}"
    );
    // Creep of 3.5 % a decade is some percent of the model's error; the noise is a hundredth of a percent.
    let (before, after, noise) = (
        figure(&said, "play-polynomial", 0),
        figure(&said, "+ creep", 0),
        figure(&said, "noise floor", 0),
    );
    assert!(before > 1.0 && after < 0.1 * before && after < 15.0 * noise, "{said}");
    // Without its compensator a hold creeps away; with it the error is a tenth at most.
    let (with, without) = (figure(&said, "hold of 4 s", 0), figure(&said, "hold of 4 s", 1));
    assert!(with < 0.1 * without, "{said}");
    assert_eq!(page.matches("role=\"img\"").count(), 6);
    assert_eq!(page.matches("<figcaption").count(), 6);
    assert!(!page.contains("src=\"http") && !page.contains("<script"));
    let next: Vec<&str> = said.lines().skip_while(|line| *line != "next:").skip(1).collect();
    assert_eq!(next.len(), 3, "{said}");
    for command in next {
        assert!(page.contains(command.trim()), "{command}");
        let words: Vec<&str> = command.split_whitespace().collect();
        assert_eq!(words[0], "hysteron");
        here().args(&words[1..]).assert().success();
    }
    // Started by cargo, it prints what can be typed there.
    let output = hysteron()
        .arg("example")
        .env("CARGO_MANIFEST_DIR", "/x")
        .output()
        .unwrap();
    assert!(String::from_utf8(output.stdout).unwrap().contains("next: cargo run"));
}

#[test]
fn refuse_demo() {
    let said = refused(&["demo", "--effect", "gravity"]);
    assert!(said.contains("gravity") && said.contains("creep"), "{said}");
}

#[test]
fn val_help_has_an_example() {
    for command in ["simulate", "demo", "paper"] {
        let output = hysteron().args([command, "--help"]).output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        let help = String::from_utf8(output.stdout).unwrap();
        assert!(
            help.contains("Example") && help.contains(&format!("hysteron {command}")),
            "{help}"
        );
    }
}

#[test]
fn refuse_paper() {
    assert!(refused(&["paper", "--seed", "x"]).contains("invalid value 'x' for '--seed <SEED>'"));
}

/// What examples/is-rate-dependence-a-delay says: sines of one amplitude cannot tell; with a decaying triangle and a multisine they tell a
/// lag, and a rate dependence stays in a set.
#[test]
fn val_sines_of_one_amplitude_cannot_tell_a_delay_from_a_rate_dependence() {
    let folder = tempfile::tempdir().unwrap();
    let answer = |stage: &str, more: &[&str]| -> serde_json::Value {
        let sines = [
            "sine:hz=10,periods=3",
            "sine:hz=100,periods=5",
            "sine:hz=500,periods=10",
        ];
        let judged = ["sine:hz=200,periods=6", "complex-harmonic:hz=100,periods=5"];
        let identify = sines.iter().chain(more).flat_map(|e| ["--excitation", *e]);
        let validate = judged.iter().flat_map(|e| ["--validate", *e]);
        let run = |args: &[&str]| hysteron().current_dir(&folder).args(args).assert().success();
        let mut simulate = vec!["simulate", "--stage", stage, "--seed", "1", "--overwrite", "-o", "data"];
        simulate.extend(identify.chain(validate));
        run(&simulate);
        run(&["fit", "data", "--model", "mpi", "-o", "model.toml"]);
        let said = run(&["diagnose", "data", "model.toml", "--json"]);
        serde_json::from_slice(&said.get_output().stdout).unwrap()
    };
    let rivals = ["delay", "first-order-lag", "rate-dependence"];
    let more = [
        "decaying-triangle:high_v=26,centre_v=13",
        "multisine:low_hz=20,high_hz=4000,period_s=0.1,periods=3,bias_v=13,peak_v=4",
    ];
    let set = |said: &serde_json::Value| -> Vec<String> {
        let others = said["also_possible"].as_array().unwrap().iter();
        let mut set: Vec<String> = others
            .chain([&said["verdict"]])
            .map(|name| name.as_str().unwrap().to_owned())
            .collect();
        set.sort_unstable();
        set
    };
    for stage in ["paper-rate", "paper-delay"] {
        assert_eq!(set(&answer(stage, &[])), rivals, "{stage}");
    }
    // The multisine rides where plays stand still: what turns its phase all the same is no rate dependence.
    let said = answer("paper-delay", &more);
    assert_eq!(set(&said), ["first-order-lag"]);
    // A rate dependence, 20 us of amplifier lag and a mode are three effects, and what one of them leaves is larger than what tells them apart.
    let said = answer("paper-rate", &more);
    assert_eq!(set(&said), rivals);
    assert_eq!(said["shape_determined"], true);
}
