//! `amplitude-gain`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Bounds, Description, Effect, Facts, Mark, Place, Scene, Shape};
use crate::family::MAX_PLAYS;
use crate::id::{EffectId, EffectName};

pub(crate) struct AmplitudeGain;

static DESCRIPTION: Description = Description {
    name: EffectId::AmplitudeGain.name(),
    place: Place::Hysteresis,
    summary: "Gain and loop opening grow from small to large strokes, below the model's smallest threshold.",
    equation: "plays with logarithmically spaced thresholds from 0.1 % of the span up, beside the model's own",
    source: "Rayleigh law, y = (d0 + a E0) E -+ a (E0^2 - E^2) / 2: a Prandtl-Ishlinskii model of even density",
    parameters: &[],
    shows: "Gain and opening over an amplitude ladder: 2 % opening at small signal, 10 to 15 % at full stroke, gain 20 to \
            60 % higher. With thresholds at (i - 1)/N of the span the model is strictly linear below 10 %.",
    mistaken_for: "backlash (an opening of constant width), thermal-drift of the gain",
    separated_by: "An amplitude ladder of 1, 2, 5, 10, 25, 50, 100 %.",
    compensated_by: "The same thresholds in the inverse; ten are enough.",
    scene: Scene::Ladder,
};

/// Smallest added threshold as a share of the span: below it loops of piezo ceramics close.
const SMALLEST: f64 = 1e-3;

/// Added thresholds, three a decade up to a tenth of the span.
const ADDED: usize = 7;

/// Thresholds with up to seven more, three a decade from a thousandth to a tenth of the span: a gain that grows from small
/// strokes on.
///
/// # Units
/// That of the thresholds, for the span as well.
pub fn with_small_plays(thresholds: &[f64], span: f64) -> Vec<f64> {
    let mut all = thresholds.to_vec();
    for i in 0..ADDED {
        let new = span * SMALLEST * 10f64.powf(i as f64 / 3.0);
        // Closer than a quarter to one that is there, a play tells nothing new.
        if !all.iter().any(|r| (r / new).ln().abs() < 0.25) {
            all.push(new);
        }
    }
    all.sort_by(f64::total_cmp);
    all
}

impl Effect for AmplitudeGain {
    fn name(&self) -> EffectName {
        EffectId::AmplitudeGain.into()
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

    fn reshape(&self, shape: &Shape, facts: &Facts, _: &dyn Fn(usize) -> Vec<f64>) -> Option<Shape> {
        let thresholds = with_small_plays(&shape.thresholds, facts.span_v());
        let added = thresholds.len() > shape.thresholds.len();
        (added && thresholds.len() <= MAX_PLAYS).then_some(Shape {
            family: shape.family,
            thresholds,
        })
    }

    fn compensation(&self, _: &[f64]) -> Compensation {
        Compensation::new(Compensator::HysteresisInverse, "part of the table that is inverted")
    }
}
