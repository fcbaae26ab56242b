//! `first-order-lag`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::run;

pub(crate) struct FirstOrderLag;

static DESCRIPTION: Description = Description {
    name: EffectId::FirstOrderLag.name(),
    place: Place::Amplifier,
    summary: "The amplifier charges the stack's capacitance through a resistance, or the sensor filters its reading.",
    equation: "tau y' + y = u, before the hysteresis (amplifier) or after it (sensor)",
    source: "source resistance times capacitance: 10 ohm x 1.8 uF = 18 us, 50 ohm x 6 uF = 300 us; sensor filters of 1 to 10 kHz: 16 to 160 us",
    parameters: &[
        Named {
            name: "amplifier_tau",
            unit: "s",
            what: "time constant before the hysteresis, 0 to 10 ms",
        },
        Named {
            name: "sensor_tau",
            unit: "s",
            what: "time constant after the hysteresis, 0 to 10 ms",
        },
    ],
    shows: "Phase -atan(w tau) with a gain that falls: 4.6 % at 500 Hz for 100 us. Corners of a square wave are rounded, \
            the slope of a step's answer is continuous.",
    mistaken_for: "delay (same phase at low frequencies), rate-dependence, resonance (whose gain rises)",
    separated_by: "A small multisine at a bias up to at least 1/(5 tau): there the gains of lag and delay part; or the \
                   amplifier's monitor output.",
    compensated_by: "A lead (1 + tau s) on the reference, whose derivative is clean.",
    scene: Scene::Edge,
};

/// Slower is a fault or creep, seconds.
const LONGEST_S: f64 = 1e-2;

impl Effect for FirstOrderLag {
    fn name(&self) -> EffectName {
        EffectId::FirstOrderLag.into()
    }

    fn refuted_on_bound(&self, _: &str) -> bool {
        true
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Phase)
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        Ok(vec![Bounds::new(0.0, LONGEST_S, facts.finest_period_s, 0.0); 2])
    }

    fn starts(&self, _: &Facts, _: &[Bounds]) -> Vec<Vec<f64>> {
        let taus = [1e-5, 3e-5, 1e-4, 3e-4, 1e-3];
        taus.iter().flat_map(|&tau| [vec![tau, 0.0], vec![0.0, tau]]).collect()
    }

    fn on_voltage(&self, values: &[f64], signals: &Signals<'_>, voltage_v: &mut [f64]) {
        if values[0] > 0.0 {
            run::lag(values[0], signals.period_s, signals.run_in, voltage_v);
        }
    }

    fn acts(&self) -> Acts {
        Acts::Linearly
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        if values[1] > 0.0 {
            run::lag(values[1], signals.period_s, signals.run_in, position_um);
        }
    }

    fn dynamic(&self) -> bool {
        true
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        let [amplifier_s, sensor_s] = [values[0], values[1]];
        let note = if sensor_s > 0.0 && amplifier_s <= 0.0 {
            "a late reading moves nothing: only what the feedback compares with is made late"
        } else {
            "asks for more voltage and current the faster the reference"
        };
        Compensation::new(Compensator::Lead { amplifier_s, sensor_s }, note)
    }
}
