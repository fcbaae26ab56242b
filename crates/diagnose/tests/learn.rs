//! Learning by itself on small simulated datasets: two hidden effects, none, and records that cannot answer.
#![expect(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod records;

use hysteron_data::{Dataset, Record, Role};
use hysteron_diagnose::diagnosis::Reason;
use hysteron_diagnose::{Learned, Stop, ladder, learn, learn_from};
use hysteron_identify::{Change, EffectId, Family, FitOptions, fit};
use hysteron_plant::hysteresis::MaxwellSlip;
use hysteron_plant::{CrossCoupling, Stage, StageConfig};
use records::{drive, hysteresis, record};
use std::f64::consts::TAU;

const PERIOD_S: f64 = 5e-5;

fn stage() -> StageConfig {
    let slip_v: Vec<f64> = (0..30).map(|i| 1.0 * 1.14_f64.powi(i)).collect();
    let family = hysteron_plant::Family::MaxwellSlip(MaxwellSlip {
        loop_opening: 0.13,
        stiffness: slip_v.iter().map(|_| 1.0).collect(),
        slip_v,
    });
    let mut config = StageConfig::bare(hysteresis(family));
    // 0.02 % of the stroke, a good capacitive sensor.
    config.sensor.noise_rms_um = 0.002;
    config
}

/// Records from 0 V: sines of two amplitudes, sums of harmonics; two for validation. The other axis moves at 23 Hz.
fn dataset(config: &StageConfig) -> Dataset {
    let records = (0..6_usize).map(|i| {
        let time = |k: u32| f64::from(k) * PERIOD_S;
        let voltage_v: Vec<f64> = (0..4000).map(|k| drive(i, time(k))).collect();
        let other: Vec<f64> = (0..4000)
            .map(|k| 40.0 * (1.0 - (TAU * (23.0 + i as f64) * time(k)).cos()))
            .collect();
        let mut stage = Stage::new(config, 1 + i as u64).unwrap();
        let run = stage.run_two_axes(&voltage_v, &other, PERIOD_S).unwrap();
        let role = if i < 4 { Role::Identify } else { Role::Validate };
        Record {
            voltage2_v: Some(other),
            ..record(&i.to_string(), role, PERIOD_S, voltage_v, run.position_um)
        }
    });
    records::dataset(records)
}

fn two_hidden() -> StageConfig {
    StageConfig {
        delay_s: 80e-6,
        cross_coupling: Some(CrossCoupling {
            ratio: 0.03,
            lag_s: 0.0,
            hysteresis: hysteresis(hysteron_plant::Family::Linear),
            mode: None,
        }),
        ..stage()
    }
}

fn effects(learned: &Learned) -> Vec<&str> {
    learned
        .model
        .effects
        .iter()
        .map(|effect| effect.name.as_str())
        .collect()
}

fn last_percent(learned: &Learned) -> f64 {
    learned.model.history.last().unwrap().validate_percent.unwrap()
}

#[test]
fn val_two_hidden_effects_are_learned_one_after_the_other() {
    let dataset = dataset(&two_hidden());
    let learned = learn(&dataset, &FitOptions::new(Family::Mpi), &|_, _| {}).unwrap();
    let mut found = effects(&learned);
    found.retain(|name| *name != "hysteresis-shape");
    assert_eq!(found, ["delay", "cross-coupling"], "{:#?}", learned.attempts);
    let delay_s = learned.model.effects[0].parameters[0].value;
    assert!((delay_s - 80e-6).abs() < 4e-6, "{delay_s}");
    // The same family on the same stage without the two.
    let bare = self::dataset(&stage());
    let known = fit(&bare, &FitOptions::new(Family::Mpi), &|_| ()).unwrap().model;
    let known = hysteron_diagnose::compare(&bare, &known, &|_| ());
    let known = known.validate.unwrap().nrmse_percent;
    assert!(
        last_percent(&learned) < 1.5 * known,
        "{} {known}",
        last_percent(&learned)
    );
    let ladder = ladder(&learned.model).unwrap();
    // The floor is the sensor's 2 nm and the rounding of its converter (50 um in 16 bits: 0.22 nm), which the plays do not reach.
    let noise = ladder.noise.unwrap();
    assert!((noise.rms_um / 2e-3 - 1.0).abs() < 0.08, "{noise}");
    assert!(
        ladder
            .steps
            .windows(2)
            .all(|pair| pair[1].percent() <= pair[0].percent().map(|p| 1.02 * p))
    );
}

#[test]
fn val_an_effect_that_a_later_one_makes_superfluous_is_taken_out() {
    let dataset = dataset(&StageConfig {
        cross_coupling: two_hidden().cross_coupling,
        ..stage()
    });
    let start = fit(&dataset, &FitOptions::new(Family::Mpi), &|_| ()).unwrap().model;
    // Hum at 50 Hz takes up a part of what comes from the other axis, until that is there itself.
    let hum = hysteron_diagnose::add(&dataset, &start, EffectId::MainsHum, &|_| ())
        .unwrap()
        .model;
    let learned = learn_from(&dataset, hum, &|_, _| {}).unwrap();
    assert_eq!(
        effects(&learned)[0],
        "cross-coupling",
        "{:#?} {:?}",
        learned.attempts,
        learned.stop
    );
    assert!(!effects(&learned).contains(&"mains-hum"), "{:#?}", learned.attempts);
    let removed = |step: &hysteron_identify::Step| {
        step.change == Change::Removed && step.what.effect().is_some_and(|name| *name == EffectId::MainsHum)
    };
    assert!(learned.model.history.iter().any(removed));
}

#[test]
fn refuse_to_learn_from_records_that_cannot_answer() {
    let mut dataset = dataset(&two_hidden());
    let noise = [3.0, -2.0, 1.0, -3.0, 2.0, -1.0];
    for record in &mut dataset.records {
        record
            .position_um
            .iter_mut()
            .zip(noise.iter().cycle())
            .for_each(|(y, e)| *y += e);
    }
    dataset.known.sensor_noise_um = Some(2.2);
    let learned = learn(&dataset, &FitOptions::new(Family::Mpi), &|_, _| {}).unwrap();
    let reasons = vec![Reason::AllNoise];
    assert_eq!(learned.stop, Stop::CannotTell { reasons });
    assert!(learned.model.effects.is_empty() && learned.attempts.is_empty());
}
