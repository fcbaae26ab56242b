//! What is asked about files that are brought: take one, read them otherwise, take one away.

use crate::api::{Answer, Parameters, Shared, aside, body};
use crate::error::Refusal;
use crate::uploads::{self, FILE_LIMIT, Reading, Upload};
use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::{Query, State};
use axum::http::StatusCode;
use axum::response::IntoResponse;
use http_body_util::BodyExt;
use serde::Deserialize;
use serde_json::json;
use std::sync::Arc;
use tokio::io::AsyncWriteExt;

/// Takes one file, or the recordings in one zip archive.
pub(crate) async fn upload(State(app): Shared, Query(parameters): Parameters, mut content: Body) -> Answer {
    let name = uploads::safe_name(parameters.get("name").map_or("", String::as_str))?;
    let folder = app.session().uploads.folder.clone();
    let beside = tempfile::NamedTempFile::new_in(&folder).map_err(|error| Refusal::disk(&folder, &error))?;
    let mut file = tokio::fs::File::from_std(beside.reopen().map_err(|error| Refusal::disk(&folder, &error))?);
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
                .map_err(|error| Refusal::disk(&folder, &error))?;
        }
    }
    file.flush().await.map_err(|error| Refusal::disk(&folder, &error))?;
    drop(file);
    if bytes == 0 {
        return Err(Refusal::unusable(format!("{name}: the file is empty")));
    }
    let own = Arc::clone(&app);
    let errors = aside(move || {
        let reading = own.session().book.reading.clone();
        let whole = if name.to_ascii_lowercase().ends_with(".zip") {
            let archive = beside.reopen().map_err(|error| Refusal::disk(&folder, &error))?;
            uploads::unzip(archive, &folder)?
        } else {
            vec![(name, beside.into_temp_path())]
        };
        let names: Vec<String> = whole.iter().map(|(name, _)| name.clone()).collect();
        own.session().uploads.put(whole)?;
        let read: Vec<Upload> = names
            .iter()
            .map(|name| uploads::read_one(&folder, name, &reading))
            .collect();
        let errors: Vec<String> = read
            .iter()
            .filter_map(|upload| upload.read.as_ref().err().cloned())
            .collect();
        {
            let mut session = own.session();
            session.uploads.take(read);
            session.book.files_taken = false;
            session.save()?;
        }
        own.changed();
        Ok(errors)
    })
    .await?;
    let status = if errors.is_empty() {
        StatusCode::OK
    } else {
        StatusCode::UNPROCESSABLE_ENTITY
    };
    let said = json!({ "error": (!errors.is_empty()).then(|| errors.join("\n")) });
    Ok((status, Json(said)).into_response())
}

/// Reads all files anew with other options.
pub(crate) async fn reading(State(app): Shared, content: Bytes) -> Answer {
    let reading: Reading = body(&content)?;
    reading.options(hysteron_data::Role::Identify)?;
    aside(move || {
        let (folder, names) = {
            let mut session = app.session();
            session.book.reading = reading.clone();
            session.book.files_taken = false;
            session.save()?;
            (
                session.uploads.folder.clone(),
                session
                    .uploads
                    .files
                    .iter()
                    .map(|file| file.name.clone())
                    .collect::<Vec<_>>(),
            )
        };
        let read = names
            .iter()
            .map(|name| uploads::read_one(&folder, name, &reading))
            .collect();
        app.session().uploads.renew(read);
        app.changed();
        Ok(Json(json!({})).into_response())
    })
    .await
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
    drop(session);
    app.changed();
    Ok(Json(json!({})).into_response())
}
