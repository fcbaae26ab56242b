//! What all hysteresis models have in common, and what a direct inverse is.
//!
//! The inverse of a Prandtl-Ishlinskii model is one, too (eqs 12, 13): a *direct inverse* is the same configuration with
//! the desired displacement as input and the voltage as output, identified from records with the columns exchanged.
//! There is no second implementation; the units of thresholds and coefficients say which way a table runs.

use crate::error::{ParamError, finite};
use crate::real::Real;

/// A model that turns an input into an output sample by sample: forward (volts to micrometres) or direct inverse.
pub trait Hysteresis<T: Real> {
    /// What the model remembers.
    type State;

    /// One sample. Returns a finite number for every input, NaN included.
    fn step(&self, state: &mut Self::State, input: T) -> T;
}

/// A model or none, which gives 0 and leaves the state alone.
impl<T: Real, M: Hysteresis<T>> Hysteresis<T> for Option<M> {
    type State = M::State;

    #[inline(always)]
    fn step(&self, state: &mut M::State, input: T) -> T {
        self.as_ref().map_or(T::ZERO, |model| model.step(state, input))
    }
}

/// A model that can be put where a stage rests.
pub trait AtRest<T: Real>: Hysteresis<T> {
    /// All plays at one output, as after a long way down to it; the first rate is from `last_input`, brought into range.
    fn at_rest(&self, output: T, last_input: T) -> Self::State;
}

/// A model that runs from displacement to voltage, of a stage that is cycled before it is used.
pub trait DirectInverse<T: Real>: Hysteresis<T> {
    /// The state of a stage that was cycled and rests at 0 V.
    fn rest(&self) -> Self::State;
}

/// Implements [`AtRest`] for models whose state is a [`crate::bank::PlayState`].
macro_rules! impl_at_rest {
    ($model:ident) => {
        impl<T: Real, const N: usize> crate::model::AtRest<T> for $model<T, N> {
            fn at_rest(&self, output: T, last_input: T) -> PlayState<T, N> {
                PlayState::at_rest(&self.bank, output, last_input)
            }
        }
    };
}
pub(crate) use impl_at_rest;

/// `sum c_i x_i`, even and odd elements apart: half as long a chain of additions, and pairs fit a vector register.
///
/// Both slices have the same length.
#[inline(always)]
pub(crate) fn dot<T: Real>(coefficients: &[T], values: &[T]) -> T {
    let mut pairs = coefficients.chunks_exact(2).zip(values.chunks_exact(2));
    let (mut even, mut odd) = match pairs.next() {
        Some((c, x)) => (c[0] * x[0], c[1] * x[1]),
        None => (T::ZERO, T::ZERO),
    };
    for (c, x) in pairs {
        even += c[0] * x[0];
        odd += c[1] * x[1];
    }
    for (&c, &x) in coefficients
        .chunks_exact(2)
        .remainder()
        .iter()
        .zip(values.chunks_exact(2).remainder())
    {
        even += c * x;
    }
    even + odd
}

/// Refuses coefficients that are not finite.
pub(crate) fn all_finite<T: Real>(name: &'static str, values: &[T]) -> Result<(), ParamError> {
    values
        .iter()
        .enumerate()
        .try_for_each(|(i, &value)| finite(name, Some(i + 1), value))
}

/// Refuses an output bound that the number type cannot hold; twice over, so that roundings cannot carry it past the end.
pub(crate) fn bounded<T: Real>(bound: T, input: T) -> Result<(), ParamError> {
    if (bound + bound).is_finite() {
        Ok(())
    } else {
        Err(ParamError::Unbounded {
            name: "output",
            input: input.to_f64(),
        })
    }
}

/// `sum |c_i|`.
pub(crate) fn sum_of_magnitudes<T: Real>(values: &[T]) -> T {
    values.iter().fold(T::ZERO, |sum, &value| sum + value.magnitude())
}
