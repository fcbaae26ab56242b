//! Band-limited noise.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use super::{Excitation, check_frequency, check_period, check_voltage, sample_count};
use crate::error::{ParameterError, within};
use crate::spectrum::periodic;

/// Gaussian noise up to `bandwidth_hz`, flat below and nothing above, one period of its own length.
///
/// Nothing is clipped, which would put energy above the band: where the peaks would leave `low_v..high_v`, the whole is scaled down until it fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandNoise {
    /// Upper end of the band, hertz.
    pub bandwidth_hz: f64,
    /// Length, seconds.
    pub duration_s: f64,
    /// Rms about the middle of the range, volts, before it is made to fit.
    pub rms_v: f64,
    /// Lowest allowed voltage, volts.
    pub low_v: f64,
    /// Highest allowed voltage, volts.
    pub high_v: f64,
    /// Seed.
    pub seed: u64,
}

impl Excitation for BandNoise {
    fn samples(&self, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
        check_period(sample_period_s)?;
        check_frequency("noise.bandwidth_hz", self.bandwidth_hz, sample_period_s)?;
        check_voltage("noise.low_v", self.low_v)?;
        check_voltage("noise.high_v", self.high_v)?;
        crate::error::ordered("noise.low_v", self.low_v, "noise.high_v", self.high_v)?;
        within("noise.rms_v", self.rms_v, 0.0, 1e4, "give volts")?;
        within(
            "noise.duration_s",
            self.duration_s,
            2.0 / self.bandwidth_hz,
            1e6,
            "last for at least two periods of bandwidth_hz",
        )?;
        let length = sample_count(self.duration_s, sample_period_s)?;
        let spacing_hz = 1.0 / (length as f64 * sample_period_s);
        let mut rng = Pcg64::seed_from_u64(self.seed);
        let mut power = 0.0;
        let lines: Vec<(usize, f64, f64)> = (1..length / 2)
            .take_while(|&k| k as f64 * spacing_hz <= self.bandwidth_hz)
            .map(|k| {
                // Two normal numbers are a Rayleigh amplitude and a uniform phase.
                let (a, b): (f64, f64) = (StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng));
                power += 0.5 * (a * a + b * b);
                (k, a.hypot(b), b.atan2(a))
            })
            .collect();
        let shape = periodic(length, &lines);
        let peak = shape.iter().fold(0.0_f64, |peak, x| peak.max(x.abs()));
        let middle_v = 0.5 * (self.low_v + self.high_v);
        let wanted = if power > 0.0 { self.rms_v / power.sqrt() } else { 0.0 };
        let fitting = if peak > 0.0 {
            0.5 * (self.high_v - self.low_v) / peak
        } else {
            0.0
        };
        let scale = wanted.min(fitting);
        Ok(shape.iter().map(|x| middle_v + scale * x).collect())
    }

    fn description(&self) -> String {
        format!(
            "noise to {} Hz, {} s, {} V rms, within {} to {} V, seed {}",
            self.bandwidth_hz, self.duration_s, self.rms_v, self.low_v, self.high_v, self.seed
        )
    }
}
