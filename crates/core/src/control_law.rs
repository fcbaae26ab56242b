//! The combined control law (eq. 15): feedforward by a direct inverse plus PI feedback, through a limiter.

use crate::limiter::{Limiter, LimiterState};
use crate::model::Hysteresis;
use crate::pi_controller::{PiController, PiState};
use crate::real::Real;

/// `v = v_ff + v_fb` (eq. 15): a direct inverse driven by the reference, a PI controller driven by the error.
///
/// # Units
/// Reference and measured position in the inverse's input unit, command in its output unit.
/// # Cost
/// That of the inverse, plus 3 multiply-adds and 10 compares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlLaw<T, F> {
    /// Direct inverse model; `None` for feedback alone.
    pub feedforward: Option<F>,
    /// Feedback; `None` for open loop.
    pub feedback: Option<PiController<T>>,
    /// Limits of the command.
    pub limiter: Limiter<T>,
}

/// What the control law remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlState<T, S> {
    /// State of the inverse.
    pub feedforward: S,
    /// State of the PI controller.
    pub feedback: PiState<T>,
    /// State of the limiter.
    pub limiter: LimiterState<T>,
}

impl<T: Real, F: Hysteresis<T>> ControlLaw<T, F> {
    /// A state at rest with the command at `command`.
    pub fn start(&self, feedforward: F::State, command: T) -> ControlState<T, F::State> {
        ControlState {
            feedforward,
            feedback: PiState::default(),
            limiter: self.limiter.start_at(command),
        }
    }

    /// One sample: the command for a reference and a measured position. Finite and within limits for every input.
    #[inline(always)]
    pub fn step(&self, state: &mut ControlState<T, F::State>, reference: T, measured: T) -> T {
        let feedforward = match &self.feedforward {
            Some(inverse) => inverse.step(&mut state.feedforward, reference),
            None => T::ZERO,
        };
        let feedback = match &self.feedback {
            Some(pi) => {
                // What the limiter leaves to the feedback once the feedforward has taken its part.
                let (lowest, highest) = self.limiter.room(&state.limiter);
                pi.step(
                    &mut state.feedback,
                    reference - measured,
                    lowest - feedforward,
                    highest - feedforward,
                )
            }
            None => T::ZERO,
        };
        self.limiter.step(&mut state.limiter, feedforward + feedback)
    }
}
