//! What of an error repeats with the drive, what of that is linear in it, and what the error goes with.

use crate::diagnosis::WhereItFails;
use crate::missing::locks::{Course, Courses, squares};
use crate::missing::regression::Gram;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Rows of a record behind the linear part.
const ROWS: usize = 4000;

/// Time constants of the filters that a linear part is made of, from two samples to a quarter of the longest record.
const FILTERS: usize = 10;

/// Answers for the errors of a model.
///
/// # Cost
/// Linear in the samples but for transforms of each record, n log n.
pub(crate) fn where_it_fails(courses: &Courses<'_>) -> WhereItFails {
    let moving: Vec<&Course<'_>> = courses.each.iter().filter(|c| c.moves()).collect();
    let periodic: Vec<bool> = moving.iter().map(|c| c.period.is_some()).collect();
    let periodic_records = periodic.iter().filter(|p| **p).count();
    let counts = |i: usize| periodic_records == 0 || periodic[i];
    let sum = |of: &dyn Fn(usize) -> f64| -> f64 {
        (0..moving.len())
            .filter(|&i| counts(i))
            .map(|i| moving[i].weight * of(i))
            .sum()
    };
    let all = sum(&|i| squares(moving[i].error_um)).max(f64::MIN_POSITIVE);
    let linear = linear(&moving);
    let linear_in_drive = sum(&|i| linear[i]) / all;
    let repeats = (periodic_records > 0).then(|| (sum(&|i| repeating(moving[i])) / all).clamp(0.0, 1.0));
    WhereItFails {
        periodic_records,
        repeats_with_drive: repeats,
        linear_in_drive: linear_in_drive.clamp(0.0, 1.0),
        nonlinear_in_drive: repeats.map(|repeats| (repeats - linear_in_drive).clamp(0.0, 1.0)),
        locked_to: courses.locks(),
    }
}

/// Squared error of a record that repeats with its drive; what stands before the drive repeats is spread as what follows is.
fn repeating(course: &Course<'_>) -> f64 {
    let Some(period) = course.period else { return 0.0 };
    let own = &course.error_um[period.from..];
    let left = squares(&course.unrepeated_um[period.from..]);
    // The mean of a few periods takes part of what does not repeat as well.
    let periods = own.len() as f64 / period.samples as f64;
    let random = left / (1.0 - 1.0 / periods);
    (squares(own) - random).max(0.0) * course.len() as f64 / own.len() as f64
}

/// Squared error of each record that one linear filter of the drive takes, the same for all of them.
fn linear(courses: &[&Course<'_>]) -> Vec<f64> {
    let shortest = courses.iter().map(|c| c.trace.period_s).fold(f64::INFINITY, f64::min);
    let longest = courses
        .iter()
        .map(|c| c.trace.period_s * c.len() as f64)
        .fold(0.0, f64::max);
    let (first, last) = (2.0 * shortest, (longest / 4.0).max(4.0 * shortest));
    let taus_s: Vec<f64> = (0..FILTERS)
        .map(|i| first * (last / first).powf(i as f64 / (FILTERS - 1) as f64))
        .collect();
    let grams: Vec<Gram> = courses
        .par_iter()
        .map(|c| {
            let every = c.len().div_ceil(ROWS).max(1);
            let target = DVector::from_iterator(c.len().div_ceil(every), c.error_um.iter().copied().step_by(every));
            Gram::new(&filtered(c, &taus_s, every, target.len()), &target)
        })
        .collect();
    let mut all = Gram::zeros(2 * FILTERS + 2);
    let weight = |c: &Course<'_>, gram: &Gram| c.weight * c.len() as f64 / gram.rows as f64;
    courses
        .iter()
        .zip(&grams)
        .for_each(|(c, gram)| all.add(gram, weight(c, gram)));
    let x = all.solve(0, 0.0, &[]);
    let of_rows = |c: &Course<'_>, gram: &Gram| {
        let nothing = DVector::zeros(x.len());
        (gram.squared_error(&nothing) - gram.squared_error(&x)) * c.len() as f64 / gram.rows as f64
    };
    courses.iter().zip(&grams).map(|(c, gram)| of_rows(c, gram)).collect()
}

/// A constant, the drive, and the drive behind one and behind two first-order lags of each time constant.
fn filtered(course: &Course<'_>, taus_s: &[f64], every: usize, rows: usize) -> DMatrix<f64> {
    let trace = course.trace;
    let mut columns = DMatrix::from_element(rows, 2 * taus_s.len() + 2, 1.0);
    let mut write = |column: usize, values: &mut dyn Iterator<Item = f64>| {
        for (row, value) in values.step_by(every).enumerate() {
            columns[(row, column)] = value;
        }
    };
    write(1, &mut trace.drive[trace.from..].iter().copied());
    for (i, tau_s) in taus_s.iter().enumerate() {
        let kept = (-trace.period_s / tau_s).exp();
        let lag = |values: &[f64]| -> Vec<f64> {
            let mut state = values.first().copied().unwrap_or(0.0);
            let step = |v: &f64| {
                state = kept * state + (1.0 - kept) * v;
                state
            };
            values.iter().map(step).collect()
        };
        let once = lag(&trace.drive);
        write(2 + 2 * i, &mut once[trace.from..].iter().copied());
        write(3 + 2 * i, &mut lag(&once)[trace.from..].iter().copied());
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::missing::made::{noise, traces};
    use hysteron_data::Record;

    fn of(error_um: impl Fn(usize, usize, &Record) -> f64) -> WhereItFails {
        let (traces, errors) = traces(|i, record| (0..record.len()).map(|k| error_um(i, k, record)).collect());
        where_it_fails(&Courses::new(&traces, errors.iter().map(Vec::as_slice)))
    }

    /// What a lag of 1 ms takes off a sine is linear and repeats, on all records at once.
    #[test]
    fn val_a_lag_is_linear() {
        let fails = of(|_, k, r| {
            let angle = std::f64::consts::TAU * k as f64 / 2000.0;
            let omega_tau = std::f64::consts::TAU / (2000.0 * r.period_s) * 1e-3;
            let half_um = 0.5 * r.position_um[1000];
            -half_um * (angle - omega_tau.atan()).cos() / omega_tau.hypot(1.0) + half_um * angle.cos()
        });
        assert_eq!(fails.periodic_records, 8);
        assert!(fails.repeats_with_drive.unwrap() > 0.99, "{fails:?}");
        assert!(fails.linear_in_drive > 0.97, "{fails:?}");
        assert!(fails.nonlinear_in_drive.unwrap() < 0.03, "{fails:?}");
    }

    /// The cube of a sine is one three times as fast and a sine of it: linear is what the drive has of it.
    #[test]
    fn val_a_static_bend_repeats_and_is_not_linear() {
        let fails = of(|_, k, r| {
            let x = r.voltage_v[k] / 50.0 - 1.0;
            0.1 * (4.0 * x.powi(3) - 3.0 * x)
        });
        assert!(fails.repeats_with_drive.unwrap() > 0.99, "{fails:?}");
        assert!(fails.nonlinear_in_drive.unwrap() > 0.5, "{fails:?}");
        assert_eq!(fails.locked_to[0].to, "position", "{fails:?}");
    }

    #[test]
    fn val_noise_does_not_repeat() {
        let (traces, errors) = traces(|i, record| {
            let mut noise = noise(i as u64);
            record.position_um.iter().map(|_| noise()).collect()
        });
        let fails = where_it_fails(&Courses::new(&traces, errors.iter().map(Vec::as_slice)));
        assert!(fails.repeats_with_drive.unwrap() < 0.03, "{fails:?}");
        assert!(fails.linear_in_drive < 0.03, "{fails:?}");
    }
}
