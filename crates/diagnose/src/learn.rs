//! Learns a model by itself: fits, tries every candidate, takes what records not fitted confirm, until nothing is gained any more.

use crate::departure::departs;
use crate::diagnose::{OfRecords, conclude, controllers_delay_s, fails, odds};
use crate::diagnosis::{Before, Diagnosis, Reason, Unexplained, Verdict};
use crate::evidence::Against;
use crate::investigation::{Best, Investigation};
use crate::ladder::percent;
use crate::noise::noise_floor;
use crate::odds::Odds;
use crate::reasons;
use crate::rules::Thresholds;
use hysteron_acquisition::{Kind, inspect};
use hysteron_data::Dataset;
use hysteron_identify::add::told;
use hysteron_identify::effects::{UserEffect, find};
use hysteron_identify::search::Thinned;
use hysteron_identify::{
    Adding, Change, EffectId, EffectName, FitOptions, IdentifyError, Model, Step, add, check_own_effect, fit,
    present_step, remove,
};
use serde::Serialize;
use std::cell::LazyCell;
use std::sync::Arc;

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
    pub change: Change,
    /// Effects that a diagnosis of these records cannot tell from it.
    pub also_possible: Vec<EffectName>,
    /// Pooled error on validation records before, percent of peak to peak.
    pub before_percent: Option<f64>,
    /// The same after.
    pub after_percent: Option<f64>,
    /// Whether the model keeps it.
    pub kept: bool,
    /// Whether it helps on what was held out, without being certain enough to be named: its cause is uncertain.
    pub uncertain: bool,
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
        reasons: Vec<Reason>,
    },
    /// Structure remains that nothing in the catalogue explains.
    Unknown {
        /// What remains, and what it goes with.
        unexplained: Unexplained,
    },
    /// As many steps as are allowed.
    EnoughSteps,
}

/// Most effects that are added: no stage of this class shows more than a handful.
const MOST_STEPS: usize = 6;

/// A step that is not named must bring the error that counts below this share: chance and mimics take a tenth.
const FAR_BETTER: f64 = 0.88;

/// What is likelier than not.
const LIKELIER: f64 = 0.5;

/// A candidate that leaves less than this share of what the first one leaves goes before it.
const CLEARLY_LESS: f64 = 0.8;

/// A step that brings the error on records not fitted above this share of what it was is not kept, whatever it does to the others.
const MOST_RISE: f64 = 1.1;

/// A step without which the error rises by less than this share is superfluous.
const SUPERFLUOUS: f64 = 0.01;

/// A step that takes less than this, percent of peak to peak, is superfluous as well: a third of the least that is named.
const TAKES_NOTHING_PERCENT: f64 = 0.03;

/// A free shape that leaves less than this share of what the model's own plays leave is a step of its own.
const SHAPE_HOLDS_UP: f64 = 0.9;

/// Fits a model of this family, then adds effect after effect, as long as what was held out confirms it.
///
/// A later step may make an earlier one superfluous (a lag that stood in for a delay): such a step is taken out again. No gain
/// that is confirmed is given up: one that cannot be named with confidence stays as a step that says so.
/// `progress` is called with what is done now, and the share of it done.
///
/// # Errors
/// As [`hysteron_identify::fit()`].
/// # Cost
/// A diagnosis, and a quarter of one for each further step.
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
    go_on(dataset, model, own, progress)
}

/// Goes on from a model, as [`learn`] does.
///
/// # Errors
/// Records on which nothing moves.
pub fn learn_from(
    dataset: &Dataset,
    model: Model,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Learned, IdentifyError> {
    go_on(dataset, model, &[], progress)
}

fn go_on(
    dataset: &Dataset,
    model: Model,
    own: &[UserEffect],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Learned, IdentifyError> {
    let rig = inspect(dataset);
    let noise_um = rig.noise.rms_um;
    let reasons = reasons::of(dataset, noise_um, rig.finds(Kind::PositionLeads), &Thresholds::DEFAULT);
    let mut climb = Climb::new(dataset, model, noise_um);
    climb.take_the_controllers_delay();
    let blocking: Vec<Reason> = reasons.iter().copied().filter(|reason| reason.blocks()).collect();
    if !blocking.is_empty() {
        let diagnosis = crate::diagnose(dataset, &climb.model, &|_, _| ());
        return Ok(climb.ended(Stop::CannotTell { reasons: blocking }, diagnosis));
    }
    let thinned = Thinned::of(dataset, noise_um);
    let mut investigation = Investigation::new(&thinned, &climb.model, own, noise_um, &reasons)?;
    let start = climb.model.clone();
    let of_records = OfRecords {
        before: Before::of(&last_step(&start, dataset)),
        fails: fails(dataset, &start),
        rig: rig.kinds(),
    };
    let first_odds = |investigation: &Investigation<'_>| odds(&start, investigation, &of_records);
    let mut stop = climb.as_far_as_it_goes(&mut investigation, &first_odds, progress);
    if investigation.nothing_taken() {
        climb.shape(&investigation);
    }
    let (mut diagnosis, _) = conclude(&start, &investigation, of_records, &|_, _| ());
    // Where the model's own plays stay, its chain is no longer that of the free shape: what helps it is asked of itself.
    let settled = !climb.model.effects.is_empty();
    if stop != Stop::EnoughSteps
        && (settled || diagnosis.odds.none < LIKELIER)
        && climb.model.family != investigation.search.standing().family()
        && let Ok(mut around_own) = Investigation::around_own(&thinned, &climb.model, own, noise_um, &reasons)
    {
        if !settled {
            climb.rivals = named(&diagnosis);
            around_own.ask_only(&climb.rivals);
        }
        stop = climb.as_far_as_it_goes(&mut around_own, &|_| diagnosis.odds.clone(), progress);
        climb.shape(&investigation);
    }
    climb.prune();
    diagnosis.before = Before::of(&climb.last_step());
    after_all(&mut diagnosis, &climb.model);
    let stop = match stop {
        Stop::NothingMissing if diagnosis.verdict != Verdict::Nothing => Stop::Unknown {
            unexplained: diagnosis.unexplained.clone(),
        },
        stop => stop,
    };
    Ok(climb.ended(stop, diagnosis))
}

/// The diagnosis of the start, as it reads once its effects are in the model.
fn after_all(diagnosis: &mut Diagnosis, model: &Model) {
    let has = |name: &EffectName| model.effects.iter().any(|fitted| fitted.name == *name);
    let shaped = model.family.is_free();
    let taken = |name: &EffectName| has(name) || shaped && *name == EffectId::HysteresisShape;
    let left = &diagnosis.unexplained;
    let structured = left.percent > crate::rules::MATTERS_PERCENT && left.percent > 2.0 * left.noise_percent;
    if diagnosis.verdict.effect().is_none_or(taken) {
        diagnosis.verdict = if structured { Verdict::Unknown } else { Verdict::Nothing };
        diagnosis.also_possible.retain(|name| !taken(name));
        diagnosis.share = None;
    }
    diagnosis.further.retain(|name| !taken(name));
}

/// The effects that a verdict names, alone or as a set.
fn named(diagnosis: &Diagnosis) -> Vec<EffectName> {
    let first = diagnosis.verdict.effect().cloned();
    first
        .into_iter()
        .chain(diagnosis.also_possible.iter().cloned())
        .collect()
}

fn last_step(model: &Model, dataset: &Dataset) -> Step {
    let last = model.history.last().cloned();
    last.unwrap_or_else(|| present_step(dataset, model))
}

/// The model on its way up, and how it came about.
struct Climb<'a> {
    dataset: &'a Dataset,
    noise_um: f64,
    model: Model,
    attempts: Vec<Attempt>,
    rungs: Vec<Model>,
    /// The set of a verdict that the steps are from.
    rivals: Vec<EffectName>,
}

impl<'a> Climb<'a> {
    fn new(dataset: &'a Dataset, model: Model, noise_um: f64) -> Self {
        Self {
            dataset,
            noise_um,
            rungs: vec![model.clone()],
            model,
            attempts: Vec::new(),
            rivals: Vec::new(),
        }
    }

    fn kept(&self) -> usize {
        self.attempts.iter().filter(|attempt| attempt.kept).count()
    }

    fn adding(&self) -> Adding {
        Adding {
            noise_um: self.noise_um,
            keep_family: true,
        }
    }

    /// The delay that the recordings say is the controller's own: nothing has to be found out, the model only needs it.
    fn take_the_controllers_delay(&mut self) {
        if controllers_delay_s(self.dataset, &self.model).is_none() {
            return;
        }
        // Where the records do not confirm it, it does not matter.
        if let Ok(added) = add(
            self.dataset,
            &self.model,
            &find(EffectId::Delay),
            self.adding(),
            &|_| (),
        ) {
            let kept = percent(&added.after) < percent(&added.before);
            self.note(
                &EffectId::Delay.into(),
                Vec::new(),
                (&added.before, &added.after),
                kept,
                false,
            );
            if kept {
                self.model = added.model.clone();
                self.rungs.push(added.model);
            }
        }
    }

    /// Round after round, until the best candidate of one is not worth a step.
    fn as_far_as_it_goes(
        &mut self,
        investigation: &mut Investigation<'_>,
        odds: &dyn Fn(&Investigation<'_>) -> Odds,
        progress: &(dyn Fn(&str, f64) + Sync),
    ) -> Stop {
        let told = |share: f64, effect: &str| progress(&format!("is it {effect}?"), share);
        loop {
            let judged = investigation.round(&told);
            if self.kept() >= MOST_STEPS {
                return Stop::EnoughSteps;
            }
            match chosen(investigation, judged, odds) {
                Some(best) => self.climb(investigation, best),
                None => return Stop::NothingMissing,
            }
        }
    }

    /// Takes a candidate into the chain, and tells the step; a model of another family gets the shape as a step beside it.
    fn climb(&mut self, investigation: &mut Investigation<'_>, best: Best) {
        let effect = best.effect.name();
        let mut rivals = rivals(investigation, &best);
        // A bent sensor stands for the shape of the one loop as well.
        let of_the_loop = investigation.one_loop() && effect == EffectId::SensorNonlinearity;
        if of_the_loop {
            rivals.push(EffectId::HysteresisShape.into());
        }
        rivals.extend(self.rivals.iter().filter(|&name| *name != effect).cloned());
        let uncertain = !best.significant || of_the_loop || self.rivals.len() > 1;
        let before = self.last_step();
        let shapes = investigation.one_loop() || investigation.search.standing().family() != self.model.family;
        let of_effect = Arc::clone(&best.effect);
        investigation.take(best);
        let adding = Adding {
            keep_family: false,
            ..self.adding()
        };
        let anew = |adding: Adding| add(self.dataset, &self.model, &of_effect, adding, &|_| ()).ok();
        let shaped = if shapes { anew(adding) } else { None };
        let added = if shaped.as_ref().is_some_and(|shaped| self.departs(&shaped.model)) {
            anew(self.adding()).or(shaped)
        } else {
            shaped
        };
        let of_search = || {
            let search = &investigation.search;
            told(self.dataset, &self.model, search, &effect, before.clone())
        };
        let added = added.unwrap_or_else(of_search);
        let (was, is) = (percent(&before), percent(&added.after));
        let spoils = was.zip(is).is_some_and(|(was, is)| is > MOST_RISE * was);
        if spoils || Before::of(&added.after).pooled() > Before::of(&before).pooled() {
            self.note(&effect, rivals, (&before, &added.after), false, uncertain);
            return;
        }
        let told = self.model.history.len().max(1);
        let mut last = before;
        for step in &added.model.history[told..] {
            let is_shape = step.what.effect() != Some(&effect);
            let name = step.what.effect().cloned().unwrap_or_else(|| effect.clone());
            let also = if is_shape { Vec::new() } else { rivals.clone() };
            self.note(&name, also, (&last, step), true, uncertain && !is_shape);
            last = step.clone();
        }
        self.model = added.model.clone();
        self.rungs.push(added.model);
    }

    /// The free shape as a step of its own, where it is what holds the error up and the records determine it.
    fn shape(&mut self, investigation: &Investigation<'_>) {
        if self.model.family.is_free() || !investigation.shape_determined || investigation.one_loop() {
            return;
        }
        let shape = find(EffectId::HysteresisShape);
        let Ok(added) = add(self.dataset, &self.model, &shape, self.adding(), &|_| ()) else {
            return;
        };
        let falls = percent(&added.before).zip(percent(&added.after));
        if !falls.is_some_and(|(before, after)| after < SHAPE_HOLDS_UP * before) {
            return;
        }
        let kept = !self.departs(&added.model);
        self.note(&shape.name(), Vec::new(), (&added.before, &added.after), kept, false);
        if kept {
            self.model = added.model.clone();
            self.rungs.push(added.model);
        }
    }

    /// Takes out what a later step has made superfluous.
    fn prune(&mut self) {
        let earlier: Vec<EffectName> = self.model.effects.iter().map(|effect| effect.name.clone()).collect();
        if earlier.len() < 2 {
            return;
        }
        for effect in earlier {
            let Ok(removed) = remove(self.dataset, &self.model, &effect, self.adding()) else {
                continue;
            };
            let rise = percent(&removed.after).zip(percent(&removed.before));
            let superfluous = |(after, before): (f64, f64)| {
                after < (1.0 + SUPERFLUOUS) * before || after.powi(2) - before.powi(2) < TAKES_NOTHING_PERCENT.powi(2)
            };
            if rise.is_some_and(superfluous) {
                self.attempts.push(Attempt {
                    effect,
                    change: Change::Removed,
                    also_possible: Vec::new(),
                    before_percent: percent(&removed.before),
                    after_percent: percent(&removed.after),
                    kept: true,
                    uncertain: false,
                });
                self.model = removed.model.clone();
                self.rungs.push(removed.model);
            }
        }
    }

    /// Whether another shape of the plays says more between the recorded loops than its gain on them allows.
    fn departs(&self, shaped: &Model) -> bool {
        let error = self.last_step().identify_percent.unwrap_or(0.0);
        shaped.family != self.model.family && departs(self.dataset, &self.model, shaped, error)
    }

    fn last_step(&self) -> Step {
        last_step(&self.model, self.dataset)
    }

    fn note(
        &mut self,
        effect: &EffectName,
        also_possible: Vec<EffectName>,
        (before, after): (&Step, &Step),
        kept: bool,
        uncertain: bool,
    ) {
        self.attempts.push(Attempt {
            effect: effect.clone(),
            change: Change::Added,
            also_possible,
            before_percent: percent(before),
            after_percent: percent(after),
            kept,
            uncertain,
        });
    }

    fn ended(mut self, stop: Stop, diagnosis: Diagnosis) -> Learned {
        self.model.fitted_on.noise = Some(noise_floor(self.dataset));
        Learned {
            model: self.model,
            attempts: self.attempts,
            rungs: self.rungs,
            stop,
            diagnosis,
        }
    }
}

/// The first candidate of a round that is worth a step, unless another one leaves clearly less.
fn chosen(
    investigation: &Investigation<'_>,
    judged: Vec<Best>,
    odds: &dyn Fn(&Investigation<'_>) -> Odds,
) -> Option<Best> {
    let search = &investigation.search;
    let left = |best: &Best| search.held_out_percent(&best.trial);
    let first = LazyCell::new(|| investigation.nothing_taken().then(|| odds(investigation)));
    let mut worth: Vec<Best> = judged
        .into_iter()
        .filter(|best| {
            is_worth(investigation, best) && (best.significant || is_likely(best.candidate.against, first.as_ref()))
        })
        .collect();
    let least = (0..worth.len()).min_by(|&a, &b| left(&worth[a]).total_cmp(&left(&worth[b])))?;
    let clearly = left(&worth[least]) < CLEARLY_LESS * left(&worth[0]);
    Some(worth.swap_remove(if clearly { least } else { 0 }))
}

/// Whether a candidate that is not named may be what is missing. `first` are the probabilities where nothing was taken yet: then
/// something of the catalogue must be likelier than nothing of it.
fn is_likely(against: Option<Against>, first: Option<&Odds>) -> bool {
    !matches!(against, Some(Against::OneSine | Against::Skew)) && first.is_none_or(|odds| odds.none < LIKELIER)
}

/// Whether a candidate leaves less of what took no part in its fit: chance and mimics do so too, and what is not named must do more.
fn is_worth(investigation: &Investigation<'_>, best: &Best) -> bool {
    let search = &investigation.search;
    let standing = search.standing();
    let (before, after) = (search.held_out_percent(standing), search.held_out_percent(&best.trial));
    if best.significant {
        return after < before;
    }
    let pairs = standing.parts.iter().zip(&best.trial.parts);
    let lower = pairs.filter(|(a, b)| b.held_out_um2 < a.held_out_um2).count();
    best.candidate.statistic > 1.0
        && 2 * lower >= best.trial.parts.len()
        && after < FAR_BETTER * before
        && investigation.scale.excess(standing) > 0.05 * investigation.base_excess
}

/// What the last round does not tell from its best candidate.
fn rivals(investigation: &Investigation<'_>, best: &Best) -> Vec<EffectName> {
    let Some(round) = investigation.rounds.last() else {
        return Vec::new();
    };
    let close = crate::verdict::close(round, !investigation.shape_determined, &investigation.thresholds);
    close.into_iter().filter(|name| *name != best.effect.name()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bva_a_step_without_a_name_on_both_sides() {
        let odds = |none: f64| Odds { each: Vec::new(), none };
        assert!(is_likely(None, Some(&odds(0.49))) && !is_likely(None, Some(&odds(0.51))));
        assert!(is_likely(None, None) && is_likely(Some(Against::Physics), None));
        assert!(!is_likely(Some(Against::OneSine), None) && !is_likely(Some(Against::Skew), None));
    }
}
