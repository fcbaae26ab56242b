//! What a glance at the columns tells: sign, units, swapped columns, a drive that never turns.

use crate::report::{Channel, Figure, Finding, Kind, Quantity, Unit};
use crate::turns::of_voltage;
use crate::{median, span};
use hysteron_data::Record;

/// Slope of the position over the voltage, and their correlation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    /// Micrometres a volt.
    pub slope: f64,
    /// From -1 to 1.
    pub correlation: f64,
}

/// The straight line of a record; `None` where nothing moves.
pub(crate) fn line(record: &Record) -> Option<Line> {
    let n = record.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
    let (v0, y0) = (mean(&record.voltage_v), mean(&record.position_um));
    let (vv, vy, yy) = record
        .voltage_v
        .iter()
        .zip(&record.position_um)
        .map(|(v, y)| (v - v0, y - y0))
        .fold((0.0, 0.0, 0.0), |(a, b, c), (v, y)| (a + v * v, b + v * y, c + y * y));
    (vv > 0.0 && yy > 0.0).then(|| Line {
        slope: vy / vv,
        correlation: vy / (vv * yy).sqrt(),
    })
}

/// Correlation from which on a record says which way the position goes.
const CLEAR: f64 = 0.6;
/// Correlation from which on a record says how far.
const CLOSE: f64 = 0.9;
/// No stage's gain differs so much between records: amplitude and frequency change it by less than two.
const OTHER_UNIT: f64 = 8.0;
/// Strokes of positioning stages, micrometres.
const STROKES_UM: [f64; 2] = [1e-3, 5e3];
/// A voltage that moves no stage by what a sensor sees: a tenth of a nanometre at 100 nm/V.
const LEAST_DRIVE_V: f64 = 1e-3;
/// Voltages of a record below this share of the largest tell little of sign and gain.
const LITTLE: f64 = 0.02;

/// Sign, units, and a drive that never turns.
pub(crate) fn glance(records: &[Record]) -> Vec<Finding> {
    let largest_v = records.iter().map(|r| span(&r.voltage_v)).fold(0.0, f64::max);
    let moved: Vec<(&Record, Line)> = records
        .iter()
        .filter(|record| span(&record.voltage_v) > LITTLE * largest_v)
        .filter_map(|record| Some((record, line(record)?)))
        .collect();
    let mut found = Vec::new();
    found.extend(sign(&moved));
    found.extend(units(&moved));
    if largest_v > 0.0 && largest_v < LEAST_DRIVE_V {
        found.push(Finding {
            kind: Kind::OtherUnits,
            channel: Some(Channel::Voltage),
            records: Vec::new(),
            figure: figure(largest_v, Unit::Volt, Quantity::Range),
        });
    }
    found.extend(swapped(&moved));
    if largest_v > 0.0 && records.iter().all(|record| of_voltage(record).is_empty()) {
        found.push(Finding {
            kind: Kind::NeverReverses,
            channel: Some(Channel::Voltage),
            records: Vec::new(),
            figure: figure(largest_v, Unit::Volt, Quantity::Range),
        });
    }
    found
}

pub(crate) fn figure(value: f64, unit: Unit, of: Quantity) -> Figure {
    Figure {
        value,
        uncertainty: None,
        unit,
        of,
    }
}

pub(crate) fn names<'a>(records: impl IntoIterator<Item = &'a Record>) -> Vec<String> {
    records.into_iter().map(|record| record.file.clone()).collect()
}

fn sign(moved: &[(&Record, Line)]) -> Option<Finding> {
    let clear = || moved.iter().filter(|(_, line)| line.correlation.abs() > CLEAR);
    let falls = || clear().filter(|(_, line)| line.slope < 0.0);
    let (all, down) = (clear().count(), falls().count());
    if down == 0 {
        return None;
    }
    let slope = median(&mut falls().map(|(_, line)| line.slope).collect::<Vec<_>>());
    let (kind, records) = if down == all {
        (Kind::NegativeGain, Vec::new())
    } else {
        (Kind::SignByRecord, names(falls().map(|(record, _)| *record)))
    };
    Some(Finding {
        kind,
        channel: Some(Channel::Position),
        records,
        figure: figure(slope, Unit::MicrometrePerVolt, Quantity::Slope),
    })
}

fn units(moved: &[(&Record, Line)]) -> Option<Finding> {
    let close: Vec<_> = moved
        .iter()
        .filter(|(_, line)| line.correlation.abs() > CLOSE)
        .collect();
    let gain = median(&mut close.iter().map(|(_, line)| line.slope.abs()).collect::<Vec<_>>());
    let ratio = |line: &Line| line.slope.abs() / gain;
    let other = |line: &Line| ratio(line) > OTHER_UNIT || ratio(line) < 1.0 / OTHER_UNIT;
    let odd: Vec<_> = close.iter().filter(|(_, line)| other(line)).collect();
    if let Some((_, first)) = odd.first() {
        return Some(Finding {
            kind: Kind::OtherUnits,
            channel: None,
            records: names(odd.iter().map(|(record, _)| *record)),
            figure: figure(ratio(first), Unit::Factor, Quantity::GainRatio),
        });
    }
    let stroke = close
        .iter()
        .map(|(record, _)| span(&record.position_um))
        .fold(0.0, f64::max);
    (stroke > 0.0 && !(STROKES_UM[0]..=STROKES_UM[1]).contains(&stroke)).then(|| Finding {
        kind: Kind::OtherUnits,
        channel: Some(Channel::Position),
        records: Vec::new(),
        figure: figure(stroke, Unit::Micrometre, Quantity::Stroke),
    })
}

/// Branches below this share of a record's range are minor loops.
const MAJOR: f64 = 0.7;
/// Loops that are less open than this do not tell which way they run.
const OPEN: f64 = 0.02;
/// A loop runs backwards by a lead of the position, too: by less than half of what is seen, here.
const BY_A_LEAD: f64 = 0.5;

/// Loops that run backwards in the slowest records, further than a lead of the position makes them.
fn swapped(moved: &[(&Record, Line)]) -> Option<Finding> {
    let openings: Vec<(&Record, f64, f64)> = moved
        .iter()
        .filter(|(_, line)| line.correlation.abs() > CLOSE)
        .filter_map(|(record, line)| {
            let (opening, slowness_s) = opening(record, line.slope.signum())?;
            Some((*record, opening, slowness_s))
        })
        .collect();
    let slowest = openings.iter().max_by(|a, b| a.2.total_cmp(&b.2))?;
    let lead_s = crate::turns::following(slowest.0).map_or(0.0, |(following, _)| (-following.seconds).max(0.0));
    // Over a branch of duration T the two sides of a loop differ by twice the lead over T, pi/2 of that half way along a sine.
    let by_lead = std::f64::consts::PI * lead_s / slowest.2;
    let backwards = openings.iter().filter(|(_, opening, _)| *opening < 0.0).count();
    (slowest.1 < -OPEN && by_lead < -BY_A_LEAD * slowest.1 && backwards == openings.len()).then(|| Finding {
        kind: Kind::SwappedColumns,
        channel: None,
        records: Vec::new(),
        figure: figure(100.0 * slowest.1, Unit::Percent, Quantity::Opening),
    })
}

/// How far loops are open half way along their branches, as a share of the stroke, and how long a branch takes.
fn opening(record: &Record, sign: f64) -> Option<(f64, f64)> {
    let (v, y) = (&record.voltage_v, &record.position_um);
    let (whole_v, whole_y) = (span(v), span(y));
    let turns = of_voltage(record);
    let major: Vec<(bool, f64, usize)> = turns
        .windows(2)
        .filter(|pair| (v[pair[1]] - v[pair[0]]).abs() > MAJOR * whole_v)
        .map(|pair| {
            let up = v[pair[1]] > v[pair[0]];
            let middle = 0.5 * (v[pair[0]] + v[pair[1]]);
            let crossing = (pair[0]..pair[1])
                .find(|&k| (v[k + 1] >= middle) == up)
                .unwrap_or(pair[0]);
            let share = (middle - v[crossing]) / (v[crossing + 1] - v[crossing]);
            let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.5 };
            (
                up,
                y[crossing] + share * (y[crossing + 1] - y[crossing]),
                pair[1] - pair[0],
            )
        })
        .collect();
    let of_way = |up: bool| {
        let mut at: Vec<f64> = major
            .iter()
            .filter(|branch| branch.0 == up)
            .map(|branch| branch.1)
            .collect();
        (at.len() >= 2).then(|| median(&mut at))
    };
    let (rising, falling) = (of_way(true)?, of_way(false)?);
    let samples = median(&mut major.iter().map(|branch| branch.2 as f64).collect::<Vec<_>>());
    Some((sign * (falling - rising) / whole_y, samples * record.period_s))
}
