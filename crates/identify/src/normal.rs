//! Weighted normal equations, accumulated sample by sample, and their regularised solution.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// `G = sum x x'`, `b = sum x y`, `sum y^2` over the rows seen. Memory is the square of the columns, whatever the rows.
#[derive(Debug, Clone)]
pub(crate) struct Normal {
    columns: usize,
    /// Lower triangle, row by row, `columns * columns` cells.
    gram: Vec<f64>,
    rhs: Vec<f64>,
    pub target_squares: f64,
    pub samples: usize,
}

impl Normal {
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            columns,
            gram: vec![0.0; columns * columns],
            rhs: vec![0.0; columns],
            target_squares: 0.0,
            samples: 0,
        }
    }

    /// The system of whole columns: a product of matrices fills the vector unit where sums row by row do not.
    pub(crate) fn of_columns(columns: &DMatrix<f64>, target: &DVector<f64>) -> Self {
        let n = columns.ncols();
        let product = columns.transpose() * columns;
        Self {
            columns: n,
            gram: (0..n * n).map(|cell| product[(cell / n, cell % n)]).collect(),
            rhs: columns.tr_mul(target).iter().copied().collect(),
            target_squares: target.norm_squared(),
            samples: target.len(),
        }
    }

    /// This system with one more column behind the others: its products with them, with itself, and with the target.
    pub(crate) fn bordered(&self, across: &DVector<f64>, own: f64, with_target: f64) -> Self {
        let n = self.columns + 1;
        let mut wider = Self::new(n);
        for i in 0..self.columns {
            wider.gram[i * n..=i * n + i].copy_from_slice(&self.gram[i * self.columns..=i * self.columns + i]);
        }
        wider.gram[(n - 1) * n..n * n - 1].copy_from_slice(across.as_slice());
        wider.gram[n * n - 1] = own;
        wider.rhs[..n - 1].copy_from_slice(&self.rhs);
        wider.rhs[n - 1] = with_target;
        (wider.target_squares, wider.samples) = (self.target_squares, self.samples);
        wider
    }

    /// Number of columns.
    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    /// Adds one row.
    #[inline]
    pub(crate) fn add_row(&mut self, row: &[f64], target: f64) {
        for (i, &x) in row.iter().enumerate() {
            let cells = &mut self.gram[i * self.columns..][..=i];
            for (cell, &other) in cells.iter_mut().zip(row) {
                *cell += x * other;
            }
            self.rhs[i] += x * target;
        }
        self.target_squares += target * target;
        self.samples += 1;
    }

    /// Adds `factor` times another system.
    pub(crate) fn add_scaled(&mut self, other: &Self, factor: f64) {
        for (a, b) in self.gram.iter_mut().zip(&other.gram) {
            *a += factor * b;
        }
        for (a, b) in self.rhs.iter_mut().zip(&other.rhs) {
            *a += factor * b;
        }
        self.target_squares += factor * other.target_squares;
        self.samples += other.samples;
    }

    /// This system with a quadratic cost of its first coefficients.
    pub(crate) fn with_costs(&self, costs: &DMatrix<f64>, factor: f64) -> Self {
        let mut costly = self.clone();
        for i in 0..costs.nrows() {
            for j in 0..=i {
                costly.gram[i * self.columns + j] += factor * costs[(i, j)];
            }
        }
        costly
    }

    /// This system beside a free constant of its own: the first column, a constant, is projected out of all else.
    pub(crate) fn level_free(mut self) -> Self {
        let n = self.columns;
        let own = self.gram[0];
        if own > 0.0 {
            let across: Vec<f64> = (0..n).map(|i| self.gram[i * n]).collect();
            let target = self.rhs[0];
            for i in 0..n {
                for j in 0..=i {
                    self.gram[i * n + j] -= across[i] * across[j] / own;
                }
                self.rhs[i] -= across[i] * target / own;
                self.gram[i * n] = 0.0;
            }
            self.rhs[0] = 0.0;
            self.target_squares -= target * target / own;
        }
        self
    }

    /// The full symmetric matrix.
    pub(crate) fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.columns, self.columns, |i, j| {
            self.gram[i.max(j) * self.columns + i.min(j)]
        })
    }

    /// The right side, `sum x y`.
    pub(crate) fn right_side(&self) -> &[f64] {
        &self.rhs
    }

    /// Squared error of these coefficients on the rows seen: `sum y^2 - 2 b'x + x'Gx`, never below 0.
    pub(crate) fn squared_error(&self, coefficients: &[f64]) -> f64 {
        let quadratic: f64 = coefficients
            .iter()
            .enumerate()
            .map(|(i, &x)| {
                let row = &self.gram[i * self.columns..][..=i];
                let below: f64 = row[..i].iter().zip(coefficients).map(|(g, other)| g * other).sum();
                x * (2.0 * below + row[i] * x)
            })
            .sum();
        let linear: f64 = self.rhs.iter().zip(coefficients).map(|(b, x)| b * x).sum();
        (self.target_squares - 2.0 * linear + quadratic).max(0.0)
    }

    /// Root of the mean of each column's square: the scale that makes the matrix one of correlations.
    fn scales(&self) -> Vec<f64> {
        (0..self.columns)
            .map(|i| self.gram[i * self.columns + i].sqrt())
            .map(|s| if s > 0.0 { s } else { 1.0 })
            .collect()
    }

    fn scaled(&self) -> (DMatrix<f64>, DVector<f64>, Vec<f64>) {
        let scales = self.scales();
        let mut matrix = self.matrix();
        for i in 0..self.columns {
            for j in 0..self.columns {
                matrix[(i, j)] /= scales[i] * scales[j];
            }
        }
        let rhs = DVector::from_fn(self.columns, |i, _| self.rhs[i] / scales[i]);
        (matrix, rhs, scales)
    }

    /// Least squares with a ridge on the scaled columns, by Cholesky; fast, for searches.
    pub(crate) fn solve(&self, ridge: f64) -> Vec<f64> {
        let (mut matrix, rhs, scales) = self.scaled();
        for i in 0..self.columns {
            matrix[(i, i)] += ridge;
        }
        match matrix.cholesky() {
            Some(factor) => factor.solve(&rhs).iter().zip(&scales).map(|(x, s)| x / s).collect(),
            None => self.spectrum().solve(ridge),
        }
    }

    /// As [`Self::solve`], for another right side.
    pub(crate) fn solve_for(&self, right: &DVector<f64>, ridge: f64) -> Vec<f64> {
        let mut other = self.clone();
        other.rhs.copy_from_slice(right.as_slice());
        other.solve(ridge)
    }

    /// The eigenvalues and eigenvectors of the scaled matrix.
    pub(crate) fn spectrum(&self) -> Spectrum {
        let (matrix, rhs, scales) = self.scaled();
        Spectrum {
            eigen: SymmetricEigen::new(matrix),
            rhs,
            scales,
        }
    }
}

/// The scaled normal matrix, diagonalised.
pub(crate) struct Spectrum {
    eigen: SymmetricEigen<f64, nalgebra::Dyn>,
    rhs: DVector<f64>,
    scales: Vec<f64>,
}

/// Directions with less than this share of a column's own square are not determined by the data: a hundred times what
/// rounding of the sums over a million rows leaves.
pub(crate) const UNDETERMINED: f64 = 1e-11;

/// Eigenvalues below this are rounding.
const ROUNDING: f64 = 1e-13;

impl Spectrum {
    /// Least squares with a ridge; directions below rounding are left at zero.
    pub(crate) fn solve(&self, ridge: f64) -> Vec<f64> {
        let projected = self.eigen.eigenvectors.tr_mul(&self.rhs);
        let shrunk = DVector::from_fn(projected.len(), |i, _| {
            let value = self.eigen.eigenvalues[i];
            if value > ROUNDING {
                projected[i] / (value + ridge)
            } else {
                0.0
            }
        });
        let x = &self.eigen.eigenvectors * shrunk;
        x.iter().zip(&self.scales).map(|(x, s)| x / s).collect()
    }

    /// `(G + ridge)^-1` in the columns' own units, determined directions only.
    pub(crate) fn inverse(&self, ridge: f64) -> DMatrix<f64> {
        let n = self.scales.len();
        let mut inverse = DMatrix::zeros(n, n);
        for (k, &value) in self.eigen.eigenvalues.iter().enumerate() {
            if value > UNDETERMINED {
                let v = self.eigen.eigenvectors.column(k);
                inverse += v * v.transpose() / (value + ridge);
            }
        }
        for i in 0..n {
            for j in 0..n {
                inverse[(i, j)] /= self.scales[i] * self.scales[j];
            }
        }
        inverse
    }

    /// For each direction that the data do not determine, the columns that take part in it (at least a tenth of it).
    pub(crate) fn undetermined(&self) -> Vec<Vec<usize>> {
        (0..self.scales.len())
            .filter(|&k| self.eigen.eigenvalues[k] <= UNDETERMINED)
            .map(|k| {
                let v = self.eigen.eigenvectors.column(k);
                (0..v.len()).filter(|&i| v[i].abs() > 0.1).collect()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_straight_line() {
        let mut normal = Normal::new(2);
        for k in 0..100 {
            let x = f64::from(k);
            normal.add_row(&[1.0, x], 3.0 + 0.5 * x);
        }
        for solution in [normal.solve(0.0), normal.spectrum().solve(0.0)] {
            assert!(
                (solution[0] - 3.0).abs() < 1e-10 && (solution[1] - 0.5).abs() < 1e-12,
                "{solution:?}"
            );
            assert!(normal.squared_error(&solution) < 1e-8);
        }
    }

    /// A record on another level than the rest: its slope counts, its level does not, as beside a column that is 1 on it alone.
    #[test]
    fn val_a_free_level_is_a_column_of_its_own() {
        let (mut known, mut shifted, mut dummy) = (Normal::new(2), Normal::new(2), Normal::new(3));
        for k in 0..50 {
            let (x, wave) = (f64::from(k), 0.1 * f64::from(k * 37 % 11));
            known.add_row(&[1.0, x], 3.0 + 0.5 * x + wave);
            shifted.add_row(&[1.0, 2.0 * x], 40.0 + x - wave);
            dummy.add_row(&[1.0, x, 0.0], 3.0 + 0.5 * x + wave);
            dummy.add_row(&[1.0, 2.0 * x, 1.0], 40.0 + x - wave);
        }
        known.add_scaled(&shifted.level_free(), 1.0);
        let (free, beside) = (known.solve(0.0), dummy.solve(0.0));
        assert!(
            (free[0] - beside[0]).abs() < 1e-9 && (free[1] - beside[1]).abs() < 1e-11,
            "{free:?} {beside:?}"
        );
        let left = known.squared_error(&free);
        assert!((left - dummy.squared_error(&beside)).abs() < 1e-6, "{left}");
    }

    #[test]
    fn val_twin_columns_are_named_and_share_their_sum() {
        let mut normal = Normal::new(3);
        for k in 0..100 {
            let x = f64::from(k) / 10.0;
            normal.add_row(&[1.0, x, x], 2.0 + 3.0 * x);
        }
        let spectrum = normal.spectrum();
        assert_eq!(spectrum.undetermined(), vec![vec![1, 2]]);
        let solution = spectrum.solve(1e-12);
        assert!(
            (solution[1] + solution[2] - 3.0).abs() < 1e-9 && (solution[1] - solution[2]).abs() < 1e-6,
            "{solution:?}"
        );
    }
}
