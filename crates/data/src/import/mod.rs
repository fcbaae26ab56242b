//! Import of what users have: tables of text in any dialect, spreadsheets, and the binary files of MATLAB, LabVIEW, Python
//! and their like.
//!
//! [`kinds`] tells by its first bytes what a file is, [`open`] reads its layout, [`columns`] chooses what is read, and
//! [`finish`] puts it on a clock. A kind that holds named arrays ([`arrays`]) needs no more than a reader of them.
//!
//! Whatever the file does not say and is not told by [`ImportOptions`] is refused, never guessed: a unit that is not
//! given, a comma that may be a decimal sign or a separator, a gap in time. What was found out is in the [`Preview`].

mod arrays;
mod cells;
mod clean;
mod columns;
mod decode;
mod dialect;
mod doubts;
mod feather;
mod finish;
mod gcs;
mod hdf5;
mod join;
mod json;
mod kinds;
mod literal;
mod lvm;
mod mat4;
mod mat5;
mod npy;
mod numbers;
mod open;
mod options;
mod parquet;
mod preview;
mod scopes;
mod sheet;
mod spelling;
mod stamps;
mod table;
mod tdms;
mod zipped;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::DataError;
use crate::record::{Notice, Record};

pub use decode::Encoding;
pub use join::import_joined;
pub(crate) use npy::MAGIC as NPY_MAGIC;
pub use options::{ColumnChoice, Decimal, Gaps, ImportOptions, Jitter, Missing, Separator, Source};
pub use preview::{Kind, Preview, ReadColumn};

/// What an import gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The records: one, or one for each part between gaps.
    pub records: Vec<Record>,
    /// What was found out about the file.
    pub preview: Preview,
}

impl Imported {
    /// The preview's notices as those of a dataset.
    pub fn notices(&self) -> impl Iterator<Item = Notice> {
        let file = &self.preview.file;
        self.preview.notices.iter().map(|text| Notice {
            file: file.clone(),
            text: text.clone(),
        })
    }
}

/// Tells records of one name apart, from each other and from those that are there: `run.csv`, `run-2.csv`. Names that differ in case
/// alone are one: on Windows and macOS one file would overwrite the other.
pub fn name_apart<'a>(records: &mut [Record], there: impl IntoIterator<Item = &'a str>) {
    let mut taken: std::collections::HashSet<String> = there.into_iter().map(str::to_lowercase).collect();
    for record in records {
        let stem = record.file.trim_end_matches(".csv").to_owned();
        let mut number = 1;
        while !taken.insert(record.file.to_lowercase()) {
            number += 1;
            record.file = format!("{stem}-{number}.csv");
        }
    }
}

/// Imports a recording of another program; `progress` gets the bytes read so far and in all.
///
/// # Errors
/// [`DataError`] with file, line and column, and what to do: no table found, columns or units that are not clear,
/// cells that are no numbers, time that is not uniform, kinds of file that cannot be read.
///
/// # Cost
/// One pass over a text file, memory for the columns that are read; of a binary file the whole, and all of its numbers.
///
/// # Example
/// ```
/// use hysteron_data::import::{ImportOptions, import};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("scope.csv");
/// std::fs::write(&path, "Rig 3\nZeit [ms];Spannung [V];Weg [nm]\n0,0;1,5;250\n0,2;2,5;500\n")?;
/// let found = import(&path, &ImportOptions::default(), &mut |_, _| {})?;
/// assert_eq!(found.records[0].period_s, 0.0002);
/// assert_eq!(found.records[0].voltage_v, [1.5, 2.5]);
/// assert_eq!(found.records[0].position_um, [0.25, 0.5]);
///
/// std::fs::write(&path, "t,u,y [nm]\n0,1.5,250\n0.2,2.5,500\n")?;
/// let error = import(&path, &ImportOptions::default(), &mut |_, _| {}).unwrap_err().to_string();
/// assert!(error.ends_with("line 1, column 2 (u): no unit given for voltage; known are V, mV, µV, kV; say which it is, \
///     as in `--column voltage=2:V` (with a gain: `V*20`)"), "{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn import(path: &Path, options: &ImportOptions, progress: &mut dyn FnMut(u64, u64)) -> Result<Imported, DataError> {
    let file = path.display().to_string();
    let source = opened(path, &file)?;
    let total = source.metadata().map_err(DataError::io(&file, "open it"))?.len();
    import_from(source, &file, options, &mut |bytes| progress(bytes, total))
}

/// Opens a recording; a folder is said to be one.
fn opened(path: &Path, file: &str) -> Result<File, DataError> {
    let source = File::open(path).map_err(DataError::io(file, "open it"))?;
    if source.metadata().is_ok_and(|data| data.is_dir()) {
        return Err(folder(path, file));
    }
    Ok(source)
}

fn folder(path: &Path, file: &str) -> DataError {
    let (found, what_to_do) = if path.join("dataset.toml").is_file() {
        (
            "this is a dataset already",
            "it needs no import: give it to `hysteron fit` or `hysteron learn` as it is",
        )
    } else {
        (
            "this is a folder",
            "give the recordings in it, as in `hysteron import FOLDER/*.csv -o stage`",
        )
    };
    DataError::Format {
        file: file.to_owned(),
        found: found.into(),
        what_to_do: what_to_do.into(),
    }
}

/// Imports a recording from any source; `file` is its name in messages, and its stem that of the records.
///
/// # Errors
/// As [`import`].
pub fn import_from(
    source: impl Read,
    file: &str,
    options: &ImportOptions,
    progress: &mut dyn FnMut(u64),
) -> Result<Imported, DataError> {
    options.validate()?;
    let opened = open::open(Box::new(source), file, options, progress)?;
    let (chosen, more) = columns::choose(&opened.offer(options), options)?;
    let mut notices = opened.notices();
    notices.extend(more);
    let kind = opened.kind();
    let parts = opened.read(chosen, options, &mut notices, progress)?;
    finish::finish(parts, kind, file, options, notices)
}
