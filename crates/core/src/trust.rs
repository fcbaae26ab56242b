//! How far feedback may take the platform away from where the feedforward has it: what a sensor can do that is wrong.

use crate::error::{ParamError, in_range};
use crate::real::Real;

/// Bounds of a correction about a feedforward, in size and rate.
///
/// A correction has a slow part (drift, creep and gain that the model does not have) and a quick one (what the model misses within a
/// period). The slow part follows what is asked for at a stated rate and up to a stated size; the quick part is what the correction may
/// differ from it. Whatever a sensor says, the correction therefore moves at once by no more than twice the quick part, then at the slow
/// rate, and ends at the sum of both sizes.
///
/// # Units
/// Volts; volts a second.
/// # Cost
/// 3 additions and 5 compares a step.
/// # Example
/// ```
/// use hysteron_core::trust::{Trust, TrustState};
/// let trust = Trust::<f64>::new(1.5, 3.0, 5.0, 50e3)?; // 1e-4 V a sample
/// let mut state = TrustState::default();
/// assert_eq!(trust.bound(&mut state, 40.0), 1.5);
/// let after_a_second = (0..50_000).map(|_| trust.bound(&mut state, 40.0)).last();
/// assert!((after_a_second.unwrap() - 4.5).abs() < 1e-6);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trust<T> {
    quick: T,
    slow: T,
    slow_a_sample: T,
}

/// The slow part of the correction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TrustState<T> {
    slow: T,
}

impl<T: Real> Trust<T> {
    /// Builds the bounds: size of the quick part, size of the slow one, rate of that.
    ///
    /// # Errors
    /// Values outside 0 to 1e6; a rate outside 0 to 1e9 a second or beyond what the number type resolves at the largest slow part; a
    /// sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(quick: f64, slow: f64, slow_per_s: f64, sample_rate_hz: f64) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("quick correction", None, quick, 0.0, 1e6)?;
        in_range("slow correction", None, slow, 0.0, 1e6)?;
        // A 2.5 millionth of its size a sample: `f32` resolves 6e-8, and rounding then changes a step by an eighth at most.
        let slowest = slow * sample_rate_hz / 2.5e6;
        in_range("rate of the slow correction", None, slow_per_s, slowest, 1e9)?;
        Ok(Self {
            quick: T::from_f64(quick),
            slow: T::from_f64(slow),
            slow_a_sample: T::from_f64(slow_per_s / sample_rate_hz),
        })
    }

    /// Quick and slow part, and what the slow one goes in a sample.
    pub fn sizes(&self) -> [T; 3] {
        [self.quick, self.slow, self.slow_a_sample]
    }

    /// One sample: what is left of a correction that is asked for. The slow part goes one way or the other in each.
    #[inline(always)]
    pub fn bound(&self, state: &mut TrustState<T>, asked: T) -> T {
        let (low, high) = (state.slow - self.quick, state.slow + self.quick);
        let allowed = low.select_max(asked.select_min(high));
        let toward = if allowed > state.slow {
            self.slow_a_sample
        } else {
            -self.slow_a_sample
        };
        state.slow = (state.slow + toward).select_min(self.slow).select_max(-self.slow);
        allowed
    }
}

impl<T: Real> TrustState<T> {
    /// The slow part.
    pub fn slow(&self) -> T {
        self.slow
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: the quick part at once, the slow one at 0.25 a sample up to 2, and back.
    #[test]
    fn val_bounds_by_hand() {
        let trust = Trust::<f64>::new(1.0, 2.0, 0.25, 1.0).unwrap();
        let mut state = TrustState::default();
        let asked = [0.5, 9.0, 9.0, 9.0, -9.0, -9.0];
        let found = asked.map(|asked| trust.bound(&mut state, asked));
        // Slow before each: 0, 0.25, 0.5, 0.75, 1, 0.75.
        assert_eq!(found, [0.5, 1.25, 1.5, 1.75, 0.0, -0.25]);
        assert_eq!(state.slow(), 0.5);
        for _ in 0..20 {
            assert!(trust.bound(&mut state, f64::INFINITY) <= 3.0);
        }
        assert_eq!((trust.bound(&mut state, 9.0), state.slow()), (3.0, 2.0));
        for _ in 0..40 {
            trust.bound(&mut state, f64::NEG_INFINITY);
        }
        assert_eq!((trust.bound(&mut state, -9.0), state.slow()), (-3.0, -2.0));
    }

    /// The numbers that a chip gets; and a correction that asks for nothing lets the slow part down, to come up again on the next sample.
    #[test]
    fn val_sizes_and_a_correction_of_none() {
        let trust = Trust::<f64>::new(1.0, 2.0, 0.25, 1.0).unwrap();
        assert_eq!(trust.sizes(), [1.0, 2.0, 0.25]);
        let mut state = TrustState::default();
        let slow = [0.0; 4].map(|asked| {
            assert_eq!(trust.bound(&mut state, asked), 0.0);
            state.slow()
        });
        assert_eq!(slow, [-0.25, 0.0, -0.25, 0.0]);
    }

    /// Within the quick part nothing is changed, and a need that lasts is taken over: the whole of the quick part is free again.
    #[test]
    fn val_lets_needs_through() {
        let trust = Trust::<f32>::new(1.0, 2.0, 5.0, 50e3).unwrap();
        let mut state = TrustState::default();
        for k in 0..50_000 {
            let asked = 0.8 + 0.9 * ((k % 100) as f32 / 100.0 - 0.5);
            let allowed = trust.bound(&mut state, asked);
            assert!(allowed == asked || k < 20_000, "{k}: {allowed} of {asked}");
        }
        assert!((state.slow() - 0.8).abs() < 0.46, "{}", state.slow());
    }

    #[test]
    fn prop_finite_for_every_input() {
        let trust = Trust::<f32>::new(1.0, 2.0, 5.0, 50e3).unwrap();
        let mut state = TrustState::default();
        for asked in [f32::NAN, f32::INFINITY, f32::MIN, 3.0, f32::NAN, -1e30] {
            let allowed = trust.bound(&mut state, asked);
            assert!(allowed.abs() <= 3.0 && state.slow().abs() <= 2.0, "{asked}: {allowed}");
        }
    }

    #[test]
    fn refuse_bounds_that_are_none() {
        use std::string::ToString;
        for (quick, slow, rate) in [
            (-1.0, 1.0, 1.0),
            (f64::NAN, 1.0, 1.0),
            (1.0, f64::INFINITY, 1.0),
            (1.0, 1.0, 0.0),
        ] {
            assert!(
                Trust::<f32>::new(quick, slow, rate, 50e3).is_err(),
                "{quick} {slow} {rate}"
            );
        }
        assert_eq!(
            Trust::<f32>::new(1.0, 5.0, 0.01, 50e3).unwrap_err().to_string(),
            "rate of the slow correction = 0.01 must lie in 0.1 to 1000000000"
        );
    }
}
