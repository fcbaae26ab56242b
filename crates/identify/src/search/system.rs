//! Normal equations around a point, solved within physical bounds.

use super::expected::Held;
use crate::effects::Bounds;
use crate::normal::Normal;
use nalgebra::{DMatrix, DVector};

/// A hundred times the rounding of sums over 20 000 rows: keeps empty and twin columns harmless.
const LEAST_RIDGE: f64 = 1e-12;

/// Linear coefficients and changes of parameters that solve the damped normal equations within the bounds; `values` are the
/// parameters as they stand. The constant is not held: an offset must change nothing.
pub(super) fn within_bounds(
    system: &Normal,
    linear: usize,
    held: Held<'_>,
    damping: f64,
    parameters: &[(Bounds, f64)],
) -> Option<Vec<f64>> {
    let mut fixed: Vec<Option<f64>> = parameters.iter().map(|(b, _)| (!b.fitted).then_some(0.0)).collect();
    let system = held.onto(system);
    // Parameters that would leave their bounds are put on them, and the others solved again.
    for _ in 0..=parameters.len() {
        let solution = solve(&system, linear, held.ridge(), damping, &fixed)?;
        let mut inside = true;
        for (j, (b, value)) in parameters.iter().enumerate() {
            let to = value + solution[linear + j];
            if fixed[j].is_none() && !(b.min..=b.max).contains(&to) {
                fixed[j] = Some(to.clamp(b.min, b.max) - value);
                inside = false;
            }
        }
        if inside {
            return Some(solution);
        }
    }
    None
}

/// Damped normal equations in scaled columns; `fixed` parameters move by what they are given.
fn solve(system: &Normal, linear: usize, ridge: f64, damping: f64, fixed: &[Option<f64>]) -> Option<Vec<f64>> {
    let matrix = system.matrix();
    let n = matrix.nrows();
    let mut rhs = DVector::from_column_slice(system.right_side());
    let mut free: Vec<usize> = (0..linear).filter(|&j| matrix[(j, j)] > 0.0).collect();
    for (j, fixed) in fixed.iter().enumerate() {
        let column = linear + j;
        match fixed {
            Some(change) => rhs.axpy(-change, &matrix.column(column), 1.0),
            // A parameter without any effect here stays.
            None if matrix[(column, column)] > 0.0 => free.push(column),
            None => {}
        }
    }
    let m = free.len();
    let scale: Vec<f64> = free.iter().map(|&i| matrix[(i, i)].sqrt()).collect();
    let mut scaled = DMatrix::from_fn(m, m, |a, b| matrix[(free[a], free[b])] / (scale[a] * scale[b]));
    for (a, &i) in free.iter().enumerate() {
        scaled[(a, a)] += match i {
            0 => LEAST_RIDGE,
            i if i < linear => ridge.max(LEAST_RIDGE),
            _ => damping.max(LEAST_RIDGE),
        };
    }
    let solution = scaled
        .cholesky()?
        .solve(&DVector::from_fn(m, |a, _| rhs[free[a]] / scale[a]));
    let mut full = vec![0.0; n];
    for (a, &i) in free.iter().enumerate() {
        full[i] = solution[a] / scale[a];
    }
    for (j, change) in fixed.iter().enumerate() {
        full[linear + j] = change.unwrap_or(full[linear + j]);
    }
    full.iter().all(|x| x.is_finite()).then_some(full)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds(min: f64, max: f64) -> Bounds {
        Bounds::new(min, max, 1.0, 0.0)
    }

    /// y = 1 + 2 x + 0.7 p: the parameter within its bounds, on one of them, and held.
    #[test]
    fn val_a_parameter_stays_within_its_bounds() {
        let mut system = Normal::new(3);
        for k in 0..60 {
            let (x, p) = (f64::from(k % 7), f64::from(k % 5));
            system.add_row(&[1.0, x, p], 1.0 + 2.0 * x + 0.7 * p);
        }
        let at = |b: Bounds| {
            within_bounds(
                &system,
                2,
                Held {
                    expected: None,
                    by: 0.0,
                },
                0.0,
                &[(b, 0.0)],
            )
            .unwrap()
        };
        let free = at(bounds(-1.0, 1.0));
        assert!((free[2] - 0.7).abs() < 1e-9 && (free[1] - 2.0).abs() < 1e-9, "{free:?}");
        assert!((at(bounds(-1.0, 0.5))[2] - 0.5).abs() < 1e-12);
        let held = at(Bounds {
            fitted: false,
            ..bounds(-1.0, 1.0)
        });
        assert!(held[2] == 0.0, "{held:?}");
    }
}
