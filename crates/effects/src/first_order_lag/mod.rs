//! `first-order-lag`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::run;
use hysteron_core::effects::lag::GrowingLag;

pub(crate) struct FirstOrderLag;

static DESCRIPTION: Description = Description {
    name: EffectId::FirstOrderLag.name(),
    place: Place::Amplifier,
    summary: "The amplifier charges the stack's capacitance through a resistance, or the sensor filters its reading.",
    equation: "tau y' + y = u, before the hysteresis (amplifier) or after it (sensor); added once more, the amplifier's grows with its \
               voltage, tau(v) = amplifier_tau + tau_per_v (v - from_v)",
    source: "source resistance times capacitance: 10 ohm x 1.8 uF = 18 us, 50 ohm x 6 uF = 300 us; sensor filters of 1 to 10 kHz: 16 to 160 us; the \
             capacitance is 30 to 60 % larger at full voltage than at rest",
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
        Named {
            name: "tau_per_v",
            unit: "s/V",
            what: "growth of the amplifier's time constant, 0 until the effect is added once more, then at most 10 ms over the range",
        },
        Named {
            name: "from_v",
            unit: "V",
            what: "voltage at the stack from which it grows, the lowest of the records; fixed",
        },
    ],
    shows: "Phase -atan(w tau) with a gain that falls: 4.6 % at 500 Hz for 100 us. Corners of a square wave are rounded, \
            the slope of a step's answer is continuous. Where it grows with the voltage, a fast sine leans.",
    mistaken_for: "delay (same phase at low frequencies), rate-dependence, resonance (whose gain rises)",
    separated_by: "A small multisine at a bias up to at least 1/(5 tau): there the gains of lag and delay part; or the \
                   amplifier's monitor output.",
    compensated_by: "A lead (1 + tau s) on the reference, whose derivative is clean; it grows with the voltage as the lag does.",
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
        let tau = Bounds::new(0.0, LONGEST_S, facts.finest_period_s, 0.0);
        let span_v = facts.span_v().max(f64::MIN_POSITIVE);
        let growth = Bounds {
            fitted: false,
            ..Bounds::new(0.0, LONGEST_S / span_v, facts.finest_period_s / span_v, 0.0)
        };
        Ok(vec![tau, tau, growth, Bounds::fixed(facts.voltage_v[0])])
    }

    fn free(&self, values: &[f64], bounds: &mut [Bounds]) {
        bounds[2].fitted |= values[2] != 0.0;
    }

    fn once_more(&self, values: &[f64], bounds: &[Bounds]) -> Option<Vec<Vec<f64>>> {
        let [amplifier_s, sensor_s, per_v, from_v] = [values[0], values[1], values[2], values[3]];
        // The lag at the middle stays; it doubles over the range, or begins at nothing.
        let half_span_v = 0.5 * LONGEST_S / bounds[2].max;
        let grows = |share: f64| {
            let change_s = share * amplifier_s.max(sensor_s);
            vec![
                (amplifier_s - change_s).max(0.0),
                sensor_s,
                change_s / half_span_v,
                from_v,
            ]
        };
        (per_v == 0.0 && amplifier_s + sensor_s > 0.0).then(|| [0.3, 1.0].map(grows).to_vec())
    }

    fn starts(&self, _: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let from_v = bounds[3].neutral;
        let taus = [1e-5, 3e-5, 1e-4, 3e-4, 1e-3];
        taus.iter()
            .flat_map(|&tau| [vec![tau, 0.0, 0.0, from_v], vec![0.0, tau, 0.0, from_v]])
            .collect()
    }

    fn on_voltage(&self, values: &[f64], signals: &Signals<'_>, voltage_v: &mut [f64]) {
        if values[2] != 0.0 {
            if let Ok(lag) = GrowingLag::<f64>::new(values[0], values[2], values[3], 1.0 / signals.period_s) {
                run::block(&lag, signals.run_in, voltage_v);
            }
        } else if values[0] > 0.0 {
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
        let [amplifier_s, sensor_s, per_v] = [values[0], values[1], values[2]];
        let note = if sensor_s > 0.0 && amplifier_s <= 0.0 && per_v == 0.0 {
            "a late reading moves nothing: only what the feedback compares with is made late"
        } else {
            "asks for more voltage and current the faster the reference"
        };
        Compensation::new(
            Compensator::Lead {
                amplifier_s,
                growth: (per_v != 0.0).then(|| [values[3], per_v]),
                sensor_s,
            },
            note,
        )
    }
}
