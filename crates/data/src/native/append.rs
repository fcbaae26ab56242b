//! Appends records to a dataset that is there.

use std::path::Path;

use super::atomic::Pending;
use super::manifest::{self, Entry, Manifest};
use super::write;
use crate::error::DataError;
use crate::record::Record;

/// Appends records to the dataset in a folder: their CSVs first, then `dataset.toml`, so that a program that ends in the midst
/// of it leaves the dataset as it was or as it will be.
///
/// # Errors
/// [`DataError::NoManifest`]; [`DataError::Exists`] for a record whose file is there already; [`DataError::Unwritable`];
/// [`DataError::Io`].
///
/// # Example
/// ```
/// # use hysteron_data::{Dataset, Overwrite, Record, Role, append_records, read_dataset, write_dataset};
/// let folder = tempfile::tempdir()?;
/// let record = |file: &str| Record::new(file, Role::Identify, 0.1, vec![0.0, 1.0], vec![0.0, 0.3]);
/// let dataset = Dataset { records: vec![record("up.csv")], ..Dataset::default() };
/// write_dataset(&dataset, folder.path(), Overwrite::Refuse)?;
/// append_records(folder.path(), &[record("down.csv")])?;
/// assert_eq!(read_dataset(folder.path())?.records.len(), 2);
/// assert!(append_records(folder.path(), &[record("down.csv")]).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn append_records(folder: &Path, records: &[Record]) -> Result<(), DataError> {
    let mut manifest = Manifest::read(folder)?;
    let mut pending = Vec::with_capacity(records.len());
    for record in records {
        if let Some(found) = manifest::unfit_name(&record.file) {
            return Err(DataError::Unwritable {
                file: folder.display().to_string(),
                found,
                allowed: manifest::NAMES,
            });
        }
        let path = folder.join(&record.file);
        if path.exists() || manifest.has(&record.file) {
            return Err(DataError::Exists {
                file: path.display().to_string(),
            });
        }
        write::validate_record(record)?;
        manifest.records.push(Entry::of(record));
        pending.push(Pending::write(&path, |out| write::write_rows(record, out))?);
    }
    pending.into_iter().try_for_each(Pending::commit)?;
    manifest.write(folder)
}
