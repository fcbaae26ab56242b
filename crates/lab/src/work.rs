//! The long jobs: fit, add, compare, diagnose, take data.

use crate::App;
use crate::error::Refusal;
use crate::jobs::{self, Progress};
use crate::session::{self, Session, model_name};
use crate::uploads::{self, quoted};
use crate::{export, signature};
use hysteron_data::{Dataset, Overwrite, write_dataset};
use hysteron_diagnose::Comparison;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_identify::{Direction, Family, FitOptions, Model};
use serde::Deserialize;
use std::path::Path;
use std::sync::Arc;

/// Most plays; as the command line.
const PLAYS: std::ops::RangeInclusive<usize> = 1..=64;

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
        let data = session::fresh(&folder)?.join("data");
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
        let data = session::fresh(&folder)?.join("data");
        (start.make)(&data, &|share| progress.at(0.8 * share, &start.title)).map_err(Refusal::unusable)?;
        take_fresh(&own, start.command.clone())
    })
}

/// Takes what was made in the fresh folder, once it is known to be readable.
fn take_fresh(app: &App, command: String) -> Result<(), Refusal> {
    let folder = app.session().folder.clone();
    uploads::read_native(&folder.join("fresh/data"))?;
    let mut session = app.session();
    session::replace_data(&folder)?;
    let dataset = uploads::read_native(&folder.join("data"))?;
    session.take_data("data".to_owned(), command, dataset)
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
        let shown = signature::signatures(&dataset, &model, &comparison, &diagnosis, &|share, effect| {
            progress.at(0.7 + 0.3 * share, effect);
        });
        let shown = serde_json::to_string(&shown).map_err(Refusal::unusable)?;
        let session = own.session();
        session::write_whole(&session.signatures_file(number), shown.as_bytes())?;
        keep(&session, number, &diagnosis)
    })
}

fn diagnosed(dataset: &Dataset, model: &Model, progress: &Progress, whole: f64) -> Diagnosis {
    hysteron_diagnose::diagnose(dataset, model, &|share, effect| progress.at(whole * share, effect))
}

/// Keeps a diagnosis: the text of `hysteron diagnose --json`, and the record to take next as `-o` writes it.
fn keep(session: &Session, number: usize, diagnosis: &Diagnosis) -> Result<(), Refusal> {
    let text = serde_json::to_string_pretty(diagnosis).map_err(Refusal::unusable)? + "\n";
    if let Some(next) = &diagnosis.next_record {
        session::write_whole(&session.next_record_file(number), next.csv().as_bytes())?;
    }
    session::write_whole(&session.diagnosis_file(number), text.as_bytes())
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
        session::write_whole(&own.session().report_file(number), page.as_bytes())
    })
}

/// Why a step has no table for the firmware, and what to do; nothing where it has one.
pub(crate) fn no_table(model: &Model) -> Option<String> {
    (!model.effects.is_empty()).then(|| {
        let names: Vec<&str> = model.effects.iter().map(|effect| effect.name.as_str()).collect();
        format!(
            "This step has {}, and a table holds the inverse of the hysteresis alone: the controller does not compensate \
             effects yet. Choose a step without effects on the ladder.",
            names.join(" and ")
        )
    })
}

/// What the controller's ends are, where they are not those of the paper's bench; each as the option of `hysteron export`.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Ends {
    /// Lowest and highest reference, micrometres.
    input_min_um: Option<f64>,
    input_max_um: Option<f64>,
    /// Volts that the stack may be given.
    amplifier_min_v: Option<f64>,
    amplifier_max_v: Option<f64>,
    latency_us: Option<f64>,
    mode_hz: Option<f64>,
    damping: Option<f64>,
}

impl Ends {
    fn options(&self) -> Result<Vec<String>, Refusal> {
        let single = [
            ("input-min", self.input_min_um),
            ("input-max", self.input_max_um),
            ("latency-us", self.latency_us),
            ("mode", self.mode_hz),
            ("damping", self.damping),
        ];
        let mut options: Vec<String> = single
            .into_iter()
            .filter_map(|(name, value)| Some(format!("--{name}={}", value?)))
            .collect();
        match (self.amplifier_min_v, self.amplifier_max_v) {
            (Some(low), Some(high)) => options.push(format!("--amplifier={low},{high}")),
            (None, None) => {}
            _ => return Err(Refusal::unusable("give the lowest and the highest voltage, or neither")),
        }
        Ok(options)
    }
}

fn inverse_name(number: usize) -> String {
    format!("models/{}-inverse.toml", number + 1)
}

/// Fits the direct inverse of the current step's family to the data, and makes the table for the firmware.
pub(crate) fn table(app: &Arc<App>, ends: &Ends) -> Result<(), Refusal> {
    let (dataset, number, model) = current(&app.session())?;
    if let Some(why) = no_table(&model) {
        return Err(Refusal::conflict(why));
    }
    let options = ends.options()?;
    let own = Arc::clone(app);
    jobs::start(app, "making the table", move |progress| {
        let plays = model.thresholds.len();
        let fit = FitOptions {
            plays,
            direction: Direction::Inverse,
            ..FitOptions::new(model.family)
        };
        let fitted = hysteron_identify::fit(&dataset, &fit, &|share| progress.at(0.95 * share, "direct inverse"));
        let inverse = fitted.map_err(Refusal::unusable)?.model;
        let text = (own.table)(&inverse, &options).map_err(Refusal::unusable)?;
        let mut session = own.session();
        let (file, table) = (inverse_name(number), Session::table_name(number));
        inverse.write(&session.folder.join(&file)).map_err(Refusal::unusable)?;
        session::write_whole(&session.folder.join(&table), text.as_bytes())?;
        let command = format!(
            "hysteron fit {} --model {} --plays {plays} --direction inverse -o {file} && hysteron export {file} {} -o {table}",
            data_word(&session),
            model.family.name(),
            options.join(" ")
        );
        session.book.tables.insert(number, command.replace("  ", " "));
        session.save()
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
