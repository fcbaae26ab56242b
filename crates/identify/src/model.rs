//! A fitted model as data: parameters with standard errors, what it was fitted on, how it came about.

use crate::covered::Covered;
use crate::effects::{Effect, EffectFile, EffectName, Family, UserEffect};
use crate::family::Direction;
use crate::objective::Weighting;
use crate::placement::Placement;
use crate::start_state::InitialState;
use hysteron_acquisition::NoiseFloor;
use hysteron_core::envelope::Envelope;
use hysteron_data::Role;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::sync::Arc;

/// How parameters are searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Separable least squares: weights in closed form, outer search over alpha and beta. Deterministic.
    Separable,
    /// The paper's modified particle swarm over all parameters.
    Mpso,
}

/// A fitted hysteresis model.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Which model.
    pub family: Family,
    /// Which way it runs.
    pub direction: Direction,
    /// Thresholds of the plays, ascending, input unit.
    pub thresholds: Vec<f64>,
    /// Alpha and beta, MRPI only.
    pub envelope: Option<Envelope<f64>>,
    /// Their standard errors, seconds.
    pub envelope_errors: Option<[f64; 2]>,
    /// Offset, input function, plays; see [`Model::parameters`] for names and units.
    pub coefficients: Vec<f64>,
    /// Standard error of each coefficient, `None` where the data determine only combinations.
    pub standard_errors: Vec<Option<f64>>,
    /// Smallest input in the records it was fitted on.
    pub input_min: f64,
    /// Largest input in the records it was fitted on.
    pub input_max: f64,
    /// The effects around the hysteresis, in the order of the chain; none in a model of the hysteresis alone.
    pub effects: Vec<FittedEffect>,
    /// How the model came about, step by step; empty until an effect is added.
    pub history: Vec<Step>,
    /// What it was fitted on, and how.
    pub fitted_on: FittedOn,
    /// What its records cover.
    pub covered: Covered,
    /// What the user should know of the fit.
    pub notices: Vec<String>,
}

/// A record simulated freely.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// Modelled output, the model's output unit.
    pub output: Vec<f64>,
    /// The state the record's start was taken in.
    pub initial: InitialState,
    /// What the slow states of the effects held beyond the first position before the record, micrometres; 0 where they rested.
    pub remembered_um: f64,
}

impl Simulation {
    /// Whether a number of the start's state was chosen to fit.
    pub fn estimated(&self) -> bool {
        matches!(self.initial, InitialState::Remanent { fraction } if fraction != 0.0) || self.remembered_um != 0.0
    }

    /// The state that the record's start was taken in, in words.
    pub fn start(&self) -> String {
        if self.remembered_um == 0.0 {
            return self.initial.to_string();
        }
        format!("{}, slow states hold {:+.3} um", self.initial, self.remembered_um)
    }
}

/// What a model was fitted on, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FittedOn {
    /// Name of the dataset.
    pub dataset: String,
    /// How parameters were searched.
    pub method: Method,
    /// How records were weighed.
    pub weighting: Weighting,
    /// How thresholds were placed.
    pub placement: Placement,
    /// Seed of the swarm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Ridge on the scaled columns; of a free shape, how strongly it is held to a smooth one: the cost of a departure by the whole
    /// stroke, where a record costs 1 with what is left of it.
    pub ridge: f64,
    /// Noise floor of the records; known once a step of the history has been measured against it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseFloor>,
    /// The records.
    #[serde(rename = "record", default)]
    pub records: Vec<FittedRecord>,
}

/// A record that a model was fitted on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FittedRecord {
    /// Its file.
    pub file: String,
    /// Its samples.
    pub samples: usize,
    /// Its sample rate, hertz.
    pub sample_rate_hz: f64,
    /// The state its start was taken in.
    pub initial_state: String,
    /// First sample fitted: before it the output depends on what was before the record.
    pub fitted_from: usize,
    /// Weight of its squared errors.
    pub weight: f64,
}

/// An effect of a model's chain, with its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FittedEffect {
    /// Name in the catalogue, or in the effect file.
    pub name: EffectName,
    /// Its parameters, in the order of the catalogue or the effect file.
    #[serde(rename = "parameter")]
    pub parameters: Vec<Parameter>,
    /// The effect file, where it is one of the user's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub definition: Option<EffectFile>,
}

impl FittedEffect {
    /// The effect itself; `None` where neither the catalogue nor a definition has it.
    pub fn effect(&self) -> Option<Arc<dyn Effect>> {
        match &self.definition {
            Some(file) => Some(UserEffect::of(file).ok()?.effect()),
            None => self.name.id().map(|id| id.effect()),
        }
    }

    /// The effect where it is one of the user's own.
    pub fn own(&self) -> Option<UserEffect> {
        self.definition.as_ref().and_then(|file| UserEffect::of(file).ok())
    }
}

/// What a step of a model's history is called where parameters were moved.
pub const MOVED_BY_HAND: &str = "moved by hand";

/// What a step of a model's history did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Change {
    /// A hysteresis family was fitted.
    Fitted,
    /// An effect was added, everything fitted anew.
    Added,
    /// An effect was taken out again, everything fitted anew.
    Removed,
    /// Parameters were moved by hand, nothing was fitted.
    Moved,
}

/// What a step was about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StepSubject {
    /// A hysteresis family that was fitted.
    Family(Family),
    /// An effect that was added or removed.
    Effect(EffectName),
}

impl StepSubject {
    /// The name as it stands in files.
    pub fn as_str(&self) -> &str {
        match self {
            Self::Family(family) => family.name(),
            Self::Effect(name) => name.as_str(),
        }
    }

    /// The effect; `None` where a family was fitted.
    pub fn effect(&self) -> Option<&EffectName> {
        match self {
            Self::Family(_) => None,
            Self::Effect(name) => Some(name),
        }
    }
}

impl std::fmt::Display for StepSubject {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.as_str())
    }
}

impl Serialize for StepSubject {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for StepSubject {
    /// No effect has the name of a family.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let family = Family::ALL.into_iter().find(|family| family.name() == name);
        Ok(family.map_or_else(|| Self::Effect(EffectName::of(&name)), Self::Family))
    }
}

/// One step of a model's history: what was fitted, added or removed, and the errors it left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// What was done.
    pub change: Change,
    /// The effect; the hysteresis family where one was fitted.
    pub what: StepSubject,
    /// Pooled error (eq. 19) on the records it was fitted to, percent of peak to peak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identify_percent: Option<f64>,
    /// Pooled error on validation records, percent of peak to peak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validate_percent: Option<f64>,
    /// Each record's error.
    #[serde(rename = "record", default)]
    pub records: Vec<RecordError>,
}

/// The error of a model on one record, free simulation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordError {
    /// The record's file.
    pub file: String,
    /// Its role.
    pub role: Role,
    /// Error, rms, output unit.
    pub rms: f64,
    /// Error over peak to peak (eq. 19), percent; absent where the drive stands still.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub percent: Option<f64>,
    /// Error over the output's own rms about its mean, percent; absent where the drive stands still.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_percent: Option<f64>,
    /// The same of the last period alone, error and output each about its mean; absent where the drive is not periodic
    /// from the first sample on. A drift from period to period does not count in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_period_percent: Option<f64>,
}

/// A named parameter with its unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Name, with the play's number from 1 where it belongs to one: `weight[3]`.
    pub name: String,
    /// Unit, such as `um/V`.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// Standard error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_error: Option<f64>,
}

impl Model {
    /// Name and unit of each coefficient, in order.
    fn names(&self) -> Vec<(String, String)> {
        let (input, output) = (self.direction.input_unit(), self.direction.output_unit());
        let slope = |power: i32| match power {
            1 => format!("{output}/{input}"),
            _ => format!("{output}/{input}^{power}"),
        };
        let mut names = vec![("offset".to_owned(), output.to_owned())];
        for &power in self.family.input_powers() {
            let name = match power {
                1 => "linear".to_owned(),
                2 => "quadratic".to_owned(),
                3 => "cubic".to_owned(),
                _ => format!("power{power}"),
            };
            names.push((name, slope(power)));
        }
        let of_plays: &[(&str, String)] = match self.family {
            Family::Pi | Family::Mpi | Family::Mrpi => &[("weight", slope(1))],
            Family::Wrpi => &[("weight", slope(1)), ("rate_weight", format!("{output} s/{input}^2"))],
            Family::PlayPolynomial | Family::Duhem => &[
                ("weight", slope(1)),
                ("weight_quadratic", slope(2)),
                ("weight_cubic", slope(3)),
            ],
        };
        for (name, unit) in of_plays {
            names.extend((1..=self.thresholds.len()).map(|i| (format!("{name}[{i}]"), unit.clone())));
        }
        names
    }

    /// Largest rms error on a record by its history, output unit, with some of its effects left out: of the last step and of those before
    /// these were added; none without a history.
    pub fn largest_error_without(&self, left_out: &[&EffectName]) -> Option<f64> {
        let adds =
            |step: &Step| step.change == Change::Added && step.what.effect().is_some_and(|e| left_out.contains(&e));
        let before = self.history.windows(2).filter(|steps| adds(&steps[1]));
        let steps = before.map(|steps| &steps[0]).chain(self.history.last());
        let records = steps.flat_map(|step| &step.records);
        records.map(|record| record.rms).max_by(f64::total_cmp)
    }

    /// All parameters but the thresholds, with names and units: offset, input function, plays, alpha and beta.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut parameters: Vec<Parameter> = self
            .names()
            .into_iter()
            .zip(&self.coefficients)
            .zip(&self.standard_errors)
            .map(|(((name, unit), &value), &standard_error)| Parameter {
                name,
                unit,
                value,
                standard_error,
            })
            .collect();
        if let Some(envelope) = self.envelope {
            let errors = self.envelope_errors.map_or([None; 2], |errors| errors.map(Some));
            for (name, value, standard_error) in [
                ("alpha", envelope.alpha_s, errors[0]),
                ("beta", envelope.beta_s, errors[1]),
            ] {
                parameters.push(Parameter {
                    name: name.to_owned(),
                    unit: "s".to_owned(),
                    value,
                    standard_error,
                });
            }
        }
        parameters
    }
}
