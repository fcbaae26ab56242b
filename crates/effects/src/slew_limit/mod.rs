//! `slew-limit`

use crate::compensator::Compensation;
use crate::effect::{Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::run;
use hysteron_core::effects::slew;

pub(crate) struct SlewLimit;

static DESCRIPTION: Description = Description {
    name: EffectId::SlewLimit.name(),
    place: Place::Amplifier,
    summary: "The amplifier's current is limited, and with it the rate at which it charges the stack.",
    equation: "|v'| <= I_max / C; added once more, the current that the amplifier takes has a limit of its own, -falling <= v' <= slew",
    source: "0.1 A into 1.8 uF: 56 kV/s, a full 200 Vpp sine only to 88 Hz",
    parameters: &[
        Named {
            name: "slew",
            unit: "V/s",
            what: "largest rate, above 0; reached by at least one record",
        },
        Named {
            name: "falling",
            unit: "V/s",
            what: "largest rate downward; 0, as upward, until the effect is added once more",
        },
    ],
    shows: "The velocity is clipped: above a threshold in amplitude times frequency sines turn into triangles, with a third \
            harmonic of up to a ninth; below it nothing is seen. Where the sides are unequal the triangle leans.",
    mistaken_for: "saturation (a threshold in amplitude alone), first-order-lag (no threshold)",
    separated_by: "The same amplitude at two frequencies, and the same product of both at another amplitude.",
    compensated_by: "Limit the rate of the reference when planning; anti-windup with the limiter's model.",
    scene: Scene::FastSine,
};

impl Effect for SlewLimit {
    fn name(&self) -> EffectName {
        EffectId::SlewLimit.into()
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Slew)
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        let peak = facts.peak_rate_v_per_s;
        if peak <= 0.0 {
            return Err("the voltage stands still in every record; a slew limit shows only in motion".to_owned());
        }
        // Above the records' own peak it does nothing; below a hundredth of it nothing would be left of fast records.
        let slew = Bounds::new(0.01 * peak, 2.0 * peak, 0.1 * peak, 2.0 * peak);
        let as_upward = Bounds {
            fitted: false,
            min: 0.0,
            neutral: 0.0,
            ..slew
        };
        Ok(vec![slew, as_upward])
    }

    fn free(&self, values: &[f64], bounds: &mut [Bounds]) {
        if values[1] != 0.0 {
            bounds[1] = Bounds {
                fitted: true,
                min: bounds[0].min,
                ..bounds[1]
            };
        }
    }

    fn once_more(&self, values: &[f64], _: &[Bounds]) -> Option<Vec<Vec<f64>>> {
        let [slew, falling] = [values[0], values[1]];
        // One limit lies between both, or at the one that more of the records reach.
        let sides = [[1.0, 0.7], [1.0, 1.4], [0.7, 1.0], [1.4, 1.0]];
        (falling == 0.0).then(|| sides.map(|sides| sides.map(|share| share * slew).to_vec()).to_vec())
    }

    fn starts(&self, facts: &Facts, _: &[Bounds]) -> Vec<Vec<f64>> {
        // Six a factor of two: a limit bites only between the peak rates of two records.
        (1..30)
            .map(|i| vec![facts.peak_rate_v_per_s * 0.5_f64.powf(f64::from(i) / 6.0), 0.0])
            .collect()
    }

    fn on_voltage(&self, values: &[f64], signals: &Signals<'_>, voltage_v: &mut [f64]) {
        let [slew, falling] = [values[0], values[1]];
        let falling = if falling == 0.0 { slew } else { falling };
        if let Ok(slew) = slew::SlewLimit::<f64>::unequal(slew, falling, 1.0 / signals.period_s) {
            run::block(&slew, signals.run_in, voltage_v);
        }
    }

    fn dynamic(&self) -> bool {
        true
    }

    fn compensation(&self, _: &[f64]) -> Compensation {
        Compensation::none("current that the amplifier lacks cannot be given; ask for slower references")
    }
}
