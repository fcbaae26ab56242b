//! What can be wrong with a stage, and the checks that say so.

pub use hysteron_excitation::ParameterError as StageError;
pub(crate) use hysteron_excitation::error::{ordered, within};

/// Refuses a column that contains anything but finite numbers, naming the first culprit.
pub(crate) fn all_finite(name: &str, values: &[f64], limit: f64, advice: &'static str) -> Result<(), StageError> {
    match values.iter().position(|v| !v.is_finite() || v.abs() > limit) {
        None => Ok(()),
        Some(at) => within(&format!("{name}[{at}]"), values[at], -limit, limit, advice),
    }
}
