//! A table as plain numbers: what a slot of a board holds of it, and what the rules judge.

use crate::{Controller, Inverse, Numbers, Sweep, Table, TableError};
use hysteron_core::bank::PlayBank;
use hysteron_core::error::ParamError;
use hysteron_core::law_numbers::LawNumbers;
use hysteron_core::tracking_law::PLAYS;
use hysteron_slot::{Chain, Refusal, Rule, first};

impl Table {
    /// The table with room for `N` plays; lists that are longer than their room are cut.
    pub fn numbers<const N: usize>(&self) -> Numbers<N> {
        let empty = Numbers::empty(self.family, self.thresholds_um.len());
        Numbers {
            sample_rate_hz: self.sample_rate_hz,
            input_min_um: self.input_min_um,
            input_max_um: self.input_max_um,
            output_min_v: self.output_min_v,
            output_max_v: self.output_max_v,
            safe_v: self.safe_v,
            slew_v_per_s: self.slew_v_per_s,
            ramp_v_per_s: self.ramp_v_per_s,
            proportional_v_per_um: self.proportional_v_per_um,
            integral_v_per_um_s: self.integral_v_per_um_s,
            feedback_up_to_hz: self.feedback_up_to_hz,
            dac_min_v: self.dac_min_v,
            dac_top_v: self.dac_top_v,
            adc_min_um: self.adc_min_um,
            adc_top_um: self.adc_top_um,
            alpha_s: self.alpha_s,
            beta_s: self.beta_s,
            offset_v: self.offset_v,
            input_function: self.input_function(),
            thresholds_um: first(&self.thresholds_um),
            weights_v_per_um: first(&self.weights_v_per_um),
            rate_weights_v_s_per_um2: first(&self.rate_weights_v_s_per_um2),
            weights_quadratic_v_per_um2: first(&self.weights_quadratic_v_per_um2),
            weights_cubic_v_per_um3: first(&self.weights_cubic_v_per_um3),
            chain: self.controller.as_ref().map(chain),
            covered: self.covered.as_ref().map_or(empty.covered, |covered| covered.numbers()),
            ..empty
        }
    }

    /// The numbers of the complete law; `None` in a table without one.
    ///
    /// # Errors
    /// Lists of other lengths than the law's, by their fields.
    pub fn law_numbers(&self) -> Result<Option<LawNumbers>, TableError> {
        if self.controller.is_none() {
            return Ok(None);
        }
        self.check_lists()?;
        let plays = self.thresholds_um.len();
        if plays != PLAYS {
            return Err(Refusal::new(Rule::LawPlays, "thresholds_um", plays as f64).into());
        }
        Ok(self.numbers::<PLAYS>().law_numbers())
    }

    /// The bank of plays and the inverse as the core runs it; `at_rest` without everything that depends on the rate.
    ///
    /// Where the table has fewer than N plays, those behind weigh nothing.
    ///
    /// # Errors
    /// What the core's constructors refuse in `f32`.
    pub fn inverse<const N: usize>(&self, at_rest: bool) -> Result<(PlayBank<f32, N>, Inverse<N>), ParamError> {
        self.numbers::<N>().inverse(at_rest)
    }

    /// As [`Numbers::open_loop_departure_um`].
    pub fn open_loop_departure_um(&self) -> Option<f64> {
        self.numbers::<PLAYS>().open_loop_departure_um()
    }

    /// As [`Numbers::departure_v`].
    pub fn departure_v(&self, sweep: &Sweep) -> f64 {
        self.numbers::<PLAYS>().departure_v(sweep)
    }

    /// As [`Numbers::overshoot`].
    pub fn overshoot(&self) -> f64 {
        self.numbers::<PLAYS>().overshoot()
    }
}

fn chain(part: &Controller) -> Chain {
    Chain {
        samples_ahead: part.samples_ahead,
        inverse_min_um: part.inverse_min_um,
        inverse_max_um: part.inverse_max_um,
        rest_um: part.rest_um,
        lag_s: part.lag_s,
        lag_growth: part.lag_growth,
        sensor_lag_s: part.sensor_lag_s,
        preview: first(&part.preview),
        second_mode: part.second_mode,
        creep_shares: first(&part.creep_shares),
        creep_tau_s: first(&part.creep_tau_s),
        coupling: part.coupling,
        cross_um_per_um: part.cross_um_per_um,
        sensor: part.sensor,
        heat: part.heat,
        model_error_um: part.model_error_um,
        feedback: part.feedback.as_ref().map(crate::Feedback::numbers),
        hum: part.hum.as_ref().map(crate::Hum::numbers),
        adaptation: part.adaptation.as_ref().map(crate::Adaptation::numbers),
    }
}
