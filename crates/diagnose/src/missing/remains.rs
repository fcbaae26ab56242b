//! What is left, and what it goes with.

use crate::diagnosis::{Lock, Unexplained};
use crate::missing::bench::{Bench, Trial, mean_square};
use hysteron_identify::family::range;

/// Cells of a residual's average over a quantity.
const CELLS: usize = 24;

/// The remaining error over the records that move, and the quantities it is a function of.
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
    Unexplained {
        percent: (percent / count).sqrt(),
        noise_percent: (noise / count).sqrt(),
        locked_to: locks(bench, residuals),
    }
}

/// Share of the squared residual that averages over cells of each quantity explain, more than cells of nothing would.
fn locks(bench: &Bench<'_>, residuals: &[Vec<f64>]) -> Vec<Lock> {
    let mut quantities: Vec<(&str, f64)> = ["time", "position", "speed", "record"].map(|name| (name, 0.0)).to_vec();
    let mut all = 0.0;
    for (trace, residual) in bench.traces.each.iter().zip(residuals) {
        let own = &residual[trace.from..];
        let n = own.len();
        let scale = if trace.stroke_um > 0.0 {
            trace.stroke_um
        } else {
            bench.traces.stroke_um
        }
        .powi(2)
            * n as f64;
        all += own.iter().map(|r| r * r).sum::<f64>() / scale;
        let mean = own.iter().sum::<f64>() / n as f64;
        quantities[3].1 += n as f64 * mean * mean / scale;
        let centred: Vec<f64> = own.iter().map(|r| r - mean).collect();
        let position = &trace.position_um[trace.from..];
        let speed: Vec<f64> = (0..n)
            .map(|k| trace.drive[trace.from + k] - trace.drive[(trace.from + k).saturating_sub(1)])
            .collect();
        let time: Vec<f64> = (0..n).map(|k| k as f64).collect();
        for (slot, quantity) in [(0, &time[..]), (1, position), (2, &speed[..])] {
            quantities[slot].1 += explained(quantity, &centred) / scale;
        }
    }
    quantities
        .into_iter()
        .map(|(to, sum)| Lock {
            to: to.to_owned(),
            share: if all > 0.0 { (sum / all).clamp(0.0, 1.0) } else { 0.0 },
        })
        .collect()
}

fn explained(quantity: &[f64], residual: &[f64]) -> f64 {
    let (low, high) = range(quantity.iter().copied());
    if high <= low {
        return 0.0;
    }
    let (mut sums, mut counts) = ([0.0; CELLS], [0u32; CELLS]);
    for (q, r) in quantity.iter().zip(residual) {
        let cell = (((q - low) / (high - low) * CELLS as f64) as usize).min(CELLS - 1);
        sums[cell] += r;
        counts[cell] += 1;
    }
    sums.iter()
        .zip(counts)
        .filter(|(_, n)| *n > 0)
        .map(|(s, n)| s * s / f64::from(n))
        .sum()
}
