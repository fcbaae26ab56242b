//! What `learn` does with a model between two diagnoses: adds, takes out, tries again.

use crate::diagnosis::Diagnosis;
use crate::ladder::percent;
use crate::learn::{Attempt, Stop};
use crate::missing::{controllers_delay_s, physical, search};
use hysteron_data::{Dataset, Role};
use hysteron_identify::effects::{Effect as _, UserEffect};
use hysteron_identify::{
    Added, EffectId, EffectName, IdentifyError, Model, Step, add_effect, add_own_effect, remove_effect,
};
use rayon::prelude::*;

/// A step must bring the pooled validation error below this share of what it was; less does not matter.
const CONFIRMED: f64 = 0.97;

/// A step without which the validation error rises by less than this share is superfluous.
const SUPERFLUOUS: f64 = 0.01;

/// A step that no diagnosis names must bring the error below this share: chance and mimics take a tenth, one of two effects of
/// like size three tenths.
const FAR_BETTER: f64 = 0.75;

/// An effect that was taken out comes back beside what displaced it where it brings the error below this share.
const BESIDE: f64 = 0.9;

/// The model on its way, and how it came about.
pub(crate) struct Learner<'a> {
    dataset: &'a Dataset,
    own: &'a [UserEffect],
    progress: &'a (dyn Fn(&str, f64) + Sync),
    pub(crate) model: Model,
    pub(crate) attempts: Vec<Attempt>,
    pub(crate) rungs: Vec<Model>,
    /// Effects that were taken out, each with the one that made it superfluous.
    displaced: Vec<[EffectName; 2]>,
    trial: Option<Trial>,
}

/// Where no diagnosis could name anything, and an effect was added on trial.
struct Trial {
    rungs: usize,
    attempts: usize,
    diagnosis: Diagnosis,
}

impl<'a> Learner<'a> {
    pub(crate) fn new(
        dataset: &'a Dataset,
        model: Model,
        own: &'a [UserEffect],
        progress: &'a (dyn Fn(&str, f64) + Sync),
    ) -> Self {
        Self {
            dataset,
            own,
            progress,
            rungs: vec![model.clone()],
            model,
            attempts: Vec::new(),
            displaced: Vec::new(),
            trial: None,
        }
    }

    /// How many attempts were kept.
    pub(crate) fn kept(&self) -> usize {
        self.attempts.iter().filter(|attempt| attempt.kept).count()
    }

    pub(crate) fn diagnose(&self) -> Diagnosis {
        search(self.dataset, &self.model, self.own, &|share, effect| {
            (self.progress)(&format!("is it {effect}?"), share);
        })
    }

    /// The delay that the recordings say is the controller's own: nothing has to be found out, the model only needs it.
    pub(crate) fn take_the_controllers_delay(&mut self) {
        if controllers_delay_s(self.dataset, &self.model).is_some() {
            // Where the records do not confirm it, it does not matter.
            let _ = self.add_and_prune(&[EffectId::Delay.into()]);
        }
    }

    /// Adds what a diagnosis names: its verdict, then what it says is missing beside that.
    pub(crate) fn follow(&mut self, diagnosis: &Diagnosis) -> Result<(), Stop> {
        let named: Vec<EffectName> = [&diagnosis.verdict]
            .into_iter()
            .chain(&diagnosis.also_possible)
            .map(|name| EffectName::of(name))
            .collect();
        let verdict = self.add_and_prune(&named);
        let mut kept = matches!(verdict, Ok(true));
        // What stands behind the verdict is a weaker claim: where it fails, the next diagnosis decides.
        for effect in diagnosis.further.iter().map(|name| EffectName::of(name)) {
            kept |= !self.has(&effect) && matches!(self.add_and_prune(std::slice::from_ref(&effect)), Ok(true));
        }
        if kept || self.enrich(diagnosis) {
            return Ok(());
        }
        let effect = EffectName::of(&diagnosis.verdict);
        Err(match verdict {
            Err(error) => Stop::CannotAdd {
                effect,
                reason: error.to_string(),
            },
            Ok(_) => Stop::NotConfirmed { effect },
        })
    }

    /// As [`Self::add_best`], then takes out what the new effect makes superfluous; whether one was kept.
    fn add_and_prune(&mut self, named: &[EffectName]) -> Result<bool, IdentifyError> {
        let added = self.add_best(named)?;
        if let Some(effect) = &added {
            self.prune(effect);
        }
        Ok(added.is_some())
    }

    /// The diagnosis judges effects beside a hysteresis of free shape, the model must do with its own plays: where these are
    /// too poor, they hide what the effect brings, and the shape goes first.
    fn enrich(&mut self, diagnosis: &Diagnosis) -> bool {
        let shape = EffectName::from(EffectId::HysteresisShape);
        diagnosis.shape_too_poor
            && diagnosis.verdict != shape.as_str()
            && matches!(self.add_best(&[shape]), Ok(Some(_)))
    }

    /// Where no diagnosis names anything: a richer shape where that is wanting, then what makes the model forecast far better.
    pub(crate) fn go_on_unknown(&mut self, diagnosis: &Diagnosis) -> bool {
        self.enrich(diagnosis) || self.try_without_a_name(diagnosis)
    }

    /// A free shape bends to what two effects do together, and then finds too little in each of them; the model's own plays
    /// bend less. What a trial so begins is kept if it leaves nothing unexplained, see [`Self::take_back`].
    fn try_without_a_name(&mut self, diagnosis: &Diagnosis) -> bool {
        // Drift and hum have numbers of every record's own to hide behind, and are seen without any model.
        let effects: Vec<EffectName> = physical()
            .map(EffectName::of)
            .filter(|effect| !SEEN_WITHOUT_A_MODEL.iter().any(|seen| effect == seen) && !self.has(effect))
            .collect();
        let tried: Vec<Option<Added>> = effects
            .par_iter()
            .with_max_len(1)
            .map(|effect| self.added(effect).ok())
            .collect();
        let mut best: Option<(EffectName, Added)> = None;
        for (effect, added) in effects.into_iter().zip(tried) {
            let Some(added) = added else { continue };
            if best.as_ref().is_none_or(|(_, best)| left(&added) < left(best)) {
                best = Some((effect, added));
            }
        }
        let Some((effect, added)) = best.filter(|(_, added)| {
            confirmed(&added.before, &added.after) && left(added) < FAR_BETTER * percent(&added.before).unwrap_or(0.0)
        }) else {
            return false;
        };
        self.trial.get_or_insert_with(|| Trial {
            rungs: self.rungs.len(),
            attempts: self.attempts.len(),
            diagnosis: diagnosis.clone(),
        });
        self.note(&effect, Vec::new(), added, true);
        true
    }

    /// Gives up what was tried without a name, as structure remains with it too; the diagnosis of what is left.
    pub(crate) fn take_back(&mut self) -> Option<Diagnosis> {
        let trial = self.trial.take()?;
        self.rungs.truncate(trial.rungs);
        self.model.clone_from(self.rungs.last()?);
        self.attempts[trial.attempts..]
            .iter_mut()
            .for_each(|attempt| attempt.kept = false);
        Some(trial.diagnosis)
    }

    /// Steps were chosen while the shape was too poor for a fair comparison: what was taken out is tried again, beside what
    /// displaced it and in its place; what moves the plays in time, in the place of what looks like it. Whether one is back.
    pub(crate) fn put_back(&mut self) -> bool {
        let mut pairs: Vec<([EffectName; 2], bool)> = self.displaced.drain(..).map(|pair| (pair, true)).collect();
        for holder in IN_TIME {
            let rivals = IN_TIME.iter().filter(|rival| **rival != holder);
            pairs.extend(rivals.map(|rival| ([(*rival).into(), holder.into()], false)));
        }
        let mut back = false;
        for ([rival, holder], may_stand_beside) in pairs {
            if self.has(&rival) || !self.has(&holder) {
                continue;
            }
            let Ok(both) = self.added(&rival) else { continue };
            let before = percent(&both.before).unwrap_or(0.0);
            let exchanged = remove_effect(self.dataset, &both.model, &holder, &|_| {})
                .ok()
                .filter(|exchanged| left(exchanged) < (1.0 - SUPERFLUOUS) * before);
            let beside = may_stand_beside && left(&both) < BESIDE * exchanged.as_ref().map_or(before, left);
            if beside || exchanged.is_some() {
                back = true;
                self.note(&rival, Vec::new(), both, true);
            }
            if let Some(exchanged) = exchanged.filter(|_| !beside) {
                self.note(&holder, Vec::new(), exchanged, true);
            }
        }
        back
    }

    fn has(&self, effect: &EffectName) -> bool {
        self.model.effects.iter().any(|fitted| fitted.name == *effect)
    }

    /// The model with another effect.
    fn added(&self, effect: &EffectName) -> Result<Added, IdentifyError> {
        let progress = |share| (self.progress)(&format!("adding {effect}"), share);
        match self.own.iter().find(|own| own.name() == *effect) {
            Some(own) => add_own_effect(self.dataset, &self.model, *own, &progress),
            None => add_effect(self.dataset, &self.model, effect.as_str().parse()?, &progress),
        }
    }

    /// Tries effects that a diagnosis cannot tell apart and keeps the one that leaves least on the validation records, if
    /// these confirm it; its name.
    fn add_best(&mut self, named: &[EffectName]) -> Result<Option<EffectName>, IdentifyError> {
        let mut tried = Vec::new();
        let mut refused = None;
        for effect in named {
            match self.added(effect) {
                Ok(added) => tried.push((effect.clone(), added)),
                Err(error) => refused = refused.or(Some(error)),
            }
        }
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
    fn prune(&mut self, newest: &EffectName) {
        let earlier: Vec<EffectName> = self.model.effects.iter().map(|effect| effect.name.clone()).collect();
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
                self.displaced.push([effect.clone(), newest.clone()]);
            }
        }
    }

    fn note(&mut self, effect: &EffectName, also_possible: Vec<EffectName>, step: Added, kept: bool) {
        self.attempts.push(Attempt {
            effect: effect.clone(),
            change: step.after.change,
            also_possible,
            before_percent: step.before.validate_percent,
            after_percent: step.after.validate_percent,
            kept,
            on_trial: kept && self.trial.is_some(),
        });
        if kept {
            self.rungs.push(step.model.clone());
            self.model = step.model;
        }
    }
}

/// Effects that are not tried without a name.
const SEEN_WITHOUT_A_MODEL: [EffectId; 2] = [EffectId::ThermalDrift, EffectId::MainsHum];

/// Effects that look like each other where plays are too few: all of them delay a slow sine by the same time.
const IN_TIME: [EffectId; 3] = [EffectId::Delay, EffectId::FirstOrderLag, EffectId::RateDependence];

/// What a step leaves on the records it was not fitted to.
fn left(step: &Added) -> f64 {
    step.after.validate_percent.unwrap_or(f64::INFINITY)
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
