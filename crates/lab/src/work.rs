//! The long jobs: fit, add, compare, diagnose, take data.

use crate::App;
use crate::error::Refusal;
use crate::jobs::{self, Progress};
use crate::session::{Session, model_name};
use crate::uploads::{self, quoted};
use crate::{export, folder, series};
use hysteron_data::{Dataset, Overwrite, write_dataset};
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_diagnose::{Comparison, Signature, signatures};
use hysteron_identify::effects::UnknownEffect;
use hysteron_identify::{Direction, EffectId, Family, FitOptions, Model};
use std::path::Path;
use std::sync::Arc;

/// Most plays; as the command line.
const PLAYS: std::ops::RangeInclusive<usize> = 1..=64;

/// Columns of a card's picture.
const CARD_COLUMNS: usize = 300;

/// Takes the files that were brought as the session's data.
pub(crate) fn take_files(app: &Arc<App>) -> Result<(), Refusal> {
    let own = Arc::clone(app);
    jobs::start(app, "writing the recordings", move |progress| {
        progress.at(0.1, "data");
        let (folder, native, command, records) = {
            let session = own.session();
            let uploads = &session.uploads;
            let names: Vec<String> = uploads.files.iter().map(|file| file.name.clone()).collect();
            if names.is_empty() {
                return Err(Refusal::unusable("there is no file to use"));
            }
            let native = uploads.is_dataset();
            if let Some(refused) = uploads.files.iter().find_map(|file| file.read.as_ref().err())
                && !native
            {
                return Err(Refusal::unusable(format!(
                    "correct or take away the file first: {refused}"
                )));
            }
            let read = uploads.files.iter().filter_map(|file| file.read.as_ref().ok());
            let records: Vec<_> = read.flat_map(|read| read.0.clone()).collect();
            (
                session.folder.clone(),
                native,
                session.book.reading.command(&names),
                records,
            )
        };
        let data = folder::fresh(&folder)?.join("data");
        let command = if native {
            let read = uploads::read_native(&folder.join("uploads"))?;
            copy_native(&folder.join("uploads"), &data, &read)?;
            format!("cp -r uploads data    # the dataset {}, as it came", read.name)
        } else {
            let dataset = uploads::imported(records);
            write_dataset(&dataset, &data, Overwrite::Refuse).map_err(Refusal::unusable)?;
            command
        };
        progress.at(0.9, "data");
        take_fresh(&own, command)
    })
}

/// Copies a dataset of ours as it came, byte by byte.
fn copy_native(from: &Path, to: &Path, dataset: &Dataset) -> Result<(), Refusal> {
    std::fs::create_dir_all(to).map_err(|error| Refusal::disk(to, &error))?;
    let records = dataset.records.iter().map(|record| record.file.as_str());
    for name in records.chain(["dataset.toml"]) {
        std::fs::copy(from.join(name), to.join(name)).map_err(|error| Refusal::disk(&to.join(name), &error))?;
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
        progress.at(0.05, &start.title);
        let folder = own.session().folder.clone();
        let data = folder::fresh(&folder)?.join("data");
        (start.make)(&data, &|share| progress.at(0.8 * share, &start.title)).map_err(Refusal::unusable)?;
        take_fresh(&own, start.command.clone())
    })
}

/// Takes what was made in the fresh folder, once it is known to be readable.
fn take_fresh(app: &App, command: String) -> Result<(), Refusal> {
    let folder = app.session().folder.clone();
    let dataset = uploads::read_native(&folder.join("fresh/data"))?;
    app.session().take_data("data".to_owned(), command, dataset)
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
    let effect: EffectId = effect
        .parse()
        .map_err(|unknown: UnknownEffect| Refusal::bad(unknown.to_string()))?;
    let (dataset, number, model) = current(&app.session())?;
    let own = Arc::clone(app);
    jobs::start(app, "adding", move |progress| {
        let added = hysteron_diagnose::add(&dataset, &model, effect, &|share| {
            progress.at(0.8 * share, effect.name())
        });
        let model = added.map_err(Refusal::unusable)?.model;
        let comparison = compare(&dataset, &model, progress);
        let mut session = own.session();
        let (before, after) = (model_name(number), model_name(session.book.steps.len()));
        let command = format!("hysteron add {effect} {} {before} -o {after}", data_word(&session));
        session.take_step(Some(number), format!("+ {effect}"), command, &model, comparison)?;
        Ok(())
    })
}

/// Diagnoses the current step's model, and shows what the first candidates do to the data.
pub(crate) fn diagnose(app: &Arc<App>) -> Result<(), Refusal> {
    let (dataset, number, model) = current(&app.session())?;
    if model.direction == Direction::Inverse {
        return Err(Refusal::conflict(
            "an inverse model has no place for physical effects; fit a forward one",
        ));
    }
    let own = Arc::clone(app);
    jobs::start(app, "diagnosing", move |progress| {
        let diagnosis = diagnosed(&dataset, &model, progress, 0.7);
        let comparison = comparison(&own, number)?;
        let mut shown = signatures(&dataset, &model, &comparison, &diagnosis, &[], &|share, effect| {
            progress.at(0.7 + 0.3 * share, effect);
        });
        shown.iter_mut().for_each(for_a_card);
        let shown = serde_json::to_string(&shown).map_err(Refusal::unusable)?;
        let session = own.session();
        folder::write_whole(&session.signatures_file(number), shown.as_bytes())?;
        keep(&session, number, &diagnosis)
    })
}

/// As many points as a card's picture has columns for.
fn for_a_card(signature: &mut Signature) {
    let Signature {
        time_s, without, with, ..
    } = &*signature;
    let points = series::columns(
        0,
        time_s.len(),
        CARD_COLUMNS,
        |k| time_s[k],
        &[&|k| without[k], &|k| with[k]],
    );
    signature.time_s = points.x;
    if let Ok([without, with]) = <[Vec<f64>; 2]>::try_from(points.y) {
        (signature.without, signature.with) = (without, with);
    }
}

fn diagnosed(dataset: &Dataset, model: &Model, progress: &Progress, whole: f64) -> Diagnosis {
    hysteron_diagnose::diagnose(dataset, model, &|share, effect| progress.at(whole * share, effect))
}

/// Keeps a diagnosis: the text of `hysteron diagnose --json`, and the record to take next as `-o` writes it.
fn keep(session: &Session, number: usize, diagnosis: &Diagnosis) -> Result<(), Refusal> {
    let text = serde_json::to_string_pretty(diagnosis).map_err(Refusal::unusable)? + "\n";
    if let Some(next) = &diagnosis.next_record {
        folder::write_whole(&session.next_record_file(number), next.csv().as_bytes())?;
    }
    folder::write_whole(&session.diagnosis_file(number), text.as_bytes())
}

/// Writes the report on the current step; what was diagnosed before is not diagnosed again.
pub(crate) fn report(app: &Arc<App>) -> Result<(), Refusal> {
    let (dataset, number, model) = current(&app.session())?;
    let own = Arc::clone(app);
    jobs::start(app, "writing the report", move |progress| {
        let comparison = comparison(&own, number)?;
        let before = std::fs::read_to_string(own.session().diagnosis_file(number)).ok();
        let diagnosis = match before.and_then(|text| serde_json::from_str(&text).ok()) {
            Some(diagnosis) => Some(diagnosis),
            None if model.direction == Direction::Inverse => None,
            None => Some(diagnosed(&dataset, &model, progress, 0.9)),
        };
        progress.at(0.95, "pictures");
        let page = export::report_page(&own, number, &comparison, diagnosis.as_ref())?;
        folder::write_whole(&own.session().report_file(number), page.as_bytes())
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

pub(crate) fn current(session: &Session) -> Result<(Arc<Dataset>, usize, Model), Refusal> {
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
