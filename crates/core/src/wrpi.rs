//! The Prandtl-Ishlinskii model with rate-dependent weights (WRPI).

use crate::bank::{PlayBank, PlayState};
use crate::error::ParamError;
use crate::model::{Hysteresis, all_finite, bounded, dot, sum_of_magnitudes};
use crate::mpi::{self, MpiCoefficients};
use crate::real::Real;

/// Rate-dependent weights: `y = c + a_1 v^3 + a_2 v + sum (k_i + l_i v') F_ri[v]`, one-sided plays.
///
/// # Units
/// As [`crate::mpi::Mpi`] (k_i are its weights); l_i in output units times seconds per squared input unit.
/// # Cost
/// N compares twice and 2 N + 5 multiply-adds a step.
/// # Reference
/// Ang, Khosla, Riviere, IEEE/ASME Trans. Mechatronics 12 (2007) 134; the paper's section 4.3, which adds the cubic
/// input function (its a_1, a_2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrpi<T, const N: usize> {
    bank: PlayBank<T, N>,
    coefficients: MpiCoefficients<T, N>,
    rate_weights: [T; N],
}

impl<T: Real, const N: usize> Wrpi<T, N> {
    /// Builds the model.
    ///
    /// # Errors
    /// A coefficient that is not finite, or an output that is not over the bank's input range at its fastest rate.
    pub fn new(
        bank: PlayBank<T, N>,
        coefficients: MpiCoefficients<T, N>,
        rate_weights: [T; N],
    ) -> Result<Self, ParamError> {
        let most = bank.largest_input();
        let reach = most + bank.thresholds().values()[N - 1];
        let without_rate = coefficients.check(most, reach)?;
        all_finite("rate_weight", &rate_weights)?;
        let of_rate = sum_of_magnitudes(&rate_weights) * reach * bank.largest_rate();
        bounded(without_rate + of_rate, most)?;
        Ok(Self {
            bank,
            coefficients,
            rate_weights,
        })
    }
}

crate::model::impl_at_rest!(Wrpi);

impl<T: Real, const N: usize> Hysteresis<T> for Wrpi<T, N> {
    type State = PlayState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut PlayState<T, N>, input: T) -> T {
        let (input, change) = self.bank.advance_static(state, input);
        let rate = change * self.bank.sample_rate_hz();
        let MpiCoefficients {
            offset,
            cubic,
            linear,
            ref weights,
        } = self.coefficients;
        offset + output(cubic, linear, weights, &self.rate_weights, input, rate, state.outputs())
    }
}

/// `a_1 v^3 + a_2 v + sum (k_i + l_i v') w_i` over slices.
#[inline(always)]
pub fn output<T: Real>(
    cubic: T,
    linear: T,
    weights: &[T],
    rate_weights: &[T],
    input: T,
    rate_per_s: T,
    outputs: &[T],
) -> T {
    mpi::output(cubic, linear, weights, input, outputs) + rate_per_s * dot(rate_weights, outputs)
}
