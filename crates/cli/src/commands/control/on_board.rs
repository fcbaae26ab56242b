//! `hysteron track --board`: the references of the table by a real board, judged by its own sensor.

use crate::commands::board::hex;
use crate::commands::control::learning::{self, Plan};
use crate::commands::control::scans;
use crate::commands::control::small_signals::Small;
use crate::commands::control::track::{TrackArgs, cells, first_mode, heads, hertz, of_the_board, scan_rows};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use hysteron_board::capture::{Start, Wish, capture};
use hysteron_board::telemetry::{About, Capture};
use hysteron_board::upload::Upload;
use hysteron_board::{BoardError, Mode, Request, TABLE_POINTS, whole_range_um};
use hysteron_control::design::Controller;
use hysteron_control::learning::{LEARNED, LearnedReference};
use hysteron_control::reference::{Reference, SHAPES, Shape};
use hysteron_control::response::Crossing;
use hysteron_tracking::scans::{LINES_HZ, ScanFigures};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The rate for which the lengths of settling and judging are worked out, hertz; a board of another rate gets as many seconds.
const USUAL_HZ: f64 = 50e3;

/// What a recording is longer than what is judged, seconds: the ramp from the safe level, 20 ms for the whole range, and as much again.
pub(super) const RAMP_S: f64 = 0.04;

/// Length of the hold at the upper end of the range, seconds.
pub(super) const HOLD_S: f64 = 10.0;
/// Time after the move before the hold is judged, seconds.
pub(super) const AFTER_MOVE_S: f64 = 5e-3;
/// Its errors are averaged over so long, seconds: the sensor's noise is no creep.
pub(super) const AVERAGED_S: f64 = 1e-3;

/// As of a simulated stage, with what a board cannot tell left out.
#[derive(Serialize)]
struct Answer {
    stage: String,
    table_sha256: String,
    first_mode_hz: Option<f64>,
    stroke_um: f64,
    position: &'static str,
    controllers: Vec<Figures>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    learned: Vec<LearnedReference>,
    /// Of a board with both axes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    scans: Vec<ScanFigures>,
    /// Ticks whose samples did not come.
    lost: u64,
}

#[derive(Serialize)]
struct Figures {
    name: &'static str,
    #[serde(rename = "loop")]
    loop_kind: &'static str,
    rms_percent: BTreeMap<String, f64>,
    /// Largest error from 5 ms after a move to the range's upper end to 10 s after it, averaged over a millisecond.
    creep_peak_percent: f64,
    lag30_hz: Option<f64>,
    minus3db_hz: Option<f64>,
    noise_nm: Option<f64>,
}

/// Runs open and closed loop on every reference, one recording each, and on scans where the board has both axes; then learns, where that
/// is asked for.
pub(super) fn track(
    args: &TrackArgs,
    from: &str,
    range_um: Option<[f64; 2]>,
    controller: &Controller,
) -> Result<Done, CliError> {
    let loops: &[(&str, bool)] = match controller.feedback {
        Some(_) => &[("open", false), ("closed", true)],
        None => &[("open", false)],
    };
    let mut answer = Answer {
        stage: String::new(),
        table_sha256: String::new(),
        first_mode_hz: controller.model.linear.modes.first().map(|mode| mode.frequency_hz),
        stroke_um: 0.0,
        position: "measured",
        controllers: Vec::new(),
        learned: Vec::new(),
        scans: Vec::new(),
        lost: 0,
    };
    let bar = progress::bar("on the board");
    let mut board = None;
    for (l, &(loop_kind, feedback)) in loops.iter().enumerate() {
        let looped = Looped {
            from,
            bank: args.bank,
            feedback,
        };
        let progress = |what: &str, share: f64| {
            bar.set_message(format!("{what}, {loop_kind} loop"));
            progress::advance(&bar, (l as f64 + share) / loops.len() as f64);
        };
        let (figures, about) = looped.figures(range_um, loop_kind, &mut answer, &progress)?;
        answer.controllers.push(figures);
        if about.hello.axes > 1 {
            let range_um = range_um.unwrap_or_else(|| whole_range_um(&about.hello));
            let scans = scans::on_board(&looped, range_um, loop_kind, &mut answer.lost, &progress)?;
            answer.scans.extend(scans);
        }
        board = Some(about.hello);
    }
    bar.finish_and_clear();
    if let (Some(most), Some(table)) = (args.iterations, &board) {
        let plan = Plan {
            controller,
            range_um: range_um.unwrap_or_else(|| whole_range_um(table)),
            most: most as usize,
        };
        let bar = progress::bar("learning on the board");
        let rate_hz = f64::from(table.sample_rate_hz);
        let open = Looped {
            from,
            bank: args.bank,
            feedback: false,
        };
        answer.learned = plan.on_board(&open, rate_hz, &mut answer.lost, &|name, number| {
            bar.set_message(format!("{name}, run {number}"));
            let before = LEARNED.iter().position(|learned| *learned == name).unwrap_or(0) as f64;
            let share = (before + number as f64 / f64::from(most + 1)) / LEARNED.len() as f64;
            progress::advance(&bar, share);
        })?;
        bar.finish_and_clear();
        if let Some(folder) = &args.keep {
            learning::keep(folder, &answer.learned, plan.range_um)?;
        }
    }
    if args.json {
        output::print_json(&answer)?;
    } else {
        output::print(&text(&answer))?;
    }
    Ok(Done::Answered)
}

/// A board's bank, open loop or closed.
pub(super) struct Looped<'a> {
    /// The server of the board's telemetry.
    pub from: &'a str,
    pub bank: u8,
    pub feedback: bool,
}

/// Points as often a second as they are to be repeated, for so many seconds.
pub(super) fn along(points: &Upload, frequency_hz: f64, seconds: f64, feedback: bool) -> Request {
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
pub(super) fn held(range_um: [f64; 2]) -> Upload {
    Upload::new(range_um, [u16::MAX; TABLE_POINTS])
}

impl Looped<'_> {
    /// All figures of a loop, and the board with the table that ran.
    fn figures(
        &self,
        range_um: Option<[f64; 2]>,
        loop_kind: &'static str,
        answer: &mut Answer,
        progress: &dyn Fn(&str, f64),
    ) -> Result<(Figures, About), CliError> {
        // The references, the small multisine, the rest, and the hold, which takes as long as all of them.
        let runs = 2.0 * (SHAPES.len() + 2) as f64;
        let mut rms_percent = BTreeMap::new();
        let mut said = None;
        for (r, (name, shape)) in SHAPES.into_iter().enumerate() {
            let judged = Judged::of(shape);
            let request = Request {
                shape: of_the_board(shape),
                frequency_hz: shape.frequency_hz(),
                range_um,
                seconds: RAMP_S + judged.length_s(),
                feedforward: true,
                feedback: self.feedback,
            };
            let captured = self.run(request, None, &|part| progress(name, (r as f64 + part) / runs))?;
            let (rms_um, stroke_um) = judged.error(&captured, name)?;
            rms_percent.insert(name.to_owned(), 100.0 * rms_um / stroke_um);
            answer.stroke_um = answer.stroke_um.max(stroke_um);
            answer.lost += captured.counts.lost;
            answer.stage = captured.about.board().to_owned();
            let about = captured.about;
            said = captured.pieces.last().map(|piece| about.with(piece.table)).or(said);
        }
        let about = said.ok_or(BoardError::NoSamples { bytes: 0 })?;
        let table = about.hello;
        answer.table_sha256 = hex(&table.hash);
        let small = Small::about(self, &table, range_um);
        let done = |runs_done: usize, part: f64| (runs_done as f64 + part) / runs;
        let part = |part| progress("small multisine", done(SHAPES.len(), part));
        let response = small.response(&mut answer.lost, &part)?;
        let part = |part| progress("at rest", done(SHAPES.len() + 1, part));
        let noise_nm = small.noise_nm(&mut answer.lost, &part)?;
        let range_um = range_um.unwrap_or_else(|| whole_range_um(&table));
        let part = |part| progress("hold", 0.5 + 0.5 * part);
        let creep_peak_percent = self.hold(range_um, &mut answer.lost, &part)?;
        let frequency_hz = |crossing: Option<Crossing>| crossing.map(|crossing| crossing.frequency_hz);
        let figures = Figures {
            name: "complete",
            loop_kind,
            rms_percent,
            creep_peak_percent,
            lag30_hz: frequency_hz(response.lag_30_deg()),
            minus3db_hz: frequency_hz(response.minus_3_db()),
            noise_nm,
        };
        Ok((figures, about))
    }

    fn run(&self, request: Request, upload: Option<Upload>, progress: &dyn Fn(f64)) -> Result<Capture, CliError> {
        let mut axes = self.axes(&[(request, upload)], progress)?.into_iter();
        Ok(axes.next().ok_or(BoardError::NoSamples { bytes: 0 })?)
    }

    /// A reference an axis, for as long as the first one's; an axis without one stands still.
    pub(super) fn axes(
        &self,
        references: &[(Request, Option<Upload>)],
        progress: &dyn Fn(f64),
    ) -> Result<Vec<Capture>, CliError> {
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
    pub(super) fn along(
        &self,
        points: Upload,
        frequency_hz: f64,
        seconds: f64,
        progress: &dyn Fn(f64),
    ) -> Result<Capture, CliError> {
        self.run(
            along(&points, frequency_hz, seconds, self.feedback),
            Some(points),
            progress,
        )
    }

    /// Largest error of a hold, percent of the range.
    fn hold(&self, range_um: [f64; 2], lost: &mut u64, progress: &dyn Fn(f64)) -> Result<f64, CliError> {
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
pub(super) fn peak_percent(errors_um: &[f64], rate_hz: f64, [low_um, high_um]: [f64; 2]) -> f64 {
    let length = (AVERAGED_S * rate_hz).round().max(1.0) as usize;
    let means = errors_um.chunks_exact(length);
    let means = means.map(|chunk| (chunk.iter().sum::<f64>() / length as f64).abs());
    100.0 * means.fold(0.0, f64::max) / (high_um - low_um)
}

/// A judged tick.
#[derive(Clone, Copy)]
pub(super) struct Tick {
    /// Since the reference began.
    pub number: usize,
    pub reference_um: f64,
    pub measured_um: f64,
    /// A real board does not say.
    pub true_um: Option<f64>,
}

/// Which part of a run is judged: from so many seconds after the loop ran, whole periods.
pub(super) struct Judged {
    from_s: f64,
    length_s: f64,
}

impl Judged {
    /// As on a simulated stage.
    pub(super) fn of(shape: Shape) -> Self {
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
    pub(super) fn length_s(&self) -> f64 {
        self.from_s + self.length_s
    }

    /// Rms of reference less measured position, and the reference's peak to peak, micrometres.
    fn error(&self, captured: &Capture, name: &str) -> Result<(f64, f64), CliError> {
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
            return Err(CliError::Option(format!("{name}: the reference did not move")));
        }
        Ok(((squares / ticks.len() as f64).sqrt(), high - low))
    }

    /// The ticks that are judged, as far as they came.
    pub(super) fn ticks(&self, captured: &Capture, name: &str) -> Result<Vec<Tick>, CliError> {
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
pub(super) fn enough(count: u64, wanted: u64, name: &str) -> Result<(), CliError> {
    if 2 * count < wanted {
        return Err(CliError::Option(format!(
            "{name}: of the {wanted} ticks that are judged {count} came; a faster probe, or a shorter polling interval, loses fewer"
        )));
    }
    Ok(())
}

/// Refuses a recording in which the board stopped.
pub(super) fn no_fault(captured: &Capture, name: &str) -> Result<(), CliError> {
    let faults = captured.pieces.iter().find_map(|piece| {
        let mut numbered = (piece.start_tick..).zip(&piece.recording.frames);
        numbered.find_map(|(tick, frame)| Some((tick, frame.fault()?)))
    });
    match faults {
        None => Ok(()),
        Some((tick, fault)) => Err(CliError::Option(format!(
            "{name}: the board stopped at tick {tick} with fault {fault:?}; clear it at the board, and give a narrower --range"
        ))),
    }
}

fn text(answer: &Answer) -> String {
    let mode = first_mode(answer.first_mode_hz);
    let mut text = format!(
        "BOARD {}, table {}; {mode} as identified; stroke {:.4} um\n\
         errors against the reference at the same instant, {} position; rms, % of peak to peak; creep: largest error from 5 ms after a\n\
         move, over {HOLD_S} s, averaged over 1 ms; bandwidths by a small multisine; noise at rest as the sensor has it\n\n\
         {:<6}{} {:>7} {:>9} {:>9} {:>6}\n",
        answer.stage,
        answer.table_sha256,
        answer.stroke_um,
        answer.position,
        "loop",
        heads(),
        "creep",
        "30 deg Hz",
        "-3 dB Hz",
        "nm"
    );
    for controller in &answer.controllers {
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<6}{} {:>7.3} {:>9} {:>9} {:>6.2}",
            controller.loop_kind,
            cells(&controller.rms_percent),
            controller.creep_peak_percent,
            hertz(controller.lag30_hz),
            hertz(controller.minus3db_hz),
            controller.noise_nm.unwrap_or(f64::NAN)
        );
    }
    if !answer.scans.is_empty() {
        text += &format!(
            "\nSCANS of both axes at {LINES_HZ} lines a second, by the sensors of both: error of each axis at the same instant, distance from\n\
             the path (late along it is none)\n\n"
        );
        text.push_str(&scan_rows(&answer.scans));
    }
    text.push_str(&learning::text(&answer.learned, " on the board"));
    let _ = writeln!(text, "\n{} ticks lost", answer.lost);
    text
}
