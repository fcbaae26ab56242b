//! `saturation`

use crate::compensator::Compensation;
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use hysteron_core::effects::saturation;

pub(crate) struct Saturation;

static DESCRIPTION: Description = Description {
    name: EffectId::Saturation.name(),
    place: Place::Sensor,
    summary: "A hard limit: the amplifier's rails, the converter's range, or a mechanical stop.",
    equation: "v' = min(max(v, v_low), v_high); y' = y_s + c (y - y_s), y_s = min(max(y, y_low), y_high)",
    source: "amplifier rails and end stops; ranges of converters",
    parameters: &[
        Named {
            name: "rail_low",
            unit: "V",
            what: "lower rail; below the records' lowest voltage it does nothing",
        },
        Named {
            name: "rail_high",
            unit: "V",
            what: "upper rail; above the records' highest voltage it does nothing",
        },
        Named {
            name: "stop_low",
            unit: "um",
            what: "lower stop; below the lowest position it does nothing",
        },
        Named {
            name: "stop_high",
            unit: "um",
            what: "upper stop; above the highest position it does nothing",
        },
        Named {
            name: "gives_way",
            unit: "",
            what: "by how much a stop gives way, 0 to 0.5 of what pushes against it",
        },
    ],
    shows: "Nothing below a level, then an error that grows to one side; flat tops; a spike at the edge of the histogram.",
    mistaken_for: "asymmetry (smooth), slew-limit (a threshold in velocity)",
    separated_by: "An amplitude ladder, or one slow ramp up to the limit.",
    compensated_by: "Keep commands inside (and tell the user the usable range), anti-windup. An end stop is never compensated.",
    scene: Scene::SlowSine,
};

/// A stop gives way by less than this share of what pushes against it; otherwise it is a bend.
const MOST_COMPLIANT: f64 = 0.5;

impl Effect for Saturation {
    fn name(&self) -> EffectName {
        EffectId::Saturation.into()
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn bends_the_loops(&self) -> bool {
        true
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Ends)
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        let side = |range: [f64; 2]| {
            let span = range[1] - range[0];
            // Neutral a tenth outside; not deeper than a third of the range, or little would be left of it.
            let (outside, deepest, scale) = (0.1 * span, span / 3.0, 0.01 * span);
            [
                Bounds::new(range[0] - outside, range[0] + deepest, scale, range[0] - outside),
                Bounds::new(range[1] - deepest, range[1] + outside, scale, range[1] + outside),
            ]
        };
        if facts.span_v() <= 0.0 || facts.stroke_um() <= 0.0 {
            return Err("nothing moves in these records; a limit shows only where it is reached".to_owned());
        }
        let ([a, b], [c, d]) = (side(facts.voltage_v), side(facts.position_um));
        Ok(vec![a, b, c, d, Bounds::new(0.0, MOST_COMPLIANT, 0.05, 0.0)])
    }

    fn starts(&self, facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let neutral: Vec<f64> = bounds.iter().map(|b| b.neutral).collect();
        let mut starts = Vec::new();
        for (i, range) in [facts.voltage_v, facts.voltage_v, facts.position_um, facts.position_um]
            .iter()
            .enumerate()
        {
            // Two a factor of two, from 0.3 % of the range to 27 %.
            for k in 0..14 {
                let inside = 0.003 * 2_f64.powf(f64::from(k) / 2.0) * (range[1] - range[0]);
                let mut start = neutral.clone();
                start[i] = if i % 2 == 0 {
                    range[0] + inside
                } else {
                    range[1] - inside
                };
                starts.push(start);
            }
        }
        starts
    }

    fn on_voltage(&self, values: &[f64], _: &Signals<'_>, voltage_v: &mut [f64]) {
        if let Ok(rails) = saturation::Saturation::new(values[0], values[1]) {
            voltage_v.iter_mut().for_each(|v| *v = rails.limit(*v));
        }
    }

    fn rails_v(&self, values: &[f64]) -> Option<[f64; 2]> {
        values.first_chunk().copied()
    }

    fn acts(&self) -> Acts {
        Acts::Nonlinearly
    }

    fn on_position(&self, values: &[f64], _: &Signals<'_>, position_um: &mut [f64]) {
        if let Ok(stops) = saturation::Saturation::new(values[2], values[3]) {
            position_um.iter_mut().for_each(|y| {
                let stopped = stops.limit(*y);
                *y = stopped + values[4] * (*y - stopped);
            });
        }
    }

    fn on_change(&self, values: &[f64], _: &Signals<'_>, position_um: &[f64], change: &mut [f64]) {
        for (change, &y) in change.iter_mut().zip(position_um) {
            if y < values[2] || y > values[3] {
                *change *= values[4];
            }
        }
    }

    fn compensation(&self, _: &[f64]) -> Compensation {
        Compensation::none("a stop cannot be passed; keep references away from it")
    }
}
