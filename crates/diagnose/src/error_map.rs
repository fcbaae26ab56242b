//! The error over position and rate: where in the loop the model fails.

use crate::breakdown::Sample;
use crate::comparison::ErrorMap;

/// Columns of the map.
const COLUMNS: usize = 24;
/// Rows for each direction: each half as fast as the one outside of it.
const ROWS: usize = 8;

/// Error rms in cells of measured position and rate of the modelled output.
pub(crate) fn error_map(samples: &[Sample<'_>]) -> ErrorMap {
    let moving = || samples.iter().filter(|sample| sample.weight > 0.0);
    let positions = || moving().flat_map(|s| s.compared.series.measured.iter().copied());
    let (low, high) = (
        positions().fold(f64::INFINITY, f64::min),
        positions().fold(f64::NEG_INFINITY, f64::max),
    );
    let fastest = moving()
        .flat_map(|s| (0..s.compared.samples).map(|k| s.rate(k).abs()))
        .fold(0.0, f64::max);
    if high <= low || fastest <= 0.0 {
        return ErrorMap {
            position_edges_um: Vec::new(),
            rate_edges_um_per_s: Vec::new(),
            rms_um: Vec::new(),
        };
    }
    let position_edges_um: Vec<f64> = (0..=COLUMNS)
        .map(|i| low + (high - low) * i as f64 / COLUMNS as f64)
        .collect();
    let outward = (0..ROWS as i32).map(|i| fastest / 2f64.powi(i));
    let mut rate_edges_um_per_s: Vec<f64> = outward.clone().map(|edge| -edge).collect();
    rate_edges_um_per_s.extend(outward.rev());
    let rows = rate_edges_um_per_s.len() - 1;
    let mut sums = vec![[(0.0, 0u32); COLUMNS]; rows];
    for sample in moving() {
        for (k, error) in sample.errors().enumerate() {
            let column = ((sample.compared.series.measured[k] - low) / (high - low) * COLUMNS as f64) as usize;
            let row = rate_edges_um_per_s
                .partition_point(|&edge| edge <= sample.rate(k))
                .clamp(1, rows)
                - 1;
            let cell = &mut sums[row][column.min(COLUMNS - 1)];
            cell.0 += error * error;
            cell.1 += 1;
        }
    }
    let cell = |&(squares, count): &(f64, u32)| (count > 0).then(|| (squares / f64::from(count)).sqrt());
    let rms_um = sums.iter().map(|row| row.iter().map(cell).collect()).collect();
    ErrorMap {
        position_edges_um,
        rate_edges_um_per_s,
        rms_um,
    }
}
