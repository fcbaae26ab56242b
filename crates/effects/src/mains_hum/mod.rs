//! `mains-hum`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use hysteron_core::effects::hum::Hum;
use std::f64::consts::TAU;

pub(crate) struct MainsHum;

static DESCRIPTION: Description = Description {
    name: EffectId::MainsHum.name(),
    place: Place::Coupling,
    summary: "The mains and its harmonics in the position, through the amplifier's ripple or a ground loop.",
    equation: "y' = y + sum A_k sin(2 pi k f t + phi_k), k = 1 to 5; phases belong to each second of each record",
    source: "ripple of 1 to 20 mV: 0.1 to 2 nm; ground loops 5 to 50 nm; the line keeps within 0.2 Hz of 50 or 60",
    parameters: &[
        Named {
            name: "frequency",
            unit: "Hz",
            what: "f, fitted near 50 or 60",
        },
        Named {
            name: "amplitude_1",
            unit: "um",
            what: "fundamental",
        },
        Named {
            name: "amplitude_2",
            unit: "um",
            what: "second harmonic",
        },
        Named {
            name: "amplitude_3",
            unit: "um",
            what: "third harmonic",
        },
        Named {
            name: "amplitude_4",
            unit: "um",
            what: "fourth harmonic",
        },
        Named {
            name: "amplitude_5",
            unit: "um",
            what: "fifth harmonic",
        },
    ],
    shows: "Lines at 50 or 60 Hz and their multiples in the error's spectrum, as large at rest as in motion, with phases \
            that differ from record to record.",
    mistaken_for: "harmonics of the drive, where its frequency divides the line's (10 Hz!)",
    separated_by: "A record at rest; drives at 11, 97, 503 Hz instead of 10, 100, 500.",
    compensated_by: "A resonator at the line frequency in the loop; better, mend the ground loop.",
    scene: Scene::OtherAxis,
};

const HARMONICS: usize = 5;

impl Effect for MainsHum {
    fn name(&self) -> EffectName {
        EffectId::MainsHum.into()
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Mains)
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        if facts.finest_period_s > 1.0 / 120.0 {
            return Err("every record is sampled slower than twice the line frequency".to_owned());
        }
        let stroke = facts.stroke_um().max(1e-6);
        // Both nets within half a hertz; a twentieth of a hertz is seen in a second.
        let mut bounds = vec![Bounds::new(49.5, 60.5, 0.02, 50.0)];
        bounds.extend([Bounds::new(0.0, stroke, 1e-3 * stroke, 0.0); HARMONICS]);
        Ok(bounds)
    }

    fn starts(&self, _: &Facts, _: &[Bounds]) -> Vec<Vec<f64>> {
        [
            49.8, 49.9, 49.95, 50.0, 50.05, 50.1, 50.2, 59.8, 59.9, 59.95, 60.0, 60.05, 60.1, 60.2,
        ]
        .iter()
        .map(|&f| vec![f, 0.0, 0.0, 0.0, 0.0, 0.0])
        .collect()
    }

    fn acts(&self) -> Acts {
        Acts::Adds
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        let n = position_um.len();
        let mut amplitudes: [f64; HARMONICS] = std::array::from_fn(|k| values[1 + k].max(0.0));
        let rate_hz = 1.0 / signals.period_s;
        for (k, amplitude) in amplitudes.iter_mut().enumerate() {
            // What a record is too slow to show would come back folded.
            if (k + 1) as f64 * values[0] >= 0.5 * rate_hz {
                *amplitude = 0.0;
            }
        }
        let parts = (signals.own.len() / HARMONICS).max(1);
        let from = |part: usize| signals.run_in + part * (n - signals.run_in) / parts;
        for part in 0..parts {
            let own = signals.own.chunks(HARMONICS).nth(part).unwrap_or(&[]);
            // Before the record the mains were as at its start.
            let start = if part == 0 { 0 } else { from(part) };
            let to_middle_s =
                (from(part) as f64 - start as f64 + 0.5 * (from(part + 1) - from(part)) as f64) * signals.period_s;
            let phases = std::array::from_fn(|k| {
                let at_middle = own.get(k).copied().unwrap_or(0.0);
                (at_middle - TAU * (k + 1) as f64 * values[0] * to_middle_s).rem_euclid(TAU)
            });
            if let Ok(hum) = Hum::<f64, HARMONICS>::new(values[0], amplitudes, phases, rate_hz) {
                let mut state = hum.start();
                for y in &mut position_um[start..from(part + 1)] {
                    *y += hum.step(&mut state);
                }
            }
        }
    }

    fn adds_line_spectrum(&self) -> bool {
        true
    }

    fn has_own_numbers(&self) -> bool {
        true
    }

    /// Phases of each part of the record, at the part's middle, where frequency and phase are independent.
    fn settle(&self, values: &[f64], signals: &Signals<'_>, unexplained: &[f64], every: usize) -> Vec<f64> {
        let step_s = every as f64 * signals.period_s;
        let n = unexplained.len();
        let parts = ((n as f64 * step_s / PART_S).round() as usize).clamp(1, n.max(1));
        let from = |part: usize| part * n / parts;
        let phases = |part: usize| {
            let own = &unexplained[from(part)..from(part + 1)];
            let mean = own.iter().sum::<f64>() / own.len().max(1) as f64;
            let middle = 0.5 * own.len() as f64;
            (1..=HARMONICS).map(move |harmonic| {
                let (mut sin, mut cos) = (0.0, 0.0);
                for (k, &e) in own.iter().enumerate() {
                    let (s, c) = (TAU * harmonic as f64 * values[0] * (k as f64 - middle) * step_s).sin_cos();
                    sin += (e - mean) * s;
                    cos += (e - mean) * c;
                }
                cos.atan2(sin)
            })
        };
        (0..parts).flat_map(phases).collect()
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        Compensation::new(
            Compensator::Hum {
                frequency_hz: values[0],
                amplitudes_um: values[1..].to_vec(),
            },
            "half a hertz about each line; what a reference has there is taken for hum",
        )
    }
}

/// Parts of a record that have phases of their own, seconds: the line wanders by tens of millihertz, and a frequency that is
/// missed by as much keeps its phase in a second.
const PART_S: f64 = 1.0;
