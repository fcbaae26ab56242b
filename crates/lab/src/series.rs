//! Long series as few points, by the smallest and the largest value of each column of pixels: no spike is lost.

use hysteron_report::decimate;
use serde::Serialize;

/// Points for a plot: one abscissa, some series over it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Points {
    /// Abscissa.
    pub(crate) x: Vec<f64>,
    /// The series.
    pub(crate) y: Vec<Vec<f64>>,
    /// Samples that the points stand for.
    pub(crate) samples: usize,
}

/// Most columns that are given out.
pub(crate) const MOST_COLUMNS: usize = 4000;

/// `len` samples from index `first` in at most `columns` columns. Of each series and column the smallest and the largest
/// value are kept, in the order they came; `x` is the abscissa of a sample.
///
/// # Cost
/// One pass for each series.
pub(crate) fn columns(
    first: usize,
    len: usize,
    columns: usize,
    x: impl Fn(usize) -> f64,
    series: &[&dyn Fn(usize) -> f64],
) -> Points {
    let columns = columns.clamp(1, MOST_COLUMNS);
    if len <= 2 * columns {
        let indices = first..first + len;
        return Points {
            x: indices.clone().map(x).collect(),
            y: series
                .iter()
                .map(|value| indices.clone().map(value).collect())
                .collect(),
            samples: len,
        };
    }
    let edge = |column: usize| first + (column as u128 * len as u128 / columns as u128) as usize;
    let mut points = Points {
        x: Vec::new(),
        y: vec![Vec::new(); series.len()],
        samples: len,
    };
    for column in 0..columns {
        let (from, to) = (edge(column), edge(column + 1));
        points.x.extend([x(from), x(from + (to - from) / 2)]);
        for (value, out) in series.iter().zip(&mut points.y) {
            out.extend(extremes(from, to, value));
        }
    }
    points
}

/// Smallest and largest of a run, in the order they come.
fn extremes(from: usize, to: usize, value: &dyn Fn(usize) -> f64) -> [f64; 2] {
    let (mut low, mut high) = ((from, value(from)), (from, value(from)));
    for index in from..to {
        let here = value(index);
        if here < low.1 {
            low = (index, here);
        }
        if here > high.1 {
            high = (index, here);
        }
    }
    if low.0 <= high.0 {
        [low.1, high.1]
    } else {
        [high.1, low.1]
    }
}

/// Pixels of the square that a loop is drawn on.
const LOOP_PX: f64 = 500.0;

/// Points a loop may have.
const LOOP_POINTS: usize = 8000;

/// A loop as points; a gap between pieces is a `null`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Loop {
    pub(crate) x: Vec<Option<f64>>,
    pub(crate) y: Vec<Option<f64>>,
}

/// The path of `y` over `x`, to a pixel.
pub(crate) fn path(x: &[f64], y: &[f64]) -> Loop {
    let scale = |values: &[f64]| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (low, LOOP_PX / (high - low).max(f64::MIN_POSITIVE))
    };
    let ((x_low, x_scale), (y_low, y_scale)) = (scale(x), scale(y));
    let lines = decimate::path(x.len().min(y.len()), LOOP_POINTS, |k| {
        ((x[k] - x_low) * x_scale, (y[k] - y_low) * y_scale)
    });
    let mut drawn = Loop {
        x: Vec::new(),
        y: Vec::new(),
    };
    for line in lines {
        drawn.x.extend(line.iter().map(|&k| Some(x[k])).chain([None]));
        drawn.y.extend(line.iter().map(|&k| Some(y[k])).chain([None]));
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::columns;

    #[test]
    fn prop_no_spike_is_lost_however_few_the_columns() {
        let n = 100_003;
        for (spike, width) in [(0, 1), (1, 7), (50_000, 800), (n - 1, 4000), (77_777, 13)] {
            let value = |k: usize| {
                if k == spike {
                    9.0
                } else if k == n - 1 - spike {
                    -9.0
                } else {
                    (k as f64).sin()
                }
            };
            let points = columns(0, n, width, |k| k as f64, &[&value]);
            let kept = &points.y[0];
            assert_eq!(
                kept.iter().copied().fold(f64::MIN, f64::max),
                9.0,
                "spike at {spike}, {width} columns"
            );
            assert_eq!(kept.iter().copied().fold(f64::MAX, f64::min), -9.0);
            assert!(points.x.windows(2).all(|w| w[0] <= w[1]) && points.x.len() <= 2 * width);
        }
    }

    #[test]
    fn prop_a_window_with_few_samples_has_them_all() {
        let points = columns(10, 5, 100, |k| k as f64, &[&|k| k as f64 * 2.0]);
        assert_eq!(points.x, [10.0, 11.0, 12.0, 13.0, 14.0]);
        assert_eq!(points.y[0], [20.0, 22.0, 24.0, 26.0, 28.0]);
    }
}
