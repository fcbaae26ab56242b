//! What the page shows, as JSON.

use crate::App;
use crate::riddle;
use crate::uploads::Upload;
use serde_json::{Value, json};

/// The whole state: data, files, steps, the job.
pub(crate) fn state(app: &App, tick: u64) -> Value {
    let session = app.session();
    let book = &session.book;
    let data = session.dataset.as_ref().map(|dataset| {
        json!({
            "name": dataset.name,
            "path": book.data,
            "command": book.data_command,
            "notices": dataset.notices.iter().map(|n| format!("{}: {}", n.file, n.text)).collect::<Vec<_>>(),
            "records": session.shown,
        })
    });
    let files: Vec<Value> = session.uploads.files.iter().map(upload).collect();
    let names: Vec<String> = session.uploads.files.iter().map(|file| file.name.clone()).collect();
    let starts: Vec<Value> = app
        .starts
        .iter()
        .map(|start| json!({"name": start.name, "title": start.title, "about": start.about, "command": start.command}))
        .collect();
    let diagnosed: Vec<bool> = (0..book.steps.len())
        .map(|step| session.diagnosis_file(step).exists())
        .collect();
    let reported: Vec<bool> = (0..book.steps.len())
        .map(|step| session.report_file(step).exists())
        .collect();
    let job = app.job().clone();
    json!({
        "tick": tick,
        "version": app.version,
        "revision": book.revision,
        "folder": session.folder.display().to_string(),
        "data": data,
        "files": files,
        "files_taken": book.files_taken,
        "reading": book.reading,
        "import_command": book.reading.command(&names),
        "starts": starts,
        "steps": book.steps,
        "diagnosed": diagnosed,
        "reported": reported,
        "tables": book.tables,
        "challenge": riddle::state(&session),
        "current": book.current,
        "job": job,
    })
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

fn upload(upload: &Upload) -> Value {
    let (preview, error) = match &upload.read {
        Ok((_, preview)) => (Some(preview), None),
        Err(error) => (None, Some(error)),
    };
    json!({"name": upload.name, "bytes": upload.bytes, "records": upload.shown, "preview": preview, "error": error})
}
