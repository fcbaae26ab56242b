//! The recordings of a zip archive.

use crate::error::Refusal;
use crate::uploads::{FILE_LIMIT, FILES, safe_name};
use std::io::{Read, Seek};
use std::path::Path;
use tempfile::{NamedTempFile, TempPath};

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
    }
}
