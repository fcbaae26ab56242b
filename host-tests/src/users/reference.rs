//! What a start model leaves, by a least squares of its own: a cubic and ten plays, states carried from record to record.
//!
//! Strengths are measured with it and not with the project's fit, so that a seed means the same stage whatever the tool becomes.

use super::rig::Played;
use hysteron_data::Role;

const PLAYS: usize = 10;
const COLUMNS: usize = PLAYS + 3;

/// Rows of a record that are used: spread evenly.
const ROWS: usize = 3000;

type Row = [f64; COLUMNS];

/// Error of the model on each record, percent of peak to peak, pooled as root mean square over the records that move.
pub(crate) fn left_percent(records: &[Played], range_v: [f64; 2]) -> f64 {
    let mut plays = Plays::new(range_v);
    let rows: Vec<Vec<(Row, f64)>> = records.iter().map(|played| plays.rows(played)).collect();
    let mut normal = Normal::default();
    for (rows, played) in rows.iter().zip(records) {
        if played.record.role == Role::Identify {
            // As it is reported: each record in shares of its own stroke.
            let weight = 1.0 / (rows.len() as f64 * stroke(played).powi(2)).max(1e-30);
            rows.iter().for_each(|(row, y)| normal.add(row, *y, weight));
        }
    }
    let Some(solution) = normal.solve() else {
        return f64::NAN;
    };
    let mut pooled = Vec::new();
    for (rows, played) in rows.iter().zip(records) {
        let stroke = stroke(played);
        if moves(played) {
            let square = |(row, y): &(Row, f64)| {
                let modelled: f64 = row.iter().zip(&solution).map(|(x, c)| x * c).sum();
                (y - modelled).powi(2)
            };
            let mean = rows.iter().map(square).sum::<f64>() / rows.len() as f64;
            pooled.push(1e4 * mean / stroke.powi(2));
        }
    }
    (pooled.iter().sum::<f64>() / pooled.len().max(1) as f64).sqrt()
}

fn stroke(played: &Played) -> f64 {
    let y = &played.record.position_um;
    let (low, high) = y
        .iter()
        .fold((f64::MAX, f64::MIN), |(low, high), &y| (low.min(y), high.max(y)));
    if moves(played) { high - low } else { f64::INFINITY }
}

fn moves(played: &Played) -> bool {
    let v = &played.record.voltage_v;
    let mean = v.iter().sum::<f64>() / v.len() as f64;
    let swing = v.iter().map(|v| (v - mean).abs()).fold(0.0, f64::max);
    swing > 1e-2 * mean.abs().max(1.0)
}

struct Plays {
    range_v: [f64; 2],
    states: [f64; PLAYS],
}

impl Plays {
    fn new(range_v: [f64; 2]) -> Self {
        let mut plays = Self {
            range_v,
            states: [0.0; PLAYS],
        };
        for x in [0.0, 1.0, 0.0] {
            plays.step(x);
        }
        plays
    }

    fn step(&mut self, x: f64) {
        for (j, state) in self.states.iter_mut().enumerate() {
            // Graded: half a percent to three quarters of the range.
            let threshold = 0.375 * (0.0067f64).powf(1.0 - j as f64 / (PLAYS - 1) as f64);
            *state = state.min(x + threshold).max(x - threshold);
        }
    }

    fn rows(&mut self, played: &Played) -> Vec<(Row, f64)> {
        let [low, high] = self.range_v;
        let each = (played.record.len() / ROWS).max(1);
        let mut rows = Vec::with_capacity(ROWS + 1);
        for (k, v) in played.command_v.iter().enumerate() {
            let x = (v - low) / (high - low);
            self.step(x);
            if k >= played.lead_in && (k - played.lead_in).is_multiple_of(each) {
                let mut row = [1.0; COLUMNS];
                row[1] = x;
                row[2] = x.powi(3);
                row[3..].copy_from_slice(&self.states);
                rows.push((row, played.record.position_um[k - played.lead_in]));
            }
        }
        rows
    }
}

/// Normal equations.
#[derive(Default)]
struct Normal {
    square: [[f64; COLUMNS]; COLUMNS],
    right: [f64; COLUMNS],
}

impl Normal {
    fn add(&mut self, row: &Row, y: f64, weight: f64) {
        for i in 0..COLUMNS {
            self.right[i] += weight * row[i] * y;
            for j in 0..=i {
                self.square[i][j] += weight * row[i] * row[j];
            }
        }
    }

    /// By Cholesky, with a ridge far below what matters.
    fn solve(&self) -> Option<[f64; COLUMNS]> {
        let mut lower = self.square;
        let ridge = 1e-9 * (0..COLUMNS).map(|i| self.square[i][i]).fold(0.0, f64::max);
        for i in 0..COLUMNS {
            for j in 0..=i {
                let mut sum = self.square[i][j] + if i == j { ridge } else { 0.0 };
                for (a, b) in lower[i].iter().zip(&lower[j]).take(j) {
                    sum -= a * b;
                }
                if i == j {
                    if sum <= 0.0 {
                        return None;
                    }
                    lower[i][i] = sum.sqrt();
                } else {
                    lower[i][j] = sum / lower[j][j];
                }
            }
        }
        let mut x = self.right;
        for i in 0..COLUMNS {
            for k in 0..i {
                x[i] -= lower[i][k] * x[k];
            }
            x[i] /= lower[i][i];
        }
        for i in (0..COLUMNS).rev() {
            for k in i + 1..COLUMNS {
                x[i] -= lower[k][i] * x[k];
            }
            x[i] /= lower[i][i];
        }
        Some(x)
    }
}
