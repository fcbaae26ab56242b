//! A stage of another family than the models, and its records.
#![allow(dead_code, reason = "each test takes what it needs")]

use hysteron_data::{Dataset, Record, Role};
use hysteron_plant::StageConfig;
use hysteron_plant::hysteresis::{DensityTerm, Hysteresis, Initial, Preisach};
use std::f64::consts::TAU;

/// Of a Preisach density: its threshold, volts, depth and phase, radians.
pub(crate) fn term(threshold_v: f64, depth: f64, phase_rad: f64) -> DensityTerm {
    DensityTerm {
        share: 1.0,
        threshold_v,
        depth,
        phase_rad,
    }
}

/// 10 um at 100 V, loops of 15 %, and nothing else but the sensor's noise.
pub(crate) fn stage(terms: Vec<DensityTerm>, noise_rms_um: f64) -> StageConfig {
    let preisach = Preisach {
        loop_opening: 0.15,
        modulation_period_v: 150.0,
        terms,
    };
    let mut config = StageConfig::bare(hysteresis(hysteron_plant::Family::Preisach(preisach)));
    config.sensor.noise_rms_um = noise_rms_um;
    config
}

pub(crate) fn hysteresis(family: hysteron_plant::Family) -> Hysteresis {
    Hysteresis {
        stroke_um: 10.0,
        reference_v: 100.0,
        initial: Initial::Conditioned,
        family,
    }
}

/// From 0 V, six of them: sines of two amplitudes, sums of harmonics.
pub(crate) fn drive(i: usize, t: f64) -> f64 {
    let sine = |f: f64, size: f64| size * 50.0 * (1.0 - (TAU * f * t).cos());
    let mixed = |f: f64| {
        let rise = 25.0 * (1.0 - (TAU * f * t / 2.0).min(TAU / 2.0).cos());
        rise + 12.0 * ((TAU * f * t).sin() + (3.0 * TAU * f * t).sin() + 0.6 * (11.0 * TAU * f * t).sin())
    };
    match i {
        0 => sine(10.0, 1.0),
        1 => sine(10.0, 0.4),
        2 => sine(200.0, 1.0),
        3 => mixed(40.0),
        4 => sine(100.0, 0.8),
        _ => mixed(30.0),
    }
}

/// A record without columns of its own.
pub(crate) fn record(name: &str, role: Role, period_s: f64, voltage_v: Vec<f64>, position_um: Vec<f64>) -> Record {
    Record::new(format!("{name}.csv"), role, period_s, voltage_v, position_um)
}

pub(crate) fn dataset(records: impl Iterator<Item = Record>) -> Dataset {
    Dataset {
        name: "small".into(),
        records: records.collect(),
        ..Dataset::default()
    }
}
