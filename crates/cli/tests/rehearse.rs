//! The whole way: a stage with a hidden effect is recorded, the effect learned and compensated, and the true position
//! follows better for it. Stage and model share no code; nothing but records goes from one to the other.
#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]
#![expect(clippy::print_stdout, reason = "a failed figure needs its table")]

use assert_cmd::Command;
use serde_json::Value;

/// An effect dominates a reference's error where it makes it at least so many times what the hysteresis alone leaves.
const DOMINATES: f64 = 6.0;
/// So many times lower the error has to be there.
const LOWER: f64 = 5.0;
/// Sensor noise and converters move the error of a run by some thousandths of a percent; it may not rise by more.
const NOISE_PERCENT: f64 = 0.01;

fn errors(errors: &Value) -> Vec<(String, f64)> {
    let errors = errors.as_object().unwrap();
    errors
        .iter()
        .map(|(key, value)| (key.clone(), value.as_f64().unwrap()))
        .collect()
}

fn learned_and_compensated(effect: &str, seed: u64) {
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .args(["rehearse", effect, "--seed", &seed.to_string(), "--json"])
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
    for ((key, before), (_, after)) in before.iter().zip(&after) {
        let without = answer["without_effect_percent"][key].as_f64().unwrap();
        assert!(
            *after <= before + NOISE_PERCENT,
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
}

#[test]
fn val_delay_is_learned_and_compensated() {
    learned_and_compensated("delay", 1);
}

#[test]
fn val_lag_is_learned_and_compensated() {
    learned_and_compensated("first-order-lag", 1);
}

#[test]
fn val_other_axis_is_learned_and_compensated() {
    learned_and_compensated("cross-coupling", 1);
}

#[test]
fn val_hum_is_learned_and_compensated() {
    learned_and_compensated("mains-hum", 1);
}
