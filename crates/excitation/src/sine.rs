//! One sine, and the paper's sum of two.

use super::{Excitation, check_frequency, check_period, check_voltage, sample_count};
use crate::error::{ParameterError, within};

/// A sine that starts at its lowest point: `low + (high - low) (1 - cos 2 pi f t) / 2`.
///
/// ```
/// use hysteron_excitation::{Excitation, Sine};
/// let sine = Sine { frequency_hz: 500.0, low_v: 0.0, high_v: 26.0, periods: 4.0 };
/// let command_v = sine.samples(20e-6)?;
/// assert_eq!(command_v.len(), 400);
/// assert_eq!(command_v[0], 0.0);
/// assert!((command_v[50] - 26.0).abs() < 1e-12);
/// # Ok::<(), hysteron_excitation::ParameterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sine {
    /// Frequency, hertz.
    pub frequency_hz: f64,
    /// Lowest voltage, volts.
    pub low_v: f64,
    /// Highest voltage, volts.
    pub high_v: f64,
    /// Length, periods.
    pub periods: f64,
}

impl Excitation for Sine {
    fn samples(&self, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
        check_period(sample_period_s)?;
        check_frequency("sine.frequency_hz", self.frequency_hz, sample_period_s)?;
        check_voltage("sine.low_v", self.low_v)?;
        check_voltage("sine.high_v", self.high_v)?;
        within(
            "sine.periods",
            self.periods,
            1e-3,
            1e7,
            "give a positive number of periods",
        )?;
        let omega = std::f64::consts::TAU * self.frequency_hz * sample_period_s;
        let half_v = 0.5 * (self.high_v - self.low_v);
        let samples = sample_count(self.periods / self.frequency_hz, sample_period_s)?;
        Ok((0..samples)
            .map(|n| self.low_v + half_v * (1.0 - (omega * n as f64).cos()))
            .collect())
    }

    fn description(&self) -> String {
        format!(
            "sine {} Hz, {} to {} V, {} periods",
            self.frequency_hz, self.low_v, self.high_v, self.periods
        )
    }
}

/// The paper's complex harmonic: `full (0.25 sin x + 0.3 sin 3x + 0.5)`, x = 2 pi f t. It starts in mid stroke: put a rise before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MultiHarmonic {
    /// Fundamental frequency, hertz.
    pub frequency_hz: f64,
    /// Voltage of the value 1 (the signal runs from 0.067 to 0.933 of it), volts.
    pub full_v: f64,
    /// Length, periods.
    pub periods: f64,
}

impl Excitation for MultiHarmonic {
    fn samples(&self, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
        check_period(sample_period_s)?;
        check_frequency(
            "multi_harmonic: three times frequency_hz",
            3.0 * self.frequency_hz,
            sample_period_s,
        )?;
        check_voltage("multi_harmonic.full_v", self.full_v)?;
        within(
            "multi_harmonic.periods",
            self.periods,
            1e-3,
            1e7,
            "give a positive number of periods",
        )?;
        let omega = std::f64::consts::TAU * self.frequency_hz * sample_period_s;
        let samples = sample_count(self.periods / self.frequency_hz, sample_period_s)?;
        let value = |n: usize| {
            let x = omega * n as f64;
            self.full_v * (0.25 * x.sin() + 0.3 * (3.0 * x).sin() + 0.5)
        };
        Ok((0..samples).map(value).collect())
    }

    fn description(&self) -> String {
        format!(
            "complex harmonic 0.25 sin x + 0.3 sin 3x + 0.5, {} Hz, of {} V, {} periods",
            self.frequency_hz, self.full_v, self.periods
        )
    }
}
