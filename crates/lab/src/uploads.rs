//! Files that were brought: kept as they came, read with options that can be corrected.

use crate::error::Refusal;
use hysteron_data::import::{ColumnChoice, Gaps, ImportOptions, Jitter, Missing, import};
use hysteron_data::{Dataset, Record, Role};
use serde::{Deserialize, Serialize};
use std::io::{Read, Seek};
use std::path::{Component, Path, PathBuf};
use tempfile::{NamedTempFile, TempPath};

/// Largest file taken, bytes: some twenty million samples as text.
pub(crate) const FILE_LIMIT: u64 = 512 << 20;

/// Most files in one session.
const FILES: usize = 500;

/// How the files are read; one for all, as on the command line.
#[derive(Debug, Clone, Serialize, Deserialize, Default, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Reading {
    /// `voltage=CH1:mV*20`, as `--column`.
    pub(crate) columns: Vec<String>,
    /// As `--rate`.
    pub(crate) rate_hz: Option<f64>,
    /// As `--missing`, `--gaps`, `--jitter`; `refuse` if empty.
    pub(crate) missing: String,
    pub(crate) gaps: String,
    pub(crate) jitter: String,
    /// Files that models are judged on.
    pub(crate) validate: Vec<String>,
}

/// A file, read or refused.
pub(crate) struct Upload {
    pub(crate) name: String,
    pub(crate) bytes: u64,
    pub(crate) read: Result<(Vec<Record>, String), String>,
    /// What the page shows of its records.
    pub(crate) shown: Vec<serde_json::Value>,
}

/// The files of a session.
pub(crate) struct Uploads {
    pub(crate) folder: PathBuf,
    pub(crate) files: Vec<Upload>,
}

impl Uploads {
    /// The files of a folder that is there, read as they were before.
    pub(crate) fn open(folder: &Path, reading: &Reading) -> Self {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries
            .filter(|entry| entry.path().is_file())
            .filter_map(|entry| entry.file_name().into_string().ok())
            .filter(|name| {
                let brought = safe_name(name).is_ok();
                if !brought {
                    // What a transfer that broke off left; where it cannot be removed it stays unseen.
                    let _ = std::fs::remove_file(folder.join(name));
                }
                brought
            })
            .collect();
        names.sort();
        Self {
            folder: folder.to_owned(),
            files: names.iter().map(|name| read_one(folder, name, reading)).collect(),
        }
    }

    /// Puts files that were read anew in place of those of the same name; one that was taken away meanwhile stays away.
    pub(crate) fn renew(&mut self, new: Vec<Upload>) {
        for upload in new {
            if let Some(file) = self.files.iter_mut().find(|file| file.name == upload.name) {
                *file = upload;
            }
        }
    }

    /// Takes files into the list in place of those of the same name.
    pub(crate) fn take(&mut self, new: Vec<Upload>) {
        for upload in new {
            self.files.retain(|file| file.name != upload.name);
            self.files.push(upload);
        }
        self.files.sort_by(|a, b| a.name.cmp(&b.name));
    }

    /// Puts files that are whole into the folder, in place of those of the same name.
    pub(crate) fn put(&self, whole: Vec<(String, TempPath)>) -> Result<(), Refusal> {
        let new = whole
            .iter()
            .filter(|(name, _)| self.files.iter().all(|file| file.name != *name));
        if self.files.len() + new.count() > FILES {
            return Err(Refusal::unusable(format!(
                "more than {FILES} files; take some away first"
            )));
        }
        for (name, file) in whole {
            let path = self.folder.join(name);
            file.persist(&path)
                .map_err(|error| Refusal::disk(&path, &error.error))?;
        }
        Ok(())
    }

    /// Whether the files are a dataset of ours.
    pub(crate) fn is_dataset(&self) -> bool {
        self.files.iter().any(|file| file.name == "dataset.toml")
    }
}

impl Reading {
    /// The options of the importer.
    pub(crate) fn options(&self, role: Role) -> Result<ImportOptions, Refusal> {
        let columns = self.columns.iter().filter(|text| !text.trim().is_empty());
        let unknown =
            |what: &str, value: &str, known: &str| Refusal::bad(format!("{what} `{value}`: known are {known}"));
        Ok(ImportOptions {
            role,
            columns: columns
                .map(|text| text.parse::<ColumnChoice>().map_err(Refusal::unusable))
                .collect::<Result<_, _>>()?,
            rate_hz: self.rate_hz,
            missing: match self.missing.as_str() {
                "" | "refuse" => Missing::Refuse,
                "trim" => Missing::Trim,
                "interpolate" => Missing::Interpolate,
                other => return Err(unknown("missing", other, "refuse, trim, interpolate")),
            },
            gaps: match self.gaps.as_str() {
                "" | "refuse" => Gaps::Refuse,
                "split" => Gaps::Split,
                other => return Err(unknown("gaps", other, "refuse, split")),
            },
            jitter: match self.jitter.as_str() {
                "" | "refuse" => Jitter::Refuse,
                "clock" => Jitter::Clock,
                "interpolate" => Jitter::Interpolate,
                other => return Err(unknown("jitter", other, "refuse, clock, interpolate")),
            },
            ..ImportOptions::default()
        })
    }

    fn role(&self, name: &str) -> Role {
        if self.validate.iter().any(|file| file == name) {
            Role::Validate
        } else {
            Role::Identify
        }
    }

    /// The import as it is typed in the session's folder.
    pub(crate) fn command(&self, files: &[String]) -> String {
        let mut command = "hysteron import".to_owned();
        for file in files.iter().filter(|file| self.role(file) == Role::Identify) {
            command.push_str(&format!(" {}", quoted(&format!("uploads/{file}"))));
        }
        for file in files.iter().filter(|file| self.role(file) == Role::Validate) {
            command.push_str(&format!(" --validate {}", quoted(&format!("uploads/{file}"))));
        }
        for column in self.columns.iter().filter(|text| !text.trim().is_empty()) {
            command.push_str(&format!(" --column {}", quoted(column)));
        }
        if let Some(rate) = self.rate_hz {
            command.push_str(&format!(" --rate {rate}"));
        }
        for (option, value) in [
            ("missing", &self.missing),
            ("gaps", &self.gaps),
            ("jitter", &self.jitter),
        ] {
            if !value.is_empty() && value != "refuse" {
                command.push_str(&format!(" --{option} {value}"));
            }
        }
        command + " -o data"
    }
}

/// A word as a shell reads it.
pub(crate) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-=:+,".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// Reads a file that was brought.
fn read(folder: &Path, name: &str, reading: &Reading) -> Upload {
    let path = folder.join(name);
    let bytes = std::fs::metadata(&path).map_or(0, |data| data.len());
    let read = reading
        .options(reading.role(name))
        .map_err(|refusal| refusal.message)
        .and_then(|options| {
            // The importer is built never to panic; should it, the file is at fault and the server goes on.
            let read =
                std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| import(&path, &options, &mut |_, _| ())));
            match read {
                Err(_) => Err(format!(
                    "{name}: the reader failed on this file; please report it with the file"
                )),
                Ok(Err(error)) => Err(error.to_string().replace(&format!("{}/", folder.display()), "")),
                Ok(Ok(imported)) => {
                    let mut preview = imported
                        .preview
                        .to_string()
                        .replace(&format!("{}/", folder.display()), "");
                    let dataset = dataset_of(imported.records);
                    for finding in hysteron_acquisition::mistakes(&dataset) {
                        preview.push_str(&format!("  warning: {finding}\n"));
                    }
                    Ok((dataset.records, preview))
                }
            }
        });
    let shown = read.iter().flat_map(|read| &read.0).map(crate::state::record).collect();
    Upload {
        name: name.to_owned(),
        bytes,
        read,
        shown,
    }
}

/// Reads a file; a manifest is no recording, it is kept and read with its records.
pub(crate) fn read_one(folder: &Path, name: &str, reading: &Reading) -> Upload {
    if name == "dataset.toml" {
        let bytes = std::fs::metadata(folder.join(name)).map_or(0, |data| data.len());
        return Upload {
            name: name.to_owned(),
            bytes,
            shown: Vec::new(),
            read: Ok((
                Vec::new(),
                "a dataset of hysteron: roles and units are taken from it".to_owned(),
            )),
        };
    }
    read(folder, name, reading)
}

/// Reads the files of a dataset of ours.
pub(crate) fn read_native(folder: &Path) -> Result<Dataset, Refusal> {
    hysteron_data::read_dataset(folder)
        .map_err(|error| Refusal::unusable(error.to_string().replace(&format!("{}/", folder.display()), "")))
}

/// The records of files as one dataset; files of one name are told apart.
pub(crate) fn imported(mut records: Vec<Record>) -> Dataset {
    name_apart(&mut records);
    dataset_of(records)
}

fn dataset_of(records: Vec<Record>) -> Dataset {
    Dataset {
        name: "data".to_owned(),
        description: "imported".to_owned(),
        records,
        ..Dataset::default()
    }
}

/// Files of one name get numbers: `run.csv`, `run-2.csv`; as `hysteron import` does.
fn name_apart(records: &mut [Record]) {
    let mut taken = std::collections::HashSet::new();
    for record in records {
        let stem = record.file.trim_end_matches(".csv").to_owned();
        let mut number = 1;
        while !taken.insert(record.file.clone()) {
            number += 1;
            record.file = format!("{stem}-{number}.csv");
        }
    }
}

/// The name under which a file is kept: one component, nothing hidden, nothing that a folder or a shell takes amiss. The
/// folders in which it came are part of the name, so that `a/run.csv` and `b/run.csv` are two.
pub(crate) fn safe_name(given: &str) -> Result<String, Refusal> {
    let refuse = || {
        Refusal::bad(format!(
            "`{}` is no name of a recording",
            given.chars().take(80).collect::<String>()
        ))
    };
    let unfit = |c: char| c.is_control() || "\\:*?\"<>|".contains(c);
    let mut parts = Vec::new();
    for part in Path::new(given).components() {
        match part {
            Component::Normal(name) => parts.push(name.to_str().ok_or_else(refuse)?),
            _ => return Err(refuse()),
        }
    }
    let name = parts.join("-");
    if parts.is_empty() || parts.iter().any(|part| part.starts_with('.')) || name.len() > 200 || name.contains(unfit) {
        return Err(refuse());
    }
    Ok(name)
}

/// The folder that all paths are in, with its last slash: it says nothing about which is which.
fn common_folder(paths: &[String]) -> usize {
    let Some(first) = paths.first() else { return 0 };
    let mut common = first.rfind('/').map_or(0, |at| at + 1);
    while !paths.iter().all(|path| path.starts_with(&first[..common])) {
        common = first[..common - 1].rfind('/').map_or(0, |at| at + 1);
    }
    common
}

/// Unpacks the recordings of a zip archive beside the files of a folder; other files in it stay in it.
pub(crate) fn unzip(archive: impl Read + Seek, beside: &Path) -> Result<Vec<(String, TempPath)>, Refusal> {
    let mut archive =
        zip::ZipArchive::new(archive).map_err(|error| Refusal::unusable(format!("zip archive: {error}")))?;
    if archive.len() > 10 * FILES {
        return Err(Refusal::unusable(format!(
            "zip archive of {} entries; at most {} are looked at",
            archive.len(),
            10 * FILES
        )));
    }
    let broken = |error: &dyn std::fmt::Display| Refusal::unusable(format!("zip archive: {error}"));
    let mut wanted = Vec::new();
    let mut paths = Vec::new();
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(|error| broken(&error))?;
        let given = entry.name().map_err(|error| broken(&error))?.into_owned();
        if !entry.is_dir() && is_recording(&given) {
            safe_name(&given)?;
            wanted.push(index);
            paths.push(given);
        }
    }
    if wanted.is_empty() {
        return Err(Refusal::unusable(
            "the zip archive holds no recording (.csv, .tsv, .txt, .dat, .asc, .mat, dataset.toml)",
        ));
    }
    let common = common_folder(&paths);
    let mut whole = Vec::new();
    let mut left = FILE_LIMIT;
    for (index, given) in wanted.into_iter().zip(&paths) {
        let mut entry = archive.by_index(index).map_err(|error| broken(&error))?;
        let name = safe_name(&given[common..])?;
        let mut file = NamedTempFile::new_in(beside).map_err(|error| Refusal::disk(beside, &error))?;
        let written = std::io::copy(&mut (&mut entry).take(left + 1), &mut file)
            .map_err(|error| Refusal::unusable(format!("zip archive, {name}: {error}")))?;
        if written > left {
            return Err(Refusal::new(
                axum::http::StatusCode::PAYLOAD_TOO_LARGE,
                format!("the zip archive unpacks to more than {} MB", FILE_LIMIT >> 20),
            ));
        }
        left -= written;
        if whole.iter().any(|(other, _)| *other == name) {
            return Err(Refusal::unusable(format!(
                "zip archive: two of its recordings come to the name {name}"
            )));
        }
        whole.push((name, file.into_temp_path()));
    }
    Ok(whole)
}

/// Whether a file of a folder or an archive is looked at.
fn is_recording(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    let file = lower.rsplit('/').next().unwrap_or("");
    !file.starts_with('.')
        && (file == "dataset.toml"
            || [".csv", ".tsv", ".txt", ".dat", ".mat", ".asc"]
                .iter()
                .any(|end| file.ends_with(end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_names_of_one_folder_and_of_several() {
        let common = |paths: &[&str]| common_folder(&paths.iter().map(|&path| path.to_owned()).collect::<Vec<_>>());
        assert_eq!(common(&["a.csv", "b.csv"]), 0);
        assert_eq!(common(&["stage/a.csv", "stage/dataset.toml"]), 6);
        assert_eq!(common(&["stage/up/a.csv", "stage/upper/a.csv"]), 6);
        assert_eq!(common(&["x/y/a.csv", "z/a.csv"]), 0);
        assert_eq!(common(&["x/y/a.csv"]), 4);
        assert_eq!(common(&[]), 0);
        assert_eq!(safe_name("up/run.csv").unwrap(), "up-run.csv");
        assert_eq!(safe_name("run.csv").unwrap(), "run.csv");
    }

    #[test]
    fn refuse_names_that_leave_the_folder() {
        for name in [
            "", "..", "../a.csv", "/a.csv", ".a.csv", "a/.b.csv", "a\\b.csv", "a\0.csv", "a:b.csv",
        ] {
            assert!(safe_name(name).is_err(), "{name:?}");
        }
    }
}
