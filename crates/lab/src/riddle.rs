//! A session whose data hide something: one answer, then the truth.

use crate::App;
use crate::error::Refusal;
use crate::reading::quoted;
use crate::session::Session;
use hysteron_challenge::ChallengeError;
use serde_json::{Value, json};
use std::path::PathBuf;

/// How the challenge stands; nothing where the data are none.
pub(crate) fn state(session: &Session) -> Option<Value> {
    let folder = place(session)?;
    let first = session.book.generations.first()?;
    let own = first.from.as_ref().unwrap_or(&first.data);
    let (data, key) = (quoted(own), quoted(&format!("{own}.key")));
    let stands = hysteron_challenge::stands(&folder);
    let error = stands.as_ref().err().map(|error| shown(session, error));
    let (answer, revealed) = stands.unwrap_or_default();
    // A seed has more digits than a number of the page.
    let seed = revealed.as_ref().map(|revealed| revealed.truth.seed.to_string());
    Some(json!({
        "names": hysteron_challenge::names(),
        "answer": answer,
        "revealed": revealed,
        "seed": seed,
        "error": error,
        "answer_command": format!("hysteron challenge answer {data} EFFECT"),
        "reveal_command": format!("hysteron challenge reveal {data} {key}"),
    }))
}

/// The folder of the challenge: the user's own, or that of the data as they began, however they grew.
fn place(session: &Session) -> Option<PathBuf> {
    let first = session.book.generations.first()?;
    let own = first.from.as_ref().map(PathBuf::from);
    own.or(Some(session.data_folder(0)))
        .filter(|folder| hysteron_challenge::is_challenge(folder))
}

/// Takes the answer.
pub(crate) fn answer(app: &App, names: &[String]) -> Result<(), Refusal> {
    let mut session = app.session();
    let folder = folder(&session)?;
    hysteron_challenge::answer(&folder, names).map_err(|error| Refusal::conflict(shown(&session, &error)))?;
    session.save()
}

/// Shows the truth with the key that lies beside the data.
pub(crate) fn reveal(app: &App) -> Result<(), Refusal> {
    let mut session = app.session();
    let folder = folder(&session)?;
    let mut key = folder.clone().into_os_string();
    key.push(".key");
    hysteron_challenge::reveal(&folder, &PathBuf::from(key))
        .map_err(|error| Refusal::conflict(shown(&session, &error)))?;
    session.save()
}

fn folder(session: &Session) -> Result<PathBuf, Refusal> {
    place(session)
        .ok_or_else(|| Refusal::conflict("nothing is hidden in these data; begin with a stage with something hidden"))
}

fn shown(session: &Session, error: &ChallengeError) -> String {
    error.to_string().replace(&format!("{}/", session.folder.display()), "")
}
