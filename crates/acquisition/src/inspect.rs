//! All of the rig in one call.

use crate::codes::resolution;
use crate::report::{Channel, Figure, Finding, Following, Kind, Quantity, Report, Unit};
use crate::{alike, clocks, codes, drive, ends, plain, tones, turns};
use hysteron_data::{Dataset, Record};
use rayon::prelude::*;

/// What the recordings say of the rig, before any model: noise, resolution, skew, and what is wrong.
///
/// # Cost
/// A few passes over the samples and a few Fourier transforms a record.
pub fn inspect(dataset: &Dataset) -> Report {
    let records = &dataset.records;
    let noise = crate::noise_floor(dataset);
    let voltage = resolution(records.iter().map(|r| r.voltage_v.as_slice()));
    let position = resolution(records.iter().map(|r| r.position_um.as_slice()));
    let following = followings(records);
    let mut findings = wrong(records, noise.rms_um, &following);
    findings.extend(alike::between_like_records(records));
    findings.extend(drive::origin(records));
    findings.extend(codes::coarse(voltage, Channel::Voltage));
    findings.extend(codes::coarse(position, Channel::Position));
    Report {
        noise,
        voltage,
        position,
        following: sharpest(&following),
        findings,
    }
}

/// Where a lab has erred: the findings of [`inspect`] that every reader of the records should know at once.
///
/// # Cost
/// Half of that of [`inspect`].
pub fn mistakes(dataset: &Dataset) -> Vec<Finding> {
    let records = &dataset.records;
    let found = wrong(records, crate::noise_floor(dataset).rms_um, &followings(records)).into_iter();
    found.filter(|finding| finding.kind.is_mistake()).collect()
}

/// How each record's position follows, and the time between its turns.
fn followings(records: &[Record]) -> Vec<(&Record, Following, f64)> {
    let each = records.par_iter();
    each.filter_map(|record| turns::following(record).map(|(following, apart_s)| (record, following, apart_s)))
        .collect()
}

/// The findings among which a lab's mistakes are.
fn wrong(records: &[Record], noise_um: f64, following: &[(&Record, Following, f64)]) -> Vec<Finding> {
    let mut findings = plain::glance(records);
    if !findings.iter().any(|finding| finding.kind == Kind::SwappedColumns) {
        findings.extend(lead(following));
    }
    findings.extend(codes::missing(records));
    findings.extend(ends::standing(records, noise_um));
    findings.extend(tones::tones(records, noise_um));
    findings.extend(clocks::different(records));
    findings
}

/// What the record says that tells the instant best.
fn sharpest(following: &[(&Record, Following, f64)]) -> Option<Following> {
    let error = |f: &Following| f.uncertainty_s.max(1e-9);
    let each = following.iter().map(|(_, following, _)| *following);
    each.min_by(|a, b| error(a).total_cmp(&error(b)))
}

/// Times between turns that must lie so far apart at the least.
const RANGE: f64 = 3.0;
/// Samples by which the position must lead at the least.
const CLEAR_SAMPLES: f64 = 0.3;
/// Share of the lead that must show without the fastest records as well: a mode bends loops beside it, and there alone.
const WITHOUT_FASTEST: f64 = 0.5;
/// Times between turns within this factor of the fastest are as fast.
const AS_FAST: f64 = 1.2;

/// A lead of the position; no stage answers before it is asked.
///
/// A loop that is not symmetric about its turns seems to lead by a share of its period; a skew of the channels is the same time at every
/// rate. Both are fitted to records of different rates; the time must be clear, and hold without the fastest.
fn lead(following: &[(&Record, Following, f64)]) -> Option<Finding> {
    let of = |following: &(&Record, Following, f64)| (following.1.seconds, following.2);
    let all: Vec<(f64, f64)> = following.iter().map(of).collect();
    let fastest_s = all.iter().map(|row| row.1).fold(f64::INFINITY, f64::min);
    let slower: Vec<(f64, f64)> = all.iter().copied().filter(|row| row.1 > AS_FAST * fastest_s).collect();
    let (skew_s, scatter_s) = skew(&all)?;
    let (without_s, _) = skew(&slower)?;
    let told = following.iter().map(|(_, f, _)| f.uncertainty_s);
    let uncertainty_s = scatter_s.max(told.fold(f64::INFINITY, f64::min));
    let finest_s = following
        .iter()
        .map(|(record, ..)| record.period_s)
        .fold(f64::INFINITY, f64::min);
    let clear = skew_s < -(chance(all.len() - 2) * uncertainty_s + CLEAR_SAMPLES * finest_s);
    (clear && without_s < WITHOUT_FASTEST * skew_s).then(|| Finding {
        kind: Kind::PositionLeads,
        channel: None,
        records: plain::names(following.iter().map(|(record, ..)| *record)),
        figure: Figure {
            value: -skew_s,
            uncertainty: Some(uncertainty_s),
            unit: Unit::Second,
            of: Quantity::Lead,
        },
    })
}

/// The skew that following times have in common, and its standard error by their scatter, from rows of that time and the time from turn
/// to turn. `None` where fewer than three, or too much alike.
fn skew(rows: &[(f64, f64)]) -> Option<(f64, f64)> {
    let degrees = rows.len().checked_sub(2).filter(|degrees| *degrees > 0)?;
    let apart = rows.iter().map(|row| row.1);
    let (fastest, slowest) = apart.fold((f64::INFINITY, 0.0_f64), |(low, high), s| (low.min(s), high.max(s)));
    if slowest < RANGE * fastest {
        return None;
    }
    // Seconds over the time between turns are a line in its inverse, whose slope is the skew.
    let line: Vec<(f64, f64)> = rows.iter().map(|(seconds, s)| (1.0 / s, seconds / s)).collect();
    let n = line.len() as f64;
    let (x0, y0) = line
        .iter()
        .fold((0.0, 0.0), |(x0, y0), (x, y)| (x0 + x / n, y0 + y / n));
    let (xx, xy) = line.iter().fold((0.0, 0.0), |(xx, xy), (x, y)| {
        (xx + (x - x0).powi(2), xy + (x - x0) * (y - y0))
    });
    let skew = xy / xx;
    let left: f64 = line.iter().map(|(x, y)| (y - y0 - skew * (x - x0)).powi(2)).sum();
    Some((skew, (left / degrees as f64 / xx).sqrt()))
}

/// Student's t that is exceeded once in 200, by degrees of freedom (Abramowitz and Stegun 1964, table 26.10).
fn chance(degrees: usize) -> f64 {
    match degrees {
        0 | 1 => 63.7,
        2 => 9.92,
        3 => 5.84,
        4 => 4.60,
        5 => 4.03,
        6 => 3.71,
        _ => 3.50,
    }
}
