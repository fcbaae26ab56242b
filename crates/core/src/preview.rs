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
/// The sum is taken over differences from sample to sample, each with the sum of the coefficients from it on: second differences of a
/// slow mode have coefficients of some hundred, which in `f32` would leave a step of a 16-bit converter where they cancel.
/// # Cost
/// TAPS multiply-adds a step, 2 TAPS numbers of state.
/// # Example
/// ```
/// use hysteron_core::preview::Preview;
/// let preview = Preview::new([0.25, 0.5, 0.25], 1)?; // the reference of one sample later stands in the middle
/// let mut state = preview.rest_at(0.0_f64);
/// let out: Vec<f64> = [1.0, 1.0, 1.0].into_iter().map(|reference| preview.step(&mut state, reference)).collect();
/// assert_eq!(out, [0.25, 0.75, 1.0]);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preview<T, const TAPS: usize> {
    /// `sum_(i > j) h_i` of each coefficient j: what a step of the reference between the samples j and j + 1 has not reached yet.
    /// The last is 0.
    tails: [T; TAPS],
    /// Sum of the coefficients, 1 but for rounding.
    total: T,
    ahead: usize,
}

/// The last samples of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreviewState<T, const TAPS: usize> {
    /// Each sample less the one after it, the newest first, round a ring; twice, so that it lies in one piece wherever it begins.
    falls: [[T; TAPS]; 2],
    begin: usize,
    newest: T,
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
        let mut tail = 0.0;
        let mut tails = [T::ZERO; TAPS];
        for (cell, &h) in tails.iter_mut().zip(&coefficients).rev() {
            *cell = T::from_f64(tail);
            tail += h;
        }
        Ok(Self {
            tails,
            total: T::from_f64(sum),
            ahead,
        })
    }

    /// The number that the newest reference is multiplied by, and that of each step from sample to sample, the newest first.
    pub fn coefficients(&self) -> (T, &[T; TAPS]) {
        (self.total, &self.tails)
    }

    /// How many samples ahead the reference comes in.
    pub fn ahead(&self) -> usize {
        self.ahead
    }

    /// A reference that has always been `reference`.
    pub fn rest_at(&self, reference: T) -> PreviewState<T, TAPS> {
        PreviewState {
            falls: [[T::ZERO; TAPS]; 2],
            begin: 0,
            newest: admit(reference, T::ZERO),
        }
    }

    /// One sample: takes in the reference `ahead` samples from now; an input that is not finite holds the last one.
    #[inline(always)]
    pub fn step(&self, state: &mut PreviewState<T, TAPS>, reference_ahead: T) -> T {
        let newest = admit(reference_ahead, state.newest);
        let fall = state.newest - newest;
        state.newest = newest;
        let begin = match state.begin.checked_sub(1) {
            Some(before) if before < TAPS => before,
            _ => TAPS - 1,
        };
        state.begin = begin;
        state.falls[0][begin] = fall;
        state.falls[1][begin] = fall;
        let mut sum = self.total * newest;
        let falls = state.falls.as_flattened()[begin..].first_chunk::<TAPS>();
        for (&tail, &fall) in self.tails.iter().zip(falls.into_iter().flatten()).take(TAPS - 1) {
            sum += tail * fall;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the sum written out.
    #[test]
    fn val_convolution() {
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
        }
    }

    /// What is left of a sum of 1 behind each coefficient; exact in halves.
    #[test]
    fn val_coefficients_by_hand() {
        let filter = Preview::<f64, 4>::new([0.5, 0.25, 0.125, 0.125], 2).unwrap();
        assert_eq!(filter.coefficients(), (1.0, &[0.5, 0.25, 0.125, 0.0]));
        assert_eq!(filter.ahead(), 2);
        assert_eq!(Preview::<f64, 4>::new([1.0, 0.0, 0.0, 0.0], 0).unwrap().ahead(), 0);
    }

    /// Second differences of a mode at 739 Hz and 50 kHz, of some 50 each: in `f32` a fast sine comes out to within a hundredth of a nanometre.
    #[test]
    fn val_large_coefficients_cancel_in_single_precision() {
        let per_square = libm::pow(50e3 / (core::f64::consts::TAU * 739.0), 2.0);
        let coefficients = [0.0, per_square, 1.0 - 2.0 * per_square, per_square, 0.0];
        let (exact, single) = (
            Preview::<f64, 5>::new(coefficients, 2).unwrap(),
            Preview::<f32, 5>::new(coefficients, 2).unwrap(),
        );
        let (mut a, mut b) = (exact.rest_at(8.0), single.rest_at(8.0));
        for k in 0..5000 {
            let reference = (8.0 + 5.0 * libm::sin(core::f64::consts::TAU * 500.0 * f64::from(k) / 50e3)) as f32;
            let wanted = exact.step(&mut a, f64::from(reference));
            let found = f64::from(single.step(&mut b, reference));
            // The coefficients' own rounding: 6e-8 of 232 x 0.3 um a sample.
            assert!((found - wanted).abs() < 1e-5, "{k}: {found} {wanted}");
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
