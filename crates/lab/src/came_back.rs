//! The files that came back of a campaign: taken whole or not at all, under a name that no other has, and taken away again.

use crate::App;
use crate::api::{Answer, Parameters, Shared, aside};
use crate::archive;
use crate::bring::received;
use crate::campaign::{self, ARCHIVED, FILES, FOLDER};
use crate::error::Refusal;
use crate::export::Download;
use crate::reading::{MANIFEST, Reading};
use crate::uploads::{self, safe_name, same_bytes};
use axum::Json;
use axum::body::Body;
use axum::extract::{Query, State};
use axum::response::IntoResponse;
use hysteron_data::{Known, Manifest};
use serde_json::json;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempPath};

/// Most files in one campaign.
const MOST: usize = 200;

/// Takes one file, or the recordings in one zip archive.
pub(crate) async fn upload(State(app): Shared, Query(parameters): Parameters, content: Body) -> Answer {
    let name = safe_name(parameters.get("name").map_or("", String::as_str))?;
    let folder = {
        let mut session = app.session();
        campaign::of(&mut session)?;
        session.folder.join(FOLDER)
    };
    let beside = received(&folder, &name, content).await?;
    let known = aside(move || keep(&app, &folder, name, beside)).await?;
    Ok(Json(json!({ "known": known })).into_response())
}

/// Keeps a file that has come whole, or the recordings in it: all of them or, where one cannot be read, none. Says which were there already.
fn keep(app: &App, folder: &Path, name: String, beside: NamedTempFile) -> Result<Vec<String>, Refusal> {
    let whole = if name.to_ascii_lowercase().ends_with(".zip") {
        let file = beside.reopen().map_err(|error| Refusal::disk(folder, &error))?;
        archive::unzip(file, folder)?
    } else {
        vec![(name, beside.into_temp_path())]
    };
    let (reading, there) = {
        let mut session = app.session();
        let campaign = campaign::of(&mut session)?;
        (campaign.reading.clone(), campaign.files.clone())
    };
    // Under their own names: what is said of a file names it.
    let coming = tempfile::tempdir_in(folder).map_err(|error| Refusal::disk(folder, &error))?;
    let come = readable(coming.path(), whole, &reading)?;
    let files = app.session().folder.join(FILES);
    std::fs::create_dir_all(&files).map_err(|error| Refusal::disk(&files, &error))?;
    if there.len() + come.len() > MOST {
        return Err(Refusal::unusable(format!(
            "more than {MOST} files; take some away first"
        )));
    }
    let mut names = there;
    let (mut known, mut new) = (Vec::new(), Vec::new());
    for (name, file) in come {
        if names.iter().any(|there| same_bytes(&files.join(there), &file)) {
            known.push(name);
            continue;
        }
        let free = free_name(&name, &names);
        std::fs::rename(&file, files.join(&free)).map_err(|error| Refusal::disk(&file, &error))?;
        names.push(free.clone());
        new.push(free);
    }
    let mut session = app.session();
    campaign::of(&mut session)?.files.extend(new);
    session.save()?;
    drop(session);
    app.changed();
    Ok(known)
}

/// Puts files into a folder under their names, and reads each.
fn readable(
    folder: &Path,
    whole: Vec<(String, TempPath)>,
    reading: &Reading,
) -> Result<Vec<(String, PathBuf)>, Refusal> {
    let mut come = Vec::new();
    let mut wrong = Vec::new();
    for (name, file) in whole {
        let path = folder.join(&name);
        file.persist(&path)
            .map_err(|error| Refusal::disk(&path, &error.error))?;
        if name == MANIFEST {
            wrong.extend(unread_known(folder));
        } else if let Err(said) = uploads::read(&path, &name, reading, &mut |_| ()) {
            wrong.push(said);
        } else {
            come.push((name, path));
        }
    }
    match wrong.is_empty() {
        true => Ok(come),
        false => Err(Refusal::unusable(wrong.join("\n"))),
    }
}

/// What is said of a `dataset.toml` that knows what is not read here: the names and roles in it are of no use to a campaign.
fn unread_known(folder: &Path) -> Option<String> {
    let known = match Manifest::read(folder) {
        Ok(manifest) => manifest.known,
        Err(error) => return Some(error.to_string().replace(&format!("{}/", folder.display()), "")),
    };
    (known != Known::default()).then(|| {
        "dataset.toml: its [known] is not read here; give the latency with the plan and the converters with the table, and bring the \
         recordings without it"
            .to_owned()
    })
}

/// A name that no file has: two instruments count alike, and none of their files is lost.
fn free_name(name: &str, names: &[String]) -> String {
    let mut free = name.to_owned();
    let mut number = 1;
    while names.iter().any(|there| there.eq_ignore_ascii_case(&free)) {
        number += 1;
        free = match name.rsplit_once('.') {
            Some((stem, kind)) => format!("{stem}-{number}.{kind}"),
            None => format!("{name}-{number}"),
        };
    }
    free
}

/// Takes a file away; what it was is looked at anew.
pub(crate) fn forget(app: &App, name: &str) -> Result<(), Refusal> {
    let mut session = app.session();
    let path = session.folder.join(FILES).join(name);
    let campaign = campaign::of(&mut session)?;
    let place = campaign.files.iter().position(|there| there == name);
    let place = place.ok_or_else(|| Refusal::absent("there is no such file"))?;
    campaign.files.remove(place);
    campaign.back = None;
    session.save()?;
    std::fs::remove_file(&path).map_err(|error| Refusal::disk(&path, &error))
}

/// Reads all files otherwise; where one cannot be read so, nothing changes.
pub(crate) fn read_so(app: &App, reading: &Reading) -> Result<(), Refusal> {
    reading.options(hysteron_data::Role::Identify)?;
    let (folder, files) = {
        let mut session = app.session();
        let files = campaign::of(&mut session)?.files.clone();
        (session.folder.join(FILES), files)
    };
    let wrong = files
        .iter()
        .filter_map(|name| uploads::read(&folder.join(name), name, reading, &mut |_| ()).err());
    let wrong: Vec<String> = wrong.collect();
    if !wrong.is_empty() {
        return Err(Refusal::unusable(wrong.join("\n")));
    }
    let mut session = app.session();
    campaign::of(&mut session)?.reading = reading.clone();
    session.save()
}

/// The files of a pass to be played, with the plan, as an archive.
pub(crate) fn pass(app: &App, number: usize) -> Result<Download, Refusal> {
    let session = {
        let mut session = app.session();
        campaign::of(&mut session)?;
        session.folder.clone()
    };
    let plan = campaign::planned(&session)?;
    if number >= plan.passes.len() {
        return Err(Refusal::absent(format!(
            "the plan has {} passes so far; bring what came back of them first",
            plan.passes.len()
        )));
    }
    let zipped = |error: &dyn std::fmt::Display| Refusal::disk(&session, error);
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, text) in plan.files(number)? {
        archive
            .start_file(format!("{ARCHIVED}/{name}"), zip::write::SimpleFileOptions::default())
            .map_err(|error| zipped(&error))?;
        archive.write_all(text.as_bytes()).map_err(|error| zipped(&error))?;
    }
    let bytes = archive.finish().map_err(|error| zipped(&error))?.into_inner();
    let name = match number {
        0 => "plan.zip".to_owned(),
        _ => format!("plan-pass{number}.zip"),
    };
    Ok((name, "application/zip", bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_files_of_one_name_stay_apart() {
        let names = ["scope.csv", "scope-2.csv", "CH1.CSV", "run"].map(str::to_owned);
        for (name, free) in [
            ("scope.csv", "scope-3.csv"),
            ("ch1.csv", "ch1-2.csv"),
            ("run", "run-2"),
            ("b.csv", "b.csv"),
        ] {
            assert_eq!(free_name(name, &names), free);
        }
    }
}
