//! A finite filter over a reference that is known some samples ahead.

use crate::effects::admit;
use crate::error::{ParamError, in_range};
use crate::real::Real;

/// `x_k = sum_j h_j r_{k + ahead - j}`: every sample takes in the reference `ahead` samples before it is due.
///
/// One filter holds everything linear that stands before the hysteresis in the inverse: the advance by the loop's
/// latency, and `1 / M(s)` of the structure (`r + 2 zeta / w r' + r'' / w^2` for one mode). With `ahead` = 0 the same filter
/// is a causal extrapolation for a reference that is not known before it is due.
///
/// # Units
/// Micrometres in and out.
/// # Range
/// Coefficients within +-1e5, their sum within 1e-3 of 1 (rest stays rest).
/// # Rounding
/// The sum is taken over differences from the sample that is due: second differences of a slow mode have coefficients of some
/// hundred, which in `f32` would leave a step of a 16-bit converter where they cancel.
/// # Cost
/// TAPS multiply-adds and subtractions a step, TAPS numbers of state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preview<T, const TAPS: usize> {
    coefficients: [T; TAPS],
    /// Sum of the coefficients, 1 but for rounding.
    total: T,
    ahead: usize,
}

/// The last TAPS samples of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreviewState<T, const TAPS: usize> {
    ring: [T; TAPS],
    newest: usize,
}

impl<T: Real, const TAPS: usize> Preview<T, TAPS> {
    /// Builds the filter; `coefficients[0]` belongs to the newest sample.
    ///
    /// # Errors
    /// A coefficient outside +-1e5 or not finite, a sum that is not 1, more samples ahead than the filter holds.
    pub fn new(coefficients: [f64; TAPS], ahead: usize) -> Result<Self, ParamError> {
        const { assert!(TAPS > 0, "a filter has at least one coefficient") }
        for (i, &value) in coefficients.iter().enumerate() {
            in_range("preview coefficient", Some(i), value, -1e5, 1e5)?;
        }
        let sum = coefficients.iter().sum::<f64>();
        in_range("sum of the preview coefficients", None, sum, 0.999, 1.001)?;
        in_range("samples ahead", None, ahead as f64, 0.0, (TAPS - 1) as f64)?;
        Ok(Self {
            coefficients: coefficients.map(T::from_f64),
            total: T::from_f64(sum),
            ahead,
        })
    }

    /// How many samples ahead the reference comes in.
    pub fn ahead(&self) -> usize {
        self.ahead
    }

    /// A reference that has always been `reference`.
    pub fn rest_at(&self, reference: T) -> PreviewState<T, TAPS> {
        PreviewState {
            ring: [admit(reference, T::ZERO); TAPS],
            newest: 0,
        }
    }

    /// One sample: takes in the reference `ahead` samples from now; an input that is not finite holds the last one.
    #[inline(always)]
    pub fn step(&self, state: &mut PreviewState<T, TAPS>, reference_ahead: T) -> T {
        let last = state.ring.get(state.newest).copied().unwrap_or(T::ZERO);
        state.newest = if state.newest + 1 < TAPS { state.newest + 1 } else { 0 };
        if let Some(cell) = state.ring.get_mut(state.newest) {
            *cell = admit(reference_ahead, last);
        }
        let due = self.due(state);
        let place = state.newest + 1;
        let (Some((younger, older)), Some((first, last))) = (
            state.ring.split_at_checked(place),
            self.coefficients.split_at_checked(place),
        ) else {
            return T::ZERO;
        };
        // Two loops: one over both parts of the ring, chained, takes 60 % longer on a Cortex-M4F.
        let mut sum = self.total * due;
        for (&h, &r) in first.iter().zip(younger.iter().rev()) {
            sum += h * (r - due);
        }
        for (&h, &r) in last.iter().zip(older.iter().rev()) {
            sum += h * (r - due);
        }
        sum
    }

    /// The reference that is due now, after [`Self::step`].
    #[inline(always)]
    pub fn due(&self, state: &PreviewState<T, TAPS>) -> T {
        let index = if self.ahead <= state.newest {
            state.newest - self.ahead
        } else {
            state.newest + TAPS - self.ahead
        };
        state.ring.get(index).copied().unwrap_or(T::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the sum written out, and the sample that is due.
    #[test]
    fn val_convolution_and_due_sample() {
        let filter = Preview::<f64, 5>::new([0.1, 0.2, 0.4, 0.2, 0.1], 2).unwrap();
        let mut state = filter.rest_at(1.0);
        let reference = |k: i32| if k < 0 { 1.0 } else { f64::from(k * k % 7) };
        for k in 0..40 {
            let found = filter.step(&mut state, reference(k));
            let wanted: f64 = [0.1, 0.2, 0.4, 0.2, 0.1]
                .iter()
                .zip(0..)
                .map(|(h, j)| h * reference(k - j))
                .sum();
            assert!((found - wanted).abs() < 1e-12);
            assert_eq!(filter.due(&state), reference(k - 2));
        }
    }

    #[test]
    fn prop_finite_for_every_input() {
        let filter = Preview::<f32, 3>::new([1e5, -1e5, 1.0], 1).unwrap();
        let mut state = filter.rest_at(f32::NAN);
        for input in [1.0, f32::NAN, 1e30, -1e30, f32::INFINITY, -f32::MAX, 0.0] {
            assert!(filter.step(&mut state, input).is_finite());
        }
    }

    #[test]
    fn refuse_filters_that_move_what_rests() {
        assert!(Preview::<f64, 2>::new([0.5, 0.4], 0).is_err());
        assert!(Preview::<f64, 2>::new([0.5, f64::NAN], 0).is_err());
        let refused = Preview::<f64, 2>::new([0.5, 0.5], 2).unwrap_err();
        assert_eq!(std::format!("{refused}"), "samples ahead = 2 must lie in 0 to 1");
    }
}
