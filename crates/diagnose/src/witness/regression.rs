//! Regression of many records at once, refitted without any one of them at next to no cost.

use nalgebra::{DMatrix, DVector};

/// Normal equations of one record.
#[derive(Debug, Clone)]
pub(crate) struct Gram {
    matrix: DMatrix<f64>,
    rhs: DVector<f64>,
    squares: f64,
    pub rows: usize,
}

impl Gram {
    pub(crate) fn new(columns: &DMatrix<f64>, target: &DVector<f64>) -> Self {
        Self {
            // As a product: dot products of columns do not fill the vector unit.
            matrix: columns.transpose() * columns,
            rhs: columns.tr_mul(target),
            squares: target.norm_squared(),
            rows: target.len(),
        }
    }

    /// These normal equations of `columns` with some more columns behind them.
    pub(crate) fn with(&self, columns: &DMatrix<f64>, more: &DMatrix<f64>, target: &DVector<f64>) -> Self {
        let (n, m) = (columns.ncols(), more.ncols());
        let mut wider = Self::zeros(n + m);
        let across = columns.tr_mul(more);
        wider.matrix.view_mut((0, 0), (n, n)).copy_from(&self.matrix);
        wider.matrix.view_mut((0, n), (n, m)).copy_from(&across);
        wider.matrix.view_mut((n, 0), (m, n)).copy_from(&across.transpose());
        wider.matrix.view_mut((n, n), (m, m)).copy_from(&more.tr_mul(more));
        wider.rhs.rows_mut(0, n).copy_from(&self.rhs);
        wider.rhs.rows_mut(n, m).copy_from(&more.tr_mul(target));
        (wider.squares, wider.rows) = (self.squares, self.rows);
        wider
    }

    pub(crate) fn zeros(n: usize) -> Self {
        Self {
            matrix: DMatrix::zeros(n, n),
            rhs: DVector::zeros(n),
            squares: 0.0,
            rows: 0,
        }
    }

    pub(crate) fn add(&mut self, other: &Self, weight: f64) {
        self.matrix.zip_apply(&other.matrix, |a, b| *a += weight * b);
        self.rhs.axpy(weight, &other.rhs, 1.0);
        self.squares += weight * other.squares;
        self.rows += other.rows;
    }

    /// Squared error of coefficients on the rows behind this.
    pub(crate) fn squared_error(&self, x: &DVector<f64>) -> f64 {
        (self.squares - 2.0 * self.rhs.dot(x) + x.dot(&(&self.matrix * x))).max(0.0)
    }

    /// Least squares; a ridge on the first `base` columns, scaled to one; the others get what rounding needs.
    pub(crate) fn solve(&self, base: usize, ridge: f64, keep: &[bool]) -> DVector<f64> {
        /// A hundred times the rounding of sums over 20 000 rows: keeps empty and twin columns harmless.
        const LEAST: f64 = 1e-12;
        let n = self.rhs.len();
        let used: Vec<usize> = (0..n)
            .filter(|&j| keep.get(j).copied().unwrap_or(true) && self.matrix[(j, j)] > 0.0)
            .collect();
        let scale: Vec<f64> = used.iter().map(|&j| self.matrix[(j, j)].sqrt()).collect();
        let m = used.len();
        let mut scaled = DMatrix::from_fn(m, m, |a, b| self.matrix[(used[a], used[b])] / (scale[a] * scale[b]));
        for (a, &j) in used.iter().enumerate() {
            // The constant is not shrunk: an offset must change nothing.
            scaled[(a, a)] += if j > 0 && j < base { ridge.max(LEAST) } else { LEAST };
        }
        let rhs = DVector::from_fn(m, |a, _| self.rhs[used[a]] / scale[a]);
        let mut x = DVector::zeros(n);
        if let Some(factor) = scaled.cholesky() {
            let solution = factor.solve(&rhs);
            for (a, &j) in used.iter().enumerate() {
                x[j] = solution[a] / scale[a];
            }
        }
        x
    }
}
