//! The period of a drive: how many samples, and from where on it repeats.

use crate::lagged::lagged_products;

/// A periodic stretch that runs to the end of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Periodic {
    /// Samples a period.
    pub samples: usize,
    /// First sample from which the drive repeats to the end of the record.
    pub from: usize,
}

impl Periodic {
    /// Whole periods in a record of `len` samples.
    pub fn count(self, len: usize) -> usize {
        (len - self.from) / self.samples
    }
}

/// Largest difference between periods that still counts as the same drive, as a share of peak to peak.
///
/// A period that is no whole number of samples is found as a multiple of itself that nearly is (at 100 samples a period,
/// 0.03 samples of misfit pass); commands written with four digits differ by less than 1e-4.
const SAME_DRIVE: f64 = 1e-3;

/// Samples at a record's end in which periods are looked for one by one. Longer periods are looked for among means of neighbours, as many as
/// this or fewer.
const AT_ONCE: usize = 1 << 20;
/// Places at which the lags beside a coarse one are compared.
const PLACES: usize = 4096;

/// Finds the shortest period with which `drive` repeats to the record's end, at least twice.
///
/// # Cost
/// O(n log n): the difference function of all lags by FFT (de Cheveigné, Kawahara 2002, eq. 6), of a million samples at most; what it
/// finds is compared over the whole record.
///
/// # Example
/// ```
/// use hysteron_identify::period::{Periodic, detect};
/// let drive: Vec<f64> = (0..1000).map(|k| (std::f64::consts::TAU * f64::from(k) / 250.0).sin()).collect();
/// assert_eq!(detect(&drive), Some(Periodic { samples: 250, from: 0 }));
/// ```
pub fn detect(drive: &[f64]) -> Option<Periodic> {
    let span = crate::family::peak_to_peak(drive);
    if drive.len() < 8 || span <= 0.0 {
        return None;
    }
    // A period that repeats at least twice to the end repeats within the last `2 P`; lags up to half the record.
    let tolerance = SAME_DRIVE * span;
    let repeats = |lag: usize| {
        let breaks = (0..drive.len() - lag)
            .rev()
            .find(|&k| (drive[k + lag] - drive[k]).abs() > tolerance);
        let from = breaks.map_or(0, |k| k + 1);
        (drive.len() - from >= 2 * lag).then_some(Periodic { samples: lag, from })
    };
    let end = &drive[drive.len().saturating_sub(AT_ONCE)..];
    let short = candidate_lags(end, tolerance).into_iter().find_map(repeats);
    if short.is_some() || end.len() == drive.len() {
        return short;
    }
    long_lags(drive, tolerance).into_iter().find_map(repeats)
}

/// As [`candidate_lags`], of those longer than half of what is looked at one by one.
fn long_lags(drive: &[f64], tolerance: f64) -> Vec<usize> {
    let each = drive.len().div_ceil(AT_ONCE);
    let means: Vec<f64> = drive[drive.len() % each..]
        .chunks_exact(each)
        .map(|chunk| chunk.iter().sum::<f64>() / each as f64)
        .collect();
    let coarse = candidate_lags(&means, tolerance).into_iter().map(|lag| lag * each);
    let near = coarse.map(|coarse| {
        let lags = coarse.saturating_sub(each)..=(coarse + each).min(drive.len() / 2);
        let step = (drive.len() / 2).div_ceil(PLACES);
        let difference = |lag: usize| -> f64 {
            let places = (0..drive.len() - lag).rev().step_by(step);
            places.map(|k| (drive[k + lag] - drive[k]).powi(2)).sum()
        };
        let differences = lags.map(|lag| (lag, difference(lag)));
        differences
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(coarse, |(lag, _)| lag)
    });
    near.filter(|lag| *lag > AT_ONCE / 2).collect()
}

/// Lags at which the mean squared difference over the last part of the record is small, ascending, first of each dip.
fn candidate_lags(drive: &[f64], tolerance: f64) -> Vec<usize> {
    let n = drive.len();
    let mean = drive.iter().sum::<f64>() / n as f64;
    let centred: Vec<f64> = drive.iter().map(|v| v - mean).collect();
    let autocorrelation = lagged_products(&centred, &centred, 0, n / 2);
    let mut squares = vec![0.0; n + 1];
    for k in 0..n {
        squares[k + 1] = squares[k] + centred[k] * centred[k];
    }
    let difference = |lag: usize| -> f64 {
        // mean over k of (x[k+lag] - x[k])^2
        let count = n - lag;
        let energy = squares[n] - squares[lag] + squares[count];
        ((energy - 2.0 * autocorrelation[lag]) / count as f64).max(0.0)
    };
    let mut lags = Vec::new();
    let mut best_in_dip: Option<(usize, f64)> = None;
    // A record that starts with a rise is not periodic as a whole: a dip is a candidate below a tenth of the variance,
    // and `detect` verifies it sample by sample.
    let dip = (0.2 * squares[n] / n as f64).max(tolerance * tolerance);
    let mut left_the_origin = false;
    for lag in 1..=n / 2 {
        let d = difference(lag);
        if d > dip {
            left_the_origin = true;
            if let Some((lag, _)) = best_in_dip.take() {
                lags.push(lag);
            }
        } else if left_the_origin && best_in_dip.is_none_or(|(_, best)| d < best) {
            best_in_dip = Some((lag, d));
        }
    }
    lags.extend(best_in_dip.map(|(lag, _)| lag));
    lags
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sine(n: usize, samples_a_period: f64) -> Vec<f64> {
        (0..n)
            .map(|k| 13.0 - 13.0 * (TAU * k as f64 / samples_a_period).cos())
            .collect()
    }

    #[test]
    fn val_whole_periods() {
        assert_eq!(detect(&sine(1000, 100.0)), Some(Periodic { samples: 100, from: 0 }));
        assert_eq!(detect(&sine(200, 100.0)), Some(Periodic { samples: 100, from: 0 }));
    }

    #[test]
    fn val_period_between_samples_is_found_as_a_multiple() {
        // 97 Hz at 50 kHz: 515.46 samples; 13 periods are 6701.03.
        let found = detect(&sine(50_000, 50_000.0 / 97.0)).unwrap();
        let periods = found.samples as f64 * 97.0 / 50_000.0;
        assert!((periods - periods.round()).abs() < 3e-4, "{periods} periods");
    }

    #[test]
    fn val_rise_before_the_periodic_part() {
        let mut drive: Vec<f64> = (0..300).map(|k| 13.0 * f64::from(k) / 300.0).collect();
        drive.extend((0..1000).map(|k| 13.0 + 13.0 * (TAU * f64::from(k) / 100.0).sin()));
        let found = detect(&drive).unwrap();
        assert_eq!(found.samples, 100);
        assert!((295..=300).contains(&found.from), "{found:?}");
    }

    /// A short and a long period of a record of two million samples, and the long one behind a rise.
    #[test]
    fn val_periods_of_long_records() {
        let n = 2 * AT_ONCE + 777;
        assert_eq!(detect(&sine(n, 500.0)), Some(Periodic { samples: 500, from: 0 }));
        // 1203 periods of one sine are 41 of the other.
        let long = 601_500;
        let both = |k: usize| (TAU * k as f64 / 500.0).sin() + 2.0 * (TAU * 41.0 * k as f64 / long as f64).sin();
        let mut drive: Vec<f64> = (0..n).map(both).collect();
        assert_eq!(detect(&drive), Some(Periodic { samples: long, from: 0 }));
        drive[1000] += 1.0;
        assert_eq!(
            detect(&drive),
            Some(Periodic {
                samples: long,
                from: 1001
            })
        );
        drive.truncate(AT_ONCE + 5);
        assert_eq!(detect(&drive), None, "less than two periods");
    }

    #[test]
    fn val_no_period_in_ramps_noise_rest() {
        assert_eq!(detect(&vec![3.0; 100]), None);
        assert_eq!(detect(&(0..500).map(f64::from).collect::<Vec<_>>()), None);
        let mut state = 1u64;
        let noise: Vec<f64> = (0..4000)
            .map(|_| {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                (state >> 40) as f64
            })
            .collect();
        assert_eq!(detect(&noise), None);
    }
}
