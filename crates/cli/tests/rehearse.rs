//! The whole way: a stage with a hidden effect is recorded, the effect learned and compensated, and the true position
//! follows better for it. Stage and model share no code; nothing but records goes from one to the other.
#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]
#![expect(clippy::print_stdout, reason = "a failed figure needs its table")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

#[path = "../../board/tests/common/mod.rs"]
mod emulator;

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

/// An effect dominates a reference's error where it makes it at least so many times what the hysteresis alone leaves.
const DOMINATES: f64 = 6.0;
/// So many times lower the error has to be there.
const LOWER: f64 = 5.0;
/// Sensor noise and converters move the error of a run by some thousandths of a percent; it may not rise by more above what it was, or
/// what the hysteresis alone leaves.
const NOISE_PERCENT: f64 = 0.01;

fn errors(errors: &Value) -> Vec<(String, f64)> {
    let errors = errors.as_object().unwrap();
    errors
        .iter()
        .map(|(key, value)| (key.clone(), value.as_f64().unwrap()))
        .collect()
}

/// The answer of a rehearsal in which the effect is named and compensated.
fn learned_and_compensated(effect: &str, seed: u64, options: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .args(["rehearse", effect, "--seed", &seed.to_string(), "--json"])
        .args(options)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{effect}, seed {seed}: {said}");
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("{answer:#}");
    assert_eq!(answer["named"], true, "{effect}, seed {seed} was not named");
    let rungs = answer["rungs"].as_array().unwrap();
    let last = rungs.iter().rfind(|rung| rung["loop"] == "open").unwrap();
    let (before, after) = (
        errors(&answer["without_compensator_percent"]),
        errors(&last["tracking_percent"]),
    );
    let mut dominated = 0;
    // Of four references one may come out lower by chance.
    let without = errors(&answer["without_effect_percent"]);
    let without = without.iter().map(|(_, percent)| *percent).fold(0.0, f64::max);
    for ((key, before), (_, after)) in before.iter().zip(&after) {
        assert!(
            *after <= before.max(without) + NOISE_PERCENT,
            "{effect}, seed {seed}, {key}: {before} % before, {after} % after"
        );
        if *before >= DOMINATES * without {
            dominated += 1;
            assert!(
                LOWER * after <= *before,
                "{effect}, seed {seed}, {key}: {before} % before, {after} % after, {without} % where nothing is hidden"
            );
        }
    }
    assert!(dominated > 0, "{effect}, seed {seed} dominates nowhere");
    answer
}

/// In records of 100 samples a second its harmonics lie on one another.
#[test]
fn val_hum_is_learned_and_compensated() {
    learned_and_compensated("mains-hum", 3, &[]);
}

#[test]
fn val_creep_is_learned_and_compensated() {
    learned_and_compensated("creep", 1, &[]);
}

/// Records and runs of the firmware in the emulator: a plain image plays the records, images of the designed controllers track.
fn on_the_chip(effect: &str, kept: &Path) -> Option<Value> {
    emulator::image("mps2-an386")?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let (kept, firmware) = (kept.display().to_string(), root.join("firmware").display().to_string());
    let options = ["--emulator", "mps2-an386", "--firmware", &firmware, "-o", &kept];
    let answer = learned_and_compensated(effect, 1, &options);
    // The loop ran at the sample clock, in time.
    assert!(answer["clocked_ticks"].as_u64().unwrap() > 10_000);
    assert_eq!(answer["late_ticks"], 0);
    Some(answer)
}

#[test]
fn val_lag_is_learned_and_compensated_on_the_chip() {
    let folder = tempfile::tempdir().unwrap();
    let Some(answer) = on_the_chip("first-order-lag", folder.path()) else {
        return;
    };
    // f32 and converters beside f64: a step of the converter is 0.3 nm of a range of 8.7 um, 0.004 %, and the noise of the sensor
    // does not matter in open loop.
    let rungs = answer["rungs"].as_array().unwrap();
    let open = rungs.iter().rfind(|rung| rung["loop"] == "open").unwrap();
    for (key, here) in errors(&answer["host_percent"]) {
        let there = open["tracking_percent"][&key].as_f64().unwrap();
        assert!(
            (there - here).abs() < 0.01,
            "{key}: {there} % on the chip, {here} % on the host"
        );
    }
    // Each step of the ladder has an error of the model, and the last is the lowest.
    let of_model = |rung: &Value| rung["model_percent"].as_f64().unwrap();
    assert!(of_model(open) < 0.2 * of_model(&rungs[0]), "{rungs:?}");
    assert!(folder.path().join("board/trained-closed.toml").is_file());
}

/// Images of both axes: while one records and tracks, the other moves by a straight line, and the law is told its command.
#[test]
fn val_other_axis_is_learned_and_compensated_on_the_chip() {
    let folder = tempfile::tempdir().unwrap();
    if on_the_chip("cross-coupling", folder.path()).is_some() {
        assert!(folder.path().join("board/other-axis.toml").is_file());
    }
}

#[test]
fn refuse_rehearsals_without_a_firmware() {
    let refused = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hysteron"));
        let output = command.arg("rehearse").args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let said = String::from_utf8_lossy(&output.stderr).replace(['│', '×'], " ");
        said.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let said = refused(&["delay", "--emulator", "mps2-an386", "--firmware", "nowhere"]);
    assert!(said.contains("nowhere: no sources of the firmware"), "{said}");
    let said = refused(&["delay", "--firmware", "firmware"]);
    assert!(said.contains("--emulator"), "{said}");
}
