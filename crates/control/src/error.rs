//! What can go wrong when a controller is designed, read or run.

use crate::process::ProcessError;
use hysteron_core::error::ParamError;
use hysteron_excitation::ParameterError;
use hysteron_identify::IdentifyError;

/// An error of a controller's design, its file or its run.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// A command that cannot be played.
    #[error(transparent)]
    Excitation(#[from] ParameterError),
    /// A model that cannot be fitted or run.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A control law that the core refuses.
    #[error("the control law cannot be built: {0}")]
    Control(#[from] ParamError),
    /// A stage in a process that cannot be run.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A chain that cannot be undone.
    #[error("no controller: {what}; {advice}")]
    Design {
        /// What stands in the way.
        what: String,
        /// What to do.
        advice: &'static str,
    },
    /// A controller file that cannot be read or written.
    #[error("{file}: {reason}")]
    ControllerFile {
        /// The file.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// A plan of a campaign that cannot be read.
    #[error("{file}: {reason}")]
    Plan {
        /// The file.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// A wish for a design that makes no sense, in words.
    #[error("{0}")]
    Wish(String),
    /// Records that cannot be used.
    #[error("{} of {asked} records cannot be used:\n{}", wrong.len(), wrong.join("\n"))]
    Unusable {
        /// A sentence for each.
        wrong: Vec<String>,
        /// How many commands were played.
        asked: usize,
    },
    /// What came back of a plan and cannot be used yet.
    #[error("the recordings cannot be used yet:\n{}", wrong.join("\n"))]
    Recordings {
        /// A sentence for each reason.
        wrong: Vec<String>,
    },
    /// A reference that is not finite.
    #[error("reference_um[{index}] = {value} is not finite; give micrometres")]
    Reference {
        /// The sample.
        index: usize,
        /// What was given.
        value: f64,
    },
}
