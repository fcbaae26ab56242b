//! The modified rate-dependent model for the chip: what has not moved is not computed again.

use crate::bank::InputState;
use crate::model::{AtRest, Hysteresis};
use crate::mpi::MpiCoefficients;
use crate::mrpi::Mrpi;
use crate::plays_sum::{self, Bank, FirstPlays, SumOfPlays};
use crate::real::Real;
use core::marker::PhantomData;

/// [`Mrpi`] with its plays moved and summed by `S`: the same outputs, bit by bit.
///
/// # Cost
/// That of `S`, and 4 multiply-adds, 4 additions and 2 compares.
/// # Example
/// ```
/// use hysteron_core::{bank::*, envelope::Envelope, model::*, mpi::MpiCoefficients, mrpi::Mrpi, quick_mrpi::QuickMrpi, thresholds::Thresholds};
/// let bank = PlayBank::new(Thresholds::new([0.0_f32, 0.1])?, -2.0, 2.0, 50e3)?;
/// let coefficients = MpiCoefficients { offset: 0.0, cubic: 0.0, linear: 1.0, weights: [1.0, 0.5] };
/// let model = Mrpi::new(bank, coefficients, Envelope { alpha_s: 3e-5, beta_s: 1e-5 })?;
/// let quick = QuickMrpi::<f32, 2>::new(model);
/// let (mut a, mut b) = (model.at_rest(0.0, 0.0), quick.at_rest(0.0, 0.0));
/// for input in [0.3, 0.7, 0.2, 0.5] {
///     assert_eq!(model.step(&mut a, input), quick.step(&mut b, input));
/// }
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuickMrpi<T, const N: usize, S = FirstPlays> {
    model: Mrpi<T, N>,
    sum_of_plays: PhantomData<S>,
}

/// State of [`QuickMrpi`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuickState<T, const N: usize> {
    outputs: [T; N],
    sums: [T; N],
    input: InputState<T>,
}

impl<T: Real, const N: usize, S> QuickMrpi<T, N, S> {
    /// The same model.
    pub fn new(model: Mrpi<T, N>) -> Self {
        Self {
            model,
            sum_of_plays: PhantomData,
        }
    }
}

impl<T: Copy, const N: usize> QuickState<T, N> {
    /// The plays' outputs.
    pub fn outputs(&self) -> &[T; N] {
        &self.outputs
    }
}

impl<T: Real, const N: usize, S: SumOfPlays<T, N>> Hysteresis<T> for QuickMrpi<T, N, S> {
    type State = QuickState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut QuickState<T, N>, input: T) -> T {
        let Mrpi {
            bank,
            coefficients,
            envelope,
        } = &self.model;
        let (input, change) = bank.admit_next(&mut state.input, input);
        let (left, right) = envelope.bounds(input, change);
        let bank = Bank {
            thresholds: bank.thresholds().values(),
            weights: &coefficients.weights,
            offset: coefficients.offset,
        };
        let sum = S::step(&bank, &mut state.outputs, &mut state.sums, left, right);
        // Read here, as the coefficients are, so that no register has to hold it meanwhile.
        let input = state.input.last();
        (coefficients.cubic * input * input + coefficients.linear) * input + sum
    }
}

impl<T: Real, const N: usize, S: SumOfPlays<T, N>> AtRest<T> for QuickMrpi<T, N, S> {
    fn at_rest(&self, output: T, last_input: T) -> QuickState<T, N> {
        let outputs = [if output.is_finite() { output } else { T::ZERO }; N];
        let MpiCoefficients { offset, weights, .. } = &self.model.coefficients;
        QuickState {
            sums: plays_sum::sums(*offset, weights, &outputs),
            outputs,
            input: self.model.bank.input_at(last_input),
        }
    }
}
