//! What is asked about files that are brought: take one, read them otherwise, take one away.

use crate::App;
use crate::api::{Answer, Parameters, Shared, aside, body, number};
use crate::archive;
use crate::book::{Brought, Stands};
use crate::error::Refusal;
use crate::reading::Reading;
use crate::uploads::{self, FILE_LIMIT, Upload};
use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::{Query, State};
use axum::http::StatusCode;
use axum::response::IntoResponse;
use http_body_util::BodyExt;
use hysteron_data::Role;
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use tokio::io::AsyncWriteExt;

/// Takes one file, or the recordings in one zip archive.
pub(crate) async fn upload(State(app): Shared, Query(parameters): Parameters, content: Body) -> Answer {
    let name = uploads::safe_name(parameters.get("name").map_or("", String::as_str))?;
    let folder = app.session().uploads.folder.clone();
    let beside = received(&folder, &name, content).await?;
    let asked_by = match parameters.contains_key("asked") {
        true => Some(number::<usize>(&parameters, "asked")?),
        false => None,
    };
    let said = aside(move || keep(&app, name, beside, asked_by)).await?;
    let status = if said["error"].is_null() {
        StatusCode::OK
    } else {
        StatusCode::UNPROCESSABLE_ENTITY
    };
    Ok((status, Json(said)).into_response())
}

/// A file as it comes, whole, beside those of a folder.
pub(crate) async fn received(folder: &Path, name: &str, mut content: Body) -> Result<NamedTempFile, Refusal> {
    let beside = NamedTempFile::new_in(folder).map_err(|error| Refusal::disk(folder, &error))?;
    let mut file = tokio::fs::File::from_std(beside.reopen().map_err(|error| Refusal::disk(folder, &error))?);
    let mut bytes = 0_u64;
    while let Some(frame) = content.frame().await {
        let frame = frame.map_err(|error| Refusal::bad(format!("{name}: the transfer broke off: {error}")))?;
        if let Ok(data) = frame.into_data() {
            bytes += data.len() as u64;
            if bytes > FILE_LIMIT {
                return Err(Refusal::new(
                    StatusCode::PAYLOAD_TOO_LARGE,
                    format!("{name}: files of more than {} MB are not taken", FILE_LIMIT >> 20),
                ));
            }
            file.write_all(&data)
                .await
                .map_err(|error| Refusal::disk(folder, &error))?;
        }
    }
    file.flush().await.map_err(|error| Refusal::disk(folder, &error))?;
    drop(file);
    if bytes == 0 {
        return Err(Refusal::unusable(format!("{name}: the file is empty")));
    }
    Ok(beside)
}

/// Keeps a recording of the board as a file that is brought, under a name that no other has, and gives that name.
pub(crate) fn keep_recorded(app: &App, beside: NamedTempFile, role: Role) -> Result<String, Refusal> {
    let name = {
        let mut session = app.session();
        let name = (1..)
            .map(|number| format!("board-{number:03}.csv"))
            .find(|name| !session.book.files.contains_key(name))
            .unwrap_or_default();
        let brought = Brought {
            role: Some(role),
            ..Brought::default()
        };
        session.book.files.insert(name.clone(), brought);
        name
    };
    keep(app, name.clone(), beside, None)?;
    Ok(name)
}

/// Keeps a file that has come whole, or the recordings in it: on the disk and in the book before it is answered.
pub(crate) fn keep(app: &App, name: String, beside: NamedTempFile, asked_by: Option<usize>) -> Result<Value, Refusal> {
    let folder = app.session().uploads.folder.clone();
    let whole = if name.to_ascii_lowercase().ends_with(".zip") {
        let file = beside.reopen().map_err(|error| Refusal::disk(&folder, &error))?;
        archive::unzip(file, &folder)?
    } else {
        vec![(name, beside.into_temp_path())]
    };
    let (put, readings) = {
        let mut session = app.session();
        if let Some(number) = asked_by {
            session.step(number)?;
        }
        let data: Vec<PathBuf> = (0..session.book.generations.len())
            .map(|k| session.data_folder(k))
            .collect();
        let put = uploads::put((&folder, &data), &session.book, whole)?;
        let new = session.book.reading_of_a_new_file();
        for name in &put.names {
            let file = session.book.files.entry(name.clone()).or_insert_with(|| Brought {
                reading: new.clone(),
                ..Brought::default()
            });
            (file.stands, file.asked_by) = (Stands::Waits, asked_by);
        }
        let reading = |name: &String| {
            session
                .book
                .files
                .get(name)
                .map(|file| file.reading.clone())
                .unwrap_or_default()
        };
        let readings: Vec<Reading> = put.names.iter().map(reading).collect();
        (put, readings)
    };
    let read: Vec<Upload> = put
        .names
        .iter()
        .zip(&readings)
        .map(|(name, reading)| uploads::read_one(&folder, name, reading, &mut |share| app.reads(Some(share))))
        .collect();
    app.reads(None);
    let errors: Vec<String> = read
        .iter()
        .filter_map(|upload| upload.read.as_ref().err().cloned())
        .collect();
    {
        let mut session = app.session();
        session.uploads.take(read);
        session.save()?;
    }
    app.changed();
    Ok(json!({
        "error": (!errors.is_empty()).then(|| errors.join("\n")),
        "known": put.known,
    }))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Read {
    files: Vec<String>,
    reading: Reading,
}

/// Reads some of the files anew, with other options.
pub(crate) async fn reading(State(app): Shared, content: Bytes) -> Answer {
    let Read { files, reading } = body(&content)?;
    reading.options(Role::Identify)?;
    aside(move || {
        let folder = {
            let mut session = app.session();
            for name in &files {
                let file = session.book.files.get_mut(name);
                file.ok_or_else(|| Refusal::absent("there is no such file"))?.reading = reading.clone();
            }
            session.save()?;
            session.uploads.folder.clone()
        };
        let read = files
            .iter()
            .map(|name| uploads::read_one(&folder, name, &reading, &mut |share| app.reads(Some(share))))
            .collect();
        app.session().uploads.renew(read);
        app.reads(None);
        app.changed();
        Ok(Json(json!({})).into_response())
    })
    .await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Use {
    file: String,
    role: Role,
}

/// What the records of a file that waits are for.
pub(crate) async fn use_as(State(app): Shared, content: Bytes) -> Answer {
    let Use { file, role } = body(&content)?;
    let mut session = app.session();
    let brought = session.book.files.get_mut(&file);
    brought.ok_or_else(|| Refusal::absent("there is no such file"))?.role = Some(role);
    session.save()?;
    drop(session);
    app.changed();
    Ok(Json(json!({})).into_response())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Forget {
    name: String,
}

/// Takes a file away.
pub(crate) async fn forget(State(app): Shared, content: Bytes) -> Answer {
    let Forget { name } = body(&content)?;
    let mut session = app.session();
    if session.uploads.files.iter().all(|file| file.name != name) {
        return Err(Refusal::absent("there is no such file"));
    }
    let path = session.uploads.folder.join(&name);
    std::fs::remove_file(&path).map_err(|error| Refusal::disk(&path, &error))?;
    session.uploads.files.retain(|file| file.name != name);
    session.book.files.remove(&name);
    session.save()?;
    drop(session);
    app.changed();
    Ok(Json(json!({})).into_response())
}
