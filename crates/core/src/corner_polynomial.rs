//! The play-polynomial model by corners: the hysteresis of the complete law.

use crate::bank::PlayBank;
use crate::corners::{CornerState, Corners, Sums};
use crate::error::ParamError;
use crate::model::{AtRest, DirectInverse, Hysteresis, bounded};
use crate::play_polynomial::{INPUT_DEGREE, PlayPolynomial, PolynomialCoefficients, of_input};
use crate::real::Real;

/// `sum q1_j w_j + q2_j w_j^2 + q3_j w_j^3` over the first plays, as polynomials of what moves them.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cubic<T> {
    /// Coefficients of v, v^2, v^3 for `w_j = v`.
    right: [T; 3],
    /// Those of 1, v, v^2, v^3 for `w_j = v - r_j`; the last is that of the right side.
    left: [T; 3],
}

impl<T: Real> Sums<T> for Cubic<T> {
    #[inline(always)]
    fn at(&self, left: bool, v: T) -> T {
        let [first, second, third] = self.right;
        if left {
            let [none, first, second] = self.left;
            ((third * v + second) * v + first) * v + none
        } else {
            ((third * v + second) * v + first) * v
        }
    }
}

/// [`crate::play_polynomial::PlayPolynomial`] computed from the corners of its input: the same play outputs, bit by bit; the same sum
/// but for rounding.
///
/// All plays that one sample moves have one value, or one value less their thresholds: the sum of their cubics is one cubic of it,
/// whose coefficients are known before.
///
/// # Cost
/// In instructions of a Cortex-M4F: about 100 a sample, 20 for each corner that it wipes out, 10 log2 N where it jumps into a segment,
/// where [`crate::play_polynomial::PlayPolynomial`] takes 14 to 18 for each play.
/// # Errors
/// As of [`crate::corners`]: it does not drift. In `f32` the sum is no further off than play by play
/// (`val_cubics_by_corners_are_no_coarser`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerPolynomial<T, const N: usize> {
    corners: Corners<T, Cubic<T>, N>,
    offset: T,
    input_function: [T; INPUT_DEGREE],
}

impl<T: Real, const N: usize> CornerPolynomial<T, N> {
    /// Builds the model.
    ///
    /// # Errors
    /// As [`PlayPolynomial::new`].
    pub fn new(bank: PlayBank<T, N>, coefficients: PolynomialCoefficients<T, N>) -> Result<Self, ParamError> {
        PlayPolynomial::new(bank, coefficients)?;
        let PolynomialCoefficients {
            offset,
            input_function,
            linear,
            quadratic,
            cubic,
        } = coefficients;
        let thresholds = *bank.thresholds().values();
        let (mut right, mut left) = ([0.0; 3], [0.0; 3]);
        let mut largest = 0.0_f64;
        let corners = Corners::new(bank, |i| {
            // Rounded once, whatever the number of plays.
            let r = thresholds[i].to_f64();
            let [q1, q2, q3] = [linear[i], quadratic[i], cubic[i]].map(T::to_f64);
            let of_right = [q1, q2, q3];
            // q1 (v - r) + q2 (v - r)^2 + q3 (v - r)^3 by powers of v
            let of_left = [
                -r * (q1 - r * (q2 - r * q3)),
                q1 - r * (2.0 * q2 - 3.0 * r * q3),
                q2 - 3.0 * r * q3,
            ];
            for (sum, q) in right.iter_mut().zip(of_right) {
                *sum += q;
            }
            for (sum, q) in left.iter_mut().zip(of_left) {
                *sum += q;
            }
            for c in right.iter().chain(&left) {
                largest = largest.max(c.abs());
            }
            Cubic {
                right: right.map(T::from_f64),
                left: left.map(T::from_f64),
            }
        });
        bounded(T::from_f64(largest), corners.bank.largest_input())?;
        Ok(Self {
            corners,
            offset,
            input_function,
        })
    }

    /// The bank of plays.
    pub fn bank(&self) -> &PlayBank<T, N> {
        &self.corners.bank
    }

    /// Constant, and coefficients of the input's powers from the first on.
    pub fn input_function(&self) -> (T, &[T; INPUT_DEGREE]) {
        (self.offset, &self.input_function)
    }

    /// For each play the sum of the cubics up to it: by v, v^2, v^3 where all of these plays are at v, by 1, v, v^2, v^3 where each is at
    /// v less its threshold.
    pub fn sums(&self) -> [([T; 3], [T; 4]); N] {
        self.corners.sums().map(|sum| {
            let ([first, second, third], right) = (sum.left, sum.right);
            (right, [first, second, third, right[2]])
        })
    }

    /// The plays' outputs, for comparison: O(N).
    pub fn outputs(&self, state: &CornerState<T, N>) -> [T; N] {
        self.corners.outputs(state)
    }
}

impl<T: Real, const N: usize> Hysteresis<T> for CornerPolynomial<T, N> {
    type State = CornerState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut CornerState<T, N>, input: T) -> T {
        let (input, _) = self.corners.bank.admit_next(&mut state.input, input);
        let of_input = of_input(&self.input_function, input);
        self.offset + (of_input + self.corners.step(state, input, input))
    }
}

impl<T: Real, const N: usize> AtRest<T> for CornerPolynomial<T, N> {
    fn at_rest(&self, output: T, last_input: T) -> CornerState<T, N> {
        self.corners.at_rest(output, self.corners.bank.input_at(last_input))
    }
}

impl<T: Real, const N: usize> DirectInverse<T> for CornerPolynomial<T, N> {
    fn rest(&self) -> CornerState<T, N> {
        self.at_rest(T::ZERO, T::ZERO)
    }
}
