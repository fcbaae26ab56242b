//! Datasets and noise of the tests.

use hysteron_data::{Dataset, Record};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};

pub(crate) fn dataset(records: Vec<Record>) -> Dataset {
    Dataset {
        records,
        ..Dataset::default()
    }
}

pub(crate) fn noise(n: usize, rms: f64, seed: u64) -> Vec<f64> {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let normal = Normal::new(0.0, rms).unwrap();
    (0..n).map(|_| normal.sample(&mut random)).collect()
}

pub(crate) fn with_noise(clean: Vec<f64>, rms: f64, seed: u64) -> Vec<f64> {
    let n = clean.len();
    clean.into_iter().zip(noise(n, rms, seed)).map(|(y, e)| y + e).collect()
}
