//! `friction`

use crate::compensator::Compensation;
use crate::effect::{Acts, Bounds, Changes, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::restoring;
use hysteron_core::effects::restoring::{Memory, RestoringNumbers};

pub(crate) struct Friction;

static DESCRIPTION: Description = Description {
    name: EffectId::Friction.name(),
    place: Place::Structure,
    summary: "Guides rub: the moving mass sticks where it turns, and slides against a force that has one size.",
    equation: "q'' + 2 zeta w q' + w^2 (q + z) = w^2 y, dz = level / presliding (dq - |dq| z / (level g)), g = 1 + sticking / (1 + (q' / rate)^2)",
    source: "Dahl's friction with Stribeck's bump: Olsson, Astrom, Canudas de Wit, Gafvert, Lischinsky, Eur. J. Control 4 (1998) 176",
    parameters: &[
        Named {
            name: "frequency",
            unit: "Hz",
            what: "without friction, undamped",
        },
        Named {
            name: "damping",
            unit: "",
            what: "zeta of the mode, 0.001 to 0.95",
        },
        Named {
            name: "level",
            unit: "um",
            what: "friction in motion over the stiffness: the dead band is twice as wide",
        },
        Named {
            name: "presliding",
            unit: "um",
            what: "way after a turn in which friction comes to its level",
        },
        Named {
            name: "sticking",
            unit: "",
            what: "by how much more it holds at rest than in motion, 0 to 1",
        },
        Named {
            name: "rate",
            unit: "um/s",
            what: "rate at which half of that is left",
        },
    ],
    shows: "Dead bands at turns that ring does not follow; small motion is stiff and hardly rings, large motion rings as if damped; \
            after steps the position stops at random short of its place.",
    mistaken_for: "backlash (no force: a mass behind it swings freely), resonance with much damping, first-order-lag",
    separated_by: "The same multisine at two amplitudes: with friction the small one is stiffer and slower to ring.",
    compensated_by: "The inverse of the straight part; friction is left to the feedback.",
    scene: Scene::SlowSine,
};

fn numbers(values: &[f64]) -> RestoringNumbers {
    let (level, presliding) = (values[2], values[3]);
    RestoringNumbers {
        memory: Memory {
            stiffness: level / presliding,
            fading: 1.0 / presliding,
            lean: 0.0,
            sticking: values[4],
            sticking_to: values[5],
        },
        ..restoring::straight(values[0], values[1])
    }
}

impl Effect for Friction {
    fn name(&self) -> EffectName {
        EffectId::Friction.into()
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
        let fastest = std::f64::consts::PI * stroke / facts.finest_period_s;
        let more = vec![
            Bounds::new(0.0, 0.5 * stroke, 2e-3 * stroke, 0.0),
            Bounds::new(2e-4 * stroke, 0.2 * stroke, 1e-3 * stroke, 0.01 * stroke),
            Bounds::new(0.0, 1.0, 0.05, 0.0),
            Bounds::new(1e-6 * fastest, fastest, 1e-3 * fastest, 1e-2 * fastest),
        ];
        restoring::bounds(self, facts, more)
    }

    /// A drive that rubs hardly rings.
    fn hides_the_narrower(&self) -> bool {
        true
    }

    fn starts(&self, _: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let (lowest, highest) = (bounds[0].min, bounds[0].max);
        let steps = ((highest / lowest).ln() / 0.4).ceil().max(1.0);
        let each = (0..=steps as u32).map(|i| lowest * (highest / lowest).powf(f64::from(i) / steps));
        let stroke = 2.0 * bounds[2].max;
        each.map(|hz| {
            let rate = 0.03 * std::f64::consts::TAU * hz * stroke;
            restoring::within(vec![hz, 0.3, 0.05 * stroke, 0.005 * stroke, 0.2, rate], bounds)
        })
        .collect()
    }

    /// What friction damps, a straight mode has for its own damping.
    fn widened(&self, narrower: &[f64], facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let stroke = facts.stroke_um();
        let rate = 0.03 * std::f64::consts::TAU * narrower[0] * stroke;
        let start = |(damping, level): (f64, f64)| {
            let presliding = 0.1 * level * stroke;
            restoring::within(
                vec![
                    narrower[0],
                    damping * narrower[1],
                    level * stroke,
                    presliding,
                    0.2,
                    rate,
                ],
                bounds,
            )
        };
        [(0.7, 0.03), (1.5, 0.1)].map(start).to_vec()
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
            values[0],
            values[1],
            "friction is left to the feedback, which small steps wait for",
        )
    }
}
