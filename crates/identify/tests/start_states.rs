//! States before a record that no file gives: a stage at rest that was never driven, and a small sine about a voltage that it came up to.

use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::{Family, FitOptions, fit, record_errors};
use std::f64::consts::TAU;

const RATE_HZ: f64 = 5_000.0;

/// Plays of half widths 0 to 40.5 V that start at zero and hold still before a drive comes; a voltage on the way to the first sample.
fn stage(drive: impl Iterator<Item = f64>, came_up_to_v: f64) -> (Vec<f64>, Vec<f64>) {
    let half_widths_v: Vec<f64> = (0..10).map(|i| 4.5 * f64::from(i)).collect();
    let mut plays = vec![0.0_f64; half_widths_v.len()];
    let mut step = |v: f64| {
        let each = plays.iter_mut().zip(&half_widths_v).enumerate();
        let moved = each.map(|(i, (play, half))| {
            *play = play.clamp(v - half, v + half);
            0.02 * (-0.25 * i as f64).exp() * *play
        });
        0.03 * v + moved.sum::<f64>()
    };
    (0..=100).for_each(|k| {
        step(came_up_to_v * f64::from(k) / 100.0);
    });
    drive.map(|v| (v, step(v))).unzip()
}

fn sine(file: &str, hz: f64, amplitude_v: f64, phase: f64) -> Record {
    let samples = (4.0 * RATE_HZ / hz) as usize;
    let drive = (0..samples).map(move |k| 45.0 + amplitude_v * (TAU * hz * k as f64 / RATE_HZ + phase).sin());
    let first = 45.0 + amplitude_v * phase.sin();
    let (voltage_v, position_um) = stage(drive, first);
    Record::new(file, Role::Identify, 1.0 / RATE_HZ, voltage_v, position_um)
}

/// A first branch that no later one repeats is neither fitted as one of them nor left unexplained, and what the wide plays hold over the
/// small sine bends none of them.
#[test]
fn val_a_virgin_stage_and_a_small_sine_are_fitted() -> Result<(), hysteron_identify::IdentifyError> {
    let virgin = sine("virgin.csv", 2.0, 45.0, -0.25 * TAU);
    let small = sine("small.csv", 5.0, 20.0, 0.0);
    let dataset = Dataset {
        records: vec![virgin, small],
        ..Dataset::default()
    };
    // Ten plays that stand elsewhere than those of the stage leave 0.05 to 0.16 %; a start at rest from above left 1.2 %. Loops alone do
    // not determine the first branch of a free shape.
    for (family, most_percent) in [(Family::Mpi, 0.2), (Family::PlayPolynomial, 0.4)] {
        let model = fit(&dataset, &FitOptions::new(family), &|_| ())?.model;
        for (error, record) in record_errors(&dataset, &model).iter().zip(&dataset.records) {
            let percent = error.percent.unwrap_or(f64::INFINITY);
            assert!(
                percent < most_percent,
                "{family:?} {}: {percent} % of peak to peak",
                record.file
            );
        }
    }
    Ok(())
}
