//! A pure delay of any number of samples, whole or not.

use crate::effects::{Block, admit};
use crate::error::{ParamError, in_range};
use crate::real::Real;

/// A pure delay, `y(t) = u(t - tau)`, over a ring of `CAPACITY` samples.
///
/// Between two samples the cubic through the four around them stands (third-order Lagrange):
/// `u(p) = (1 - p) u_0 + p u_1 - p (1 - p) / 6 ((2 - p) c_0 + (1 + p) c_1)` with `c` the second differences at the two.
/// Two departures keep it usable ahead of a hysteresis, which never forgets an overshoot: where the second differences
/// disagree in sign (steps, corners) the line is straight, and neither counts for more than four times the other. Within
/// the newest interval, where the fourth sample is still to come, the older second difference serves for both.
///
/// # Units
/// Delay in seconds; the signal in any unit.
/// # Range
/// 0 to `CAPACITY - 3` samples.
/// # Error
/// On a sine of N samples a period, h = 2 pi / N, as a share of its amplitude: `0.023 h^4` where the second differences
/// agree (4e-5 at N = 30). Beside a zero crossing, where they do not and the line is straight, at most `h^3 / 8`; with
/// less than one sample of delay, where the second difference is that of one and a half samples before, `3 h^3 / 16`.
/// # Cost
/// 12 multiply-adds and 6 compare-selects a step, `CAPACITY` numbers of state.
/// # Example
/// ```
/// use hysteron_core::effects::{Block, delay::Delay};
/// let delay = Delay::<f64, 16>::new(50e-6, 50e3)?; // two and a half samples
/// let mut state = delay.rest_at(0.0);
/// let ramp = [1.0, 2.0, 3.0, 4.0, 5.0].map(|u| delay.step(&mut state, u));
/// assert_eq!(ramp[4], 2.5);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
/// # Reference
/// Laakso, Välimäki, Karjalainen, Laine, IEEE Signal Processing Magazine 13 (1996) 30 (Lagrange interpolation); the limit
/// on the second differences is that of essentially non-oscillatory interpolation (Harten, Osher 1987).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delay<T, const CAPACITY: usize> {
    whole: usize,
    fraction: T,
}

/// The last `CAPACITY` samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayState<T, const CAPACITY: usize> {
    ring: [T; CAPACITY],
    newest: usize,
}

impl<T: Real, const CAPACITY: usize> Delay<T, CAPACITY> {
    /// Builds a delay.
    ///
    /// # Errors
    /// A delay that is negative, not finite or longer than the ring holds; a sample rate outside 1e-3 to 1e7 Hz.
    pub fn new(delay_s: f64, sample_rate_hz: f64) -> Result<Self, ParamError> {
        const { assert!(CAPACITY >= 4, "the cubic needs four samples") }
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("delay_s", None, delay_s, 0.0, (CAPACITY - 3) as f64 / sample_rate_hz)?;
        // Rounding of the product must not step over the limit that has just been checked.
        let samples = (delay_s * sample_rate_hz).min((CAPACITY - 3) as f64);
        let whole = samples as usize;
        Ok(Self {
            whole,
            fraction: T::from_f64(samples - whole as f64),
        })
    }
}

impl<T: Real, const CAPACITY: usize> DelayState<T, CAPACITY> {
    /// The sample `age` steps ago; ages beyond the ring give its oldest.
    #[inline(always)]
    fn at(&self, age: usize) -> T {
        let age = if age < CAPACITY { age } else { CAPACITY - 1 };
        let index = if age <= self.newest {
            self.newest - age
        } else {
            self.newest + CAPACITY - age
        };
        self.ring.get(index).copied().unwrap_or(T::ZERO)
    }
}

impl<T: Real, const CAPACITY: usize> Block<T> for Delay<T, CAPACITY> {
    type State = DelayState<T, CAPACITY>;

    fn rest_at(&self, input: T) -> Self::State {
        DelayState {
            ring: [admit(input, T::ZERO); CAPACITY],
            newest: 0,
        }
    }

    #[inline(always)]
    fn step(&self, state: &mut Self::State, input: T) -> T {
        let last = state.at(0);
        state.newest = if state.newest + 1 < CAPACITY {
            state.newest + 1
        } else {
            0
        };
        if let Some(cell) = state.ring.get_mut(state.newest) {
            *cell = admit(input, last);
        }
        let (younger, older, oldest) = (state.at(self.whole), state.at(self.whole + 1), state.at(self.whole + 2));
        let older_bend = younger - older - older + oldest;
        let (a, b) = if self.whole > 0 {
            let younger_bend = state.at(self.whole - 1) - younger - younger + older;
            agreeing(younger_bend, older_bend)
        } else {
            let before = older - oldest - oldest + state.at(self.whole + 3);
            let (bend, _) = agreeing(older_bend, before);
            (bend, bend)
        };
        let p = self.fraction;
        let rest = T::ONE - p;
        let third = T::from_f64(1.0 / 6.0);
        rest * younger + p * older - p * rest * third * ((T::ONE + rest) * a + (T::ONE + p) * b)
    }
}

/// Both second differences where they agree in sign, neither more than four times the other; else zeros.
#[inline(always)]
fn agreeing<T: Real>(a: T, b: T) -> (T, T) {
    let four = T::from_f64(4.0);
    if a > T::ZERO && b > T::ZERO {
        (a.select_min(four * b), b.select_min(four * a))
    } else if a < T::ZERO && b < T::ZERO {
        (a.select_max(four * b), b.select_max(four * a))
    } else {
        (T::ZERO, T::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use std::vec::Vec;

    fn largest_error(samples_a_period: f64, delay_samples: f64) -> f64 {
        let delay = Delay::<f64, 64>::new(delay_samples, 1.0).unwrap();
        let mut state = delay.rest_at(0.0);
        let mut largest: f64 = 0.0;
        for k in 0..400 {
            let phase = |x: f64| (TAU * x / samples_a_period).sin();
            let found = delay.step(&mut state, phase(f64::from(k)));
            if k > 50 {
                largest = largest.max((found - phase(f64::from(k) - delay_samples)).abs());
            }
        }
        largest
    }

    /// A line errs by at most `p (1 - p) / 2 = 1/8` of the second difference. One sample from a zero crossing that is at
    /// most `h^3`; one and a half samples, `3/2 h^3`.
    #[test]
    fn val_sines_within_the_stated_error() {
        for n in [20.3, 40.7, 100.1] {
            for delay in [0.3, 0.5, 1.5, 2.25, 17.7] {
                let share = if delay < 1.0 { 3.0 / 16.0 } else { 1.0 / 8.0 };
                let bound = share * (TAU / n).powi(3);
                let found = largest_error(n, delay);
                assert!(found < bound, "{n} samples a period, {delay}: {found} {bound}");
            }
        }
    }

    #[test]
    fn val_whole_samples_are_exact() {
        let delay = Delay::<f64, 8>::new(3e-3, 1e3).unwrap();
        let mut state = delay.rest_at(7.0);
        let outputs: Vec<f64> = (0..6).map(|k| delay.step(&mut state, f64::from(k * k))).collect();
        assert_eq!(outputs, [7.0, 7.0, 7.0, 0.0, 1.0, 4.0]);
    }

    #[test]
    fn val_a_parabola_is_exact_from_one_sample_on() {
        let delay = Delay::<f64, 8>::new(1.4, 1.0).unwrap();
        let mut state = delay.rest_at(0.0);
        for k in 0..20 {
            let found = delay.step(&mut state, f64::from(k * k));
            if k > 4 {
                assert!((found - (f64::from(k) - 1.4).powi(2)).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn prop_a_step_never_overshoots() {
        for delay_samples in [0.1, 0.3, 0.5, 0.9, 1.3, 2.5] {
            let delay = Delay::<f64, 8>::new(delay_samples, 1.0).unwrap();
            let mut state = delay.rest_at(0.0);
            for _ in 0..10 {
                let y = delay.step(&mut state, 1.0);
                assert!((0.0..=1.0).contains(&y), "{delay_samples}: {y}");
            }
        }
    }

    #[test]
    fn prop_finite_for_every_input() {
        let delay = Delay::<f32, 8>::new(0.5, 1.0).unwrap();
        let mut state = delay.rest_at(f32::NAN);
        for input in [1.0, f32::NAN, f32::INFINITY, -f32::MAX, 2.0, 1e30, -1e30, 0.0] {
            assert!(delay.step(&mut state, input).is_finite());
        }
    }

    #[test]
    fn refuse_delays_beyond_the_ring() {
        let refused = Delay::<f64, 8>::new(6e-3, 1e3).unwrap_err();
        assert_eq!(std::format!("{refused}"), "delay_s = 0.006 must lie in 0 to 0.005");
        assert!(Delay::<f64, 8>::new(-1e-6, 1e3).is_err());
        assert!(Delay::<f64, 8>::new(f64::NAN, 1e3).is_err());
        assert!(Delay::<f64, 8>::new(5e-3, 1e3).is_ok());
    }
}
