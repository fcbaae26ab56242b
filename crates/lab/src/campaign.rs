//! The campaign on a stage of the user's own: its plan, the recordings that came back of it, and what was identified from them.
//!
//! All of it lies in `campaign/`, as the command line leaves it: `plan/`, `files/` as they came, `back/` as they are imported, `records/`.

use crate::App;
use crate::controller::Made;
use crate::error::Refusal;
use crate::folder::write_whole;
use crate::jobs::{self, Progress};
use crate::reading::{Reading, quoted};
use crate::session::Session;
use crate::uploads::{self, Found};
use crate::wish::Given as Options;
use hysteron_control::ControlError;
use hysteron_control::plan::came_back::{CameBack, Checked, Given};
use hysteron_control::plan::{FILE, Plan};
use hysteron_data::import::name_apart;
use hysteron_data::{Dataset, Overwrite, Record, write_dataset};
use hysteron_report::{came_back_text, option};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Its folders in the session, as the commands name them.
pub(crate) const FOLDER: &str = "campaign";
const PLAN: &str = "campaign/plan";
pub(crate) const FILES: &str = "campaign/files";
const BACK: &str = "campaign/back";
pub(crate) const RECORDS: &str = "campaign/records";

/// The plan's folder in the archive that is downloaded.
pub(crate) const ARCHIVED: &str = "plan";

/// All folders of a campaign.
pub(crate) const PARTS: [&str; 7] = [
    FOLDER,
    PLAN,
    "campaign/plan/pass1",
    "campaign/plan/pass2",
    FILES,
    BACK,
    RECORDS,
];

/// A campaign as it stands.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Campaign {
    /// The command that made its plan.
    pub(crate) command: String,
    /// Highest voltage, volts at the actuator.
    pub(crate) top_v: f64,
    /// Sample rate of the controller, hertz.
    pub(crate) rate_hz: f64,
    /// Its latency, microseconds; none where nobody has said it yet.
    pub(crate) latency_us: Option<f64>,
    /// Bandwidth of the sensor, hertz; none where it is not told.
    pub(crate) sensor_bandwidth_hz: Option<f64>,
    /// Whether records that began while the stage moved are taken.
    pub(crate) short_rests: bool,
    /// What is to be played in each pass, and how.
    pub(crate) passes: Vec<String>,
    /// How the files are read.
    pub(crate) reading: Reading,
    /// The files that came back, in the order in which they came.
    pub(crate) files: Vec<String>,
    /// What they are; none before they were looked at.
    pub(crate) back: Option<Back>,
    /// The controller that was designed from the records.
    pub(crate) controller: Option<Made>,
    /// Its run on a simulated stage.
    pub(crate) on_stage: Option<Made>,
    /// Its table for the firmware.
    pub(crate) table: Option<Made>,
}

/// What came back of the plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Back {
    /// The commands that say the same.
    command: String,
    /// The planned records.
    records: Vec<Planned>,
    /// What should be known of the recordings.
    notes: Vec<String>,
    /// Why they cannot be used yet, and what to do.
    refused: Vec<String>,
    /// What may spoil the controller, and what to do.
    doubts: Vec<String>,
    /// What was identified; none where they cannot be used yet.
    said: Option<String>,
    /// The pass that is to be recorded as well; none once all are there.
    next: Option<usize>,
}

/// A planned record, and what came back of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Planned {
    name: String,
    pass: usize,
    tells: String,
    seconds: f64,
    /// The recording that it was found in.
    from: Option<String>,
}

impl Campaign {
    /// Whether every pass was recorded, so that a controller can be designed.
    pub(crate) fn complete(&self) -> bool {
        let back = self.back.as_ref();
        back.is_some_and(|back| back.said.is_some() && back.next.is_none())
    }
}

/// What a plan is asked for; each as the option of `hysteron campaign` of its name.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Asked {
    top_v: Option<f64>,
    rate_hz: Option<f64>,
    latency_us: Option<f64>,
    seed: Option<u64>,
}

/// How what came back is looked at; each as the option of `hysteron campaign` of its name.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Looked {
    latency_us: Option<f64>,
    sensor_bandwidth_hz: Option<f64>,
    short_rests: bool,
}

/// The campaign of a session.
pub(crate) fn of(session: &mut Session) -> Result<&mut Campaign, Refusal> {
    let campaign = session.book.campaign.as_mut();
    campaign.ok_or_else(|| Refusal::conflict("there is no campaign yet; make its plan first"))
}

/// Takes out of the list what is not in the folder.
pub(crate) fn still_there(session: &mut Session) {
    let folder = session.folder.join(FILES);
    if let Some(campaign) = &mut session.book.campaign {
        campaign.files.retain(|name| folder.join(name).is_file());
    }
}

/// Makes a plan where there is none.
pub(crate) fn plan(app: &Arc<App>, asked: &Asked) -> Result<(), Refusal> {
    if app.session().book.campaign.is_some() {
        return Err(Refusal::conflict(
            "there is a plan already, which recordings may be of; end that campaign first",
        ));
    }
    let given = Given {
        top_v: asked.top_v,
        rate_hz: asked.rate_hz,
        latency_us: asked.latency_us,
        seed: asked.seed,
        ..Given::default()
    };
    given.protocol()?;
    let mut options = Options::default();
    options.number("top-v", asked.top_v);
    options.number("rate-hz", asked.rate_hz);
    options.number("latency-us", asked.latency_us);
    let seed = asked.seed.map_or(String::new(), |seed| format!(" --seed={seed}"));
    let command = format!("hysteron campaign{}{seed} -o {PLAN}", options.words());
    let own = Arc::clone(app);
    jobs::start(app, "planning", move |progress| {
        progress.at(0.1, "the commands of the first pass");
        let plan = given.plan()?;
        // The last look at whether it was stopped.
        progress.at(0.5, "its files");
        let folder = end(&own)?;
        write_pass(&folder, &plan, 0)?;
        let mut session = own.session();
        session.book.campaign = Some(Campaign {
            command,
            top_v: plan.top_v,
            rate_hz: plan.rate_hz,
            latency_us: plan.latency_us,
            passes: words(&plan),
            ..Campaign::default()
        });
        session.save()
    })
}

/// Takes the campaign away with all that came of it; where the session is.
fn end(app: &App) -> Result<PathBuf, Refusal> {
    let mut session = app.session();
    if session.book.campaign.take().is_some() {
        session.save()?;
    }
    // The book names nothing in it any more: what an end in the midst of this leaves is in nobody's way.
    let folder = session.folder.join(FOLDER);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(|error| Refusal::disk(&folder, &error))?;
    }
    Ok(session.folder.clone())
}

/// Ends the campaign, where nothing runs.
pub(crate) fn forget_all(app: &App) -> Result<(), Refusal> {
    of(&mut app.session())?;
    if app.job().running {
        return Err(Refusal::conflict("something is running; wait for it or stop it"));
    }
    end(app).map(drop)
}

/// What is to be played in each pass, as the command line says it; files are named as the archive has them.
fn words(plan: &Plan) -> Vec<String> {
    let passes = 0..plan.passes.len();
    passes.map(|pass| plan.words(pass, Path::new(ARCHIVED))).collect()
}

/// The files of a pass, the plan itself last.
fn write_pass(session: &Path, plan: &Plan, number: usize) -> Result<(), Refusal> {
    for (name, text) in plan.files(number)? {
        let file = session.join(PLAN).join(name);
        let folder = file.parent().unwrap_or(session);
        std::fs::create_dir_all(folder).map_err(|error| Refusal::disk(folder, &error))?;
        write_whole(&file, text.as_bytes())?;
    }
    Ok(())
}

/// The plan as it lies in the session.
pub(crate) fn planned(session: &Path) -> Result<Plan, Refusal> {
    let here = format!("{}/", session.display());
    Plan::read(&session.join(PLAN)).map_err(|error| Refusal::unusable(error.worded(option).replace(&here, "")))
}

/// Looks at what came back, identifies from it, and makes the next pass until all are there.
pub(crate) fn look(app: &Arc<App>, looked: &Looked) -> Result<(), Refusal> {
    let given = Given {
        latency_us: looked.latency_us,
        sensor_bandwidth_hz: looked.sensor_bandwidth_hz,
        short_rests: looked.short_rests,
        ..Given::default()
    };
    given.check_chain()?;
    let (session, before) = {
        let mut session = app.session();
        let campaign = of(&mut session)?.clone();
        (session.folder.clone(), campaign)
    };
    let own = Arc::clone(app);
    jobs::start(app, "looking at what came back", move |progress| {
        let looked_at = match before.files.is_empty() {
            true => None,
            false => Some(look_at(&session, &before, &given, progress)?),
        };
        // The last look at whether it was stopped.
        progress.at(0.95, "");
        if let Some((_, Some(came))) = &looked_at {
            write_dataset(&came.dataset, &session.join(RECORDS), Overwrite::Allow).map_err(Refusal::unusable)?;
            if let Some(number) = came.next {
                write_pass(&session, &came.plan, number)?;
            }
        }
        let mut session = own.session();
        let campaign = of(&mut session)?;
        (campaign.short_rests, campaign.sensor_bandwidth_hz) = (given.short_rests, given.sensor_bandwidth_hz);
        let (back, came) = looked_at.unzip();
        campaign.back = back;
        if let Some(came) = came.flatten() {
            campaign.latency_us = came.plan.latency_us;
            campaign.passes = words(&came.plan);
            // They were of other records.
            (campaign.controller, campaign.on_stage, campaign.table) = (None, None, None);
        }
        session.save()
    })
}

/// What the files are; and where they can be used, what was identified.
fn look_at(
    session: &Path,
    campaign: &Campaign,
    given: &Given,
    progress: &Progress,
) -> Result<(Back, Option<CameBack>), Refusal> {
    let (recorded, names) = recorded(session, campaign, progress)?;
    progress.at(0.5, "which is which");
    let file = Path::new(PLAN).join(FILE);
    let checked = Checked::new(planned(session)?, given, &file, &recorded)?;
    let mut notes: Vec<String> = recorded
        .notices
        .iter()
        .map(|n| format!("{}: {}", n.file, n.text))
        .collect();
    notes.extend(checked.remarks().iter().map(ToString::to_string));
    let mut doubts = Vec::new();
    if checked.is_wrong() {
        doubts.extend(
            hysteron_acquisition::mistakes(&recorded)
                .iter()
                .map(ToString::to_string),
        );
    }
    let records = checked.found().map(|found| Planned {
        name: found.planned.name.clone(),
        pass: found.pass,
        tells: found.planned.tells.clone(),
        seconds: found.planned.duration_s(),
        from: found
            .from
            .map(|from| names.get(from).map_or(from, String::as_str).to_owned()),
    });
    let mut back = Back {
        command: command(campaign, given),
        records: records.collect(),
        notes,
        refused: Vec::new(),
        doubts,
        said: None,
        next: None,
    };
    let came = checked.complete().and_then(|complete| {
        back.doubts
            .extend(complete.warnings().iter().map(|warning| warning.worded(option)));
        progress.at(0.6, "what they tell");
        complete.identify()
    });
    match came {
        Ok(came) => {
            back.doubts.extend(came.skew.iter().map(ToString::to_string));
            back.said = Some(came_back_text(&came));
            back.next = came.next;
            Ok((back, Some(came)))
        }
        Err(ControlError::Recordings { wrong }) => {
            back.refused = wrong.iter().map(|message| message.worded(option)).collect();
            Ok((back, None))
        }
        Err(error) => {
            back.refused = vec![error.worded(option)];
            Ok((back, None))
        }
    }
}

/// The files as a dataset: imported, written and read again as the command line does it; and the file of each record.
fn recorded(
    session: &Path,
    campaign: &Campaign,
    progress: &Progress,
) -> Result<(Dataset, BTreeMap<String, String>), Refusal> {
    let mut records: Vec<Record> = Vec::new();
    let mut names = Vec::new();
    for (index, name) in campaign.files.iter().enumerate() {
        progress.at(0.4 * index as f64 / campaign.files.len() as f64, name);
        let found = uploads::read(&session.join(FILES).join(name), name, &campaign.reading, &mut |_| ());
        if let Found::Records { records: found, .. } = found.map_err(Refusal::unusable)? {
            names.extend(found.iter().map(|_| name.clone()));
            records.extend(found);
        }
    }
    name_apart(&mut records, []);
    let names = records.iter().map(|record| record.file.clone()).zip(names).collect();
    let back = session.join(BACK);
    if back.exists() {
        std::fs::remove_dir_all(&back).map_err(|error| Refusal::disk(&back, &error))?;
    }
    let dataset = Dataset {
        name: "back".to_owned(),
        description: "imported".to_owned(),
        records,
        ..Dataset::default()
    };
    write_dataset(&dataset, &back, Overwrite::Allow).map_err(Refusal::unusable)?;
    Ok((uploads::read_native(&back)?, names))
}

/// The import and the look as they are typed in the session's folder.
fn command(campaign: &Campaign, given: &Given) -> String {
    let files = campaign.files.iter().map(|name| quoted(&format!("{FILES}/{name}")));
    let files = files.collect::<Vec<_>>().join(" ");
    let mut options = Options::default();
    options.number("latency-us", given.latency_us);
    options.number("sensor-bandwidth-hz", given.sensor_bandwidth_hz);
    options.flag("short-rests", given.short_rests);
    format!(
        "hysteron import {files}{} --overwrite -o {BACK} && hysteron campaign --plan {PLAN} --recorded {BACK}{} --overwrite -o {RECORDS}",
        campaign.reading.typed(),
        options.words()
    )
}

/// What is known of the bench from the project's recordings, for the fields of a plan.
pub(crate) fn usual(app: &App) -> Value {
    let session = app.session();
    let Some(dataset) = &session.dataset else {
        return json!({"top_v": null, "rate_hz": null, "latency_us": null});
    };
    let volts = dataset.records.iter().flat_map(|record| &record.voltage_v);
    let highest_v = volts.copied().fold(0.0, f64::max);
    let rate_hz = dataset.records.iter().map(Record::rate_hz).fold(0.0, f64::max);
    // A known delay has half a sample of hold in it.
    let latency_s = dataset.known.delay_s.map(|delay_s| delay_s - 0.5 / rate_hz);
    let rounded = |value: f64, step: f64| (value / step).round() * step;
    json!({
        "top_v": dataset.known.voltage_max_v.or((highest_v > 0.0).then(|| rounded(highest_v, 0.1))),
        "rate_hz": (rate_hz > 0.0).then(|| rounded(rate_hz, 1.0)),
        "latency_us": latency_s.filter(|s| *s >= 0.0).map(|s| rounded(1e6 * s, 0.01)),
    })
}
