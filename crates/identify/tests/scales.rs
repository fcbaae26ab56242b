//! Models are fitted at any sample rate, voltage, stroke and length.

use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::{Family, FitOptions, fit};
use std::f64::consts::TAU;

/// A minor loop within a major one through four plays; everything in units of the scale, so that only rounding differs.
fn record(rate_hz: f64, volts: f64, stroke_um: f64, samples: usize) -> Record {
    let thresholds = [0.0, 0.1, 0.2, 0.35];
    let mut plays = [0.0f64; 4];
    let (mut voltage_v, mut position_um) = (Vec::new(), Vec::new());
    for k in 0..samples {
        let turn = TAU * 4.0 * k as f64 / samples as f64;
        let v = 0.5 - 0.35 * turn.cos() - 0.15 * (3.0 * turn).cos();
        for (w, r) in plays.iter_mut().zip(thresholds) {
            *w = w.clamp(v - r, v + r);
        }
        voltage_v.push(volts * v);
        position_um.push(stroke_um * (0.5 * v + 0.125 * plays.iter().sum::<f64>()));
    }
    Record::new("a.csv", Role::Identify, 1.0 / rate_hz, voltage_v, position_um)
}

/// Six plays placed on the data stand in for four of other widths: in these units they leave less than 2 % of the stroke.
#[test]
fn prop_any_rate_voltage_stroke_and_length() {
    for rate_hz in [0.01, 1.0, 3.0, 19.9, 20.1, 1e3, 5e4, 1e6] {
        for (volts, stroke_um, samples) in [
            (1e-2, 1e-3, 64),
            (26.0, 15.0, 700),
            (2000.0, 1e3, 64),
            (150.0, 40.0, 3000),
        ] {
            let dataset = Dataset {
                records: vec![record(rate_hz, volts, stroke_um, samples)],
                ..Dataset::default()
            };
            for family in [
                Family::Pi,
                Family::Mpi,
                Family::Wrpi,
                Family::Mrpi,
                Family::PlayPolynomial,
            ] {
                let report = fit(
                    &dataset,
                    &FitOptions {
                        plays: 6,
                        ..FitOptions::new(family)
                    },
                    &|_| (),
                )
                .unwrap();
                let record = &dataset.records[0];
                let modelled = report.model.simulate(record).output;
                let squares: f64 = modelled
                    .iter()
                    .zip(&record.position_um)
                    .map(|(m, y)| (m - y).powi(2))
                    .sum();
                let share = (squares / samples as f64).sqrt() / stroke_um;
                assert!(
                    share < 0.02,
                    "{family:?}, {rate_hz} Hz, {volts} V, {stroke_um} um, {samples}: {share}"
                );
            }
        }
    }
}
