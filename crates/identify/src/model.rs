//! A fitted model: parameters with standard errors, what it was fitted on, free simulation.

use crate::chain::{Chain, Link};
use crate::chain_fit;
use crate::chain_trace::Trace;
use crate::columns::{Design, Run};
use crate::effects::{self, Effect, EffectFile, UserEffect};
use crate::error::IdentifyError;
use crate::family::{Direction, Family};
use crate::fit::Method;
use crate::initial::{self, InitialState};
use crate::objective::{Weighting, run_of};
use crate::placement::Placement;
use hysteron_core::envelope::Envelope;
use hysteron_data::{Record, Role};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

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
    /// What the user should know of the fit.
    pub notices: Vec<String>,
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
    /// Ridge on the scaled columns.
    pub ridge: f64,
    /// Noise floor of the records, output unit, rms; known once a step of the history has been measured against it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_rms: Option<f64>,
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
    pub name: String,
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
            None => effects::find(&self.name),
        }
    }

    /// The effect where it is one of the user's own.
    pub fn own(&self) -> Option<UserEffect> {
        self.definition.as_ref().and_then(|file| UserEffect::of(file).ok())
    }
}

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
}

/// One step of a model's history: what was fitted, added or removed, and the errors it left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// What was done.
    pub change: Change,
    /// The effect; the hysteresis family where one was fitted.
    pub what: String,
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

/// A record simulated freely.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// Modelled output, the model's output unit.
    pub output: Vec<f64>,
    /// The state the record's start was taken in.
    pub initial: InitialState,
}

impl Model {
    /// Runs the model freely over a record (never one step ahead: the measured output is used for nothing but the state
    /// before the first sample, one number, chosen where the drive does not give it).
    ///
    /// # Cost
    /// O(samples x plays); a record that does not start periodically costs about 25 runs more for its initial state.
    pub fn simulate(&self, record: &Record) -> Simulation {
        if let Some(chain) = self.chain() {
            return chain_fit::simulate(&chain, &self.coefficients, record);
        }
        let mut run = run_of(record, self.direction, None);
        let design = self.design();
        run.initial = initial::choose(&design, &self.coefficients, &run);
        self.simulate_from(&design, &run)
    }

    /// As [`Self::simulate`] of a record that is known to begin at rest at the low end of its drive.
    pub(crate) fn simulate_from_rest(&self, record: &Record) -> Vec<f64> {
        let rest = InitialState::Remanent { fraction: 0.0 };
        if let Some(chain) = self.chain() {
            return chain_fit::simulate_from(&chain, &self.coefficients, record, rest);
        }
        let mut run = run_of(record, self.direction, None);
        run.initial = rest;
        self.simulate_from(&self.design(), &run).output
    }

    /// The mains hum of the model in a record, micrometres, its phases as the record has them; `None` where the model has none.
    ///
    /// # Cost
    /// As [`Self::simulate`].
    pub fn hum_um(&self, record: &Record) -> Option<Vec<f64>> {
        let chain = self.chain()?;
        let is_hum = |link: &Link| link.effect.description().name == "mains-hum";
        let hum = chain.links.iter().position(is_hum)?;
        let guess = initial::guess(&record.voltage_v, &record.position_um);
        let trace = chain_fit::prepare(&chain, &self.coefficients, record, guess);
        Some(chain.addition(&trace, hum))
    }

    /// Runs the model over an input alone, from a given state, with the effects around the hysteresis.
    ///
    /// # Errors
    /// An effect that an input alone does not determine: heat, another axis, the mains' phases.
    pub fn simulate_input(
        &self,
        input: &[f64],
        period_s: f64,
        initial: InitialState,
    ) -> Result<Vec<f64>, IdentifyError> {
        if let Some(chain) = self.chain() {
            return self.simulate_voltage(&chain, input, period_s, initial);
        }
        let run = Run {
            input,
            output: &[],
            period_s,
            initial,
            weight: 1.0,
            fit_from: 0,
        };
        Ok(self.simulate_from(&self.design(), &run).output)
    }

    fn simulate_voltage(
        &self,
        chain: &Chain,
        voltage_v: &[f64],
        period_s: f64,
        initial: InitialState,
    ) -> Result<Vec<f64>, IdentifyError> {
        let beyond = |link: &&Link| link.effect.needs_columns();
        if let Some(link) = chain.links.iter().find(beyond) {
            return Err(IdentifyError::EffectNeedsRecord {
                effect: link.effect.description().name.to_owned(),
            });
        }
        let record = Record {
            file: String::new(),
            role: Role::Validate,
            excitation: String::new(),
            start_s: 0.0,
            period_s,
            voltage_v: voltage_v.to_vec(),
            position_um: vec![0.0; voltage_v.len()],
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        };
        Ok(chain.respond(&self.coefficients, &Trace::new(&record, initial, chain.dynamic())))
    }

    fn simulate_from(&self, design: &Design, run: &Run<'_>) -> Simulation {
        let mut output = Vec::with_capacity(run.input.len());
        design.simulate(&self.coefficients, run, |_, modelled| output.push(modelled));
        Simulation {
            output,
            initial: run.initial,
        }
    }

    /// The chain of a model that has effects.
    pub(crate) fn chain(&self) -> Option<Chain> {
        if self.effects.is_empty() {
            return None;
        }
        Some(self.chain_with(Vec::new()))
    }

    /// Whether an effect moves signals in time: then records are run on the grid of [`crate::grid::refinement`].
    pub fn is_dynamic(&self) -> bool {
        self.chain_with(Vec::new()).dynamic()
    }

    /// The model's chain, with further links.
    pub(crate) fn chain_with(&self, mut links: Vec<Link>) -> Chain {
        links.extend(self.effects.iter().filter_map(|fitted| {
            Some(Link {
                effect: fitted.effect()?,
                values: fitted.parameters.iter().map(|parameter| parameter.value).collect(),
            })
        }));
        Chain::new(self.design(), links, self.input_max - self.input_min)
    }

    pub(crate) fn design(&self) -> Design {
        Design {
            family: self.family,
            thresholds: self.thresholds.clone(),
            envelope: self.envelope.unwrap_or(Envelope {
                alpha_s: 0.0,
                beta_s: 0.0,
            }),
        }
    }

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
            Family::PlayPolynomial => &[
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
