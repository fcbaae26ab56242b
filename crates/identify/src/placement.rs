//! Where the thresholds of the play operators are put.

use crate::fading::lengths;
use crate::family::range;
use serde::{Deserialize, Serialize};

/// How thresholds are placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Placement {
    /// Eq. 16: `r_i = (i - 1) / N * span`. The first play has no width, and below a tenth of the span (N = 10) the
    /// model is strictly linear.
    Eq16,
    /// Geometric from a two-hundredth of the span up.
    Log,
    /// Quantiles of the distance from the last turning point: plays stand where the records exercise them.
    Data,
}

/// Smallest threshold of [`Placement::Log`] as a share of the span: half a percent, where piezo small-signal loops close.
const LOG_START: f64 = 0.005;

/// Thresholds for `plays` operators on these inputs, strictly increasing, in the inputs' unit.
///
/// The span is peak to peak over all records. Returns fewer than `plays` only if the inputs do not move.
pub fn thresholds(placement: Placement, plays: usize, inputs: &[&[f64]]) -> Vec<f64> {
    let Some(span) = span(inputs) else { return Vec::new() };
    let n = plays as f64;
    match placement {
        Placement::Eq16 => (0..plays).map(|i| i as f64 / n * span).collect(),
        Placement::Log => {
            // N points from LOG_START to (N-1)/N of the span: the largest play must still move.
            let end: f64 = (1.0 - 1.0 / n).max(0.5);
            let step = if plays > 1 {
                (end / LOG_START).ln() / (n - 1.0)
            } else {
                0.0
            };
            (0..plays).map(|i| span * LOG_START * (step * i as f64).exp()).collect()
        }
        Placement::Data => data_quantiles(plays, inputs, span, 1.0),
    }
}

/// Peak to peak over all records; `None` where nothing moves.
fn span(inputs: &[&[f64]]) -> Option<f64> {
    let (low, high) = range(inputs.iter().flat_map(|input| input.iter().copied()));
    Some(high - low).filter(|span| *span > 0.0 && span.is_finite())
}

/// Largest threshold of a free shape as a share of the span, that of eq. 16 with ten plays. A wider play hardly moves: its cubic is what a
/// few samples at the ends of the range make of it, and multiplies the voltage at which a record happens to begin.
const FREE_END: f64 = 0.9;

/// Thresholds of a free shape: as [`Placement::Data`], up to nine tenths of the span.
pub(crate) fn free_thresholds(plays: usize, inputs: &[&[f64]]) -> Vec<f64> {
    let Some(span) = span(inputs) else { return Vec::new() };
    data_quantiles(plays, inputs, span, FREE_END)
}

/// Lengths along which the elements of Duhem's family fade, strictly increasing; empty where the inputs do not move.
pub(crate) fn fading_lengths(elements: usize, inputs: &[&[f64]]) -> Vec<f64> {
    span(inputs).map_or_else(Vec::new, |span| lengths(elements, span))
}

/// Number of cells of the histogram of distances; far finer than the spacing of the largest number of plays.
const CELLS: usize = 4096;

/// Quantiles of the distance from the last turning point, up to a share `end` of the span.
fn data_quantiles(plays: usize, inputs: &[&[f64]], span: f64, end: f64) -> Vec<f64> {
    // Each record counts the same however many samples it has; uniform share keeps empty stretches served.
    let mut histogram = vec![0.0; CELLS];
    for input in inputs {
        let mut of_record = vec![0u32; CELLS];
        for_each_travel(input, 1e-3 * span, |travel| {
            let cell = (travel / span * CELLS as f64) as usize;
            of_record[cell.min(CELLS - 1)] += 1;
        });
        let total: u32 = of_record.iter().sum();
        if total > 0 {
            for (sum, &count) in histogram.iter_mut().zip(&of_record) {
                *sum += f64::from(count) / f64::from(total);
            }
        }
    }
    let total: f64 = histogram.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let mut density: Vec<f64> = histogram.iter().map(|h| 0.5 * h / total + 0.5 / CELLS as f64).collect();
    density.truncate((end * CELLS as f64) as usize);
    let within: f64 = density.iter().sum();
    density.iter_mut().for_each(|share| *share /= within);
    let mut thresholds = Vec::with_capacity(plays);
    let (mut cumulative, mut cell) = (0.0, 0);
    for i in 0..plays {
        let target = (i as f64 + 0.5) / plays as f64;
        while cell < density.len() - 1 && cumulative + density[cell] < target {
            cumulative += density[cell];
            cell += 1;
        }
        let inside = ((target - cumulative) / density[cell]).clamp(0.0, 1.0);
        thresholds.push((cell as f64 + inside) / CELLS as f64 * span);
    }
    thresholds
}

/// Calls `visit` with each sample's distance from the last turning point; reversals below `hysteresis` do not count.
fn for_each_travel(input: &[f64], hysteresis: f64, mut visit: impl FnMut(f64)) {
    let Some(&first) = input.first() else { return };
    let (mut corner, mut extreme, mut rising) = (first, first, true);
    for &value in input {
        let beyond = if rising { value > extreme } else { value < extreme };
        if beyond {
            extreme = value;
        } else if (value - extreme).abs() > hysteresis {
            corner = extreme;
            extreme = value;
            rising = !rising;
        }
        if (value - corner).abs() > hysteresis {
            visit((value - corner).abs());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_eq16() {
        let input = [0.0, 20.0];
        assert_eq!(thresholds(Placement::Eq16, 4, &[&input]), [0.0, 5.0, 10.0, 15.0]);
    }

    #[test]
    fn val_all_placements_increase_within_the_span() {
        let input: Vec<f64> = (0..2000).map(|k| 50.0 - 50.0 * (f64::from(k) * 0.01).cos()).collect();
        for placement in [Placement::Eq16, Placement::Log, Placement::Data] {
            for plays in [1, 2, 10, 40, 64] {
                let r = thresholds(placement, plays, &[&input]);
                assert_eq!(r.len(), plays);
                assert!(
                    r.windows(2).all(|pair| pair[0] < pair[1]),
                    "{placement:?} {plays}: {r:?}"
                );
                assert!(r[plays - 1] <= 100.0 && r[0] >= 0.0);
            }
        }
    }

    #[test]
    fn bva_a_free_shape_has_no_play_as_wide_as_the_span() {
        let input: Vec<f64> = (0..2000).map(|k| 50.0 - 50.0 * (f64::from(k) * 0.01).cos()).collect();
        for plays in [1, 18, 64] {
            let free = free_thresholds(plays, &[&input]);
            assert!(free.len() == plays && free[plays - 1] < 90.0, "{free:?}");
            assert!(free.windows(2).all(|pair| pair[0] < pair[1]), "{free:?}");
        }
        assert!(thresholds(Placement::Data, 64, &[&input])[63] > 95.0);
        assert!(free_thresholds(18, &[&[1.0, 1.0]]).is_empty());
    }

    #[test]
    fn val_small_records_draw_thresholds_to_small_values() {
        let large: Vec<f64> = (0..1000).map(|k| 50.0 - 50.0 * (f64::from(k) * 0.01).cos()).collect();
        let small: Vec<f64> = (0..1000).map(|k| 2.0 - 2.0 * (f64::from(k) * 0.01).cos()).collect();
        let with = thresholds(Placement::Data, 10, &[&large, &small]);
        let without = thresholds(Placement::Data, 10, &[&large]);
        let below = |r: &[f64]| r.iter().filter(|&&r| r < 4.0).count();
        assert!(below(&with) > below(&without), "{with:?} {without:?}");
    }

    #[test]
    fn refuse_standing_input() {
        assert!(thresholds(Placement::Eq16, 10, &[&[1.0, 1.0]]).is_empty());
    }
}
