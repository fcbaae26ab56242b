//! Thresholds of a bank of play operators: any ascending list.

use crate::error::{ParamError, in_range};
use crate::real::Real;

/// N thresholds r_1 < r_2 < .. < r_N, finite and not negative, in the unit of the model's input.
///
/// # Example
/// ```
/// use hysteron_core::thresholds::Thresholds;
/// // eq. 16 for N = 4 and a largest input of 2: r_i = (i - 1) / 4 * 2
/// assert_eq!(*Thresholds::<f32, 4>::even(2.0)?.values(), [0.0, 0.5, 1.0, 1.5]);
/// let refused = Thresholds::new([0.1, 0.1]).unwrap_err();
/// assert_eq!(refused.to_string(), "threshold[2] = 0.1 must exceed threshold[1] = 0.1; sort the values");
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds<T, const N: usize>([T; N]);

impl<T: Real, const N: usize> Thresholds<T, N> {
    /// Takes a list as it is.
    ///
    /// # Errors
    /// - A threshold that is negative, NaN or infinite.
    /// - A threshold that does not exceed the one before.
    pub fn new(values: [T; N]) -> Result<Self, ParamError> {
        const { assert!(N > 0, "a bank has at least one play operator") };
        let mut previous: Option<T> = None;
        for (i, &value) in values.iter().enumerate() {
            in_range("threshold", Some(i + 1), value, 0.0, f64::MAX)?;
            if let Some(before) = previous
                && value <= before
            {
                let (value, previous) = (value.to_f64(), before.to_f64());
                return Err(ParamError::NotIncreasing {
                    name: "threshold",
                    index: i + 1,
                    value,
                    previous,
                });
            }
            previous = Some(value);
        }
        Ok(Self(values))
    }

    /// Even spacing from zero, eq. 16: `r_i = (i - 1) / N * largest_input`.
    ///
    /// # Errors
    /// `largest_input` not finite and positive.
    pub fn even(largest_input: T) -> Result<Self, ParamError> {
        in_range("largest input", None, largest_input, f64::MIN_POSITIVE, f64::MAX)?;
        let mut values = [T::ZERO; N];
        for (i, value) in values.iter_mut().enumerate() {
            *value = T::from_f64(i as f64 / N as f64) * largest_input;
        }
        Self::new(values)
    }

    /// Logarithmic spacing from `smallest` to `largest`, both included (`smallest` alone for N = 1).
    ///
    /// # Errors
    /// Not `0 < smallest < largest`, or not finite.
    pub fn logarithmic(smallest: T, largest: T) -> Result<Self, ParamError> {
        let (low, high) = (smallest.to_f64(), largest.to_f64());
        in_range("smallest threshold", None, smallest, f64::MIN_POSITIVE, f64::MAX)?;
        in_range("largest threshold", None, largest, low, f64::MAX)?;
        let steps = if N > 1 { (N - 1) as f64 } else { 1.0 };
        let ratio = libm::log(high / low) / steps;
        let mut values = [T::ZERO; N];
        for (i, value) in values.iter_mut().enumerate() {
            *value = T::from_f64(low * libm::exp(ratio * i as f64));
        }
        if N > 1 {
            // As given, not as exp and log round it.
            values[N - 1] = largest;
        }
        Self::new(values)
    }

    /// The values, ascending.
    pub fn values(&self) -> &[T; N] {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn val_logarithmic() {
        let r = Thresholds::<f64, 3>::logarithmic(0.1, 10.0).unwrap();
        for (found, wanted) in r.values().iter().zip([0.1, 1.0, 10.0]) {
            assert!((found - wanted).abs() < 1e-12);
        }
        assert_eq!(r.values()[2], 10.0);
        assert_eq!(*Thresholds::<f32, 1>::logarithmic(0.1, 10.0).unwrap().values(), [0.1]);
    }

    #[test]
    fn refuse_bad_thresholds() {
        let check = |values: [f64; 2], message: &str| {
            assert_eq!(Thresholds::new(values).unwrap_err().to_string(), message);
        };
        check([-1.0, 1.0], "threshold[1] = -1 must be finite and not negative");
        check([0.0, f64::NAN], "threshold[2] = NaN must be finite and not negative");
        check(
            [0.15, 0.12],
            "threshold[2] = 0.12 must exceed threshold[1] = 0.15; sort the values",
        );
        assert!(Thresholds::<f64, 4>::even(0.0).is_err());
        assert!(Thresholds::<f64, 4>::logarithmic(1.0, 1.0).is_err());
    }
}
