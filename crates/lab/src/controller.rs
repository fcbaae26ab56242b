//! A controller, of a step or of the campaign: designed, run, and as the table that the firmware takes.

use crate::App;
use crate::bench::Bench;
use crate::error::Refusal;
use crate::jobs;
use crate::place::{Of, On, Origin, Place};
use crate::session::Session;
use crate::wish::{Given, pair};
use crate::{folder, image, uploads};
use hysteron_control::design::beyond;
use hysteron_control::design::curves::{LoopCurves, MeasuredLoop};
use hysteron_control::design::source::{Source, Wishes, design, usual_rate_hz, usual_volts};
use hysteron_control::design::{Controller, ReferenceKind};
use hysteron_control::expected::{Row, half_the_stroke};
use hysteron_control::export::export;
use hysteron_control::on_model::on_model;
use hysteron_identify::small_signal_response;
use hysteron_report::{Light, beyond_text, design_lights, design_text, law_table_text, reference_name, tracked_text};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
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
        wishes.check()?;
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

/// The controller of a place.
fn designed(session: &Session, place: Place) -> Result<Controller, Refusal> {
    if !place.has_one(&session.book) {
        let whose = match place {
            Place::Step(_) => "this step",
            Place::Campaign => "the campaign",
        };
        return Err(Refusal::conflict(format!(
            "{whose} has no controller yet; design one first"
        )));
    }
    Ok(Controller::read(&session.folder.join(place.controller()))?)
}

/// Designs a controller; what was made of the one before goes with it.
pub(crate) fn make(app: &Arc<App>, of: Of, wished: &Wished) -> Result<(), Refusal> {
    let (place, name, origin) = {
        let session = app.session();
        let place = Place::of(&session, of)?;
        let (name, origin) = place.origin(&session)?;
        (place, name, origin)
    };
    let (wishes, given) = wished.read()?;
    let own = Arc::clone(app);
    jobs::start(app, "designing", move |progress| {
        progress.at(0.02, "feedforward and feedback, some seconds");
        let dataset;
        let source = match &origin {
            Origin::Model(model) => Source::Model { model, along: &[] },
            Origin::Records(folder) => {
                dataset = uploads::read_native(folder)?;
                Source::Records(&dataset)
            }
        };
        let designed = design(&source, &wishes)?;
        let said = design_text(&designed, wishes.margin)?;
        let lights = design_lights(&designed, wishes.margin);
        let text = designed.controller.to_toml()?;
        // The last look at whether it was stopped.
        progress.at(0.99, "");
        let mut session = own.session();
        folder::write_whole(&session.folder.join(place.controller()), text.as_bytes())?;
        let command = format!("hysteron design {name}{} -o {}", given.words(), place.controller());
        let made = Made {
            lights,
            ..Made::new(command, said)
        };
        place.put_controller(&mut session.book, made);
        session.save()
    })
}

/// Runs a controller on the model that it was designed from, or on a simulated stage.
pub(crate) fn track(app: &Arc<App>, of: Of, along: &Along) -> Result<(), Refusal> {
    let (place, name, origin, controller) = {
        let session = app.session();
        let place = Place::of(&session, of)?;
        let (name, origin) = place.origin(&session)?;
        (place, name, origin, designed(&session, place)?)
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
    let beyond = beyond::simulated(&controller, range_um, along.beyond_records)?;
    let own = Arc::clone(app);
    jobs::start(app, "tracking", move |progress| {
        let stage = stage.map(|stage| &own.stages[stage]);
        let (said, rows, on) = match (stage, &origin) {
            (None, Origin::Records(_)) => {
                return Err(Refusal::unusable(
                    "the records of a campaign are no model to run on; choose a simulated stage",
                ));
            }
            (None, Origin::Model(model)) => {
                progress.at(0.02, "on the model, along all references");
                let report = on_model(model, &controller, range_um)?;
                (
                    tracked_text(&format!("MODEL {name}"), &report),
                    report.rows,
                    format!("--model {name}"),
                )
            }
            (Some(stage), _) => {
                progress.at(0.02, "on the simulated stage, along all references");
                let run = (stage.run)(&controller, range_um).map_err(Refusal::unusable)?;
                (run.said, run.rows, format!("--stage {} --alone", stage.name))
            }
        };
        progress.at(0.99, "");
        let command = format!("hysteron track {} {on}{}", place.controller(), given.words());
        let made = Made {
            rows: rows.iter().map(Found::of).collect(),
            ..Made::new(command, said + &beyond_text(&beyond))
        };
        let mut session = own.session();
        let on = stage.map_or(On::Model, |_| On::Stage);
        place.put_run(&mut session.book, on, made);
        session.save()
    })
}

/// The number of a simulated stage.
pub(crate) fn stage(app: &App, name: &str) -> Result<usize, Refusal> {
    let names = || app.stages.iter().map(|stage| stage.name);
    names().position(|known| known == name).ok_or_else(|| {
        Refusal::bad(format!(
            "there is no stage `{}`; the simulated ones are {}",
            name.chars().take(40).collect::<String>(),
            names().collect::<Vec<_>>().join(", ")
        ))
    })
}

/// Makes the firmware's table of a controller.
pub(crate) fn table(app: &Arc<App>, of: Of, bench: &Bench) -> Result<(), Refusal> {
    let (place, controller) = {
        let session = app.session();
        let place = Place::of(&session, of)?;
        (place, designed(&session, place)?)
    };
    let name = place.controller();
    let (bench, given) = bench.read(&name)?;
    let own = Arc::clone(app);
    jobs::start(app, "making the table", move |_| {
        let exported = export(&controller, &bench)?;
        let refused = |error| Refusal::unusable(format!("{name}: {error}"));
        let text = exported.table.to_toml().map_err(refused)?;
        let said = law_table_text(&controller, &exported);
        let mut session = own.session();
        let table = place.table();
        image::forget(&session, place);
        folder::write_whole(&session.folder.join(&table), text.as_bytes())?;
        let command = format!("hysteron export {name}{} -o {table}", given.words());
        place.put_table(&mut session.book, Made::new(command, said));
        session.save()
    })
}

/// What holds where nobody wishes otherwise, and the loop of a controller over frequency, also through what the stage answered where the
/// data of its step tell.
pub(crate) fn view(app: &App, place: Place) -> Result<Value, Refusal> {
    let mut session = app.session();
    let (volts, rate_hz) = match (place, &session.book.campaign) {
        (Place::Step(number), _) => {
            let model = session.model(number)?;
            (usual_volts(&model), usual_rate_hz(&model))
        }
        (Place::Campaign, Some(campaign)) => ([0.0, campaign.top_v], Some(campaign.rate_hz)),
        (Place::Campaign, None) => return Err(Refusal::absent("there is no campaign")),
    };
    let usual = json!({ "volts": volts, "rate_hz": rate_hz, "margin": Wishes::default().margin });
    let there = place.has_one(&session.book);
    let controller = there.then(|| designed(&session, place)).transpose()?;
    let of_step = match (place, &controller) {
        (Place::Step(number), Some(_)) => Some((session.data_of(number)?, session.model(number)?)),
        _ => None,
    };
    drop(session);
    let measured = of_step.and_then(|(dataset, model)| {
        let found = small_signal_response(&model, &dataset)?;
        MeasuredLoop::of(controller.as_ref()?, &found)
    });
    Ok(json!({
        "usual": usual,
        "stages": app.stages.iter().map(|stage| json!({"name": stage.name, "usual_um": stage.usual_um})).collect::<Vec<_>>(),
        "curves": controller.as_ref().and_then(LoopCurves::of),
        "measured": measured,
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
