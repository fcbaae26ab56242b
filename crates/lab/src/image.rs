//! The firmware's image with a controller's table in it, built from the sources where they are at hand.

use crate::App;
use crate::error::Refusal;
use crate::export::Download;
use crate::jobs;
use crate::place::{Of, Place};
use crate::session::Session;
use hysteron_board::image::{Board, build};
use serde_json::{Value, json};
use std::sync::Arc;

/// The board of a name.
fn board(name: &str) -> Result<Board, Refusal> {
    Board::find(name).ok_or_else(|| {
        Refusal::bad(format!(
            "there is no board `{}`; there are {}",
            name.chars().take(40).collect::<String>(),
            Board::ALL.map(Board::name).join(", ")
        ))
    })
}

/// The image's file, as the commands name it: beside its table.
fn file(place: Place, board: Board) -> String {
    let table = place.table();
    let name = table.strip_suffix(".toml").unwrap_or(&table);
    format!("{name}-{}.elf", board.name())
}

/// Builds the image of a controller's table for a board.
pub(crate) fn make(app: &Arc<App>, of: Of, name: &str) -> Result<(), Refusal> {
    let board = board(name)?;
    let (folder, place) = {
        let session = app.session();
        let place = Place::of(&session, of)?;
        if !place.has_table(&session.book) {
            return Err(Refusal::conflict("no table here yet; make it first"));
        }
        (session.folder.clone(), place)
    };
    let own = Arc::clone(app);
    jobs::start(app, "building the image", move |progress| {
        progress.at(0.1, board.name());
        let (table, image) = (folder.join(place.table()), folder.join(file(place, board)));
        let unfinished = image.with_extension("part");
        let mut told = |said: &str| progress.at(0.1, said);
        build(&own.firmware, board, (&table, None), &unfinished, &mut told).map_err(Refusal::unusable)?;
        std::fs::rename(&unfinished, &image).map_err(|error| Refusal::disk(&image, &error))?;
        own.session().save()
    })
}

/// Takes away the images of a table that is made anew.
pub(crate) fn forget(session: &Session, place: Place) {
    for board in Board::ALL {
        // One that is not there needs no taking away; what cannot be removed stands beside a table of another time.
        let _ = std::fs::remove_file(session.folder.join(file(place, board)));
    }
}

/// What can be built, and what is there: by the mark of the place, the names of the boards.
pub(crate) fn state(app: &App, session: &Session) -> Value {
    let places = (0..session.book.steps.len()).map(Place::Step).chain([Place::Campaign]);
    let with_table = places.filter(|place| place.has_table(&session.book));
    let there = |place: Place| -> Vec<&str> {
        let all = Board::ALL.into_iter();
        all.filter(|board| session.folder.join(file(place, *board)).exists())
            .map(Board::name)
            .collect()
    };
    let images: serde_json::Map<String, Value> = with_table.map(|place| (place.mark(), json!(there(place)))).collect();
    json!({
        "sources": app.firmware.join("nucleo").is_dir(),
        "boards": Board::ALL.map(Board::name),
        "there": images,
    })
}

/// An image that was built.
pub(crate) fn download(app: &App, place: Place, name: &str) -> Result<Download, Refusal> {
    let board = board(name)?;
    let session = app.session();
    let absent = || Refusal::absent("no such image here yet; build it first");
    if !place.has_table(&session.book) {
        return Err(absent());
    }
    let bytes = std::fs::read(session.folder.join(file(place, board))).map_err(|_| absent())?;
    Ok((
        format!("image-{}-{}.elf", place.mark(), board.name()),
        "application/octet-stream",
        bytes,
    ))
}
