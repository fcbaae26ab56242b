//! Where a voltage turns, and how much later the position does.

use crate::report::Following;
use crate::{median, span};
use hysteron_data::Record;
use nalgebra::{DMatrix, DVector};

/// A turn counts when the voltage has come back by this share of its range.
const BACK: f64 = 0.05;

/// Samples at which a series turns, the ends left out.
pub(crate) fn turns(series: &[f64], back: f64) -> Vec<usize> {
    let mut found = Vec::new();
    let (mut high, mut low) = (0, 0);
    // 1 while it goes up, -1 while it goes down, 0 before the first turn is known.
    let mut direction = 0;
    for (k, &v) in series.iter().enumerate() {
        if v > series[high] {
            high = k;
        }
        if v < series[low] {
            low = k;
        }
        if direction >= 0 && series[high] - v > back {
            found.push(high);
            (direction, low) = (-1, k);
        } else if direction <= 0 && v - series[low] > back {
            found.push(low);
            (direction, high) = (1, k);
        }
        if direction == -1 && v < series[low] {
            low = k;
        }
        if direction == 1 && v > series[high] {
            high = k;
        }
    }
    // The first sample is where the record begins, not a turn.
    found.retain(|&k| k > 0);
    found
}

/// Turns of a record's voltage.
pub(crate) fn of_voltage(record: &Record) -> Vec<usize> {
    turns(&record.voltage_v, BACK * span(&record.voltage_v))
}

/// Points on either side of a turn that are looked at.
const POINTS: usize = 24;
/// Fewest samples between a turn and the next from which its instant is told.
const FEWEST: usize = 18;
/// Most turns of a record that are looked at.
const MOST: usize = 40;

/// How much later than the voltage the position of a record turns, and the time from turn to turn, seconds.
///
/// The position of a stage without any time scale turns where the voltage does, whatever its hysteresis: on either side of a
/// turn it is a function of the voltage. Both sides are fitted, the voltage shifted until they fit best.
pub(crate) fn following(record: &Record) -> Option<(Following, f64)> {
    let (v, y) = (&record.voltage_v, &record.position_um);
    let all = of_voltage(record);
    let ends: Vec<usize> = [0]
        .into_iter()
        .chain(all.iter().copied())
        .chain([v.len() - 1])
        .collect();
    let every = (all.len() / MOST).max(1);
    // Tops and bottoms apart: a drift moves them in opposite directions.
    let (mut tops, mut bottoms) = (Vec::new(), Vec::new());
    let mut apart = Vec::new();
    for around in ends.windows(3).step_by(every) {
        let reach = (around[1] - around[0]).min(around[2] - around[1]);
        if reach < FEWEST {
            continue;
        }
        let half = reach / 3;
        let stride = (half / POINTS).max(1);
        let Some(lag) = instant(v, y, around[1], half / stride, stride) else {
            continue;
        };
        apart.push((around[2] - around[0]) as f64 * 0.5 * record.period_s);
        let top = v[around[1]] > v[around[0]];
        if top { &mut tops } else { &mut bottoms }.push(lag * stride as f64 * record.period_s);
    }
    let turns = tops.len() + bottoms.len();
    if tops.len() < 2 || bottoms.len() < 2 || turns < 5 {
        return None;
    }
    let (top, bottom) = (median(&mut tops), median(&mut bottoms));
    let scatter = |values: &[f64], middle: f64| {
        let mut apart: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
        1.4826 * 1.2533 * median(&mut apart) / (values.len() as f64).sqrt()
    };
    let following = Following {
        seconds: 0.5 * (top + bottom),
        uncertainty_s: 0.5 * scatter(&tops, top).hypot(scatter(&bottoms, bottom)),
        turns,
    };
    Some((following, median(&mut apart)))
}

/// The shift, in strides, at which position and voltage fit best about a turn.
fn instant(v: &[f64], y: &[f64], turn: usize, points: usize, stride: usize) -> Option<f64> {
    let points = points as isize;
    let farthest = (points / 2).clamp(2, 8);
    let mean = |series: &[f64], at: isize| -> Option<f64> {
        let from = turn as isize + at * stride as isize - (stride / 2) as isize;
        let part = series.get(usize::try_from(from).ok()?..usize::try_from(from).ok()? + stride)?;
        Some(part.iter().sum::<f64>() / stride as f64)
    };
    let drive: Vec<f64> = (-points - farthest - 2..=points + farthest + 2)
        .map(|k| mean(v, k))
        .collect::<Option<_>>()?;
    let answer: Vec<f64> = (-points..=points).map(|k| mean(y, k)).collect::<Option<_>>()?;
    // A voltage that rests at its turn has no instant.
    let middle = drive.len() / 2;
    let reach = (drive[middle] - drive[middle + points as usize]).abs();
    let rests = (1..=points as usize)
        .filter(|&k| (drive[middle] - drive[middle + k]).abs() < 1e-4 * reach)
        .count();
    if reach <= 0.0 || rests > 2 {
        return None;
    }
    let misfit = |shift: f64| misfit(&drive, &answer, shift);
    let grid = 8 * farthest;
    let shift = |k: isize| k as f64 / 8.0;
    let best = (-grid..=grid).min_by(|&a, &b| misfit(shift(a)).total_cmp(&misfit(shift(b))))?;
    if best.abs() == grid {
        return None;
    }
    // The minimum between three neighbours of the grid.
    let [before, here, after] = [best - 1, best, best + 1].map(|k| misfit(shift(k)));
    let bend = before - 2.0 * here + after;
    (bend > 0.0).then(|| shift(best) + 0.125 * 0.5 * (before - after) / bend)
}

/// What a parabola of the shifted voltage on either side of a turn, meeting there, leaves of the position.
fn misfit(drive: &[f64], answer: &[f64], shift: f64) -> f64 {
    let points = answer.len() / 2;
    let middle = drive.len() / 2;
    let (instant, extreme) = extremum(drive, middle);
    let mut columns = DMatrix::zeros(answer.len(), 5);
    for k in 0..answer.len() {
        let at = (middle + k) as f64 - points as f64 - shift;
        let u = between(drive, at) - extreme;
        columns[(k, 0)] = 1.0;
        let side = if at < instant { 1 } else { 3 };
        columns[(k, side)] = u;
        columns[(k, side + 1)] = u * u;
    }
    for mut column in columns.column_iter_mut().skip(1) {
        let size = column.amax();
        if size > 0.0 {
            column /= size;
        }
    }
    let y = DVector::from_column_slice(answer);
    let mean = y.mean();
    let y = y.add_scalar(-mean);
    let gram = columns.tr_mul(&columns) + DMatrix::identity(5, 5) * 1e-9;
    match gram.cholesky() {
        Some(factor) => (&y - &columns * factor.solve(&columns.tr_mul(&y))).norm_squared(),
        None => f64::INFINITY,
    }
}

/// Instant and value of an extremum, by a parabola through three points.
fn extremum(series: &[f64], at: usize) -> (f64, f64) {
    let (before, here, after) = (series[at - 1], series[at], series[at + 1]);
    let bend = before - 2.0 * here + after;
    if bend == 0.0 {
        return (at as f64, here);
    }
    let off = (0.5 * (before - after) / bend).clamp(-0.5, 0.5);
    (at as f64 + off, here - 0.25 * (before - after) * off)
}

/// A series between its samples, by a cubic through four of them.
pub(crate) fn between(series: &[f64], at: f64) -> f64 {
    let last = series.len() as isize - 1;
    let k = at.floor();
    let s = at - k;
    let value = |k: isize| series[k.clamp(0, last) as usize];
    let [a, b, c, d] = [-1, 0, 1, 2].map(|j| value(k as isize + j));
    let (third, second) = (0.5 * (3.0 * (b - c) + d - a), 0.5 * (2.0 * a - 5.0 * b + 4.0 * c - d));
    ((third * s + second) * s + 0.5 * (c - a)) * s + b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_turns_of_a_triangle() {
        let triangle: Vec<f64> = (0..100).map(|k| f64::from((k % 20 - 10i32).abs())).collect();
        assert_eq!(turns(&triangle, 0.5), [10, 20, 30, 40, 50, 60, 70, 80, 90]);
        assert!(turns(&(0..50).map(f64::from).collect::<Vec<_>>(), 1.0).is_empty());
        assert!(turns(&[1.0; 50], 0.0).is_empty());
    }
}
