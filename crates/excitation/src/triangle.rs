//! Triangles: of one amplitude, and decaying, which leaves nested minor loops behind.

use super::{Excitation, check_frequency, check_period, check_voltage, sample_count};
use crate::error::{ParameterError, within};

/// A triangle that starts at its lowest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Frequency, hertz.
    pub frequency_hz: f64,
    /// Lowest voltage, volts.
    pub low_v: f64,
    /// Highest voltage, volts.
    pub high_v: f64,
    /// Length, periods.
    pub periods: f64,
}

impl Excitation for Triangle {
    fn samples(&self, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
        check_period(sample_period_s)?;
        check_frequency("triangle.frequency_hz", self.frequency_hz, sample_period_s)?;
        check_voltage("triangle.low_v", self.low_v)?;
        check_voltage("triangle.high_v", self.high_v)?;
        within(
            "triangle.periods",
            self.periods,
            1e-3,
            1e7,
            "give a positive number of periods",
        )?;
        let samples = sample_count(self.periods / self.frequency_hz, sample_period_s)?;
        let span_v = self.high_v - self.low_v;
        let value = |n: usize| {
            let cycle = self.frequency_hz * n as f64 * sample_period_s;
            let part = cycle - cycle.floor();
            self.low_v + span_v * (1.0 - (2.0 * part - 1.0).abs())
        };
        Ok((0..samples).map(value).collect())
    }

    fn description(&self) -> String {
        format!(
            "triangle {} Hz, {} to {} V, {} periods",
            self.frequency_hz, self.low_v, self.high_v, self.periods
        )
    }
}

/// A triangle that decays: from 0 V up to `high_v`, then turning points that approach `centre_v` by the same factor each, at constant slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecayingTriangle {
    /// First peak, volts.
    pub high_v: f64,
    /// Voltage that the turning points close in on, volts.
    pub centre_v: f64,
    /// Distance of each turning point from the centre relative to the one before.
    pub decay: f64,
    /// Number of turning points.
    pub turns: u32,
    /// Slope, volts per second.
    pub slope_v_per_s: f64,
}

impl Excitation for DecayingTriangle {
    fn samples(&self, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
        check_period(sample_period_s)?;
        check_voltage("decaying_triangle.high_v", self.high_v)?;
        check_voltage("decaying_triangle.centre_v", self.centre_v)?;
        within(
            "decaying_triangle.decay",
            self.decay,
            0.01,
            0.999,
            "0.8 to 0.95 leaves evenly spaced minor loops",
        )?;
        within(
            "decaying_triangle.turns",
            f64::from(self.turns),
            1.0,
            1e6,
            "give at least one turning point",
        )?;
        within(
            "decaying_triangle.slope_v_per_s",
            self.slope_v_per_s,
            1e-6,
            1e9,
            "give a positive slope",
        )?;
        let mut corners_v = vec![0.0];
        let mut distance_v = self.high_v - self.centre_v;
        for _ in 0..self.turns {
            corners_v.push(self.centre_v + distance_v);
            distance_v *= -self.decay;
        }
        along(&corners_v, self.slope_v_per_s, sample_period_s)
    }

    fn description(&self) -> String {
        format!(
            "decaying triangle, first peak {} V, about {} V, factor {}, {} turning points, {} V/s",
            self.high_v, self.centre_v, self.decay, self.turns, self.slope_v_per_s
        )
    }
}

/// Straight lines through the corners at constant slope, ending on the last corner.
fn along(corners_v: &[f64], slope_v_per_s: f64, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
    let total_v: f64 = corners_v.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
    let mut samples = Vec::with_capacity(sample_count(total_v / slope_v_per_s, sample_period_s)? + 2);
    let step_v = slope_v_per_s * sample_period_s;
    let (mut way_v, mut passed_v) = (0.0, 0.0);
    for pair in corners_v.windows(2) {
        let length_v = (pair[1] - pair[0]).abs();
        while way_v < passed_v + length_v {
            samples.push(pair[0] + (pair[1] - pair[0]).signum() * (way_v - passed_v));
            way_v = step_v * samples.len() as f64;
        }
        passed_v += length_v;
    }
    samples.extend(corners_v.last());
    Ok(samples)
}
