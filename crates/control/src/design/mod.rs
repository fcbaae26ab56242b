//! From the identified chain to a controller: every effect gets its compensator, with reasons where it cannot have one.

pub mod beyond;
pub mod curves;
mod evolution;
pub mod feedback;
pub(crate) mod linear_stage;
pub mod prediction;
pub mod preview;
pub mod refusal;
pub mod source;
pub mod stands;

use crate::error::ControlError;
use feedback::{Effort, FeedbackDesign};
use hysteron_core::biquad::Biquad;
use hysteron_core::law_numbers::{HumNumbers, LawNumbers};
use hysteron_core::real::Real;
use hysteron_core::surroundings::HARMONICS;
use hysteron_identify::control::{ControlModel, FadingPart};
use hysteron_table::Adaptation;
use preview::{AHEAD, PreviewQuality, TAPS, Undone};
use serde::{Deserialize, Serialize};

pub use hysteron_core::surroundings::{DesignedLaw, DesignedState};

/// When the reference is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReferenceKind {
    /// [`AHEAD`] samples before it is due: scans, trajectories.
    Previewed,
    /// Not before it is due: joysticks, outer loops. It must be smooth and digital, never a measurement.
    Live,
}

/// Highest frequency that a live reference is extrapolated for, hertz: smooth references; what lies above is amplified.
const LIVE_BAND_HZ: f64 = 1500.0;

/// Why a controller has no feedback.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OpenLoop {
    /// None was asked for.
    NotAsked,
    /// No record of small signals tells where the stage has modes, and nobody vouches for it.
    NotTold,
    /// No loop keeps the sensitivity that was asked for.
    NoneRobust,
    /// Every loop that the design found swings on a stage that the records allow.
    Swings,
}

/// A controller: the identified chain and what was designed on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Version of the file's form.
    pub format: u32,
    /// When the reference is known.
    pub reference: ReferenceKind,
    /// Samples that the reference comes before it is due.
    pub samples_ahead: usize,
    /// Coefficients of the preview filter, the newest sample's first.
    pub preview: Vec<f64>,
    /// Feedback; none where `open_loop` says why.
    pub feedback: Option<FeedbackDesign>,
    /// Why there is no feedback.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub open_loop: Option<OpenLoop>,
    /// What is learned of gain, zero and lag while the law runs; nothing without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<Adaptation>,
    /// The identified chain.
    pub model: ControlModel,
}

/// The form written.
const FORMAT: u32 = 2;

/// Loops that are designed before there is none.
const DESIGNS: usize = 3;
/// What a tighter one may have of the sensitivity's peak above 1.
const TIGHTER: f64 = 0.7;

impl Controller {
    /// Designs a controller on an identified chain.
    ///
    /// # Errors
    /// A chain that cannot be undone: see [`refusal::refuse`].
    pub fn design(model: &ControlModel, reference: ReferenceKind) -> Result<Self, ControlError> {
        let (samples_ahead, band_hz) = match reference {
            ReferenceKind::Previewed => (AHEAD, band_hz(model)),
            ReferenceKind::Live => (0, LIVE_BAND_HZ.min(band_hz(model))),
        };
        refusal::refuse(model, samples_ahead)?;
        let taps = preview::design(&undone(model, samples_ahead)?, band_hz);
        Ok(Self {
            format: FORMAT,
            reference,
            samples_ahead,
            preview: taps.to_vec(),
            feedback: None,
            open_loop: Some(OpenLoop::NotAsked),
            adaptation: None,
            model: model.clone(),
        })
    }

    /// The same controller, which learns gain, zero and lag while it runs: the gain by `gain_bound` at most, a share.
    #[must_use]
    pub fn adapting(self, gain_bound: f64) -> Self {
        let stroke_um = self.model.inverse.input_max_um - self.model.inverse.input_min_um;
        let range_v = self.model.voltage_max_v - self.model.voltage_min_v;
        Self {
            adaptation: Some(Adaptation::within(
                gain_bound,
                stroke_um,
                range_v,
                self.model.covered.swing_hz,
            )),
            ..self
        }
    }

    /// The same controller with feedback, where there is a robust one.
    ///
    /// # Errors
    /// As [`Self::with_feedback_within`].
    pub fn with_feedback(self) -> Result<Self, ControlError> {
        self.with_feedback_within(feedback::LARGEST_SENSITIVITY, Effort::Whole)
    }

    /// As [`Self::with_feedback`], with another largest peak of the sensitivity.
    ///
    /// A loop is designed on responses over frequency, and then run in time on each stage that the records allow, see [`stands::swings`].
    /// Where it swings on one of them, a tighter one is designed, twice at most.
    ///
    /// # Errors
    /// A law that the core refuses.
    pub fn with_feedback_within(self, largest_sensitivity: f64, effort: Effort) -> Result<Self, ControlError> {
        if self.model.covered.told_to_hz().is_none() {
            return Ok(self.open(OpenLoop::NotTold));
        }
        let mut peak = largest_sensitivity;
        for _ in 0..DESIGNS {
            let Some(feedback) = feedback::design(&self.model, peak, effort) else {
                let why = if peak < largest_sensitivity {
                    OpenLoop::Swings
                } else {
                    OpenLoop::NoneRobust
                };
                return Ok(self.open(why));
            };
            let closed = Self {
                feedback: Some(feedback),
                open_loop: None,
                ..self.clone()
            };
            if stands::swings(&closed)?.is_none() {
                return Ok(closed);
            }
            peak = 1.0 + TIGHTER * (peak - 1.0);
        }
        Ok(self.open(OpenLoop::Swings))
    }

    fn open(self, why: OpenLoop) -> Self {
        Self {
            feedback: None,
            open_loop: Some(why),
            ..self
        }
    }

    /// The same controller in open loop; hum is still learned from the sensor where the chain has any.
    #[must_use]
    pub fn without_feedback(&self) -> Self {
        self.clone().open(self.open_loop.unwrap_or(OpenLoop::NotAsked))
    }

    /// What the preview filter reaches on the identified linear part.
    ///
    /// # Errors
    /// Modes that the core refuses.
    pub fn preview_quality(&self) -> Result<PreviewQuality, ControlError> {
        let mut taps = [0.0; TAPS];
        taps.iter_mut()
            .zip(&self.preview)
            .for_each(|(tap, value)| *tap = *value);
        Ok(preview::quality(&taps, &undone(&self.model, self.samples_ahead)?))
    }

    /// Error of the position at one frequency, as a share of the reference, that the preview filter leaves on the identified linear
    /// part.
    pub(crate) fn preview_error_at(&self, frequency_hz: f64) -> Result<f64, ControlError> {
        let mut taps = [0.0; TAPS];
        taps.iter_mut()
            .zip(&self.preview)
            .for_each(|(tap, value)| *tap = *value);
        Ok(preview::error_at(
            &taps,
            &undone(&self.model, self.samples_ahead)?,
            frequency_hz,
        ))
    }

    /// The control law, open or closed, in the number type of the host or the chip.
    ///
    /// # Errors
    /// Values that the core refuses.
    pub fn law<T: Real>(&self) -> Result<DesignedLaw<T>, ControlError> {
        let fading = self.model.fading.as_ref().map(FadingPart::to_core).transpose()?;
        Ok(self.of_plays()?.designed(fading)?)
    }

    /// All numbers of the law, as a table has them.
    ///
    /// # Errors
    /// Lists of other lengths than the law's, modes that the core refuses, fading elements, of which there is no table.
    pub fn numbers(&self) -> Result<LawNumbers, ControlError> {
        if self.model.fading.is_some() {
            return Err(ControlError::Wish(
                "this controller undoes its hysteresis by fading elements, and a table holds plays only; run its law on the host, in Python or \
                 by the C library"
                    .into(),
            ));
        }
        self.of_plays()
    }

    /// All numbers but those of fading elements.
    fn of_plays(&self) -> Result<LawNumbers, ControlError> {
        let model = &self.model;
        let sample_rate_hz = 1.0 / model.sample_period_s;
        let preview: [f64; TAPS] = self.preview.as_slice().try_into().map_err(|_| ControlError::Design {
            what: format!(
                "the controller has {} preview coefficients, the law {TAPS}",
                self.preview.len()
            ),
            advice: "design the controller again with this version".into(),
        })?;
        let ([b0, b1, b2], [a1, a2]) = second_mode(model)?.coefficients();
        let (creep_fast, creep_slow) = model.creep.numbers()?;
        let (low_v, high_v) = (model.voltage_min_v, model.voltage_max_v);
        let around = &model.around;
        Ok(LawNumbers {
            sample_rate_hz,
            samples_ahead: self.samples_ahead,
            preview,
            second_mode: [b0, b1, b2, a1, a2],
            creep_fast,
            creep_slow,
            inverse: model.inverse.numbers()?,
            lag_s: model.linear.lag_s,
            lag_growth: model.linear.lag_growth,
            feedback: self.feedback.as_ref().map(FeedbackDesign::numbers),
            command_min_v: low_v,
            command_max_v: high_v,
            // The whole range in one sample is no limit.
            slew_v_per_s: (high_v - low_v) * sample_rate_hz,
            rest_um: around.rest_um,
            sensor_lag_s: around.sensor_lag_s,
            coupling: around.coupling,
            cross_um_per_um: None,
            hum: self.hum_numbers(),
            heat: around.heat,
            sensor: around.sensor,
            adaptation: self.adaptation.as_ref().map(Adaptation::numbers),
        })
    }

    /// Harmonics of less than a hundredth of the largest are left alone: learning them would only pass the sensor's noise on.
    fn hum_numbers(&self) -> Option<HumNumbers> {
        let hum = self.model.around.hum.as_ref()?;
        let largest = hum.amplitudes_um.iter().fold(0.0, |most: f64, a| most.max(*a));
        let mut sensitivity = [[0.0; 2]; HARMONICS];
        for (k, (cell, amplitude)) in sensitivity.iter_mut().zip(&hum.amplitudes_um).enumerate() {
            if *amplitude > 0.01 * largest {
                let omega = std::f64::consts::TAU * (k + 1) as f64 * hum.frequency_hz;
                let seen = feedback::sensitivity(&self.model, self.feedback.as_ref(), omega);
                *cell = [seen.re, seen.im];
            }
        }
        Some(HumNumbers {
            frequency_hz: hum.frequency_hz,
            sensitivity,
            learning_s: HUM_S,
            // A record's hum and today's may differ: up to five times as much is learned.
            largest_um: 5.0 * hum.amplitudes_um.iter().sum::<f64>(),
        })
    }
}

/// Time constant of learning the hum, seconds: a bandwidth of half a hertz, more than the line wanders in.
const HUM_S: f64 = 0.3;

/// A delay is identified to about a microsecond, a twentieth of a sample: a step that close to a sample's instant has not arrived.
const ARRIVES: f64 = 0.05;

/// How early the inverse has to come, seconds: the latency (half a sample of it is the converter's hold), and what lies between
/// the middle of a held command and the instant at which the position has to be right.
///
/// Behind an amplifier's lag the voltage meets its value at the end of a held command: half a sample more. On the way it has been ahead of
/// a straight line, by the mean of its path less a half, `1 / (1 - e^-a) - 1 / a` with a the samples a lag; a mode averages that. Where
/// nothing averages and nothing lags, the position at a sample is one of the steps: whole samples.
fn advance_s(model: &ControlModel) -> f64 {
    let (period_s, lag_s) = (model.sample_period_s, model.linear.lag_s);
    let samples_a_lag = period_s / lag_s;
    let mean = if lag_s > 0.0 {
        1.0 / (1.0 - (-samples_a_lag).exp()) - 1.0 / samples_a_lag
    } else {
        1.0
    };
    match (model.linear.modes.is_empty(), lag_s > 0.0) {
        (false, _) => model.latency_s + (1.0 - mean) * period_s,
        (true, true) => model.latency_s + 0.5 * period_s,
        (true, false) => ((model.latency_s / period_s - 0.5 + ARRIVES).floor() + 1.0) * period_s,
    }
}

/// The band that the preview filter works in, hertz: to three times the first mode, where the stage still moves by an
/// eighth; with a second mode that has no section of its own, to 0.7 of it; at most an eighth of the sample rate.
fn band_hz(model: &ControlModel) -> f64 {
    let modes = &model.linear.modes;
    let first_hz = modes.first().map_or(f64::INFINITY, |mode| 3.0 * mode.frequency_hz);
    let second_hz = match (model.linear.antiresonance(), modes.get(1)) {
        (None, Some(mode)) => 0.7 * mode.frequency_hz,
        _ => f64::INFINITY,
    };
    first_hz.min(second_hz).min(0.125 / model.sample_period_s)
}

/// The second mode and the antiresonance below it, undone; identity without.
fn second_mode(model: &ControlModel) -> Result<Biquad<f64>, ControlError> {
    match (model.linear.antiresonance(), model.linear.modes.get(1)) {
        (Some(antiresonance), Some(mode)) => Ok(Biquad::mode_swap(
            [mode.frequency_hz, mode.damping],
            antiresonance,
            1.0 / model.sample_period_s,
        )?),
        _ => Ok(Biquad::identity()),
    }
}

fn undone(model: &ControlModel, ahead: usize) -> Result<Undone<'_>, ControlError> {
    Ok(Undone {
        linear: &model.linear,
        second_mode: second_mode(model)?,
        advance_s: advance_s(model),
        period_s: model.sample_period_s,
        ahead,
    })
}

impl Controller {
    /// Whether a file means to be a controller.
    pub fn is_one(path: &std::path::Path) -> bool {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        toml::from_str::<toml::Table>(&text).is_ok_and(|table| table.contains_key("samples_ahead"))
    }

    /// Reads a controller file.
    ///
    /// # Errors
    /// A file that cannot be read, is no controller, or holds a chain that cannot be undone.
    pub fn read(path: &std::path::Path) -> Result<Self, ControlError> {
        let refused = |reason: String| ControlError::ControllerFile {
            file: path.display().to_string(),
            reason,
        };
        let text = std::fs::read_to_string(path).map_err(|error| refused(error.to_string()))?;
        let controller: Self = toml::from_str(&text)
            .map_err(|error| refused(format!("{error}\nwrite a controller with `hysteron design`")))?;
        if controller.format != FORMAT {
            return Err(refused(format!(
                "format {} is not known, this version reads {FORMAT}; design the controller again",
                controller.format
            )));
        }
        refusal::refuse(&controller.model, controller.samples_ahead)?;
        controller.law::<f64>()?;
        Ok(controller)
    }

    /// The controller as a file's text.
    ///
    /// # Errors
    /// Values that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, ControlError> {
        toml::to_string(self).map_err(|error| ControlError::ControllerFile {
            file: "controller".to_owned(),
            reason: error.to_string(),
        })
    }
}
