//! Readings that stand still: at the end of a converter's range, at a stop, anywhere; readings that are repeated.

use crate::plain::{figure, line, names};
use crate::report::{Channel, Finding, Kind, Quantity, Unit};
use crate::resolution::code_width;
use crate::span;
use crate::turns::of_voltage;
use hysteron_data::Record;
use std::ops::Range;

/// Share of the voltage's range over which a clipped reading stands still while the voltage goes on outward.
const CLIPPED_V: f64 = 0.02;
/// Share of it over which a sensor stands still anywhere.
const STUCK_V: f64 = 0.3;
/// Motion that is expected meanwhile, in steps and in noise.
const EXPECTED: f64 = 8.0;
/// Fewest samples that stand still.
const FEWEST: usize = 4;

/// Runs of equal readings, of at least [`FEWEST`].
fn runs(values: &[f64]) -> impl Iterator<Item = Range<usize>> {
    let mut start = 0;
    (1..=values.len()).filter_map(move |k| {
        if k < values.len() && values[k] == values[start] {
            return None;
        }
        let run = start..k;
        start = k;
        (run.len() >= FEWEST).then_some(run)
    })
}

/// Positions at which the readings of some record are clipped, micrometres: a reading that is one of them says nothing of the stage.
///
/// # Cost
/// A few passes over each record.
pub fn clipped_at(records: &[Record]) -> Vec<f64> {
    let mut ends: Vec<f64> = records
        .iter()
        .flat_map(|record| clipped(record).into_iter().map(|run| record.position_um[run.start]))
        .collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup();
    ends
}

/// Samples of a record at which the reading stands at the end of its range while the voltage goes on outward. Noise above a step never
/// stands still, so that it needs no say.
fn clipped(record: &Record) -> Vec<Range<usize>> {
    let (v, y) = (&record.voltage_v, &record.position_um);
    let Some(line) = line(record) else { return Vec::new() };
    let (low, high) = crate::range(y);
    let step = code_width(y);
    let least_v = (CLIPPED_V * span(v)).max(EXPECTED * step / line.slope.abs());
    runs(y)
        .filter(|run| {
            let outward = match y[run.start] {
                end if end == high => line.slope.signum(),
                end if end == low => -line.slope.signum(),
                _ => return false,
            };
            let first = v[run.start];
            let farthest = v[run.clone()].iter().map(|v| outward * (v - first)).fold(0.0, f64::max);
            farthest > least_v
        })
        .collect()
}

/// Samples at which readings stand still anywhere while the voltage moves far.
fn stuck(record: &Record) -> Vec<Range<usize>> {
    let (v, y) = (&record.voltage_v, &record.position_um);
    let least_v = STUCK_V * span(v);
    let clipped = clipped(record);
    runs(y)
        .filter(|run| span(&v[run.clone()]) > least_v && least_v > 0.0)
        .filter(|run| !clipped.contains(run))
        .collect()
}

/// The share of its branch over which the position stands still before the voltage's end, where it does.
///
/// Hysteresis steepens towards the end of a branch, saturation flattens it slowly; a stop leaves no slope at all.
fn flat_top(record: &Record, top: bool, extreme_um: f64, stroke_um: f64, noise_um: f64) -> Option<f64> {
    let (v, y) = (&record.voltage_v, &record.position_um);
    let line = line(record)?;
    if line.correlation.abs() < 0.95 {
        return None;
    }
    let outward = if top { line.slope.signum() } else { -line.slope.signum() };
    let ends: Vec<usize> = [0].into_iter().chain(of_voltage(record)).chain([v.len() - 1]).collect();
    let half_v = 0.5 * span(v);
    let branch = ends
        .windows(2)
        .filter(|pair| outward * (v[pair[1]] - v[pair[0]]) > half_v)
        .max_by(|a, b| (outward * v[a[1]]).total_cmp(&(outward * v[b[1]])))?;
    let (from, to) = (branch[0], branch[1]);
    if (y[to] - extreme_um).abs() > 0.01 * stroke_um {
        return None;
    }
    let whole_v = (v[to] - v[from]).abs();
    let slope = |share: f64| -> Option<(f64, f64)> {
        let rows: Vec<(f64, f64)> = (from..=to)
            .filter(|&k| (v[to] - v[k]).abs() <= share * whole_v)
            .map(|k| (v[k], y[k]))
            .collect();
        let n = rows.len() as f64;
        let (mv, my) = rows.iter().fold((0.0, 0.0), |(a, b), r| (a + r.0 / n, b + r.1 / n));
        let (vv, vy) = rows.iter().fold((0.0, 0.0), |(a, b), r| {
            (a + (r.0 - mv).powi(2), b + (r.0 - mv) * (r.1 - my))
        });
        (rows.len() >= 8 && vv > 0.0).then(|| (vy / vv, noise_um / vv.sqrt()))
    };
    [0.5, 0.4, 0.3, 0.2, 0.14, 0.1, 0.07, 0.05]
        .into_iter()
        .find_map(|share| {
            let (here, error) = slope(share)?;
            let flat = here.abs() + 3.0 * error < 0.06 * line.slope.abs();
            // The motion that is missing must be far above noise and steps.
            let missing = share * whole_v * line.slope.abs();
            (flat && missing > EXPECTED * noise_um.max(code_width(y))).then_some(share)
        })
}

/// Clipped readings, stops, a sensor that stands still, repeated readings.
pub(crate) fn standing(records: &[Record], noise_um: f64) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut shares = |kind: Kind, of: &dyn Fn(&Record) -> Vec<Range<usize>>| {
        let (mut seen, mut samples, mut all) = (Vec::new(), 0, 0);
        for record in records {
            let still: usize = of(record).iter().map(ExactSizeIterator::len).sum();
            if still > 0 {
                seen.push(record);
                (samples, all) = (samples + still, all + record.len());
            }
        }
        if !seen.is_empty() {
            found.push(Finding {
                kind,
                channel: Some(Channel::Position),
                records: names(seen),
                figure: figure(100.0 * samples as f64 / all as f64, Unit::Percent, Quantity::Share),
            });
        }
        samples > 0
    };
    let clipped_any = shares(Kind::Clipped, &clipped);
    let stuck_any = shares(Kind::StuckSensor, &stuck);
    if !clipped_any && !stuck_any {
        found.extend(stops(records, noise_um));
    }
    found.extend(held(records, noise_um));
    found
}

fn stops(records: &[Record], noise_um: f64) -> Option<Finding> {
    let (low, high) = records
        .iter()
        .map(|r| crate::range(&r.position_um))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (a, b)| {
            (low.min(a), high.max(b))
        });
    let mut seen: Vec<(&Record, f64)> = Vec::new();
    for record in records {
        let at = |top: bool| {
            let extreme = if top { high } else { low };
            flat_top(record, top, extreme, high - low, noise_um)
        };
        seen.extend(at(true).or_else(|| at(false)).map(|share| (record, share)));
    }
    let share = seen.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    (share > 0.0).then(|| Finding {
        kind: Kind::FlatTop,
        channel: Some(Channel::Position),
        records: names(seen.iter().map(|(record, _)| *record)),
        figure: figure(100.0 * share, Unit::Percent, Quantity::Range),
    })
}

/// Share of moving samples that repeat the one before from which on readings are repeated: of a fine column a hundredth
/// do by chance.
const REPEATED: f64 = 0.2;
/// Longest hold that is looked for, samples.
const LONGEST_HOLD: usize = 32;

/// Readings per value where a column repeats each; 1 where it does not.
pub(crate) fn hold(values: &[f64], noise: f64) -> usize {
    let step = code_width(values);
    let moves = |k: usize| {
        let slope = (values[k + 3] - values[k - 3]).abs() / 6.0;
        slope >= 5.0 * step.max(noise) && slope > 0.0
    };
    let moving = || (3..values.len().saturating_sub(3)).filter(|&k| moves(k));
    let all = moving().count();
    let changed = || moving().filter(|&k| values[k] != values[k - 1]);
    let changes = changed().count();
    if all < 60 || ((all - changes) as f64) < REPEATED * all as f64 {
        return 1;
    }
    // The longest hold at one phase of which nearly all changes happen.
    (2..=LONGEST_HOLD)
        .rev()
        .find(|&hold| {
            let mut at_phase = [0; LONGEST_HOLD];
            changed().for_each(|k| at_phase[k % hold] += 1);
            at_phase.iter().any(|&at| at * 20 > changes * 19)
        })
        .unwrap_or(1)
}

fn held(records: &[Record], noise_um: f64) -> Vec<Finding> {
    let of = |channel: Channel| {
        let held = |record: &Record| match channel {
            Channel::Position => hold(&record.position_um, noise_um),
            Channel::Voltage => hold(&record.voltage_v, 0.0),
        };
        let seen: Vec<(&Record, usize)> = records
            .iter()
            .map(|record| (record, held(record)))
            .filter(|(_, hold)| *hold > 1)
            .collect();
        let most = seen.iter().map(|(_, hold)| *hold).max()?;
        Some(Finding {
            kind: Kind::HeldSamples,
            channel: Some(channel),
            records: names(seen.iter().map(|(record, _)| *record)),
            figure: figure(most as f64, Unit::Sample, Quantity::Hold),
        })
    };
    [Channel::Position, Channel::Voltage]
        .into_iter()
        .filter_map(of)
        .collect()
}
