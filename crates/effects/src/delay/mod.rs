//! `delay`

use crate::compensator::{Compensation, Compensator};
use crate::effect::{Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use crate::run;
use hysteron_core::effects::delay;

pub(crate) struct Delay;

static DESCRIPTION: Description = Description {
    name: EffectId::Delay.name(),
    place: Place::Delay,
    summary: "Everything arrives late by the same time: sampling, computing, converters, the sensor's electronics.",
    equation: "v'(t) = v(t - tau)",
    source: "hold, computing and converters of a digital loop: 1.5 sample periods; digital sensor electronics up to about 100 us",
    parameters: &[Named {
        name: "delay",
        unit: "s",
        what: "tau, 0 to 5 ms; 30 us for one and a half samples at 50 kHz",
    }],
    shows: "The error is proportional to the rate of the position, at all amplitudes and biases alike; the phase falls in \
            a straight line with frequency while the gain stays; after a step there is a dead time.",
    mistaken_for: "first-order-lag (same phase, but its gain falls), resonance (same phase, but its gain rises), \
                   rate-dependence (an envelope with alpha = beta = tau is v(t - tau) to first order)",
    separated_by: "A small multisine at a bias, up to 1/(5 tau) or higher: gain and phase there belong to the linear path \
                   alone. The edge of a step tells dead time from rounding.",
    compensated_by: "Advance the reference by tau (preview) in the feedforward; in the loop less gain or a Smith predictor.",
    scene: Scene::FastSine,
};

/// No controller or sensor is slower, seconds.
const LONGEST_S: f64 = 5e-3;

/// The host's ring, samples: 80 ms at 50 kHz.
const CAPACITY: usize = 4096;

/// A series so much later, seconds: from rest at its first value, or in the steady state of the period that it starts with, as many
/// samples as `run_in`.
///
/// At most 4092 samples later.
pub fn late(delay_s: f64, period_s: f64, run_in: usize, series: &mut [f64]) {
    let longest_s = (CAPACITY - 4) as f64 * period_s;
    if let Ok(delay) = delay::Delay::<f64, CAPACITY>::new(delay_s.clamp(0.0, longest_s), 1.0 / period_s) {
        run::block(&delay, run_in, series);
    }
}

impl Effect for Delay {
    fn name(&self) -> EffectName {
        EffectId::Delay.into()
    }

    fn refuted_on_bound(&self, _: &str) -> bool {
        true
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Phase)
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        Ok(vec![Bounds::new(0.0, LONGEST_S, facts.finest_period_s, 0.0)])
    }

    fn starts(&self, _: &Facts, _: &[Bounds]) -> Vec<Vec<f64>> {
        // From a fiftieth of a 50 kHz sample's order up, three a decade.
        [1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3]
            .iter()
            .map(|&tau| vec![tau])
            .collect()
    }

    fn on_voltage(&self, values: &[f64], signals: &Signals<'_>, voltage_v: &mut [f64]) {
        late(values[0], signals.period_s, signals.run_in, voltage_v);
    }

    fn dynamic(&self) -> bool {
        true
    }

    fn compensation(&self, values: &[f64]) -> Compensation {
        Compensation::new(
            Compensator::Delay { delay_s: values[0] },
            "counted to the command's way; a sensor that is late as a whole looks the same in records",
        )
    }
}
