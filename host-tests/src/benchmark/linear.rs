//! A linear model by least squares: `y_k = sum a_i y_(k-i) + sum b_i u_(k-i)`, its order by free simulation on the last train record.

use hysteron_data::{Dataset, Record, Role};

/// A linear model with as many past positions as past drives.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    order: usize,
    /// Past positions, then drives from the present on.
    weights: Vec<f64>,
}

/// Orders that are tried.
const ORDERS: [usize; 6] = [2, 3, 4, 6, 10, 16];

impl Linear {
    /// The model that simulates the last train record best; none where no order can be solved.
    pub fn fit(dataset: &Dataset) -> Option<Self> {
        let train: Vec<&Record> = dataset.with_role(Role::Identify).collect();
        let (last, others) = train.split_last()?;
        let fitted_to = if others.is_empty() { train.as_slice() } else { others };
        let tried = ORDERS.into_iter().filter_map(|order| Self::of_order(order, fitted_to));
        let best = tried.min_by(|a, b| a.rms_um(last).total_cmp(&b.rms_um(last)))?;
        Self::of_order(best.order, &train)
    }

    fn of_order(order: usize, records: &[&Record]) -> Option<Self> {
        let width = 2 * order + 1;
        let mut square = vec![vec![0.0; width]; width];
        let mut right = vec![0.0; width];
        for record in records {
            let (u, y) = (&record.voltage_v, &record.position_um);
            for k in order..y.len() {
                let row = Self::row(order, u, y, k);
                for i in 0..width {
                    right[i] += row[i] * y[k];
                    for j in 0..width {
                        square[i][j] += row[i] * row[j];
                    }
                }
            }
        }
        Some(Self {
            order,
            weights: solve(square, right)?,
        })
    }

    fn row(order: usize, u: &[f64], y: &[f64], k: usize) -> Vec<f64> {
        let past = (1..=order).map(|i| if i <= k { y[k - i] } else { 0.0 });
        past.chain((0..=order).map(|i| if i <= k { u[k - i] } else { 0.0 }))
            .collect()
    }

    /// Free simulation from rest.
    pub fn simulate(&self, record: &Record) -> Vec<f64> {
        let mut y: Vec<f64> = Vec::with_capacity(record.len());
        for k in 0..record.len() {
            y.push(0.0);
            let row = Self::row(self.order, &record.voltage_v, &y, k);
            let next: f64 = row.iter().zip(&self.weights).map(|(x, w)| x * w).sum();
            // What an unstable model makes of it is an error without bound, and no number that is none.
            y[k] = next.clamp(-1e12, 1e12);
        }
        y
    }

    /// Error of the free simulation, micrometres rms.
    pub fn rms_um(&self, record: &Record) -> f64 {
        let squares = self
            .simulate(record)
            .into_iter()
            .zip(&record.position_um)
            .map(|(m, y)| (y - m).powi(2));
        (squares.sum::<f64>() / record.len() as f64).sqrt()
    }
}

/// Gauss with pivots, on columns of unit size.
fn solve(mut square: Vec<Vec<f64>>, mut right: Vec<f64>) -> Option<Vec<f64>> {
    let n = right.len();
    let size: Vec<f64> = (0..n).map(|i| square[i][i].sqrt().max(f64::MIN_POSITIVE)).collect();
    for i in 0..n {
        right[i] /= size[i];
        for j in 0..n {
            square[i][j] /= size[i] * size[j];
        }
    }
    for i in 0..n {
        let pivot = (i..n).max_by(|&a, &b| square[a][i].abs().total_cmp(&square[b][i].abs()))?;
        if square[pivot][i].abs() < 1e-15 {
            return None;
        }
        square.swap(i, pivot);
        right.swap(i, pivot);
        let (upper, lower) = square.split_at_mut(i + 1);
        let pivots = &upper[i];
        for (below, row) in lower.iter_mut().enumerate() {
            let factor = row[i] / pivots[i];
            for (x, pivot) in row[i..].iter_mut().zip(&pivots[i..]) {
                *x -= factor * pivot;
            }
            right[i + 1 + below] -= factor * right[i];
        }
    }
    for i in (0..n).rev() {
        for j in i + 1..n {
            right[i] -= square[i][j] * right[j];
        }
        right[i] /= square[i][i];
    }
    Some(right.iter().zip(&size).map(|(x, s)| x / s).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::System;

    /// A linear system is found exactly: that of a small force on the Duffing oscillator is one, to the third power of the force.
    #[test]
    fn val_a_linear_system_is_found() {
        let mut dataset = System::Duffing.benchmark(1).dataset;
        for record in &mut dataset.records {
            record.voltage_v.iter_mut().for_each(|u| *u *= 1e-3);
            record.position_um = System::Duffing.respond(&record.voltage_v);
        }
        let model = Linear::fit(&dataset).expect("a model");
        let test = dataset.with_role(Role::Validate).next().expect("a test record");
        let swing = test.position_um.iter().fold(0.0, |a: f64, y| a.max(y.abs()));
        let rms = model.rms_um(test);
        assert!(rms < 1e-3 * swing, "{rms} of {swing}");
    }
}
