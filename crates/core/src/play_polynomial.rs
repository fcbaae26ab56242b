//! The play-polynomial model: each play's output through a cubic.

use crate::bank::{PlayBank, PlayState};
use crate::error::{ParamError, finite};
use crate::model::{Hysteresis, all_finite, bounded, sum_of_magnitudes};
use crate::real::Real;

/// Degree of the input function.
pub const INPUT_DEGREE: usize = 5;

/// `y = c + g(v) + sum (q1_i w_i + q2_i w_i^2 + q3_i w_i^3)`, `g` a polynomial of degree 5 without constant.
///
/// A Preisach operator is an integral of functions of play outputs (Krejci), so this form reaches loops that change with
/// bias, where a weight a play cannot. It extrapolates badly: keep the input range to what it was identified on.
///
/// # Units
/// Powers of the input unit as the degree says.
/// # Cost
/// N compares twice and 3 N + 6 multiply-adds a step.
/// # Reference
/// Krejci, Hysteresis, Convexity and Dissipation in Hyperbolic Equations (1996), section II.3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlayPolynomial<T, const N: usize> {
    bank: PlayBank<T, N>,
    coefficients: PolynomialCoefficients<T, N>,
}

/// Coefficients of [`PlayPolynomial`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PolynomialCoefficients<T, const N: usize> {
    /// c, output units
    pub offset: T,
    /// g's coefficients of v, v^2, .. v^5
    pub input_function: [T; INPUT_DEGREE],
    /// q1_i
    pub linear: [T; N],
    /// q2_i
    pub quadratic: [T; N],
    /// q3_i
    pub cubic: [T; N],
}

impl<T: Real, const N: usize> PlayPolynomial<T, N> {
    /// Builds the model.
    ///
    /// # Errors
    /// A coefficient that is not finite, or an output that is not over the bank's input range.
    pub fn new(bank: PlayBank<T, N>, coefficients: PolynomialCoefficients<T, N>) -> Result<Self, ParamError> {
        let PolynomialCoefficients {
            offset,
            input_function,
            linear,
            quadratic,
            cubic,
        } = &coefficients;
        finite("offset", None, *offset)?;
        all_finite("input_function", input_function)?;
        all_finite("linear", linear)?;
        all_finite("quadratic", quadratic)?;
        all_finite("cubic", cubic)?;
        let most = bank.largest_input();
        let reach = most + bank.thresholds().values()[N - 1];
        let of_input = input_function
            .iter()
            .rev()
            .fold(T::ZERO, |sum, &c| (sum + c.magnitude()) * most);
        let of_plays = ((sum_of_magnitudes(cubic) * reach + sum_of_magnitudes(quadratic)) * reach
            + sum_of_magnitudes(linear))
            * reach;
        bounded(offset.magnitude() + of_input + of_plays, most)?;
        Ok(Self { bank, coefficients })
    }
}

crate::model::impl_at_rest!(PlayPolynomial);

impl<T: Real, const N: usize> Hysteresis<T> for PlayPolynomial<T, N> {
    type State = PlayState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut PlayState<T, N>, input: T) -> T {
        let (input, _) = self.bank.advance_static(state, input);
        let c = &self.coefficients;
        c.offset
            + output(
                &c.input_function,
                [&c.linear, &c.quadratic, &c.cubic],
                input,
                state.outputs(),
            )
    }
}

/// `g(v)`
#[inline(always)]
pub(crate) fn of_input<T: Real>(input_function: &[T; INPUT_DEGREE], input: T) -> T {
    let mut sum = T::ZERO;
    for &c in input_function.iter().rev() {
        sum = (sum + c) * input;
    }
    sum
}

/// `g(v) + sum (q1_i w_i + q2_i w_i^2 + q3_i w_i^3)` over slices; `plays` are q1, q2, q3.
#[inline(always)]
pub fn output<T: Real>(input_function: &[T; INPUT_DEGREE], plays: [&[T]; 3], input: T, outputs: &[T]) -> T {
    let mut sum = of_input(input_function, input);
    let [linear, quadratic, cubic] = plays;
    for (((&w, &q1), &q2), &q3) in outputs.iter().zip(linear).zip(quadratic).zip(cubic) {
        sum += ((q3 * w + q2) * w + q1) * w;
    }
    sum
}
