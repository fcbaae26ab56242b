//! Verdicts on small simulated datasets: a stack of another family, six records, one effect.
#![expect(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod records;

use hysteron_data::{Dataset, Record, Role};
use hysteron_diagnose::diagnose;
use hysteron_diagnose::diagnosis::{Diagnosis, Reason};
use hysteron_identify::{EffectId, EffectName, Family, FitOptions, Model, fit};
use hysteron_plant::{Backlash, EndStop, Stage, StageConfig};
use records::{drive, record, term};
use std::f64::consts::TAU;

const PERIOD_S: f64 = 5e-5;

fn stage() -> StageConfig {
    // 0.02 % of the stroke, a good capacitive sensor.
    records::stage(vec![term(5.0, 0.3, 1.0), term(25.0, 0.2, 1.5)], 0.002)
}

/// Records from 0 V: sines of two amplitudes, sums of harmonics; two for validation.
fn dataset(config: &StageConfig, seed: u64) -> Dataset {
    played(config, seed, [4, 5], |_| PERIOD_S, 4000, drive)
}

/// Six records of a drive, those of the given numbers for validation, each with a period of its own.
fn played(
    config: &StageConfig,
    seed: u64,
    validate: [usize; 2],
    period_s: impl Fn(usize) -> f64,
    samples: u32,
    drive: impl Fn(usize, f64) -> f64,
) -> Dataset {
    let records = (0..6).map(|i| {
        let period_s = period_s(i);
        let voltage_v: Vec<f64> = (0..samples).map(|k| drive(i, f64::from(k) * period_s)).collect();
        let mut stage = Stage::new(config, seed + i as u64).unwrap();
        let run = stage.run(&voltage_v, period_s).unwrap();
        let role = if validate.contains(&i) {
            Role::Validate
        } else {
            Role::Identify
        };
        record(&i.to_string(), role, period_s, voltage_v, run.position_um)
    });
    records::dataset(records)
}

fn delayed(seed: u64) -> Dataset {
    dataset(
        &StageConfig {
            delay_s: 80e-6,
            ..stage()
        },
        seed,
    )
}

fn model(dataset: &Dataset) -> Model {
    fit(dataset, &FitOptions::new(Family::Mpi), &|_| {}).unwrap().model
}

#[test]
fn val_a_delay_is_named_with_its_size() {
    let dataset = delayed(1);
    let found = diagnose(&dataset, &model(&dataset), &|_, _| {});
    assert_eq!(found.verdict.as_str(), "delay", "{:#?}", found.ranking);
    assert_eq!(found.known_delay_s, None);
    let delay_s = found.delay_s().unwrap();
    // At 200 Hz the position moves by up to 6 um/ms: 0.1 % of the stroke, the coarseness of the free shape, is 1.6 us.
    assert!((delay_s - 80e-6).abs() < 1.6e-6, "{delay_s}");
    let before = found.before.validate_percent.unwrap();
    assert!(
        found.ranking[0].errors.validate_percent.unwrap() < 0.2 * before,
        "{before} {:?}",
        found.ranking[0]
    );
}

/// What the recordings say is the controller's own is not the stage's: the rest of a delay is named, and none where it is all of it.
#[test]
fn val_the_stage_is_not_blamed_for_the_controllers_delay() {
    let mut dataset = delayed(1);
    let model = model(&dataset);
    dataset.known.delay_s = Some(30e-6);
    let found = diagnose(&dataset, &model, &|_, _| {});
    assert_eq!((found.verdict.as_str(), found.known_delay_s), ("delay", Some(30e-6)));
    let delay_s = found.delay_s().unwrap();
    assert!((delay_s - 50e-6).abs() < 1.6e-6, "{delay_s}");

    dataset.known.delay_s = Some(80e-6);
    let found = diagnose(&dataset, &model, &|_, _| {});
    assert!(
        matches!(found.verdict.as_str(), "none" | "hysteresis-shape"),
        "{} {:#?}",
        found.verdict,
        found.ranking
    );

    let learned = hysteron_diagnose::learn(&dataset, &FitOptions::new(Family::Mpi), &|_, _| {}).unwrap();
    let effects: Vec<&str> = learned
        .model
        .effects
        .iter()
        .map(|effect| effect.name.as_str())
        .collect();
    assert!(
        effects.contains(&"delay"),
        "a model of these records needs it: {effects:?}"
    );
}

#[test]
fn val_nothing_physical_is_named_where_nothing_is_missing() {
    let dataset = dataset(&stage(), 2);
    let found = diagnose(&dataset, &model(&dataset), &|_, _| {});
    assert!(
        matches!(found.verdict.as_str(), "none" | "hysteresis-shape"),
        "{} {:#?}",
        found.verdict,
        found.ranking
    );
}

#[test]
fn prop_order_names_and_offset_change_no_verdict() {
    let first = delayed(3);
    let mut second = first.clone();
    second.records.reverse();
    for (i, record) in second.records.iter_mut().enumerate() {
        record.file = format!("other-{i}.csv");
        record.position_um.iter_mut().for_each(|y| *y += 12.5);
    }
    let verdict = |d: &Dataset| diagnose(d, &model(d), &|_, _| {}).verdict;
    assert_eq!(verdict(&first), verdict(&second));
}

#[test]
fn val_without_a_validation_record_the_records_are_held_out_by_turns() {
    let mut unjudged = delayed(4);
    unjudged.records.iter_mut().for_each(|r| r.role = Role::Identify);
    let found = diagnose(&unjudged, &model(&unjudged), &|_, _| {});
    assert_eq!(found.verdict.as_str(), "delay", "{:#?}", found.ranking);
    assert!(found.cannot_answer.is_empty());
}

/// Records of another day, all kept for validation: what is missing in a model is asked of them as well.
#[test]
fn val_records_that_are_all_for_validation_name_the_effect() {
    let dataset = delayed(11);
    let model = model(&dataset);
    let mut other_day = delayed(12);
    other_day
        .records
        .iter_mut()
        .for_each(|record| record.role = Role::Validate);
    let said = diagnose(&other_day, &model, &|_, _| ());
    assert!(said.verdict.is(EffectId::Delay), "{said:?}");
    assert!(said.free_shape.counts().is_some_and(f64::is_finite));
}

#[test]
fn refuse_to_name_what_widens_the_loops_from_one_sine() {
    let mut one = delayed(4);
    one.records.truncate(1);
    let again = Record {
        role: Role::Validate,
        ..one.records[0].clone()
    };
    one.records.push(again);
    let found = diagnose(&one, &model(&one), &|_, _| {});
    assert!(
        found
            .verdict
            .effect()
            .is_none_or(|name| *name == EffectId::HysteresisShape),
        "{}",
        found.verdict
    );
    assert_eq!(found.cannot_answer, [Reason::OneSine]);
}

fn with_backlash(width_um: f64) -> StageConfig {
    StageConfig {
        backlash: Some(Backlash { width_um }),
        ..stage()
    }
}

/// Slow sines from 0 V, full, half and falling, one with a ripple, one of 50 Hz.
fn slow(config: &StageConfig) -> Dataset {
    let sine = |f: f64, size: f64, t: f64| size * 50.0 * (1.0 - (TAU * f * t).cos());
    let drive = |i: usize, t: f64| match i {
        0 => sine(1.0, 1.0, t),
        1 => sine(1.0, 0.5, t),
        2 => sine(1.0, 1.0, t) * (1.0 - t / 4.0),
        3 => sine(0.5, 0.8, t) + 8.0 * (1.0 - (TAU * 3.0 * t).cos()),
        4 => sine(50.0, 1.0, t),
        _ => sine(7.0, 0.9, t),
    };
    played(config, 0, [3, 5], |i| if i == 4 { 1e-4 } else { 1e-3 }, 3000, drive)
}

fn lost(dataset: &Dataset) -> (bool, Diagnosis) {
    let found = diagnose(dataset, &model(dataset), &|_, _| {});
    let named = found
        .further
        .iter()
        .chain(found.verdict.effect())
        .any(|name| *name == EffectId::Backlash);
    (named, found)
}

/// Half a percent to a twentieth of the stroke. The drive goes as far within the dead band as takes the same stage without one
/// through its width; sampled at 1 ms, a sine of 1 Hz moves by up to 2 % of the span meanwhile, and a half sine turns slowly.
#[test]
fn val_lost_motion_is_named_with_its_dead_band() {
    let sine = &slow(&stage()).records[0];
    let top = sine.position_um.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for width_um in [0.06, 0.15, 0.5] {
        let after_the_top = (500..1000).find(|&k| sine.position_um[k] < top - width_um).unwrap();
        let band_v = 100.0 - sine.voltage_v[after_the_top];
        let (_, found) = lost(&slow(&with_backlash(width_um)));
        assert_eq!(found.verdict.as_str(), "backlash", "{width_um} {:#?}", found.ranking);
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
    let plain = slow(&stage());
    assert!(!lost(&plain).0);
    let stopped = StageConfig {
        end_stop: Some(EndStop {
            min_um: -5.0,
            max_um: 8.0,
        }),
        ..stage()
    };
    assert!(!lost(&slow(&stopped)).0);
    let mut coarse = plain;
    for record in &mut coarse.records {
        // Seven bits.
        record
            .position_um
            .iter_mut()
            .for_each(|y| *y = (*y / 0.08).round() * 0.08);
    }
    assert!(!lost(&coarse).0);
}

/// Parts that touch give way: behind the contact this stop moves by 15 % of what pushes against it.
#[test]
fn val_a_stop_that_gives_way_is_a_stop() {
    let mut dataset = dataset(&stage(), 3);
    let highest = |record: &Record| record.position_um.iter().copied().fold(f64::MIN, f64::max);
    let contact_um = 0.9 * dataset.records.iter().map(highest).fold(f64::MIN, f64::max);
    let stopped = |y: &mut f64| *y -= 0.85 * (*y - contact_um).max(0.0);
    for record in &mut dataset.records {
        record.position_um.iter_mut().for_each(stopped);
    }
    let found = diagnose(&dataset, &model(&dataset), &|_, _| {});
    assert_eq!(found.verdict.as_str(), "saturation", "{:#?}", found.ranking);
}

/// Beside another effect it is named as well, one of the two as the verdict.
#[test]
fn val_lost_motion_beside_a_delay() {
    let both = StageConfig {
        delay_s: 300e-6,
        ..with_backlash(0.2)
    };
    let (named, found) = lost(&slow(&both));
    let all: Vec<&EffectName> = found.further.iter().chain(found.verdict.effect()).collect();
    assert!(named, "{all:?}");
    assert!(all.iter().any(|name| **name == EffectId::Delay), "{all:?}");
}
