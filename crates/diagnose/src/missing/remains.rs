//! What is left, and what it goes with.

use crate::diagnosis::Unexplained;
use crate::missing::bench::{Bench, Trial, mean_square};
use crate::missing::locks::Courses;

/// The remaining error over the records that move, and what it goes with.
pub(crate) fn remains(bench: &Bench<'_>, last: &Trial, residuals: &[Vec<f64>]) -> Unexplained {
    let moving: Vec<usize> = (0..residuals.len())
        .filter(|&i| bench.traces.each[i].stroke_um > 0.0)
        .collect();
    let count = moving.len().max(1) as f64;
    let percent = moving
        .iter()
        .map(|&i| 1e4 * mean_square(&last.residuals[i]) / bench.traces.each[i].stroke_um.powi(2))
        .sum::<f64>();
    let noise = moving
        .iter()
        .map(|&i| 1e4 * bench.noise_um.powi(2) / bench.traces.each[i].stroke_um.powi(2))
        .sum::<f64>();
    let own = bench.traces.each.iter().zip(residuals).map(|(t, r)| &r[t.from..]);
    Unexplained {
        percent: (percent / count).sqrt(),
        // Noise is never larger than what is left.
        noise_percent: (noise.min(percent) / count).sqrt(),
        locked_to: Courses::new(bench.traces, own).locks(),
    }
}
