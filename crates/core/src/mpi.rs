//! The modified Prandtl-Ishlinskii model (eq. 6) and its direct inverse (eq. 12).

use crate::bank::{PlayBank, PlayState};
use crate::error::{ParamError, finite};
use crate::model::{Hysteresis, all_finite, bounded, dot, sum_of_magnitudes};
use crate::real::Real;

/// The modified Prandtl-Ishlinskii model, eq. 6: `y = c + a_1 v^3 + a_2 v + sum p_i F_ri[v]`, one-sided plays.
///
/// As a direct inverse (eq. 12) the input is y_d and the output the voltage.
///
/// # Units
/// Offset in the output's unit; `cubic` per cubed input unit; `linear` and weights per input unit.
/// # Cost
/// N compares twice and N + 4 multiply-adds a step.
/// # Reference
/// Gu, Zhu, Su, IEEE Trans. Ind. Electron. 61 (2014) 1583; the paper's eqs 6 and 12. The offset is the sensor's zero.
/// # Example
/// ```
/// use hysteron_core::{bank::{PlayBank, PlayState}, model::Hysteresis, mpi::{Mpi, MpiCoefficients}, thresholds::Thresholds};
/// let bank = PlayBank::new(Thresholds::new([1.0])?, -10.0, 10.0, 50e3)?;
/// let mpi = Mpi::new(bank, MpiCoefficients { offset: 0.0, cubic: 0.01, linear: 0.5, weights: [1.0] })?;
/// let up: f64 = mpi.step(&mut PlayState::virgin(), 3.0);
/// assert!((up - (0.01 * 27.0 + 0.5 * 3.0 + 2.0)).abs() < 1e-12);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mpi<T, const N: usize> {
    bank: PlayBank<T, N>,
    coefficients: MpiCoefficients<T, N>,
}

/// Coefficients of [`Mpi`], and of the static part of [`crate::mrpi::Mrpi`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MpiCoefficients<T, const N: usize> {
    /// c, output units
    pub offset: T,
    /// a_1 (b_1 in eq. 10), output units per cubed input unit
    pub cubic: T,
    /// a_2 (b_2), output units per input unit
    pub linear: T,
    /// p_i (q_i), output units per input unit
    pub weights: [T; N],
}

impl<T: Real, const N: usize> MpiCoefficients<T, N> {
    /// Refuses coefficients that are not finite, or whose output is not when inputs reach `most` and plays `reach`;
    /// returns the bound of the output's magnitude.
    pub(crate) fn check(&self, most: T, reach: T) -> Result<T, ParamError> {
        finite("offset", None, self.offset)?;
        finite("cubic", None, self.cubic)?;
        finite("linear", None, self.linear)?;
        all_finite("weight", &self.weights)?;
        let input_function = (self.cubic.magnitude() * most * most + self.linear.magnitude()) * most;
        let bound = self.offset.magnitude() + input_function + sum_of_magnitudes(&self.weights) * reach;
        bounded(bound, most)?;
        Ok(bound)
    }
}

impl<T: Real, const N: usize> Mpi<T, N> {
    /// Builds the model.
    ///
    /// # Errors
    /// A coefficient that is not finite, or an output that is not over the bank's input range.
    pub fn new(bank: PlayBank<T, N>, coefficients: MpiCoefficients<T, N>) -> Result<Self, ParamError> {
        let most = bank.largest_input();
        coefficients.check(most, most + bank.thresholds().values()[N - 1])?;
        Ok(Self { bank, coefficients })
    }
}

crate::model::impl_at_rest!(Mpi);

impl<T: Real, const N: usize> Hysteresis<T> for Mpi<T, N> {
    type State = PlayState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut PlayState<T, N>, input: T) -> T {
        let (input, _) = self.bank.advance_static(state, input);
        let MpiCoefficients {
            offset,
            cubic,
            linear,
            ref weights,
        } = self.coefficients;
        offset + output(cubic, linear, weights, input, state.outputs())
    }
}

/// `a_1 v^3 + a_2 v + sum p_i w_i` over slices, for a number of plays that is known at run time only.
#[inline(always)]
pub fn output<T: Real>(cubic: T, linear: T, weights: &[T], input: T, outputs: &[T]) -> T {
    (cubic * input * input + linear) * input + dot(weights, outputs)
}
