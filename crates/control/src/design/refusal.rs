//! Chains whose inverse would explode: refused with the reason and what to do.

use crate::error::ControlError;
use crate::message::{Message, Setting};
use hysteron_identify::control::ControlModel;
use hysteron_table::short;

/// Longest lag that the core undoes, samples.
const LONGEST_LAG_SAMPLES: f64 = 1000.0;

/// Refuses a chain whose inverse would explode.
///
/// # Errors
/// - a latency longer than the reference is known ahead;
/// - a mode without damping, or above half the sample rate;
/// - a lag that is negative or of more than 1000 samples;
/// - a table that does not rise everywhere, so that it has no inverse;
/// - limits of the command that are not known;
/// - an error of the model that is no rms error.
pub fn refuse(model: &ControlModel, samples_ahead: usize) -> Result<(), ControlError> {
    latency(model, samples_ahead)?;
    modes(model)?;
    lag(model)?;
    table(model)?;
    limits(model)?;
    error(model)
}

fn error(model: &ControlModel) -> Result<(), ControlError> {
    match model.model_error_um {
        // A NaN fails the comparison.
        Some(rms_um) if !(rms_um >= 0.0 && rms_um.is_finite()) => Err(ControlError::Design {
            what: format!(
                "the model's error on its records is said to be {rms_um} um rms; it must be 0 or more and finite"
            ),
            advice: "fit the model again: its history has the error on each record".into(),
        }),
        _ => Ok(()),
    }
}

fn latency(model: &ControlModel, samples_ahead: usize) -> Result<(), ControlError> {
    let period_s = model.sample_period_s;
    let known_s = samples_ahead as f64 * period_s;
    // A live reference is extrapolated, whatever the latency; half a sample more because the lag's inverse meets its values at the
    // end of each sample.
    if samples_ahead == 0 || (0.0..=known_s - 0.5 * period_s).contains(&model.latency_s) {
        return Ok(());
    }
    Err(ControlError::Design {
        what: format!(
            "the latency of {:.0} us is longer than the preview of {:.0} us ({samples_ahead} samples)",
            1e6 * model.latency_s,
            1e6 * known_s
        ),
        advice: Message::from("shorten the controller's latency or run it slower, or design with ")
            .naming(Setting::Live)
            .and(" and accept its limits"),
    })
}

fn modes(model: &ControlModel) -> Result<(), ControlError> {
    let half_rate_hz = 0.5 / model.sample_period_s;
    for (i, mode) in model.linear.modes.iter().enumerate() {
        // A ring of 1/zeta turns: at 1e-4 it outlasts every record of a second.
        if !(mode.damping >= 1e-4 && mode.damping < 1.0) {
            return Err(ControlError::Design {
                what: format!(
                    "mode {} at {:.0} Hz has a damping ratio of {}; its inverse needs 0.0001 to 1",
                    i + 1,
                    mode.frequency_hz,
                    short(mode.damping)
                ),
                advice: "record a longer small multisine, so that the width of the peak can be seen".into(),
            });
        }
        if !(mode.frequency_hz > 0.0 && mode.frequency_hz < half_rate_hz) {
            return Err(ControlError::Design {
                what: format!(
                    "mode {} at {:.0} Hz lies above half the sample rate, {half_rate_hz:.0} Hz",
                    i + 1,
                    mode.frequency_hz
                ),
                advice: "run the controller faster, or take the mode out of the model: below it the stage is rigid"
                    .into(),
            });
        }
    }
    Ok(())
}

fn lag(model: &ControlModel) -> Result<(), ControlError> {
    let longest_s = LONGEST_LAG_SAMPLES * model.sample_period_s;
    if !(0.0..=longest_s).contains(&model.linear.lag_s) {
        return Err(ControlError::Design {
            what: format!(
                "an amplifier's lag of {:.0} us cannot be undone at {:.0} Hz: it asks for more than {LONGEST_LAG_SAMPLES} times \
                 each change of the command",
                1e6 * model.linear.lag_s,
                1.0 / model.sample_period_s
            ),
            advice: "give a lag of 0 to 1000 samples, or identify again".into(),
        });
    }
    Ok(())
}

fn table(model: &ControlModel) -> Result<(), ControlError> {
    if let Some(fading) = &model.fading {
        return fading.to_core::<f64>().map(drop).map_err(|error| ControlError::Design {
            what: format!("the fading elements of the hysteresis do not invert: {error}"),
            advice: "record large signals over the whole stroke, slow and fast, and identify again".into(),
        });
    }
    let slope = model.inverse.smallest_slope_v_per_um();
    if slope.is_nan() || slope <= 0.0 {
        return Err(ControlError::Design {
            what: format!(
                "the hysteresis table does not invert: its voltage falls by {slope:.3} V/um somewhere in its range"
            ),
            advice: "record large signals over the whole stroke, slow and fast, and identify again".into(),
        });
    }
    Ok(())
}

fn limits(model: &ControlModel) -> Result<(), ControlError> {
    if !(model.voltage_min_v.is_finite()
        && model.voltage_max_v.is_finite()
        && model.voltage_min_v < model.voltage_max_v)
        || model.voltage_max_v == f64::MAX
    {
        return Err(ControlError::Design {
            what: "the limits of the command are not known".to_owned(),
            advice: "give known.voltage_min_v and known.voltage_max_v in dataset.toml".into(),
        });
    }
    Ok(())
}
