//! `thermal-drift`

use super::{Acts, Bounds, Description, Effect, Facts, Named, Place, Scene, Signals};
use hysteron_core::effects::thermal::Thermal;

pub(super) struct ThermalDrift;

static DESCRIPTION: Description = Description {
    name: "thermal-drift",
    place: Place::Coupling,
    summary: "Position and gain follow the temperature (or, where it was not recorded, the time).",
    equation: "y' = y (1 + c d) + k d, tau d' + d = T - T0; without a temperature d is the time since the record's start, in hours",
    source: "aluminium 23 ppm/K x 50 mm = 1.15 um/K, Invar 0.1 um/K; bodies take 5 to 60 minutes to follow",
    parameters: &[
        Named {
            name: "reference",
            unit: "degC",
            what: "T0, the records' mean; not fitted",
        },
        Named {
            name: "tau",
            unit: "s",
            what: "time the body takes to follow, 0 to 3600 s",
        },
        Named {
            name: "shift",
            unit: "um/K",
            what: "k; um/h without a temperature",
        },
        Named {
            name: "gain",
            unit: "1/K",
            what: "c, up to 0.05; 1/h without a temperature",
        },
    ],
    shows: "The error follows the temperature column, or a straight line in time, whatever the last step was; the quiet \
            record moves as well. A changing gain shows as an error proportional to the position that grows slowly.",
    mistaken_for: "creep (turns round with the step), drift after power-on, ageing or a changed load (gain)",
    separated_by: "A long rest at 0 V, where nothing creeps, with the temperature recorded; a slow record right after a fast one.",
    compensated_by: "Integral action, feedforward from a temperature sensor, a gain schedule.",
    scene: Scene::Hold,
};

impl Effect for ThermalDrift {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        let stroke = facts.stroke_um();
        if stroke <= 0.0 {
            return Err("the position stands still in every record".to_owned());
        }
        let shift = |most: f64| Bounds::new(-most, most, 0.01 * most, 0.0);
        Ok(match facts.temperature_c {
            Some([low, mean, high]) if high > low => vec![
                Bounds::fixed(mean),
                Bounds::new(0.0, 3600.0, 60.0, 0.0),
                shift(stroke / (high - low)),
                shift(0.05),
            ],
            _ => {
                let hours = facts.longest_s / 3600.0;
                vec![
                    Bounds::fixed(0.0),
                    Bounds::fixed(0.0),
                    shift(stroke / hours),
                    shift(0.2 / hours),
                ]
            }
        })
    }

    fn starts(&self, facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let start = |tau: f64| vec![bounds[0].neutral, tau, 0.0, 0.0];
        if facts.temperature_c.is_some_and(|[low, _, high]| high > low) {
            [0.0, 3.0, 30.0, 300.0, 1500.0].map(start).to_vec()
        } else {
            vec![start(0.0)]
        }
    }

    fn acts(&self) -> Acts {
        // The shift does not depend on the position, the gain does: `on_change` has the slope.
        Acts::Nonlinearly
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        let warmer = warmer(values, signals, position_um.len());
        for (y, d) in position_um.iter_mut().zip(warmer) {
            *y += d * (values[2] + values[3] * *y);
        }
    }

    fn on_change(&self, values: &[f64], signals: &Signals<'_>, _: &[f64], change: &mut [f64]) {
        if values[3] != 0.0 {
            let warmer = warmer(values, signals, change.len());
            for (change, d) in change.iter_mut().zip(warmer) {
                *change *= 1.0 + d * values[3];
            }
        }
    }
}

/// `d`: how much warmer the body is than the reference, or hours since the start.
fn warmer(values: &[f64], signals: &Signals<'_>, n: usize) -> Vec<f64> {
    let Some(temperature_c) = signals.temperature_c else {
        let hours = signals.period_s / 3600.0;
        return (0..n).map(|k| (k as f64 - signals.run_in as f64) * hours).collect();
    };
    // The block of the core with unit shift, on a position of zero.
    let (Ok(body), Some(&first)) = (
        Thermal::<f64>::new(1.0, 0.0, values[0], values[1], 1.0 / signals.period_s),
        temperature_c.first(),
    ) else {
        return vec![0.0; n];
    };
    let mut state = body.settled_at(first);
    temperature_c.iter().map(|&t| body.step(&mut state, 0.0, t)).collect()
}
