//! The controller of a step: designed from its model, run on it, and as the table that the firmware takes.

use crate::App;
use crate::bench::Bench;
use crate::error::Refusal;
use crate::jobs;
use crate::session::Session;
use crate::wish::{Given, pair};
use crate::{folder, work};
use hysteron_control::design::beyond::{self, Asked};
use hysteron_control::design::curves::LoopCurves;
use hysteron_control::design::source::{Source, Wishes, design, usual_rate_hz, usual_volts};
use hysteron_control::design::{Controller, ReferenceKind};
use hysteron_control::expected::half_the_stroke;
use hysteron_control::export::export;
use hysteron_control::on_model::on_model;
use hysteron_identify::Model;
use hysteron_report::{design_text, law_table_text, tracked_text};
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
            ..usual
        };
        wishes.check().map_err(Refusal::unusable)?;
        Ok((wishes, given))
    }
}

/// Where the law is run along references, each as the option of `hysteron track` of its name.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Along {
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
        let text = designed.controller.to_toml().map_err(Refusal::unusable)?;
        // The last look at whether it was stopped.
        progress.at(0.99, "");
        let mut session = own.session();
        folder::write_whole(&file(&session, number), text.as_bytes())?;
        let command = format!("hysteron design {name}{} -o {}", given.words(), file_name(number));
        session.book.controllers.insert(number, Made { command, said });
        session.book.tracked.remove(&number);
        session.book.tables.remove(&number);
        session.save()
    })
}

/// Runs the controller of the current step on its model.
pub(crate) fn track(app: &Arc<App>, along: &Along) -> Result<(), Refusal> {
    let (number, name, model, controller) = {
        let session = app.session();
        let (number, name, model) = current(&session)?;
        let controller = designed(&session, number)?;
        (number, name, model, controller)
    };
    let range_um = pair("position", along.range_min_um, along.range_max_um)?;
    let mut given = Given::default();
    given.pair("range", range_um);
    given.flag("beyond-records", along.beyond_records);
    let range_um = range_um.unwrap_or_else(|| half_the_stroke(&controller));
    let asked = [Asked::position(&range_um, "--range LOW,HIGH")];
    beyond::granted(&mut controller.model.covered.clone(), &asked, along.beyond_records).map_err(Refusal::unusable)?;
    let own = Arc::clone(app);
    jobs::start(app, "tracking", move |progress| {
        progress.at(0.02, "on the model, along all references");
        let report = on_model(&model, &controller, range_um).map_err(Refusal::unusable)?;
        progress.at(0.99, "");
        let said = tracked_text(&format!("MODEL {name}"), &report);
        let command = format!("hysteron track {} --model {name}{}", file_name(number), given.words());
        let mut session = own.session();
        session.book.tracked.insert(number, Made { command, said });
        session.save()
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
        session.book.tables.insert(number, Made { command, said });
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
        "curves": controller.as_ref().and_then(LoopCurves::of),
        "margin": controller.as_ref().and_then(|c| Some(c.feedback.as_ref()?.peak_sensitivity)),
        "told_to_hz": controller.as_ref().and_then(|c| Some(c.feedback.as_ref()?.told_to_hz)),
        "range_um": controller.as_ref().map(half_the_stroke),
    }))
}
