//! What can go wrong when a controller is designed, read or run.

use crate::message::{Message, Naming, Setting};
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
    #[error("{}", no_controller(what, advice, Setting::field))]
    Design {
        /// What stands in the way.
        what: String,
        /// What to do.
        advice: Message,
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
    #[error("{}", plan(file, reason, Setting::field))]
    Plan {
        /// The file.
        file: String,
        /// What is wrong.
        reason: Message,
    },
    /// A wish for a design that makes no sense, in words.
    #[error("{0}")]
    Wish(Message),
    /// Records that cannot be used.
    #[error("{}", unusable(wrong, *asked, Setting::field))]
    Unusable {
        /// A sentence for each.
        wrong: Vec<Message>,
        /// How many commands were played.
        asked: usize,
    },
    /// What came back of a plan and cannot be used yet.
    #[error("{}", recordings(wrong, Setting::field))]
    Recordings {
        /// A sentence for each reason.
        wrong: Vec<Message>,
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

impl ControlError {
    /// What it says, with settings in a front end's names.
    pub fn worded(&self, name: Naming) -> String {
        match self {
            Self::Design { what, advice } => no_controller(what, advice, name),
            Self::Plan { file, reason } => plan(file, reason, name),
            Self::Wish(message) => message.worded(name),
            Self::Unusable { wrong, asked } => unusable(wrong, *asked, name),
            Self::Recordings { wrong } => recordings(wrong, name),
            Self::Process(error) => error.worded(name),
            Self::Excitation(_)
            | Self::Identify(_)
            | Self::Control(_)
            | Self::ControllerFile { .. }
            | Self::Reference { .. } => self.to_string(),
        }
    }
}

fn no_controller(what: &str, advice: &Message, name: Naming) -> String {
    format!("no controller: {what}; {}", advice.worded(name))
}

fn plan(file: &str, reason: &Message, name: Naming) -> String {
    format!("{file}: {}", reason.worded(name))
}

fn unusable(wrong: &[Message], asked: usize, name: Naming) -> String {
    let count = wrong.len();
    format!("{count} of {asked} records cannot be used:\n{}", lines(wrong, name))
}

fn recordings(wrong: &[Message], name: Naming) -> String {
    format!("the recordings cannot be used yet:\n{}", lines(wrong, name))
}

fn lines(wrong: &[Message], name: Naming) -> String {
    let lines: Vec<String> = wrong.iter().map(|message| message.worded(name)).collect();
    lines.join("\n")
}
