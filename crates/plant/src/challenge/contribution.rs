//! What an effect adds to the error, and the size that adds as much as is asked for.

use super::effect::Strength;
use crate::error::StageError;

/// The effect's contribution to the error: how far readings `with` the effect are from readings `without`, after the best common gain and offset
/// (which any identification would absorb), rms in percent of each record's peak to peak, root mean square over the records that move.
///
/// Records count alike; a record moves if its peak to peak exceeds 1 % of the largest.
pub(super) fn percent(without: &[Vec<f64>], with: &[Vec<f64>]) -> f64 {
    let spans: Vec<f64> = without.iter().map(|y| peak_to_peak(y)).collect();
    let largest = spans.iter().fold(0.0_f64, |a, &b| a.max(b));
    let moving: Vec<(&[f64], &[f64], f64)> = without
        .iter()
        .zip(with)
        .zip(&spans)
        .filter(|(_, span)| **span > 0.01 * largest)
        .map(|((x, y), span)| (x.as_slice(), y.as_slice(), 1.0 / (span * span * x.len() as f64)))
        .collect();
    // Weighted line y = gain x + offset over all of them.
    let mut sums = [0.0; 5];
    for (x, y, weight) in &moving {
        for (x, y) in x.iter().zip(*y) {
            for (sum, term) in sums.iter_mut().zip([1.0, *x, *y, x * x, x * y]) {
                *sum += weight * term;
            }
        }
    }
    let [n, x, y, xx, xy] = sums;
    let determinant = n * xx - x * x;
    if determinant <= 0.0 {
        return 0.0;
    }
    let gain = (n * xy - x * y) / determinant;
    let offset = (y - gain * x) / n;
    let squares = moving.iter().map(|(x, y, weight)| {
        weight
            * x.iter()
                .zip(*y)
                .map(|(x, y)| (y - gain * x - offset).powi(2))
                .sum::<f64>()
    });
    100.0 * (squares.sum::<f64>() / moving.len() as f64).sqrt()
}

fn peak_to_peak(values: &[f64]) -> f64 {
    let (low, high) = values
        .iter()
        .fold((f64::MAX, f64::MIN), |(low, high), &y| (low.min(y), high.max(y)));
    (high - low).max(0.0)
}

/// The size at which `contribution` lies in the strength's band, with that contribution; none where even `most` stays below.
///
/// Aims at `target`; steps along the power law through the last two points, kept between the sizes known to be too small and too large.
pub(super) fn size_for(
    strength: Strength,
    target_percent: f64,
    (start, most): (f64, f64),
    mut contribution: impl FnMut(f64) -> Result<f64, StageError>,
) -> Result<Option<(f64, f64)>, StageError> {
    const STEPS: usize = 24;
    let (low_percent, high_percent) = strength.band_percent();
    let (mut too_small, mut too_large) = (0.0, f64::INFINITY);
    let mut before: Option<(f64, f64)> = None;
    let mut size = start.min(most);
    for _ in 0..STEPS {
        let percent = contribution(size)?;
        if (low_percent..=high_percent).contains(&percent) {
            return Ok(Some((size, percent)));
        }
        if percent < low_percent {
            if size >= most {
                return Ok(None);
            }
            too_small = size;
        } else {
            too_large = size;
        }
        let power = match before {
            Some((old_size, old)) if old > 0.0 && percent > 0.0 => {
                ((percent / old).ln() / (size / old_size).ln()).clamp(0.3, 3.0)
            }
            _ => 1.0,
        };
        before = Some((size, percent));
        // At most tenfold at once: thresholds give nothing at all below them.
        let factor = (target_percent / percent.max(1e-9)).powf(1.0 / power).clamp(0.1, 10.0);
        size = (size * factor).min(most);
        if size <= too_small || size >= too_large {
            size = if too_large.is_finite() {
                (too_small.max(1e-3 * too_large) * too_large).sqrt()
            } else {
                most
            };
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::{percent, size_for};
    use crate::challenge::Strength;

    /// A gain and an offset are no error. A sine of amplitude a on a ramp of 0..1, orthogonal to it, is a / sqrt 2 of its peak to peak.
    #[test]
    fn val_gain_and_offset_do_not_count() {
        let x: Vec<f64> = (0..1000)
            .map(|n| (f64::from(n) * 0.02 * std::f64::consts::PI).cos())
            .collect();
        let line: Vec<f64> = x.iter().map(|x| 3.0 * x + 0.7).collect();
        assert!(percent(std::slice::from_ref(&x), &[line]) < 1e-9);
        let odd: Vec<f64> = (0..1000)
            .map(|n| x[n as usize] + 0.02 * (f64::from(n) * 0.06 * std::f64::consts::PI).sin())
            .collect();
        let found = percent(&[x], &[odd]);
        assert!((found - 100.0 * 0.02 / 2.0 / 2_f64.sqrt()).abs() < 1e-3, "{found}");
    }

    #[test]
    fn val_size_is_found_for_laws_with_and_without_a_threshold() {
        let linear = size_for(Strength::Weak, 0.45, (1.0, 1e6), |size| Ok(1e-3 * size))
            .unwrap()
            .unwrap();
        assert!((300.0..=600.0).contains(&linear.0));
        let threshold = |size: f64| Ok(if size < 5.0 { 0.0 } else { (size - 5.0).powi(2) });
        let (size, found) = size_for(Strength::Medium, 1.5, (1.1, 100.0), threshold)
            .unwrap()
            .unwrap();
        assert!((6.0..=6.415).contains(&size) && (1.0..=2.0).contains(&found));
        assert_eq!(
            size_for(Strength::Strong, 4.0, (1.0, 10.0), |size| Ok(0.1 * size)).unwrap(),
            None
        );
    }
}
