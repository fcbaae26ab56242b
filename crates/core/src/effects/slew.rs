//! The slew limit of an amplifier that charges a capacitance with a limited current.

use crate::effects::{Block, admit};
use crate::error::{ParamError, in_range};
use crate::real::Real;

/// A slew limit, `-F <= y' <= R`: the output runs after the input at no more than `R` upward and `F` downward.
///
/// # Units
/// Slews in volts per second (current over capacitance: 0.1 A into 1.8 uF gives 56 kV/s).
/// # Cost
/// 2 compare-selects and 3 additions a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlewLimit<T> {
    largest_rise: T,
    largest_fall: T,
}

/// The output, and whether it had to be held back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlewState<T> {
    output: T,
    limited: bool,
}

impl<T: Real> SlewLimit<T> {
    /// Builds a slew limit that is the same to both sides.
    ///
    /// # Errors
    /// As [`Self::unequal`].
    pub fn new(slew_v_per_s: f64, sample_rate_hz: f64) -> Result<Self, ParamError> {
        Self::unequal(slew_v_per_s, slew_v_per_s, sample_rate_hz)
    }

    /// Builds a slew limit of an amplifier that gives more current than it takes, or less.
    ///
    /// # Errors
    /// A slew that is not positive or beyond 1e15 a second; a sample rate outside 1e-3 to 1e7 Hz.
    pub fn unequal(rising_v_per_s: f64, falling_v_per_s: f64, sample_rate_hz: f64) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range(
            "rising_v_per_s",
            None,
            rising_v_per_s,
            f64::from(f32::MIN_POSITIVE),
            1e15,
        )?;
        in_range(
            "falling_v_per_s",
            None,
            falling_v_per_s,
            f64::from(f32::MIN_POSITIVE),
            1e15,
        )?;
        Ok(Self {
            largest_rise: T::from_f64(rising_v_per_s / sample_rate_hz),
            largest_fall: T::from_f64(falling_v_per_s / sample_rate_hz),
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
        let change = (-self.largest_fall).select_max(wanted).select_min(self.largest_rise);
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
    fn val_each_side_has_its_own_slew() {
        let slew = SlewLimit::<f64>::unequal(100.0, 50.0, 50.0).unwrap(); // 2 V up, 1 V down a sample
        let mut state = slew.rest_at(0.0);
        let outputs = [5.0, 5.0, 0.0, 0.0, 1.5].map(|u| slew.step(&mut state, u));
        assert_eq!(outputs, [2.0, 4.0, 3.0, 2.0, 1.5]);
        assert!(!state.limited());
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
        assert!(SlewLimit::<f64>::unequal(100.0, 0.0, 50.0).is_err());
    }
}
