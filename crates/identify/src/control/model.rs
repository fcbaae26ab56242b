//! The identified chain as a controller needs it.

use super::fading_part::FadingPart;
use super::held_out::HeldOut;
use super::linear_part::LinearPart;
use crate::covered::Covered;
use hysteron_core::corner_polynomial::CornerPolynomial;
use hysteron_core::effects::creep::CreepInverse;
use hysteron_core::error::ParamError;
use hysteron_core::law_numbers::{CreepNumbers, InverseNumbers};
use hysteron_core::real::Real;
use serde::{Deserialize, Serialize};

pub use hysteron_core::tracking_law::{CREEP_DIVIDER, CREEP_FAST, CREEP_SLOW, PLAYS};

/// Elements of creep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CreepPart {
    /// Time constants, seconds, ascending.
    pub tau_s: Vec<f64>,
    /// Displacement still to come over the one that came at once, for each.
    pub shares: Vec<f64>,
}

/// The direct inverse of the hysteresis: position before creep in, voltage behind the lag out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InversePart {
    /// Inputs that the inverse was identified on, micrometres.
    pub input_min_um: f64,
    /// Inputs that the inverse was identified on, micrometres.
    pub input_max_um: f64,
    /// Thresholds of the plays, micrometres.
    pub thresholds_um: Vec<f64>,
    /// Constant, volts.
    pub offset_v: f64,
    /// Coefficients of x, x^2, .. x^5.
    pub input_function: Vec<f64>,
    /// Coefficients of each play's output.
    pub linear: Vec<f64>,
    /// Coefficients of its square.
    pub quadratic: Vec<f64>,
    /// Coefficients of its cube.
    pub cubic: Vec<f64>,
}

/// Everything a controller undoes, as identified from records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlModel {
    /// Sample period of the records and of the controller, seconds.
    pub sample_period_s: f64,
    /// Latency of the controller, half a sample of hold included, seconds: of a campaign, as its records say it, within 1.5 samples of what
    /// is known.
    pub latency_s: f64,
    /// Lowest command, volts.
    pub voltage_min_v: f64,
    /// Highest command, volts.
    pub voltage_max_v: f64,
    /// Static gain for small signals about the bias, micrometres per volt.
    pub small_signal_um_per_v: f64,
    /// Rms of the inverse's error on the last records, percent of their peak to peak.
    pub misfit_percent: f64,
    /// Largest rms error on a record, those held out included, micrometres, by the model's history, without the effects that are left out;
    /// none where that was not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_error_um: Option<f64>,
    /// What references of the last pass came to while no fit had seen their records; empty of other records.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub held_out: Vec<HeldOut>,
    /// Lag and modes.
    pub linear: LinearPart,
    /// Creep.
    pub creep: CreepPart,
    /// Hysteresis, by plays.
    pub inverse: InversePart,
    /// Hysteresis of Duhem's kind, which stands in the place of the plays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fading: Option<FadingPart>,
    /// What acts on the position beside the command.
    #[serde(default)]
    pub around: AroundPart,
    /// What the records cover.
    #[serde(default)]
    pub covered: Covered,
}

/// What acts on the position beside the command, as far as it was identified.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AroundPart {
    /// Position at rest at 0 V, micrometres.
    pub rest_um: f64,
    /// Time constant of the sensor's lag, seconds; 0 for none.
    pub sensor_lag_s: f64,
    /// The other axis: gain (um/V), lead (um s/V), weight (um/V) and threshold (V) of its play.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coupling: Option<[f64; 4]>,
    /// The mains.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hum: Option<HumPart>,
    /// Heat: reference (degC), time constant (s), shift (um/K), gain (1/K).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heat: Option<[f64; 4]>,
    /// The sensor's curve: middle (um), quadratic (1/um), cubic (1/um^2).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor: Option<[f64; 3]>,
}

/// Hum: its phases differ from record to record and are learned in the loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HumPart {
    /// Frequency of the line, hertz.
    pub frequency_hz: f64,
    /// Amplitudes of the harmonics, micrometres.
    pub amplitudes_um: Vec<f64>,
}

fn array<const N: usize>(name: &'static str, values: &[f64]) -> Result<[f64; N], ParamError> {
    values.try_into().map_err(|_| ParamError::OutOfRange {
        name,
        index: None,
        value: values.len() as f64,
        min: N as f64,
        max: N as f64,
    })
}

impl CreepPart {
    /// The fast and the slow elements as the core takes them.
    ///
    /// # Errors
    /// Another number of elements than the core's block has.
    pub fn numbers(&self) -> Result<(CreepNumbers<CREEP_FAST>, CreepNumbers<CREEP_SLOW>), ParamError> {
        let (fast_c, slow_c) = self.shares.split_at(CREEP_FAST.min(self.shares.len()));
        let (fast_s, slow_s) = self.tau_s.split_at(CREEP_FAST.min(self.tau_s.len()));
        let fast = CreepNumbers {
            shares: array("number of fast creep shares", fast_c)?,
            tau_s: array("number of fast creep times", fast_s)?,
        };
        let slow = CreepNumbers {
            shares: array("number of slow creep shares", slow_c)?,
            tau_s: array("number of slow creep times", slow_s)?,
        };
        Ok((fast, slow))
    }

    /// The core's inverse.
    ///
    /// # Errors
    /// As [`Self::numbers`]; shares or times that the core refuses.
    pub fn to_core<T: Real>(&self, sample_rate_hz: f64) -> Result<CreepInverse<T, CREEP_FAST, CREEP_SLOW>, ParamError> {
        let (fast, slow) = self.numbers()?;
        CreepInverse::new(
            [fast.shares, fast.tau_s],
            [slow.shares, slow.tau_s],
            sample_rate_hz,
            CREEP_DIVIDER,
        )
    }
}

impl InversePart {
    /// The inverse as the core takes it.
    ///
    /// # Errors
    /// Another number of plays than the core's table has.
    pub fn numbers(&self) -> Result<InverseNumbers, ParamError> {
        Ok(InverseNumbers {
            min_um: self.input_min_um,
            max_um: self.input_max_um,
            thresholds_um: array("number of thresholds", &self.thresholds_um)?,
            offset_v: self.offset_v,
            input_function: array("number of powers", &self.input_function)?,
            linear: array("number of linear coefficients", &self.linear)?,
            quadratic: array("number of quadratic coefficients", &self.quadratic)?,
            cubic: array("number of cubic coefficients", &self.cubic)?,
        })
    }

    /// The core's inverse, its input limited to what it was identified on.
    ///
    /// # Errors
    /// As [`Self::numbers`]; values that the core refuses.
    pub fn to_core<T: Real>(&self, sample_rate_hz: f64) -> Result<CornerPolynomial<T, PLAYS>, ParamError> {
        self.numbers()?.inverse(sample_rate_hz)
    }

    /// Smallest incremental slope that the inverse has anywhere, volts per micrometre: below zero it is no inverse.
    ///
    /// After a turn only the input function and plays whose threshold is passed move; with all earlier plays moving the
    /// slope is `g'(x) + sum_{i <= n} (q1_i + 2 q2_i w + 3 q3_i w^2)`. Checked along major branches up and down.
    pub fn smallest_slope_v_per_um(&self) -> f64 {
        const STEPS: usize = 200;
        let (low, high) = (self.input_min_um.max(0.0), self.input_max_um);
        let slope_of_input = |x: f64| -> f64 {
            let powers = self.input_function.iter().zip(1..);
            powers.map(|(c, n)| f64::from(n) * c * x.powi(n - 1)).sum()
        };
        let slope_of_play =
            |i: usize, w: f64| self.linear[i] + 2.0 * self.quadratic[i] * w + 3.0 * self.cubic[i] * w * w;
        let mut smallest = f64::INFINITY;
        for turn in 0..=4 {
            let from = low + (high - low) * f64::from(turn) / 4.0;
            for step in 0..=STEPS {
                let x = low + (high - low) * step as f64 / STEPS as f64;
                let moved = (x - from).abs();
                let plays: f64 = (0..self.thresholds_um.len())
                    .filter(|&i| self.thresholds_um[i] < moved)
                    .map(|i| slope_of_play(i, if x > from { x - self.thresholds_um[i] } else { x }))
                    .sum();
                smallest = smallest.min(slope_of_input(x) + plays);
            }
        }
        smallest
    }
}
