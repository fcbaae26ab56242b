//! What a controller does not change while it runs: the numbers of one table.

use crate::monitor::Scales;
use hysteron_core::codes::Converter;
use hysteron_core::error::ParamError;
use hysteron_core::limiter::Limiter;
use hysteron_slot::{Numbers, Sweep};

/// Law, limits and converters of one axis.
///
/// On the chip these are made of the table that was compiled in, [`crate::table::parameters`], or of one in a slot of its flash.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters<L> {
    /// The control law, with range and slew of the command.
    pub law: L,
    /// Range of the command, and the slew of its way from and to the safe level.
    pub ramp: Limiter<f32>,
    /// Largest step of a reference on its way from rest to a trajectory: the ramp's change of the command where the inverse is steepest,
    /// micrometres.
    pub rise_um: f32,
    /// What the monitor's limits are made of.
    pub scales: Scales,
    /// Codes of the command, volts at the actuator.
    pub dac: Converter<f32>,
    /// Codes of the position, micrometres: the converter's volts are the sensor's micrometres here.
    pub adc: Converter<f32>,
    /// Lowest and highest reference, micrometres.
    pub range_um: [f32; 2],
    /// Rate of the loop, hertz.
    pub sample_rate_hz: f32,
    /// Feedback is whole up to this frequency of the reference and none from twice it, hertz.
    pub feedback_up_to_hz: f32,
    /// Where the command starts and ends, volts.
    pub safe_v: f32,
}

impl<L> Parameters<L> {
    /// Of a law and the table that it was made of, which has passed every check.
    ///
    /// # Errors
    /// What the core refuses, which no check has let through.
    #[inline(always)]
    pub fn of<const N: usize>(law: L, table: &Numbers<N>, sweep: &Sweep) -> Result<Self, ParamError> {
        let (adc_min_um, adc_top_um) = (table.adc_min_um as f32, table.adc_top_um as f32);
        let (input_min_um, input_max_um) = (table.input_min_um as f32, table.input_max_um as f32);
        let sample_rate_hz = table.sample_rate_hz as f32;
        let slopes_v_per_um = sweep.slopes_v_per_um.map(|slope| slope as f32);
        Ok(Self {
            law,
            ramp: table.limiter(table.ramp_v_per_s)?,
            rise_um: table.ramp_v_per_s as f32 / sample_rate_hz / slopes_v_per_um[1],
            scales: Scales {
                range_um: input_max_um - input_min_um,
                um_per_code: (adc_top_um - adc_min_um) / 65_535.0,
                slopes_v_per_um,
                span_v: sweep.span_v as f32,
                departure_v: table.departure_v(sweep) as f32,
                overshoot: table.overshoot() as f32,
            },
            dac: Converter::new(table.dac_min_v as f32, table.dac_top_v as f32)?,
            adc: Converter::new(adc_min_um, adc_top_um)?,
            range_um: [input_min_um, input_max_um],
            sample_rate_hz,
            feedback_up_to_hz: table.feedback_up_to_hz as f32,
            safe_v: table.safe_v as f32,
        })
    }

    /// Takes over everything but the law.
    pub fn set_around<M>(&mut self, other: &Parameters<M>) {
        // All of them by name: a field more is an error here.
        let &Parameters {
            law: _,
            ramp,
            rise_um,
            scales,
            dac,
            adc,
            range_um,
            sample_rate_hz,
            feedback_up_to_hz,
            safe_v,
        } = other;
        self.ramp = ramp;
        self.rise_um = rise_um;
        self.scales = scales;
        self.dac = dac;
        self.adc = adc;
        self.range_um = range_um;
        self.sample_rate_hz = sample_rate_hz;
        self.feedback_up_to_hz = feedback_up_to_hz;
        self.safe_v = safe_v;
    }
}
