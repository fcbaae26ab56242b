//! Stretches at constant voltage.

use crate::{median, span};
use hysteron_data::Record;
use std::ops::Range;

/// Shortest stretch that tells something of the noise, samples.
const SHORTEST: usize = 64;
/// A voltage that was measured rests within so many times its own noise.
const WITHIN_NOISE: f64 = 6.0;
/// Noise of a voltage beyond this share of its range is motion.
const MOST_NOISE: f64 = 2e-3;

/// Standard deviation of what a series has from sample to sample, by the median of third differences; a drive's own motion
/// counts as well, where it is that fast.
pub(crate) fn roughness(series: &[f64]) -> f64 {
    let step = (series.len() / 20_000).max(1);
    let mut thirds: Vec<f64> = series
        .windows(4)
        .step_by(step)
        .map(|y| (y[3] - 3.0 * y[2] + 3.0 * y[1] - y[0]).abs())
        .collect();
    // Median of |normal| is 0.6745 standard deviations; third differences have 20 times the variance.
    median(&mut thirds) / 0.6745 / 20f64.sqrt()
}

/// Rests of a record: stretches over which no voltage moves, without the first part of those that follow a motion.
pub(crate) fn rests(record: &Record, largest_v: f64) -> Vec<Range<usize>> {
    let band = |series: &[f64], largest: f64| {
        let rough = roughness(series);
        let of_noise = if rough < MOST_NOISE * largest {
            WITHIN_NOISE * rough
        } else {
            0.0
        };
        of_noise.max(1e-6 * largest)
    };
    let v = &record.voltage_v;
    let own = band(v, largest_v);
    let other = record
        .voltage2_v
        .as_deref()
        .map(|v2| (v2, band(v2, span(v2).max(largest_v))));
    let mut found = Vec::new();
    let mut start = 0;
    for k in 1..=v.len() {
        let stays = k < v.len()
            && (v[k] - v[start]).abs() <= own
            && other.is_none_or(|(v2, band)| (v2[k] - v2[start]).abs() <= band);
        if stays {
            continue;
        }
        // What rings after a change dies away; a record's own beginning follows none.
        let settling = if start == 0 {
            0
        } else {
            ((k - start) / 4).max(SHORTEST / 2)
        };
        if k >= start + settling + SHORTEST {
            found.push(start + settling..k);
        }
        start = k;
    }
    found
}
