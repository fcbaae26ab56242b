//! Reads and writes a dataset folder.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::atomic::Pending;
use super::manifest::{self, Manifest};
use super::read;
use super::write::{self, Overwrite};
use crate::error::DataError;
use crate::record::{Dataset, Known};

/// Reads a dataset: a folder with `dataset.toml`, or one native CSV, which is a dataset of one record with role
/// `identify`.
///
/// # Errors
/// [`DataError`] with file, line and column; see [`read_record`](super::read_record) and [`parse_manifest`](super::parse_manifest).
///
/// # Example
/// ```
/// let folder = tempfile::tempdir()?;
/// std::fs::write(folder.path().join("up.csv"), "time_s,voltage_v,position_um\n0,0,0\n0.1,1,0.3\n")?;
/// std::fs::write(
///     folder.path().join("dataset.toml"),
///     "format = 1\nname = \"x\"\n[[record]]\nfile = \"up.csv\"\nrole = \"validate\"\n",
/// )?;
/// let dataset = hysteron_data::read_dataset(folder.path())?;
/// assert_eq!(dataset.records[0].period_s, 0.1);
/// assert_eq!(dataset.with_role(hysteron_data::Role::Validate).count(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_dataset(path: &Path) -> Result<Dataset, DataError> {
    read_dataset_with_progress(path, &mut |_, _| {})
}

/// Reads a dataset and says how far it is: `progress(bytes read, bytes in all)`, every few thousand samples.
///
/// # Errors
/// As [`read_dataset`].
pub fn read_dataset_with_progress(path: &Path, progress: &mut dyn FnMut(u64, u64)) -> Result<Dataset, DataError> {
    let shown = path.display().to_string();
    let kind = fs::metadata(path).map_err(DataError::io(&shown, "open it"))?;
    if !kind.is_dir() {
        return one_csv(path, &shown, kind.len(), progress);
    }
    let manifest = Manifest::read(path)?;
    let paths: Vec<PathBuf> = manifest.records.iter().map(|entry| path.join(&entry.file)).collect();
    let total: u64 = paths
        .iter()
        .map(|path| fs::metadata(path).map_or(0, |found| found.len()))
        .sum();
    let mut dataset = Dataset {
        name: manifest.name,
        description: manifest.description,
        known: manifest.known,
        records: Vec::with_capacity(paths.len()),
        notices: Vec::new(),
    };
    let mut done = 0;
    for (entry, path) in manifest.records.into_iter().zip(&paths) {
        let mut here = 0;
        let (mut record, notices) = read::read_file(path, &path.display().to_string(), &mut |bytes| {
            here = bytes;
            progress(done + bytes, total);
        })?;
        done += here;
        dataset.notices.extend(notices.into_iter().map(|mut notice| {
            notice.file.clone_from(&entry.file);
            notice
        }));
        record.file = entry.file;
        record.role = entry.role;
        record.excitation = entry.excitation;
        dataset.records.push(record);
    }
    Ok(dataset)
}

fn one_csv(path: &Path, shown: &str, total: u64, progress: &mut dyn FnMut(u64, u64)) -> Result<Dataset, DataError> {
    let (mut record, mut notices) = read::read_file(path, shown, &mut |bytes| progress(bytes, total))?;
    record.file = path
        .file_name()
        .map_or_else(|| shown.to_owned(), |name| name.to_string_lossy().into_owned());
    notices
        .iter_mut()
        .for_each(|notice| notice.file.clone_from(&record.file));
    let name = path
        .file_stem()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    Ok(Dataset {
        name,
        description: String::new(),
        known: Known::default(),
        records: vec![record],
        notices,
    })
}

/// Writes a dataset as a folder; every file is there whole or not at all, `dataset.toml` comes last.
///
/// What it replaces: `dataset.toml` and the CSVs of the same names, and only when told so. Other files stay.
/// The notices are not written: they are about the files that were read.
///
/// # Errors
/// [`DataError::Exists`] when any of the files is there already; [`DataError::Unwritable`] for a record that could not
/// be read back, or two records of one name; [`DataError::Io`].
pub fn write_dataset(dataset: &Dataset, folder: &Path, overwrite: Overwrite) -> Result<(), DataError> {
    let shown = folder.display().to_string();
    validate(dataset, &shown)?;
    let manifest_path = folder.join(manifest::FILE);
    let paths: Vec<PathBuf> = dataset.records.iter().map(|record| folder.join(&record.file)).collect();
    if overwrite == Overwrite::Refuse
        && let Some(there) = std::iter::once(&manifest_path).chain(&paths).find(|path| path.exists())
    {
        return Err(DataError::Exists {
            file: there.display().to_string(),
        });
    }
    let text = Manifest::of(dataset).render(&manifest_path)?;
    let mut pending = Vec::with_capacity(paths.len() + 1);
    for (record, path) in dataset.records.iter().zip(&paths) {
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(DataError::io(&shown, "create the folder"))?;
        }
        pending.push(Pending::write(path, |out| write::write_rows(record, out))?);
    }
    pending.push(Pending::write(&manifest_path, |out| out.write_all(text.as_bytes()))?);
    pending.into_iter().try_for_each(Pending::commit)
}

fn validate(dataset: &Dataset, shown: &str) -> Result<(), DataError> {
    let refuse = |found, allowed| {
        Err(DataError::Unwritable {
            file: shown.to_owned(),
            found,
            allowed,
        })
    };
    if dataset.records.is_empty() {
        return refuse("the dataset has no record".into(), "a dataset needs at least one");
    }
    for (index, record) in dataset.records.iter().enumerate() {
        if let Some(found) = manifest::unfit_name(&record.file) {
            return refuse(found, manifest::NAMES);
        }
        // compared without case: on Windows and macOS one would overwrite the other
        let same = |other: &crate::record::Record| other.file.to_lowercase() == record.file.to_lowercase();
        if dataset.records[..index].iter().any(same) {
            return refuse(
                format!("two records are named {:?}", record.file),
                "every record has a file of its own",
            );
        }
        write::validate_record(record)?;
    }
    manifest::check_known(&dataset.known, shown)
}
