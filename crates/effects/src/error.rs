//! What can go wrong with effects.

use crate::id::UnknownEffect;

/// An error about effects.
#[derive(Debug, thiserror::Error)]
pub enum EffectError {
    /// A name that the catalogue does not have.
    #[error(transparent)]
    Unknown(#[from] UnknownEffect),
    /// An effect file that is refused.
    #[error("{file}: {reason}")]
    File {
        /// The file.
        file: String,
        /// What is wrong, with line or field, and what is allowed.
        reason: String,
    },
    /// An effect file that cannot be opened.
    #[error("{file}: {source}")]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
}
