//! The control law of a table, with a trajectory: what runs in the interrupt.

use crate::parameters::Parameters;
use crate::trajectory::Sine;
use crate::wire::{Frame, LIMITED, Setup};
use hysteron_core::bank::PlayState;
use hysteron_core::codes::{AdcCode, Converter};
use hysteron_core::control_law::{ControlLaw, ControlState};
use hysteron_core::model::Hysteresis;

/// Control law, its state, converters and trajectory; N plays.
#[derive(Debug, Clone)]
pub struct Controller<I, const N: usize> {
    law: ControlLaw<f32, I>,
    state: ControlState<f32, PlayState<f32, N>>,
    dac: Converter<f32>,
    adc: Converter<f32>,
    trajectory: Sine,
    number: u32,
}

impl<I: Hysteresis<f32, State = PlayState<f32, N>>, const N: usize> Controller<I, N> {
    /// The controller at rest at the reference's first value, its command at the safe level.
    pub fn new(parameters: Parameters<I, N>, setup: &Setup) -> Self {
        let law = ControlLaw {
            feedforward: setup.feedforward.then_some(parameters.inverse),
            feedback: setup.feedback.then_some(parameters.feedback),
            limiter: parameters.limiter,
        };
        let plays = PlayState::remanent(&parameters.bank, setup.low_um, 0.0);
        let mut state = law.start(plays, parameters.safe_v);
        let frequency_hz = setup.frequency_hz(parameters.sample_rate_hz);
        state.set_feedback_weight(feedback_weight(frequency_hz, parameters.feedback_up_to_hz));
        Self {
            law,
            state,
            dac: parameters.dac,
            adc: parameters.adc,
            trajectory: Sine::new(setup.low_um, setup.high_um, setup.phase_step),
            number: 0,
        }
    }

    /// One tick. Total: every code gives a command within the limits.
    ///
    /// # Cost
    /// That of [`ControlLaw::step`] with the table's inverse, two conversions and a look-up.
    #[inline(always)]
    pub fn step(&mut self, position: AdcCode) -> Frame {
        let reference_um = self.trajectory.next_um();
        let measured_um = self.adc.volts(position);
        let command_v = self.law.step(&mut self.state, reference_um, measured_um);
        let frame = Frame {
            number: self.number,
            reference_um,
            command_v,
            dac: self.dac.code(command_v).0,
            flags: if self.state.limiter.limited() { LIMITED } else { 0 },
        };
        self.number = self.number.wrapping_add(1);
        frame
    }
}

/// The share of the feedback: 1 up to a frequency, in a straight line to 0 at twice it; the law brings it into 0 to 1.
fn feedback_weight(frequency_hz: f32, up_to_hz: f32) -> f32 {
    2.0 - frequency_hz / up_to_hz
}
