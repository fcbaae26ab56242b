//! One run of a designed controller on the simulated stage.

use crate::error::TrackingError;
use hysteron_control::ControlError;
use hysteron_control::adapted::Adapted;
use hysteron_control::design::DesignedLaw;
use hysteron_control::figures::Tracked;
use hysteron_control::reference::Reference;
use hysteron_core::surroundings::LoopInput;
use hysteron_plant::{Stage, StageConfig};

/// Lets a complete law drive a fresh stage along a reference; position k is compared with reference k, nothing is shifted.
///
/// The law takes in each sample of the reference as many samples before it is due as it was designed for.
///
/// # Errors
/// A stage that cannot be built, a reference that is not finite.
pub fn track(
    config: &StageConfig,
    seed: u64,
    law: &DesignedLaw<f64>,
    reference: &Reference,
) -> Result<Tracked, TrackingError> {
    track_beside(config, seed, law, reference, &[])
}

/// As [`track`], with a command of the other axis beside it, one value a sample of the reference, 0 V beyond its ends; the law
/// knows it as early as the reference.
///
/// # Errors
/// As [`track`].
pub fn track_beside(
    config: &StageConfig,
    seed: u64,
    law: &DesignedLaw<f64>,
    reference: &Reference,
    voltage2_v: &[f64],
) -> Result<Tracked, TrackingError> {
    let samples_um = &reference.samples_um;
    if let Some(index) = samples_um.iter().position(|value| !value.is_finite()) {
        let value = samples_um[index];
        return Err(ControlError::Reference { index, value }.into());
    }
    let mut stage = Stage::new(config, seed)?;
    let ahead = law.ahead();
    let temperature = |stage: &Stage| stage.sample().temperature_c.unwrap_or(0.0);
    let mut state = law.rest(temperature(&stage));
    let input = |stage: &Stage, k: usize| LoopInput {
        reference_ahead: reference.at(k),
        measured: stage.sample().position_um,
        voltage2_ahead: voltage2_v.get(k).copied().unwrap_or(0.0),
        motion2_ahead: 0.0,
        temperature_c: temperature(stage),
    };
    // What becomes known before the first sample is due.
    for k in 0..ahead.min(samples_um.len()) {
        let command_v = law.step(&mut state, input(&stage, k));
        stage.step_two_axes(command_v, 0.0);
    }
    let length = samples_um.len();
    let mut tracked = Tracked {
        reference_um: samples_um.clone(),
        measured_um: Vec::with_capacity(length),
        true_um: Vec::with_capacity(length),
        command_v: Vec::with_capacity(length),
        limited: Vec::with_capacity(length),
        adapted: None,
    };
    for k in 0..length {
        let sample = stage.sample();
        tracked.measured_um.push(sample.position_um);
        tracked.true_um.push(sample.true_position_um);
        let command_v = law.step(&mut state, input(&stage, k + ahead));
        tracked.command_v.push(command_v);
        tracked.limited.push(state.limited());
        stage.step_two_axes(command_v, voltage2_v.get(k).copied().unwrap_or(0.0));
    }
    tracked.adapted = Adapted::of(law, &state, config.sample_period_s);
    Ok(tracked)
}
