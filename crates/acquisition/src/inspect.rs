//! All of the rig in one call.

use crate::codes::resolution;
use crate::report::{Channel, Figure, Finding, Following, Kind, Quantity, Report, Unit};
use crate::{alike, codes, drive, ends, plain, tones, turns};
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
    let following: Vec<(&Record, Following, f64)> = records
        .par_iter()
        .filter_map(|record| turns::following(record).map(|(following, apart_s)| (record, following, apart_s)))
        .collect();
    let mut findings = plain::glance(records);
    let upside_down = |kind| findings.iter().any(|finding: &Finding| finding.kind == kind);
    if !upside_down(Kind::SwappedColumns) {
        findings.extend(lead(&following));
    }
    findings.extend(alike::between_like_records(records));
    findings.extend(drive::origin(records));
    findings.extend(codes::coarse(voltage, Channel::Voltage));
    findings.extend(codes::coarse(position, Channel::Position));
    findings.extend(codes::missing(records));
    findings.extend(ends::standing(records, noise.rms_um));
    findings.extend(tones::tones(records, noise.rms_um));
    Report {
        noise,
        voltage,
        position,
        following: sharpest(&following),
        findings,
    }
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
const CLEAR_SAMPLES: f64 = 0.06;

/// A lead of the position; no stage answers before it is asked.
///
/// A loop that is not symmetric about its turns seems to lead by a share of its period; a skew of the channels is the same time at every
/// rate. Both are fitted to records of different rates, and the time must be clear.
fn lead(following: &[(&Record, Following, f64)]) -> Option<Finding> {
    let apart = following.iter().map(|(.., apart_s)| *apart_s);
    let (fastest, slowest) = apart.fold((f64::INFINITY, 0.0_f64), |(low, high), s| (low.min(s), high.max(s)));
    let degrees = following.len().checked_sub(2).filter(|degrees| *degrees > 0)?;
    if slowest < RANGE * fastest {
        return None;
    }
    // Seconds over the time between turns are a line in its inverse, whose slope is the skew.
    let rows: Vec<(f64, f64)> = following.iter().map(|(_, f, s)| (1.0 / s, f.seconds / s)).collect();
    let n = rows.len() as f64;
    let (x0, y0) = rows
        .iter()
        .fold((0.0, 0.0), |(x0, y0), (x, y)| (x0 + x / n, y0 + y / n));
    let (xx, xy) = rows.iter().fold((0.0, 0.0), |(xx, xy), (x, y)| {
        (xx + (x - x0).powi(2), xy + (x - x0) * (y - y0))
    });
    let skew_s = xy / xx;
    let left: f64 = rows.iter().map(|(x, y)| (y - y0 - skew_s * (x - x0)).powi(2)).sum();
    let told = following
        .iter()
        .map(|(_, f, _)| f.uncertainty_s)
        .fold(f64::INFINITY, f64::min);
    let uncertainty_s = (left / degrees as f64 / xx).sqrt().max(told);
    let finest_s = following
        .iter()
        .map(|(record, ..)| record.period_s)
        .fold(f64::INFINITY, f64::min);
    (skew_s < -(chance(degrees) * uncertainty_s + CLEAR_SAMPLES * finest_s)).then(|| Finding {
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
