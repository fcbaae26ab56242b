//! Runs a fitted model: free simulation over records and inputs.

use crate::any_state;
use crate::chain::{Chain, Link, Own};
use crate::chain_trace::Trace;
use crate::columns::{Design, Run};
use crate::error::IdentifyError;
use crate::fading;
use crate::family::{Direction, Family, peak_to_peak};
use crate::initial;
use crate::model::{FittedEffect, Model, Simulation};
use crate::objective::run_of;
use crate::start_state::InitialState;
use hysteron_core::envelope::Envelope;
use hysteron_data::Record;

impl Model {
    /// Runs the model freely over a record (never one step ahead: the measured output is used for nothing but the state
    /// before the first sample, one number of the plays and one of a creep or a drift, chosen where the drive does not give them).
    ///
    /// # Cost
    /// O(samples x plays); a record that does not start periodically costs about 25 runs more for its initial state.
    pub fn simulate(&self, record: &Record) -> Simulation {
        self.simulate_after(record, Before::Unknown)
    }

    /// As [`Self::simulate`] of a record before which the slow states of creep and drift rested: nothing is estimated of them.
    pub fn simulate_rested(&self, record: &Record) -> Simulation {
        self.simulate_after(record, Before::Rest)
    }

    fn simulate_after(&self, record: &Record, before: Before) -> Simulation {
        if let Some((chain, coefficients)) = self.chain() {
            let (trace, own) = prepare(&chain, &coefficients, record);
            let mut output = chain.respond(&coefficients, &trace, &own);
            let remembered_um = match (before, trace.initial) {
                (Before::Unknown, InitialState::Remanent { .. }) => {
                    remember(&chain, &coefficients, record, &mut output)
                }
                _ => 0.0,
            };
            return Simulation {
                output,
                initial: trace.initial,
                remembered_um,
            };
        }
        let mut run = run_of(record, self.direction, None);
        let design = self.design();
        run.initial = initial::choose(&design, &self.coefficients, &run);
        self.simulate_from(&design, &run)
    }

    /// As [`Self::simulate`] of a record whose start is known or was found before: one run, and the slow states.
    pub fn simulate_starting(&self, record: &Record, initial: InitialState) -> Vec<f64> {
        let Some((chain, coefficients)) = self.chain() else {
            let mut run = run_of(record, self.direction, None);
            run.initial = initial;
            return self.simulate_from(&self.design(), &run).output;
        };
        let trace = Trace::new(record, initial, chain.dynamic());
        let own = chain.settle(&coefficients, &trace);
        let mut output = chain.respond(&coefficients, &trace, &own);
        if matches!(initial, InitialState::Remanent { .. }) {
            remember(&chain, &coefficients, record, &mut output);
        }
        output
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
            level_free: false,
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
            remembered_um: 0.0,
        }
    }

    /// What the fading elements of Duhem's family hold of `v`, `v^2` and `v^3` at rest at 0 V; nothing of other families.
    pub fn fading_at_rest(&self) -> Vec<[f64; 3]> {
        match self.family {
            Family::Duhem => fading::at_rest(&self.thresholds, [self.input_min, self.input_max]),
            _ => Vec::new(),
        }
    }

    /// The chain of a model that has effects or a free shape, with the coefficients of its basis; `None` where the plays alone run.
    pub(crate) fn chain(&self) -> Option<(Chain, Vec<f64>)> {
        let free = self.family.is_free() && self.direction == Direction::Forward;
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

/// What slow states did before a record.
#[derive(Clone, Copy)]
enum Before {
    /// They rested.
    Rest,
    /// Nobody knows.
    Unknown,
}

/// A record in the state that the chain finds for it, and the numbers that belong to it alone.
fn prepare<'a>(chain: &Chain, coefficients: &[f64], record: &'a Record) -> (Trace<'a>, Own) {
    let fine = chain.dynamic();
    let guess = initial::guess(&record.voltage_v, &record.position_um);
    let trace = Trace::new(record, guess, fine);
    let chosen = any_state::choose(chain, coefficients, &trace, guess);
    let trace = trace.starting_at(chosen, fine);
    let own = chain.settle(coefficients, &trace);
    (trace, own)
}

/// The squared error must fall by this share before slow states are believed to remember what was before a record.
const REMEMBERS: f64 = 0.1;

/// Adds what the slow states of each effect held from before a record, at most a stroke, chosen by least squares, where that explains
/// enough of what is left; all together, micrometres.
fn remember(chain: &Chain, coefficients: &[f64], record: &Record, output: &mut [f64]) -> f64 {
    let n = output.len();
    let mut held_um = 0.0;
    for link in &chain.links {
        let Some(of_one) = link.effect.remembered(&link.values, record.period_s, n) else {
            continue;
        };
        let left = || record.position_um.iter().zip(output.iter()).map(|(y, m)| y - m);
        let product: f64 = left().zip(&of_one).map(|(e, c)| e * c).sum();
        let square: f64 = of_one.iter().map(|c| c * c).sum();
        let whole: f64 = left().map(|e| e * e).sum();
        if square <= 0.0 || product.powi(2) / square < REMEMBERS * whole {
            continue;
        }
        let ends_um = chain.respond_to_voltage(coefficients, &chain.range_v, record.period_s, InitialState::REST);
        let stroke_um = peak_to_peak(&ends_um);
        let own_um = (product / square).clamp(-stroke_um, stroke_um);
        output.iter_mut().zip(&of_one).for_each(|(y, c)| *y += own_um * c);
        held_um += own_um;
    }
    held_um
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::EffectId;
    use crate::fit::{FitOptions, fit};
    use crate::model::Parameter;
    use hysteron_data::{Dataset, Role};
    use std::f64::consts::TAU;

    const PERIOD_S: f64 = 1e-3;

    fn record(voltage_v: Vec<f64>, position_um: Vec<f64>) -> Record {
        Record::new("r.csv", Role::Identify, PERIOD_S, voltage_v, position_um)
    }

    /// A loop with a slow creep of one element: `share` of the position, 2 s.
    fn creeping(share: f64) -> Model {
        let angle = |k: i32| TAU * f64::from(k) / 500.0;
        let voltage_v: Vec<f64> = (0..2000).map(|k| 10.0 - 10.0 * angle(k).cos()).collect();
        let position_um = (0..2000).map(|k| 1.0 - (angle(k) - 0.1).cos()).collect();
        let dataset = Dataset {
            records: vec![record(voltage_v, position_um)],
            ..Dataset::default()
        };
        let mut model = fit(&dataset, &FitOptions::new(Family::Pi), &|_| ()).unwrap().model;
        let values = [
            ("first_tau", 2.0),
            ("share_1", share),
            ("share_2", 0.0),
            ("share_3", 0.0),
            ("share_4", 0.0),
        ];
        let parameter = |(name, value): (&str, f64)| Parameter {
            name: name.to_owned(),
            value,
            unit: String::new(),
            standard_error: None,
        };
        model.effects.push(FittedEffect {
            name: EffectId::Creep.into(),
            parameters: values.map(parameter).to_vec(),
            definition: None,
        });
        model
    }

    /// A second at rest, a rise, then up and down about the middle.
    fn drive() -> Vec<f64> {
        let rise = (0..100).map(|k| 0.2 * f64::from(k));
        // Not periodic: a period would be the start's state.
        let swing = |k: i32, period: f64| (TAU * f64::from(k) / period).cos();
        let moves = (0..1500).map(|k| 13.0 + 4.0 * swing(k, 700.0) + 3.0 * swing(k, 447.0));
        std::iter::repeat_n(0.0, 1000).chain(rise).chain(moves).collect()
    }

    fn rms(a: &[f64], b: &[f64]) -> f64 {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    }

    /// A record that begins amid a creep is simulated from what the creep held there; one from rest remembers nothing.
    #[test]
    fn val_slow_states_before_a_record_are_found() {
        let model = creeping(0.1);
        let voltage_v = drive();
        let whole_um = model.simulate_input(&voltage_v, PERIOD_S, InitialState::REST).unwrap();
        let whole = model.simulate(&record(voltage_v.clone(), whole_um.clone()));
        assert_eq!(whole.remembered_um, 0.0);
        assert!(rms(&whole.output, &whole_um) < 1e-9);

        // From the peak after the rise on: the plays stand above, the creep still where it rested.
        let cut = model.simulate(&record(voltage_v[1100..].to_vec(), whole_um[1100..].to_vec()));
        let moved_um = whole_um[1100] - whole_um[0];
        assert!(
            (cut.remembered_um + moved_um).abs() < 0.1 * moved_um,
            "{} {moved_um}",
            cut.remembered_um
        );
        assert!(rms(&cut.output, &whole_um[1100..]) < 2e-3 * moved_um);
    }

    /// Slow states hold a stroke at most, whatever offset a record has.
    #[test]
    fn bva_slow_states_hold_no_more_than_a_stroke() {
        let model = creeping(0.1);
        let voltage_v = drive();
        let whole_um = model.simulate_input(&voltage_v, PERIOD_S, InitialState::REST).unwrap();
        let of_offset = |offset_um: f64| {
            let far: Vec<f64> = whole_um[1100..].iter().map(|y| y + offset_um).collect();
            model.simulate(&record(voltage_v[1100..].to_vec(), far)).remembered_um
        };
        let stroke_um = peak_to_peak(&whole_um);
        assert!(
            of_offset(50.0) > 0.8 * stroke_um && of_offset(50.0) < 1.3 * stroke_um,
            "{}",
            of_offset(50.0)
        );
        assert_eq!(of_offset(50.0), of_offset(100.0));
    }
}
