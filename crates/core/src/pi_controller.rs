//! The proportional plus integral controller (eq. 14) with anti-windup and bumpless start.

use crate::error::{ParamError, in_range};
use crate::real::Real;

/// Largest gain.
const LARGEST_GAIN: f64 = 1e12;

/// Largest error that counts. No micrometre is larger, and with gains up to [`LARGEST_GAIN`] every product stays below what `f32`
/// (3.4e38) holds.
const LARGEST_ERROR: f64 = 1e25;
/// Largest integral that a controller is started with.
const LARGEST_INTEGRAL: f64 = 1e37;

/// Eq. 14, `v = K_p e + K_i integral e dt`, the integral by the backward rectangle: `I_k = I_(k-1) + K_i T e_k`.
///
/// A step is asked for first, [`Self::ask`], and taken once the limiter behind has let it through, [`Self::take`] and
/// [`Self::take_limited`].
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
/// 2 multiply-adds and an addition a step; 2 additions and 4 compares more where the output is limited.
/// # Example
/// ```
/// use hysteron_core::pi_controller::{PiController, PiState};
/// let controller = PiController::new(2.0, 1000.0, 50e3)?; // V/um, V/(um s)
/// let mut state = PiState::default();
/// let asked = controller.ask(&state, 0.1_f64);
/// controller.take(&mut state, asked);
/// assert!((asked.output - 0.2).abs() < 0.01 && state.integral() > 0.0);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
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

/// What a controller asks for at one sample: its output, and the integral in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asked<T> {
    /// Proportional and integral part.
    pub output: T,
    pub(crate) integral: T,
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

    /// Proportional gain, and integral gain a sample.
    pub fn gains(&self) -> [T; 2] {
        [self.proportional, self.integral_a_sample]
    }

    /// A controller that does nothing: both gains 0.
    pub fn none() -> Self {
        Self {
            proportional: T::ZERO,
            integral_a_sample: T::ZERO,
        }
    }

    /// With a share of the error, from 0 to 1 (brought into that, NaN to 0), in place of the whole.
    ///
    /// The error is weighted, not the output: at 0 the integral stands still, keeps the correction of slow errors (creep, drift, offset)
    /// that it has found, and does not wind up.
    #[must_use]
    pub fn weighted(&self, share: T) -> Self {
        let share = share.select_max(T::ZERO).select_min(T::ONE);
        Self {
            proportional: self.proportional * share,
            integral_a_sample: self.integral_a_sample * share,
        }
    }

    /// One sample: what the controller asks for at an error, which changes nothing yet. An error that is not usable gives what is not.
    #[inline(always)]
    pub fn ask(&self, state: &PiState<T>, error: T) -> Asked<T> {
        let integral = state.integral + self.integral_a_sample * error;
        let output = self.proportional * error + integral;
        Asked { output, integral }
    }

    /// As [`Self::ask`]; an error that is not finite or above 1e25 counts as 0.
    pub fn ask_checked(&self, state: &PiState<T>, error: T) -> Asked<T> {
        // A NaN fails the comparison.
        let usable = error.magnitude() <= T::from_f64(LARGEST_ERROR);
        self.ask(state, if usable { error } else { T::ZERO })
    }

    /// The sample's output went out as it was asked for.
    #[inline(always)]
    pub fn take(&self, state: &mut PiState<T>, asked: Asked<T>) {
        state.integral = asked.integral;
    }

    /// The sample's output was changed by `excess`: the integral goes as far as that allows, between where it is and where it would be.
    #[inline(always)]
    pub fn take_limited(&self, state: &mut PiState<T>, asked: Asked<T>, excess: T) {
        let (from, to) = (state.integral, asked.integral);
        let allowed = to + excess;
        state.integral = if T::MAX_INSTRUCTION {
            allowed.select_max(from.select_min(to)).select_min(from.select_max(to))
        } else if excess < T::ZERO && to > from {
            allowed.select_max(from)
        } else if excess > T::ZERO && to < from {
            allowed.select_min(from)
        } else {
            to
        };
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

    /// One sample behind limits.
    fn step<T: Real>(pi: &PiController<T>, state: &mut PiState<T>, error: T, lowest: T, highest: T) -> T {
        let asked = pi.ask_checked(state, error);
        let allowed = lowest.select_max(asked.output).select_min(highest);
        pi.take_limited(state, asked, allowed - asked.output);
        allowed
    }

    #[test]
    fn val_step_response_is_a_ramp_on_a_step() {
        // K_p = 1, K_i = 6000, T = 20 us: after k samples of e = 1 the output is 1 + 0.12 k.
        let pi = PiController::new(1.0_f64, 6000.0, 50e3).unwrap();
        let mut state = PiState::default();
        for k in 1..=100 {
            let asked = pi.ask(&state, 1.0);
            pi.take(&mut state, asked);
            assert!((asked.output - (1.0 + 0.12 * f64::from(k))).abs() < 1e-9);
        }
    }

    /// 6000 a second are 0.12 in a sample of 20 us; half of the error is half of both.
    #[test]
    fn val_gains_by_hand() {
        let close = |found: [f64; 2], wanted: [f64; 2]| {
            assert!(
                (found[0] - wanted[0]).abs() < 1e-15 && (found[1] - wanted[1]).abs() < 1e-15,
                "{found:?} {wanted:?}"
            );
        };
        let pi = PiController::new(1.5, 6000.0, 50e3).unwrap();
        close(pi.gains(), [1.5, 0.12]);
        close(pi.weighted(0.5).gains(), [0.75, 0.06]);
        close(pi.weighted(0.0).gains(), [0.0, 0.0]);
        close(pi.weighted(7.0).gains(), [1.5, 0.12]);
        close(PiController::none().gains(), [0.0, 0.0]);
    }

    #[test]
    fn val_leaves_saturation_at_once() {
        let pi = PiController::new(0.1, 600.0, 50e3).unwrap();
        let mut state = PiState::default();
        for _ in 0..50_000 {
            step(&pi, &mut state, 1.0, -10.0, 10.0);
        }
        // Without anti-windup the integral would stand at 600 and take 50 000 samples back.
        assert!(step(&pi, &mut state, -1.0, -10.0, 10.0) < 10.0);
        assert!(state.integral() <= 10.0);
    }

    #[test]
    fn val_starts_without_a_bump() {
        let pi = PiController::new(0.5_f64, 1000.0, 50e3).unwrap();
        let mut state = PiState::default();
        pi.start_at(&mut state, 3.25, 0.7);
        assert!((pi.ask(&state, 0.7).output - 3.25).abs() < 1e-12);
    }

    /// A slew limit narrows the room to a little around the last command: it must hold the integral, never move it.
    #[test]
    fn regress_a_narrow_room_does_not_move_the_integral() {
        let pi = PiController::new(1.0_f64, 1000.0, 50e3).unwrap();
        let mut state = PiState::default();
        pi.start_at(&mut state, 2.0, 5.0);
        let before = state.integral(); // 2 - 5 - 0.1
        // The output of 2.0 lies in the room of 1.9 to 2.2: one step of integration, 1000 x 20 us x 5, and no more.
        assert!((step(&pi, &mut state, 5.0, 1.9, 2.2) - 2.0).abs() < 1e-12);
        assert!((state.integral() - before - 0.1).abs() < 1e-12);
        // Below the room at a positive error: the whole step, and nothing beyond it.
        let before = state.integral();
        assert!((step(&pi, &mut state, 5.0, 7.0, 8.0) - 7.0).abs() < 1e-12);
        assert!((state.integral() - before - 0.1).abs() < 1e-12);
        // Above it at a negative one, where the room lies below what the integral had: alike.
        let before = state.integral();
        assert!((step(&pi, &mut state, -0.1, -9.0, -8.0) + 8.0).abs() < 1e-12);
        assert!((state.integral() - before + 0.002).abs() < 1e-12);
    }

    /// A slew limit of less than one step of integration a sample slows the integral down; it used to stop it for good.
    #[test]
    fn regress_a_slew_limit_does_not_lock_the_integral() {
        let pi = PiController::new(0.5_f64, 1000.0, 50e3).unwrap();
        let mut state = PiState::default();
        let mut last = 2.0;
        // e = 4 asks for 0.08 a sample; the room is 0.02 above the last output.
        for k in 1..=100 {
            last = step(&pi, &mut state, 4.0, last - 0.02, last + 0.02);
            assert!((last - (2.0 + 0.02 * f64::from(k))).abs() < 1e-12, "{k}: {last}");
            assert!((state.integral() - 0.02 * f64::from(k)).abs() < 1e-12);
        }
        // Against the other end alike.
        let mut state = PiState::default();
        let mut last = -2.0;
        for k in 1..=100 {
            last = step(&pi, &mut state, -4.0, last - 0.02, last + 0.02);
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
                for excess in extremes {
                    let asked = pi.ask_checked(&state, error);
                    assert!(!asked.output.is_nan());
                    pi.take_limited(&mut state, asked, excess);
                    assert!(state.integral().is_finite(), "{error} {excess}");
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
