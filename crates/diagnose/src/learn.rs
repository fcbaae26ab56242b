//! Learns a model by itself: fits, diagnoses, adds, until nothing more is missing or nothing more can be told.

use crate::diagnosis::{Diagnosis, Unexplained};
use crate::ladder::percent;
use crate::missing::search;
use crate::noise::noise_floor;
use hysteron_data::{Dataset, Role};
use hysteron_identify::effects::UserEffect;
use hysteron_identify::{
    Added, FitOptions, IdentifyError, Model, Step, add_effect, add_own_effect, fit, remove_effect,
};
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
    pub effect: String,
    /// Added, or taken out again as a later one made it superfluous.
    pub change: hysteron_identify::Change,
    /// Effects that a diagnosis of these records cannot tell from it; it left least on the validation records.
    pub also_possible: Vec<String>,
    /// Pooled error on validation records before, percent of peak to peak.
    pub before_percent: Option<f64>,
    /// The same after.
    pub after_percent: Option<f64>,
    /// Whether the validation records confirm it; the model keeps it only then.
    pub kept: bool,
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
        effect: String,
    },
    /// An effect is named that the model cannot be given: it has it already, or cannot have it.
    CannotAdd {
        /// The effect.
        effect: String,
        /// Why.
        reason: String,
    },
    /// As many steps as are allowed.
    EnoughSteps,
}

/// Most effects that are added: there are fifteen, and no stage of this class shows more than a handful.
const MOST_STEPS: usize = 6;

/// A step must bring the pooled validation error below this share of what it was; less does not matter.
const CONFIRMED: f64 = 0.97;

/// A step without which the validation error rises by less than this share is superfluous.
const SUPERFLUOUS: f64 = 0.01;

/// Fits a model of this family, then adds what [`crate::diagnose`] names, as long as records that it was not fitted to confirm it.
///
/// A later step may make an earlier one superfluous (a lag that stood in for a delay): such a step is taken out again.
/// `progress` is called with what is done now, and the share of it done.
///
/// # Errors
/// As [`hysteron_identify::fit`].
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
    own.iter().try_for_each(|effect| effect.check(dataset))?;
    let model = fit(dataset, options, &|share| progress("fitting", share))?.model;
    Ok(go_on(dataset, model, own, progress))
}

/// Goes on from a model, as [`learn`] does.
pub fn learn_from(dataset: &Dataset, model: Model, progress: &(dyn Fn(&str, f64) + Sync)) -> Learned {
    go_on(dataset, model, &[], progress)
}

fn go_on(dataset: &Dataset, model: Model, own: &[UserEffect], progress: &(dyn Fn(&str, f64) + Sync)) -> Learned {
    let mut learner = Learner {
        dataset,
        rungs: vec![model.clone()],
        model,
        own,
        attempts: Vec::new(),
        progress,
    };
    let mut diagnosis = learner.diagnose();
    let stop = loop {
        if let Some(stop) = answered(&diagnosis) {
            break stop;
        }
        if learner.attempts.iter().filter(|attempt| attempt.kept).count() >= MOST_STEPS {
            break Stop::EnoughSteps;
        }
        if let Err(stop) = learner.follow(&diagnosis) {
            break stop;
        }
        diagnosis = learner.diagnose();
    };
    learner.model.fitted_on.noise_rms = Some(noise_floor(dataset).rms_um);
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

struct Learner<'a> {
    dataset: &'a Dataset,
    model: Model,
    own: &'a [UserEffect],
    attempts: Vec<Attempt>,
    rungs: Vec<Model>,
    progress: &'a (dyn Fn(&str, f64) + Sync),
}

impl Learner<'_> {
    fn diagnose(&self) -> Diagnosis {
        search(self.dataset, &self.model, self.own, &|share, effect| {
            (self.progress)(&format!("is it {effect}?"), share);
        })
    }

    /// Adds what a diagnosis names: its verdict, then what it says is missing beside that.
    fn follow(&mut self, diagnosis: &Diagnosis) -> Result<(), Stop> {
        let mut named = vec![diagnosis.verdict.clone()];
        named.extend(diagnosis.also_possible.iter().cloned());
        let verdict = self.add_and_prune(&named);
        let mut kept = matches!(verdict, Ok(true));
        // What stands behind the verdict is a weaker claim: where it fails, the next diagnosis decides.
        for effect in &diagnosis.further {
            let there = self.model.effects.iter().any(|fitted| fitted.name == *effect);
            kept |= !there && matches!(self.add_and_prune(std::slice::from_ref(effect)), Ok(true));
        }
        if kept || self.enrich(diagnosis) {
            return Ok(());
        }
        let effect = diagnosis.verdict.clone();
        Err(match verdict {
            Err(error) => Stop::CannotAdd {
                effect,
                reason: error.to_string(),
            },
            Ok(_) => Stop::NotConfirmed { effect },
        })
    }

    /// As [`Self::add_best`], then takes out what the new effect makes superfluous; whether one was kept.
    fn add_and_prune(&mut self, named: &[String]) -> Result<bool, IdentifyError> {
        let added = self.add_best(named)?;
        if let Some(effect) = &added {
            self.prune(effect);
        }
        Ok(added.is_some())
    }

    /// The diagnosis judges effects beside a hysteresis of free shape, the model must do with its own plays: where these are
    /// too poor, they hide what the effect brings, and the shape goes first.
    fn enrich(&mut self, diagnosis: &Diagnosis) -> bool {
        let shape = ["hysteresis-shape".to_owned()];
        diagnosis.shape_too_poor && diagnosis.verdict != shape[0] && matches!(self.add_best(&shape), Ok(Some(_)))
    }

    /// Tries effects that a diagnosis cannot tell apart and keeps the one that leaves least on the validation records, if
    /// these confirm it; its name.
    fn add_best(&mut self, named: &[String]) -> Result<Option<String>, IdentifyError> {
        let mut tried = Vec::new();
        let mut refused = None;
        for effect in named {
            let progress = |share| (self.progress)(&format!("adding {effect}"), share);
            let added = match self.own.iter().find(|own| own.name() == effect) {
                Some(own) => add_own_effect(self.dataset, &self.model, *own, &progress),
                None => add_effect(self.dataset, &self.model, effect, &progress),
            };
            match added {
                Ok(added) => tried.push((effect.clone(), added)),
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        let left = |added: &Added| added.after.validate_percent.unwrap_or(f64::INFINITY);
        tried.sort_by(|a, b| left(&a.1).total_cmp(&left(&b.1)));
        let Some((effect, added)) = tried.into_iter().next() else {
            return refused.map_or(Ok(None), Err);
        };
        let others = named.iter().filter(|name| **name != effect).cloned().collect();
        let kept = confirmed(&added.before, &added.after);
        self.note(&effect, others, added, kept);
        Ok(kept.then_some(effect))
    }

    /// Takes out every earlier effect that the model does not need any more, the newest kept.
    fn prune(&mut self, newest: &str) {
        let earlier: Vec<String> = self.model.effects.iter().map(|effect| effect.name.clone()).collect();
        for effect in earlier.iter().filter(|name| *name != newest) {
            let without = remove_effect(self.dataset, &self.model, effect, &|share| {
                (self.progress)(&format!("without {effect}"), share);
            });
            let Ok(without) = without else { continue };
            let as_good = |before: f64, after: f64| after <= (1.0 + SUPERFLUOUS) * before;
            if percent(&without.before)
                .zip(percent(&without.after))
                .is_some_and(|(b, a)| as_good(b, a))
            {
                self.note(effect, Vec::new(), without, true);
            }
        }
    }

    fn note(&mut self, effect: &str, also_possible: Vec<String>, step: Added, kept: bool) {
        self.attempts.push(Attempt {
            effect: effect.to_owned(),
            change: step.after.change,
            also_possible,
            before_percent: step.before.validate_percent,
            after_percent: step.after.validate_percent,
            kept,
        });
        if kept {
            self.rungs.push(step.model.clone());
            self.model = step.model;
        }
    }
}

/// Whether records that a step was not fitted to confirm it: the pooled error falls, and so it does on at least half of
/// the records that move, so that no single record decides.
fn confirmed(before: &Step, after: &Step) -> bool {
    let (Some(b), Some(a)) = (before.validate_percent, after.validate_percent) else {
        return false;
    };
    let moving = || {
        before
            .records
            .iter()
            .zip(&after.records)
            .filter(|(record, _)| record.role == Role::Validate)
            .filter_map(|(b, a)| b.percent.zip(a.percent))
    };
    let fell = moving().filter(|(b, a)| a < b).count();
    a < CONFIRMED * b && 2 * fell >= moving().count()
}
