//! Datasets that cannot answer which effect is missing.

use hysteron_data::{Dataset, Role};
use rand::{RngExt, SeedableRng};

/// Only the slowest sine, for fitting and again for judging.
pub fn one_sine(dataset: &Dataset) -> Dataset {
    let mut changed = dataset.clone();
    changed.records.retain(|record| record.file.starts_with("sine-001hz"));
    let mut again = changed.records.clone();
    for record in &mut again {
        record.role = Role::Validate;
        record.file = format!("again-{}", record.file);
    }
    changed.records.extend(again);
    changed
}

/// One second of the slow sine, nothing to judge on.
pub fn one_second(dataset: &Dataset) -> Dataset {
    let mut changed = dataset.clone();
    changed.records.retain(|record| record.file.starts_with("sine-001hz"));
    for record in &mut changed.records {
        let kept = (1.0 / record.period_s).round() as usize;
        record.voltage_v.truncate(kept);
        record.position_um.truncate(kept);
        for column in [&mut record.temperature_c, &mut record.voltage2_v]
            .into_iter()
            .flatten()
        {
            column.truncate(kept);
        }
    }
    changed
}

/// Every reading above 60 % and below 10 % of the range stands at the limit: the sensor's input range was set too small.
pub fn clipped(dataset: &Dataset) -> Dataset {
    let mut changed = dataset.clone();
    let all = || dataset.records.iter().flat_map(|record| &record.position_um);
    let (low, high) = all().fold((f64::MAX, f64::MIN), |(low, high), &y| (low.min(y), high.max(y)));
    let (floor, ceiling) = (low + 0.1 * (high - low), low + 0.6 * (high - low));
    changed
        .records
        .iter_mut()
        .flat_map(|record| &mut record.position_um)
        .for_each(|y| *y = y.clamp(floor, ceiling));
    changed
}

/// Positions that have nothing to do with the voltage: the sensor's cable was not plugged in.
pub fn all_noise(dataset: &Dataset, seed: u64) -> Dataset {
    let mut changed = dataset.clone();
    let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
    for y in changed.records.iter_mut().flat_map(|record| &mut record.position_um) {
        *y = rng.random_range(-2e-3..2e-3);
    }
    changed
}

/// Every record is there to be fitted to.
pub fn no_validation(dataset: &Dataset) -> Dataset {
    let mut changed = dataset.clone();
    changed
        .records
        .iter_mut()
        .for_each(|record| record.role = Role::Identify);
    changed
}
