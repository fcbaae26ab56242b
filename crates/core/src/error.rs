//! Why a parameter set is refused.

use core::fmt;

/// A parameter that cannot be used. Values are given as `f64` whatever the number type.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ParamError {
    /// A value is NaN, infinite or outside its range.
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// Its number, from 1, where there are several.
        index: Option<usize>,
        /// What was given.
        value: f64,
        /// Smallest allowed.
        min: f64,
        /// Largest allowed.
        max: f64,
    },
    /// Values that must ascend do not.
    NotIncreasing {
        /// The parameter.
        name: &'static str,
        /// Number, from 1, of the value that does not exceed the one before.
        index: usize,
        /// That value.
        value: f64,
        /// The one before.
        previous: f64,
    },
    /// The output could leave what the number type holds.
    Unbounded {
        /// What could.
        name: &'static str,
        /// Largest input allowed by the range.
        input: f64,
    },
}

impl fmt::Display for ParamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::OutOfRange {
                name,
                index,
                value,
                min,
                max,
            } => {
                write!(f, "{name}")?;
                if let Some(index) = index {
                    write!(f, "[{index}]")?;
                }
                write!(f, " = {} ", Shortest(value))?;
                // The largest number stands for no limit.
                match (min == -f64::MAX, max == f64::MAX) {
                    (true, true) => f.write_str("must be finite"),
                    (false, true) if min == 0.0 => f.write_str("must be finite and not negative"),
                    (false, true) if min == f64::MIN_POSITIVE => f.write_str("must be finite and positive"),
                    (false, true) => write!(f, "must be finite and at least {min}"),
                    _ => write!(f, "must lie in {min} to {max}"),
                }
            }
            Self::NotIncreasing {
                name,
                index,
                value,
                previous,
            } => write!(
                f,
                "{name}[{index}] = {} must exceed {name}[{}] = {}; sort the values",
                Shortest(value),
                index - 1,
                Shortest(previous)
            ),
            Self::Unbounded { name, input } => write!(
                f,
                "{name} is not finite over inputs up to {}; narrow the input range or check the coefficients' units",
                Shortest(input)
            ),
        }
    }
}

impl core::error::Error for ParamError {}

/// A value as its user wrote it: 0.12 in `f32` is 0.12, not the 0.11999999731779099 that it is exactly.
struct Shortest(f64);

impl fmt::Display for Shortest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let single = self.0 as f32;
        if f64::from(single) == self.0 {
            write!(f, "{single}")
        } else {
            write!(f, "{}", self.0)
        }
    }
}

/// Refuses a value that is not finite or outside `min..=max`.
pub(crate) fn in_range<T: crate::real::Real>(
    name: &'static str,
    index: Option<usize>,
    value: T,
    min: f64,
    max: f64,
) -> Result<(), ParamError> {
    let given = value.to_f64();
    // A NaN fails both comparisons.
    if given >= min && given <= max {
        Ok(())
    } else {
        Err(ParamError::OutOfRange {
            name,
            index,
            value: given,
            min,
            max,
        })
    }
}

/// Refuses a value that is NaN or infinite.
pub(crate) fn finite<T: crate::real::Real>(
    name: &'static str,
    index: Option<usize>,
    value: T,
) -> Result<(), ParamError> {
    in_range(name, index, value, -f64::MAX, f64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn refuse_with_a_message_a_user_understands() {
        for (refused, message) in [
            (finite("weight", Some(3), f64::NAN), "weight[3] = NaN must be finite"),
            (
                in_range("threshold", Some(1), -0.12_f32, 0.0, f64::MAX),
                "threshold[1] = -0.12 must be finite and not negative",
            ),
            (
                in_range("largest input", None, 0.0, f64::MIN_POSITIVE, f64::MAX),
                "largest input = 0 must be finite and positive",
            ),
            (
                in_range("slew_per_s", None, f64::INFINITY, 2.5, f64::MAX),
                "slew_per_s = inf must be finite and at least 2.5",
            ),
            (
                in_range("alpha_s", None, 1.1, 0.0, 1.0),
                "alpha_s = 1.1 must lie in 0 to 1",
            ),
        ] {
            assert_eq!(refused.unwrap_err().to_string(), message);
        }
        let unsorted = ParamError::NotIncreasing {
            name: "threshold",
            index: 2,
            value: f64::from(0.12_f32),
            previous: f64::from(0.15_f32),
        };
        assert_eq!(
            unsorted.to_string(),
            "threshold[2] = 0.12 must exceed threshold[1] = 0.15; sort the values"
        );
    }
}
