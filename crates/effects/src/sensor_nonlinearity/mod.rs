//! `sensor-nonlinearity`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use hysteron_core::effects::sensor::SensorCurve;

pub(crate) struct SensorNonlinearity;

static DESCRIPTION: Description = Description {
    name: EffectId::SensorNonlinearity.name(),
    place: Place::Sensor,
    summary: "The sensor's reading bends over its range.",
    equation: "y_m = y + c2 y^2 + c3 y^3, y against the middle of the records' positions",
    source: "capacitive sensors 0.01 to 0.1 % of the range, strain gauges 0.1 to 0.5 %",
    parameters: &[
        Named {
            name: "middle",
            unit: "um",
            what: "middle of the records' positions; not fitted",
        },
        Named {
            name: "quadratic",
            unit: "1/um",
            what: "c2",
        },
        Named {
            name: "cubic",
            unit: "1/um^2",
            what: "c3",
        },
    ],
    shows: "The error is a function of the position alone, at every frequency and on both branches. In closed loop it is \
            invisible: the loop follows the wrong sensor.",
    mistaken_for: "asymmetry (a function of the voltage instead): the same thing in slow records of one amplitude",
    separated_by: "Records fast enough for position and voltage to part, or a second sensor (interferometer).",
    compensated_by: "The inverse polynomial on the reading.",
    scene: Scene::SlowSine,
};

/// A reading may be so many times steeper towards the ends than it may be flatter there.
const STEEPEST: f64 = 3.0;

impl Effect for SensorNonlinearity {
    fn name(&self) -> EffectName {
        EffectId::SensorNonlinearity.into()
    }

    fn bends_the_loops(&self) -> bool {
        true
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Position)
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        let half = 0.5 * facts.moving_stroke_um()?;
        // A reading must grow with the position: slopes down to a half at the ends, and up to two and a half.
        let (c2, c3) = (0.25 / half, 0.16 / (half * half));
        let middle = 0.5 * (facts.position_um[0] + facts.position_um[1]);
        Ok(vec![
            Bounds::fixed(middle),
            Bounds::new(-c2, c2, 0.02 * c2, 0.0),
            Bounds::new(-c3, STEEPEST * c3, 0.02 * c3, 0.0),
        ])
    }

    /// Plays with polynomials take a part of any bend: from a straight curve the way down ends in a valley of theirs.
    fn starts(&self, _: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let start = |(c2, c3): (f64, f64)| vec![bounds[0].neutral, c2 * bounds[1].max, c3 * -bounds[2].min];
        let cubic = [-0.7, -0.3, 0.0, 0.3, 0.9, 1.8, 2.7].map(|c3| (0.0, c3));
        let quadratic = [(-0.5, 0.0), (0.5, 0.0)];
        cubic.into_iter().chain(quadratic).map(start).collect()
    }

    fn acts(&self) -> Acts {
        Acts::Nonlinearly
    }

    fn on_position(&self, values: &[f64], _: &Signals<'_>, position_um: &mut [f64]) {
        if let Ok(curve) = SensorCurve::new(values[1], values[2]) {
            position_um
                .iter_mut()
                .for_each(|y| *y = values[0] + curve.reading(*y - values[0]));
        }
    }

    fn on_change(&self, values: &[f64], _: &Signals<'_>, position_um: &[f64], change: &mut [f64]) {
        if let Ok(curve) = SensorCurve::new(values[1], values[2]) {
            change
                .iter_mut()
                .zip(position_um)
                .for_each(|(change, y)| *change *= curve.slope(*y - values[0]));
        }
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        Compensation::new(
            Compensator::SensorCurve {
                middle_um: values[0],
                quadratic_per_um: values[1],
                cubic_per_um2: values[2],
            },
            "as good as the records tell it from a bent hysteresis",
        )
    }
}
