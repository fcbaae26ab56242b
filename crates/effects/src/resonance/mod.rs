//! `resonance`

use crate::compensator::{Compensation, Compensator, StageMode};
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::run;
use hysteron_core::effects::resonance::Mode;

pub(crate) struct Resonance;

static DESCRIPTION: Description = Description {
    name: EffectId::Resonance.name(),
    place: Place::Structure,
    summary: "The moving mass on its flexures rings: one mode, or two driven by the same force.",
    equation: "y' = (1 - s) M1 y + s M2 y, M_i: q'' + 2 zeta_i w_i q' + w_i^2 q = w_i^2 y",
    source: "flexure stages: 200 to 2500 Hz, zeta 0.005 to 0.03; stiff parallel stages above 10 kHz",
    parameters: &[
        Named {
            name: "frequency",
            unit: "Hz",
            what: "first mode, undamped",
        },
        Named {
            name: "damping",
            unit: "",
            what: "zeta of the first mode, 0.001 to 0.1",
        },
        Named {
            name: "frequency_2",
            unit: "Hz",
            what: "second mode",
        },
        Named {
            name: "damping_2",
            unit: "",
            what: "zeta of the second mode, 0.001 to 0.1",
        },
        Named {
            name: "share_2",
            unit: "",
            what: "the second mode's part of the static displacement, -1 to 1; 0: one mode",
        },
    ],
    shows: "Ringing at one frequency after steps and turning points, whatever the drive; a peak in the frequency response; \
            well below it the gain rises with (f / f1)^2, 4.2 % at 500 Hz for 2.5 kHz, while the phase falls in a straight line.",
    mistaken_for: "delay (the same phase, but a delay never raises the gain), cross-coupling (the other axis' mode appears)",
    separated_by: "A small multisine or a step at a rate that shows the ringing; the sign of the gain's change at high frequency.",
    compensated_by: "Notch filters (one a mode), damping by feedback, input shaping, or feedforward y + 2 zeta/w y' + y''/w^2.",
    scene: Scene::Edge,
};

/// Above this a structure with its payload is a delay to any controller here, hertz.
const HIGHEST_HZ: f64 = 2e4;

/// Records of a second and less show modes from here on, hertz; below [`LOWEST_HZ`] no stage has one.
const LOWEST_USUAL_HZ: f64 = 20.0;
const LOWEST_HZ: f64 = 1.0;

/// Periods of a mode in the longest record, at the least: a slower one is a creep to these records.
const LEAST_PERIODS: f64 = 20.0;

impl Effect for Resonance {
    fn name(&self) -> EffectName {
        EffectId::Resonance.into()
    }

    /// More damping imitates lag and delay.
    fn refuted_on_bound(&self, parameter: &str) -> bool {
        parameter == "damping" || parameter == "frequency"
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Phase)
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        // Ringing at the grid's Nyquist frequency and above would come back folded.
        let highest = (0.45 / facts.finest_grid_s).min(HIGHEST_HZ);
        let lowest = (LEAST_PERIODS / facts.longest_s)
            .clamp(LOWEST_HZ, LOWEST_USUAL_HZ)
            .min(0.1 * highest);
        let frequency = |neutral: f64| Bounds::new(lowest, highest, 0.02 * highest, neutral);
        // More damping than 0.1 imitates lag and delay.
        let damping = Bounds::new(1e-3, 0.1, 0.01, 0.02);
        // The second mode waits until the effect is added once more.
        let later = |bounds: Bounds| Bounds {
            fitted: false,
            ..bounds
        };
        Ok(vec![
            frequency(highest),
            damping,
            later(frequency(highest)),
            later(damping),
            later(Bounds::new(-1.0, 1.0, 0.05, 0.0)),
        ])
    }

    fn free(&self, values: &[f64], bounds: &mut [Bounds]) {
        if values[4] != 0.0 {
            bounds.iter_mut().for_each(|b| b.fitted = true);
        }
    }

    fn once_more(&self, values: &[f64], bounds: &[Bounds]) -> Option<Vec<Vec<f64>>> {
        let (lowest, highest) = (bounds[2].min, bounds[2].max);
        let second = |i: u32| lowest * (highest / lowest).powf(f64::from(i) / 48.0);
        (values[4] == 0.0).then(|| {
            (0..=48)
                .map(|i| vec![values[0], values[1], second(i), 0.03, 0.01])
                .collect()
        })
    }

    fn starts(&self, _: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let (lowest, highest) = (bounds[0].min, bounds[0].max);
        let one = |f: f64, zeta: f64| vec![f, zeta, highest, 0.02, 0.0];
        // A light mode's valley is as narrow as its peak: 2 zeta of the frequency.
        let steps = ((highest / lowest).ln() / 0.05).ceil();
        (0..=steps as u32)
            .map(|i| lowest * (highest / lowest).powf(f64::from(i) / steps))
            .map(|f| one(f, 0.03))
            .collect()
    }

    fn acts(&self) -> Acts {
        Acts::Linearly
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        let rate_hz = 1.0 / signals.period_s;
        let (Ok(first), Ok(second)) = (
            Mode::<f64>::new(values[0], values[1], rate_hz),
            Mode::<f64>::new(values[2], values[3], rate_hz),
        ) else {
            return;
        };
        let share = values[4];
        if share == 0.0 {
            run::mode(&first, signals.run_in, position_um);
            return;
        }
        let mut other = position_um.to_vec();
        run::mode(&first, signals.run_in, position_um);
        run::mode(&second, signals.run_in, &mut other);
        position_um
            .iter_mut()
            .zip(&other)
            .for_each(|(y, other)| *y += share * (other - *y));
    }

    fn on_positions(&self, values: &[f64], signals: &Signals<'_>, positions_um: &mut [Vec<f64>]) {
        match Mode::<f64>::new(values[0], values[1], 1.0 / signals.period_s) {
            Ok(only) if values[4] == 0.0 => run::modes(&only, signals.run_in, positions_um),
            _ => positions_um
                .iter_mut()
                .for_each(|position_um| self.on_position(values, signals, position_um)),
        }
    }

    fn dynamic(&self) -> bool {
        true
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        let mode = |frequency_hz, damping, share| StageMode {
            frequency_hz,
            damping,
            share,
        };
        let share_2 = values[4];
        let mut modes = vec![mode(values[0], values[1], 1.0 - share_2)];
        if share_2 != 0.0 {
            modes.push(mode(values[2], values[3], share_2));
            modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        }
        Compensation::new(
            Compensator::Modes(modes),
            "1 % of the mode's frequency is 0.7 % of error near it; identify again when the load changes",
        )
    }
}
