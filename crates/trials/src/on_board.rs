//! The references of the table by a real board, judged by its own sensor.

use crate::adapted::adapted;
use crate::error::TrialError;
use crate::learning::Plan;
use crate::scans;
use crate::small_signals::Small;
use hysteron_board::capture::{Start, Wish, capture};
use hysteron_board::telemetry::{About, Capture};
use hysteron_board::upload::Upload;
use hysteron_board::{BoardError, Mode, Request, TABLE_POINTS};
use hysteron_control::adapted::{Adaptation, Adapted};
use hysteron_control::design::Controller;
use hysteron_control::design::beyond::{self, NotPlayed};
use hysteron_control::learning::{LEARNED, LearnedReference};
use hysteron_control::reference::{Reference, Shape};
use hysteron_control::response::Crossing;
use hysteron_identify::covered::Beyond;
use hysteron_tracking::scans::{LINES_HZ, ScanFigures};
use serde::Serialize;
use std::collections::BTreeMap;

/// The rate for which the lengths of settling and judging are worked out, hertz; a board of another rate gets as many seconds.
const USUAL_HZ: f64 = 50e3;

/// What a recording is longer than what is judged, seconds: the ramp from the safe level, 20 ms for the whole range, and as much again.
pub(crate) const RAMP_S: f64 = 0.04;

/// Length of the hold at the upper end of the range, seconds.
pub const HOLD_S: f64 = 10.0;
/// Time after the move before the hold is judged, seconds.
pub(crate) const AFTER_MOVE_S: f64 = 5e-3;
/// Its errors are averaged over so long, seconds: the sensor's noise is no creep.
pub(crate) const AVERAGED_S: f64 = 1e-3;

/// Name of the scans among the references that are left out.
const SCANS: &str = "scans";

/// What is asked of a board.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// The server of the board's telemetry, HOST:PORT.
    pub from: &'a str,
    /// Which of the board's tables runs.
    pub bank: u8,
    /// Lowest and highest reference, micrometres.
    pub range_um: [f64; 2],
    /// Whether references may leave what the records cover.
    pub beyond_records: bool,
    /// Corrections of each reference that is learned, at most; none for no learning.
    pub iterations: Option<usize>,
}

/// As of a simulated stage, with what a board cannot tell left out.
#[derive(Debug, Clone, Serialize)]
pub struct BoardReport {
    /// The board's name.
    pub stage: String,
    /// The table that ran.
    pub table_sha256: String,
    /// As identified; none of a rigid stage.
    pub first_mode_hz: Option<f64>,
    /// Peak to peak of the references, micrometres.
    pub stroke_um: f64,
    /// Whose position is judged: the sensor's.
    pub position: &'static str,
    /// Open loop, and closed where there is feedback.
    pub controllers: Vec<BoardFigures>,
    /// References that were learned run by run.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub learned: Vec<LearnedReference>,
    /// Of a board with both axes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scans: Vec<ScanFigures>,
    /// Ticks whose samples did not come.
    pub lost: u64,
    /// Bounds of what the law learns of gain, zero and lag; none where it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<Adaptation>,
    /// What of the references leaves the records, as was granted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beyond: Vec<Beyond>,
    /// References and scans that were left out since they leave the records.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_played: Vec<NotPlayed>,
}

/// What a loop reached.
#[derive(Debug, Clone, Serialize)]
pub struct BoardFigures {
    /// The law.
    pub name: &'static str,
    /// `open` or `closed`.
    #[serde(rename = "loop")]
    pub loop_kind: &'static str,
    /// Rms of reference less measured position, percent of peak to peak, by reference.
    pub rms_percent: BTreeMap<String, f64>,
    /// What the law had learned at the end of each of these runs, one after the other; empty where it does not learn.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub adapted: BTreeMap<String, Adapted>,
    /// Largest error from 5 ms after a move to the range's upper end to 10 s after it, averaged over a millisecond.
    pub creep_peak_percent: f64,
    /// Where the position lags the reference by 30 degrees, hertz.
    pub lag30_hz: Option<f64>,
    /// Where the position is 3 dB smaller than the reference, hertz.
    pub minus3db_hz: Option<f64>,
    /// At rest, rms, the sensor's with it.
    pub noise_nm: Option<f64>,
}

/// Runs open and closed loop on every reference within the records, one recording each, and on scans where the board has both axes; then
/// learns, where that is asked for. Progress gets what runs and the share done, 0 to 1.
///
/// # Errors
/// Positions beyond the records that were not granted, and records without any of the frequencies, refused before the board is asked for
/// anything; a board that does not answer, stops, or sends too little.
pub fn track(
    controller: &Controller,
    asked: &Asked<'_>,
    progress: &dyn Fn(&str, f64),
) -> Result<BoardReport, TrialError> {
    let range_um = asked.range_um;
    let programme = beyond::real(controller, range_um, asked.beyond_records)?;
    let scans_beyond = beyond::frequency(controller, range_um, LINES_HZ).filter(|_| !asked.beyond_records);
    let loops: &[(&str, bool)] = match controller.feedback {
        Some(_) => &[("open", false), ("closed", true)],
        None => &[("open", false)],
    };
    let mut report = BoardReport {
        stage: String::new(),
        table_sha256: String::new(),
        first_mode_hz: controller.model.linear.modes.first().map(|mode| mode.frequency_hz),
        stroke_um: 0.0,
        position: "measured",
        controllers: Vec::new(),
        learned: Vec::new(),
        scans: Vec::new(),
        lost: 0,
        adaptation: controller.adaptation.clone(),
        beyond: programme.granted,
        not_played: programme.not_played,
    };
    // Learning takes about as long as a loop.
    let parts = (loops.len() + usize::from(asked.iterations.is_some())) as f64;
    let looped = |feedback| Looped {
        from: asked.from,
        bank: asked.bank,
        feedback,
    };
    let mut rate_hz = USUAL_HZ;
    let mut axes = 1;
    for (l, &(loop_kind, feedback)) in loops.iter().enumerate() {
        let looped = looped(feedback);
        let progress =
            |what: &str, share: f64| progress(&format!("{what}, {loop_kind} loop"), (l as f64 + share) / parts);
        let (figures, about) = looped.figures((range_um, &programme.played), loop_kind, &mut report, &progress)?;
        report.controllers.push(figures);
        axes = about.hello.axes;
        if axes > 1 && scans_beyond.is_none() {
            let scans = scans::on_board(&looped, range_um, loop_kind, &mut report.lost, &progress)?;
            report.scans.extend(scans);
        }
        rate_hz = f64::from(about.hello.sample_rate_hz);
    }
    let scans = |beyond| NotPlayed {
        reference: SCANS,
        beyond,
    };
    report.not_played.extend(scans_beyond.filter(|_| axes > 1).map(scans));
    if let Some(most) = asked.iterations {
        let plan = Plan {
            controller,
            range_um,
            most,
            references: &programme.played,
        };
        report.learned = plan.on_board(&looped(false), rate_hz, &mut report.lost, &|name, number| {
            let before = LEARNED.iter().position(|learned| *learned == name).unwrap_or(0) as f64;
            let share = (before + number as f64 / (most + 1) as f64) / LEARNED.len() as f64;
            progress(
                &format!("learning {name}, run {number}"),
                (loops.len() as f64 + share) / parts,
            );
        })?;
    }
    Ok(report)
}

/// A board's bank, open loop or closed.
pub(crate) struct Looped<'a> {
    /// The server of the board's telemetry.
    pub from: &'a str,
    pub bank: u8,
    pub feedback: bool,
}

/// Points as often a second as they are to be repeated, for so many seconds.
pub(crate) fn along(points: &Upload, frequency_hz: f64, seconds: f64, feedback: bool) -> Request {
    Request {
        shape: hysteron_board::Shape::Table,
        frequency_hz,
        range_um: Some(points.range_um),
        seconds,
        feedforward: true,
        feedback,
    }
}

/// Points that are all the upper end of a range.
pub(crate) fn held(range_um: [f64; 2]) -> Upload {
    Upload::new(range_um, [u16::MAX; TABLE_POINTS])
}

impl Looped<'_> {
    /// All figures of a loop, and the board with the table that ran.
    fn figures(
        &self,
        (range_um, references): ([f64; 2], &[(&'static str, Shape)]),
        loop_kind: &'static str,
        report: &mut BoardReport,
        progress: &dyn Fn(&str, f64),
    ) -> Result<(BoardFigures, About), TrialError> {
        // The references, the small multisine, the rest, and the hold, which takes as long as all of them.
        let runs = 2.0 * (references.len() + 2) as f64;
        let (mut rms_percent, mut adapted_by) = (BTreeMap::new(), BTreeMap::new());
        let mut said = None;
        for (r, &(name, shape)) in references.iter().enumerate() {
            let judged = Judged::of(shape);
            let request = Request {
                shape: crate::on_chip::of_the_board(shape),
                frequency_hz: shape.frequency_hz(),
                range_um: Some(range_um),
                seconds: RAMP_S + judged.length_s(),
                feedforward: true,
                feedback: self.feedback,
            };
            let captured = self.run(request, None, &|part| progress(name, (r as f64 + part) / runs))?;
            let (rms_um, stroke_um) = judged.error(&captured, name)?;
            rms_percent.insert(name.to_owned(), 100.0 * rms_um / stroke_um);
            report.stroke_um = report.stroke_um.max(stroke_um);
            report.lost += captured.counts.lost;
            report.stage = captured.about.board().to_owned();
            let about = captured.about;
            let learned = adapted(captured.learned(), about.hello.sample_rate_hz);
            adapted_by.extend(learned.map(|learned| (name.to_owned(), learned)));
            said = captured.pieces.last().map(|piece| about.with(piece.table)).or(said);
        }
        let about = said.ok_or(BoardError::NoSamples { bytes: 0 })?;
        let table = about.hello;
        report.table_sha256 = hysteron_board::telemetry::hex(&table.hash);
        let small = Small::about(self, &table, range_um);
        let done = |runs_done: usize, part: f64| (runs_done as f64 + part) / runs;
        let part = |part| progress("small multisine", done(references.len(), part));
        let response = small.response(&mut report.lost, &part)?;
        let part = |part| progress("at rest", done(references.len() + 1, part));
        let noise_nm = small.noise_nm(&mut report.lost, &part)?;
        let part = |part| progress("hold", 0.5 + 0.5 * part);
        let creep_peak_percent = self.hold(range_um, &mut report.lost, &part)?;
        let frequency_hz = |crossing: Option<Crossing>| crossing.map(|crossing| crossing.frequency_hz);
        let figures = BoardFigures {
            name: "complete",
            loop_kind,
            rms_percent,
            adapted: adapted_by,
            creep_peak_percent,
            lag30_hz: frequency_hz(response.lag_30_deg()),
            minus3db_hz: frequency_hz(response.minus_3_db()),
            noise_nm,
        };
        Ok((figures, about))
    }

    fn run(&self, request: Request, upload: Option<Upload>, progress: &dyn Fn(f64)) -> Result<Capture, TrialError> {
        let mut axes = self.axes(&[(request, upload)], progress)?.into_iter();
        Ok(axes.next().ok_or(BoardError::NoSamples { bytes: 0 })?)
    }

    /// A reference an axis, for as long as the first one's; an axis without one stands still.
    pub(crate) fn axes(
        &self,
        references: &[(Request, Option<Upload>)],
        progress: &dyn Fn(f64),
    ) -> Result<Vec<Capture>, TrialError> {
        let seconds = references.first().map_or(0.0, |(request, _)| request.seconds);
        let wish = |&(request, upload): &(Request, Option<Upload>)| {
            Some(Wish {
                bank: self.bank,
                request,
                upload,
            })
        };
        let wishes: Vec<Option<Wish>> = references.iter().map(wish).collect();
        Ok(capture(self.from, seconds, Start::Playing(&wishes), &mut |part| {
            progress(part)
        })?)
    }

    /// Along uploaded points.
    pub(crate) fn along(
        &self,
        points: Upload,
        frequency_hz: f64,
        seconds: f64,
        progress: &dyn Fn(f64),
    ) -> Result<Capture, TrialError> {
        self.run(
            along(&points, frequency_hz, seconds, self.feedback),
            Some(points),
            progress,
        )
    }

    /// Largest error of a hold, percent of the range.
    fn hold(&self, range_um: [f64; 2], lost: &mut u64, progress: &dyn Fn(f64)) -> Result<f64, TrialError> {
        let captured = self.along(held(range_um), 1.0, RAMP_S + HOLD_S, progress)?;
        *lost += captured.counts.lost;
        let judged = Judged {
            from_s: AFTER_MOVE_S,
            length_s: HOLD_S - AFTER_MOVE_S,
        };
        let rate_hz = f64::from(captured.about.hello.sample_rate_hz);
        let ticks = judged.ticks(&captured, "hold")?;
        let errors: Vec<f64> = ticks.iter().map(|tick| tick.reference_um - tick.measured_um).collect();
        Ok(peak_percent(&errors, rate_hz, range_um))
    }
}

/// Largest mean over a millisecond, percent of a range.
pub(crate) fn peak_percent(errors_um: &[f64], rate_hz: f64, [low_um, high_um]: [f64; 2]) -> f64 {
    let length = (AVERAGED_S * rate_hz).round().max(1.0) as usize;
    let means = errors_um.chunks_exact(length);
    let means = means.map(|chunk| (chunk.iter().sum::<f64>() / length as f64).abs());
    100.0 * means.fold(0.0, f64::max) / (high_um - low_um)
}

/// A judged tick.
#[derive(Clone, Copy)]
pub(crate) struct Tick {
    /// Since the reference began.
    pub number: usize,
    pub reference_um: f64,
    pub measured_um: f64,
    /// A real board does not say.
    pub true_um: Option<f64>,
}

/// Which part of a run is judged: from so many seconds after the loop ran, whole periods.
pub(crate) struct Judged {
    from_s: f64,
    length_s: f64,
}

impl Judged {
    /// As on a simulated stage.
    pub(crate) fn of(shape: Shape) -> Self {
        let Reference {
            samples_um,
            judged_from,
            ..
        } = shape.reference([0.0, 1.0], 1.0 / USUAL_HZ);
        Self {
            from_s: judged_from as f64 / USUAL_HZ,
            length_s: (samples_um.len() - judged_from) as f64 / USUAL_HZ,
        }
    }

    /// From the reference's beginning to the end of what is judged, seconds.
    pub(crate) fn length_s(&self) -> f64 {
        self.from_s + self.length_s
    }

    /// Rms of reference less measured position, and the reference's peak to peak, micrometres.
    fn error(&self, captured: &Capture, name: &str) -> Result<(f64, f64), TrialError> {
        let ticks = self.ticks(captured, name)?;
        let squares: f64 = ticks
            .iter()
            .map(|tick| (tick.reference_um - tick.measured_um).powi(2))
            .sum();
        let reference = || ticks.iter().map(|tick| tick.reference_um);
        let (low, high) = (
            reference().fold(f64::INFINITY, f64::min),
            reference().fold(f64::NEG_INFINITY, f64::max),
        );
        if high <= low {
            return Err(TrialError::Still { name: name.to_owned() });
        }
        Ok(((squares / ticks.len() as f64).sqrt(), high - low))
    }

    /// The ticks that are judged, as far as they came.
    pub(crate) fn ticks(&self, captured: &Capture, name: &str) -> Result<Vec<Tick>, TrialError> {
        let rate_hz = f64::from(captured.about.hello.sample_rate_hz);
        let ticks = captured.pieces.iter().flat_map(|piece| {
            let recording = &piece.recording;
            let numbered = (piece.start_tick..).zip(&recording.frames);
            numbered
                .zip(&recording.position_um)
                .map(|((tick, frame), &measured_um)| (tick, frame, measured_um))
        });
        no_fault(captured, name)?;
        let began = ticks
            .clone()
            .find(|(_, frame, _)| frame.mode() == Mode::Running)
            .map_or(u64::MAX, |(tick, ..)| tick);
        let first = began.saturating_add((self.from_s * rate_hz).round() as u64);
        let end = first.saturating_add((self.length_s * rate_hz).round() as u64);
        let judged = ticks.filter(|(tick, frame, _)| (first..end).contains(tick) && frame.mode() == Mode::Running);
        let judged: Vec<Tick> = judged
            .map(|(tick, frame, measured_um)| Tick {
                number: (tick - began) as usize,
                reference_um: f64::from(frame.reference_um),
                measured_um,
                true_um: None,
            })
            .collect();
        enough(judged.len() as u64, end - first, name)?;
        Ok(judged)
    }
}

/// Refuses a run of which less than half came: half may be lost to a slow probe, less tells little of whole periods.
pub(crate) fn enough(count: u64, wanted: u64, name: &str) -> Result<(), TrialError> {
    if 2 * count < wanted {
        return Err(TrialError::TooFew {
            name: name.to_owned(),
            wanted,
            came: count,
        });
    }
    Ok(())
}

/// Refuses a recording in which the board stopped.
pub(crate) fn no_fault(captured: &Capture, name: &str) -> Result<(), TrialError> {
    let faults = captured.pieces.iter().find_map(|piece| {
        let mut numbered = (piece.start_tick..).zip(&piece.recording.frames);
        numbered.find_map(|(tick, frame)| Some((tick, frame.fault()?)))
    });
    match faults {
        None => Ok(()),
        Some((tick, fault)) => Err(TrialError::Stopped {
            name: name.to_owned(),
            tick,
            fault,
        }),
    }
}
