//! A zero that drifts while records are taken, of which no column tells and no rest before a record.
#![expect(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod records;

use hysteron_data::{Dataset, Role};
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_diagnose::{diagnose, learn};
use hysteron_identify::{EffectId, Family, FitOptions, fit};
use hysteron_plant::Stage;
use records::{drive, record, term};

const PERIOD_S: f64 = 1.0 / 10_000.0;

/// All drives are periodic and in motion by then.
const FROM: usize = 1_250;

/// 0.3 s: three periods of the slowest drive.
const TO: usize = FROM + 3_000;

/// Nine records, six of them to identify; each drifts at its own rate, micrometres a second.
fn dataset(rate_um_per_s: impl Fn(usize) -> f64) -> Dataset {
    let config = records::stage(vec![term(15.0, 0.2, 1.0)], 0.002);
    records::dataset((0..9).map(|i| {
        // The drives of six records, three of them once more at three quarters.
        let size = if i < 6 { 1.0 } else { 0.75 };
        let voltage_v: Vec<f64> = (0..TO).map(|k| size * drive(i % 6, k as f64 * PERIOD_S)).collect();
        let run = Stage::new(&config, i as u64)
            .unwrap()
            .run(&voltage_v, PERIOD_S)
            .unwrap();
        // About the record's middle: what differs from record to record is the rate, not the zero.
        let drifted = |(k, y): (usize, &f64)| y + rate_um_per_s(i) * (k as f64 - (TO - FROM) as f64 / 2.0) * PERIOD_S;
        let position_um = run.position_um[FROM..].iter().enumerate().map(drifted).collect();
        let role = if i % 3 == 1 { Role::Validate } else { Role::Identify };
        record(&i.to_string(), role, PERIOD_S, voltage_v[FROM..].to_vec(), position_um)
    }))
}

fn answer(dataset: &Dataset) -> Diagnosis {
    let model = fit(dataset, &FitOptions::new(Family::Mpi), &|_| ()).unwrap().model;
    diagnose(dataset, &model, &|_, _| {})
}

/// 1 um/s on a stroke of 10 um: 3 % from one end of a record to the other.
#[test]
fn val_a_drift_that_all_records_share_is_named_and_learned() {
    let dataset = dataset(|_| 1.0);
    let found = answer(&dataset);
    assert_eq!(found.verdict.as_str(), "thermal-drift", "{:#?}", found.ranking);
    let drift = found
        .ranking
        .iter()
        .find(|entry| entry.effect == hysteron_identify::EffectId::ThermalDrift)
        .unwrap();
    let rate = drift.parameters.iter().find(|p| p.name == "shift").unwrap();
    assert_eq!(rate.unit, "um/h");
    assert!((rate.value / 3600.0 - 1.0).abs() < 0.03, "{drift:#?}");
    let learned = learn(&dataset, &FitOptions::new(Family::Mpi), &|_, _| {}).unwrap();
    let effect = learned
        .model
        .effects
        .iter()
        .find(|e| e.name == EffectId::ThermalDrift)
        .unwrap();
    let shift = effect.parameters.iter().find(|p| p.name == "shift").unwrap();
    assert!((shift.value / 3600.0 - 1.0).abs() < 0.03, "{effect:#?}");
}

/// Rates as large, but each record's own: none foretells another, and a zero of each record's own is no effect.
#[test]
fn val_drifts_that_differ_from_record_to_record_are_not_named() {
    let found = answer(&dataset(|i| [1.0, -1.0, 0.6, -0.8, 1.2, -0.4, -1.1, 0.7, 0.2][i]));
    assert_eq!(found.verdict.as_str(), "unknown", "{:#?}", found.ranking);
    assert_eq!(
        found.unexplained.locked_to[0].to.as_str(),
        "time",
        "{:#?}",
        found.unexplained
    );
}
