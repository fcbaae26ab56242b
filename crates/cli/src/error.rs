//! The errors of the binary, with what to do about them.

use hysteron_data::DataError;
use hysteron_identify::IdentifyError;
use hysteron_identify::effects::{EffectError, UnknownEffect};
use hysteron_report::option;
use std::path::PathBuf;

/// Everything a command can end with but an answer.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub(crate) enum CliError {
    /// A dataset or recording that cannot be read or written.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A model that cannot be fitted, read or written.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// An effect that the catalogue does not have, or an effect file that is refused.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// A simulated stage or an excitation that is refused.
    #[error(transparent)]
    Plant(#[from] hysteron_plant::StageError),
    /// A challenge that cannot be made, answered or shown.
    #[error(transparent)]
    Challenge(#[from] hysteron_challenge::ChallengeError),
    /// A controller that cannot be designed, read or run.
    #[error(transparent)]
    Control(#[from] hysteron_control::ControlError),
    /// A tracking run that cannot be made.
    #[error(transparent)]
    Tracking(#[from] hysteron_tracking::TrackingError),
    /// A trial in the emulator or on a board that cannot be made.
    #[error(transparent)]
    Trial(#[from] hysteron_trials::TrialError),
    /// A model that makes no table.
    #[error("{}: {source}", path.display())]
    Table {
        /// The model.
        path: PathBuf,
        /// What is wrong.
        source: hysteron_table::TableError,
    },
    /// A model or a table that makes no co-simulation unit.
    #[error("{}: {source}", path.display())]
    Fmu {
        /// The model or the table.
        path: PathBuf,
        /// What is wrong.
        source: hysteron_fmu::FmuError,
    },
    /// A run of the firmware that failed.
    #[error(transparent)]
    Board(#[from] hysteron_board::BoardError),
    /// A file of ours that cannot be written.
    #[error("{}: {source}", path.display())]
    #[diagnostic(help("choose another place with -o, or make the folder writable"))]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file that cannot be read.
    #[error("{}: {source}", path.display())]
    #[diagnostic(help("give a file that is there and readable"))]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The workbench cannot be opened.
    #[error(transparent)]
    Lab(#[from] hysteron_lab::LabError),
    /// An option whose value makes no sense here.
    #[error("{0}")]
    Option(String),
    /// Standard output cannot be written.
    #[error("standard output: {0}")]
    Output(#[from] std::io::Error),
    /// An answer that cannot be turned into JSON.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
}

impl CliError {
    /// What it says, with settings by the names of their options.
    pub(crate) fn worded(&self) -> String {
        match self {
            Self::Control(error) => error.worded(option),
            Self::Tracking(error) => error.worded(option),
            Self::Trial(error) => error.worded(option),
            _ => self.to_string(),
        }
    }

    /// The option that says what a library asks for in words.
    pub(crate) fn option_to_give(&self) -> Option<String> {
        let Self::Identify(error) = self else { return None };
        match error {
            IdentifyError::NoSwarm { .. } => Some("give --method separable".to_owned()),
            IdentifyError::CorePlays { wanted, .. } => Some(format!("give --plays {wanted}")),
            _ => None,
        }
    }
}

impl From<UnknownEffect> for CliError {
    fn from(unknown: UnknownEffect) -> Self {
        Self::Effect(unknown.into())
    }
}
