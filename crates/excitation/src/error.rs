//! What can be wrong with a parameter, and the checks that say so.

/// A parameter, or parameters together, that cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// A number outside of what is physical or supported.
    #[error("{name} = {value} must lie between {min} and {max}; {advice}")]
    OutOfRange {
        /// The parameter, with its place in the configuration and its unit.
        name: String,
        /// What was given.
        value: f64,
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
        /// What to do.
        advice: &'static str,
    },
    /// A list with the wrong number of values.
    #[error("{name} has {found} values where {wanted} are needed; {advice}")]
    Length {
        /// The list.
        name: String,
        /// How many values were given.
        found: usize,
        /// How many are needed, in words.
        wanted: String,
        /// What to do.
        advice: &'static str,
    },
    /// Parameters that are fine alone but not together.
    #[error("{what}; {advice}")]
    Conflict {
        /// What does not go together, with the values.
        what: String,
        /// What to do.
        advice: &'static str,
    },
}

/// Refuses a value that is not finite or lies outside `min..=max`.
///
/// # Errors
/// Such a value.
pub fn within(name: &str, value: f64, min: f64, max: f64, advice: &'static str) -> Result<(), ParameterError> {
    if value >= min && value <= max && value.is_finite() {
        Ok(())
    } else {
        Err(ParameterError::OutOfRange {
            name: name.to_owned(),
            value,
            min,
            max,
            advice,
        })
    }
}

/// Refuses a pair that is not in increasing order.
///
/// # Errors
/// Such a pair.
pub fn ordered(low_name: &str, low: f64, high_name: &str, high: f64) -> Result<(), ParameterError> {
    if low < high {
        Ok(())
    } else {
        Err(ParameterError::Conflict {
            what: format!("{low_name} = {low} must lie below {high_name} = {high}"),
            advice: "exchange or correct the two",
        })
    }
}
