//! `thermal-drift`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::series;
use hysteron_core::effects::thermal::Thermal;

pub(crate) struct ThermalDrift;

static DESCRIPTION: Description = Description {
    name: EffectId::ThermalDrift.name(),
    place: Place::Coupling,
    summary: "Position and gain follow the temperature (or, where it was not recorded, the time).",
    equation: "y' = y (1 + c d) + k d + s (z - k d_0), tau d' + d = T - T0; without a temperature d is the time since the \
               record's start, in hours. z is where the record finds the stage at rest before it moves (else its mean error), \
               d_0 the d of that moment",
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
        Named {
            name: "rest_share",
            unit: "",
            what: "s, 0 to 1: how far the rest before a record tells its zero better than the temperature does; 0 where no record \
                   begins at rest",
        },
    ],
    shows: "The error follows the temperature column, or a straight line in time, whatever the last step was; the quiet \
            record moves as well. A changing gain shows as an error proportional to the position that grows slowly.",
    mistaken_for: "creep (turns round with the step), drift after power-on, ageing or a changed load (gain)",
    separated_by: "A long rest at 0 V, where nothing creeps, with the temperature recorded; a slow record right after a fast one.",
    compensated_by: "Integral action, feedforward from a temperature sensor, a gain schedule.",
    scene: Scene::Hold,
};

/// A low end that moves less than this share of the high end is moved by the gain.
const OF_THE_GAIN: f64 = 0.3;

/// The largest change of the gain that is a stage's, a kelvin.
const MOST_GAIN_PER_K: f64 = 0.05;

/// Why a drift in time is left out.
const IN_TIME: &str = "it was fitted against time, not temperature, and time starts anew; record temperature_c, or leave it to the feedback";

impl Effect for ThermalDrift {
    fn name(&self) -> EffectName {
        EffectId::ThermalDrift.into()
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Temperature)
    }

    fn zero_um_per_k(&self, values: &[f64], position_um: [f64; 2]) -> Option<f64> {
        // No stage's gain changes by so much: what asks for it must move the zero as a shift does.
        if values[3].abs() >= MOST_GAIN_PER_K {
            return Some(values[2]);
        }
        let [low, high] = position_um.map(|y| values[2] + values[3] * y);
        (low.abs() > OF_THE_GAIN * high.abs()).then_some(low)
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        let stroke = facts.moving_stroke_um()?;
        let shift = |most: f64| Bounds::new(-most, most, 0.01 * most, 0.0);
        // Where none shows its zero, a zero of each record's own would explain anything.
        let rest_share = if facts.rests {
            Bounds::new(0.0, 1.0, 0.1, 0.0)
        } else {
            Bounds::fixed(0.0)
        };
        Ok(match facts.temperature_c {
            Some([low, mean, high]) if high > low => vec![
                Bounds::fixed(mean),
                Bounds::new(0.0, 3600.0, 60.0, 0.0),
                shift(stroke / (high - low)),
                shift(MOST_GAIN_PER_K),
                rest_share,
            ],
            _ => {
                let hours = facts.longest_s / 3600.0;
                vec![
                    Bounds::fixed(0.0),
                    Bounds::fixed(0.0),
                    shift(stroke / hours),
                    shift(0.2 / hours),
                    rest_share,
                ]
            }
        })
    }

    fn starts(&self, facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let taus: &[f64] = if facts.temperature_c.is_some_and(|[low, _, high]| high > low) {
            &[0.0, 3.0, 30.0, 300.0, 1500.0]
        } else {
            &[0.0]
        };
        let start = |share: f64| move |&tau: &f64| vec![bounds[0].neutral, tau, 0.0, 0.0, share];
        let shares = if facts.rests { &[0.0, 1.0][..] } else { &[0.0] };
        shares.iter().flat_map(|&share| taus.iter().map(start(share))).collect()
    }

    fn acts(&self) -> Acts {
        // The shift does not depend on the position, the gain does: `on_change` has the slope.
        Acts::Nonlinearly
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        let warmer = warmer(values, signals, position_um.len());
        let at_start = warmer.get(signals.run_in).copied().unwrap_or(0.0);
        let beside_um = signals
            .own
            .first()
            .map_or(0.0, |zero| values[4] * (zero - values[2] * at_start));
        for (y, d) in position_um.iter_mut().zip(warmer) {
            *y += beside_um + d * (values[2] + values[3] * *y);
        }
    }

    fn unit_without_temperature(&self, named: &Named) -> &'static str {
        match named.name {
            "shift" => "um/h",
            "gain" => "1/h",
            _ => named.unit,
        }
    }

    fn has_own_numbers(&self) -> bool {
        true
    }

    /// Where the record finds the stage: a body warms while nothing is recorded, and one that lags its temperature is not
    /// where that says. A record that starts in motion has its zero in its mean.
    fn settle(&self, _: &[f64], signals: &Signals<'_>, unexplained: &[f64], every: usize) -> Vec<f64> {
        let looked_at = match series::rest(&signals.at_stack_v[signals.run_in..], every) {
            Some(samples) => samples.min(unexplained.len()),
            None => unexplained.len(),
        };
        vec![unexplained[..looked_at].iter().sum::<f64>() / looked_at.max(1) as f64]
    }

    /// How warm the body was before the record, as its shift.
    fn remembered(&self, values: &[f64], period_s: f64, samples: usize) -> Option<Vec<f64>> {
        let tau_s = values[1];
        let left = |k: usize| {
            if tau_s > 0.0 {
                (-(k as f64) * period_s / tau_s).exp()
            } else {
                1.0
            }
        };
        Some((0..samples).map(left).collect())
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        let &[reference_c, tau_s, shift_um_per_k, gain_per_k, _] = values else {
            return Compensation::none(IN_TIME);
        };
        if reference_c == 0.0 {
            return Compensation::none(IN_TIME);
        }
        Compensation::new(
            Compensator::ThermalGain {
                reference_c,
                tau_s,
                shift_um_per_k,
                gain_per_k,
            },
            "needs the temperature at every sample",
        )
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A gain about the low end leaves the zero where it is; a shift, and a gain about the middle, move it.
    #[test]
    fn bva_what_moves_the_zero_on_both_sides() {
        let zero = |shift: f64, gain: f64| ThermalDrift.zero_um_per_k(&[20.0, 0.0, shift, gain, 0.0], [5.0, 15.0]);
        assert_eq!(zero(0.2, 0.0), Some(0.2));
        assert_eq!(zero(-0.2, 0.04), None);
        assert!(zero(-0.4, 0.04).is_some_and(|moved| (moved + 0.2).abs() < 1e-12));
        // 0.31 and 0.29 of what the high end moves.
        assert!(zero(-0.04 * 5.0 + 0.18, 0.04).is_some());
        assert!(zero(-0.04 * 5.0 + 0.16, 0.04).is_none());
        // On its bound a gain is not excused.
        assert_eq!([zero(-0.25, 0.0499), zero(-0.25, 0.05)], [None, Some(-0.25)]);
    }
}
