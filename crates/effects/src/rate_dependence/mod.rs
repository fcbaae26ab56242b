//! `rate-dependence`

use crate::compensator::Compensation;
use crate::effect::{Bounds, Description, Effect, Facts, Mark, Named, Place, RateLaw, Scene};
use crate::family::Family;
use crate::id::{EffectId, EffectName};
use hysteron_core::envelope::Envelope;
use std::f64::consts::PI;
use std::sync::Arc;

pub(crate) struct RateDependence;

const ALPHA: Named = Named {
    name: "alpha",
    unit: "s",
    what: "widening on the way up, 0 to 1 ms (the paper: 21.5 us)",
};

const BETA: Named = Named {
    name: "beta",
    unit: "s",
    what: "widening on the way down, 0 to 1 ms (the paper: 21.2 us)",
};

static DESCRIPTION: Description = Description {
    name: EffectId::RateDependence.name(),
    place: Place::Hysteresis,
    summary: "The hysteresis itself widens with the rate of the voltage; the linear path does not.",
    equation: "w_i = max(v - alpha f - r_i, min(v + beta f, w_i)), \
               f = |v'| (|v'| / reference)^(exponent - 1)",
    source: "the paper's eqs 8 to 10 (exponent 1), without the operator of no width: that one is a delay; \
             excess losses go with 1/2",
    parameters: &[
        ALPHA,
        BETA,
        Named {
            name: "exponent",
            unit: "",
            what: "1: in proportion to the rate (the paper); 1/2: as excess loss; towards 0.1: as a logarithm",
        },
        Named {
            name: "reference",
            unit: "V/s",
            what: "rate at which the exponent does not matter: that of a full sine of 100 Hz; not fitted",
        },
    ],
    shows: "Loops open with frequency at a fixed amplitude; a small signal at a bias shows nothing of it.",
    mistaken_for: "delay, first-order-lag, resonance: all open loops like sin(phase). Genuine material rate dependence is \
                   weak and logarithmic, so an opening linear in frequency is an alarm for a lag.",
    separated_by: "A small signal at a bias (500 Hz, 1 Vpp at 13 V: -0.5 degrees for the operators against -18 for a \
                   delay of 100 us), the same frequency at two amplitudes, triangle against sine.",
    compensated_by: "The inverse with dynamic envelopes, with the derivative of the reference, not of the sensor.",
    scene: Scene::FastSine,
};

/// Largest alpha and beta, seconds: five times the paper's figure-1 example.
const LARGEST_S: f64 = 1e-3;

/// Exponents of the rate: a logarithm over three decades of it passes for the least.
const EXPONENTS: [f64; 2] = [0.1, 1.5];

/// Frequency of the full sine whose rate is the reference, hertz.
const REFERENCE_HZ: f64 = 100.0;

impl Effect for RateDependence {
    fn name(&self) -> EffectName {
        EffectId::RateDependence.into()
    }

    /// A longer envelope is a lag.
    fn refuted_on_bound(&self, parameter: &str) -> bool {
        parameter == "alpha" || parameter == "beta"
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Rate)
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        if matches!(facts.family, Family::Mrpi | Family::Wrpi) {
            return Err(format!(
                "the model's hysteresis ({}) depends on the rate already",
                facts.family
            ));
        }
        let time = Bounds::new(0.0, LARGEST_S, facts.finest_period_s, 0.0);
        let [lowest, highest] = EXPONENTS;
        let reference = PI * REFERENCE_HZ * facts.span_v();
        Ok(vec![
            time,
            time,
            Bounds::new(lowest, highest, 0.1, 1.0),
            Bounds::fixed(reference),
        ])
    }

    fn starts(&self, _: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
        let reference = bounds[3].neutral;
        let times = [1e-5, 3e-5, 1e-4, 3e-4];
        let linear = times.iter().flat_map(|&t| {
            [
                vec![t, t, 1.0, reference],
                vec![t, 0.0, 1.0, reference],
                vec![0.0, t, 1.0, reference],
            ]
        });
        let power = |exponent: f64| times.iter().map(move |&t| vec![t, t, exponent, reference]);
        linear.chain(power(0.5)).chain(power(0.2)).collect()
    }

    fn envelope(&self, values: &[f64]) -> Option<Envelope<f64>> {
        Some(Envelope {
            alpha_s: values[0],
            beta_s: values[1],
        })
    }

    fn rate_law(&self, values: &[f64]) -> RateLaw {
        RateLaw {
            exponent: values[2],
            reference_v_per_s: values[3],
        }
    }

    fn compensation(&self, _: &[f64]) -> Compensation {
        Compensation::none(
            "the inverse at rest is static; learn whether a delay, a lag or a mode is what widens the loops",
        )
    }
}

/// Alpha and beta of a family that has them, as a link of the chain that is fitted with the effects; no effect of its own.
pub struct OfFamily;

static OF_FAMILY: Description = Description {
    name: "envelope of the family",
    equation: "the paper's eq. 9, for all plays",
    parameters: &[ALPHA, BETA],
    ..DESCRIPTION
};

impl Effect for OfFamily {
    fn name(&self) -> EffectName {
        EffectId::RateDependence.into()
    }

    fn description(&self) -> &'static Description {
        &OF_FAMILY
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        Ok(vec![Bounds::new(0.0, LARGEST_S, facts.finest_period_s, 0.0); 2])
    }

    fn free(&self, values: &[f64], bounds: &mut [Bounds]) {
        for (b, &value) in bounds.iter_mut().zip(values) {
            (b.min, b.max) = (b.min.min(value), b.max.max(value));
        }
    }

    fn envelope(&self, values: &[f64]) -> Option<Envelope<f64>> {
        RateDependence.envelope(values)
    }

    fn outside_family(&self) -> Option<Arc<dyn Effect>> {
        Some(Arc::new(RateDependence))
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        RateDependence.compensation(values)
    }
}
