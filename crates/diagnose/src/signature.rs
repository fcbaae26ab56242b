//! What a candidate does to the user's own data: the error of one record without it and with it.

use crate::comparison::Comparison;
use crate::diagnosis::Diagnosis;
use hysteron_data::{Dataset, Record};
use hysteron_identify::effects::{Effect as _, UserEffect};
use hysteron_identify::{EffectName, Model, period};
use serde::{Deserialize, Serialize};

/// Candidates that are shown where fewer count.
const AT_LEAST: usize = 3;
/// Most candidates that are shown: each is a fit.
const AT_MOST: usize = 5;

/// A candidate's trace in one record: of the last two periods, or of the whole record where its drive does not repeat.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Signature {
    /// Its name in the ranking.
    pub effect: EffectName,
    /// The record where it takes most of the squared error.
    pub file: String,
    /// Time, seconds.
    pub time_s: Vec<f64>,
    /// Error of the model as it is, micrometres.
    pub without: Vec<f64>,
    /// The same with the candidate, everything fitted anew.
    pub with: Vec<f64>,
    /// Its parameters in that fit.
    pub parameters: Vec<Fitted>,
    /// Pooled errors of the model with the candidate, percent of peak to peak: what a step of the ladder will show.
    pub identify_percent: Option<f64>,
    /// The same on records it was not fitted to.
    pub validate_percent: Option<f64>,
}

/// A parameter of a candidate as `add` fits it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fitted {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// Its standard error, where the records determine it.
    pub standard_error: Option<f64>,
}

/// The signatures of the candidates that count, or of three: those that count beside the verdict before the others. One that cannot be added to these data has none.
///
/// `own` are the effects of the user's own among the candidates; `comparison` is the model's as it is.
///
/// # Cost
/// A fit of everything for each of at most five.
pub fn signatures(
    dataset: &Dataset,
    model: &Model,
    comparison: &Comparison,
    diagnosis: &Diagnosis,
    own: &[UserEffect],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Vec<Signature> {
    let counting = diagnosis.ranking.iter().filter(|effect| effect.significant).count();
    let shown = counting.clamp(AT_LEAST, AT_MOST).min(diagnosis.ranking.len());
    let mut names: Vec<(u8, &EffectName)> = diagnosis
        .ranking
        .iter()
        .map(|effect| match effect {
            effect if effect.significant => (0, &effect.effect),
            effect if diagnosis.further.contains(&effect.effect) => (1, &effect.effect),
            effect => (2, &effect.effect),
        })
        .collect();
    names.sort_by_key(|&(group, _)| group);
    names
        .iter()
        .take(shown)
        .enumerate()
        .filter_map(|(done, &(_, name))| {
            let share = |part: f64| progress((done as f64 + part) / shown as f64, name.as_str());
            share(0.0);
            let adding = |part: f64| share(0.8 * part);
            let added = match own.iter().find(|effect| effect.name() == *name) {
                Some(effect) => crate::add_own(dataset, model, *effect, &adding),
                None => crate::add(dataset, model, name.id()?, &adding),
            };
            let with = added.ok()?.model;
            let after = crate::compare(dataset, &with, &|part| share(0.8 + 0.2 * part));
            signature(dataset, &with, [comparison, &after], name)
        })
        .collect()
}

/// The trace of an effect in the comparisons before it was added and after.
fn signature(
    dataset: &Dataset,
    with: &Model,
    [before, after]: [&Comparison; 2],
    effect: &EffectName,
) -> Option<Signature> {
    let pairs = before.records.iter().zip(&after.records);
    let traces = dataset
        .records
        .iter()
        .zip(pairs)
        .filter_map(|(record, (before, after))| {
            before.nrmse_percent?;
            let measured = &before.series.measured;
            let [without, with] = [before, after].map(|compared| {
                let pairs = compared.series.measured.iter().zip(&compared.series.modelled);
                pairs.map(|(y, m)| y - m).collect::<Vec<f64>>()
            });
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
        .find(|fitted| fitted.name == *effect)?
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
    let time_s = (first..first + len).map(|k| record.start_s + k as f64 * record.period_s);
    let part = |own: Vec<f64>| own[first..first + len].to_vec();
    Some(Signature {
        effect: effect.clone(),
        file: record.file.clone(),
        time_s: time_s.collect(),
        without: part(without),
        with: part(with),
        parameters: parameters.collect(),
        identify_percent: after.identify.map(|pooled| pooled.nrmse_percent),
        validate_percent: after.validate.map(|pooled| pooled.nrmse_percent),
    })
}

/// The last two periods of a record, or all of it: first sample and number of samples.
fn telling(record: &Record) -> (usize, usize) {
    match period::detect(&record.voltage_v) {
        Some(period) if 2 * period.samples < record.len() => (record.len() - 2 * period.samples, 2 * period.samples),
        _ => (0, record.len()),
    }
}
