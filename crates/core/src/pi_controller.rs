//! The proportional plus integral controller (eq. 14) with anti-windup and bumpless start.

use crate::error::{ParamError, in_range};
use crate::real::Real;

/// Eq. 14, `v = K_p e + K_i integral e dt`, the integral by the backward rectangle: `I_k = I_(k-1) + K_i T e_k`.
///
/// Anti-windup by conditional integration (Åström, Hägglund, Advanced PID Control (2006), section 3.5): a step that
/// would drive a saturated output further into its limit does not integrate.
///
/// # Units
/// Gains in output units per input unit (`proportional`) and that per second (`integral_per_s`).
/// # Cost
/// 3 multiply-adds and 4 compares a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PiController<T> {
    proportional: T,
    integral_a_sample: T,
}

/// The controller's integral, in output units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PiState<T> {
    integral: T,
}

impl<T: Real> PiController<T> {
    /// Builds the controller.
    ///
    /// # Errors
    /// Gains that are negative or not finite; a sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(proportional: T, integral_per_s: T, sample_rate_hz: T) -> Result<Self, ParamError> {
        in_range("proportional gain", None, proportional, 0.0, 1e12)?;
        in_range("integral gain", None, integral_per_s, 0.0, 1e12)?;
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        Ok(Self {
            proportional,
            integral_a_sample: integral_per_s / sample_rate_hz,
        })
    }

    /// One sample: the controller's output for an error, given the room that the limiter leaves it.
    ///
    /// `lowest` and `highest` are the outputs beyond which the actuator saturates. An error that is not finite counts as 0.
    #[inline(always)]
    pub fn step(&self, state: &mut PiState<T>, error: T, lowest: T, highest: T) -> T {
        let error = if error.is_finite() { error } else { T::ZERO };
        let integral = state.integral + self.integral_a_sample * error;
        let output = self.proportional * error + integral;
        let winds_up = (output > highest && error > T::ZERO) || (output < lowest && error < T::ZERO);
        if !winds_up {
            // An integral beyond the actuator's whole range serves nothing; the bound keeps every number finite.
            state.integral = lowest.select_max(integral.select_min(highest));
        }
        self.proportional * error + state.integral
    }

    /// Sets the integral so that the next output is `output` at `error`: switching on without a bump.
    pub fn start_at(&self, state: &mut PiState<T>, output: T, error: T) {
        let integral = output - (self.proportional + self.integral_a_sample) * error;
        state.integral = if integral.is_finite() { integral } else { T::ZERO };
    }
}

impl<T: Real> PiState<T> {
    /// The integral, output units.
    pub fn integral(&self) -> T {
        self.integral
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: f64 = 1e6;

    #[test]
    fn val_step_response_is_a_ramp_on_a_step() {
        // K_p = 1, K_i = 6000, T = 20 us: after k samples of e = 1 the output is 1 + 0.12 k.
        let pi = PiController::new(1.0, 6000.0, 50e3).unwrap();
        let mut state = PiState::default();
        for k in 1..=100 {
            let output = pi.step(&mut state, 1.0, -WIDE, WIDE);
            assert!((output - (1.0 + 0.12 * f64::from(k))).abs() < 1e-9);
        }
    }

    #[test]
    fn val_leaves_saturation_at_once() {
        let pi = PiController::new(0.1, 600.0, 50e3).unwrap();
        let mut state = PiState::default();
        for _ in 0..50_000 {
            pi.step(&mut state, 1.0, -10.0, 10.0);
        }
        // Without anti-windup the integral would stand at 600 and take 50 000 samples back.
        assert!(pi.step(&mut state, -1.0, -10.0, 10.0) < 10.0);
        assert!(state.integral() <= 10.0);
    }

    #[test]
    fn val_starts_without_a_bump() {
        let pi = PiController::new(0.5, 1000.0, 50e3).unwrap();
        let mut state = PiState::default();
        pi.start_at(&mut state, 3.25, 0.7);
        assert!((pi.step(&mut state, 0.7, -WIDE, WIDE) - 3.25).abs() < 1e-12);
    }

    #[test]
    fn refuse_bad_gains() {
        use std::string::ToString;
        let error = PiController::new(-1.0, 1.0, 50e3).unwrap_err();
        assert_eq!(
            error.to_string(),
            "proportional gain = -1 must lie in 0 to 1000000000000"
        );
        assert!(PiController::new(1.0, f64::NAN, 50e3).is_err());
    }
}
