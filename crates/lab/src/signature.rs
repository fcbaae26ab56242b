//! What a candidate does to the user's own data: the error of one record without it and with it.

use crate::series;
use hysteron_data::{Dataset, Record};
use hysteron_diagnose::Comparison;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_identify::period;
use serde::{Deserialize, Serialize};

/// Candidates that are shown where fewer count.
const AT_LEAST: usize = 3;
/// Most candidates that are shown: each is a fit.
const AT_MOST: usize = 5;
/// Columns of a card's picture.
const COLUMNS: usize = 300;

/// A candidate's trace in one record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Signature {
    pub(crate) effect: String,
    /// The record where it takes most of the squared error.
    pub(crate) file: String,
    pub(crate) time_s: Vec<f64>,
    /// Error of the model as it is.
    pub(crate) without: Vec<f64>,
    /// Error of the model with the candidate, everything fitted anew.
    pub(crate) with: Vec<f64>,
    /// Its parameters in that fit.
    pub(crate) parameters: Vec<Fitted>,
}

/// A parameter of a candidate as `add` fits it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Fitted {
    pub(crate) name: String,
    pub(crate) value: f64,
    pub(crate) unit: String,
    pub(crate) standard_error: Option<f64>,
}

/// The signatures of the candidates that count, or of the first ones. One that cannot be added to these data has none.
pub(crate) fn signatures(
    dataset: &Dataset,
    model: &hysteron_identify::Model,
    comparison: &Comparison,
    diagnosis: &Diagnosis,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Vec<Signature> {
    let counting = diagnosis.ranking.iter().filter(|effect| effect.significant).count();
    let shown = counting.clamp(AT_LEAST, AT_MOST).min(diagnosis.ranking.len());
    let order = diagnosis.ranking.iter().enumerate();
    let mut first: Vec<_> = order
        .map(|(place, effect)| (!effect.significant, place, effect))
        .collect();
    first.sort_by_key(|&(not, place, _)| (not, place));
    let candidates = first.iter().take(shown).enumerate();
    candidates
        .filter_map(|(done, (_, _, effect))| {
            let share = |part: f64| (done as f64 + part) / shown as f64;
            progress(share(0.0), &effect.effect);
            let added = hysteron_diagnose::add(dataset, model, &effect.effect, &|part| {
                progress(share(part), &effect.effect);
            });
            signature(dataset, &added.ok()?.model, comparison, &effect.effect)
        })
        .collect()
}

fn signature(
    dataset: &Dataset,
    with: &hysteron_identify::Model,
    comparison: &Comparison,
    effect: &str,
) -> Option<Signature> {
    let traces = dataset
        .records
        .iter()
        .zip(&comparison.records)
        .filter_map(|(record, compared)| {
            compared.nrmse_percent?;
            let measured = &compared.series.measured;
            let modelled = with.simulate(record).output;
            let without: Vec<f64> = measured
                .iter()
                .zip(&compared.series.modelled)
                .map(|(y, m)| y - m)
                .collect();
            let with: Vec<f64> = measured.iter().zip(&modelled).map(|(y, m)| y - m).collect();
            let squares = |errors: &[f64]| errors.iter().map(|e| e * e).sum::<f64>();
            let low = measured.iter().copied().fold(f64::INFINITY, f64::min);
            let high = measured.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            // As in the pooled percentage, each record counts by its own stroke and length.
            let takes = (squares(&without) - squares(&with)) / (measured.len() as f64 * (high - low).powi(2));
            Some((takes, record, without, with))
        });
    let parameters = with
        .effects
        .iter()
        .find(|fitted| fitted.name == effect)?
        .parameters
        .iter();
    let parameters = parameters.map(|p| Fitted {
        name: p.name.clone(),
        value: p.value,
        unit: p.unit.clone(),
        standard_error: p.standard_error,
    });
    let (_, record, without, with) = traces.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let (first, len) = telling(record);
    let time = |k: usize| record.start_s + k as f64 * record.period_s;
    let points = series::columns(first, len, COLUMNS, time, &[&|k| without[k], &|k| with[k]]);
    let [without, with] = <[Vec<f64>; 2]>::try_from(points.y).ok()?;
    Some(Signature {
        effect: effect.to_owned(),
        file: record.file.clone(),
        time_s: points.x,
        without,
        with,
        parameters: parameters.collect(),
    })
}

/// The last two periods of a record, or all of it: first sample and number of samples.
fn telling(record: &Record) -> (usize, usize) {
    match period::detect(&record.voltage_v) {
        Some(period) if 2 * period.samples < record.len() => (record.len() - 2 * period.samples, 2 * period.samples),
        _ => (0, record.len()),
    }
}
