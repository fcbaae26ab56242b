//! Lost motion is told from the stage's own hysteresis by what follows a reversal, though the model's plays take it in.
#![expect(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use hysteron_data::{Dataset, Record, Role};
use hysteron_diagnose::diagnose;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_identify::{Family, FitOptions, fit};
use hysteron_plant::hysteresis::{DensityTerm, Hysteresis, Initial, Preisach};
use hysteron_plant::{Backlash, EndStop, Stage, StageConfig};
use std::f64::consts::TAU;

fn stage() -> StageConfig {
    let term = |threshold_v: f64, depth: f64, phase_rad: f64| DensityTerm {
        share: 1.0,
        threshold_v,
        depth,
        phase_rad,
    };
    let preisach = Preisach {
        loop_opening: 0.15,
        modulation_period_v: 150.0,
        terms: vec![term(5.0, 0.3, 1.0), term(25.0, 0.2, 1.5)],
    };
    let mut config = StageConfig::bare(Hysteresis {
        stroke_um: 10.0,
        reference_v: 100.0,
        initial: Initial::Conditioned,
        family: hysteron_plant::Family::Preisach(preisach),
    });
    config.sensor.noise_rms_um = 0.002;
    config
}

fn with_backlash(width_um: f64) -> StageConfig {
    StageConfig {
        backlash: Some(Backlash { width_um }),
        ..stage()
    }
}

/// A falling triangle and a sine of 1 Hz, full and half, and sums of harmonics; 3000 samples each.
fn dataset(config: &StageConfig) -> Dataset {
    let sine = |f: f64, size: f64, t: f64| size * 50.0 * (1.0 - (TAU * f * t).cos());
    let drive = |i: usize, t: f64| match i {
        0 => sine(1.0, 1.0, t),
        1 => sine(1.0, 0.5, t),
        2 => sine(1.0, 1.0, t) * (1.0 - t / 4.0),
        3 => sine(0.5, 0.8, t) + 8.0 * (1.0 - (TAU * 3.0 * t).cos()),
        4 => sine(50.0, 1.0, t),
        _ => sine(7.0, 0.9, t),
    };
    let records = (0..6).map(|i| {
        let period_s = if i == 4 { 1e-4 } else { 1e-3 };
        let voltage_v: Vec<f64> = (0..3000).map(|k| drive(i, f64::from(k) * period_s)).collect();
        let run = Stage::new(config, i as u64).unwrap().run(&voltage_v, period_s).unwrap();
        Record {
            file: format!("{i}.csv"),
            role: if [3, 5].contains(&i) {
                Role::Validate
            } else {
                Role::Identify
            },
            excitation: String::new(),
            start_s: 0.0,
            period_s,
            voltage_v,
            position_um: run.position_um,
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        }
    });
    Dataset {
        name: "slow".into(),
        records: records.collect(),
        ..Dataset::default()
    }
}

fn diagnosed(dataset: &Dataset) -> Diagnosis {
    let model = fit(dataset, &FitOptions::new(Family::Mpi), &|_| {}).unwrap().model;
    diagnose(dataset, &model, &|_, _| {})
}

fn named(found: &Diagnosis) -> bool {
    found.verdict == "backlash" || found.further.iter().any(|name| name == "backlash")
}

/// Half a percent to a twentieth of the stroke. The drive goes as far within the dead band as takes the same stage without one
/// through its width; sampled at 1 ms, a sine of 1 Hz moves by up to 2 % of the span meanwhile, and a half sine turns slowly.
#[test]
fn val_lost_motion_is_named_with_its_dead_band() {
    let sine = &dataset(&stage()).records[0];
    let top = sine.position_um.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for width_um in [0.06, 0.15, 0.5] {
        let after_the_top = (500..1000).find(|&k| sine.position_um[k] < top - width_um).unwrap();
        let band_v = 100.0 - sine.voltage_v[after_the_top];
        let found = diagnosed(&dataset(&with_backlash(width_um)));
        assert_eq!(found.verdict, "backlash", "{width_um} {:#?}", found.ranking);
        let entry = &found.ranking[0];
        let value = |i: usize| entry.parameters[i].value;
        assert!((value(0) / band_v - 1.0).abs() < 0.15, "{} V for {band_v}", value(0));
        assert!(value(1) > 0.95 * width_um, "{} um for {width_um}", value(1));
        assert!(entry.statistic > entry.threshold);
    }
}

/// What else keeps a position still: a stop holds it at one end, a coarse converter within each of its steps.
#[test]
fn val_a_stop_and_a_coarse_converter_lose_no_motion() {
    let plain = dataset(&stage());
    assert!(!named(&diagnosed(&plain)));
    let stopped = StageConfig {
        end_stop: Some(EndStop {
            min_um: -5.0,
            max_um: 8.0,
        }),
        ..stage()
    };
    assert!(!named(&diagnosed(&dataset(&stopped))));
    let mut coarse = plain;
    for record in &mut coarse.records {
        // Seven bits.
        record
            .position_um
            .iter_mut()
            .for_each(|y| *y = (*y / 0.08).round() * 0.08);
    }
    assert!(!named(&diagnosed(&coarse)));
}

/// Beside another effect it is named as well, one of the two as the verdict.
#[test]
fn val_lost_motion_beside_a_delay() {
    let both = StageConfig {
        delay_s: 300e-6,
        ..with_backlash(0.2)
    };
    let found = diagnosed(&dataset(&both));
    let all: Vec<&String> = found.further.iter().chain([&found.verdict]).collect();
    assert!(all.iter().any(|name| *name == "backlash"), "{all:?}");
    assert!(all.iter().any(|name| *name == "delay"), "{all:?}");
}
