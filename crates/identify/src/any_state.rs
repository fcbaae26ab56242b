//! A chain's answer to one record from any state of its plays: what does not depend on the state is run once.

use crate::chain::Chain;
use crate::chain_trace::Trace;
use crate::effects::Family;
use crate::initial;
use crate::start_state::InitialState;
use std::cell::OnceCell;

/// A chain on one record.
struct AnyState<'s, 'r> {
    chain: &'s Chain,
    coefficients: &'s [f64],
    /// The record from the state that it was last found in.
    given: &'s Trace<'r>,
    /// The record from a state that it remembers.
    remanent: Trace<'r>,
    voltage_at_stack_v: Vec<f64>,
    ends: OnceCell<Ends>,
}

/// The hysteresis from both ends of the states, and from the middle of fading elements.
struct Ends {
    /// Come down to.
    down: Vec<f64>,
    /// Demagnetised; empty for plays.
    middle: Vec<f64>,
    /// Come up to.
    up: Vec<f64>,
    /// Samples after which the state before the record is forgotten.
    remembers: usize,
}

impl AnyState<'_, '_> {
    /// The record from a state that it remembers.
    fn from(&self, fraction: f64) -> Trace<'_> {
        let mut from = self.remanent.clone();
        from.initial = InitialState::Remanent { fraction };
        from
    }

    fn hysteresis(&self, from: &Trace<'_>, samples: usize) -> Vec<f64> {
        self.chain
            .hysteresis(self.coefficients, from, &self.voltage_at_stack_v[..samples])
    }

    fn ends(&self) -> &Ends {
        self.ends.get_or_init(|| {
            let whole = self.voltage_at_stack_v.len();
            let [down, up] = [0.0, 1.0].map(|fraction| self.hysteresis(&self.from(fraction), whole));
            // A play from any other state moves between those from both ends, and goes on as they do once they have met.
            let differ = down.iter().zip(&up).rposition(|(down, up)| down != up);
            let fading = self.chain.design.family == Family::Duhem;
            Ends {
                middle: if fading {
                    self.hysteresis(&self.from(0.5), whole)
                } else {
                    Vec::new()
                },
                remembers: differ.map_or(0, |last| last + 1),
                down,
                up,
            }
        })
    }

    /// What the hysteresis makes of the command from a state, `from` the record in it.
    fn stroke_um(&self, from: &Trace<'_>, fraction: f64) -> Vec<f64> {
        let Ends {
            down,
            middle,
            up,
            remembers,
        } = self.ends();
        if fraction == 0.0 {
            return down.clone();
        }
        if fraction == 1.0 {
            return up.clone();
        }
        if !middle.is_empty() {
            // What fading elements hold is linear in what they held, on each side of the middle.
            let (one, other, share) = if fraction < 0.5 {
                (down, middle, 2.0 * fraction)
            } else {
                (middle, up, 2.0 * fraction - 1.0)
            };
            return one.iter().zip(other).map(|(a, b)| a + share * (b - a)).collect();
        }
        let mut stroke_um = self.hysteresis(from, *remembers);
        stroke_um.extend_from_slice(&down[*remembers..]);
        stroke_um
    }

    fn respond(&self, state: InitialState, fine: bool) -> Vec<f64> {
        let InitialState::Remanent { fraction } = state else {
            let other = (state != self.given.initial).then(|| self.remanent.starting_at(state, fine));
            let trace = other.as_ref().unwrap_or(self.given);
            let own = self.chain.settle(self.coefficients, trace);
            return self.chain.respond(self.coefficients, trace, &own);
        };
        let trace = self.from(fraction);
        let stroke_um = self.stroke_um(&trace, fraction);
        let own = self
            .chain
            .settle_behind(self.coefficients, &trace, &self.voltage_at_stack_v, &stroke_um);
        self.chain
            .respond_behind(self.coefficients, &trace, &own, &self.voltage_at_stack_v, stroke_um)
    }
}

/// Chooses the state in which a record finds the plays under a chain: the guess from the record alone, unless another explains it clearly
/// better ([`initial::choose_by`]). `trace` is the record from any state.
pub(crate) fn choose(chain: &Chain, coefficients: &[f64], trace: &Trace<'_>, guess: InitialState) -> InitialState {
    let fine = chain.dynamic();
    let remanent = trace.starting_at(InitialState::REST, fine);
    let any = AnyState {
        chain,
        coefficients,
        given: trace,
        voltage_at_stack_v: chain.stack(&remanent, &vec![Vec::new(); chain.links.len()]),
        remanent,
        ends: OnceCell::new(),
    };
    let fades = chain.design.family == Family::Duhem;
    initial::choose_by(guess, &trace.record.position_um, fades, |state| {
        any.respond(state, fine)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Link;
    use crate::columns::Design;
    use crate::effects::{EffectId, find};
    use hysteron_data::{Record, Role};
    use std::f64::consts::TAU;

    /// A record that begins in the midst of its range: a small swing before a large one.
    fn record() -> Record {
        let angle = |k: usize| TAU * k as f64 / 300.0;
        let swing = |k: usize| if k < 450 { 5.0 } else { 40.0 };
        let voltage_v: Vec<f64> = (0..1800).map(|k| 50.0 + swing(k) * angle(k).sin()).collect();
        Record::new("r.csv", Role::Identify, 1e-3, voltage_v.clone(), voltage_v)
    }

    fn chain(family: Family) -> (Chain, Vec<f64>) {
        let thresholds = vec![4.0, 15.0, 45.0];
        let creep = Link {
            effect: find(EffectId::Creep),
            values: vec![0.05, 0.01, 0.02, 0.0, 0.0],
        };
        let chain = Chain::new(Design::still(family, thresholds), vec![creep], [0.0, 100.0]);
        let coefficients = (0..chain.design.columns()).map(|k| 0.1 + 0.01 * k as f64).collect();
        (chain, coefficients)
    }

    /// From every state the same as the chain run as a whole from it.
    #[test]
    fn val_each_state_as_run_alone() {
        let record = record();
        for family in [Family::Mpi, Family::PlayPolynomial, Family::Duhem] {
            let (chain, coefficients) = chain(family);
            let remanent = Trace::new(&record, InitialState::REST, true);
            let none = vec![Vec::new(); 1];
            let any = AnyState {
                chain: &chain,
                coefficients: &coefficients,
                given: &remanent,
                voltage_at_stack_v: chain.stack(&remanent, &none),
                remanent: remanent.clone(),
                ends: OnceCell::new(),
            };
            for fraction in [0.0, 0.2, 0.5, 0.7, 1.0] {
                let state = InitialState::Remanent { fraction };
                let alone = chain.respond(&coefficients, &Trace::new(&record, state, true), &none);
                for (a, b) in any.respond(state, true).iter().zip(&alone) {
                    assert!(
                        (a - b).abs() < 1e-9 * b.abs().max(1.0),
                        "{family:?} {fraction}: {a} {b}"
                    );
                }
            }
            // Plays forget within the large swing; elements that fade do not within a record.
            let forgotten = any.ends().remembers < record.len();
            assert_eq!(forgotten, family != Family::Duhem, "{family:?}");
        }
    }
}
