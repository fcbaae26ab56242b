//! Adds an effect to a model, or takes one out: everything fitted anew, errors before and after on every record.

use crate::effects::{Effect, EffectName, FREE_SHAPE, Shape as Reshaped, UserEffect};
use crate::error::IdentifyError;
use crate::family::Direction;
use crate::history::{self, record_errors};
use crate::loops::one_loop;
use crate::model::{Change, Model, Step, StepSubject};
use crate::placement::free_thresholds;
use crate::search::{Refused, Search, Shape, Thinned};
use hysteron_data::{Dataset, Record, Role};
use std::sync::Arc;

/// What adding an effect did.
#[derive(Debug, Clone, PartialEq)]
pub struct Added {
    /// The new model, with the step in its history.
    pub model: Model,
    /// Errors of the model it was added to.
    pub before: Step,
    /// Errors of the new model.
    pub after: Step,
}

/// How an effect is added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adding {
    /// Noise of the readings, micrometres rms: errors below it are not fitted to.
    pub noise_um: f64,
    /// Whether the model's own family of plays stays, even where its shape is what holds the error up.
    pub keep_family: bool,
}

/// A free shape that leaves less than this share of what the model's own plays leave, both with the effect, is a step of
/// its own before it.
const SHAPE_HOLDS_UP: f64 = 0.9;

/// Adds an effect to a model and fits all parameters anew. `progress` is called with the share done, 0 to 1.
///
/// Where the model's plays are too poor for the loops, and hide what the effect brings, `hysteresis-shape` becomes a step of
/// its own before it, unless the family is to be kept or the records show [one loop](one_loop).
///
/// Deterministic: starts from the effect's own list, follows the best of them.
///
/// # Errors
/// - An effect that the model has already, or that these records cannot show.
/// - A model of direction inverse, no record to identify.
///
/// # Cost
/// Some fifty passes over the records; below a second for 60 000 samples.
pub fn add(
    dataset: &Dataset,
    model: &Model,
    effect: &Arc<dyn Effect>,
    adding: Adding,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    add_held(dataset, model, effect, &[], adding, progress)
}

/// As [`add`], with some of the effect's parameters held at what was seen of it without a model: a stretch of a record that the
/// fit leaves out, because its plays have not settled, may show a ring all the same.
///
/// # Errors
/// As [`add`].
pub fn add_held(
    dataset: &Dataset,
    model: &Model,
    effect: &Arc<dyn Effect>,
    held: &[(&str, f64)],
    adding: Adding,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    let name = effect.name();
    let refuse = |reason: String| IdentifyError::EffectRefused {
        effect: name.clone(),
        reason,
    };
    if model.direction == Direction::Inverse {
        return Err(refuse(
            "the model runs from position to voltage; fit one with the direction forward".to_owned(),
        ));
    }
    if dataset.with_role(Role::Identify).next().is_none() {
        return Err(IdentifyError::NothingToFit);
    }
    let before = history::present_step(dataset, model);
    progress(0.1);
    let thinned = Thinned::of(dataset, adding.noise_um);
    if name == FREE_SHAPE && !model.family.is_free() {
        let search = Search::free(&thinned, model, adding.noise_um)?;
        return Ok(told(dataset, model, &search, &name, before));
    }
    let own = Search::new(&thinned, model, &Shape::Own, adding.noise_um)?;
    if effect.bounds(own.facts()).map_err(refuse)?.is_empty() {
        let reshaped = reshaped(dataset, model, effect, &own)
            .ok_or_else(|| refuse("the model's family of plays has it already".to_owned()))?;
        let search = Search::new(&thinned, &reshaped, &Shape::Own, adding.noise_um)?;
        return Ok(told(dataset, model, &search, &name, before));
    }
    progress(0.3);
    let refused = |refused: Refused| match refused {
        Refused::There => refuse("the model has it already".to_owned()),
        Refused::Cannot(reason) => refuse(reason),
    };
    let of_own = own.candidate_held(effect, held);
    progress(0.5);
    let free = if model.family.is_free() || adding.keep_family || one_loop(dataset) {
        None
    } else {
        Search::free(&thinned, model, adding.noise_um).ok()
    };
    progress(0.6);
    let of_own = of_own.map(|trial| {
        let mut own = own;
        own.stand_on(trial);
        told(dataset, model, &own, &name, before.clone())
    });
    let of_free = free.map(|free| free.candidate_on_either(effect, held));
    progress(0.8);
    let added = match (of_own, of_free) {
        (Ok(own), Some(Ok((trial, mut free)))) => {
            // The step that lets the error fall at once goes first: an effect that is missing can spoil a shape that is free.
            let shape = told(dataset, model, &free, &FREE_SHAPE.into(), before.clone());
            let (step, last) = if counts(&shape.after) <= counts(&before) {
                (shape, &name)
            } else {
                (own.clone(), &FREE_SHAPE.into())
            };
            free.stand_on(trial);
            let shaped = told(dataset, &step.model, &free, last, step.after);
            // Validation records alone do not tell: they may know nothing of what the fitted ones begin with.
            let no_worse = shaped.after.identify_percent <= own.after.identify_percent;
            if no_worse && counts(&shaped.after) < SHAPE_HOLDS_UP * counts(&own.after) {
                shaped
            } else {
                own
            }
        }
        (Err(_), Some(Ok((trial, mut free)))) => {
            let step = told(dataset, model, &free, &FREE_SHAPE.into(), before.clone());
            free.stand_on(trial);
            told(dataset, &step.model, &free, &name, step.after)
        }
        (Ok(own), _) => own,
        (Err(reason), _) => return Err(refused(reason)),
    };
    progress(1.0);
    Ok(Added { before, ..added })
}

/// The error that counts: on validation records, else on those that were fitted; percent.
fn counts(step: &Step) -> f64 {
    step.validate_percent.or(step.identify_percent).unwrap_or(f64::INFINITY)
}

/// Takes an effect out of a model again and fits all other parameters anew.
///
/// # Errors
/// - An effect that is not in the model's chain; a change of the hysteresis family cannot be taken back.
/// - No record to identify.
pub fn remove(dataset: &Dataset, model: &Model, name: &EffectName, adding: Adding) -> Result<Added, IdentifyError> {
    if !model.effects.iter().any(|fitted| fitted.name == *name) {
        return Err(IdentifyError::EffectNotThere { effect: name.clone() });
    }
    let mut without = model.clone();
    without.effects.retain(|fitted| fitted.name != *name);
    let thinned = Thinned::of(dataset, adding.noise_um);
    let search = Search::new(&thinned, &without, &Shape::Own, adding.noise_um)?;
    let before = history::present_step(dataset, model);
    Ok(step(dataset, model, &search, Change::Removed, name, before))
}

/// Refuses a dataset that lacks a column which the equations of an effect file need.
///
/// # Errors
/// - `temperature` without a temperature in every record that is fitted.
/// - `v2` where the other axis stands still in all of them.
pub fn check_own_effect(effect: UserEffect, dataset: &Dataset) -> Result<(), IdentifyError> {
    let records = || dataset.with_role(Role::Identify);
    let moves = |record: &Record| {
        let axis = record.voltage2_v.as_deref();
        axis.is_some_and(|axis| axis.iter().any(|v| *v != axis[0]))
    };
    let with_temperature = records().all(|record| record.temperature_c.is_some());
    effect
        .needs(with_temperature, records().any(moves))
        .map_err(|reason| IdentifyError::EffectRefused {
            effect: effect.name(),
            reason,
        })
}

/// The standing chain of a search as a model, the last effect of it told in its history.
pub fn told(dataset: &Dataset, from: &Model, search: &Search<'_>, effect: &EffectName, before: Step) -> Added {
    step(dataset, from, search, Change::Added, effect, before)
}

fn step(
    dataset: &Dataset,
    from: &Model,
    search: &Search<'_>,
    change: Change,
    effect: &EffectName,
    before: Step,
) -> Added {
    let mut new = search.model();
    let after = history::step(
        change,
        StepSubject::Effect(effect.clone()),
        record_errors(dataset, &new),
    );
    new.history.clone_from(&from.history);
    if new.history.is_empty() {
        new.history.push(before.clone());
    }
    new.history.push(after.clone());
    new.cover(dataset);
    Added {
        model: new,
        before,
        after,
    }
}

/// The model with another shape of its plays, where the effect is one.
fn reshaped(dataset: &Dataset, model: &Model, effect: &Arc<dyn Effect>, own: &Search<'_>) -> Option<Model> {
    let place = |plays: usize| {
        let inputs: Vec<&[f64]> = dataset
            .with_role(Role::Identify)
            .map(|record| record.voltage_v.as_slice())
            .collect();
        free_thresholds(plays, &inputs)
    };
    let shape = effect.reshape(
        &Reshaped {
            family: model.family,
            thresholds: model.thresholds.clone(),
        },
        own.facts(),
        &place,
    )?;
    let mut reshaped = model.clone();
    (reshaped.family, reshaped.thresholds) = (shape.family, shape.thresholds);
    Some(reshaped)
}
