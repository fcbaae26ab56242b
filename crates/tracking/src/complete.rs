//! One run of a designed controller on the simulated stage.

use crate::design::CompleteLaw;
use crate::error::TrackingError;
use crate::reference::Reference;
use crate::run::Tracked;
use hysteron_plant::{Stage, StageConfig};

/// Lets a complete law drive a fresh stage along a reference; position k is compared with reference k, nothing is shifted.
///
/// The law takes in each sample of the reference as many samples before it is due as it was designed for; beyond the end
/// the reference rests.
///
/// # Errors
/// A stage that cannot be built, a reference that is not finite.
pub fn track(
    config: &StageConfig,
    seed: u64,
    law: &CompleteLaw<f64>,
    reference: &Reference,
) -> Result<Tracked, TrackingError> {
    let samples_um = &reference.samples_um;
    if let Some(index) = samples_um.iter().position(|value| !value.is_finite()) {
        let value = samples_um[index];
        return Err(TrackingError::Reference { index, value });
    }
    let mut stage = Stage::new(config, seed)?;
    let ahead = law.feedforward.preview.ahead();
    let last = samples_um.last().copied().unwrap_or(0.0);
    let mut state = law.rest();
    // What becomes known before the first sample is due.
    let lead_in = samples_um.iter().take(ahead);
    for &reference_um in lead_in {
        let command_v = law.step(&mut state, reference_um, stage.sample().position_um);
        stage.step(command_v);
    }
    let length = samples_um.len();
    let mut tracked = Tracked {
        reference_um: samples_um.clone(),
        measured_um: Vec::with_capacity(length),
        true_um: Vec::with_capacity(length),
        command_v: Vec::with_capacity(length),
        limited: Vec::with_capacity(length),
    };
    for k in 0..length {
        let sample = stage.sample();
        tracked.measured_um.push(sample.position_um);
        tracked.true_um.push(sample.true_position_um);
        let reference_um = samples_um.get(k + ahead).copied().unwrap_or(last);
        let command_v = law.step(&mut state, reference_um, sample.position_um);
        tracked.command_v.push(command_v);
        tracked.limited.push(state.limiter().limited());
        stage.step(command_v);
    }
    Ok(tracked)
}
