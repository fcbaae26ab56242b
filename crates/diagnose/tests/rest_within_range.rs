//! Records that begin at rest at 0 V on a stage that is driven to both sides of it.

mod records;

use hysteron_data::Role;
use hysteron_diagnose::diagnose;
use hysteron_identify::{Family, FitOptions, fit};
use hysteron_plant::{Creep, KelvinVoigtElement, Stage, StageConfig};
use records::{record, term};
use std::f64::consts::TAU;

const TOP_V: f64 = 100.0;
const LOWEST_V: f64 = -15.0;

fn stage() -> StageConfig {
    let mut config = records::stage(vec![term(15.0, 0.2, 1.0)], 0.001);
    let element = |share, time_constant_s| KelvinVoigtElement { share, time_constant_s };
    config.creep = Some(Creep::KelvinVoigt {
        elements: vec![element(0.05, 0.25), element(0.05, 4.0)],
    });
    config
}

/// Name, role, sample period, voltage; all begin at 0 V.
fn programme() -> Vec<(&'static str, Role, f64, Vec<f64>)> {
    use Role::{Identify, Validate};
    let sine = |frequency_hz: f64, high_v: f64, periods: f64, period_s: f64| -> Vec<f64> {
        let samples = (periods / frequency_hz / period_s).round() as usize;
        (0..samples)
            .map(|k| 0.5 * high_v * (1.0 - (TAU * frequency_hz * k as f64 * period_s).cos()))
            .collect()
    };
    // Straight lines from turn to turn, 200 V/s.
    let turns = |levels: &[f64]| -> Vec<f64> {
        let pairs = levels.windows(2).flat_map(|pair| {
            let samples = ((pair[1] - pair[0]).abs() / 0.2).round() as usize;
            (0..samples).map(move |k| pair[0] + (pair[1] - pair[0]) * k as f64 / samples as f64)
        });
        pairs.collect()
    };
    let holds = |levels: &[f64]| -> Vec<f64> {
        let each = levels.iter().flat_map(|&level| std::iter::repeat_n(level, 1200));
        each.collect()
    };
    vec![
        ("sine-001hz", Identify, 1e-3, sine(1.0, TOP_V, 4.0, 1e-3)),
        ("sine-010hz", Identify, 2e-4, sine(10.0, TOP_V, 6.0, 2e-4)),
        ("sine-010hz-small", Identify, 2e-4, sine(10.0, 40.0, 5.0, 2e-4)),
        ("sine-050hz", Validate, 1e-4, sine(50.0, TOP_V, 8.0, 1e-4)),
        ("sine-100hz", Identify, 5e-5, sine(100.0, TOP_V, 10.0, 5e-5)),
        ("sine-100hz-small", Validate, 5e-5, sine(100.0, 30.0, 10.0, 5e-5)),
        (
            "turns",
            Identify,
            1e-3,
            turns(&[0.0, TOP_V, LOWEST_V, 85.0, -3.0, 73.0, 8.0, 63.0, 18.0, 55.0, 26.0]),
        ),
        (
            "turns-2",
            Validate,
            1e-3,
            turns(&[0.0, 70.0, 10.0, 90.0, 25.0, 60.0, 5.0]),
        ),
        ("holds", Identify, 1e-2, holds(&[0.0, 80.0, 35.0])),
        ("hold", Validate, 1e-2, holds(&[0.0, 60.0])),
        ("quiet", Identify, 2e-4, vec![0.0; 5000]),
    ]
}

/// A sine from 0 V looks the same after a rest and after a thousand periods, and only the lowest voltage of all leaves the plays no
/// choice. Taken for settled, creep is in no record what it is in the others.
#[test]
fn regress_creep_from_rest_within_the_range_is_named() {
    let mut stage = Stage::new(&stage(), 5).unwrap();
    let records = programme().into_iter().map(|(name, role, period_s, voltage_v)| {
        stage.move_and_rest(TOP_V, 0.05, 0.0).unwrap();
        stage.move_and_rest(0.0, 0.05, 60.0).unwrap();
        let run = stage.run(&voltage_v, period_s).unwrap();
        record(name, role, period_s, voltage_v, run.position_um)
    });
    let dataset = records::dataset(records);
    let model = fit(&dataset, &FitOptions::new(Family::Pi), &|_| ()).unwrap().model;
    let found = diagnose(&dataset, &model, &|_, _| {});
    assert_eq!(found.verdict.as_str(), "creep", "{:#?}", found.ranking);
    let creep = found
        .ranking
        .iter()
        .find(|entry| entry.effect == hysteron_identify::EffectId::Creep)
        .unwrap();
    // Two elements of 5 %; those that are fitted stand a decade apart, and share what lies between them with one slower than any hold.
    // What all of them have done by the end of the longest hold is what the records tell.
    let value = |name: &str| creep.parameters.iter().find(|p| p.name == name).unwrap().value;
    let (first_tau_s, hold_s) = (value("first_tau"), 12.0_f64);
    let elements = ["share_1", "share_2", "share_3", "share_4"]
        .into_iter()
        .zip([1.0, 10.0, 100.0, 1000.0]);
    let done: f64 = elements
        .map(|(share, times)| value(share) * (1.0 - (-hold_s / (times * first_tau_s)).exp()))
        .sum();
    let truth = 0.05 * (1.0 - (-hold_s / 0.25).exp()) + 0.05 * (1.0 - (-hold_s / 4.0).exp());
    assert!((done - truth).abs() < 0.005, "{done} {truth} {creep:#?}");
    assert!(creep.errors.identify_percent.unwrap() < 0.15, "{creep:#?}");
}
