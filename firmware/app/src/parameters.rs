//! What a controller does not change while it runs: the numbers of one table.

use crate::monitor::Scales;
use hysteron_core::codes::Converter;
use hysteron_core::limiter::Limiter;

/// Law, limits and converters of one axis.
///
/// On the chip these are the constants of the table that was compiled in, [`crate::table::parameters`].
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
