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
                write!(f, " = {value} must lie in {min} to {max}")
            }
            Self::NotIncreasing {
                name,
                index,
                value,
                previous,
            } => write!(
                f,
                "{name}[{index}] = {value} must exceed {name}[{}] = {previous}; sort the values",
                index - 1
            ),
            Self::Unbounded { name, input } => write!(
                f,
                "{name} is not finite over inputs up to {input}; narrow the input range or check the coefficients' units"
            ),
        }
    }
}

impl core::error::Error for ParamError {}

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
