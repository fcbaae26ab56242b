//! Lost motion at the output.

use crate::effects::{Block, admit};
use crate::error::{ParamError, in_range};
use crate::real::Real;

/// Lost motion of width 2 b: `z = max(y - b, min(y + b, z))`, a two-sided play (eq. 2) of the position.
///
/// # Units
/// Width (2 b) in the input's unit; ball tips and screws lose 5 to 200 nm.
/// # Cost
/// 2 compare-selects and 2 additions a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Backlash<T> {
    half_width: T,
}

/// Where the lost motion has left the output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BacklashState<T> {
    output: T,
}

impl<T: Real> Backlash<T> {
    /// Builds lost motion.
    ///
    /// # Errors
    /// A width that is negative or not below 1e6.
    pub fn new(width: T) -> Result<Self, ParamError> {
        in_range("width", None, width, 0.0, 1e6)?;
        Ok(Self {
            half_width: width * T::from_f64(0.5),
        })
    }
}

impl<T: Real> Block<T> for Backlash<T> {
    type State = BacklashState<T>;

    /// In the middle of the play.
    fn rest_at(&self, input: T) -> BacklashState<T> {
        BacklashState {
            output: admit(input, T::ZERO),
        }
    }

    #[inline(always)]
    fn step(&self, state: &mut BacklashState<T>, input: T) -> T {
        let input = admit(input, state.output);
        state.output = crate::play::two_sided(input, state.output, self.half_width);
        state.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_reversals_lose_the_width() {
        let backlash = Backlash::new(2.0_f64).unwrap();
        let mut state = backlash.rest_at(0.0);
        let outputs = [5.0, 4.0, 3.0, 2.0, 2.5, 4.5].map(|y| backlash.step(&mut state, y));
        assert_eq!(outputs, [4.0, 4.0, 4.0, 3.0, 3.0, 3.5]);
        assert_eq!(backlash.step(&mut state, f64::NAN), 3.5);
    }

    #[test]
    fn refuse_negative_width() {
        assert!(Backlash::new(-1e-3_f32).is_err());
        assert!(Backlash::new(f32::NAN).is_err());
    }
}
