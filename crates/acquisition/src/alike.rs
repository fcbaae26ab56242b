//! Records with the same drive: what differs between them is the rig's, or drifts.

use crate::plain::{figure, names};
use crate::report::{Channel, Figure, Finding, Kind, Quantity, Unit};
use crate::{median, span};
use hysteron_data::Record;
use nalgebra::{Matrix3, Vector3};

/// Difference of two drives, rms over range, up to which they are the same.
const SAME: f64 = 3e-3;
/// Fewest records of one drive that tell one from the others.
const FEWEST: usize = 3;
/// Standard errors beyond which a difference is one.
const CLEAR: f64 = 6.0;
/// Differences that matter, as shares of the stroke (offset, time) and of the gain.
const MATTERS: f64 = 5e-4;
/// Gains of one stage differ by less between like records.
const GAIN: f64 = 5e-3;

/// By how much a record differs from the mean of those with the same drive, with standard errors.
#[derive(Debug, Clone, Copy)]
struct Difference {
    offset_um: [f64; 2],
    gain: [f64; 2],
    seconds: [f64; 2],
}

/// Gains, offsets and starting instants of like records.
pub(crate) fn between_like_records(records: &[Record]) -> Vec<Finding> {
    let mut left: Vec<&Record> = records.iter().filter(|record| span(&record.voltage_v) > 0.0).collect();
    let mut found = Vec::new();
    while let Some(&first) = left.first() {
        let (same, other): (Vec<&Record>, Vec<&Record>) = left.iter().partition(|record| is_same_drive(first, record));
        left = other;
        if same.len() >= FEWEST {
            found.extend(of_group(&same));
        }
    }
    found
}

fn is_same_drive(a: &Record, b: &Record) -> bool {
    let squares: f64 = a.voltage_v.iter().zip(&b.voltage_v).map(|(a, b)| (a - b).powi(2)).sum();
    let rms = (squares / a.len().max(1) as f64).sqrt();
    a.len() == b.len() && (a.period_s / b.period_s - 1.0).abs() < 1e-6 && rms < SAME * span(&a.voltage_v)
}

fn of_group(same: &[&Record]) -> Vec<Finding> {
    let each: Vec<Difference> = (0..same.len()).filter_map(|i| difference(same, i)).collect();
    if each.len() != same.len() {
        return Vec::new();
    }
    let stroke = span(&same[0].position_um);
    let speed = rms_speed(same[0]);
    let mut found = Vec::new();
    let mut tell = |kind, unit, of: fn(&Difference) -> [f64; 2], least: f64, random: bool| {
        let values: Vec<[f64; 2]> = each.iter().map(of).collect();
        let middle = median(&mut values.iter().map(|v| v[0]).collect::<Vec<_>>());
        let odd = |v: &[f64; 2]| (v[0] - middle).abs() > CLEAR * v[1] && (v[0] - middle).abs() > least;
        let seen: Vec<&Record> = same
            .iter()
            .zip(&values)
            .filter(|(_, v)| odd(v))
            .map(|(r, _)| *r)
            .collect();
        let ordered = !random || goes_one_way(&values);
        if seen.is_empty() || (random && ordered) {
            return;
        }
        let farthest = values
            .iter()
            .max_by(|a, b| (a[0] - middle).abs().total_cmp(&(b[0] - middle).abs()));
        if let Some(farthest) = farthest {
            found.push(Finding {
                kind,
                channel: Some(Channel::Position),
                records: names(seen),
                figure: Figure {
                    uncertainty: Some(farthest[1]),
                    ..figure(farthest[0] - middle, unit, quantity(kind))
                },
            });
        }
    };
    tell(
        Kind::TriggerJitter,
        Unit::Second,
        |d| d.seconds,
        MATTERS * stroke / speed,
        false,
    );
    tell(
        Kind::GainByRecord,
        Unit::Percent,
        |d| d.gain.map(|g| 100.0 * g),
        100.0 * GAIN,
        false,
    );
    tell(
        Kind::OffsetByRecord,
        Unit::Micrometre,
        |d| d.offset_um,
        4.0 * MATTERS * stroke,
        true,
    );
    found
}

fn quantity(kind: Kind) -> Quantity {
    if kind == Kind::TriggerJitter {
        Quantity::Spread
    } else {
        Quantity::Difference
    }
}

/// A drift goes one way: its steps are small against its range (von Neumann's ratio is 2 without any order).
fn goes_one_way(values: &[[f64; 2]]) -> bool {
    let n = values.len() as f64;
    let mean = values.iter().map(|v| v[0]).sum::<f64>() / n;
    let all: f64 = values.iter().map(|v| (v[0] - mean).powi(2)).sum();
    let steps: f64 = values.windows(2).map(|v| (v[1][0] - v[0][0]).powi(2)).sum();
    values.len() < 5 || steps < 1.2 * all
}

fn rms_speed(record: &Record) -> f64 {
    let y = &record.position_um;
    // Over twenty samples, so that noise counts little.
    let wide = (y.len() / 50).clamp(1, 10);
    let squares: f64 = y
        .windows(2 * wide + 1)
        .map(|w| ((w[2 * wide] - w[0]) / (2 * wide) as f64).powi(2))
        .sum();
    (squares / y.len() as f64).sqrt() / record.period_s
}

/// Record `i` against the mean of the others, over the later half: the start is another matter.
fn difference(same: &[&Record], i: usize) -> Option<Difference> {
    let n = same[0].len();
    let from = n / 2;
    let others = (same.len() - 1) as f64;
    let mean: Vec<f64> = (from..n)
        .map(|k| {
            same.iter()
                .enumerate()
                .filter(|(j, _)| *j != i)
                .map(|(_, r)| r.position_um[k])
                .sum::<f64>()
                / others
        })
        .collect();
    let own = &same[i].position_um[from..];
    let wide = (mean.len() / 200).clamp(1, 10);
    let rows: Vec<usize> = (wide..mean.len().checked_sub(wide)?).collect();
    if rows.len() < 30 {
        return None;
    }
    let middle = mean.iter().sum::<f64>() / mean.len() as f64;
    let columns = |k: usize| {
        Vector3::new(
            1.0,
            mean[k] - middle,
            -(mean[k + wide] - mean[k - wide]) / (2 * wide) as f64,
        )
    };
    let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for &k in &rows {
        let row = columns(k);
        gram += row * row.transpose();
        right += row * (own[k] - mean[k]);
    }
    let inverse = gram.try_inverse()?;
    let solution = inverse * right;
    let left: Vec<f64> = rows
        .iter()
        .map(|&k| own[k] - mean[k] - columns(k).dot(&solution))
        .collect();
    let squares: f64 = left.iter().map(|e| e * e).sum();
    // What is left is often slow: fewer samples count then.
    let alike = left.windows(2).map(|e| e[0] * e[1]).sum::<f64>() / squares.max(f64::MIN_POSITIVE);
    let fewer = ((1.0 + alike) / (1.0 - alike).max(0.02)).max(1.0);
    let variance = squares / rows.len() as f64 * fewer;
    let with_error = |j: usize| [solution[j], (variance * inverse[(j, j)]).sqrt()];
    let period_s = same[0].period_s;
    Some(Difference {
        offset_um: with_error(0),
        gain: with_error(1),
        seconds: with_error(2).map(|samples| samples * period_s),
    })
}
