//! The hysteresis of a designed law: a table of plays or fading elements.

use crate::corner_polynomial::CornerPolynomial;
use crate::corners::CornerState;
use crate::fading::{FadingInverse, FadingState};
use crate::model::{DirectInverse, Hysteresis};
use crate::real::Real;
use crate::tracking_law::{FADING, PLAYS};

/// One of the two inverses. A chip's law is built with the one that its table has, and pays for no other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EitherInverse<T> {
    /// Plays.
    Plays(CornerPolynomial<T, PLAYS>),
    /// Elements of Duhem's kind.
    Fading(FadingInverse<T, FADING>),
}

/// State of [`EitherInverse`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EitherState<T> {
    /// Of plays.
    Plays(CornerState<T, PLAYS>),
    /// Of fading elements.
    Fading(FadingState<T, FADING>),
}

impl<T: Real> Hysteresis<T> for EitherInverse<T> {
    type State = EitherState<T>;

    /// A state of the other kind gives way to that of rest.
    fn step(&self, state: &mut EitherState<T>, input: T) -> T {
        match (self, &mut *state) {
            (Self::Plays(inverse), EitherState::Plays(state)) => inverse.step(state, input),
            (Self::Fading(inverse), EitherState::Fading(state)) => inverse.step(state, input),
            (Self::Plays(inverse), _) => {
                let mut rest = inverse.rest();
                let output = inverse.step(&mut rest, input);
                *state = EitherState::Plays(rest);
                output
            }
            (Self::Fading(inverse), _) => {
                let mut rest = inverse.rest();
                let output = inverse.step(&mut rest, input);
                *state = EitherState::Fading(rest);
                output
            }
        }
    }
}

impl<T: Real> DirectInverse<T> for EitherInverse<T> {
    fn rest(&self) -> EitherState<T> {
        match self {
            Self::Plays(inverse) => EitherState::Plays(inverse.rest()),
            Self::Fading(inverse) => EitherState::Fading(inverse.rest()),
        }
    }
}
