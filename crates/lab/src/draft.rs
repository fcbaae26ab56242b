//! The effect file that a person writes on the page: kept with the session as it is typed, read by the parser of the command line.

use crate::api::{Answer, Shared, aside, body};
use crate::book::Recipe;
use crate::error::Refusal;
use crate::folder::write_whole;
use crate::{App, work};
use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::response::IntoResponse;
use hysteron_data::Dataset;
use hysteron_identify::Model;
use hysteron_identify::effects::{Effect, EffectError, UserEffect};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;

/// Largest body of a request with a text: the longest effect file, every character of it escaped.
pub(crate) const BODY_LIMIT: usize = 512 << 10;

/// Its file in the session's folder, and its name in what is said of it.
const FILE: &str = "own-effect.toml";

/// What stands there before a person has written anything.
const EXAMPLE: &str = include_str!("../../../docs/effects/encoder-ripple.toml");

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    text: String,
}

/// The text as it was left, else the example.
fn read(app: &App) -> Result<String, Refusal> {
    let file = app.session().folder.join(FILE);
    match std::fs::read_to_string(&file) {
        Ok(text) => Ok(text),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(EXAMPLE.to_owned()),
        Err(error) => Err(Refusal::disk(&file, &error)),
    }
}

/// The text, and what is wrong in it.
pub(crate) async fn show(State(app): Shared) -> Answer {
    aside(move || {
        let text = read(&app)?;
        Ok(Json(json!({ "text": text, "judged": judged(&text) })).into_response())
    })
    .await
}

/// Keeps the text, right or wrong, and says what is wrong in it.
pub(crate) async fn keep(State(app): Shared, content: Bytes) -> Answer {
    let Written { text } = body(&content)?;
    aside(move || {
        // Two tabs at once write one after the other.
        let session = app.session();
        write_whole(&session.folder.join(FILE), text.as_bytes())?;
        drop(session);
        Ok(Json(judged(&text)).into_response())
    })
    .await
}

/// The effect's name and its summary, or what is wrong and where.
fn judged(text: &str) -> Value {
    match UserEffect::checked(text, FILE) {
        Ok(file) => json!({ "name": file.name, "summary": file.summary }),
        Err(EffectError::File { reason, at, .. }) => match at {
            Some(at) => json!({ "wrong": at.why, "line": at.line, "column": at.column }),
            None => json!({ "wrong": reason }),
        },
        Err(error) => json!({ "wrong": error.to_string() }),
    }
}

/// Adds the effect of the text that is kept to the current step's model.
pub(crate) fn add(app: &Arc<App>) -> Result<(), Refusal> {
    let text = read(app)?;
    UserEffect::checked(&text, FILE).map_err(Refusal::unusable)?;
    work::add_by(app, Recipe::AddOwn { text })
}

/// The title of the step and the model with the effect of a text in it.
pub(crate) fn added(
    text: &str,
    dataset: &Dataset,
    before: &Model,
    at: &(dyn Fn(f64, &str) + Sync),
) -> Result<(String, Model), Refusal> {
    let effect = UserEffect::from_toml(text, FILE).map_err(Refusal::unusable)?;
    let name = effect.name();
    let added = hysteron_diagnose::add_own(dataset, before, effect, &|share| at(share, name.as_str()));
    Ok((format!("+ {name}"), added.map_err(Refusal::unusable)?.model))
}
