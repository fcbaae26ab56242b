//! Runs a fitted model: free simulation over records and inputs.

use crate::chain::{Chain, Link, Own};
use crate::chain_trace::Trace;
use crate::columns::{Design, Run};
use crate::effects::Family;
use crate::error::IdentifyError;
use crate::family::Direction;
use crate::initial;
use crate::model::{FittedEffect, Model, Simulation};
use crate::objective::run_of;
use crate::start_state::InitialState;
use hysteron_core::envelope::Envelope;
use hysteron_data::Record;

impl Model {
    /// Runs the model freely over a record (never one step ahead: the measured output is used for nothing but the state
    /// before the first sample, one number, chosen where the drive does not give it).
    ///
    /// # Cost
    /// O(samples x plays); a record that does not start periodically costs about 25 runs more for its initial state.
    pub fn simulate(&self, record: &Record) -> Simulation {
        if let Some((chain, coefficients)) = self.chain() {
            let (trace, own) = prepare(&chain, &coefficients, record);
            return Simulation {
                output: chain.respond(&coefficients, &trace, &own),
                initial: trace.initial,
            };
        }
        let mut run = run_of(record, self.direction, None);
        let design = self.design();
        run.initial = initial::choose(&design, &self.coefficients, &run);
        self.simulate_from(&design, &run)
    }

    /// As [`Self::simulate`] of a record that is known to begin at rest at the low end of its drive.
    pub(crate) fn simulate_from_rest(&self, record: &Record) -> Vec<f64> {
        if let Some((chain, coefficients)) = self.chain() {
            let trace = Trace::new(record, InitialState::REST, chain.dynamic());
            return chain.respond(&coefficients, &trace, &chain.settle(&coefficients, &trace));
        }
        let mut run = run_of(record, self.direction, None);
        run.initial = InitialState::REST;
        self.simulate_from(&self.design(), &run).output
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
        if let Some((chain, coefficients)) = self.chain() {
            return simulate_voltage(&chain, &coefficients, input, period_s, initial);
        }
        let run = Run {
            input,
            output: &[],
            period_s,
            initial,
            weight: 1.0,
            fit_from: 0,
            clipped: &[],
        };
        Ok(self.simulate_from(&self.design(), &run).output)
    }

    fn simulate_from(&self, design: &Design, run: &Run<'_>) -> Simulation {
        let mut output = Vec::with_capacity(run.input.len());
        design.simulate(&self.coefficients, run, |_, modelled| output.push(modelled));
        Simulation {
            output,
            initial: run.initial,
        }
    }

    /// The chain of a model that has effects or a free shape, with the coefficients of its basis; `None` where the plays alone run.
    pub(crate) fn chain(&self) -> Option<(Chain, Vec<f64>)> {
        let free = self.family == Family::PlayPolynomial && self.direction == Direction::Forward;
        if self.effects.is_empty() && !free {
            return None;
        }
        let chain = Chain::new(self.design(), self.links(), [self.input_min, self.input_max]);
        let coefficients = chain.basis().of_powers(&self.thresholds, &self.coefficients);
        Some((chain, coefficients))
    }

    /// The effects around the hysteresis as links of a chain.
    pub(crate) fn links(&self) -> Vec<Link> {
        let link = |fitted: &FittedEffect| {
            Some(Link {
                effect: fitted.effect()?,
                values: fitted.parameters.iter().map(|parameter| parameter.value).collect(),
            })
        };
        self.effects.iter().filter_map(link).collect()
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
}

/// A record in the state that the chain finds for it, and the numbers that belong to it alone.
fn prepare<'a>(chain: &Chain, coefficients: &[f64], record: &'a Record) -> (Trace<'a>, Own) {
    let fine = chain.dynamic();
    let guess = initial::guess(&record.voltage_v, &record.position_um);
    let trace = Trace::new(record, guess, fine);
    let chosen = initial::choose_by(guess, &record.position_um, |initial| {
        let from = trace.starting_at(initial, fine);
        let own = chain.settle(coefficients, &from);
        chain.respond(coefficients, &from, &own)
    });
    let trace = trace.starting_at(chosen, fine);
    let own = chain.settle(coefficients, &trace);
    (trace, own)
}

fn simulate_voltage(
    chain: &Chain,
    coefficients: &[f64],
    voltage_v: &[f64],
    period_s: f64,
    initial: InitialState,
) -> Result<Vec<f64>, IdentifyError> {
    let beyond = |link: &&Link| link.effect.needs_columns();
    if let Some(link) = chain.links.iter().find(beyond) {
        return Err(IdentifyError::EffectNeedsRecord {
            effect: link.effect.name(),
        });
    }
    Ok(chain.respond_to_voltage(coefficients, voltage_v, period_s, initial))
}
