//! How a model came about: the error on every record, before and after each step.

use crate::family::peak_to_peak;
use crate::model::{Change, Model, RecordError, Step, StepSubject};
use crate::objective::clipped;
use crate::period;
use hysteron_data::{Dataset, Role};
use rayon::prelude::*;
use std::ops::Range;

/// The step at which a model stands, with its errors on this dataset.
pub fn present_step(dataset: &Dataset, model: &Model) -> Step {
    let (change, what) = model.history.last().map_or_else(
        || (Change::Fitted, StepSubject::Family(model.family)),
        |step| (step.change, step.what.clone()),
    );
    step(change, what, record_errors(dataset, model))
}

/// The error of a model on every record of a dataset, free simulation. Readings that are clipped do not count.
pub fn record_errors(dataset: &Dataset, model: &Model) -> Vec<RecordError> {
    let clipped = clipped(dataset, model.direction);
    dataset
        .records
        .par_iter()
        .map(|record| {
            let modelled = model.simulate(record).output;
            let measured = model.direction.output(record);
            // Measured, and how far off the model is.
            let counted = |samples: Range<usize>| -> (Vec<f64>, Vec<f64>) {
                let counted = samples.filter(|&k| !clipped.contains(&measured[k]));
                counted.map(|k| (measured[k], measured[k] - modelled[k])).unzip()
            };
            let (of_all, error) = counted(0..measured.len());
            let rms = (error.iter().map(|e| e * e).sum::<f64>().abs() / error.len().max(1) as f64).sqrt();
            let stroke = peak_to_peak(measured);
            let moves = stroke > 0.0 && peak_to_peak(&record.voltage_v) > 0.0 && !of_all.is_empty();
            let last = period::detect(&record.voltage_v)
                .filter(|found| moves && found.from == 0)
                .map(|found| counted(measured.len() - found.samples..measured.len()))
                .filter(|(measured, _)| !measured.is_empty());
            RecordError {
                file: record.file.clone(),
                role: record.role,
                rms,
                percent: moves.then(|| 100.0 * rms / stroke),
                relative_percent: moves.then(|| 100.0 * rms / scatter(&of_all)),
                last_period_percent: last.map(|(measured, error)| 100.0 * scatter(&error) / scatter(&measured)),
            }
        })
        .collect()
}

/// Rms about the mean.
fn scatter(series: &[f64]) -> f64 {
    let n = series.len() as f64;
    let mean = series.iter().sum::<f64>() / n;
    (series.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// A step of a history from its records' errors, pooled as root mean square over the records that move.
pub(crate) fn step(change: Change, what: StepSubject, records: Vec<RecordError>) -> Step {
    let pool = |role: Role| {
        let squares: Vec<f64> = records
            .iter()
            .filter(|r| r.role == role)
            .filter_map(|r| r.percent)
            .map(|p| p * p)
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    Step {
        change,
        what,
        identify_percent: pool(Role::Identify),
        validate_percent: pool(Role::Validate),
        records,
    }
}
