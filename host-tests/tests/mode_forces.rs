//! Forces inside a mode that are no straight line, on systems made from their published equations: named, and learned down to the noise.
#![allow(clippy::unwrap_used, reason = "a test that cannot make its data fails")]

use host_tests::benchmark::System;
use host_tests::users::tool;
use hysteron_data::{Dataset, Role};
use hysteron_identify::Family;

/// Two records to learn from and one to judge on, their first samples.
fn short(system: System, samples: usize) -> Dataset {
    let mut dataset = system.benchmark(5).dataset;
    dataset.records.truncate(5);
    dataset.records.drain(2..4);
    for record in &mut dataset.records {
        record.voltage_v.truncate(samples);
        record.position_um.truncate(samples);
    }
    dataset
}

/// Rms error on the record to judge on after `learn`, micrometres, and the effects.
fn learned(system: System) -> (f64, Vec<String>) {
    let dataset = short(system, 3000);
    let start = tool::start(&dataset, Family::Mpi).unwrap();
    let (model, effects) = tool::learned(&dataset, start).unwrap();
    let judged = dataset.with_role(Role::Validate).next().unwrap();
    let modelled = model.simulate(judged).output;
    let squares = judged.position_um.iter().zip(&modelled).map(|(y, m)| (y - m).powi(2));
    ((squares.sum::<f64>() / judged.len() as f64).sqrt(), effects)
}

/// The test record has no noise: 1.2 times the noise of training is what a straight mode misses by a factor of 300.
#[test]
fn val_a_spring_that_hardens_is_named() {
    let (left_um, effects) = learned(System::Duffing);
    assert_eq!(effects, ["nonlinear-stiffness"]);
    assert!(left_um < 1.2 * 0.05, "{left_um}");
}

/// 3e-5 m, where a straight mode leaves 1.6e-4.
#[test]
fn val_hysteresis_in_a_mode_is_named() {
    let (left_um, effects) = learned(System::BoucWen);
    assert_eq!(effects, ["mode-hysteresis"]);
    assert!(left_um < 30.0, "{left_um}");
}

/// The form is not ours: a smooth sign, and a bump of another shape. A lag leaves 31.
#[test]
fn val_friction_of_a_drive_is_named() {
    let (left_um, effects) = learned(System::Friction);
    assert!(effects.iter().any(|effect| effect == "friction"), "{effects:?}");
    assert!(left_um < 8.0, "{left_um}");
}
