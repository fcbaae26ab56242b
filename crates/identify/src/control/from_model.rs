//! From a fitted model with effects to the chain that a controller undoes: each effect brings its compensator, or is named.

use super::inverse::{self, Pairs};
use super::linear_part::{LinearPart, ModeOfStage};
use super::model::{AroundPart, CREEP_FAST, CREEP_SLOW, ControlModel, CreepPart, HumPart};
use crate::effects::{Compensation, Compensator, CreepElement, EffectName, StageMode};
use crate::error::IdentifyError;
use crate::family::{Direction, Family};
use crate::model::{FittedEffect, Model};
use crate::start_state::InitialState;
use hysteron_core::envelope::Envelope;
use realfft::num_complex::Complex64;

/// A part of a model that a controller should undo.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Part {
    /// An effect around the hysteresis.
    Effect(EffectName),
    /// The rate dependence that its family has.
    RateDependenceOf(Family),
}

impl std::fmt::Display for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Effect(name) => name.fmt(f),
            Self::RateDependenceOf(family) => f.pad(&format!("rate dependence of {family}")),
        }
    }
}

/// What became of one part of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Undone {
    /// The effect, or what the family has of one.
    pub part: Part,
    /// Its compensator; `None` where it is left out.
    pub by: Option<&'static str>,
    /// Why it is left out, or what limits its compensator.
    pub note: &'static str,
}

/// Whether the half sample of the converter's hold is in the records that a model was fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordedHold {
    /// Positions stand beside the commands as they were given: a delay that was learned has the hold in it.
    InRecords,
    /// Positions stand beside the middle of what they were an answer to: the hold comes on top of what was learned.
    AccountedFor,
}

/// The chain of a model for a controller of this sample period and these limits of the command, and what became of each effect.
///
/// The hysteresis is played over the whole range of voltages that the model was fitted on (cycles of every size, and minor loops at
/// random), and its direct inverse is fitted to that; everything else is taken over effect by effect.
///
/// # Errors
/// A model that runs backwards already; a hysteresis that does not rise with the voltage everywhere, so that it has no inverse.
///
/// # Cost
/// 50 000 samples of the model and one least squares of 60 unknowns: some 0.1 s.
pub fn chain_of(
    model: &Model,
    sample_period_s: f64,
    [voltage_min_v, voltage_max_v]: [f64; 2],
    hold: RecordedHold,
) -> Result<(ControlModel, Vec<Undone>), IdentifyError> {
    if model.direction == Direction::Inverse {
        return Err(IdentifyError::Control {
            reason: "the model runs from position to voltage; a controller is designed from a model of the direction forward; \
                     fit one"
                .into(),
        });
    }
    let mut chain = ControlModel {
        sample_period_s,
        // The converter holds each command for a sample: that much delay is certain.
        latency_s: 0.5 * sample_period_s,
        voltage_min_v,
        voltage_max_v,
        small_signal_um_per_v: 0.0,
        misfit_percent: 0.0,
        model_error_um: None,
        held_out: Vec::new(),
        linear: LinearPart {
            lag_s: 0.0,
            lag_growth: None,
            modes: Vec::new(),
        },
        creep: no_creep(),
        inverse: super::InversePart {
            input_min_um: 0.0,
            input_max_um: 0.0,
            thresholds_um: Vec::new(),
            offset_v: 0.0,
            input_function: Vec::new(),
            linear: Vec::new(),
            quadratic: Vec::new(),
            cubic: Vec::new(),
        },
        fading: None,
        around: AroundPart::default(),
        covered: model.covered.clone(),
    };
    let mut held_beside = false;
    let mut undone = Vec::with_capacity(model.effects.len());
    for fitted in &model.effects {
        let Compensation { by, note } = compensation(fitted)?;
        undone.push(Undone {
            part: Part::Effect(fitted.name.clone()),
            by: by.name(),
            note,
        });
        if hold == RecordedHold::AccountedFor && matches!(by, Compensator::Delay { .. }) {
            held_beside = true;
        }
        take_over(by, &mut chain, model);
    }
    let left_out: Vec<&EffectName> = (model.effects.iter().zip(&undone))
        .filter(|(_, undone)| undone.by.is_none())
        .map(|(fitted, _)| &fitted.name)
        .collect();
    chain.model_error_um = model.largest_error_without(&left_out);
    if held_beside {
        chain.latency_s += 0.5 * sample_period_s;
    }
    if matches!(model.family, Family::Mrpi | Family::Wrpi) {
        undone.push(Undone {
            part: Part::RateDependenceOf(model.family),
            by: None,
            note: "its loops at rest are inverted; fit mpi and learn names what widens them (a delay, a lag, a mode)",
        });
    }
    let quasi_static = quasi_static(model);
    let played = played(&quasi_static)?;
    rises(&played)?;
    let (inverse, left_v) = inverse::fit_pairs(&played.series);
    let swing_v = model.input_max - model.input_min;
    chain.inverse = inverse;
    chain.around.rest_um = rest_with_creep(model, sample_period_s)?;
    chain.misfit_percent = 100.0 * left_v / swing_v;
    let spans = played.series.iter().flat_map(|pairs| pairs.position_um.iter().copied());
    let (low, high) = crate::family::range(spans);
    chain.small_signal_um_per_v = (high - low) / swing_v;
    Ok((chain, undone))
}

/// Elements of the core's creep block without any share.
pub(super) fn no_creep() -> CreepPart {
    let decade = |i: usize| 1e-3 * 10f64.powf(i as f64 * 2.0 / 3.0);
    CreepPart {
        tau_s: (0..CREEP_FAST + CREEP_SLOW).map(decade).collect(),
        shares: vec![0.0; CREEP_FAST + CREEP_SLOW],
    }
}

/// Slowest element of creep that keeps its digits in `f32` at every sample, seconds: at 50 kHz a step moves it by 1e-4 of its
/// deviation.
const SLOWEST_FAST_S: f64 = 0.2;

/// How a controller undoes a fitted effect.
fn compensation(fitted: &FittedEffect) -> Result<Compensation, IdentifyError> {
    let effect = fitted.effect().ok_or_else(|| IdentifyError::Control {
        reason: format!(
            "neither the catalogue nor the model has a definition of `{}`",
            fitted.name
        ),
    })?;
    let values: Vec<f64> = fitted.parameters.iter().map(|parameter| parameter.value).collect();
    let wanted = effect.description().parameters.len();
    if values.len() != wanted {
        return Err(IdentifyError::Control {
            reason: format!("`{}` has {} parameters; it needs {wanted}", fitted.name, values.len()),
        });
    }
    Ok(effect.compensation(&values))
}

/// Puts a compensator's numbers where the controller takes them from.
fn take_over(by: Compensator, chain: &mut ControlModel, model: &Model) {
    match by {
        Compensator::Delay { delay_s } => chain.latency_s = delay_s,
        Compensator::Lead {
            amplifier_s,
            growth,
            sensor_s,
        } => {
            chain
                .linear
                .set_lag(amplifier_s, growth, 0.5 * (model.input_min + model.input_max));
            chain.around.sensor_lag_s = sensor_s;
        }
        Compensator::Modes(modes) => {
            chain.linear.modes = modes.into_iter().map(mode_of_stage).collect();
        }
        Compensator::Creep(elements) => creep(&elements, &mut chain.creep),
        Compensator::Coupling {
            gain_um_per_v,
            lead_um_s_per_v,
            weight_um_per_v,
            threshold_v,
        } => chain.around.coupling = Some([gain_um_per_v, lead_um_s_per_v, weight_um_per_v, threshold_v]),
        Compensator::Hum {
            frequency_hz,
            amplitudes_um,
        } => {
            chain.around.hum = Some(HumPart {
                frequency_hz,
                amplitudes_um,
            });
        }
        Compensator::SensorCurve {
            middle_um,
            quadratic_per_um,
            cubic_per_um2,
        } => chain.around.sensor = Some([middle_um, quadratic_per_um, cubic_per_um2]),
        Compensator::ThermalGain {
            reference_c,
            tau_s,
            shift_um_per_k,
            gain_per_k,
        } => chain.around.heat = Some([reference_c, tau_s, shift_um_per_k, gain_per_k]),
        Compensator::HysteresisInverse | Compensator::None => {}
    }
}

/// A few elements into the core's fast and slow ones; unused places keep a share of 0.
fn creep(elements: &[CreepElement], part: &mut CreepPart) {
    let fast = elements
        .iter()
        .filter(|element| element.tau_s <= SLOWEST_FAST_S)
        .count();
    for (i, element) in elements.iter().enumerate() {
        let place = if i < fast {
            CREEP_FAST - fast + i
        } else {
            CREEP_FAST + i - fast
        };
        (part.tau_s[place], part.shares[place]) = (element.tau_s, element.share);
    }
}

/// What a model says of small signals: delay, lags and modes, without gain and hysteresis.
pub(crate) struct Linear {
    pub part: LinearPart,
    delay_s: f64,
    sensor_lag_s: f64,
}

impl Linear {
    /// Of the effects that have such compensators.
    pub(crate) fn of(model: &Model) -> Self {
        let mut linear = Self {
            part: LinearPart {
                lag_s: 0.0,
                lag_growth: None,
                modes: Vec::new(),
            },
            delay_s: 0.0,
            sensor_lag_s: 0.0,
        };
        for compensation in model.effects.iter().filter_map(|fitted| compensation(fitted).ok()) {
            match compensation.by {
                Compensator::Delay { delay_s } => linear.delay_s = delay_s,
                Compensator::Lead {
                    amplifier_s,
                    growth,
                    sensor_s,
                } => {
                    linear
                        .part
                        .set_lag(amplifier_s, growth, 0.5 * (model.input_min + model.input_max));
                    linear.sensor_lag_s = sensor_s;
                }
                Compensator::Modes(modes) => linear.part.modes = modes.into_iter().map(mode_of_stage).collect(),
                _ => {}
            }
        }
        linear
    }

    /// The response; 1 at rest.
    pub(crate) fn response(&self, omega: f64) -> Complex64 {
        let sensor = Complex64::new(1.0, omega * self.sensor_lag_s);
        Complex64::from_polar(1.0, -omega * self.delay_s) * self.part.response(omega) / sensor
    }
}

fn mode_of_stage(mode: StageMode) -> ModeOfStage {
    ModeOfStage {
        frequency_hz: mode.frequency_hz,
        damping: mode.damping,
        share: mode.share,
    }
}

/// A model of which only the effects with such compensators are left.
fn with_compensators(model: &Model, stays: impl Fn(&Compensator) -> bool) -> Model {
    let mut left = model.clone();
    left.effects
        .retain(|fitted| matches!(compensation(fitted), Ok(compensation) if stays(&compensation.by)));
    left
}

/// The hysteresis alone, as slow as can be: what stands in its place and is static stays, all else is taken out.
pub(super) fn quasi_static(model: &Model) -> Model {
    let mut alone = with_compensators(model, |by| *by == Compensator::HysteresisInverse);
    alone.envelope = model.envelope.map(|_| Envelope {
        alpha_s: 0.0,
        beta_s: 0.0,
    });
    alone
}

/// Position at rest at 0 V, micrometres: creep adds its share of the stroke that the middle of the range is away.
fn rest_with_creep(model: &Model, sample_period_s: f64) -> Result<f64, IdentifyError> {
    let settled = with_compensators(model, |by| {
        matches!(by, Compensator::HysteresisInverse | Compensator::Creep(_))
    });
    Ok(settled.simulate_input(&[0.0; 2], sample_period_s, InitialState::REST)?[0])
}

/// Voltages and the displacements that they make, from rest at 0 V.
pub(super) struct Played {
    pub series: Vec<Pairs>,
    /// Position at rest at 0 V, micrometres.
    pub rest_um: f64,
}

/// Time between two samples of a play, seconds: so long that rates are none.
pub(super) const AGES_S: f64 = 1e6;
/// Samples of a sweep over the whole range: steps of a 500th of it, a fifth of the narrowest threshold of the inverse.
const SWEEP: usize = 500;

/// Plays cycles of every size about several middles, and a walk with turns at random places.
pub(super) fn played(model: &Model) -> Result<Played, IdentifyError> {
    let [low, high] = [model.input_min.min(0.0), model.input_max];
    let span = high - low;
    let mut turns: Vec<Vec<f64>> = Vec::new();
    for middle in [0.15, 0.35, 0.5, 0.65, 0.85_f64] {
        // The whole range first, then ever smaller cycles about the middle.
        let mut list = vec![0.0, high, low];
        let reach = middle.min(1.0 - middle);
        for i in 0..24 {
            let size = reach * 0.85_f64.powi(i / 2);
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            list.push(low + span * (middle + side * size));
        }
        turns.push(list);
    }
    // Turns at the points of a sequence that fills the range evenly (fractional parts of multiples of the golden ratio).
    for start in [0.1_f64, 0.47, 0.83] {
        let golden = 0.5 * (5_f64.sqrt() - 1.0);
        let mut list = vec![0.0, high, low];
        list.extend((0..30).map(|i| low + span * (start + golden * f64::from(i)).fract()));
        turns.push(list);
    }
    let rest_um = model.simulate_input(&[0.0; 2], AGES_S, InitialState::REST)?[0];
    let mut series = Vec::with_capacity(turns.len());
    for list in turns {
        let mut voltage_v = vec![0.0];
        for pair in list.windows(2) {
            let steps = ((pair[1] - pair[0]).abs() / span * SWEEP as f64).ceil().max(1.0);
            voltage_v.extend((1..=steps as usize).map(|n| pair[0] + (pair[1] - pair[0]) * n as f64 / steps));
        }
        let position_um = model.simulate_input(&voltage_v, AGES_S, InitialState::REST)?;
        series.push(Pairs {
            position_um: position_um.iter().map(|y| y - rest_um).collect(),
            voltage_v,
            factor: 1.0,
        });
    }
    Ok(Played { series, rest_um })
}

/// How far the displacement may go back in one sweep of the voltage, as a share of the stroke: a model fitted to noise and to effects
/// that it lacks wavers by some thousandths, which the inverse smooths over.
const WAVERS: f64 = 0.01;

/// Refuses a hysteresis whose displacement goes back while the voltage goes on.
fn rises(played: &Played) -> Result<(), IdentifyError> {
    let all = played.series.iter().flat_map(|pairs| pairs.position_um.iter().copied());
    let (low, high) = crate::family::range(all);
    let stroke = high - low;
    let refuse = |reason: String| Err(IdentifyError::Control { reason });
    if stroke.is_nan() || stroke <= 0.0 {
        return refuse(
            "the model does not move between its lowest and highest voltage; fit it to records that do".into(),
        );
    }
    for Pairs {
        voltage_v,
        position_um: x,
        ..
    } in &played.series
    {
        // Farthest along the sweep so far, and the voltage there.
        let (mut farthest, mut at_v, mut last) = (0.0, voltage_v[0], 0.0);
        for (v, x) in voltage_v.windows(2).zip(x.windows(2)) {
            let direction = (v[1] - v[0]).signum();
            if direction != last || (x[1] - farthest) * direction > 0.0 {
                (farthest, at_v, last) = (x[1], v[1], direction);
            }
            let back = (farthest - x[1]) * direction;
            if back > WAVERS * stroke {
                return refuse(format!(
                    "the hysteresis table does not invert: from {at_v:.2} V to {:.2} V the displacement goes back by {back:.2e} um; \
                     fit fewer plays, or record large signals over the whole range",
                    v[1]
                ));
            }
        }
    }
    Ok(())
}
