//! The error over position and rate: where in the loop the model fails.

use crate::breakdown::Sample;
use crate::comparison::{ErrorMap, Stretch};

/// Columns of the map.
const COLUMNS: usize = 24;
/// Rows for each direction: each half as fast as the one outside of it.
const ROWS: usize = 8;

/// What fell into a cell.
#[derive(Clone, Default)]
struct Cell<'a> {
    squares: f64,
    count: u32,
    /// The largest error, its record and its sample.
    most: Option<(f64, &'a Sample<'a>, usize)>,
}

/// Error rms in cells of measured position and rate of the modelled output.
pub(crate) fn error_map<'a>(samples: &'a [Sample<'a>]) -> ErrorMap {
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
            worst: Vec::new(),
        };
    }
    let position_edges_um: Vec<f64> = (0..=COLUMNS)
        .map(|i| low + (high - low) * i as f64 / COLUMNS as f64)
        .collect();
    let outward = (0..ROWS as i32).map(|i| fastest / 2f64.powi(i));
    let mut rate_edges_um_per_s: Vec<f64> = outward.clone().map(|edge| -edge).collect();
    rate_edges_um_per_s.extend(outward.rev());
    let rows = rate_edges_um_per_s.len() - 1;
    let place = |sample: &Sample<'_>, k: usize| {
        let column = ((sample.compared.series.measured[k] - low) / (high - low) * COLUMNS as f64) as usize;
        let edges = &rate_edges_um_per_s;
        let row = edges.partition_point(|&edge| edge <= sample.rate(k)).clamp(1, rows) - 1;
        (row, column.min(COLUMNS - 1))
    };
    let mut cells = vec![vec![Cell::default(); COLUMNS]; rows];
    for sample in moving() {
        for (k, error) in sample.errors().enumerate() {
            let (row, column) = place(sample, k);
            let cell = &mut cells[row][column];
            cell.squares += error * error;
            cell.count += 1;
            if cell.most.is_none_or(|(most, ..)| error.abs() > most) {
                cell.most = Some((error.abs(), sample, k));
            }
        }
    }
    // The samples about the largest error that fall in the same cell.
    let about = |(_, sample, k): (f64, &Sample<'_>, usize)| {
        let here = |&other: &usize| place(sample, other) == place(sample, k);
        let first = (0..k).rev().take_while(here).last().unwrap_or(k);
        let last = (k + 1..sample.compared.samples).take_while(here).last().unwrap_or(k);
        Stretch::of(sample.compared, first, last)
    };
    let rms = |cell: &Cell<'_>| (cell.count > 0).then(|| (cell.squares / f64::from(cell.count)).sqrt());
    let each = |row: &Vec<Cell<'_>>| row.iter().map(|cell| cell.most.map(about)).collect();
    let rms_um = cells.iter().map(|row| row.iter().map(rms).collect()).collect();
    let worst = cells.iter().map(each).collect();
    ErrorMap {
        position_edges_um,
        rate_edges_um_per_s,
        rms_um,
        worst,
    }
}
