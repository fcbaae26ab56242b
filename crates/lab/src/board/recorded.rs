//! Recordings of a board: as a page asks for them, as they come, and how they go to the data.

use crate::error::Refusal;
use crate::reading::MANIFEST;
use crate::session::Session;
use crate::wish::{Given, pair};
use crate::{App, bring, grow};
use hysteron_board::Request;
use hysteron_board::capture::Wish;
use hysteron_board::shapes::{Named, SHAPES};
use hysteron_board::upload::Upload;
use hysteron_data::{Manifest, Role, write_record_to};
use hysteron_trials::recording::{Followed, followed, recorded};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::sync::Arc;

/// A recording, as it was asked for.
#[derive(Debug, Clone)]
pub(super) struct Recording {
    pub(super) words: String,
    pub(super) command: String,
    axis: usize,
}

/// What a recording came to.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Run {
    /// The reference in words.
    words: String,
    /// The first letters of its table's hash.
    table: String,
    samples: u64,
    lost: u64,
    #[serde(flatten)]
    followed: Option<Followed>,
}

/// What the board is to play; each as the option of `hysteron board record` of its name.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wanted {
    bank: Option<u8>,
    shape: String,
    /// One period of a reference of one's own, a position a line, instead of a shape.
    trajectory: Option<String>,
    hz: Option<f64>,
    low_um: Option<f64>,
    high_um: Option<f64>,
    seconds: Option<f64>,
    #[serde(default)]
    no_feedback: bool,
    #[serde(default)]
    no_feedforward: bool,
    #[serde(default)]
    axis: usize,
}

/// Usual frequency and length of a recording, as the command's.
const USUAL_HZ: f64 = 100.0;
const USUAL_S: f64 = 1.0;

impl Wanted {
    /// The wish of each axis, and the recording that it is.
    pub(super) fn read(&self, from: &str) -> Result<(Vec<Option<Wish>>, f64, Recording), Refusal> {
        if self.axis > 1 {
            return Err(Refusal::bad(format!("axis = {}: allowed are 0 and 1", self.axis)));
        }
        let points = self.trajectory.as_deref().filter(|text| !text.trim().is_empty());
        let points = points.map(Upload::parse).transpose().map_err(Refusal::unusable)?;
        let named = Named::find(&self.shape).ok_or_else(|| {
            let known = SHAPES.map(|known| known.name).join(", ");
            let given: String = self.shape.chars().take(40).collect();
            Refusal::bad(format!("there is no reference `{given}`; there are {known}"))
        })?;
        let given_um = pair("reference", self.low_um, self.high_um)?;
        let (hz, seconds) = (self.hz.unwrap_or(USUAL_HZ), self.seconds.unwrap_or(USUAL_S));
        let request = Request {
            shape: named.shape,
            frequency_hz: hz,
            range_um: given_um,
            seconds,
            feedforward: !self.no_feedforward,
            feedback: !self.no_feedback,
        };
        let shape = named.name;
        let mut given = Given::default();
        given.number("bank", self.bank.map(f64::from));
        given.number("hz", Some(hz));
        given.number("low", given_um.map(|[low, _]| low).filter(|_| points.is_none()));
        given.number("high", given_um.map(|[_, high]| high).filter(|_| points.is_none()));
        given.flag("no-feedback", self.no_feedback);
        given.flag("no-feedforward", self.no_feedforward);
        given.flag("axis y", self.axis == 1);
        given.number("seconds", Some(seconds));
        let reference = match points {
            Some(_) => "--trajectory=FILE.csv".to_owned(),
            None => format!("--shape={shape}"),
        };
        let parts = match (self.no_feedforward, self.no_feedback) {
            (false, false) => "",
            (false, true) => ", open loop",
            (true, false) => ", feedback alone",
            (true, true) => ", neither part",
        };
        let recording = Recording {
            words: format!(
                "{} {hz} Hz{parts}",
                points.as_ref().map_or(shape, |_| "reference of a file")
            ),
            command: format!(
                "hysteron board record --from {from} --run {reference}{} -o recorded",
                given.words()
            ),
            axis: self.axis,
        };
        let mut wishes = vec![None; self.axis];
        wishes.push(Some(Wish::new(self.bank.unwrap_or(0), request, points)));
        Ok((wishes, seconds, recording))
    }
}

/// A recording that has ended becomes what it came to.
pub(super) fn take_in(app: &App) -> bool {
    let mut bench = app.bench();
    let Some(on) = bench.as_mut() else {
        return false;
    };
    let Some(captured) = on.live.recorded() else {
        return false;
    };
    let Some(asked) = on.asked.take() else {
        return false;
    };
    let recorded = captured.map_err(|error| error.to_string()).and_then(|captures| {
        let followed = captures.get(asked.axis).and_then(followed);
        recorded(captures, asked.axis)
            .map(|recorded| (recorded, followed))
            .map_err(|error| error.to_string())
    });
    match recorded {
        Ok((recorded, followed)) => {
            let tables = recorded.counted.tables_sha256.first();
            on.runs.push(Run {
                words: asked.words,
                table: tables.map_or(String::new(), |hash| hash.chars().take(8).collect()),
                samples: recorded.counted.samples,
                lost: recorded.counted.lost,
                followed,
            });
            on.fault = recorded
                .fault
                .map(|(tick, fault)| format!("the board stopped with a fault at tick {tick}: {fault:?}"));
            on.came = Some(recorded);
        }
        Err(reason) => on.fault = Some(reason),
    }
    true
}

/// What was recorded goes to the data, as files that are brought do: a record a piece without a gap. Where the data begin with it, the
/// board's known delay is theirs.
pub(super) fn keep(app: &Arc<App>, role: Role) -> Result<(), Refusal> {
    let mut recorded = {
        let bench = app.bench();
        let on = bench
            .as_ref()
            .ok_or_else(|| Refusal::conflict("no board is connected"))?;
        let came = on.came.as_ref();
        came.ok_or_else(|| Refusal::conflict("nothing was recorded that is not kept"))?
            .dataset
            .clone()
    };
    let (folder, first) = {
        let session = app.session();
        (session.uploads.folder.clone(), takes_known(&session))
    };
    let come = |bytes: &[u8]| -> Result<tempfile::NamedTempFile, Refusal> {
        let mut beside = tempfile::NamedTempFile::new_in(&folder).map_err(|error| Refusal::disk(&folder, &error))?;
        beside
            .write_all(bytes)
            .map_err(|error| Refusal::disk(&folder, &error))?;
        Ok(beside)
    };
    for record in &mut recorded.records {
        let mut bytes = Vec::new();
        write_record_to(record, &mut bytes).map_err(Refusal::unusable)?;
        record.file = bring::keep_recorded(app, come(&bytes)?, role)?;
        record.role = role;
    }
    if first {
        let manifest = Manifest::of(&recorded)
            .render(MANIFEST.as_ref())
            .map_err(Refusal::unusable)?;
        bring::keep(app, MANIFEST.to_owned(), come(manifest.as_bytes())?, None)?;
    }
    let records = recorded.records.len();
    if let Some(on) = app.bench().as_mut() {
        on.came = None;
    }
    let (begun, others) = {
        let session = app.session();
        let waiting = session
            .uploads
            .usable(&session.book, |stands| stands == crate::book::Stands::Waits);
        (session.dataset.is_some(), waiting.len() > records)
    };
    match (begun, others) {
        // What a person has not looked at yet is not taken with it.
        (_, true) => Ok(()),
        (true, false) => grow::add_files(app),
        (false, false) => grow::take_files(app),
    }
}

/// Whether what is known of a recording's board comes to the data with it: where they begin with it alone, and nobody has said otherwise.
pub(crate) fn takes_known(session: &Session) -> bool {
    let waiting = session.uploads.usable(&session.book, |_| true);
    session.book.generations.is_empty() && session.uploads.manifest().is_none() && waiting.is_empty()
}
