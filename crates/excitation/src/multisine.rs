//! Odd random-phase multisine: flat in its band, even harmonics and the skipped odd ones left for nonlinearity to show.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{Excitation, check_frequency, check_period, check_voltage, sample_count};
use crate::error::{ParameterError, ordered, within};
use crate::spectrum::periodic;

/// A sum of the odd harmonics of 1 / `period_s` between `low_hz` and `high_hz` with equal amplitudes and random phases, scaled to the largest deviation.
///
/// # Reference
/// Pintelon and Schoukens, *System Identification: A Frequency Domain Approach* (2012), chapters 3 and 4.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Multisine {
    /// Lower end of the band, hertz.
    pub low_hz: f64,
    /// Upper end of the band, hertz.
    pub high_hz: f64,
    /// Period, seconds; the lines lie 2 / period_s apart.
    pub period_s: f64,
    /// Length, whole periods.
    pub periods: u32,
    /// Mean voltage, volts.
    pub bias_v: f64,
    /// Largest deviation from the mean, volts.
    pub peak_v: f64,
    /// Seed of the phases.
    pub seed: u64,
}

impl Excitation for Multisine {
    fn samples(&self, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
        check_period(sample_period_s)?;
        check_voltage("multisine.bias_v", self.bias_v)?;
        check_voltage("multisine.peak_v", self.peak_v)?;
        within(
            "multisine.low_hz",
            self.low_hz,
            0.0,
            1e6,
            "the band starts at or above 0 Hz",
        )?;
        check_frequency("multisine.high_hz", self.high_hz, sample_period_s)?;
        ordered("multisine.low_hz", self.low_hz, "multisine.high_hz", self.high_hz)?;
        within(
            "multisine.periods",
            f64::from(self.periods),
            1.0,
            1e6,
            "give whole periods",
        )?;
        within(
            "multisine.period_s",
            self.period_s,
            1.0 / self.high_hz,
            1e5,
            "the period must hold at least one of high_hz",
        )?;
        let length = sample_count(self.period_s, sample_period_s)?;
        sample_count(self.period_s * f64::from(self.periods), sample_period_s)?;
        let spacing_hz = 1.0 / (length as f64 * sample_period_s);
        let mut rng = Pcg64::seed_from_u64(self.seed);
        let lines: Vec<(usize, f64, f64)> = (1..length / 2)
            .step_by(2)
            .filter(|&k| (self.low_hz..=self.high_hz).contains(&(k as f64 * spacing_hz)))
            .map(|k| (k, 1.0, rng.random_range(0.0..std::f64::consts::TAU)))
            .collect();
        if lines.is_empty() {
            return Err(ParameterError::Conflict {
                what: format!(
                    "no odd harmonic of {spacing_hz} Hz lies between {} and {} Hz",
                    self.low_hz, self.high_hz
                ),
                advice: "lengthen period_s or widen the band",
            });
        }
        let shape = periodic(length, &lines);
        let peak = shape.iter().fold(0.0_f64, |peak, x| peak.max(x.abs()));
        let period = shape.iter().map(|x| self.bias_v + self.peak_v * x / peak);
        Ok(period.cycle().take(length * self.periods as usize).collect())
    }

    fn description(&self) -> String {
        // A product as people write it: 0.24 of 50 kHz is 12000 Hz, not 11999.999999999998 Hz.
        let written = |value: f64| (1e6 * value).round() / 1e6;
        format!(
            "odd random-phase multisine {} to {} Hz, period {} s, {} periods, {} V about {} V, seed {}",
            written(self.low_hz),
            written(self.high_hz),
            self.period_s,
            self.periods,
            written(self.peak_v),
            written(self.bias_v),
            self.seed
        )
    }
}
