//! `creep`

use crate::compensator::{Compensation, Compensator, CreepElement};
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::run;

pub(crate) struct Creep;

static DESCRIPTION: Description = Description {
    name: EffectId::Creep.name(),
    place: Place::Creep,
    summary: "The stack goes on moving after the voltage has come to rest, a percent or two in every decade of time.",
    equation: "y' = y + sum c_i x_i, tau_i x_i' + x_i = y, tau_i = tau_1 10^(i-1), i = 1 to 4; equal c_i are the logarithmic law",
    source: "Kelvin-Voigt chain (Croft, Shed, Devasia 2001); y = y0 (1 + gamma log10(t / t0)) (Jung, Gweon 2000)",
    parameters: &[
        Named {
            name: "first_tau",
            unit: "s",
            what: "time constant of the first element, 10 ms to 1 s",
        },
        Named {
            name: "share_1",
            unit: "",
            what: "what the first element adds, 0 to 0.2 of the displacement",
        },
        Named {
            name: "share_2",
            unit: "",
            what: "one decade slower",
        },
        Named {
            name: "share_3",
            unit: "",
            what: "two decades slower",
        },
        Named {
            name: "share_4",
            unit: "",
            what: "three decades slower",
        },
    ],
    shows: "After a step the error is a straight line over log t, with the sign of the step; periodic records show a mean \
            that moves slowly and remembers the last step.",
    mistaken_for: "thermal-drift and drift after power-on (both monotone, whatever the step), hysteresis (creep adds a \
                   constant phase of 0.4 to 0.8 degrees at every frequency)",
    separated_by: "A step held for 100 s or longer, up and down again: creep turns round with the step, heat does not; a \
                   second level: creep scales with the step.",
    compensated_by: "Three to five first-order states in the inverse; integral action for the rest.",
    scene: Scene::Hold,
};

const ELEMENTS: usize = 4;

/// A record of this length shows more than one decade above the fastest element, seconds; in shorter ones nothing tells creep from a lag.
const SHORTEST_RECORD_S: f64 = 0.3;

impl Effect for Creep {
    fn name(&self) -> EffectName {
        EffectId::Creep.into()
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Time)
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        if facts.longest_s < SHORTEST_RECORD_S {
            return Err(format!(
                "the longest record lasts {:.3} s; creep is told from a lag in records of {SHORTEST_RECORD_S} s and longer",
                facts.longest_s
            ));
        }
        let mut bounds = vec![Bounds::new(0.01, 1.0, 0.05, 0.1)];
        bounds.extend([Bounds::new(0.0, 0.2, 0.005, 0.0); ELEMENTS]);
        Ok(bounds)
    }

    fn starts(&self, _: &Facts, _: &[Bounds]) -> Vec<Vec<f64>> {
        [0.02, 0.05, 0.1, 0.2, 0.5]
            .iter()
            .map(|&tau| vec![tau, 1e-3, 1e-3, 1e-3, 1e-3])
            .collect()
    }

    fn acts(&self) -> Acts {
        Acts::Linearly
    }

    fn outlasts_records(&self) -> bool {
        true
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        let mut alone = [position_um.to_vec()];
        self.on_positions(values, signals, &mut alone);
        position_um.copy_from_slice(&alone[0]);
    }

    fn on_positions(&self, values: &[f64], signals: &Signals<'_>, positions_um: &mut [Vec<f64>]) {
        let elements = elements(values);
        // From rest the elements begin with the record; what they would have been in the run-in is looked at by nobody.
        let from = if signals.rested { signals.run_in } else { 0 };
        run::relaxations(&elements, signals.period_s, from, signals.run_in - from, positions_um);
    }

    fn remembered(&self, values: &[f64], period_s: f64, samples: usize) -> Option<Vec<f64>> {
        let mut held: Vec<(f64, f64)> = elements(values)
            .into_iter()
            .map(|(tau_s, share)| (share, (-period_s / tau_s).exp()))
            .collect();
        let step = |_| {
            let sum = held.iter().map(|(left, _)| left).sum();
            held.iter_mut().for_each(|(left, keeps)| *left *= *keeps);
            sum
        };
        Some((0..samples).map(step).collect())
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        let elements = values[1..].iter().enumerate().map(|(i, &share)| CreepElement {
            tau_s: values[0] * 10f64.powi(i as i32),
            share,
        });
        Compensation::new(
            Compensator::Creep(elements.collect()),
            "slow states run once in 50 samples",
        )
    }
}

/// Time constants, seconds, and shares of the elements that are there.
fn elements(values: &[f64]) -> Vec<(f64, f64)> {
    let each = (0..ELEMENTS).map(|i| (values[0] * 10f64.powi(i as i32), values[i + 1]));
    each.filter(|(_, share)| *share != 0.0).collect()
}
