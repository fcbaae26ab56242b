//! `cross-coupling`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use hysteron_core::effects::Block;
use hysteron_core::effects::coupling::Coupling;

pub(crate) struct CrossCoupling;

static DESCRIPTION: Description = Description {
    name: EffectId::CrossCoupling.name(),
    place: Place::Coupling,
    summary: "Motion of the other axis reaches this one.",
    equation: "y' = y + g u2 + d u2' + p F_r[u2], r a third of the other axis' span",
    source: "parallel kinematics and guiding errors: -60 to -30 dB, more near the other axis' mode",
    parameters: &[
        Named {
            name: "gain",
            unit: "um/V",
            what: "g, 0.1 to 3 % of the axis' own gain",
        },
        Named {
            name: "lead",
            unit: "um s/V",
            what: "d, what runs ahead of or behind the other axis",
        },
        Named {
            name: "play_weight",
            unit: "um/V",
            what: "p, the other axis' hysteresis",
        },
        Named {
            name: "threshold",
            unit: "V",
            what: "r; not fitted",
        },
    ],
    shows: "The error follows the other axis' voltage (column voltage2_v), also while this axis is at rest.",
    mistaken_for: "mains-hum, thermal-drift, crosstalk between sensors (same frequency, no lag)",
    separated_by: "This axis at rest, the other one moving, not in step with anything here.",
    compensated_by: "Feedforward from the other axis, static or with two biquads.",
    scene: Scene::OtherAxis,
};

impl Effect for CrossCoupling {
    fn name(&self) -> EffectName {
        EffectId::CrossCoupling.into()
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::OtherAxis)
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        let Some([low, high]) = facts.voltage2_v else {
            return Err("no record has a moving column voltage2_v; record the other axis' command".to_owned());
        };
        let span = high - low;
        // More than the whole stroke is no coupling but a confusion of axes.
        let most = facts.stroke_um() / span;
        let gain = Bounds::new(-most, most, 0.01 * most, 0.0);
        let slow = 1e-2 * most;
        Ok(vec![
            gain,
            Bounds::new(-slow, slow, 1e-5 * most, 0.0),
            gain,
            Bounds::fixed(span / 3.0),
        ])
    }

    fn acts(&self) -> Acts {
        Acts::Adds
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        let Some(&first) = signals.voltage2_v.and_then(<[f64]>::first) else {
            return;
        };
        let coupling = Coupling::<f64>::new(values[0], values[1], values[2], values[3], 1.0 / signals.period_s);
        if let (Ok(coupling), Some(voltage2_v)) = (coupling, signals.voltage2_v) {
            let mut state = coupling.rest_at(first);
            for &u in &voltage2_v[..signals.run_in] {
                coupling.step(&mut state, u);
            }
            for (y, &u) in position_um.iter_mut().zip(voltage2_v) {
                *y += coupling.step(&mut state, u);
            }
        }
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        Compensation::new(
            Compensator::Coupling {
                gain_um_per_v: values[0],
                lead_um_s_per_v: values[1],
                weight_um_per_v: values[2],
                threshold_v: values[3],
            },
            "needs the other axis' command as early as the reference",
        )
    }
}
