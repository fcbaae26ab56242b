//! A sine whose frequency runs through a range.

use super::{Excitation, check_frequency, check_period, check_voltage, sample_count};
use crate::error::{ParameterError, ordered, within};

/// How the frequency of a sweep runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SweepLaw {
    /// Evenly in hertz.
    Linear,
    /// Evenly in octaves.
    Logarithmic,
}

/// A sine sweep from `start_hz` to `end_hz` that starts at its lowest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// First frequency, hertz.
    pub start_hz: f64,
    /// Last frequency, hertz.
    pub end_hz: f64,
    /// How the frequency runs.
    pub law: SweepLaw,
    /// Length, seconds.
    pub duration_s: f64,
    /// Lowest voltage, volts.
    pub low_v: f64,
    /// Highest voltage, volts.
    pub high_v: f64,
}

impl Excitation for Sweep {
    fn samples(&self, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
        check_period(sample_period_s)?;
        check_frequency("sweep.start_hz", self.start_hz, sample_period_s)?;
        check_frequency("sweep.end_hz", self.end_hz, sample_period_s)?;
        ordered("sweep.start_hz", self.start_hz, "sweep.end_hz", self.end_hz)?;
        within(
            "sweep.duration_s",
            self.duration_s,
            1.0 / self.start_hz,
            1e6,
            "sweep for at least one period of start_hz",
        )?;
        check_voltage("sweep.low_v", self.low_v)?;
        check_voltage("sweep.high_v", self.high_v)?;
        let samples = sample_count(self.duration_s, sample_period_s)?;
        let half_v = 0.5 * (self.high_v - self.low_v);
        let octaves = (self.end_hz / self.start_hz).ln();
        let cycles = |t: f64| match self.law {
            SweepLaw::Linear => t * (self.start_hz + 0.5 * (self.end_hz - self.start_hz) * t / self.duration_s),
            SweepLaw::Logarithmic => {
                self.start_hz * self.duration_s / octaves * (octaves * t / self.duration_s).exp_m1()
            }
        };
        let value = |n: usize| {
            let turn = cycles(n as f64 * sample_period_s);
            self.low_v + half_v * (1.0 - (std::f64::consts::TAU * turn).cos())
        };
        Ok((0..samples).map(value).collect())
    }

    fn description(&self) -> String {
        let law = match self.law {
            SweepLaw::Linear => "linear",
            SweepLaw::Logarithmic => "logarithmic",
        };
        format!(
            "{law} sweep {} to {} Hz in {} s, {} to {} V",
            self.start_hz, self.end_hz, self.duration_s, self.low_v, self.high_v
        )
    }
}
