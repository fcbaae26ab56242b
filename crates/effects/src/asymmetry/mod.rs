//! `asymmetry`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};

pub(crate) struct Asymmetry;

static DESCRIPTION: Description = Description {
    name: EffectId::Asymmetry.name(),
    place: Place::Hysteresis,
    summary: "Both branches of the loop bend in the same way: the gain depends on the voltage.",
    equation: "y' = y + b2 v^2 + b3 v^3, v against the middle of the records' voltages",
    source: "the input function g of the paper's eqs 6 and 10 (Gu, Zhu, Su 2014)",
    parameters: &[
        Named {
            name: "middle",
            unit: "V",
            what: "middle of the records' voltages; not fitted",
        },
        Named {
            name: "quadratic",
            unit: "um/V^2",
            what: "b2; bends by 1 to 5 % of the range",
        },
        Named {
            name: "cubic",
            unit: "um/V^3",
            what: "b3; bends by 1 to 5 % of the range",
        },
    ],
    shows: "The error is a polynomial of the voltage, the same on both branches, down to the lowest frequency; up-branch and \
            down-branch differ in curvature.",
    mistaken_for: "sensor-nonlinearity (a function of the position instead), the onset of saturation, play weights that \
                   depend on the bias",
    separated_by: "The error drawn over voltage and over position, at a frequency where the two part: which one overlays \
                   the branches? Full-range against half-range records; a second sensor.",
    compensated_by: "A cubic in the inverse, four operations.",
    scene: Scene::SlowSine,
};

impl Effect for Asymmetry {
    fn name(&self) -> EffectName {
        EffectId::Asymmetry.into()
    }

    fn of_the_shape(&self) -> bool {
        true
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
        let (half, stroke) = (0.5 * facts.span_v(), facts.stroke_um());
        if !(half > 0.0 && stroke > 0.0) {
            return Err("nothing moves in these records".to_owned());
        }
        if facts.family.input_powers().contains(&2) {
            return Err(format!(
                "the model's hysteresis ({}) has a free input function already",
                facts.family
            ));
        }
        // No stack bends by more than its stroke.
        let amplitude = |power: i32| {
            let most = stroke / half.powi(power);
            Bounds::new(-most, most, 0.01 * most, 0.0)
        };
        let middle = 0.5 * (facts.voltage_v[0] + facts.voltage_v[1]);
        Ok(vec![Bounds::fixed(middle), amplitude(2), amplitude(3)])
    }

    fn acts(&self) -> Acts {
        Acts::Adds
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        let [middle, quadratic, cubic] = [values[0], values[1], values[2]];
        for (y, &v) in position_um.iter_mut().zip(signals.at_stack_v) {
            let v = v - middle;
            *y += v * v * (quadratic + cubic * v);
        }
    }

    fn compensation(&self, _: &[f64]) -> Compensation {
        Compensation::new(Compensator::HysteresisInverse, "part of the table that is inverted")
    }
}
