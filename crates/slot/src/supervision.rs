//! How far a stage may be from where a table expects it.

use crate::{Numbers, Sweep};

/// The integral beside an inverse without a chain around it may be as large as this, as a share of the inverse's span: above what
/// hysteresis, creep and drift leave to it. A stage without an inverse has loops of 15 to 23 % up to 100 Hz (the paper's openings), and
/// creeps by a few percent.
const BESIDE_AN_INVERSE: f64 = 0.3;
/// What a complete law in open loop may be off by, as a share of the range: 2 % of gain and as much of creep and drift.
const OPEN_LOOP: f64 = 0.0375;
/// Rms of what a model is known to miss on a record to what it may be off by at once. Peaks on the references of `hysteron rehearse`, with
/// the effect left out of the model: 1.4 of it where a delay or lag is missing and the error a sine, 2.7 where another axis is. A history's
/// errors have peaks of 3, as for the feedback's bound; the rest is for references that no record is like.
const PEAK_OF_RMS: f64 = 4.0;
/// Whatever the model is known to miss, a departure of this share of the range is that of another stage or sensor: half the gain shows
/// two fifths of the range above the rest, a sensor that stands still after a fifth of it, a reversed one after a tenth.
const OPEN_LOOP_AT_MOST: f64 = 0.2;
/// Of what the feedback may take away, beyond which sensor and model are not of one stage.
const BEYOND_TRUST: f64 = 1.5;
/// A lightly damped mode doubles a step of the command, and an inverse without the mode does not see it coming.
const OVERSHOOT: f64 = 2.0;
/// What a chain with the mode in it leaves of a step.
const OVERSHOOT_OF_A_CHAIN: f64 = 0.5;

/// Least that the feedback is trusted with, as a share of the range: 2 % of gain, and creep and drift that no model has. It is also less
/// than 5 % of a reference over half of the range and more, which is as far as any sensor may take the platform beyond it.
pub const LEAST_TRUST: f64 = 0.025;

impl<const N: usize> Numbers<N> {
    /// How far the platform may be from where a complete law in open loop expects it, micrometres: 3.75 % of the range, or four times
    /// what the model misses on its records, up to a fifth of the range; none of a table with feedback or without a complete law.
    ///
    /// The sensor moves nothing in open loop: the bound only tells whether stage and sensor are the model's, which is known by how far it
    /// misses. A model that says nothing of that gets the least.
    pub fn open_loop_departure_um(&self) -> Option<f64> {
        let chain = self.chain.as_ref().filter(|chain| chain.feedback.is_none())?;
        let range_um = self.input_max_um - self.input_min_um;
        let missed_um = chain.model_error_um.unwrap_or(0.0);
        let known_um = (PEAK_OF_RMS * missed_um).min(OPEN_LOOP_AT_MOST * range_um);
        Some(known_um.max(OPEN_LOOP * range_um))
    }

    /// How far a stage may depart from what the law expects, volts: beyond it, stage or sensor is not the one that the table is of.
    ///
    /// Of a complete law the error, in volts where the inverse is flattest, with what the feedback added; of an inverse alone the integral.
    pub fn departure_v(&self, sweep: &Sweep) -> f64 {
        if let Some(departure_um) = self.open_loop_departure_um() {
            return departure_um * sweep.slopes_v_per_um[0];
        }
        let feedback = self.chain.as_ref().and_then(|chain| chain.feedback.as_ref());
        match feedback.and_then(|feedback| feedback.trust.as_ref()) {
            Some(trust) => BEYOND_TRUST * (trust.quick_v + trust.slow_v),
            None => BESIDE_AN_INVERSE * sweep.span_v,
        }
    }

    /// How much further than a change of the command the platform may go.
    pub fn overshoot(&self) -> f64 {
        match self.chain {
            Some(_) => OVERSHOOT_OF_A_CHAIN,
            None => OVERSHOOT,
        }
    }
}
