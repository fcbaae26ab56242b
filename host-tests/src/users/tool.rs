//! All calls of the tool that is measured, and nothing else: where its interface changes, only this file does.

use hysteron_data::Dataset;
use hysteron_diagnose::evidence::Evidence;
use hysteron_diagnose::{examine, learn_from};
use hysteron_identify::{Family, FitOptions, IdentifyError, Model, fit, present_step};

/// A record that the tool asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// In words.
    pub words: String,
    /// Sample period, seconds.
    pub period_s: f64,
    /// Voltages, one a sample.
    pub voltage_v: Vec<f64>,
    /// Voltages of the other axis, where it is to move.
    pub other_v: Option<Vec<f64>>,
}

/// What a diagnosis says.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// The verdict.
    pub verdict: String,
    /// What cannot be told from it.
    pub also_possible: Vec<String>,
    /// What is missing beside it.
    pub further: Vec<String>,
    /// Why the records cannot answer.
    pub refused: Vec<String>,
    /// What is significant in the ranking, best first, whether it is named or not.
    pub starred: Vec<String>,
    /// The record to take next.
    pub next: Option<Wanted>,
    /// The numbers behind it.
    pub evidence: Evidence,
}

impl Said {
    /// Whether a word is the name of an effect.
    pub fn is_name(word: &str) -> bool {
        !matches!(word, "none" | "unknown" | "hysteresis-shape" | "")
    }

    /// The verdict and what cannot be told from it, names only.
    pub fn set(&self) -> Vec<&str> {
        let all = std::iter::once(&self.verdict).chain(&self.also_possible);
        all.map(String::as_str).filter(|word| Self::is_name(word)).collect()
    }
}

/// The start model of a dataset.
///
/// # Errors
/// As [`fit()`].
pub fn start(dataset: &Dataset, family: Family) -> Result<Model, IdentifyError> {
    Ok(fit(dataset, &FitOptions::new(family), &|_| {})?.model)
}

/// What is missing in a model.
pub fn ask(dataset: &Dataset, model: &Model) -> Said {
    let (said, evidence) = examine(dataset, model, &[], &|_, _| {});
    let starred = said.ranking.iter().filter(|entry| entry.significant);
    Said {
        evidence,
        starred: starred.map(|entry| entry.effect.to_string()).collect(),
        verdict: said.verdict.as_str().to_owned(),
        also_possible: said.also_possible.iter().map(ToString::to_string).collect(),
        further: said.further.iter().map(ToString::to_string).collect(),
        refused: said.cannot_answer.iter().map(|reason| format!("{reason:?}")).collect(),
        next: said
            .next_record
            .filter(|next| !next.voltage_v.is_empty())
            .map(|next| Wanted {
                words: next.excitation,
                period_s: next.sample_period_s,
                voltage_v: next.voltage_v,
                other_v: next.voltage2_v,
            }),
    }
}

/// What the tool learns by itself from a start model: the model, and the effects in it.
///
/// # Errors
/// As [`learn_from`].
pub fn learned(dataset: &Dataset, model: Model) -> Result<(Model, Vec<String>), IdentifyError> {
    let model = learn_from(dataset, model, &|_, _| {})?.model;
    let effects = model.effects.iter().map(|effect| effect.name.to_string()).collect();
    Ok((model, effects))
}

/// Error of a model on records, percent of peak to peak, pooled over those that move; none where none does.
pub fn error_percent(held_out: &Dataset, model: &Model) -> Option<f64> {
    present_step(held_out, model).validate_percent
}
