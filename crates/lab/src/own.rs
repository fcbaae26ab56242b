//! Data of the user's own: copied to begin with, because a session's data never change; what came to them later is brought.

use crate::book::{Generation, Stands};
use crate::error::{LabError, Refusal};
use crate::folder;
use crate::grow::stay;
use crate::reading::{MANIFEST, quoted};
use crate::session::Session;
use crate::uploads::{self, same_bytes};
use hysteron_data::{Dataset, Manifest, Role};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Begins with the data given at the start, or brings what came to them since the session began with them.
pub(crate) fn begin_with(session: &mut Session, data: &Path) -> Result<(), LabError> {
    let whole = std::path::absolute(data)?;
    let from = whole.display().to_string();
    let folder = session.folder.display().to_string();
    let failed = |reason: String| LabError::Session { folder, reason };
    if session
        .book
        .generations
        .first()
        .is_some_and(|first| first.from.as_ref() == Some(&from))
    {
        let listed = listed(&whole)?;
        return bring_new(session, &listed).map_err(|refusal| failed(refusal.message));
    }
    if !session.book.steps.is_empty() {
        return Err(failed(
            "it has models of other data; give another folder with --session, or leave DATA out to go on".to_owned(),
        ));
    }
    let dataset = hysteron_data::read_dataset(&whole)?;
    begin(session, &whole, &dataset).map_err(|refusal| failed(refusal.message))
}

fn begin(session: &mut Session, from: &Path, dataset: &Dataset) -> Result<(), Refusal> {
    let data = folder::fresh(&session.folder)?.join("data");
    stay(dataset, from, &data, |file, place| std::fs::copy(file, place).map(drop))?;
    let word = from.display().to_string();
    if from.is_dir() {
        // As it came, with all that a person wrote into it.
        std::fs::copy(from.join(MANIFEST), data.join(MANIFEST)).map_err(|error| Refusal::disk(&data, &error))?;
    }
    let first = Generation {
        data: "data".to_owned(),
        command: from.is_dir().then(|| format!("cp -r {} data", quoted(&word))),
        from: Some(word),
        ..Generation::default()
    };
    let dataset = uploads::read_native(&data)?;
    session.begin(first, &[], dataset)
}

/// A record of the user's own.
struct Listed {
    /// Its name in the dataset.
    name: String,
    file: PathBuf,
    /// Its role, where a `dataset.toml` gives it one.
    role: Option<Role>,
}

/// The records that the user's own data list now.
fn listed(data: &Path) -> Result<Vec<Listed>, LabError> {
    if !data.is_dir() {
        let name = data.file_name().unwrap_or_default().to_string_lossy().into_owned();
        return Ok(vec![Listed {
            name,
            file: data.to_owned(),
            role: None,
        }]);
    }
    let entries = Manifest::read(data)?.records.into_iter();
    Ok(entries
        .map(|entry| Listed {
            file: data.join(&entry.file),
            name: entry.file,
            role: Some(entry.role),
        })
        .collect())
}

/// Brings the records that the session's data do not have; says where a role is another one.
fn bring_new(session: &mut Session, listed: &[Listed]) -> Result<(), Refusal> {
    let folder = session.uploads.folder.clone();
    let data: Vec<PathBuf> = (0..session.book.generations.len())
        .map(|k| session.data_folder(k))
        .collect();
    let mut names = Vec::new();
    for record in listed {
        if data
            .iter()
            .any(|data| same_bytes(&data.join(&record.name), &record.file))
        {
            let here = session.dataset.iter().flat_map(|dataset| &dataset.records);
            let here = here.into_iter().find(|here| here.file == record.name);
            if let Some((here, role)) = here.zip(record.role).filter(|(here, role)| here.role != *role) {
                let (file, [there, here]) = (&here.file, [role, here.role].map(Role::name));
                session.notices.push(format!(
                    "{file}: the dataset.toml that the session began with has the role {there} now, here it is {here}; change it \
                     in the table if you want"
                ));
            }
            continue;
        }
        let copy = NamedTempFile::new_in(&folder).map_err(|error| Refusal::disk(&folder, &error))?;
        std::fs::copy(&record.file, copy.path()).map_err(|error| Refusal::disk(&record.file, &error))?;
        let whole = vec![(uploads::safe_name(&record.name)?, copy.into_temp_path())];
        let put = uploads::put((&folder, &data), &session.book, whole)?;
        for name in put.names {
            let file = session.book.files.entry(name.clone()).or_default();
            (file.stands, file.role) = (Stands::Waits, record.role);
            names.push((name, file.reading.clone()));
        }
    }
    if names.is_empty() {
        return Ok(());
    }
    let read = names
        .iter()
        .map(|(name, reading)| uploads::read_one(&folder, name, reading, &mut |_| ()));
    session.uploads.take(read.collect());
    session.save()
}
