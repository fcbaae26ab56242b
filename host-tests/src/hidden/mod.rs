//! Datasets with a hidden effect: from the cases of `hysteron_plant::challenge` to what the tool reads, and the score of its verdicts.

pub mod change;
pub mod own;
pub mod score;
pub mod thresholds;
pub mod unanswerable;

use hysteron_challenge::dataset;
use hysteron_data::Dataset;
use hysteron_plant::StageError;
use hysteron_plant::challenge::{self, Spec, Start, Truth};

/// A case as a dataset, with the family of the model to start from.
#[derive(Debug, Clone)]
pub struct Example {
    /// What the user has.
    pub dataset: Dataset,
    /// The model to start from.
    pub start: hysteron_identify::Family,
    /// What is hidden.
    pub truth: Truth,
}

/// The dataset of a seed.
///
/// # Errors
/// As [`challenge::generate`].
pub fn generate(seed: u64, spec: &Spec) -> Result<Example, StageError> {
    let (case, truth) = challenge::generate(seed, spec)?;
    let start = match case.start {
        Start::Pi => hysteron_identify::Family::Pi,
        Start::Mpi => hysteron_identify::Family::Mpi,
        Start::Mrpi => hysteron_identify::Family::Mrpi,
    };
    Ok(Example {
        dataset: dataset(case, &format!("case-{seed}")),
        start,
        truth,
    })
}

/// The truth as JSON.
pub fn truth_json(truth: &Truth) -> serde_json::Value {
    let hidden: Vec<_> = truth
        .hidden
        .iter()
        .map(|hidden| {
            let parameters: serde_json::Map<_, _> = hidden
                .parameters
                .iter()
                .map(|p| (p.name.clone(), serde_json::json!({"value": p.value, "unit": p.unit})))
                .collect();
            serde_json::json!({
                "effect": hidden.effect.name(),
                "strength": hidden.strength.name(),
                "contribution_percent": hidden.contribution_percent,
                "parameters": parameters,
            })
        })
        .collect();
    serde_json::json!({
        "hidden": hidden,
        "accepted_verdicts": truth.accepted_verdicts(),
        "family": truth.family.name(),
        "stroke_um": truth.stroke_um,
        "full_v": truth.full_v,
        "noise_rms_um": truth.noise_rms_um,
        "seed": truth.seed,
    })
}
