//! A line in the error at one frequency, whatever the drive does: a vibration.

use crate::diagnosis::{Lock, LockTo, parameter};
use crate::spectrum::periodogram;
use crate::witness::locks::{Course, Courses, squares};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Samples of a record that are looked at.
const LOOKED_AT: usize = 1 << 15;

/// Peaks of each record's spectrum that are tried on the others.
const PEAKS: usize = 3;

/// A line has so many periods in a record that shows it.
const FEWEST_PERIODS: f64 = 4.0;

/// Highest frequency in a record that shows it, of its sampling rate.
const HIGHEST: f64 = 0.45;

/// The line that takes most of all records' squared error, if most of those that can show it do.
pub(crate) fn lock(courses: &Courses<'_>) -> Option<Lock> {
    let peaks: Vec<(f64, f64)> = courses.each.par_iter().flat_map_iter(peaks).collect();
    let all = |f: f64| -> f64 { courses.each.iter().map(|c| c.weight * of_line(c, f)).sum() };
    let best = |tried: &[(f64, f64)]| {
        let each: Vec<(f64, (f64, f64))> = tried.par_iter().map(|&(f, width)| (all(f), (f, width))).collect();
        each.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let (_, (peak_hz, width_hz)) = best(&peaks)?;
    // A longer record tells the frequency more closely than the one whose spectrum had the peak.
    let fine: Vec<(f64, f64)> = (-20..=20)
        .map(|i| (peak_hz + width_hz * f64::from(i) / 20.0, width_hz))
        .collect();
    let (taken, (frequency_hz, _)) = best(&fine)?;
    let (mut seen, mut of) = (0, 0);
    for course in &courses.each {
        let length_s = course.len() as f64 * course.trace.period_s;
        if frequency_hz * course.trace.period_s < HIGHEST && frequency_hz * length_s > FEWEST_PERIODS {
            of += 1;
            seen += usize::from(of_line(course, frequency_hz) > 0.1 * squares(looked_at(course)));
        }
    }
    (of > 2 && 3 * seen > 2 * of).then(|| Lock {
        parameters: vec![parameter("frequency", frequency_hz, "Hz")],
        ..Lock::new(LockTo::Time, taken)
    })
}

fn looked_at<'a>(course: &Course<'a>) -> &'a [f64] {
    &course.error_um[..course.len().min(LOOKED_AT)]
}

/// The highest peaks of a record's error, and the width of a bin, hertz.
fn peaks(course: &Course<'_>) -> Vec<(f64, f64)> {
    let own = looked_at(course);
    let powers = periodogram(own);
    let bin_hz = 1.0 / (own.len() as f64 * course.trace.period_s);
    let mut peaks: Vec<usize> = (FEWEST_PERIODS as usize..powers.len().saturating_sub(1))
        .filter(|&k| powers[k] > powers[k - 1] && powers[k] >= powers[k + 1])
        .filter(|&k| (k as f64) < HIGHEST * own.len() as f64)
        .collect();
    peaks.sort_by(|&a, &b| powers[b].total_cmp(&powers[a]));
    peaks.truncate(PEAKS);
    let between = |k: usize| {
        // Within a bin, by the amplitudes beside the peak.
        let (left, right) = (powers[k - 1].sqrt(), powers[k + 1].sqrt());
        let aside = if right > left { right } else { -left };
        k as f64 + aside / (powers[k].sqrt() + aside.abs()).max(f64::MIN_POSITIVE)
    };
    peaks.into_iter().map(|k| (bin_hz * between(k), 0.5 * bin_hz)).collect()
}

/// Squares that a sine takes from a record, in a slower one at the frequency to which it folds.
fn of_line(course: &Course<'_>, frequency_hz: f64) -> f64 {
    let own = looked_at(course);
    let mean = own.iter().sum::<f64>() / own.len() as f64;
    let (turn_sin, turn_cos) = (TAU * frequency_hz * course.trace.period_s).sin_cos();
    let (mut cos, mut sin) = (1.0, 0.0);
    let (mut with_cos, mut with_sin, mut cc, mut ss, mut cs) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for e in own {
        let e = e - mean;
        with_cos += e * cos;
        with_sin += e * sin;
        cc += cos * cos;
        ss += sin * sin;
        cs += cos * sin;
        (cos, sin) = (cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin);
    }
    let determinant = cc * ss - cs * cs;
    if determinant <= 1e-6 * cc * ss {
        return 0.0;
    }
    (with_cos * with_cos * ss - 2.0 * with_cos * with_sin * cs + with_sin * with_sin * cc) / determinant
}
