//! What of an error repeats with the drive, what of that is linear in it, and what the error goes with.

use crate::diagnosis::WhereItFails;
use crate::witness::filters::Linear;
use crate::witness::locks::{Course, Courses, squares};
use crate::witness::regression::Gram;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Rows of a record behind the linear part.
const ROWS: usize = 4000;

/// Time constants of the filters that a linear part is made of, from two samples to a quarter of the longest record.
const FILTERS: usize = 10;

/// Frequencies at which a mode is looked for, up to this share of the highest sampling rate.
const FREQUENCIES: usize = 60;
const HIGHEST: f64 = 0.45;

/// Of the columns' squares: a record that has a rate of its own is foretold with filters that others determine.
const RIDGE: f64 = 1e-6;

/// Damping ratios of a mode, the first one tried at every frequency.
const DAMPINGS: [f64; 5] = [0.03, 0.005, 0.01, 0.02, 0.06];

/// Answers for the errors of a model.
///
/// # Cost
/// Linear in the samples but for transforms of each record, n log n.
pub(crate) fn where_it_fails(courses: &Courses<'_>) -> WhereItFails {
    let moving: Vec<&Course<'_>> = courses.each.iter().filter(|c| c.moves()).collect();
    let periodic: Vec<bool> = moving.iter().map(|c| c.period.is_some()).collect();
    let periodic_records = periodic.iter().filter(|p| **p).count();
    let sum = |of: &dyn Fn(usize) -> f64, counts: &dyn Fn(usize) -> bool| -> f64 {
        let each = (0..moving.len()).filter(|&i| counts(i));
        each.map(|i| moving[i].weight * of(i)).sum()
    };
    let linear = linear(&moving);
    let share = |of: &dyn Fn(usize) -> f64, counts: &dyn Fn(usize) -> bool| {
        let all = sum(&|i| squares(moving[i].error_um), counts).max(f64::MIN_POSITIVE);
        (sum(of, counts) / all).clamp(0.0, 1.0)
    };
    let repeats = |of: &dyn Fn(usize) -> f64| (periodic_records > 0).then(|| share(of, &|i| periodic[i]));
    WhereItFails {
        linear_in_drive: share(&|i| linear[i], &|_| true),
        periodic_records,
        repeats_with_drive: repeats(&|i| repeating(moving[i])),
        nonlinear_in_drive: repeats(&|i| repeating(moving[i]) - linear[i]),
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

/// What the linear part of a record's error is fitted to.
struct Rows<'a> {
    course: &'a Course<'a>,
    /// Samples from one row to the next.
    every: usize,
    /// A constant, the drive, and the drive behind one and behind two first-order lags of each time constant.
    columns: DMatrix<f64>,
    error_um: DVector<f64>,
    gram: Gram,
}

impl<'a> Rows<'a> {
    fn new(course: &'a Course<'a>, taus_s: &[f64]) -> Self {
        let every = course.len().div_ceil(ROWS).max(1);
        let error_um: Vec<f64> = course.error_um.iter().copied().step_by(every).collect();
        let mut rows = Self {
            course,
            every,
            columns: DMatrix::from_element(error_um.len(), 2 * taus_s.len() + 2, 1.0),
            error_um: DVector::from_vec(error_um),
            gram: Gram::zeros(0),
        };
        let mut drive: Vec<[f64; 1]> = course.trace.drive.iter().map(|&v| [v]).collect();
        let columns = &mut rows.columns;
        let from = course.trace.from;
        let mut write = |column: usize, series: &[[f64; 1]]| {
            let own = series[from..].iter().step_by(every);
            columns
                .column_mut(column)
                .iter_mut()
                .zip(own)
                .for_each(|(c, s)| *c = s[0]);
        };
        write(1, &drive);
        let commanded = drive.clone();
        for (i, &tau_s) in taus_s.iter().enumerate() {
            let lag = Linear::lag(tau_s, course.trace.period_s);
            drive.copy_from_slice(&commanded);
            for column in [2 + 2 * i, 3 + 2 * i] {
                lag.apply(&mut drive);
                write(column, &drive);
            }
        }
        rows.gram = Gram::new(&rows.columns, &rows.error_um);
        rows
    }

    /// With the way and the speed of a mode that the drive pushes.
    fn with_mode(&self, frequency_hz: f64, zeta: f64) -> Gram {
        let trace = self.course.trace;
        let mut mode: Vec<[f64; 1]> = trace.drive.iter().map(|&v| [v]).collect();
        Linear::mode(frequency_hz, zeta, trace.period_s).apply(&mut mode);
        let at = |row: usize| trace.from + row * self.every;
        let more = DMatrix::from_fn(self.error_um.len(), 2, |row, column| match column {
            0 => mode[at(row)][0] - trace.drive[at(row)],
            _ => mode[at(row)][0] - mode[at(row).saturating_sub(1)][0],
        });
        self.gram.with(&self.columns, &more, &self.error_um)
    }

    fn weight(&self) -> f64 {
        self.course.weight * self.course.len() as f64 / self.gram.rows as f64
    }
}

/// Squared error of each record that a linear filter of the drive takes, fitted to the other records: lags, and the mode that takes most.
fn linear(courses: &[&Course<'_>]) -> Vec<f64> {
    let shortest_s = courses.iter().map(|c| c.trace.period_s).fold(f64::INFINITY, f64::min);
    let lengths_s = courses.iter().map(|c| c.trace.period_s * c.len() as f64);
    let longest_s = lengths_s.fold(0.0, f64::max);
    let spaced = |first: f64, last: f64, count: usize| -> Vec<f64> {
        let step = |i: usize| i as f64 / (count - 1) as f64;
        (0..count).map(|i| first * (last / first).powf(step(i))).collect()
    };
    let last_s = (longest_s / 4.0).max(4.0 * shortest_s);
    let taus_s = spaced(2.0 * shortest_s, last_s, FILTERS);
    let rows: Vec<Rows<'_>> = courses.par_iter().map(|&c| Rows::new(c, &taus_s)).collect();
    let solve = |all: &Gram| all.solve(2 * FILTERS + 4, RIDGE, &[]);
    let fit = |(frequency_hz, zeta): (f64, f64)| {
        let grams: Vec<Gram> = rows.iter().map(|r| r.with_mode(frequency_hz, zeta)).collect();
        let mut all = Gram::zeros(2 * FILTERS + 4);
        let pairs = rows.iter().zip(&grams);
        pairs.for_each(|(r, gram)| all.add(gram, r.weight()));
        let error = all.squared_error(&solve(&all));
        (error, grams, all)
    };
    let best = |tried: Vec<(f64, f64)>| {
        let errors = tried.into_par_iter().map(|mode| (fit(mode).0, mode));
        errors
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or((1.0, 0.0), |(_, mode)| mode)
    };
    let highest_hz = HIGHEST / shortest_s;
    let frequencies_hz = spaced((10.0 / longest_s).min(0.01 * highest_hz), highest_hz, FREQUENCIES);
    let apart = (frequencies_hz[1] / frequencies_hz[0]).ln();
    let mut mode = best(frequencies_hz.into_iter().map(|f| (f, DAMPINGS[0])).collect());
    for part in [0.1, 0.02] {
        let near = (-10..=10).map(|i| mode.0 * (f64::from(i) * part * apart).exp());
        mode = best(near.map(|f| (f, mode.1)).collect());
        mode = best(DAMPINGS.map(|zeta| (mode.0, zeta)).to_vec());
    }
    let (_, grams, all) = fit(mode);
    let of_rows = |(r, gram): (&Rows<'_>, &Gram)| {
        // What is only fitted, as a mode that rings along with one record's harmonics, the other records do not foretell.
        let mut others = all.clone();
        others.add(gram, -r.weight());
        let x = solve(&others);
        let taken = gram.squared_error(&DVector::zeros(x.len())) - gram.squared_error(&x);
        taken.max(0.0) * r.course.len() as f64 / gram.rows as f64
    };
    rows.iter().zip(&grams).map(of_rows).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::witness::made::{noise, traces};
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

    /// A bend that makes three times the frequency of a sine over the whole range and nothing at its own: no filter makes that.
    #[test]
    fn val_a_static_bend_repeats_and_is_not_linear() {
        let bend = |k: usize, r: &Record| {
            let x = r.voltage_v[k] / 50.0 - 1.0;
            0.1 * (4.0 * x.powi(3) - 3.0 * x)
        };
        let fails = of(|_, k, r| if r.voltage_v[1000] > 99.0 { bend(k, r) } else { 0.0 });
        assert!(fails.repeats_with_drive.unwrap() > 0.99, "{fails:?}");
        assert!(fails.nonlinear_in_drive.unwrap() > 0.97, "{fails:?}");
        assert!(fails.linear_in_drive < 0.03, "{fails:?}");
        // In small sines it is a gain and a zero, which filters may have where each rate has its own amplitude.
        let fails = of(|_, k, r| bend(k, r));
        assert_eq!(fails.locked_to[0].to, crate::diagnosis::LockTo::Position, "{fails:?}");
    }

    /// Records without a repeating drive: what a mode adds to a drive of many frequencies is linear as well.
    #[test]
    fn val_a_mode_is_linear() {
        let (mut traces, _) = traces(|_, record| vec![0.0; record.len()]);
        let errors: Vec<Vec<f64>> = (traces.each.iter_mut().zip(0..))
            .map(|(trace, seed)| {
                let mut noise = noise(seed);
                let mut slow = 0.0;
                trace.drive.iter_mut().for_each(|v| {
                    slow += 0.3 * (noise() - slow);
                    *v = slow;
                });
                let mut mode: Vec<[f64; 1]> = trace.drive.iter().map(|&v| [v]).collect();
                Linear::mode(37.0, 0.014, trace.period_s).apply(&mut mode);
                mode.iter().zip(&trace.drive).map(|(m, v)| m[0] - v).collect()
            })
            .collect();
        let fails = where_it_fails(&Courses::new(&traces, errors.iter().map(Vec::as_slice)));
        assert_eq!((fails.periodic_records, fails.nonlinear_in_drive), (0, None));
        assert!(fails.linear_in_drive > 0.9, "{fails:?}");
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
