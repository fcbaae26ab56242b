//! What is taken home: model, report, the whole session.

use crate::App;
use crate::book::Book;
use crate::campaign;
use crate::error::Refusal;
use crate::folder::RESULTS;
use crate::place::Place;
use hysteron_diagnose::Comparison;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_report::{Findings, frozen, hashes};
use std::io::{Cursor, Write};
use std::path::Path;

/// A file to download: name, type, bytes.
pub(crate) type Download = (String, &'static str, Vec<u8>);

/// The model of a step.
pub(crate) fn model(app: &App, number: usize) -> Result<Download, Refusal> {
    let session = app.session();
    let file = session.folder.join(&session.step(number)?.model);
    let bytes = std::fs::read(&file).map_err(|error| Refusal::disk(&file, &error))?;
    Ok((format!("model-{}.toml", number + 1), "application/toml", bytes))
}

/// A controller, as it was designed.
pub(crate) fn controller(app: &App, place: Place) -> Result<Download, Refusal> {
    let bytes = made(app, place, &place.controller(), Place::has_one)?
        .ok_or_else(|| Refusal::absent("no controller here yet; design it first"))?;
    Ok((format!("controller-{}.toml", place.mark()), "application/toml", bytes))
}

/// A controller's table for the firmware, as it was made.
pub(crate) fn table(app: &App, place: Place) -> Result<Download, Refusal> {
    let bytes = made(app, place, &place.table(), Place::has_table)?
        .ok_or_else(|| Refusal::absent("no table here yet; make it first"))?;
    Ok((format!("table-{}.toml", place.mark()), "application/toml", bytes))
}

/// A file that was made, where the book has it: one that it does not know is of a controller before.
fn made(app: &App, place: Place, name: &str, there: impl Fn(Place, &Book) -> bool) -> Result<Option<Vec<u8>>, Refusal> {
    let session = app.session();
    if let Place::Step(number) = place {
        session.step(number)?;
    }
    if !there(place, &session.book) {
        return Ok(None);
    }
    let file = session.folder.join(name);
    std::fs::read(&file)
        .map(Some)
        .map_err(|error| Refusal::disk(&file, &error))
}

/// The voltage of the record to take next.
pub(crate) fn next_record(app: &App, number: usize) -> Result<Download, Refusal> {
    let session = app.session();
    session.step(number)?;
    let bytes = std::fs::read(session.next_record_file(number))
        .map_err(|_| Refusal::absent("no record to take next; diagnose this step first"))?;
    Ok((format!("next-{}.csv", number + 1), "text/csv", bytes))
}

/// The report on a step, as it was written.
pub(crate) fn report(app: &App, number: usize) -> Result<Download, Refusal> {
    let session = app.session();
    session.step(number)?;
    let bytes = std::fs::read(session.report_file(number))
        .map_err(|_| Refusal::absent("no report of this step yet; write it first"))?;
    Ok(("report.html".to_owned(), "text/html; charset=utf-8", bytes))
}

/// The page of a report; the same bytes as `hysteron report` leaves in the session's folder.
pub(crate) fn report_page(
    app: &App,
    number: usize,
    comparison: &Comparison,
    diagnosis: Option<&Diagnosis>,
) -> Result<String, Refusal> {
    let (dataset, model, data, model_file, folder) = {
        let mut session = app.session();
        let dataset = session.data_of(number)?;
        let step = session.step(number)?;
        let data = session
            .book
            .generations
            .get(step.generation)
            .map(|generation| generation.data.clone());
        (
            dataset,
            session.model(number)?,
            data.unwrap_or_default(),
            step.model.clone(),
            session.folder.clone(),
        )
    };
    let hashes = hashes(&folder.join(&data), &folder.join(&model_file), &dataset)
        .map_err(|(path, error)| Refusal::disk(&path, &error))?;
    let findings = Findings {
        model: &model,
        comparison,
        diagnosis,
        hashes: &hashes,
    };
    let words = [data, model_file, "report.html".to_owned()];
    Ok(frozen(&words, &dataset, &findings, app.version))
}

/// The session's folder as a zip archive.
pub(crate) fn session(app: &App) -> Result<Download, Refusal> {
    let session = app.session();
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    let zipped = |error: &dyn std::fmt::Display| Refusal::disk(&session.folder, error);
    let data = session
        .book
        .generations
        .iter()
        .map(|generation| generation.data.as_str());
    let campaign = session.book.campaign.iter().flat_map(|_| campaign::PARTS);
    for part in ["", "uploads"].into_iter().chain(data).chain(RESULTS).chain(campaign) {
        let folder = session.folder.join(part);
        let mut files: Vec<_> = std::fs::read_dir(&folder)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .filter(|path| path.is_file())
            .collect();
        files.sort();
        for file in files {
            let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with('.') {
                continue;
            }
            let inside = Path::new("session").join(part).join(name);
            archive
                .start_file(inside.to_string_lossy(), options)
                .map_err(|error| zipped(&error))?;
            let bytes = std::fs::read(&file).map_err(|error| Refusal::disk(&file, &error))?;
            archive.write_all(&bytes).map_err(|error| zipped(&error))?;
        }
    }
    let bytes = archive.finish().map_err(|error| zipped(&error))?.into_inner();
    Ok(("session.zip".to_owned(), "application/zip", bytes))
}
