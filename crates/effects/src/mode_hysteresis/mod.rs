//! `mode-hysteresis`

use crate::compensator::Compensation;
use crate::effect::{Acts, Bounds, Changes, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::restoring;
use hysteron_core::effects::restoring::{Memory, RestoringNumbers};

pub(crate) struct ModeHysteresis;

static DESCRIPTION: Description = Description {
    name: EffectId::ModeHysteresis.name(),
    place: Place::Structure,
    summary: "The restoring force of the mode has a loop: joints and elastomers give way as they are bent.",
    equation: "q'' + 2 zeta w q' + w^2 (q + z) = w^2 y, dz = stiffness dq - fading |dq| z - lean dq |z|",
    source: "Bouc and Wen's with an exponent of 1: Ismail, Ikhouane, Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161",
    parameters: &[
        Named {
            name: "frequency",
            unit: "Hz",
            what: "without the loop's stiffness, undamped",
        },
        Named {
            name: "damping",
            unit: "",
            what: "zeta of the mode, 0.001 to 0.95",
        },
        Named {
            name: "stiffness",
            unit: "",
            what: "of the loop after a turn, over that of the spring beside it, 0 to 20",
        },
        Named {
            name: "fading",
            unit: "1/um",
            what: "how fast the loop's force forgets along the motion",
        },
        Named {
            name: "lean",
            unit: "1/um",
            what: "below 0 the loop opens outwards, above it inwards",
        },
    ],
    shows: "The mode is stiffer, and rings longer, in small motion than in large; the loop of a fast record is wider near the mode \
            and does not have the shape of a slow one.",
    mistaken_for: "nonlinear-stiffness (no loop), friction (slides at one force), rate-dependence (no mode)",
    separated_by: "The same multisine at two amplitudes: both frequency and damping change with it.",
    compensated_by: "The inverse of the straight part; the loop is left to the feedback.",
    scene: Scene::Edge,
};

/// A loop may be so many times as stiff as the spring.
const STIFFEST: f64 = 20.0;

fn numbers(values: &[f64]) -> RestoringNumbers {
    RestoringNumbers {
        memory: Memory {
            stiffness: values[2],
            fading: values[3],
            lean: values[4],
            ..Memory::default()
        },
        ..restoring::straight(values[0], values[1])
    }
}

impl Effect for ModeHysteresis {
    fn name(&self) -> EffectName {
        EffectId::ModeHysteresis.into()
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Phase)
    }

    fn widens(&self) -> Option<EffectId> {
        Some(EffectId::Resonance)
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        let stroke = facts.moving_stroke_um()?;
        let more = vec![
            Bounds::new(0.0, STIFFEST, 0.02, 0.0),
            Bounds::new(0.0, 100.0 / stroke, 0.1 / stroke, 2.0 / stroke),
            Bounds::new(-50.0 / stroke, 50.0 / stroke, 0.1 / stroke, 0.0),
        ];
        restoring::bounds(self, facts, more)
    }

    fn starts(&self, facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        restoring::starts(self, facts, bounds)
    }

    /// A straight mode is as stiff as the loop and the spring together, somewhere between small and large motion.
    fn widened(&self, narrower: &[f64], facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let stroke = facts.stroke_um();
        let start = |(stiffness, fading, lean, stiffer): (f64, f64, f64, f64)| {
            let frequency = narrower[0] / f64::sqrt(stiffer);
            restoring::within(
                vec![frequency, 0.3 * narrower[1], stiffness, fading / stroke, lean / stroke],
                bounds,
            )
        };
        [
            (0.5, 2.0, 0.0, 1.4),
            (1.0, 8.0, 0.0, 1.5),
            (1.0, 3.0, -4.0, 2.4),
            (0.5, 2.0, 2.0, 1.4),
        ]
        .map(start)
        .to_vec()
    }

    fn acts(&self) -> Acts {
        Acts::Nonlinearly
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        restoring::run(&numbers(values), signals, position_um);
    }

    fn on_change(&self, values: &[f64], signals: &Signals<'_>, position_um: &[f64], change: &mut [f64]) {
        restoring::change(&numbers(values), *signals, position_um, change);
    }

    fn on_changes<'a>(&'a self, values: &'a [f64], signals: Signals<'a>, position_um: &'a [f64]) -> Changes<'a> {
        restoring::changes(&numbers(values), signals, position_um)
    }

    fn dynamic(&self) -> bool {
        true
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        restoring::undone(
            values[0] * f64::sqrt(1.0 + values[2]),
            values[1],
            "the mode of small motion is undone; the loop is left to the feedback",
        )
    }
}
