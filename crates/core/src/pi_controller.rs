//! The proportional plus integral controller (eq. 14) with anti-windup and bumpless start.

use crate::error::{ParamError, in_range};
use crate::real::{Real, rarely};

/// Largest gain.
const LARGEST_GAIN: f64 = 1e12;

/// Largest error and integral that count. No micrometre or volt is larger, and with gains up to [`LARGEST_GAIN`] every
/// sum stays below 2.1e37, which `f32` (3.4e38) holds.
const LARGEST_ERROR: f64 = 1e25;
const LARGEST_INTEGRAL: f64 = 1e37;

/// Eq. 14, `v = K_p e + K_i integral e dt`, the integral by the backward rectangle: `I_k = I_(k-1) + K_i T e_k`.
///
/// Anti-windup by conditional integration (Åström, Hägglund, Advanced PID Control (2006), section 3.5), with one
/// difference: a step that would drive a saturated output further into its limit integrates as far as the limit, not
/// nothing at all. Behind a slew limit that matters: where `K_i T e` exceeds what one sample lets through, "nothing"
/// would be every sample's answer, and the loop would stand still with its error for ever. The integral is never moved
/// against the error, so a room that narrows leaves it alone.
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
        in_range("proportional gain", None, proportional, 0.0, LARGEST_GAIN)?;
        in_range("integral gain", None, integral_per_s, 0.0, LARGEST_GAIN)?;
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        let integral_a_sample = integral_per_s / sample_rate_hz;
        in_range("integral gain a sample", None, integral_a_sample, 0.0, LARGEST_GAIN)?;
        Ok(Self {
            proportional,
            integral_a_sample,
        })
    }

    /// One sample: the controller's output for an error, given the room that the limiter leaves it.
    ///
    /// `lowest` and `highest` are the outputs beyond which the actuator saturates; the output is not cut to them, the
    /// limiter that they come from does that. An error that is not finite or above 1e25 counts as 0.
    #[inline(always)]
    pub fn step(&self, state: &mut PiState<T>, error: T, lowest: T, highest: T) -> T {
        // A NaN fails the comparison; it counts as no error.
        let usable = error.magnitude() <= T::from_f64(LARGEST_ERROR);
        if !usable {
            rarely();
            return T::ZERO + state.integral;
        }
        let proportional = self.proportional * error;
        let wanted = state.integral + self.integral_a_sample * error;
        let integral = if error > T::ZERO {
            wanted.select_below(highest - proportional, state.integral)
        } else {
            wanted.select_above(lowest - proportional, state.integral)
        };
        // Matters only where the room is none (infinite or NaN).
        let bounded = integral.magnitude() <= T::from_f64(LARGEST_INTEGRAL);
        if !bounded {
            rarely();
            return proportional + state.integral;
        }
        state.integral = integral;
        proportional + integral
    }

    /// Sets the integral so that the next output is `output` at `error`: switching on without a bump.
    ///
    /// Where there is no such integral (an argument that is not finite or absurdly large) it is 0.
    pub fn start_at(&self, state: &mut PiState<T>, output: T, error: T) {
        let integral = output - (self.proportional + self.integral_a_sample) * error;
        state.integral = if integral.magnitude() <= T::from_f64(LARGEST_INTEGRAL) {
            integral
        } else {
            T::ZERO
        };
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

    /// A slew limit narrows the room to a little around the last command: it must hold the integral, never move it.
    #[test]
    fn regress_a_narrow_room_does_not_move_the_integral() {
        let pi = PiController::new(1.0_f64, 1000.0, 50e3).unwrap();
        let mut state = PiState::default();
        pi.start_at(&mut state, 2.0, 5.0);
        let before = state.integral(); // 2 - 5 - 0.1
        // The output of 2.0 lies in the room of 1.9 to 2.2: one step of integration, 1000 x 20 us x 5, and no more.
        assert!((pi.step(&mut state, 5.0, 1.9, 2.2) - 2.0).abs() < 1e-12);
        assert!((state.integral() - before - 0.1).abs() < 1e-12);
    }

    /// A slew limit of less than one step of integration a sample slows the integral down; it used to stop it for good.
    #[test]
    fn regress_a_slew_limit_does_not_lock_the_integral() {
        let pi = PiController::new(0.5_f64, 1000.0, 50e3).unwrap();
        let mut state = PiState::default();
        let mut last = 2.0;
        // e = 4 asks for 0.08 a sample; the room is 0.02 above the last output.
        for k in 1..=100 {
            last = pi.step(&mut state, 4.0, last - 0.02, last + 0.02);
            assert!((last - (2.0 + 0.02 * f64::from(k))).abs() < 1e-12, "{k}: {last}");
        }
        // Against the other end alike.
        let mut state = PiState::default();
        let mut last = -2.0;
        for k in 1..=100 {
            last = pi.step(&mut state, -4.0, last - 0.02, last + 0.02);
            assert!((last - (-2.0 - 0.02 * f64::from(k))).abs() < 1e-12, "{k}: {last}");
        }
    }

    /// Numbers that no stage has, in the type that holds least.
    #[test]
    fn prop_finite_for_every_input() {
        let extremes = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            f32::MIN,
            1e25,
            -1e25,
            0.0,
            1.0,
        ];
        let pi = PiController::new(1e12_f32, 1e12, 1.0).unwrap();
        let mut state = PiState::default();
        for _ in 0..20 {
            for error in extremes {
                for lowest in extremes {
                    for highest in extremes {
                        assert!(pi.step(&mut state, error, lowest, highest).is_finite());
                    }
                }
                pi.start_at(&mut state, error, error);
                assert!(state.integral().is_finite());
            }
        }
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
        // 1e12 a second at one sample in 1000 s
        assert_eq!(
            PiController::new(1.0, 1e12, 1e-3).unwrap_err().to_string(),
            "integral gain a sample = 1000000000000000 must lie in 0 to 1000000000000"
        );
    }
}
