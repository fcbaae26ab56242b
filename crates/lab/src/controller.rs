//! The controller of a step: designed from its model, run on it, and as the table that the firmware takes.

use crate::App;
use crate::bench::Bench;
use crate::error::Refusal;
use crate::jobs;
use crate::session::Session;
use crate::wish::{Given, pair};
use crate::{folder, work};
use hysteron_control::design::beyond;
use hysteron_control::design::curves::LoopCurves;
use hysteron_control::design::source::{Source, Wishes, design, usual_rate_hz, usual_volts};
use hysteron_control::design::{Controller, ReferenceKind};
use hysteron_control::expected::{Row, half_the_stroke};
use hysteron_control::export::export;
use hysteron_control::on_model::on_model;
use hysteron_identify::{Model, small_signal_response};
use hysteron_report::{Light, beyond_text, design_lights, design_text, law_table_text, reference_name, tracked_text};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;

/// Something that was made of a step.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Made {
    /// The command that makes it.
    pub(crate) command: String,
    /// What the command says of it.
    pub(crate) said: String,
    /// The lights of a design.
    #[serde(default)]
    pub(crate) lights: Vec<Light>,
    /// What a run came to.
    #[serde(default)]
    pub(crate) rows: Vec<Found>,
}

impl Made {
    fn new(command: String, said: String) -> Self {
        Self {
            command,
            said,
            lights: Vec::new(),
            rows: Vec::new(),
        }
    }
}

/// A reference in one loop: the error that was expected and the one that was found, rms, percent of peak to peak.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Found {
    /// The reference in words.
    reference: String,
    closed: bool,
    expected_percent: Option<f64>,
    found_percent: Option<f64>,
    stable: bool,
}

impl Found {
    fn of(row: &Row) -> Self {
        Self {
            reference: reference_name(row.reference),
            closed: row.loop_kind == "closed",
            expected_percent: row.expected_percent,
            found_percent: row.found_percent.is_finite().then_some(row.found_percent),
            stable: row.stable,
        }
    }
}

/// What is wished for of a design; each as the option of `hysteron design` of its name.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Wished {
    reference: Option<ReferenceKind>,
    volts_min: Option<f64>,
    volts_max: Option<f64>,
    rate_hz: Option<f64>,
    margin: Option<f64>,
    rigid_hz: Option<f64>,
    adapt_percent: Option<f64>,
    beyond_records: bool,
    open: bool,
}

impl Wished {
    /// The wishes, and the options that say the same.
    fn read(&self) -> Result<(Wishes, Given), Refusal> {
        let usual = Wishes::default();
        let volts = pair("voltage", self.volts_min, self.volts_max)?;
        if self.open && (self.margin.is_some() || self.rigid_hz.is_some()) {
            return Err(Refusal::unusable(
                "without feedback there is nothing for --margin and --rigid to say; leave them empty, or design with feedback",
            ));
        }
        let reference = self.reference.unwrap_or(usual.reference);
        let mut given = Given::default();
        given.flag("reference live", reference == ReferenceKind::Live);
        given.pair("volts", volts);
        given.number("rate-hz", self.rate_hz);
        given.number("margin", self.margin);
        given.number("rigid", self.rigid_hz);
        given.number("adapt", self.adapt_percent);
        given.flag("beyond-records", self.beyond_records);
        given.flag("open", self.open);
        let wishes = Wishes {
            reference,
            volts,
            rate_hz: self.rate_hz,
            margin: self.margin.unwrap_or(usual.margin),
            rigid_hz: self.rigid_hz,
            beyond_records: self.beyond_records,
            open: self.open,
            adapt_percent: self.adapt_percent,
        };
        wishes.check().map_err(Refusal::unusable)?;
        Ok((wishes, given))
    }
}

/// Where the law is run along references, each as the option of `hysteron track` of its name.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Along {
    /// A simulated stage; the step's model without.
    stage: Option<String>,
    range_min_um: Option<f64>,
    range_max_um: Option<f64>,
    beyond_records: bool,
}

/// A controller's file, as the commands name it.
pub(crate) fn file_name(number: usize) -> String {
    format!("controllers/{}.toml", number + 1)
}

/// The current step.
fn current(session: &Session) -> Result<(usize, String, Model), Refusal> {
    let work::Base { number, model, .. } = work::Base::of(session)?;
    Ok((number, session.step(number)?.model.clone(), model))
}

/// The controller of the current step.
fn designed(session: &Session, number: usize) -> Result<Controller, Refusal> {
    if !session.book.controllers.contains_key(&number) {
        return Err(Refusal::conflict("this step has no controller yet; design one first"));
    }
    Controller::read(&file(session, number)).map_err(Refusal::unusable)
}

fn file(session: &Session, number: usize) -> PathBuf {
    session.folder.join(file_name(number))
}

/// Designs the controller of the current step; what was made of the one before goes with it.
pub(crate) fn make(app: &Arc<App>, wished: &Wished) -> Result<(), Refusal> {
    let (number, name, model) = current(&app.session())?;
    let (wishes, given) = wished.read()?;
    let own = Arc::clone(app);
    jobs::start(app, "designing", move |progress| {
        progress.at(0.02, "feedforward and feedback, some ten seconds");
        let source = Source::Model {
            model: &model,
            along: &[],
        };
        let designed = design(&source, &wishes).map_err(Refusal::unusable)?;
        let said = design_text(&designed, wishes.margin).map_err(Refusal::unusable)?;
        let lights = design_lights(&designed, wishes.margin);
        let text = designed.controller.to_toml().map_err(Refusal::unusable)?;
        // The last look at whether it was stopped.
        progress.at(0.99, "");
        let mut session = own.session();
        folder::write_whole(&file(&session, number), text.as_bytes())?;
        let command = format!("hysteron design {name}{} -o {}", given.words(), file_name(number));
        let made = Made {
            lights,
            ..Made::new(command, said)
        };
        session.book.controllers.insert(number, made);
        session.book.tracked.remove(&number);
        session.book.on_stage.remove(&number);
        session.book.tables.remove(&number);
        session.save()
    })
}

/// Runs the controller of the current step on its model, or on a simulated stage.
pub(crate) fn track(app: &Arc<App>, along: &Along) -> Result<(), Refusal> {
    let (number, name, model, controller) = {
        let session = app.session();
        let (number, name, model) = current(&session)?;
        let controller = designed(&session, number)?;
        (number, name, model, controller)
    };
    let stage = match &along.stage {
        Some(name) => Some(stage(app, name)?),
        None => None,
    };
    let range_um = pair("position", along.range_min_um, along.range_max_um)?;
    let mut given = Given::default();
    given.pair("range", range_um);
    given.flag("beyond-records", along.beyond_records);
    let usual = || stage.map_or_else(|| half_the_stroke(&controller), |stage| app.stages[stage].usual_um);
    let range_um = range_um.unwrap_or_else(usual);
    let beyond = beyond::simulated(&controller, range_um, along.beyond_records).map_err(Refusal::unusable)?;
    let own = Arc::clone(app);
    jobs::start(app, "tracking", move |progress| {
        let stage = stage.map(|stage| &own.stages[stage]);
        let (said, rows, on) = match stage {
            None => {
                progress.at(0.02, "on the model, along all references");
                let report = on_model(&model, &controller, range_um).map_err(Refusal::unusable)?;
                (
                    tracked_text(&format!("MODEL {name}"), &report),
                    report.rows,
                    format!("--model {name}"),
                )
            }
            Some(stage) => {
                progress.at(0.02, "on the simulated stage, along all references");
                let run = (stage.run)(&controller, range_um).map_err(Refusal::unusable)?;
                (run.said, run.rows, format!("--stage {} --alone", stage.name))
            }
        };
        progress.at(0.99, "");
        let command = format!("hysteron track {} {on}{}", file_name(number), given.words());
        let made = Made {
            rows: rows.iter().map(Found::of).collect(),
            ..Made::new(command, said + &beyond_text(&beyond))
        };
        let mut session = own.session();
        match stage {
            None => session.book.tracked.insert(number, made),
            Some(_) => session.book.on_stage.insert(number, made),
        };
        session.save()
    })
}

/// The number of a simulated stage.
fn stage(app: &App, name: &str) -> Result<usize, Refusal> {
    let names = || app.stages.iter().map(|stage| stage.name);
    names().position(|known| known == name).ok_or_else(|| {
        Refusal::bad(format!(
            "there is no stage `{}`; the simulated ones are {}",
            name.chars().take(40).collect::<String>(),
            names().collect::<Vec<_>>().join(", ")
        ))
    })
}

/// Makes the firmware's table of the controller of the current step.
pub(crate) fn table(app: &Arc<App>, bench: &Bench) -> Result<(), Refusal> {
    let (number, controller) = {
        let session = app.session();
        let (number, ..) = current(&session)?;
        (number, designed(&session, number)?)
    };
    let name = file_name(number);
    let (bench, given) = bench.read(&name)?;
    let own = Arc::clone(app);
    jobs::start(app, "making the table", move |_| {
        let exported = export(&controller, &bench).map_err(Refusal::unusable)?;
        let refused = |error| Refusal::unusable(format!("{name}: {error}"));
        let text = exported.table.to_toml().map_err(refused)?;
        let said = law_table_text(&controller, &exported);
        let mut session = own.session();
        let table = Session::table_name(number);
        folder::write_whole(&session.folder.join(&table), text.as_bytes())?;
        let command = format!("hysteron export {name}{} -o {table}", given.words());
        session.book.tables.insert(number, Made::new(command, said));
        session.save()
    })
}

/// What holds for a step where nobody wishes otherwise, and the loop of its controller over frequency.
pub(crate) fn view(app: &App, number: usize) -> Result<Value, Refusal> {
    let session = app.session();
    let model = session.model(number)?;
    let usual = json!({
        "volts": usual_volts(&model),
        "rate_hz": usual_rate_hz(&model),
        "margin": Wishes::default().margin,
    });
    let there = session.book.controllers.contains_key(&number);
    let controller = there.then(|| designed(&session, number)).transpose()?;
    Ok(json!({
        "usual": usual,
        "stages": app.stages.iter().map(|stage| json!({"name": stage.name, "usual_um": stage.usual_um})).collect::<Vec<_>>(),
        "curves": controller.as_ref().and_then(LoopCurves::of),
        "margin": controller.as_ref().and_then(|c| Some(c.feedback.as_ref()?.peak_sensitivity)),
        "told_to_hz": controller.as_ref().and_then(|c| Some(c.feedback.as_ref()?.told_to_hz)),
        "range_um": controller.as_ref().map(half_the_stroke),
    }))
}

/// What the stage answers to small signals, beside its model, as a step's data show it; nothing where no record does.
pub(crate) fn response(app: &App, number: usize) -> Result<Value, Refusal> {
    let (dataset, model) = {
        let mut session = app.session();
        (session.data_of(number)?, session.model(number)?)
    };
    let Some(found) = small_signal_response(&model, &dataset) else {
        return Ok(Value::Null);
    };
    let [phase_deg, modelled_phase_deg] = found.phases_deg();
    Ok(json!({
        "record": found.record,
        "frequency_hz": found.frequency_hz,
        "gain": found.measured.iter().map(|h| h.norm()).collect::<Vec<_>>(),
        "phase_deg": phase_deg,
        "deviation": found.deviation,
        "modelled_gain": found.modelled.iter().map(|h| h.norm()).collect::<Vec<_>>(),
        "modelled_phase_deg": modelled_phase_deg,
        "of_mean": found.gain,
        "told_to_hz": found.told_to_hz,
    }))
}
