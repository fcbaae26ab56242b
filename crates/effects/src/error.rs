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
        /// The same with its place, where it has one.
        at: Option<InText>,
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

/// What is wrong, at its place in a text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InText {
    /// Line, from 1.
    pub line: usize,
    /// Character of the line, from 1.
    pub column: usize,
    /// What is wrong there, and what is allowed.
    pub why: String,
}

impl InText {
    /// At a byte of a text; what is no byte of it is its end.
    pub(crate) fn at(text: &str, byte: usize, why: String) -> Self {
        let before = text.get(..byte).unwrap_or(text);
        let begin = before.rfind('\n').map_or(0, |end| end + 1);
        Self {
            line: before.matches('\n').count() + 1,
            column: before[begin..].chars().count() + 1,
            why,
        }
    }
}
