//! What can go wrong in a trial.

use hysteron_board::{BoardError, Fault};
use hysteron_control::ControlError;
use hysteron_control::message::{Message, Naming, Setting};
use hysteron_identify::IdentifyError;
use hysteron_plant::StageError;
use hysteron_table::TableError;
use hysteron_tracking::TrackingError;
use std::path::PathBuf;

/// An error of a trial.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The image, the emulator or the board.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// A controller that cannot be designed or run.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// A model that cannot be fitted or run.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// The simulated stage.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// A run on the simulated stage that cannot be made.
    #[error(transparent)]
    Tracking(#[from] TrackingError),
    /// A controller that makes no table.
    #[error("the controller makes no table: {0}")]
    Table(#[from] TableError),
    /// Tables and images that cannot be written.
    #[error("{}: {source}; choose another folder, or make it writable", path.display())]
    Write {
        /// Where.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A passing folder that cannot be made.
    #[error("no folder for tables and images: {0}")]
    Passing(#[source] std::io::Error),
    /// A reference that stands still.
    #[error("{name}: the reference did not move")]
    Still {
        /// Its name.
        name: String,
    },
    /// A run of which too little came to judge it.
    #[error(
        "{name}: of the {wanted} ticks that are judged {came} came; a faster probe, or a shorter polling interval, loses fewer"
    )]
    TooFew {
        /// The reference.
        name: String,
        /// Ticks that are judged.
        wanted: u64,
        /// Ticks that came.
        came: u64,
    },
    /// A record with gaps.
    #[error(
        "{name}: played {times} times, and never came whole ({lost} ticks lost the last time); a record with gaps tells nothing of time: \
         take a faster probe, or a shorter polling interval"
    )]
    Gaps {
        /// The record.
        name: String,
        /// Times that it was played.
        times: usize,
        /// Ticks that did not come the last time.
        lost: u64,
    },
    /// A record that is of no use.
    #[error("{}", useless(name, why, Setting::field))]
    Useless {
        /// The record.
        name: String,
        /// Why, and what to do.
        why: Message,
    },
    /// A real board that stopped.
    #[error("{}", stopped(name, *tick, *fault, Setting::field))]
    Stopped {
        /// The reference.
        name: String,
        /// When.
        tick: u64,
        /// Why.
        fault: Fault,
    },
    /// An image that stopped because stage and model are not one.
    #[error(
        "the board stopped at tick {tick} with fault Disagreement: the position is further from where the model has it than the model's \
         own error explains, so stage and model are not one; record this stage and design from that"
    )]
    Disagreement {
        /// When.
        tick: u32,
    },
    /// An image that stopped.
    #[error(
        "the board stopped at tick {tick} with fault {fault:?}; the stage is not one that this controller can run on"
    )]
    NotThisStage {
        /// When.
        tick: u32,
        /// Why.
        fault: Fault,
    },
}

impl TrialError {
    /// What it says, with settings in a front end's names.
    pub fn worded(&self, name: Naming) -> String {
        match self {
            Self::Control(error) => error.worded(name),
            Self::Tracking(error) => error.worded(name),
            Self::Useless { name: record, why } => useless(record, why, name),
            Self::Stopped {
                name: reference,
                tick,
                fault,
            } => stopped(reference, *tick, *fault, name),
            _ => self.to_string(),
        }
    }
}

fn useless(record: &str, why: &Message, name: Naming) -> String {
    format!("{record}: {}", why.worded(name))
}

fn stopped(reference: &str, tick: u64, fault: Fault, name: Naming) -> String {
    format!(
        "{reference}: the board stopped at tick {tick} with fault {fault:?}; clear it at the board, and make {} narrower",
        name(Setting::Range)
    )
}
