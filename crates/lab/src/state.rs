//! What the page shows, as JSON.

use crate::App;
use crate::board;
use crate::book::Step;
use crate::image;
use crate::reading::quoted;
use crate::riddle;
use crate::session::Session;
use crate::undo::Way;
use crate::uploads::{Found, Upload};
use hysteron_data::{Known, Manifest};
use serde_json::{Value, json};
use std::path::PathBuf;

/// The whole state: data, files, steps, the job.
pub(crate) fn state(app: &App, tick: u64) -> Value {
    let session = app.session();
    let book = &session.book;
    let starts: Vec<Value> = app
        .starts
        .iter()
        .map(|start| json!({"name": start.name, "title": start.title, "about": start.about, "command": start.command}))
        .collect();
    let there = |file: fn(&Session, usize) -> PathBuf| -> Vec<bool> {
        let steps = 0..book.steps.len();
        steps.map(|step| file(&session, step).exists()).collect()
    };
    let job = app.job().clone();
    json!({
        "tick": tick,
        "run": app.run,
        "version": app.version,
        "revision": book.revision,
        "folder": session.folder.display().to_string(),
        "project": app.projects.open_name(),
        "session_command": format!("hysteron lab --session {}", quoted(&session.folder.display().to_string())),
        "data": data(&session),
        "files": session.uploads.files.iter().map(|file| upload(&session, file)).collect::<Vec<_>>(),
        "starts": starts,
        "steps": book.steps.iter().map(|step| shown_step(&session, step)).collect::<Vec<_>>(),
        "diagnosed": there(Session::diagnosis_file),
        "reported": there(Session::report_file),
        "learned": book.learned,
        "controllers": book.controllers,
        "tracked": book.tracked,
        "on_stage": book.on_stage,
        "tables": book.tables,
        "images": image::state(app, &session),
        "campaign": book.campaign,
        "challenge": riddle::state(&session),
        "current": book.current,
        "undo": book.offered(Way::Undo),
        "redo": book.offered(Way::Redo),
        "board": app.has_board(),
        "takes_known": board::takes_known(&session),
        "job": job,
        "reading": app.reading(),
    })
}

/// The present data, and where each record came from.
fn data(session: &Session) -> Option<Value> {
    let (book, dataset) = (&session.book, session.dataset.as_ref()?);
    let records = session.shown.iter().zip(&dataset.records).map(|(shown, record)| {
        let mut shown = shown.clone();
        let came = book.origin(&record.file);
        shown["came_in"] = json!(came.map(|came| &came.file));
        shown["asked_by"] = json!(came.and_then(|came| came.asked_by));
        shown
    });
    let generation = book.data()?;
    let read = dataset.notices.iter().map(|n| format!("{}: {}", n.file, n.text));
    Some(json!({
        "name": dataset.name,
        "path": generation.data,
        "command": generation.command,
        "generation": book.now(),
        "notices": read.chain(session.notices.iter().cloned()).collect::<Vec<_>>(),
        "records": records.collect::<Vec<_>>(),
    }))
}

/// A step, and what came to the data since.
fn shown_step(session: &Session, step: &Step) -> Value {
    let mut shown = json!(step);
    shown["since"] = json!(session.book.since(step));
    shown["title"] = json!(step.name());
    shown["made"] = json!(step.title);
    shown
}

/// A record in figures; finding its period takes a transform of the drive, so this is done once.
pub(crate) fn record(record: &hysteron_data::Record) -> Value {
    let quantities: Vec<&str> = [
        Some("voltage"),
        Some("position"),
        record.reference_um.as_ref().map(|_| "reference"),
        record.temperature_c.as_ref().map(|_| "temperature"),
        record.voltage2_v.as_ref().map(|_| "second voltage"),
    ]
    .into_iter()
    .flatten()
    .collect();
    json!({
        "file": record.file,
        "role": record.role,
        "excitation": record.excitation,
        "samples": record.len(),
        "rate_hz": record.rate_hz(),
        "seconds": record.duration_s(),
        "period_samples": hysteron_identify::period::detect(&record.voltage_v).map(|period| period.samples),
        "quantities": quantities,
    })
}

fn upload(session: &Session, upload: &Upload) -> Value {
    let brought = session.book.files.get(&upload.name);
    let (preview, error) = match &upload.read {
        Ok(Found::Records { preview, .. }) => (Some(preview.clone()), None),
        Ok(Found::Manifest(manifest)) => (Some(manifest_words(session, manifest)), None),
        Err(error) => (None, Some(error)),
    };
    json!({
        "name": upload.name,
        "bytes": upload.bytes,
        "records": upload.shown,
        "preview": preview,
        "error": error,
        "role": session.uploads.role(&upload.name, brought),
        "reading": brought.map(|file| &file.reading),
        "asked_by": brought.and_then(|file| file.asked_by),
        "stands": brought.map(|file| file.stands),
    })
}

/// What a `dataset.toml` gives, and what it names and is not there.
fn manifest_words(session: &Session, manifest: &Manifest) -> String {
    let mut words = "a dataset of hysteron: the roles of its records are taken from it".to_owned();
    if !session.book.generations.is_empty() && manifest.known != Known::default() {
        words.push_str("; its [known] is not, because the data are there already");
    }
    let there = |name: &str| {
        let brought = session.uploads.files.iter().any(|file| file.name == name);
        let data = session.dataset.iter().flat_map(|dataset| &dataset.records);
        brought || data.into_iter().any(|record| record.file == name)
    };
    let absent: Vec<&str> = manifest
        .records
        .iter()
        .map(|entry| entry.file.as_str())
        .filter(|name| !there(name))
        .collect();
    if !absent.is_empty() {
        words.push_str(&format!(
            "\nit names {}, not brought: bring it too, or go on without it",
            absent.join(", ")
        ));
    }
    words
}
