//! Where to look closer in a record that swings too often to be seen as a whole.

use std::ops::Range;

use crate::axis::extent;

/// Swings through the middle from which a record is too dense to be read as a whole.
const DENSE: usize = 24;
/// Swings shown close up: four periods.
const SHOWN: usize = 8;
/// A swing leaves the middle by this share of the peak to peak, so that noise is none.
const SWING: f64 = 0.1;

/// The samples about the largest error in which the measured output swings eight times; nothing where the whole record
/// can be read.
pub(crate) fn closeup(measured: &[f64], modelled: &[f64]) -> Option<Range<usize>> {
    let swings = swings(measured)?;
    if swings.len() < DENSE {
        return None;
    }
    let error = |index: &usize| {
        let error = (measured[*index] - modelled[*index]).abs();
        if error.is_finite() { error } else { -1.0 }
    };
    let worst = (0..measured.len().min(modelled.len())).max_by(|a, b| error(a).total_cmp(&error(b)))?;
    let nearest = swings.partition_point(|swing| *swing <= worst);
    let first = nearest.saturating_sub(SHOWN / 2).min(swings.len() - 1 - SHOWN);
    Some(swings[first]..swings[first + SHOWN] + 1)
}

/// The samples at which the output has crossed its middle to the other side.
fn swings(measured: &[f64]) -> Option<Vec<usize>> {
    let (low, high) = extent(measured.iter().copied())?;
    let (middle, band) = (0.5 * (low + high), SWING * (high - low));
    let mut above: Option<bool> = None;
    let mut found = Vec::new();
    for (index, value) in measured.iter().enumerate() {
        let side = if *value > middle + band {
            true
        } else if *value < middle - band {
            false
        } else {
            continue;
        };
        if above.is_some_and(|before| before != side) {
            found.push(index);
        }
        above = Some(side);
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::closeup;

    fn sine(periods: f64) -> Vec<f64> {
        (0..10_000)
            .map(|i| (std::f64::consts::TAU * periods * f64::from(i) / 10_000.0).sin())
            .collect()
    }

    #[test]
    fn prop_a_record_that_can_be_read_has_no_closeup() {
        let measured = sine(3.0);
        assert_eq!(closeup(&measured, &measured), None);
        assert_eq!(closeup(&[1.0; 100], &[1.0; 100]), None);
        assert_eq!(closeup(&[], &[]), None);
    }

    #[test]
    fn prop_the_largest_error_is_inside_and_four_periods_are_shown() {
        let measured = sine(100.0);
        for worst in [0, 5000, 9999] {
            let mut modelled = measured.clone();
            modelled[worst] += 1.0;
            let range = closeup(&measured, &modelled).unwrap();
            // Four periods of 100 samples, to a sample at the edges.
            assert!(range.len().abs_diff(400) <= 2, "{range:?}");
            // At the record's ends the nearest whole swings are at most one period away.
            assert!(
                range.start <= worst + 100 && worst <= range.end + 100,
                "{range:?} {worst}"
            );
        }
    }
}
