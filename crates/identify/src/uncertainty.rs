//! Standard errors of the fitted parameters.

use crate::columns::{Design, Run};
use crate::family::Family;
use crate::lagged::lagged_products;
use crate::normal::Normal;
use crate::separable::{Solved, pooled};
use hysteron_core::envelope::Envelope;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Standard errors of the coefficients, then of alpha and beta (MRPI only); `None` where the data do not determine one.
pub(crate) struct StandardErrors {
    pub coefficients: Vec<Option<f64>>,
    pub envelope: Option<[f64; 2]>,
    /// Groups of coefficients of which only a combination is determined.
    pub undetermined: Vec<Vec<usize>>,
}

/// Sandwich covariance `A^-1 B A^-1` (White 1980): A the weighted normal matrix, B the same with each record's residual
/// variance, inflated by its integrated autocorrelation time, because residuals of a discretised hysteresis model are
/// never white. Alpha and beta enter by their derivative columns.
pub(crate) fn standard_errors(solved: &Solved, runs: &[Run<'_>]) -> StandardErrors {
    let spectrum = pooled(&solved.normals, runs).spectrum();
    let undetermined = spectrum.undetermined();
    let searched = solved.design.family == Family::Mrpi;
    let normals: Vec<Normal> = if searched {
        with_derivatives(solved, runs)
    } else {
        solved.normals.clone()
    };
    let inverse: DMatrix<f64> = pooled(&normals, runs).spectrum().inverse(solved.ridge);
    let noise = per_run_variance(solved, runs);
    let mut middle = DMatrix::zeros(inverse.nrows(), inverse.ncols());
    for ((normal, run), variance) in normals.iter().zip(runs).zip(noise) {
        middle += normal.matrix() * (run.weight * run.weight * variance);
    }
    let covariance = &inverse * middle * &inverse;
    let n = solved.coefficients.len();
    let error = |i: usize| covariance[(i, i)].max(0.0).sqrt();
    let coefficients = (0..n)
        .map(|i| (!undetermined.iter().any(|group| group.contains(&i))).then(|| error(i)))
        .collect();
    StandardErrors {
        coefficients,
        envelope: searched.then(|| [error(n), error(n + 1)]),
        undetermined,
    }
}

/// Residual variance times integrated autocorrelation time of each run.
fn per_run_variance(solved: &Solved, runs: &[Run<'_>]) -> Vec<f64> {
    runs.par_iter()
        .map(|run| {
            let mut residual = Vec::with_capacity(run.output.len());
            solved.design.simulate(&solved.coefficients, run, |k, modelled| {
                if run.counts(k) {
                    residual.push(run.output[k] - modelled);
                }
            });
            inflated_variance(&residual)
        })
        .collect()
}

/// Longest lag at which a residual is looked at for what it remembers, samples.
const LONGEST: usize = 1 << 20;

/// Mean square of a residual times its integrated autocorrelation time, samples.
pub(crate) fn inflated_variance(residual: &[f64]) -> f64 {
    let correlation = lagged_products(residual, residual, 0, residual.len().saturating_sub(1).min(LONGEST));
    let Some(&power) = correlation.first().filter(|&&power| power > 0.0) else {
        return 0.0;
    };
    // Sum up to the first lag that is not positive (initial positive sequence, Geyer 1992).
    let positive: f64 = correlation[1..].iter().take_while(|&&c| c > 0.0).sum();
    (power + 2.0 * positive) / residual.len() as f64
}

/// Normal matrices with two more columns: the derivatives of the output by alpha and by beta.
fn with_derivatives(solved: &Solved, runs: &[Run<'_>]) -> Vec<Normal> {
    let base = solved.design.envelope;
    let step_s = 1e-3 * (base.alpha_s + base.beta_s).max(1e-6);
    let shifted = |alpha: f64, beta: f64| Design {
        envelope: Envelope {
            alpha_s: base.alpha_s + alpha,
            beta_s: base.beta_s + beta,
        },
        ..solved.design.clone()
    };
    let (by_alpha, by_beta) = (shifted(step_s, 0.0), shifted(0.0, step_s));
    runs.par_iter()
        .map(|run| {
            let simulate = |design: &Design| {
                let mut output = Vec::with_capacity(run.input.len());
                design.simulate(&solved.coefficients, run, |_, modelled| output.push(modelled));
                output
            };
            let (here, alpha, beta) = (simulate(&solved.design), simulate(&by_alpha), simulate(&by_beta));
            let columns = solved.coefficients.len();
            let mut normal = Normal::new(columns + 2);
            let mut row = vec![0.0; columns + 2];
            solved.design.for_each_row(run, 1, |k, linear, target| {
                row[..columns].copy_from_slice(linear);
                row[columns] = (alpha[k] - here[k]) / step_s;
                row[columns + 1] = (beta[k] - here[k]) / step_s;
                normal.add_row(&row, target);
            });
            normal
        })
        .collect()
}
