//! A model's parameters moved by hand: what can be moved within which bounds, and the model with them moved.

use crate::chain_facts::facts;
use crate::effects::EffectName;
use crate::error::IdentifyError;
use crate::family::{peak_to_peak, range};
use crate::history::{present_step, record_errors, step};
use crate::model::{Change, FittedEffect, MOVED_BY_HAND, Model, Parameter, StepSubject};
use hysteron_data::Dataset;
use std::fmt;

/// Least and largest factor to the gain of the plays: beyond it is another stage.
const GAIN: [f64; 2] = [0.5, 2.0];
/// Largest change of the offset, as a share of the output's peak to peak.
const OFFSET_SHARE: f64 = 0.5;

/// What a [`Knob`] moves.
#[derive(Debug, Clone, PartialEq)]
pub enum KnobPart {
    /// A factor to the slope and to all weights of the hysteresis.
    Gain,
    /// The offset of the hysteresis.
    Offset,
    /// A parameter of an effect.
    Effect(EffectName),
}

/// A parameter of a model that a person can move.
#[derive(Debug, Clone, PartialEq)]
pub struct Knob {
    /// What it moves.
    pub part: KnobPart,
    /// Its name, as in `model.toml`; the hysteresis has `gain` and `offset`.
    pub name: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// What it is, for people.
    pub what: String,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// The value that the model has.
    pub value: f64,
}

impl Knob {
    /// `creep: share_1`, or `gain` of the hysteresis.
    pub fn full_name(&self) -> String {
        match self.effect() {
            Some(effect) => format!("{effect}: {}", self.name),
            None => self.name.clone(),
        }
    }

    /// The effect it belongs to; none of the hysteresis.
    pub fn effect(&self) -> Option<&EffectName> {
        match &self.part {
            KnobPart::Effect(effect) => Some(effect),
            KnobPart::Gain | KnobPart::Offset => None,
        }
    }
}

/// A parameter that was moved, for people.
#[derive(Debug, Clone, PartialEq)]
pub struct Turned {
    /// The parameter, with the value that it had.
    pub knob: Knob,
    /// The value that it has now.
    pub to: f64,
}

impl Turned {
    /// All that was moved, in one line.
    pub fn words(turned: &[Self]) -> String {
        let words: Vec<String> = turned.iter().map(ToString::to_string).collect();
        words.join("; ")
    }
}

impl fmt::Display for Turned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Knob { unit, value, .. } = &self.knob;
        let space = if unit.is_empty() { "" } else { " " };
        let name = self.knob.full_name();
        write!(f, "{name} from {value:.6} to {:.6}{space}{unit}", self.to)
    }
}

impl Model {
    /// What can be moved by hand: gain and offset of the hysteresis, and each parameter of its effects that a fit may choose,
    /// within the bounds that the effect has on these records. A fitted value beyond them widens them.
    pub fn knobs(&self, dataset: &Dataset) -> Vec<Knob> {
        let records = dataset.records.iter();
        let (low, high) = range(records.flat_map(|record| self.direction.output(record).iter().copied()));
        let most = OFFSET_SHARE * peak_to_peak(&[low, high]);
        let offset = self.coefficients.first().copied().unwrap_or_default();
        let of_hysteresis = |part: KnobPart, name: &str, unit: &str, what: &str, [min, max]: [f64; 2], value| Knob {
            part,
            name: name.to_owned(),
            unit: unit.to_owned(),
            what: what.to_owned(),
            min,
            max,
            value,
        };
        let output = self.direction.output_unit();
        let mut knobs = vec![
            of_hysteresis(
                KnobPart::Gain,
                "gain",
                "",
                "factor to the slope and to all weights of the hysteresis",
                GAIN,
                1.0,
            ),
            of_hysteresis(
                KnobPart::Offset,
                "offset",
                output,
                "offset of the hysteresis",
                [offset - most, offset + most],
                offset,
            ),
        ];
        let facts = facts(dataset, self.family);
        for fitted in &self.effects {
            let Some(effect) = fitted.effect() else { continue };
            let Ok(bounds) = effect.bounds(&facts) else { continue };
            let named = effect.description().parameters;
            for (k, (parameter, b)) in fitted.parameters.iter().zip(&bounds).enumerate() {
                let (min, max) = (b.min.min(parameter.value), b.max.max(parameter.value));
                if b.fitted && (max - min).is_finite() && max > min {
                    knobs.push(Knob {
                        part: KnobPart::Effect(fitted.name.clone()),
                        name: parameter.name.clone(),
                        unit: parameter.unit.clone(),
                        what: named.get(k).map_or("", |named| named.what).to_owned(),
                        min,
                        max,
                        value: parameter.value,
                    });
                }
            }
        }
        knobs
    }

    /// The model with its parameters at other values, one for each of its [`Self::knobs`]; for a picture, so its history and its
    /// standard errors stay.
    ///
    /// # Errors
    /// Another number of values, or one outside its bounds.
    pub fn moved(&self, knobs: &[Knob], values: &[f64]) -> Result<Self, IdentifyError> {
        if values.len() != knobs.len() {
            return Err(IdentifyError::Moved(format!(
                "{} values for {} parameters; give one for each",
                values.len(),
                knobs.len()
            )));
        }
        let mut moved = self.clone();
        for (knob, &value) in knobs.iter().zip(values) {
            // A NaN fails every comparison.
            if !(value >= knob.min && value <= knob.max) {
                return Err(IdentifyError::Moved(format!(
                    "{} = {value}: allowed are {:.6} to {:.6} {}",
                    knob.full_name(),
                    knob.min,
                    knob.max,
                    knob.unit
                )));
            }
            moved.set(knob, value);
        }
        Ok(moved)
    }

    fn set(&mut self, knob: &Knob, value: f64) {
        let mut coefficients = self.coefficients.iter_mut();
        match &knob.part {
            KnobPart::Gain => coefficients.skip(1).for_each(|c| *c *= value),
            KnobPart::Offset => coefficients.next().into_iter().for_each(|c| *c = value),
            KnobPart::Effect(effect) => {
                named(&mut self.effects, effect, &knob.name).for_each(|parameter| parameter.value = value)
            }
        }
    }

    /// The model moved, to be kept: what was moved has no standard error any more, the history and the notices say so.
    ///
    /// # Errors
    /// As [`Self::moved`]; values that are all the model's own.
    pub fn moved_to_keep(&self, dataset: &Dataset, values: &[f64]) -> Result<(Self, Vec<Turned>), IdentifyError> {
        let knobs = self.knobs(dataset);
        let mut moved = self.moved(&knobs, values)?;
        let pairs = knobs.into_iter().zip(values);
        let turned: Vec<Turned> = pairs
            .filter(|(knob, to)| knob.value != **to)
            .map(|(knob, &to)| Turned { knob, to })
            .collect();
        if turned.is_empty() {
            return Err(IdentifyError::Moved(
                "every parameter stands where it was fitted; move one before the model is kept".to_owned(),
            ));
        }
        for Turned { knob, .. } in &turned {
            moved.forget_error(knob);
        }
        moved
            .notices
            .push(format!("{MOVED_BY_HAND}: {}", Turned::words(&turned)));
        if moved.history.is_empty() {
            moved.history.push(present_step(dataset, self));
        }
        let subject = StepSubject::Family(self.family);
        let errors = record_errors(dataset, &moved);
        moved.history.push(step(Change::Moved, subject, errors));
        Ok((moved, turned))
    }

    fn forget_error(&mut self, knob: &Knob) {
        let mut errors = self.standard_errors.iter_mut();
        match &knob.part {
            KnobPart::Gain => errors.skip(1).for_each(|error| *error = None),
            KnobPart::Offset => errors.next().into_iter().for_each(|error| *error = None),
            KnobPart::Effect(effect) => {
                named(&mut self.effects, effect, &knob.name).for_each(|parameter| parameter.standard_error = None);
            }
        }
    }
}

/// The parameters of an effect that have a name.
fn named<'a>(
    effects: &'a mut [FittedEffect],
    effect: &'a EffectName,
    name: &'a str,
) -> impl Iterator<Item = &'a mut Parameter> {
    let of_it = effects.iter_mut().filter(move |fitted| fitted.name == *effect);
    of_it
        .flat_map(|fitted| &mut fitted.parameters)
        .filter(move |parameter| parameter.name == name)
}
