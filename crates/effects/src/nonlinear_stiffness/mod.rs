//! `nonlinear-stiffness`

use crate::compensator::Compensation;
use crate::effect::{Acts, Bounds, Changes, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::restoring;
use hysteron_core::effects::restoring::RestoringNumbers;

pub(crate) struct NonlinearStiffness;

static DESCRIPTION: Description = Description {
    name: EffectId::NonlinearStiffness.name(),
    place: Place::Structure,
    summary: "The flexures harden or soften as they bend, and the mode's frequency goes with its amplitude.",
    equation: "q'' + 2 zeta w q' + w^2 (q + r(q)) = w^2 y, r' = slope x + curve x^2, x = (q - middle) / half_stroke",
    source: "Kovacic, Brennan, The Duffing Equation (2011), ch. 1; flexures stretch as they bend",
    parameters: &[
        Named {
            name: "frequency",
            unit: "Hz",
            what: "small motion in the middle, undamped",
        },
        Named {
            name: "damping",
            unit: "",
            what: "zeta of the mode, 0.001 to 0.95",
        },
        Named {
            name: "middle",
            unit: "um",
            what: "middle of the recorded positions; not fitted",
        },
        Named {
            name: "half_stroke",
            unit: "um",
            what: "half of the recorded stroke; not fitted",
        },
        Named {
            name: "slope",
            unit: "",
            what: "change of the stiffness from the middle to the upper end that the lower end has with the other sign, -0.6 to 0.6",
        },
        Named {
            name: "curve",
            unit: "",
            what: "change of the stiffness towards both ends alike, -0.4 to 20; above 0 the spring hardens",
        },
    ],
    shows: "The peak of the response leans: to higher frequencies with the amplitude where the spring hardens, to lower ones where it \
            softens; sweeps up and down differ, and odd harmonics come with large motion.",
    mistaken_for: "resonance (the same frequency at every amplitude), sensor-nonlinearity (bends slow records alike)",
    separated_by: "The same multisine or sweep at two amplitudes: the peak of a straight mode stays.",
    compensated_by: "The inverse of the straight part; the bend is left to the feedback.",
    scene: Scene::Edge,
};

/// Small changes of the stiffness: the bounds of what a spring on flexures does.
const SLOPE: f64 = 0.6;
const CURVE: [f64; 2] = [-0.4, 20.0];

fn numbers(values: &[f64]) -> RestoringNumbers {
    RestoringNumbers {
        middle: values[2],
        half: values[3],
        stiffness: [values[4], values[5]],
        ..restoring::straight(values[0], values[1])
    }
}

impl Effect for NonlinearStiffness {
    fn name(&self) -> EffectName {
        EffectId::NonlinearStiffness.into()
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
        let half = 0.5 * facts.moving_stroke_um()?;
        let middle = 0.5 * (facts.position_um[0] + facts.position_um[1]);
        let more = vec![
            Bounds::fixed(middle),
            Bounds::fixed(half),
            Bounds::new(-SLOPE, SLOPE, 0.02, 0.0),
            Bounds::new(CURVE[0], CURVE[1], 0.05, 0.0),
        ];
        restoring::bounds(self, facts, more)
    }

    fn starts(&self, facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        restoring::starts(self, facts, bounds)
    }

    /// In the middle of a spring that hardens the mode is slower than what large motion shows.
    fn widened(&self, narrower: &[f64], facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let middle = 0.5 * (facts.position_um[0] + facts.position_um[1]);
        let start = |(share, curve): (f64, f64)| {
            restoring::within(
                vec![
                    share * narrower[0],
                    narrower[1],
                    middle,
                    0.5 * facts.stroke_um(),
                    0.0,
                    curve,
                ],
                bounds,
            )
        };
        [(0.95, 0.4), (1.03, -0.15)].map(start).to_vec()
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
            "the spring is straight to the inverse: large fast motion is left to the feedback",
        )
    }
}
