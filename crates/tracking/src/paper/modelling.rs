//! Section 4.2: both ways to identify, and how far the identified inverse is off.

use super::IDENTIFIED_HZ;
use crate::error::TrackingError;
use hysteron_data::Dataset;
use hysteron_identify::{Family, FitOptions, FitReport, Method, Model, fit};
use std::time::Instant;

/// The inverse MRPI identified by separable least squares and by the paper's particle swarm, on the same objective (17).
#[derive(Debug, Clone)]
pub struct SwarmRace {
    /// Objective (17) that separable least squares reached, V^2.
    pub separable_objective: f64,
    /// Objective (17) that the swarm reached, V^2.
    pub swarm_objective: f64,
    /// Time of a separable fit, seconds; the only figures here that differ from run to run are times.
    pub separable_s: f64,
    /// Time of the swarm, seconds.
    pub swarm_s: f64,
    /// The swarm's model.
    pub swarm: Model,
}

pub(super) fn race(
    records: &Dataset,
    separable: &FitReport,
    seed: u64,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<SwarmRace, TrackingError> {
    let options = FitOptions::paper(Family::Mrpi);
    let start = Instant::now();
    fit(records, &options, &|_| ())?;
    let separable_s = start.elapsed().as_secs_f64();
    let options = FitOptions {
        method: Method::Mpso,
        seed,
        ..options
    };
    let start = Instant::now();
    let swarmed = fit(records, &options, progress)?;
    Ok(SwarmRace {
        separable_objective: separable.objective,
        swarm_objective: swarmed.objective,
        separable_s,
        // The swarm's fit begins with a separable one, for the initial states.
        swarm_s: (start.elapsed().as_secs_f64() - separable_s).max(0.0),
        swarm: swarmed.model,
    })
}

/// Errors of an inverse on the records it was fitted to, percent of the voltage's peak to peak, by frequency.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ModellingError {
    /// Largest error.
    pub largest_percent: [f64; 3],
    /// Rms error.
    pub rms_percent: [f64; 3],
}

impl ModellingError {
    /// The largest of all, and the frequency it is at, hertz.
    pub fn worst(&self) -> (f64, f64) {
        let by_frequency = self.largest_percent.into_iter().zip(IDENTIFIED_HZ);
        by_frequency.fold((0.0, f64::NAN), |a, b| if b.0 > a.0 { b } else { a })
    }
}

pub(super) fn error(records: &Dataset, inverse: &Model) -> ModellingError {
    let mut found = ModellingError {
        largest_percent: [f64::NAN; 3],
        rms_percent: [f64::NAN; 3],
    };
    for (i, record) in records.records.iter().enumerate().take(3) {
        let modelled = inverse.simulate(record).output;
        let errors = || modelled.iter().zip(&record.voltage_v).map(|(m, v)| m - v);
        let span_v = hysteron_identify::family::peak_to_peak(&record.voltage_v);
        let mean_square = errors().map(|e| e * e).sum::<f64>() / modelled.len() as f64;
        found.rms_percent[i] = 100.0 * mean_square.sqrt() / span_v;
        found.largest_percent[i] = 100.0 * errors().fold(0.0_f64, |most, e| most.max(e.abs())) / span_v;
    }
    found
}
