//! One run of the core's control law on the simulated stage.

use crate::error::TrackingError;
use hysteron_control::ControlError;
use hysteron_control::figures::Tracked;
use hysteron_control::reference::Reference;
use hysteron_core::control_law::ControlLaw;
use hysteron_core::limiter::Limiter;
use hysteron_core::model::Hysteresis;
use hysteron_core::pi_controller::PiController;
use hysteron_identify::{CoreModel, Model};
use hysteron_plant::{Stage, StageConfig};
use std::collections::VecDeque;

/// The control law of eq. 15 in micrometres and actuator volts, its inverse with N plays.
pub type Law<const N: usize> = ControlLaw<f64, Option<CoreModel<f64, N>>>;

/// Gains of the PI controller, eq. 14.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PiGains {
    /// K_p, actuator volts per micrometre.
    pub proportional_v_per_um: f64,
    /// K_i, actuator volts per micrometre and second.
    pub integral_v_per_um_s: f64,
}

/// Builds the control law for a stage: the command within the amplifier's range, not limited in slew.
///
/// # Errors
/// An inverse with another number of plays than N, gains that are negative or not finite.
pub fn law<const N: usize>(
    stage: &StageConfig,
    inverse: Option<&Model>,
    gains: Option<PiGains>,
) -> Result<Law<N>, TrackingError> {
    let rate_hz = 1.0 / stage.sample_period_s;
    let feedforward = inverse
        .map(|model| model.to_core(model.input_min, model.input_max, rate_hz))
        .transpose()?;
    law_of(stage, feedforward, gains)
}

/// As [`law`], with any model in the feedforward.
///
/// # Errors
/// Gains that are negative or not finite.
pub fn law_of<F>(
    stage: &StageConfig,
    feedforward: Option<F>,
    gains: Option<PiGains>,
) -> Result<ControlLaw<f64, Option<F>>, TrackingError> {
    let rate_hz = 1.0 / stage.sample_period_s;
    let (low_v, high_v) = (stage.amplifier.min_v, stage.amplifier.max_v);
    let feedback = match gains {
        Some(gains) => PiController::new(gains.proportional_v_per_um, gains.integral_v_per_um_s, rate_hz)?,
        None => PiController::none(),
    };
    Ok(ControlLaw {
        feedforward,
        feedback,
        // The whole range in one sample is no limit.
        limiter: Limiter::new(low_v, high_v, (high_v - low_v) * rate_hz, rate_hz)?,
    })
}

/// Lets the control law drive a fresh stage along a reference, at the stage's own sample rate, through its converters.
///
/// At each sample the sensor is read, the law computes, and the command is latched, as in the records that the stage
/// gives: the first reading that a command can move is the next one, so the loop has one sample of latency and the half
/// sample of the hold. `further_samples` are whole samples of computing on top of that. Position k is compared with
/// reference k: nothing is shifted.
///
/// # Errors
/// A stage that cannot be built, a reference that is not finite.
pub fn track<const N: usize>(
    config: &StageConfig,
    seed: u64,
    law: &Law<N>,
    reference: &Reference,
    further_samples: usize,
) -> Result<Tracked, TrackingError> {
    let start_um = reference.samples_um.first().copied().unwrap_or(0.0);
    // Without an inverse the state is there and is not used: any table would do.
    let plays = match &law.feedforward {
        Some(inverse) => inverse.start_at(start_um, 0.0),
        None => hysteron_core::bank::PlayState::virgin(),
    };
    track_from(config, seed, law, plays, reference, further_samples)
}

/// As [`track`], with any model in the feedforward, in the state that it starts from.
///
/// # Errors
/// As [`track`].
pub fn track_from<F: Hysteresis<f64>>(
    config: &StageConfig,
    seed: u64,
    law: &ControlLaw<f64, F>,
    feedforward: F::State,
    reference: &Reference,
    further_samples: usize,
) -> Result<Tracked, TrackingError> {
    let samples_um = &reference.samples_um;
    if let Some(index) = samples_um.iter().position(|value| !value.is_finite()) {
        let value = samples_um[index];
        return Err(ControlError::Reference { index, value }.into());
    }
    let mut stage = Stage::new(config, seed)?;
    let mut state = law.start(feedforward, 0.0);
    let mut waiting: VecDeque<f64> = VecDeque::from(vec![0.0; further_samples]);
    let length = samples_um.len();
    let mut tracked = Tracked {
        reference_um: samples_um.clone(),
        measured_um: Vec::with_capacity(length),
        true_um: Vec::with_capacity(length),
        command_v: Vec::with_capacity(length),
        limited: Vec::with_capacity(length),
        adapted: None,
    };
    for &reference_um in samples_um {
        let sample = stage.sample();
        tracked.measured_um.push(sample.position_um);
        tracked.true_um.push(sample.true_position_um);
        let command_v = law.step(&mut state, reference_um, sample.position_um);
        tracked.command_v.push(command_v);
        tracked.limited.push(state.limiter.limited());
        waiting.push_back(command_v);
        stage.step(waiting.pop_front().unwrap_or(command_v));
    }
    Ok(tracked)
}
