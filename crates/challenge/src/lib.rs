//! Datasets with something hidden in them: drawn from a seed, the truth sealed, an answer taken, the truth shown.
//!
//! [`Setting::make`] draws the stage and its records, [`Riddle::write`] leaves them in a folder with the truth encrypted and
//! the key in a file apart; [`answer`] takes one answer, [`reveal`] shows the truth and judges it. The command line and the
//! workbench call the same functions. [`examples`] are datasets for first steps.
#![forbid(unsafe_code)]

mod case;
pub mod examples;
mod folder;
mod judge;
mod seal;
mod setting;
mod truth;

pub use case::dataset;
pub use folder::{ANSWER, REVEALED, Revealed, Riddle, SEALED, answer, is_challenge, refuse_places, reveal, stands};
pub use judge::{Answer, Judgement, Outcome, judge, names};
pub use setting::Setting;
pub use truth::{SealedEffect, SealedParameter, SealedTruth};

/// Why a challenge cannot be made, answered or shown.
#[derive(Debug, thiserror::Error)]
pub enum ChallengeError {
    /// A setting, an answer or a key that is refused, in words.
    #[error("{0}")]
    Refused(String),
    /// The stage cannot show the effect at its strength.
    #[error(transparent)]
    Plant(#[from] hysteron_plant::StageError),
    /// The dataset cannot be read or written.
    #[error(transparent)]
    Data(#[from] hysteron_data::DataError),
    /// A file of the challenge that the system refuses.
    #[error("{file}: {source}")]
    File {
        /// The file.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// A truth that is not one of this program.
    #[error("the truth cannot be read: {0}")]
    Json(#[from] serde_json::Error),
}
