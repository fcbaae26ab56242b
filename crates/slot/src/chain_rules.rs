//! What is checked of a complete law's numbers, and of what the records cover.

use crate::rules::{Checked, list, number};
use crate::{Chain, Covered, Refusal, Rule};
use hysteron_core::adaptation::Adaptation;
use hysteron_core::biquad::Biquad;
use hysteron_core::effects::coupling::Coupling;
use hysteron_core::effects::creep::CreepInverse;
use hysteron_core::effects::lag::{HeldLagInverse, Lag, LagGrowth};
use hysteron_core::error::ParamError;
use hysteron_core::law_numbers::{LARGEST_CROSS, LawNumbers};
use hysteron_core::preview::Preview;
use hysteron_core::surroundings::{CompleteLaw, SensorInverse};
use hysteron_core::tracking_law::{CREEP_DIVIDER, CREEP_FAST, CREEP_SLOW, TAPS};
use hysteron_core::trust::Trust;

/// A field, where the core refuses what is made of it.
fn named<T>(field: &'static str, built: Result<T, ParamError>) -> Checked {
    built.map(|_| ()).map_err(|error| Refusal::of_core(field, error))
}

/// The law as a chip runs it; one function, so that an image has it once, for its checks and for what it runs.
///
/// # Errors
/// Values that the core refuses.
#[cold]
#[inline(never)]
pub(crate) fn law(numbers: &LawNumbers) -> Result<CompleteLaw<f32>, ParamError> {
    numbers.law()
}

impl Chain {
    /// Runs the core's own constructors, each over the fields that its block is made of, then that of the whole law.
    #[inline(never)]
    pub(crate) fn buildable(&self, numbers: &LawNumbers) -> Checked {
        let rate_hz = numbers.sample_rate_hz;
        let section = |[b0, b1, b2, a1, a2]: [f64; 5]| Biquad::<f32>::new([b0, b1, b2], [a1, a2]);
        let preview = Preview::<f32, TAPS>::new(numbers.preview, numbers.samples_ahead);
        named("controller.preview, controller.samples_ahead", preview)?;
        named("controller.second_mode", section(self.second_mode))?;
        let (fast, slow) = (&numbers.creep_fast, &numbers.creep_slow);
        let creep = CreepInverse::<f32, CREEP_FAST, CREEP_SLOW>::new(
            [fast.shares, fast.tau_s],
            [slow.shares, slow.tau_s],
            rate_hz,
            CREEP_DIVIDER,
        );
        named("controller.creep_shares, controller.creep_tau_s", creep)?;
        named(
            "controller.lag_s",
            HeldLagInverse::<f32>::new(self.lag_s, None, rate_hz),
        )?;
        let growth = self.lag_growth.map(LagGrowth::from);
        let growing = HeldLagInverse::<f32>::new(self.lag_s, growth, rate_hz);
        named("controller.lag_growth", growing)?;
        named("controller.sensor_lag_s", Lag::<f32>::new(self.sensor_lag_s, rate_hz))?;
        if let Some(feedback) = &self.feedback {
            let [first, second] = feedback.series;
            named("controller.feedback.series[1]", section(first))?;
            named("controller.feedback.series[2]", section(second))?;
            named("controller.feedback.damping", section(feedback.damping))?;
            if let Some(trust) = &feedback.trust {
                let trust = Trust::<f32>::new(trust.quick_v, trust.slow_v, trust.slow_v_per_s, rate_hz);
                named("controller.feedback.trust", trust)?;
            }
        }
        if let Some([g, d, p, r]) = self.coupling {
            named("controller.coupling", Coupling::<f32>::new(g, d, p, r, rate_hz))?;
        }
        if let Some([middle, c2, c3]) = self.sensor {
            named("controller.sensor", SensorInverse::<f32>::new(middle, c2, c3))?;
        }
        if let Some(part) = &self.adaptation {
            named("controller.adaptation", Adaptation::<f32>::new(part, rate_hz))?;
        }
        if let Some(share) = self.cross_um_per_um.filter(|share| share.abs() > LARGEST_CROSS) {
            let refused = Refusal::new(Rule::Outside, "controller.cross_um_per_um", share);
            return Err(refused.allowed([-LARGEST_CROSS, LARGEST_CROSS, 0.0]));
        }
        if let Some(rms_um) = self.model_error_um.filter(|rms_um| *rms_um < 0.0) {
            return Err(Refusal::new(Rule::NegativeError, "controller.model_error_um", rms_um));
        }
        let left = match self.hum {
            Some(_) => "controller.hum, controller.feedback",
            None => "controller.feedback",
        };
        named(left, law(numbers))
    }

    #[inline(never)]
    pub(crate) fn finite(&self) -> Checked {
        number("controller.inverse_min_um", self.inverse_min_um)?;
        number("controller.inverse_max_um", self.inverse_max_um)?;
        number("controller.rest_um", self.rest_um)?;
        number("controller.lag_s", self.lag_s)?;
        number("controller.sensor_lag_s", self.sensor_lag_s)?;
        number("controller.cross_um_per_um", self.cross_um_per_um.unwrap_or(0.0))?;
        number("controller.model_error_um", self.model_error_um.unwrap_or(0.0))?;
        list("controller.preview", &self.preview)?;
        list("controller.second_mode", &self.second_mode)?;
        list("controller.creep_shares", &self.creep_shares)?;
        list("controller.creep_tau_s", &self.creep_tau_s)?;
        list("controller.lag_growth", &self.lag_growth.unwrap_or_default())?;
        list("controller.coupling", &self.coupling.unwrap_or_default())?;
        list("controller.sensor", &self.sensor.unwrap_or_default())?;
        list("controller.heat", &self.heat.unwrap_or_default())?;
        if let Some(feedback) = &self.feedback {
            number("controller.feedback.integral_v_per_um_s", feedback.integral_v_per_um_s)?;
            list("controller.feedback.series", feedback.series.as_flattened())?;
            list("controller.feedback.damping", &feedback.damping)?;
            if let Some(trust) = &feedback.trust {
                number("controller.feedback.trust.quick_v", trust.quick_v)?;
                number("controller.feedback.trust.slow_v", trust.slow_v)?;
                number("controller.feedback.trust.slow_v_per_s", trust.slow_v_per_s)?;
            }
        }
        if let Some(hum) = &self.hum {
            number("controller.hum.frequency_hz", hum.frequency_hz)?;
            number("controller.hum.learning_s", hum.learning_s)?;
            number("controller.hum.largest_um", hum.largest_um)?;
            list("controller.hum.sensitivity", hum.sensitivity.as_flattened())?;
        }
        Ok(())
    }
}

impl Covered {
    /// Refuses ends that are not numbers or do not ascend, and bounds that are negative.
    ///
    /// # Errors
    /// The first of them.
    pub fn check(&self) -> Checked {
        for (field, ends) in [
            ("covered.voltage_v", self.voltage_v),
            ("covered.position_um", self.position_um),
            ("covered.temperature_c", self.temperature_c),
        ] {
            if let Some([low, high]) = ends.filter(|[low, high]| !(low.is_finite() && high.is_finite() && low <= high))
            {
                return Err(Refusal::new(Rule::CoveredPair, field, low).allowed([0.0, high, 0.0]));
            }
        }
        for (field, value) in [
            ("covered.slew_v_per_s", self.slew_v_per_s),
            ("covered.swing_hz", self.swing_hz),
            ("covered.sample_rate_hz", self.sample_rate_hz),
            ("covered.told_to_hz", self.told_to_hz),
        ] {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value >= 0.0)) {
                return Err(Refusal::new(Rule::CoveredNegative, field, value));
            }
        }
        Ok(())
    }
}
