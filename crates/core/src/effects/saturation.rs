//! Hard limits: the rails of an amplifier, the stops of a mechanism.

use crate::effects::{Block, admit};
use crate::error::{ParamError, finite};
use crate::real::Real;

/// A hard limit, `y = min(max(u, low), high)`.
///
/// # Units
/// Volts at an amplifier's rails, micrometres at end stops.
/// # Cost
/// 2 compare-selects a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Saturation<T> {
    low: T,
    high: T,
}

/// The last output of a limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SaturationState<T> {
    output: T,
}

impl<T: Real> Saturation<T> {
    /// Builds a limit.
    ///
    /// # Errors
    /// Limits that are not finite or do not ascend.
    pub fn new(low: T, high: T) -> Result<Self, ParamError> {
        finite("low", None, low)?;
        finite("high", None, high)?;
        if high <= low {
            let (value, previous) = (high.to_f64(), low.to_f64());
            return Err(ParamError::NotIncreasing {
                name: "limit",
                index: 2,
                value,
                previous,
            });
        }
        Ok(Self { low, high })
    }

    /// The input within the limits.
    #[inline(always)]
    pub fn limit(&self, input: T) -> T {
        self.low.select_max(input).select_min(self.high)
    }
}

impl<T: Real> Block<T> for Saturation<T> {
    type State = SaturationState<T>;

    fn rest_at(&self, input: T) -> SaturationState<T> {
        SaturationState {
            output: self.limit(admit(input, T::ZERO)),
        }
    }

    #[inline(always)]
    fn step(&self, state: &mut SaturationState<T>, input: T) -> T {
        state.output = self.limit(admit(input, state.output));
        state.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_limits_and_holds() {
        let rails = Saturation::new(-1.0_f32, 2.0).unwrap();
        let mut state = rails.rest_at(5.0);
        let outputs = [f32::NAN, 0.5, -3.0, f32::INFINITY, 7.0].map(|u| rails.step(&mut state, u));
        assert_eq!(outputs, [2.0, 0.5, -1.0, -1.0, 2.0]);
    }

    #[test]
    fn refuse_limits_that_do_not_ascend() {
        let refused = Saturation::new(2.0_f64, 2.0).unwrap_err();
        assert_eq!(
            std::format!("{refused}"),
            "limit[2] = 2 must exceed limit[1] = 2; sort the values"
        );
        assert!(Saturation::new(f64::NAN, 2.0).is_err());
    }
}
