//! What can go wrong when records are read, imported or written.

use crate::place::Place;

/// An error of reading, importing or writing. The message says where, what was found, what is allowed and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// The system refuses.
    #[error("{file}: cannot {action}: {source}")]
    Io {
        /// The file or folder.
        file: String,
        /// What was tried: `open it`.
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// A folder without `dataset.toml`.
    #[error(
        "{folder}: the folder has no dataset.toml; give a dataset folder or one CSV, \
         or make a dataset of recordings with `hysteron import`"
    )]
    NoManifest {
        /// The folder.
        folder: String,
    },
    /// `dataset.toml` does not say what it must.
    #[error("{at}: {found}; {allowed}")]
    Manifest {
        /// Where.
        at: Place,
        /// What is wrong.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The file is of another kind than can be read.
    #[error("{file}: {found}; {what_to_do}")]
    Format {
        /// The file.
        file: String,
        /// What it is.
        found: String,
        /// What to do.
        what_to_do: String,
    },
    /// A line without end.
    #[error("{at}: the line is longer than {most} bytes; a record has one line per sample")]
    LineTooLong {
        /// The line.
        at: Place,
        /// The most that is read.
        most: usize,
    },
    /// No line of column names where one must be.
    #[error("{at}: {found}; {allowed}")]
    NoHeader {
        /// Where it was looked for.
        at: Place,
        /// What is there.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// A required column is missing.
    #[error("{at}: no {quantity} among {found}; {allowed}")]
    MissingColumn {
        /// The header line.
        at: Place,
        /// `time`, `voltage` or `position`.
        quantity: String,
        /// The columns that are there.
        found: String,
        /// What is allowed, and what to do.
        allowed: String,
    },
    /// Several things about the columns that are not clear.
    #[error("{at}: {found}; {columns}; {what_to_do}")]
    Unclear {
        /// The header line.
        at: Place,
        /// What is not clear, one after the other.
        found: String,
        /// The columns that are there.
        columns: String,
        /// The options that settle it.
        what_to_do: String,
    },
    /// Two columns of one quantity.
    #[error("{at}: a second column of {quantity} (the first is column {first}); {what_to_do}")]
    DuplicateColumn {
        /// The second column.
        at: Place,
        /// The quantity.
        quantity: String,
        /// The first column, counted from 1.
        first: usize,
        /// What to do.
        what_to_do: String,
    },
    /// A unit that is not known, or none where one is needed.
    #[error("{at}: {found}; known are {known}")]
    Unit {
        /// The column.
        at: Place,
        /// What stands for the unit.
        found: String,
        /// The units that are known, and what to do.
        known: String,
    },
    /// A line with more or fewer cells than the header.
    #[error("{at}: {found} columns, the header has {expected}; {what_to_do}")]
    Columns {
        /// The line.
        at: Place,
        /// Its cells.
        found: usize,
        /// The header's columns.
        expected: usize,
        /// What to do.
        what_to_do: &'static str,
    },
    /// A cell that is not a finite number.
    #[error("{at}: found {found}; {allowed}")]
    Cell {
        /// The cell.
        at: Place,
        /// What was found, quoted.
        found: String,
        /// What is allowed, and what to do.
        allowed: String,
    },
    /// An empty line between samples.
    #[error("{at}: the line is empty; a record has one line per sample, so delete it or restore the sample")]
    EmptyLine {
        /// The line.
        at: Place,
    },
    /// Too few samples.
    #[error("{at}: {samples} sample(s); a record needs at least {least}")]
    TooShort {
        /// The file.
        at: Place,
        /// What it has.
        samples: usize,
        /// What is needed.
        least: usize,
    },
    /// The file can be read in more than one way.
    #[error("{at}: {found}; {what_to_do}")]
    Ambiguous {
        /// Where it is seen.
        at: Place,
        /// What is unclear.
        found: String,
        /// What to do.
        what_to_do: String,
    },
    /// A choice of the user that cannot be.
    #[error("{found}; {allowed}")]
    Choice {
        /// What was chosen.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// Time stamps that are no uniform clock.
    #[error("{at}: {found}; {what_to_do}")]
    Clock {
        /// The first stamp that does not fit.
        at: Place,
        /// What is wrong with it.
        found: String,
        /// What is allowed, and what to do.
        what_to_do: String,
    },
    /// A dataset or record in memory that cannot be written.
    #[error("{file}: {found}; {allowed}")]
    Unwritable {
        /// The record.
        file: String,
        /// What is wrong.
        found: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Something is already there.
    #[error("{file}: already exists and is not overwritten; choose another place or say that it may be overwritten")]
    Exists {
        /// What exists.
        file: String,
    },
}

impl DataError {
    /// Wraps what the system said.
    pub(crate) fn io(file: &str, action: &'static str) -> impl FnOnce(std::io::Error) -> DataError {
        let file = file.to_owned();
        move |source| DataError::Io { file, action, source }
    }
}
