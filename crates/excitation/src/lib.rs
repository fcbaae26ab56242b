//! Command voltages for experiments: units in the names, whole periods where periodic, seeded where random.

#![forbid(unsafe_code)]

pub mod error;
mod multisine;
mod noise;
mod sine;
mod spectrum;
mod steps;
mod sweep;
mod triangle;

pub use multisine::Multisine;
pub use noise::BandNoise;
pub use sine::{MultiHarmonic, Sine};
pub use steps::Steps;
pub use sweep::{Sweep, SweepLaw};
pub use triangle::{DecayingTriangle, Triangle};

use crate::error::within;

pub use error::ParameterError;

/// Something that can be played on a stage.
pub trait Excitation {
    /// The command, volts at the actuator, one value every `sample_period_s`.
    ///
    /// # Errors
    /// Parameters outside of their range, or that the sample rate cannot show.
    fn samples(&self, sample_period_s: f64) -> Result<Vec<f64>, ParameterError>;

    /// What it is, in words with units.
    fn description(&self) -> String;
}

/// Puts a smooth rise before a command that does not start at 0 V: half a cosine from 0 V to its first value.
///
/// # Errors
/// A rise below one sample or above 1000 s.
pub fn with_rise(command_v: &[f64], rise_s: f64, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
    check_period(sample_period_s)?;
    within("rise_s", rise_s, sample_period_s, 1e3, "give at least one sample")?;
    let first_v = command_v.first().copied().unwrap_or(0.0);
    let steps = (rise_s / sample_period_s).round();
    let rise = (0..steps as usize).map(|n| first_v * 0.5 * (1.0 - (std::f64::consts::PI * n as f64 / steps).cos()));
    Ok(rise.chain(command_v.iter().copied()).collect())
}

fn check_period(sample_period_s: f64) -> Result<(), ParameterError> {
    within("sample_period_s", sample_period_s, 1e-7, 1e3, "50 kHz is 2e-5")
}

fn check_voltage(name: &str, voltage_v: f64) -> Result<(), ParameterError> {
    within(name, voltage_v, -1e4, 1e4, "give volts at the actuator")
}

/// A frequency needs more than four samples a period to look like itself at its peaks.
fn check_frequency(name: &str, frequency_hz: f64, sample_period_s: f64) -> Result<(), ParameterError> {
    within(
        name,
        frequency_hz,
        1e-5,
        0.25 / sample_period_s,
        "sample faster, or lower the frequency",
    )
}

/// Number of samples of a duration, refused where it would not fit in memory.
fn sample_count(duration_s: f64, sample_period_s: f64) -> Result<usize, ParameterError> {
    let samples = (duration_s / sample_period_s).round();
    within(
        "number of samples",
        samples,
        1.0,
        1e9,
        "shorten the record or sample it more slowly",
    )?;
    Ok(samples as usize)
}
