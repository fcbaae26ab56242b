//! Section 4.2: both ways to identify, and how far the identified inverse is off.

use hysteron_data::Dataset;
use hysteron_identify::{Family, FitOptions, Method, Model, fit};
use hysteron_tracking::TrackingError;
use hysteron_tracking::experiment::IDENTIFIED_HZ;
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

/// Identifies the inverse MRPI from the same records by both methods. `progress` gets the share done.
///
/// # Errors
/// Records that no model can be fitted to.
///
/// # Cost
/// The swarm evaluates the objective 80 000 times, each time over all samples: about a minute of one core for 30 000.
pub fn race(records: &Dataset, seed: u64, progress: &(dyn Fn(f64) + Sync)) -> Result<SwarmRace, TrackingError> {
    let options = FitOptions::paper(Family::Mrpi);
    let start = Instant::now();
    let separable = fit(records, &options, &|_| ())?;
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

/// The lead of a direct inverse MRPI whose first play has no width: its play is `y -+ alpha y'`, so its weight w_1 beside
/// the linear term b_2 makes `(b_2 + w_1) (y + lead y')` with `lead = -w_1 (alpha + beta) / 2 / (b_2 + w_1)`, seconds.
///
/// `None` for other families, and where the first threshold is above zero.
pub fn first_play_lead_s(inverse: &Model) -> Option<f64> {
    let envelope = inverse.envelope.filter(|_| inverse.thresholds.first() == Some(&0.0))?;
    let parameters = inverse.parameters();
    let value = |name: &str| parameters.iter().find(|p| p.name == name).map(|p| p.value);
    let (linear, first) = (value("linear")?, value("weight[1]")?);
    Some(-first * 0.5 * (envelope.alpha_s + envelope.beta_s) / (linear + first))
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
