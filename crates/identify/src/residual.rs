//! What an error remembers of itself and of the drive: correlations, with bands that hold for coloured noise.
//!
//! An error that is noise stays within both bands. One that leaves the second has something of the drive in it, which a model could have.

use crate::lagged::lagged_products;
use statrs::distribution::{ContinuousCDF, Normal};

/// A correlation over lags, and the band that it stays in by chance.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlation {
    /// Lags, samples, ascending.
    pub lag: Vec<i64>,
    /// Correlation at each, -1 to 1.
    pub value: Vec<f64>,
    /// Half width of the band at each: in 95 of 100 records no lag leaves it by chance.
    pub band: Vec<f64>,
}

impl Correlation {
    /// The lag at which the correlation is largest against its band, and by how many times it is.
    pub fn largest(&self) -> Option<(i64, f64)> {
        let each = self.lag.iter().zip(self.value.iter().zip(&self.band));
        each.map(|(lag, (value, band))| (*lag, value.abs() / band))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Correlations of an error.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlations {
    /// With itself, from lag 1 on.
    pub own: Correlation,
    /// With the drive; at positive lags the error comes after the drive.
    pub with_drive: Correlation,
}

impl Correlations {
    /// Up to which lag, samples, the error goes on remembering itself: the first lag within the band, less one.
    pub fn memory(&self) -> usize {
        let inside = self.own.value.iter().zip(&self.own.band);
        let outside = inside.take_while(|(value, band)| value.abs() > **band);
        outside.count()
    }
}

/// Probability that any lag of a record leaves a band by chance.
const BY_CHANCE: f64 = 0.05;
/// Longest lag, samples.
const LONGEST: usize = 1000;
/// Lags are at most this share of a record.
const SHARE: usize = 10;
/// Memory of error and drive that the second band allows for, as a share of a record.
const MEMORY_SHARE: usize = 20;
/// Least samples.
const LEAST: usize = 100;

/// Correlations of an error with itself and with the drive, up to a tenth of the record and 1000 samples.
///
/// The band of the first at lag k is that of an error which remembers nothing from k on: `z sqrt((1 + 2 sum_{i<k} r_i^2) / N)`
/// (Bartlett). The band of the second is that of an error of the same spectrum which has nothing to do with the drive:
/// `z sqrt(sum_k r_e(k) r_u(k) / N)`, the sum under Bartlett's window. z is for all lags together.
///
/// None for fewer than 100 samples, and where error or drive do not move.
///
/// # Reference
/// Box and Jenkins, Time Series Analysis (2016), section 2.1.6; Ljung, System Identification (1999), section 16.6.
///
/// # Cost
/// O(n log n); memory for the record twice.
pub fn correlations(error: &[f64], drive: &[f64]) -> Option<Correlations> {
    let n = error.len().min(drive.len());
    if n < LEAST {
        return None;
    }
    let lags = LONGEST.min(n / SHARE);
    let memory = (n / MEMORY_SHARE).max(1);
    let (error, drive) = (centred(&error[..n]), centred(&drive[..n]));
    let own = lagged_products(&error, &error, 0, lags.max(memory));
    let own_drive = lagged_products(&drive, &drive, 0, memory);
    let cross = lagged_products(&drive, &error, lags, lags);
    let (power, power_drive) = (own[0], own_drive[0]);
    if !(power > 0.0 && power_drive > 0.0) {
        return None;
    }
    let root_n = (n as f64).sqrt();
    let z = |count: usize| {
        let share = 0.5 * BY_CHANCE / count as f64;
        Normal::standard().inverse_cdf(1.0 - share) / root_n
    };
    let value: Vec<f64> = (1..=lags).map(|k| own[k] / power).collect();
    let mut before = 1.0;
    let band = value.iter().map(|r| {
        let now = z(lags) * f64::sqrt(before);
        before += 2.0 * r * r;
        now
    });
    let own_correlation = Correlation {
        lag: (1..=lags as i64).collect(),
        band: band.collect(),
        value: value.clone(),
    };
    let window = |k: usize| 1.0 - k as f64 / memory as f64;
    let spread = (1..memory)
        .map(|k| 2.0 * window(k) * own[k] * own_drive[k])
        .sum::<f64>()
        / (power * power_drive);
    let lag: Vec<i64> = (-(lags as i64)..=lags as i64).collect();
    let scale = (power * power_drive).sqrt();
    Some(Correlations {
        own: own_correlation,
        with_drive: Correlation {
            value: cross.iter().map(|sum| sum / scale).collect(),
            band: vec![z(lag.len()) * (1.0 + spread).max(0.0).sqrt(); lag.len()],
            lag,
        },
    })
}

/// A series without its mean.
fn centred(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|value| value - mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    const SAMPLES: usize = 4000;
    const RECORDS: u64 = 200;

    /// Noise with a variance of 1/3 a sample, white.
    fn white(seed: u64, samples: usize) -> Vec<f64> {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        (0..samples).map(|_| random.random_range(-1.0..1.0)).collect()
    }

    /// Noise through a lag of twenty samples.
    fn coloured(seed: u64) -> Vec<f64> {
        let mut state = 0.0;
        let noise = white(seed, SAMPLES).into_iter();
        noise
            .map(|value| {
                state = 0.95 * state + value;
                state
            })
            .collect()
    }

    fn sine(k: usize) -> f64 {
        (std::f64::consts::TAU * k as f64 / 200.0).sin()
    }

    /// The sums by their definition.
    #[test]
    fn val_correlations_are_the_sums_of_their_definition() {
        let (error, drive) = (white(1, 500), white(2, 500));
        let mean = |values: &[f64]| values.iter().sum::<f64>() / 500.0;
        let (e, u) = (mean(&error), mean(&drive));
        let sum = |k: i64| -> f64 {
            (0..500_i64)
                .filter(|t| (0..500).contains(&(t + k)))
                .map(|t| (drive[t as usize] - u) * (error[(t + k) as usize] - e))
                .sum()
        };
        let size = |values: &[f64], mean: f64| values.iter().map(|v| (v - mean).powi(2)).sum::<f64>().sqrt();
        let found = correlations(&error, &drive).unwrap();
        for (lag, value) in found.with_drive.lag.iter().zip(&found.with_drive.value) {
            let wanted = sum(*lag) / (size(&error, e) * size(&drive, u));
            assert!((value - wanted).abs() < 1e-12, "{lag}: {value} {wanted}");
        }
        assert_eq!((found.with_drive.lag[0], found.with_drive.lag.len()), (-50, 101));
    }

    /// Coloured noise that has nothing to do with the drive leaves the band in one record of twenty at most; the band of white noise
    /// it leaves in most.
    #[test]
    fn val_the_band_of_the_drive_holds_for_coloured_noise() {
        let slow: Vec<f64> = (0..SAMPLES).map(sine).collect();
        for drive in [slow, coloured(77)] {
            let (mut left, mut left_white) = (0, 0);
            for seed in 1000..1000 + RECORDS {
                let found = correlations(&coloured(seed), &drive).unwrap().with_drive;
                let white = found.band[0].min(4.1 / (SAMPLES as f64).sqrt());
                left += u64::from(found.largest().unwrap().1 > 1.0);
                left_white += u64::from(found.value.iter().any(|value| value.abs() > white));
            }
            assert!(left <= RECORDS / 20, "{left} of {RECORDS}");
            assert!(left_white > RECORDS / 4, "{left_white} of {RECORDS}");
        }
    }

    /// An error that is late of the drive by 30 samples shows there, however coloured its noise is.
    #[test]
    fn val_an_error_that_follows_the_drive_leaves_the_band_at_its_lag() {
        let drive = white(5, SAMPLES);
        let noise = coloured(6);
        let error: Vec<f64> = (0..SAMPLES)
            .map(|k| noise[k] + if k < 30 { 0.0 } else { 1.5 * drive[k - 30] })
            .collect();
        let (lag, times) = correlations(&error, &drive).unwrap().with_drive.largest().unwrap();
        assert!(lag == 30 && times > 1.5, "{lag}, {times}");
    }

    /// A mean over 25 samples remembers 24: the correlation leaves the band at none of the lags behind, in 19 of 20 records and more.
    #[test]
    fn val_the_band_of_the_error_itself_holds_for_coloured_noise() {
        let (mut left, mut memory) = (0, 0);
        let drive: Vec<f64> = (0..SAMPLES).map(sine).collect();
        for seed in 0..RECORDS {
            let noise = white(seed, SAMPLES + 25);
            let error: Vec<f64> = (0..SAMPLES).map(|k| noise[k..k + 25].iter().sum()).collect();
            let found = correlations(&error, &drive).unwrap();
            let behind = found.own.value.iter().zip(&found.own.band).skip(25);
            left += u64::from(behind.into_iter().any(|(value, band)| value.abs() > *band));
            memory += found.memory() as u64;
        }
        assert!(left <= RECORDS / 20, "{left} of {RECORDS}");
        let memory = memory as f64 / RECORDS as f64;
        assert!((16.0..26.0).contains(&memory), "{memory}");
    }

    #[test]
    fn refuse_nothing_but_give_nothing_where_nothing_moves() {
        assert_eq!(correlations(&[1.0; 50], &[1.0; 50]), None);
        assert_eq!(correlations(&[0.0; 500], &white(1, 500)), None);
        assert_eq!(correlations(&white(1, 500), &[2.0; 500]), None);
    }
}
