//! Learns a model by itself: fits, diagnoses, adds, until nothing more is missing or nothing more can be told.

use crate::diagnosis::{Diagnosis, Unexplained};
use crate::learner::Learner;
use crate::noise::noise_floor;
use hysteron_data::Dataset;
use hysteron_identify::effects::UserEffect;
use hysteron_identify::{EffectName, FitOptions, IdentifyError, Model, check_own_effect, fit};
use serde::Serialize;

/// What `learn` did, and why it stopped.
#[derive(Debug, Clone)]
pub struct Learned {
    /// The model, with every step in its history.
    pub model: Model,
    /// The attempts in their order, those that were not kept as well.
    pub attempts: Vec<Attempt>,
    /// The model at the start and after each attempt that was kept; the last is [`Self::model`].
    pub rungs: Vec<Model>,
    /// Why it stopped.
    pub stop: Stop,
    /// The last diagnosis.
    pub diagnosis: Diagnosis,
}

/// One attempt to change the model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Attempt {
    /// The effect that was tried.
    pub effect: EffectName,
    /// Added, or taken out again as a later one made it superfluous.
    pub change: hysteron_identify::Change,
    /// Effects that a diagnosis of these records cannot tell from it; it left least on the validation records.
    pub also_possible: Vec<EffectName>,
    /// Pooled error on validation records before, percent of peak to peak.
    pub before_percent: Option<f64>,
    /// The same after.
    pub after_percent: Option<f64>,
    /// Whether the model keeps it: where the validation records confirm it.
    pub kept: bool,
    /// Whether no diagnosis had named it: it was tried because the model with it forecasts far better, and is kept only if
    /// nothing unexplained remains in the end.
    pub on_trial: bool,
}

/// Why learning stopped.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "why", rename_all = "kebab-case")]
pub enum Stop {
    /// What is left is noise and the known coarseness of the model.
    NothingMissing,
    /// The records cannot answer.
    CannotTell {
        /// Why, as in [`Diagnosis::cannot_answer`].
        reasons: Vec<String>,
    },
    /// Structure remains that nothing in the catalogue explains.
    Unknown {
        /// What remains, and what it goes with.
        unexplained: Unexplained,
    },
    /// An effect is named, but the validation records do not confirm it.
    NotConfirmed {
        /// The effect.
        effect: EffectName,
    },
    /// An effect is named that the model cannot be given: it has it already, or cannot have it.
    CannotAdd {
        /// The effect.
        effect: EffectName,
        /// Why.
        reason: String,
    },
    /// As many steps as are allowed.
    EnoughSteps,
}

/// Most effects that are added: there are fifteen, and no stage of this class shows more than a handful.
const MOST_STEPS: usize = 6;

/// Fits a model of this family, then adds what [`crate::diagnose`] names, as long as records that it was not fitted to confirm it.
///
/// A later step may make an earlier one superfluous (a lag that stood in for a delay): such a step is taken out again.
/// `progress` is called with what is done now, and the share of it done.
///
/// # Errors
/// As [`hysteron_identify::fit()`].
/// # Cost
/// A diagnosis a step, and one more: seconds each.
pub fn learn(
    dataset: &Dataset,
    options: &FitOptions,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Learned, IdentifyError> {
    learn_with(dataset, options, &[], progress)
}

/// As [`learn`], with effects of the user's own among the candidates.
///
/// # Errors
/// As [`learn`]; an effect whose equations need a column that the records lack.
pub fn learn_with(
    dataset: &Dataset,
    options: &FitOptions,
    own: &[UserEffect],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Learned, IdentifyError> {
    own.iter().try_for_each(|effect| check_own_effect(*effect, dataset))?;
    let model = fit(dataset, options, &|share| progress("fitting", share))?.model;
    Ok(go_on(dataset, model, own, progress))
}

/// Goes on from a model, as [`learn`] does.
pub fn learn_from(dataset: &Dataset, model: Model, progress: &(dyn Fn(&str, f64) + Sync)) -> Learned {
    go_on(dataset, model, &[], progress)
}

fn go_on(dataset: &Dataset, model: Model, own: &[UserEffect], progress: &(dyn Fn(&str, f64) + Sync)) -> Learned {
    let mut learner = Learner::new(dataset, model, own, progress);
    learner.take_the_controllers_delay();
    let mut diagnosis = learner.diagnose();
    let mut stop = loop {
        let stop = match answered(&diagnosis) {
            None if learner.kept() >= MOST_STEPS => Some(Stop::EnoughSteps),
            None => learner.follow(&diagnosis).err(),
            stop => stop,
        };
        let nothing_certain = matches!(stop, Some(Stop::Unknown { .. } | Stop::NotConfirmed { .. }));
        if let Some(stop) = stop.filter(|_| !nothing_certain || !learner.go_on_unknown(&diagnosis)) {
            break stop;
        }
        diagnosis = learner.diagnose();
    };
    if matches!(stop, Stop::Unknown { .. } | Stop::NotConfirmed { .. })
        && let Some(before) = learner.take_back()
    {
        diagnosis = before;
    } else if learner.put_back() {
        diagnosis = learner.diagnose();
        stop = answered(&diagnosis).unwrap_or(stop);
    }
    learner.model.fitted_on.noise = Some(noise_floor(dataset));
    Learned {
        model: learner.model,
        attempts: learner.attempts,
        rungs: learner.rungs,
        stop,
        diagnosis,
    }
}

/// Whether a diagnosis ends the search.
fn answered(diagnosis: &Diagnosis) -> Option<Stop> {
    if !diagnosis.cannot_answer.is_empty() {
        return Some(Stop::CannotTell {
            reasons: diagnosis.cannot_answer.clone(),
        });
    }
    match diagnosis.verdict.as_str() {
        "none" => Some(Stop::NothingMissing),
        "unknown" => Some(Stop::Unknown {
            unexplained: diagnosis.unexplained.clone(),
        }),
        _ => None,
    }
}
