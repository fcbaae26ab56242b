//! Voltage and position on two clocks: the position falls behind, or runs ahead, by the same part of the time in every record.

use crate::comb::{Comb, amplitude, phase};
use crate::plain::names;
use crate::report::{Figure, Finding, Kind, Quantity, Unit};
use hysteron_data::Record;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Stretches of a record whose phases are compared.
const STRETCHES: [usize; 2] = [5, 16];
/// Periods of a stretch at the least: a window of Hann over two has hardly any of the mean and its drift.
const PERIODS: usize = 2;
/// Periods at a record's beginning in which a stage finds its loop.
const SETTLING: f64 = 1.0;
/// The drive's harmonics of which the strongest is looked at.
const HARMONICS: usize = 5;
/// Standard errors from which on a difference is clear: a phase that scatters does not come near, one that settles is curved.
const CLEAR: f64 = 8.0;
/// Part of the phase's change that may be curved: clocks differ by the same all the time, what settles or warms up does not.
const CURVED: f64 = 0.15;
/// Samples by which a record must have slipped at the least.
const SLIPPED: f64 = 0.3;
/// Factor by which drives must differ in frequency: a lag that grows with time is a phase that differs with the frequency.
const APART: f64 = 1.5;

/// What a record says of the clocks.
#[derive(Debug, Clone, Copy)]
struct Slip {
    /// Rate of the position's clock over that of the voltage's, less one.
    difference: f64,
    /// Its standard error.
    error: f64,
    /// Frequency of the line that was looked at, hertz.
    hz: f64,
    /// Samples that the record has slipped.
    samples: f64,
}

/// A difference of the clocks that records of several rates agree on.
pub(crate) fn different(records: &[Record]) -> Option<Finding> {
    let told: Vec<(&Record, Slip)> = records.par_iter().filter_map(|r| Some((r, slip(r)?))).collect();
    let hz = told.iter().map(|(_, slip)| slip.hz);
    let (slowest, fastest) = hz.fold((f64::INFINITY, 0.0_f64), |(low, high), hz| (low.min(hz), high.max(hz)));
    if told.len() < 2 || fastest < APART * slowest {
        return None;
    }
    let weight = |slip: &Slip| slip.error.powi(-2);
    let weights: f64 = told.iter().map(|(_, slip)| weight(slip)).sum();
    let mean = told.iter().map(|(_, slip)| weight(slip) * slip.difference).sum::<f64>() / weights;
    let apart: f64 = told
        .iter()
        .map(|(_, slip)| weight(slip) * (slip.difference - mean).powi(2))
        .sum();
    // Records that do not agree within their errors make the error of the mean larger.
    let scatter = (apart / (told.len() - 1) as f64).max(1.0);
    let error = (scatter / weights).sqrt();
    let slipped = told.iter().map(|(_, slip)| slip.samples.abs()).fold(0.0, f64::max);
    (mean.abs() > CLEAR * error && slipped > SLIPPED).then(|| Finding {
        kind: Kind::DifferentClocks,
        channel: None,
        records: names(told.iter().map(|(record, _)| *record)),
        figure: Figure {
            value: 1e6 * mean,
            uncertainty: Some(1e6 * error),
            unit: Unit::PartsPerMillion,
            of: Quantity::ClockDifference,
        },
    })
}

/// How the phase from voltage to position runs away, at the strongest line of a drive that repeats.
fn slip(record: &Record) -> Option<Slip> {
    let (v, y) = (&record.voltage_v, &record.position_um);
    let comb = Comb::find(v)?;
    let from = comb.from + (SETTLING / comb.cycles).ceil() as usize;
    let len = v.len().checked_sub(from)?;
    let periods = comb.cycles * len as f64;
    let stretches = (periods as usize / PERIODS).min(STRETCHES[1]);
    if stretches < STRETCHES[0] {
        return None;
    }
    let (harmonic, _) = (1..=HARMONICS)
        .map(|h| (h, amplitude(&v[from..], h as f64 * comb.cycles)))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let cycles = harmonic as f64 * comb.cycles;
    // Whole periods a stretch, so that all stretches begin at one phase and what the window lets by is the same in each.
    let whole = (periods / stretches as f64).floor() / comb.cycles;
    let starts: Vec<usize> = (0..stretches)
        .map(|k| from + (k as f64 * whole).round() as usize)
        .collect();
    let length = whole.floor() as usize;
    let mut phases: Vec<f64> = Vec::with_capacity(stretches);
    for &start in &starts {
        let stretch = start..(start + length).min(v.len());
        let behind = phase(&v[stretch.clone()], cycles) - phase(&y[stretch], cycles);
        let last = phases.last().copied().unwrap_or(behind);
        phases.push(behind - TAU * ((behind - last) / TAU).round());
    }
    let rows: Vec<(f64, f64)> = starts.iter().map(|&start| start as f64).zip(phases).collect();
    let (slope, error, curved) = line(&rows)?;
    let total = slope * len as f64;
    // The sine's phase falls where the position's clock is slow.
    (curved.abs() < CURVED * total.abs() || total.abs() < CLEAR * error * len as f64).then(|| Slip {
        difference: slope / (TAU * cycles),
        error: error / (TAU * cycles),
        hz: cycles / record.period_s,
        samples: total / (TAU * cycles),
    })
}

/// Slope of a line through rows, its standard error, and how far a parabola lies from it at the ends.
fn line(rows: &[(f64, f64)]) -> Option<(f64, f64, f64)> {
    let n = rows.len() as f64;
    let x0 = rows.iter().map(|row| row.0).sum::<f64>() / n;
    let y0 = rows.iter().map(|row| row.1).sum::<f64>() / n;
    let xx: f64 = rows.iter().map(|row| (row.0 - x0).powi(2)).sum();
    let slope = rows.iter().map(|row| (row.0 - x0) * (row.1 - y0)).sum::<f64>() / xx;
    let left = |row: &(f64, f64)| row.1 - y0 - slope * (row.0 - x0);
    let bent = |row: &(f64, f64)| (row.0 - x0).powi(2) - xx / n;
    let bend = rows.iter().map(|row| bent(row) * left(row)).sum::<f64>()
        / rows.iter().map(|row| bent(row).powi(2)).sum::<f64>();
    let curved = bend * (rows.last()?.0 - x0).powi(2);
    let rest: f64 = rows.iter().map(|row| left(row).powi(2)).sum();
    // Rounding alone leaves no error at all; a millionth of a turn over the record is none that matters.
    let least = 1e-6 * TAU / (rows.last()?.0 - rows.first()?.0).max(1.0);
    Some((slope, (rest / (n - 2.0) / xx).sqrt().max(least), curved))
}
