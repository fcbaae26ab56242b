//! `hysteresis-shape`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Bounds, Description, Effect, Facts, Mark, Place, Scene, Shape};
use crate::family::{FREE_PLAYS, Family};
use crate::id::{EffectId, EffectName};

pub(crate) struct HysteresisShape;

/// The step of a ladder that gives a model the free shape.
pub const FREE_SHAPE: EffectId = EffectId::HysteresisShape;

static DESCRIPTION: Description = Description {
    name: EffectId::HysteresisShape.name(),
    place: Place::Hysteresis,
    summary: "The family of play operators is too poor for this stage's loops: nothing physical is missing.",
    equation: "y = c + g(v) + sum (q1 w_i + q2 w_i^2 + q3 w_i^3), g of degree 5, at least 18 plays where the records exercise them; or \
               w a fading element, dz = |dv| (v^k - z) / L, k from 1 to 3, four lengths L, where that foretells the records better",
    source: "a Preisach operator is an integral of functions of play outputs (Krejci 1996); Duhem's kind does not close its small loops (Coleman, Hodgdon 1986)",
    parameters: &[],
    shows: "An error that repeats with the drive at every rate, even the lowest; equal minor loops at different biases \
            differ (10 to 40 % in opening), first-order reversal curves are no translates of each other.",
    mistaken_for: "asymmetry, sensor-nonlinearity, backlash: a free shape absorbs nearly all of them",
    separated_by: "Three equal minor loops at three biases and a decaying triangle, slowly.",
    compensated_by: "A play-polynomial or generalised model in the inverse; more plays.",
    scene: Scene::Ladder,
};

impl Effect for HysteresisShape {
    fn name(&self) -> EffectName {
        EffectId::HysteresisShape.into()
    }

    fn of_the_shape(&self) -> bool {
        true
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Position)
    }

    fn bounds(&self, _: &Facts) -> Result<Vec<Bounds>, String> {
        Ok(Vec::new())
    }

    fn reshape(&self, shape: &Shape, _: &Facts, place: &dyn Fn(usize) -> Vec<f64>) -> Option<Shape> {
        (shape.family != Family::PlayPolynomial).then(|| Shape {
            family: Family::PlayPolynomial,
            thresholds: place(FREE_PLAYS.max(shape.thresholds.len())),
        })
    }

    fn compensation(&self, _: &[f64]) -> Compensation {
        Compensation::new(Compensator::HysteresisInverse, "part of the table that is inverted")
    }
}
