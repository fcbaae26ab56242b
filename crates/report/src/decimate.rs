//! Long series with few points: what is left looks the same at the size drawn, and no spike is lost.

use std::collections::HashSet;

/// The indices of the smallest and the largest value of each run of samples that share a column of pixels, in the order
/// of the series. `column` gives a sample's column and never decreases. Values that are not finite are left out.
///
/// # Cost
/// One pass; at most two indices a column.
pub(crate) fn min_max(len: usize, column: impl Fn(usize) -> usize, value: impl Fn(usize) -> f64) -> Vec<usize> {
    let mut kept = Vec::new();
    let mut run: Option<Run> = None;
    for index in (0..len).filter(|index| value(*index).is_finite()) {
        match &mut run {
            Some(run) if run.column == column(index) => {
                if value(index) < value(run.smallest) {
                    run.smallest = index;
                }
                if value(index) > value(run.largest) {
                    run.largest = index;
                }
            }
            _ => {
                keep(run, &mut kept);
                run = Some(Run {
                    column: column(index),
                    smallest: index,
                    largest: index,
                });
            }
        }
    }
    keep(run, &mut kept);
    kept
}

/// The extremes of a run.
struct Run {
    column: usize,
    smallest: usize,
    largest: usize,
}

/// Keeps a run's extremes in the order of the series.
fn keep(run: Option<Run>, kept: &mut Vec<usize>) {
    if let Some(Run { smallest, largest, .. }) = run {
        kept.push(smallest.min(largest));
        if smallest != largest {
            kept.push(smallest.max(largest));
        }
    }
}

/// [`min_max`] of a uniformly sampled series over `columns` columns.
pub(crate) fn min_max_uniform(len: usize, columns: usize, value: impl Fn(usize) -> f64) -> Vec<usize> {
    let len_or_one = len.max(1);
    min_max(len, |index| index * columns.max(1) / len_or_one, value)
}

/// Cell sizes tried for a path, in pixels, until it is short enough.
const CELLS_PX: [f64; 6] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0];

/// A path through a plane as few polylines: samples that stay in a cell of the grid, and ways between cells that were
/// walked before, are left out. Every sample lies within one cell of a point that is kept, so that no spike is lost; the
/// cells start at a pixel and grow only as long as more than `budget` points are left.
///
/// `at` gives a sample's place in pixels.
///
/// # Cost
/// One pass for each cell size tried, with a hash set of at most `budget` ways.
pub fn path(len: usize, budget: usize, at: impl Fn(usize) -> (f64, f64)) -> Vec<Vec<usize>> {
    let mut lines = Vec::new();
    for (tried, cell_px) in CELLS_PX.iter().enumerate() {
        let limit = if tried + 1 == CELLS_PX.len() {
            usize::MAX
        } else {
            budget
        };
        if let Some(found) = path_on_grid(len, *cell_px, limit, &at) {
            lines = found;
            break;
        }
    }
    lines
}

/// The path on one grid; nothing when it takes more than `budget` points.
fn path_on_grid(len: usize, cell_px: f64, budget: usize, at: &impl Fn(usize) -> (f64, f64)) -> Option<Vec<Vec<usize>>> {
    let mut walked: HashSet<(i32, i32, i32, i32)> = HashSet::new();
    let mut lines: Vec<Vec<usize>> = Vec::new();
    let mut points = 0;
    let mut before: Option<(i32, i32, usize)> = None;
    let mut pen_down = false;
    for index in 0..len {
        let (x, y) = at(index);
        if !x.is_finite() || !y.is_finite() {
            before = None;
            pen_down = false;
            continue;
        }
        let (column, row) = ((x / cell_px).floor() as i32, (y / cell_px).floor() as i32);
        let Some((column_before, row_before, index_before)) = before else {
            before = Some((column, row, index));
            continue;
        };
        if (column, row) == (column_before, row_before) {
            continue;
        }
        let way = if (column, row) < (column_before, row_before) {
            (column, row, column_before, row_before)
        } else {
            (column_before, row_before, column, row)
        };
        if walked.insert(way) {
            if !pen_down {
                lines.push(vec![index_before]);
                points += 1;
            }
            if let Some(line) = lines.last_mut() {
                line.push(index);
            }
            points += 1;
            pen_down = true;
        } else {
            pen_down = false;
        }
        if points > budget {
            return None;
        }
        before = Some((column, row, index));
    }
    Some(lines)
}

#[cfg(test)]
mod tests {
    use super::{min_max_uniform, path};
    use proptest::prelude::{ProptestConfig, prop_assert, proptest};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn prop_min_max_keeps_order_and_every_column_s_extremes(
            values in proptest::collection::vec(-1e3f64..1e3, 2..4000), columns in 1usize..400,
        ) {
            let kept = min_max_uniform(values.len(), columns, |i| values[i]);
            prop_assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
            prop_assert!(kept.len() <= (2 * columns).max(2));
            // A spike put anywhere is always kept.
            for spike in [0, values.len() / 3, values.len() - 1] {
                let kept = min_max_uniform(values.len(), columns, |i| if i == spike { 1e6 } else { values[i] });
                prop_assert!(kept.contains(&spike));
                let kept = min_max_uniform(values.len(), columns, |i| if i == spike { -1e6 } else { values[i] });
                prop_assert!(kept.contains(&spike));
            }
        }

        #[test]
        fn prop_path_leaves_no_sample_further_than_a_cell(
            samples in proptest::collection::vec((0.0f64..300.0, 0.0f64..300.0), 2..3000),
        ) {
            let budget = 500;
            let kept: Vec<usize> = path(samples.len(), budget, |i| samples[i]).concat();
            // The coarsest cell is 6 px; a sample and the kept point of its cell are at most its diagonal apart, 8.5 px.
            if samples.iter().any(|s| (s.0 - samples[0].0).abs() > 6.0) {
                for (x, y) in &samples {
                    let nearest = kept.iter().map(|k| (samples[*k].0 - x).hypot(samples[*k].1 - y)).fold(f64::MAX, f64::min);
                    prop_assert!(nearest <= 6.0 * std::f64::consts::SQRT_2, "{nearest}");
                }
            }
        }
    }

    #[test]
    fn prop_path_of_a_repeated_loop_is_as_long_as_of_one() {
        let circle = |i: usize| {
            let phase = std::f64::consts::TAU * (i % 1000) as f64 / 1000.0;
            (150.0 + 100.0 * phase.cos(), 150.0 + 100.0 * phase.sin())
        };
        let once: usize = path(1001, 5000, circle).iter().map(Vec::len).sum();
        let often: usize = path(1_000_000, 5000, circle).iter().map(Vec::len).sum();
        assert!(once > 500);
        // The thousand repetitions add nothing but the cut where the first one closed.
        assert!(often <= once + 2, "{often} {once}");
    }

    #[test]
    fn prop_values_that_are_not_finite_are_skipped() {
        let values = [0.0, f64::NAN, 1.0, f64::INFINITY, 2.0];
        assert_eq!(min_max_uniform(5, 100, |i| values[i]), vec![0, 2, 4]);
        assert_eq!(min_max_uniform(5, 1, |i| values[i]), vec![0, 4]);
        assert!(min_max_uniform(0, 10, |_| 0.0).is_empty());
        assert!(path(5, 100, |i| (values[i], values[i])).is_empty());
    }
}
