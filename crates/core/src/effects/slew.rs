//! The slew limit of an amplifier that charges a capacitance with a limited current.

use crate::effects::{Block, admit};
use crate::error::{ParamError, in_range};
use crate::real::Real;

/// A slew limit, `|y'| <= S`, symmetric: the output runs after the input at no more than `S`.
///
/// # Units
/// Slew in volts per second (current over capacitance: 0.1 A into 1.8 uF gives 56 kV/s).
/// # Cost
/// 2 compare-selects and 3 additions a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlewLimit<T> {
    largest_change: T,
}

/// The output, and whether it had to be held back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlewState<T> {
    output: T,
    limited: bool,
}

impl<T: Real> SlewLimit<T> {
    /// Builds a slew limit.
    ///
    /// # Errors
    /// A slew that is not positive or beyond 1e15 a second; a sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(slew_v_per_s: f64, sample_rate_hz: f64) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("slew_v_per_s", None, slew_v_per_s, f64::from(f32::MIN_POSITIVE), 1e15)?;
        Ok(Self {
            largest_change: T::from_f64(slew_v_per_s / sample_rate_hz),
        })
    }
}

impl<T: Copy> SlewState<T> {
    /// Whether the last sample was held back.
    pub fn limited(&self) -> bool {
        self.limited
    }
}

impl<T: Real> Block<T> for SlewLimit<T> {
    type State = SlewState<T>;

    fn rest_at(&self, input: T) -> SlewState<T> {
        SlewState {
            output: admit(input, T::ZERO),
            limited: false,
        }
    }

    #[inline(always)]
    fn step(&self, state: &mut SlewState<T>, input: T) -> T {
        let wanted = admit(input, state.output) - state.output;
        let change = (-self.largest_change)
            .select_max(wanted)
            .select_min(self.largest_change);
        state.limited = change != wanted;
        state.output += change;
        state.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_step_becomes_a_ramp() {
        let slew = SlewLimit::<f64>::new(100.0, 50.0).unwrap(); // 2 V a sample
        let mut state = slew.rest_at(0.0);
        let outputs = [5.0, 5.0, 5.0, 5.0, 0.0].map(|u| slew.step(&mut state, u));
        assert_eq!(outputs, [2.0, 4.0, 5.0, 5.0, 3.0]);
        assert!(state.limited());
    }

    #[test]
    fn prop_finite_for_every_input() {
        let slew = SlewLimit::<f32>::new(1e15, 1.0).unwrap();
        let mut state = slew.rest_at(0.0);
        for input in [f32::NAN, f32::INFINITY, -f32::MAX, 1e30, -1e30] {
            assert!(slew.step(&mut state, input).is_finite());
        }
    }

    #[test]
    fn refuse_no_slew() {
        assert!(SlewLimit::<f64>::new(0.0, 50.0).is_err());
        assert!(SlewLimit::<f64>::new(f64::NAN, 50.0).is_err());
    }
}
