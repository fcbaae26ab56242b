//! Separable least squares: the model is linear in its weights, so only alpha and beta are searched
//! (variable projection, Golub and Pereyra 1973).

use crate::columns::{Design, Run};
use crate::family::Family;
use crate::normal::Normal;
use crate::simplex::{Vertex, minimum};
use hysteron_core::envelope::Envelope;
use rayon::prelude::*;

/// Ridge on the scaled columns of the models that are linear in the plays: a tenth of what rounding leaves undetermined
/// moves no coefficient that the data determine, and keeps twin columns from opposing each other.
pub(crate) const RIDGE: f64 = 1e-12;

/// Ridges tried for the play-polynomial, which extrapolates badly without; chosen by leaving out one record at a time.
const POLYNOMIAL_RIDGES: [f64; 6] = [1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5];

/// What the play-polynomial gets where a single record leaves nothing to choose by.
const POLYNOMIAL_RIDGE: f64 = 1e-7;

/// Rows that the search over alpha and beta looks at; the final solution takes all.
pub(crate) const SEARCH_ROWS: usize = 5_000;

/// Largest alpha and beta searched, seconds: five times the seed's figure-1 example; one sample where sampling is slower.
const LARGEST_S: f64 = 1e-3;

/// The shortest and the longest envelope that records of this finest sample period can show, seconds.
fn searched(finest_s: f64) -> (f64, f64) {
    // Below a fiftieth of a sample an envelope of a play without width is a pure derivative: nothing new, and weights
    // without bound.
    (finest_s / 50.0, LARGEST_S.max(finest_s))
}

/// A separable fit.
pub(crate) struct Solved {
    pub design: Design,
    pub coefficients: Vec<f64>,
    pub ridge: f64,
    /// One system of normal equations a run, unweighted.
    pub normals: Vec<Normal>,
}

/// Fits coefficients, and alpha and beta where the family has them.
pub(crate) fn solve(family: Family, thresholds: Vec<f64>, runs: &[Run<'_>], progress: &(dyn Fn(f64) + Sync)) -> Solved {
    let mut design = Design::still(family, thresholds);
    if family == Family::Mrpi {
        design.envelope = search_envelope(&design, runs, progress);
    }
    let normals = normals(&design, runs, 1);
    let ridge = if family == Family::PlayPolynomial {
        choose_ridge(&normals, &runs.iter().map(|run| run.weight).collect::<Vec<_>>())
    } else {
        RIDGE
    };
    let coefficients = pooled(&normals, runs).spectrum().solve(ridge);
    Solved {
        design,
        coefficients,
        ridge,
        normals,
    }
}

/// Normal equations of each run, every `stride`-th row.
pub(crate) fn normals(design: &Design, runs: &[Run<'_>], stride: usize) -> Vec<Normal> {
    runs.par_iter()
        .map(|run| {
            let mut normal = Normal::new(design.columns());
            design.for_each_row(run, stride, |_, row, target| normal.add_row(row, target));
            if run.level_free { normal.level_free() } else { normal }
        })
        .collect()
}

/// The weighted sum of the runs' systems.
pub(crate) fn pooled(normals: &[Normal], runs: &[Run<'_>]) -> Normal {
    let mut sum = Normal::new(normals.first().map_or(1, |n| n.matrix().nrows()));
    for (normal, run) in normals.iter().zip(runs) {
        sum.add_scaled(normal, run.weight);
    }
    sum
}

/// The ridge under which coefficients fitted to all records but one explain that one best.
pub(crate) fn choose_ridge(normals: &[Normal], weights: &[f64]) -> f64 {
    if normals.len() < 3 {
        return POLYNOMIAL_RIDGE;
    }
    let mut all = Normal::new(normals[0].matrix().nrows());
    for (normal, &weight) in normals.iter().zip(weights) {
        all.add_scaled(normal, weight);
    }
    let mut errors = [0.0; POLYNOMIAL_RIDGES.len()];
    for (normal, &weight) in normals.iter().zip(weights) {
        let mut rest = all.clone();
        rest.add_scaled(normal, -weight);
        let spectrum = rest.spectrum();
        for (error, &ridge) in errors.iter_mut().zip(&POLYNOMIAL_RIDGES) {
            *error += weight * normal.squared_error(&spectrum.solve(ridge));
        }
    }
    let best = (0..errors.len())
        .min_by(|&a, &b| errors[a].total_cmp(&errors[b]))
        .unwrap_or(0);
    POLYNOMIAL_RIDGES[best]
}

/// Alpha and beta by a coarse grid (the objective has several valleys) and a simplex from its best point.
fn search_envelope(design: &Design, runs: &[Run<'_>], progress: &(dyn Fn(f64) + Sync)) -> Envelope<f64> {
    let rows: usize = runs.iter().map(|run| run.input.len()).sum();
    let stride = rows.div_ceil(SEARCH_ROWS).max(1);
    let finest = runs.iter().map(|run| run.period_s).fold(f64::INFINITY, f64::min);
    let (least, largest) = searched(finest);
    let objective = &|alpha_s: f64, beta_s: f64| -> f64 {
        let envelope = Envelope {
            alpha_s: alpha_s.clamp(least, largest),
            beta_s: beta_s.clamp(least, largest),
        };
        let trial = Design {
            envelope,
            ..design.clone()
        };
        let system = pooled(&normals(&trial, runs, stride), runs);
        // Outside the bounds the objective grows, so that the simplex comes back.
        let outside = (alpha_s - envelope.alpha_s).abs() + (beta_s - envelope.beta_s).abs();
        system.squared_error(&system.solve(RIDGE)) * (1.0 + outside / largest)
    };
    let grid = [0.0, finest, 3.0 * finest, 1e-4, 3e-4];
    let mut best = (f64::INFINITY, 0.0, 0.0);
    for (i, &alpha_s) in grid.iter().enumerate() {
        for &beta_s in &grid {
            let value = objective(alpha_s, beta_s);
            if value < best.0 {
                best = (value, alpha_s, beta_s);
            }
        }
        progress(0.7 * (i + 1) as f64 / grid.len() as f64);
    }
    let (mut alpha_s, mut beta_s) = (best.1, best.2);
    // A simplex that has collapsed in a bent valley goes on when it is set up anew.
    for share in [0.5, 0.1, 0.02] {
        let size = share * alpha_s.max(beta_s).max(finest);
        let (found, _) = minimum(&[alpha_s, beta_s], size, 20, have_met, |x| objective(x[0], x[1]));
        (alpha_s, beta_s) = (found[0], found[1]);
    }
    Envelope {
        alpha_s: alpha_s.clamp(least, largest),
        beta_s: beta_s.clamp(least, largest),
    }
}

/// Whether the corners lie closer together than a ten-thousandth of the first one's distance from zero.
fn have_met(vertices: &[Vertex]) -> bool {
    let first = &vertices[0].0;
    let apart = |vertex: &Vertex| vertex.0.iter().zip(first).map(|(x, f)| (x - f).abs()).sum::<f64>();
    let size: f64 = first.iter().map(|x| x.abs()).sum();
    vertices.iter().map(apart).fold(0.0, f64::max) < 1e-4 * size + 1e-12
}
