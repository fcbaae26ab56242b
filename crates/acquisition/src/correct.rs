//! What can be put right with certainty.

use crate::ends;
use crate::report::{Kind, Report};
use hysteron_data::{Dataset, Record};
use serde::Serialize;
use std::ops::Range;

/// What was put right, or must be left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Correction {
    /// All positions changed their sign: the stage has a negative gain.
    SignTurned,
    /// All positions were moved to a later time, by the lead that no stage can have.
    LeadRemoved {
        /// By so much, seconds.
        seconds: f64,
    },
    /// Samples of a record that say nothing: readings at the end of the converter's range. They are as they were.
    LeaveOut {
        /// The record.
        file: String,
        /// Its samples.
        samples: Vec<Range<usize>>,
    },
}

/// The records with what is certain put right, and a list of it.
///
/// Units, gains, swapped columns and a skew that may be the stage's delay stay as they are: those are the user's to decide.
pub fn corrected(dataset: &Dataset, report: &Report) -> (Dataset, Vec<Correction>) {
    let mut dataset = dataset.clone();
    let mut corrections = Vec::new();
    for record in &dataset.records {
        let samples = ends::clipped(record, report.noise.rms_um);
        if !samples.is_empty() {
            let file = record.file.clone();
            corrections.push(Correction::LeaveOut { file, samples });
        }
    }
    let doubtful = [Kind::SwappedColumns, Kind::SignByRecord];
    if report.findings.iter().any(|finding| doubtful.contains(&finding.kind)) {
        return (dataset, corrections);
    }
    if report.of(Kind::NegativeGain).next().is_some() {
        for record in &mut dataset.records {
            record.position_um.iter_mut().for_each(|y| *y = -*y);
            if let Some(reference_um) = &mut record.reference_um {
                reference_um.iter_mut().for_each(|r| *r = -*r);
            }
        }
        corrections.push(Correction::SignTurned);
    }
    if let Some(lead) = report.of(Kind::PositionLeads).next() {
        let seconds = lead.figure.value;
        dataset.records.iter_mut().for_each(|record| later(record, seconds));
        corrections.push(Correction::LeadRemoved { seconds });
    }
    (dataset, corrections)
}

/// Samples on either side from which a value between two samples is taken.
const TAPS: isize = 16;

/// Moves the positions of a record to a later time, by a windowed sinc: exact below 0.8 of half the sampling rate.
fn later(record: &mut Record, seconds: f64) {
    let shift = seconds / record.period_s;
    let whole = shift.floor();
    let part = shift - whole;
    // Weight of the sample j - TAPS before the whole shift.
    let mut weights: Vec<f64> = (-TAPS..=TAPS + 1)
        .map(|j| {
            let x = j as f64 - part;
            let sinc = if x.abs() < 1e-12 {
                1.0
            } else {
                (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x)
            };
            let window = (0.5 * std::f64::consts::PI * x / (TAPS as f64 + 1.0))
                .cos()
                .max(0.0)
                .powi(2);
            sinc * window
        })
        .collect();
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    let y = &record.position_um;
    let last = y.len() as isize - 1;
    let moved = (0..=last)
        .map(|k| {
            let at = |j: usize| y[(k - whole as isize - (j as isize - TAPS)).clamp(0, last) as usize];
            weights.iter().enumerate().map(|(j, w)| w * at(j)).sum()
        })
        .collect();
    record.position_um = moved;
}
