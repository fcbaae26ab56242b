//! Desired trajectories, micrometres.

use crate::error::ControlError;
use hysteron_excitation::{BandNoise, Excitation};
use std::f64::consts::{PI, TAU};

/// A trajectory within a range of positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// `low + (high - low) (1 - cos 2 pi f t) / 2`.
    Sine {
        /// Frequency, hertz.
        frequency_hz: f64,
    },
    /// The paper's complex harmonic, `0.25 sin x + 0.3 sin 3x + 0.5` with x = 2 pi f t, its extremes at `low` and `high`.
    ComplexHarmonic {
        /// Fundamental frequency, hertz.
        frequency_hz: f64,
    },
    /// From `low` to `high` and back in straight lines.
    Triangle {
        /// Frequency, hertz.
        frequency_hz: f64,
    },
}

/// References that repeat, with the names that tables and files give them.
pub const SHAPES: [(&str, Shape); 7] = [
    ("10", Shape::Sine { frequency_hz: 10.0 }),
    ("100", Shape::Sine { frequency_hz: 100.0 }),
    ("500", Shape::Sine { frequency_hz: 500.0 }),
    ("503", Shape::Sine { frequency_hz: 503.0 }),
    ("1000", Shape::Sine { frequency_hz: 1000.0 }),
    ("complex-harmonic-100", Shape::ComplexHarmonic { frequency_hz: 100.0 }),
    ("triangle-100", Shape::Triangle { frequency_hz: 100.0 }),
];

/// What a reference needs to be judged: the samples, and where the judged part begins.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reference {
    /// Desired position, micrometres.
    pub samples_um: Vec<f64>,
    /// First sample of the judged part: whole periods to the end.
    pub judged_from: usize,
    /// How it goes on, micrometres: a law that knows it ahead takes this in before the end. Beyond, it rests.
    pub after_um: Vec<f64>,
}

impl Reference {
    /// Its value at a sample, beyond the judged part as well.
    pub fn at(&self, sample: usize) -> f64 {
        let after = || self.after_um.get(sample.checked_sub(self.samples_um.len())?);
        let here = self.samples_um.get(sample).or_else(after);
        let last = || self.after_um.last().or(self.samples_um.last());
        here.or_else(last).copied().unwrap_or(0.0)
    }
}

/// Rise from the stage's rest to the trajectory's start, seconds: slow against every mode and lag here.
pub const RISE_S: f64 = 0.02;
/// Least settling before the judged part, seconds: ten time constants of the paper's slowest loop (36 Hz).
const SETTLING_S: f64 = 0.06;
/// Least length of the judged part, seconds: 2000 samples at 50 kHz average the sensor's noise to 2 % of itself.
const JUDGED_S: f64 = 0.04;
/// Samples that a shape goes on for: more than any law knows ahead.
const AFTER: usize = 64;

impl Shape {
    /// Frequency that the shape repeats at, hertz.
    pub fn frequency_hz(self) -> f64 {
        match self {
            Self::Sine { frequency_hz } | Self::ComplexHarmonic { frequency_hz } | Self::Triangle { frequency_hz } => {
                frequency_hz
            }
        }
    }

    /// Highest frequency at which the shape swings over a third of its range, hertz, as records are said to cover one: of the complex
    /// harmonic its third, which has 0.3 of 0.4333 of the swing. A triangle's third harmonic has a ninth of its first.
    pub fn swings_hz(self) -> f64 {
        match self {
            Self::Sine { frequency_hz } | Self::Triangle { frequency_hz } => frequency_hz,
            Self::ComplexHarmonic { frequency_hz } => 3.0 * frequency_hz,
        }
    }

    /// The value at a time, as a share of the range.
    pub fn share(self, time_s: f64) -> f64 {
        match self {
            Self::Sine { frequency_hz } => 0.5 - 0.5 * (TAU * frequency_hz * time_s).cos(),
            Self::ComplexHarmonic { frequency_hz } => {
                let x = TAU * frequency_hz * time_s;
                0.5 + 0.5 * (0.25 * x.sin() + 0.3 * (3.0 * x).sin()) / complex_harmonic_peak()
            }
            Self::Triangle { frequency_hz } => {
                let phase = (frequency_hz * time_s).fract();
                1.0 - (2.0 * phase - 1.0).abs()
            }
        }
    }

    /// The trajectory: a rise from 0 um, periods to settle, periods to judge.
    ///
    /// # Example
    /// ```
    /// use hysteron_control::reference::Shape;
    /// let reference = Shape::Triangle { frequency_hz: 100.0 }.reference([2.0, 8.0], 20e-6);
    /// let highest = reference.samples_um.iter().copied().fold(0.0, f64::max);
    /// assert!((highest - 8.0).abs() < 0.02);
    /// ```
    pub fn reference(self, [low_um, high_um]: [f64; 2], sample_period_s: f64) -> Reference {
        let frequency_hz = self.frequency_hz();
        let at = |time_s: f64| low_um + (high_um - low_um) * self.share(time_s);
        let rise = (RISE_S / sample_period_s).round() as usize;
        let mut samples_um: Vec<f64> = (0..rise)
            .map(|n| at(0.0) * 0.5 * (1.0 - (PI * n as f64 / rise as f64).cos()))
            .collect();
        let samples = |periods: f64| (periods / frequency_hz / sample_period_s).round() as usize;
        let settling = samples(3.0_f64.max((SETTLING_S * frequency_hz).ceil()));
        let judged = samples(2.0_f64.max((JUDGED_S * frequency_hz).ceil()));
        samples_um.extend((0..settling + judged).map(|n| at(n as f64 * sample_period_s)));
        let after_um = (settling + judged..)
            .take(AFTER)
            .map(|n| at(n as f64 * sample_period_s));
        Reference {
            samples_um,
            judged_from: rise + settling,
            after_um: after_um.collect(),
        }
    }
}

/// Largest value of `0.25 sin x + 0.3 sin 3x`: 0.4333, where `0.25 cos x + 0.9 cos 3x = 0`.
///
/// With c = cos x: `0.25 + 0.9 (4 c^2 - 3) = 0`, c^2 = 2.45 / 3.6.
fn complex_harmonic_peak() -> f64 {
    let c2: f64 = 2.45 / 3.6;
    let s = (1.0 - c2).sqrt();
    0.25 * s + 0.3 * (3.0 * s - 4.0 * s.powi(3))
}

/// Band-limited noise about the middle of a range, after a rise to it; the judged part begins with the noise.
///
/// # Errors
/// A band that the sample rate cannot show, a range that does not ascend.
pub fn noise(
    [low_um, high_um]: [f64; 2],
    rms_um: f64,
    bandwidth_hz: f64,
    duration_s: f64,
    seed: u64,
    sample_period_s: f64,
) -> Result<Reference, ControlError> {
    // The generator of commands knows numbers; its volts are micrometres here.
    let noise = BandNoise {
        bandwidth_hz,
        duration_s,
        rms_v: rms_um,
        low_v: low_um,
        high_v: high_um,
        seed,
    };
    let noise_um = noise.samples(sample_period_s)?;
    let first_um = noise_um.first().copied().unwrap_or(0.0);
    let rise = ((RISE_S + SETTLING_S) / sample_period_s).round() as usize;
    let share = |n: usize| 0.5 * (1.0 - (PI * (n as f64 * sample_period_s / RISE_S).min(1.0)).cos());
    let mut samples_um: Vec<f64> = (0..rise).map(|n| first_um * share(n)).collect();
    samples_um.extend(noise_um);
    Ok(Reference {
        samples_um,
        judged_from: rise,
        ..Reference::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_shapes_fill_their_range_in_whole_periods() {
        for shape in [
            Shape::Sine { frequency_hz: 500.0 },
            Shape::ComplexHarmonic { frequency_hz: 100.0 },
        ] {
            let Reference {
                samples_um,
                judged_from,
                ..
            } = shape.reference([0.2, 2.4], 20e-6);
            let judged = &samples_um[judged_from..];
            let periods = judged.len() as f64 * 20e-6 * shape.frequency_hz();
            assert!((periods - periods.round()).abs() < 1e-9, "{periods}");
            let low = judged.iter().copied().fold(f64::INFINITY, f64::min);
            let high = judged.iter().copied().fold(0.0, f64::max);
            // A peak between two samples of a 300 Hz component lies at most (1 - cos(w T / 2)) = 2e-4 of it away.
            assert!((low - 0.2).abs() < 1e-3 && (high - 2.4).abs() < 1e-3, "{low} {high}");
            // Nothing jumps: the fastest slope is a few percent of the range a sample.
            let jump = samples_um
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).abs())
                .fold(0.0, f64::max);
            assert!(samples_um[0] == 0.0 && jump < 0.1, "{jump}");
        }
    }

    #[test]
    fn val_noise_has_its_rms_about_the_middle() {
        let reference = noise([0.0, 2.0], 0.05, 5e3, 1.0, 1, 20e-6).unwrap();
        let judged = &reference.samples_um[reference.judged_from..];
        let mean = judged.iter().sum::<f64>() / judged.len() as f64;
        let rms = (judged.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / judged.len() as f64).sqrt();
        assert!((mean - 1.0).abs() < 1e-9 && (rms - 0.05).abs() < 1e-9, "{mean} {rms}");
    }

    #[test]
    fn refuse_noise_beyond_the_sample_rate() {
        assert!(noise([0.0, 2.0], 0.05, 20e3, 1.0, 1, 20e-6).is_err());
    }
}
