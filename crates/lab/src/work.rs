//! The long jobs: fit, add, compare, diagnose, take data.

use crate::App;
use crate::error::Refusal;
use crate::jobs::{self, Progress};
use crate::session::{Session, model_name};
use crate::uploads::{self, quoted};
use hysteron_data::Dataset;
use hysteron_diagnose::Comparison;
use hysteron_identify::{Direction, Family, FitOptions, Model};
use std::fmt::Write;
use std::sync::Arc;

/// Most plays; as the command line.
const PLAYS: std::ops::RangeInclusive<usize> = 1..=64;

/// Takes the files that were brought as the session's data.
pub(crate) fn take_files(app: &Arc<App>) -> Result<(), Refusal> {
    let own = Arc::clone(app);
    jobs::start(app, "writing the recordings", move |progress| {
        progress.at(0.1, "data");
        let (folder, files, native, command) = {
            let session = own.session();
            let uploads = &session.uploads;
            let names: Vec<String> = uploads.files.iter().map(|file| file.name.clone()).collect();
            if let Some(refused) = uploads.files.iter().find_map(|file| file.read.as_ref().err())
                && !uploads.is_dataset()
            {
                return Err(Refusal::unusable(format!(
                    "correct or take away the file first: {refused}"
                )));
            }
            (
                session.folder.clone(),
                names,
                uploads.is_dataset(),
                uploads.reading.command(&names_of(uploads)),
            )
        };
        if files.is_empty() {
            return Err(Refusal::unusable("there is no file to use"));
        }
        let from = folder.join("uploads");
        let (dataset, command) = if native {
            let read = uploads::read_native(&from)?;
            let name = read.name.clone();
            let dataset = copy_native(&folder, &read).and_then(|()| uploads::read_native(&folder.join("data")))?;
            (
                dataset,
                format!("cp -r uploads data    # the dataset {name}, as it came"),
            )
        } else {
            let records = own
                .session()
                .uploads
                .files
                .iter()
                .filter_map(|file| file.read.as_ref().ok())
                .flat_map(|read| read.0.clone())
                .collect();
            (
                uploads::write_data(&folder, "data", records, &Dataset::default())?,
                command,
            )
        };
        progress.at(0.9, "data");
        own.session().take_data("data".to_owned(), command, dataset)
    })
}

fn names_of(uploads: &uploads::Uploads) -> Vec<String> {
    uploads.files.iter().map(|file| file.name.clone()).collect()
}

/// Copies a dataset of ours as it came, byte by byte.
fn copy_native(folder: &std::path::Path, dataset: &Dataset) -> Result<(), Refusal> {
    let data = folder.join("data");
    std::fs::create_dir_all(&data).map_err(|error| Refusal::disk(&data, &error))?;
    for name in dataset
        .records
        .iter()
        .map(|record| record.file.as_str())
        .chain(["dataset.toml"])
    {
        std::fs::copy(folder.join("uploads").join(name), data.join(name))
            .map_err(|error| Refusal::disk(&data.join(name), &error))?;
    }
    Ok(())
}

/// Makes the data of a starting point.
pub(crate) fn take_start(app: &Arc<App>, name: &str) -> Result<(), Refusal> {
    let index = app
        .starts
        .iter()
        .position(|start| start.name == name)
        .ok_or_else(|| Refusal::absent(format!("there is no starting point `{name}`")))?;
    let own = Arc::clone(app);
    jobs::start(app, "recording", move |progress| {
        let start = &own.starts[index];
        let dataset = (start.make)(&|share| progress.at(0.8 * share, &start.title)).map_err(Refusal::unusable)?;
        let folder = own.session().folder.clone();
        let name = dataset.name.clone();
        let records = dataset.records.clone();
        let read = uploads::write_data(&folder, &name, records, &dataset)?;
        own.session().take_data("data".to_owned(), start.command.clone(), read)
    })
}

/// Fits a model as a new root.
pub(crate) fn fit(app: &Arc<App>, family: &str, plays: usize) -> Result<(), Refusal> {
    let family = Family::ALL
        .into_iter()
        .find(|known| known.name() == family)
        .ok_or_else(|| {
            Refusal::bad(format!(
                "`{family}` is no model; known are {}",
                Family::ALL.map(Family::name).join(", ")
            ))
        })?;
    if !PLAYS.contains(&plays) {
        return Err(Refusal::bad(format!(
            "{plays} plays: allowed are {} to {}",
            PLAYS.start(),
            PLAYS.end()
        )));
    }
    let dataset = app.session().data()?;
    let own = Arc::clone(app);
    jobs::start(app, "fitting", move |progress| {
        let options = FitOptions {
            plays,
            ..FitOptions::new(family)
        };
        let fitted = hysteron_identify::fit(&dataset, &options, &|share| progress.at(0.7 * share, family.name()));
        let model = fitted.map_err(Refusal::unusable)?.model;
        let comparison = compare(&dataset, &model, progress);
        let mut session = own.session();
        let command = format!(
            "hysteron fit {} --model {} --plays {plays} -o {}",
            data_word(&session),
            family.name(),
            model_name(session.book.steps.len())
        );
        session.take_step(
            None,
            format!("{}, {plays} plays", family.name()),
            command,
            &model,
            comparison,
        )?;
        Ok(())
    })
}

/// Adds an effect to the current step's model.
pub(crate) fn add(app: &Arc<App>, effect: &str) -> Result<(), Refusal> {
    if hysteron_identify::effects::find(effect).is_none() {
        return Err(Refusal::bad(format!(
            "`{effect}` is no effect; known are {}",
            hysteron_identify::effects::names().join(", ")
        )));
    }
    let (dataset, number, model) = current(&app.session())?;
    let (own, effect) = (Arc::clone(app), effect.to_owned());
    jobs::start(app, "adding", move |progress| {
        let added = hysteron_diagnose::add(&dataset, &model, &effect, &|share| progress.at(0.8 * share, &effect));
        let model = added.map_err(Refusal::unusable)?.model;
        let comparison = compare(&dataset, &model, progress);
        let mut session = own.session();
        let (before, after) = (model_name(number), model_name(session.book.steps.len()));
        let command = format!("hysteron add {effect} {} {before} -o {after}", data_word(&session));
        session.take_step(Some(number), format!("+ {effect}"), command, &model, comparison)?;
        Ok(())
    })
}

/// Diagnoses the current step's model.
pub(crate) fn diagnose(app: &Arc<App>) -> Result<(), Refusal> {
    let (dataset, number, model) = current(&app.session())?;
    if model.direction == Direction::Inverse {
        return Err(Refusal::conflict(
            "an inverse model has no place for physical effects; fit a forward one",
        ));
    }
    let own = Arc::clone(app);
    jobs::start(app, "diagnosing", move |progress| {
        let diagnosis = hysteron_diagnose::diagnose(&dataset, &model, &|share, effect| progress.at(share, effect));
        let session = own.session();
        let text = serde_json::to_string_pretty(&diagnosis).map_err(Refusal::unusable)? + "\n";
        if let Some(next) = &diagnosis.next_record {
            let mut csv = "time_s,voltage_v\n".to_owned();
            for (k, v) in next.voltage_v.iter().enumerate() {
                // Writing to a String does not fail; the same digits as `hysteron diagnose -o`.
                let _ = writeln!(csv, "{:.6},{v:.5}", k as f64 * next.sample_period_s);
            }
            crate::session::write_whole(&session.next_record_file(number), csv.as_bytes())?;
        }
        crate::session::write_whole(&session.diagnosis_file(number), text.as_bytes())
    })
}

/// The comparison of a step, from memory or computed now.
pub(crate) fn comparison(app: &App, number: usize) -> Result<Arc<Comparison>, Refusal> {
    let (dataset, model) = {
        let session = app.session();
        session.step(number)?;
        if let Some(there) = session.remembered(number) {
            return Ok(there);
        }
        (session.data()?, session.model(number)?)
    };
    let comparison = Arc::new(hysteron_diagnose::compare(&dataset, &model, &|_| ()));
    app.session().remember(number, Arc::clone(&comparison));
    Ok(comparison)
}

fn compare(dataset: &Dataset, model: &Model, progress: &Progress) -> Comparison {
    hysteron_diagnose::compare(dataset, model, &|share| progress.at(0.8 + 0.2 * share, "comparing"))
}

fn current(session: &Session) -> Result<(Arc<Dataset>, usize, Model), Refusal> {
    let dataset = session.data()?;
    let number = session
        .book
        .current
        .ok_or_else(|| Refusal::conflict("there is no model yet; fit one first"))?;
    Ok((dataset, number, session.model(number)?))
}

/// The dataset as a command names it.
pub(crate) fn data_word(session: &Session) -> String {
    quoted(session.book.data.as_deref().unwrap_or("data"))
}
