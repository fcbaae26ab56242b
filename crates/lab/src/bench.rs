//! The bench that a table is made for, as a person names it.

use crate::error::Refusal;
use crate::wish::{Given, pair};
use hysteron_control::export;
use serde::Deserialize;

/// What the bench is where the records do not say; each as the option of `hysteron export` of its name.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Bench {
    /// Lowest and highest reference, micrometres.
    input_min_um: Option<f64>,
    input_max_um: Option<f64>,
    /// Volts that the stack may be given.
    amplifier_min_v: Option<f64>,
    amplifier_max_v: Option<f64>,
    /// Volts at the stack of the DAC's lowest code and of full scale.
    dac_min_v: Option<f64>,
    dac_full_v: Option<f64>,
    /// Micrometres of the ADC's lowest code and of full scale.
    adc_min_um: Option<f64>,
    adc_full_um: Option<f64>,
    feedback_up_to_hz: Option<f64>,
    feedback_bound_um: Option<f64>,
    cross: Option<f64>,
    beyond_records: bool,
}

impl Bench {
    /// The bench, and the options that say the same; `source` is the controller's file.
    pub(crate) fn read(&self, source: &str) -> Result<(export::Bench, Given), Refusal> {
        let bench = export::Bench {
            source: source.to_owned(),
            stage: None,
            amplifier_v: pair("voltage at the stack", self.amplifier_min_v, self.amplifier_max_v)?,
            dac_v: pair("end of the DAC", self.dac_min_v, self.dac_full_v)?,
            adc_um: pair("end of the ADC", self.adc_min_um, self.adc_full_um)?,
            input_min_um: self.input_min_um,
            input_max_um: self.input_max_um,
            feedback_up_to_hz: self.feedback_up_to_hz,
            feedback_bound_um: self.feedback_bound_um,
            cross_um_per_um: self.cross,
            beyond_records: self.beyond_records,
            thermometer: false,
        };
        let mut given = Given::default();
        given.number("input-min", bench.input_min_um);
        given.number("input-max", bench.input_max_um);
        given.pair("amplifier", bench.amplifier_v);
        given.pair("dac", bench.dac_v);
        given.pair("adc", bench.adc_um);
        given.number("feedback-up-to", bench.feedback_up_to_hz);
        given.number("feedback-bound-um", bench.feedback_bound_um);
        given.number("cross", bench.cross_um_per_um);
        given.flag("beyond-records", bench.beyond_records);
        Ok((bench, given))
    }
}
