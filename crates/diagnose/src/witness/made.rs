//! Records and errors that are made for tests.

use crate::witness::traces::Traces;
use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::InitialState;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

/// White noise of rms 1.
pub(crate) fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
    move || StandardNormal.sample(&mut rng)
}

/// Eight records of a stage of 0.1 um a volt: sines of 1 to 50 Hz over 20 to 100 V, each of six periods of 2000 samples, and the
/// errors that are added to its position.
pub(crate) fn traces(error_um: impl Fn(usize, &Record) -> Vec<f64>) -> (Traces, Vec<Vec<f64>>) {
    let records: Vec<Record> = (0..8).map(record).collect();
    let errors: Vec<Vec<f64>> = records.iter().enumerate().map(|(i, r)| error_um(i, r)).collect();
    let mut dataset = Dataset {
        records,
        ..Dataset::default()
    };
    for (record, error) in dataset.records.iter_mut().zip(&errors) {
        record.position_um.iter_mut().zip(error).for_each(|(y, e)| *y += e);
    }
    let states = vec![InitialState::REST; dataset.records.len()];
    (Traces::new(&dataset, &states, 1e-3), errors)
}

fn record(i: usize) -> Record {
    let frequency_hz = [1.0, 50.0, 2.0, 20.0, 5.0, 10.0, 50.0, 1.0][i];
    let size_v = [50.0, 50.0, 20.0, 50.0, 10.0, 50.0, 10.0, 30.0][i];
    let voltage_v: Vec<f64> = (0..12_000)
        .map(|k| size_v * (1.0 - (TAU * f64::from(k) / 2000.0).cos()))
        .collect();
    Record {
        file: format!("sine-{i}.csv"),
        role: Role::Validate,
        excitation: String::new(),
        start_s: 0.0,
        period_s: 1.0 / (2000.0 * frequency_hz),
        position_um: voltage_v.iter().map(|v| 0.1 * v).collect(),
        voltage_v,
        reference_um: None,
        temperature_c: None,
        voltage2_v: None,
    }
}
