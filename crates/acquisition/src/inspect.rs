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
    let following: Vec<(&Record, Following)> = records
        .par_iter()
        .filter_map(|record| Some((record, turns::following(record)?)))
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
        following: sharpest(&following).map(|(_, following)| *following),
        findings,
    }
}

/// The record that tells the instant best.
fn sharpest<'a>(following: &'a [(&Record, Following)]) -> Option<&'a (&'a Record, Following)> {
    let error = |f: &Following| f.uncertainty_s.max(1e-9);
    following.iter().min_by(|a, b| error(&a.1).total_cmp(&error(&b.1)))
}

/// Standard errors, and samples, by which the position must lead.
const CLEAR: f64 = 5.0;
const CLEAR_SAMPLES: f64 = 0.06;

/// A lead of the position, in the record that tells it best; no stage answers before it is asked.
fn lead(following: &[(&Record, Following)]) -> Option<Finding> {
    let leads =
        |(record, f): &&(&Record, Following)| f.seconds < -(CLEAR * f.uncertainty_s + CLEAR_SAMPLES * record.period_s);
    let seen: Vec<_> = following.iter().filter(leads).collect();
    let best = sharpest(following)?;
    if !leads(&best) {
        return None;
    }
    Some(Finding {
        kind: Kind::PositionLeads,
        channel: None,
        records: plain::names(seen.iter().map(|(record, _)| *record)),
        figure: Figure {
            value: -best.1.seconds,
            uncertainty: Some(best.1.uncertainty_s),
            unit: Unit::Second,
            of: Quantity::Lead,
        },
    })
}
