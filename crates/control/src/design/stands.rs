//! Whether a designed loop stands: the core's feedback run sample by sample on the identified linear part, spread, through converters.
//!
//! Nothing of the design is used but its numbers. The design works with responses over frequency; here time is stepped.

use super::Controller;
use super::feedback::{GAIN_FACTORS, MODE_FACTORS, Unseen};
use super::linear_stage::LinearStage;
use crate::error::ControlError;
use hysteron_core::tracking_law::{Feedback, FeedbackState};
use hysteron_identify::control::{ControlModel, LinearPart};
use rayon::prelude::*;
use std::fmt;

/// A stage on which a loop swings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swings {
    /// Factor on the frequencies of the model's modes.
    pub modes: f64,
    /// Factor on the gain.
    pub gain: f64,
    /// A mode that no record shows, hertz; none but the model's.
    pub unseen_hz: Option<f64>,
}

impl fmt::Display for Swings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "loop gain times {}, modes times {}", self.gain, self.modes)?;
        match self.unseen_hz {
            Some(hz) => write!(f, ", and a mode at {hz:.0} Hz that no record shows"),
            None => Ok(()),
        }
    }
}

/// Where a mode that nobody has seen is put, as multiples of the frequency from which on it may be anywhere.
const UNSEEN_AT: [f64; 4] = [1.0, 1.15, 1.6, 2.5];
/// Codes of a converter over the range.
const CODES: f64 = 65_536.0;
/// The disturbance, in steps of the sensor's converter: small against the range, large against a step.
const DISTURBANCE_STEPS: f64 = 1000.0;
/// Swing that converters keep up by themselves, in steps of both together.
const LIMIT_CYCLE_STEPS: f64 = 20.0;
/// Growth over the disturbance at which a run need not go on.
const RUN_AWAY: f64 = 1e3;
/// Length of a run, in decays of the mode that rings longest: of a loop that halves the damping the last quarter has an eighth of the second.
const RINGS: f64 = 8.0;
/// The same in time constants of the integral.
const SETTLES: f64 = 30.0;
/// Shortest and longest run, seconds.
const SHORTEST_S: f64 = 0.1;
const LONGEST_S: f64 = 4.0;
/// What the last quarter may be of the second one.
const FALLS: f64 = 0.7;

/// The first stage on which the loop does not come to rest; none where it does on all.
///
/// Each run begins with a step of the position and every mode displaced. It comes to rest where the last quarter is below seven tenths of the
/// second one, or down to what converters of 16 bits keep up.
///
/// # Errors
/// A law that the core refuses.
pub fn swings(controller: &Controller) -> Result<Option<Swings>, ControlError> {
    let law = controller.law::<f64>()?;
    let (Some(feedback), Some(unseen)) = (law.feedback(), Unseen::of(&controller.model)) else {
        return Ok(None);
    };
    let model = &controller.model;
    let half_rate_hz = 0.5 / model.sample_period_s;
    let places = UNSEEN_AT.iter().map(|factor| factor * unseen.from_hz);
    let places: Vec<Option<f64>> = std::iter::once(None)
        .chain(places.filter(|hz| *hz < half_rate_hz).map(Some))
        .collect();
    let modes = if model.linear.modes.is_empty() {
        &MODE_FACTORS[1..2]
    } else {
        &MODE_FACTORS[..]
    };
    let spread: Vec<Swings> = places
        .into_iter()
        .flat_map(|unseen_hz| {
            modes
                .iter()
                .flat_map(move |&modes| GAIN_FACTORS.map(|gain| Swings { modes, gain, unseen_hz }))
        })
        .collect();
    let swinging = spread.into_par_iter().find_first(|one| {
        let mut linear = model.linear.clone();
        linear.modes.iter_mut().for_each(|mode| mode.frequency_hz *= one.modes);
        let linear = match one.unseen_hz {
            Some(hz) => unseen.linear(&linear, hz),
            None => linear,
        };
        !comes_to_rest(feedback, model, &linear, one.gain)
    });
    Ok(swinging)
}

fn comes_to_rest(feedback: &Feedback<f64>, model: &ControlModel, linear: &LinearPart, gain: f64) -> bool {
    let period_s = model.sample_period_s;
    let step_v = (model.voltage_max_v - model.voltage_min_v) / CODES;
    let step_um = model.inverse.input_max_um / CODES;
    let disturbance_um = DISTURBANCE_STEPS * step_um;
    let mut stage = LinearStage::of(model, linear, gain).disturbed(disturbance_um);
    let integral_per_s = feedback.integral.gains()[1] / period_s * stage.gain_um_per_v();
    let ringing_s = stage.slowest_per_s().map_or(0.0, |decay| RINGS / decay);
    let length_s = ringing_s.max(SETTLES / integral_per_s).clamp(SHORTEST_S, LONGEST_S);
    let samples = (length_s / period_s) as usize;
    let mut state = FeedbackState::default();
    let mut quarters = [0.0; 4];
    for k in 0..samples {
        let measured_um = (stage.read_um() / step_um).round() * step_um;
        let asked = feedback.ask(&mut state, -measured_um);
        let correction_v = feedback.bound(&mut state, asked);
        feedback.take(&mut state, asked, correction_v - asked.output);
        stage.step((correction_v / step_v).round() * step_v);
        let position_um = stage.position_um();
        // A NaN has run away as well.
        if position_um.is_nan() || position_um.abs() > RUN_AWAY * disturbance_um {
            return false;
        }
        quarters[4 * k / samples.max(1)] += position_um * position_um;
    }
    let rms = |quarter: f64| (4.0 * quarter / samples as f64).sqrt();
    let converters_um = LIMIT_CYCLE_STEPS * (step_um + stage.gain_um_per_v() * step_v);
    rms(quarters[3]) < (FALLS * rms(quarters[1])).max(converters_um)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use hysteron_core::biquad::Biquad;
    use hysteron_core::pi_controller::PiController;
    use hysteron_identify::Covered;
    use hysteron_identify::control::{AroundPart, CreepPart, InversePart, ModeOfStage};

    /// 20 um at 200 V, 50 kHz, half a sample of hold.
    pub(crate) fn rigid() -> ControlModel {
        ControlModel {
            sample_period_s: 20e-6,
            latency_s: 10e-6,
            voltage_min_v: 0.0,
            voltage_max_v: 200.0,
            small_signal_um_per_v: 0.1,
            misfit_percent: 0.0,
            model_error_um: None,
            held_out: Vec::new(),
            linear: LinearPart {
                lag_s: 0.0,
                lag_growth: None,
                modes: Vec::new(),
            },
            creep: CreepPart {
                tau_s: Vec::new(),
                shares: Vec::new(),
            },
            inverse: InversePart {
                input_min_um: 0.0,
                input_max_um: 20.0,
                thresholds_um: Vec::new(),
                offset_v: 0.0,
                input_function: vec![10.0, 0.0, 0.0, 0.0, 0.0],
                linear: Vec::new(),
                quadratic: Vec::new(),
                cubic: Vec::new(),
            },
            fading: None,
            around: AroundPart::default(),
            covered: Covered::default(),
        }
    }

    fn integral(v_per_um_s: f64) -> Feedback<f64> {
        Feedback {
            integral: PiController::new(0.0, v_per_um_s, 50e3).unwrap(),
            series: [Biquad::identity(); 2],
            damping: Biquad::new([0.0; 3], [0.0; 2]).unwrap(),
            trust: None,
        }
    }

    /// What the integral of a loop on a mode alone may be: `K < 2 z w` (Fleming, Leang 2014). A tenth below it comes to rest, a tenth above
    /// it does not.
    #[test]
    fn val_an_integral_on_a_mode_swings_from_the_known_gain_on() {
        let (hz, damping) = (500.0, 0.02);
        let mut model = rigid();
        model.linear.modes.push(ModeOfStage {
            frequency_hz: hz,
            damping,
            share: 1.0,
        });
        let limit_per_s = 2.0 * damping * std::f64::consts::TAU * hz;
        for (share, rests) in [(0.5, true), (0.9, true), (1.1, false), (2.0, false)] {
            // A gain of 0.1 um/V.
            let feedback = integral(share * limit_per_s / 0.1);
            assert_eq!(
                comes_to_rest(&feedback, &model, &model.linear, 1.0),
                rests,
                "{share} of the limit"
            );
        }
    }

    /// A latency of T swings from `K T = pi / 2` on.
    #[test]
    fn val_an_integral_behind_a_latency_swings_from_the_known_gain_on() {
        let mut model = rigid();
        model.latency_s = 510e-6;
        let limit_per_s = std::f64::consts::FRAC_PI_2 / model.latency_s;
        for (share, rests) in [(0.5, true), (0.95, true), (1.05, false)] {
            let feedback = integral(share * limit_per_s / 0.1);
            assert_eq!(
                comes_to_rest(&feedback, &model, &model.linear, 1.0),
                rests,
                "{share} of the limit"
            );
        }
    }
}
