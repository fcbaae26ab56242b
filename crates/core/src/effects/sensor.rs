//! A sensor whose reading bends.

use crate::effects::{Block, LARGEST_GAIN, admit};
use crate::error::{ParamError, in_range};
use crate::real::Real;

/// A sensor's curve, `y_m = y + c_2 y^2 + c_3 y^3`.
///
/// # Units
/// `c_2` in 1/um, `c_3` in 1/um^2; capacitive sensors bend by 0.01 to 0.1 % of their range.
/// # Cost
/// 3 multiply-adds a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorCurve<T> {
    quadratic: T,
    cubic: T,
    largest: T,
}

/// The last position a sensor could read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorState<T> {
    input: T,
}

/// No stage moves further, micrometres (a metre): keeps the cube finite in `f32`.
const LARGEST_UM: f64 = 1e6;

impl<T: Real> SensorCurve<T> {
    /// Builds a curve.
    ///
    /// # Errors
    /// A coefficient that is not finite or beyond 1e6.
    pub fn new(quadratic: T, cubic: T) -> Result<Self, ParamError> {
        in_range("quadratic", None, quadratic, -LARGEST_GAIN, LARGEST_GAIN)?;
        in_range("cubic", None, cubic, -LARGEST_GAIN, LARGEST_GAIN)?;
        Ok(Self {
            quadratic,
            cubic,
            largest: T::from_f64(LARGEST_UM),
        })
    }

    /// Quadratic and cubic coefficient.
    pub fn coefficients(&self) -> [T; 2] {
        [self.quadratic, self.cubic]
    }

    /// The reading at a position.
    #[inline(always)]
    pub fn reading(&self, position: T) -> T {
        position * (T::ONE + position * (self.quadratic + position * self.cubic))
    }

    /// Slope of the reading at a position.
    #[inline(always)]
    pub fn slope(&self, position: T) -> T {
        let (two, three) = (T::from_f64(2.0), T::from_f64(3.0));
        T::ONE + position * (two * self.quadratic + position * (three * self.cubic))
    }
}

impl<T: Real> Block<T> for SensorCurve<T> {
    type State = SensorState<T>;

    fn rest_at(&self, input: T) -> SensorState<T> {
        SensorState {
            input: admit(input, T::ZERO),
        }
    }

    #[inline(always)]
    fn step(&self, state: &mut SensorState<T>, input: T) -> T {
        let input = admit(input, state.input);
        state.input = (-self.largest).select_max(input).select_min(self.largest);
        self.reading(state.input)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_polynomial_and_its_slope() {
        let curve = SensorCurve::new(0.1_f64, -0.02).unwrap();
        assert!((curve.reading(2.0) - (2.0 + 0.4 - 0.16)).abs() < 1e-15);
        let h = 1e-6;
        let by_differences = (curve.reading(2.0 + h) - curve.reading(2.0 - h)) / (2.0 * h);
        assert!((curve.slope(2.0) - by_differences).abs() < 1e-9);
    }

    #[test]
    fn prop_finite_for_every_input() {
        let curve = SensorCurve::new(1e6_f32, -1e6).unwrap();
        let mut state = curve.rest_at(f32::NAN);
        for input in [f32::NAN, f32::INFINITY, -f32::MAX, 1e30] {
            assert!(curve.step(&mut state, input).is_finite());
        }
    }

    #[test]
    fn refuse_coefficients_without_bound() {
        assert!(SensorCurve::new(f64::INFINITY, 0.0).is_err());
        assert!(SensorCurve::new(0.0, 1e7).is_err());
    }
}
