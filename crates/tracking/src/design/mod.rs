//! From the identified chain to a controller: every effect gets its compensator, with reasons where it cannot have one.

pub mod feedback;
pub mod preview;

use crate::error::TrackingError;
use feedback::FeedbackDesign;
use hysteron_core::biquad::Biquad;
use hysteron_core::effects::lag::HeldLagInverse;
use hysteron_core::limiter::Limiter;
use hysteron_core::preview::Preview;
use hysteron_core::real::Real;
use hysteron_core::tracking_law::{Feedforward, TrackingLaw};
use hysteron_identify::control::ControlModel;
use hysteron_identify::control::model::{CREEP_FAST, CREEP_SLOW, PLAYS};
use preview::{AHEAD, PreviewQuality, TAPS, Undone};
use serde::{Deserialize, Serialize};

/// The law with the sizes of a designed controller.
pub type CompleteLaw<T> = TrackingLaw<T, TAPS, PLAYS, CREEP_FAST, CREEP_SLOW>;

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
    /// Feedback; none where no loop is robust, or none was asked for.
    pub feedback: Option<FeedbackDesign>,
    /// The identified chain.
    pub model: ControlModel,
}

/// The form written.
const FORMAT: u32 = 1;

impl Controller {
    /// Designs a controller on an identified chain.
    ///
    /// # Errors
    /// A chain that cannot be undone: see [`refuse`].
    pub fn design(model: &ControlModel, reference: ReferenceKind) -> Result<Self, TrackingError> {
        refuse(model)?;
        let period_s = model.sample_period_s;
        let band_hz = band_hz(model);
        let (samples_ahead, band_hz) = match reference {
            ReferenceKind::Previewed => (AHEAD, band_hz),
            ReferenceKind::Live => (0, LIVE_BAND_HZ.min(band_hz)),
        };
        let advance_s = advance_s(model);
        if samples_ahead > 0 && advance_s > samples_ahead as f64 * period_s {
            return Err(TrackingError::Design {
                what: format!(
                    "the latency of {:.0} us is longer than the preview of {:.0} us ({samples_ahead} samples)",
                    1e6 * model.latency_s,
                    1e6 * samples_ahead as f64 * period_s
                ),
                advice: "shorten the controller's latency, or design with --reference live and accept its limits",
            });
        }
        let taps = preview::design(&undone(model, samples_ahead)?, band_hz);
        Ok(Self {
            format: FORMAT,
            reference,
            samples_ahead,
            preview: taps.to_vec(),
            feedback: None,
            model: model.clone(),
        })
    }

    /// The same controller with feedback, where there is a robust one.
    #[must_use]
    pub fn with_feedback(self) -> Self {
        Self {
            feedback: feedback::design(&self.model),
            ..self
        }
    }

    /// What the preview filter reaches on the identified linear part.
    ///
    /// # Errors
    /// Modes that the core refuses.
    pub fn preview_quality(&self) -> Result<PreviewQuality, TrackingError> {
        let mut taps = [0.0; TAPS];
        taps.iter_mut()
            .zip(&self.preview)
            .for_each(|(tap, value)| *tap = *value);
        Ok(preview::quality(&taps, &undone(&self.model, self.samples_ahead)?))
    }

    /// The control law, open or closed, in the number type of the host or the chip.
    ///
    /// # Errors
    /// Values that the core refuses.
    pub fn law<T: Real>(&self) -> Result<CompleteLaw<T>, TrackingError> {
        let model = &self.model;
        let rate_hz = 1.0 / model.sample_period_s;
        let taps: [f64; TAPS] = self.preview.as_slice().try_into().map_err(|_| TrackingError::Design {
            what: format!(
                "the controller has {} preview coefficients, the law {TAPS}",
                self.preview.len()
            ),
            advice: "design the controller again with this version",
        })?;
        let (low_v, high_v) = (model.voltage_min_v, model.voltage_max_v);
        Ok(TrackingLaw {
            feedforward: Feedforward {
                preview: Preview::new(taps, self.samples_ahead)?,
                second_mode: second_mode(model)?,
                creep: model.creep.to_core(rate_hz)?,
                hysteresis: model.inverse.to_core(rate_hz)?,
                lead: HeldLagInverse::new(model.linear.lag_s, rate_hz)?,
            },
            feedback: self
                .feedback
                .as_ref()
                .map(|design| design.to_core(rate_hz))
                .transpose()?,
            // The whole range in one sample is no limit.
            limiter: Limiter::new(
                T::from_f64(low_v),
                T::from_f64(high_v),
                T::from_f64((high_v - low_v) * rate_hz),
                T::from_f64(rate_hz),
            )?,
        })
    }
}

/// How early the inverse has to come: the latency, and half a sample because the lag's inverse meets its values at the end
/// of each sample.
fn advance_s(model: &ControlModel) -> f64 {
    model.latency_s + 0.5 * model.sample_period_s
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
fn second_mode<T: Real>(model: &ControlModel) -> Result<Biquad<T>, TrackingError> {
    match (model.linear.antiresonance(), model.linear.modes.get(1)) {
        (Some(antiresonance), Some(mode)) => Ok(Biquad::mode_swap(
            [mode.frequency_hz, mode.damping],
            antiresonance,
            1.0 / model.sample_period_s,
        )?),
        _ => Ok(Biquad::identity()),
    }
}

fn undone(model: &ControlModel, ahead: usize) -> Result<Undone<'_>, TrackingError> {
    Ok(Undone {
        linear: &model.linear,
        second_mode: second_mode(model)?,
        advance_s: advance_s(model),
        period_s: model.sample_period_s,
        ahead,
    })
}

/// Longest lag that the core undoes, samples.
const LONGEST_LAG_SAMPLES: f64 = 1000.0;

/// Refuses a chain whose inverse would explode.
///
/// # Errors
/// - a mode without damping, or above half the sample rate;
/// - a lag that is negative or of more than 1000 samples;
/// - a table that does not rise everywhere, so that it has no inverse;
/// - limits of the command that are not known.
pub fn refuse(model: &ControlModel) -> Result<(), TrackingError> {
    let half_rate_hz = 0.5 / model.sample_period_s;
    for (i, mode) in model.linear.modes.iter().enumerate() {
        // A ring of 1/zeta turns: at 1e-4 it outlasts every record of a second.
        if !(mode.damping >= 1e-4 && mode.damping < 1.0) {
            return Err(TrackingError::Design {
                what: format!(
                    "mode {} at {:.0} Hz has a damping ratio of {}; its inverse needs 0.0001 to 1",
                    i + 1,
                    mode.frequency_hz,
                    mode.damping
                ),
                advice: "record a longer small multisine, so that the width of the peak can be seen",
            });
        }
        if !(mode.frequency_hz > 0.0 && mode.frequency_hz < half_rate_hz) {
            return Err(TrackingError::Design {
                what: format!(
                    "mode {} at {:.0} Hz lies above half the sample rate, {half_rate_hz:.0} Hz",
                    i + 1,
                    mode.frequency_hz
                ),
                advice: "run the controller faster, or take the mode out of the model: below it the stage is rigid",
            });
        }
    }
    let longest_s = LONGEST_LAG_SAMPLES * model.sample_period_s;
    if !(0.0..=longest_s).contains(&model.linear.lag_s) {
        return Err(TrackingError::Design {
            what: format!(
                "an amplifier's lag of {:.0} us cannot be undone at {:.0} Hz: it asks for more than {LONGEST_LAG_SAMPLES} times \
                 each change of the command",
                1e6 * model.linear.lag_s,
                2.0 * half_rate_hz
            ),
            advice: "give a lag of 0 to 1000 samples, or identify again",
        });
    }
    let slope = model.inverse.smallest_slope_v_per_um();
    if slope.is_nan() || slope <= 0.0 {
        return Err(TrackingError::Design {
            what: format!(
                "the hysteresis table does not invert: its voltage falls by {slope:.3} V/um somewhere in its range"
            ),
            advice: "record large signals over the whole stroke, slow and fast, and identify again",
        });
    }
    if !(model.voltage_min_v.is_finite()
        && model.voltage_max_v.is_finite()
        && model.voltage_min_v < model.voltage_max_v)
        || model.voltage_max_v == f64::MAX
    {
        return Err(TrackingError::Design {
            what: "the limits of the command are not known".to_owned(),
            advice: "give known.voltage_min_v and known.voltage_max_v in dataset.toml",
        });
    }
    Ok(())
}

impl Controller {
    /// Reads a controller file.
    ///
    /// # Errors
    /// A file that cannot be read, is no controller, or holds a chain that cannot be undone.
    pub fn read(path: &std::path::Path) -> Result<Self, TrackingError> {
        let refused = |reason: String| TrackingError::ControllerFile {
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
        refuse(&controller.model)?;
        controller.law::<f64>()?;
        Ok(controller)
    }

    /// The controller as a file's text.
    ///
    /// # Errors
    /// Values that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, TrackingError> {
        toml::to_string(self).map_err(|error| TrackingError::ControllerFile {
            file: "controller".to_owned(),
            reason: error.to_string(),
        })
    }
}
