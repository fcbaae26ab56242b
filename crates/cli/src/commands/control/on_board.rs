//! `hysteron track --board`: the references of the table by a real board, judged by its own sensor.

use crate::commands::board::hex;
use crate::commands::control::track::{cells, first_mode, heads, of_the_board};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use hysteron_board::capture::{Start, Wish, capture};
use hysteron_board::telemetry::Capture;
use hysteron_board::{Mode, Request};
use hysteron_tracking::bench::SHAPES;
use hysteron_tracking::design::Controller;
use hysteron_tracking::reference::{Reference, Shape};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The rate for which the lengths of settling and judging are worked out, hertz; a board of another rate gets as many seconds.
const USUAL_HZ: f64 = 50e3;

/// What a recording is longer than what is judged, seconds: the ramp from the safe level, 20 ms for the whole range, and as much again.
const RAMP_S: f64 = 0.04;

/// As of a simulated stage, with what a board cannot tell left out.
#[derive(Serialize)]
struct Answer {
    stage: String,
    table_sha256: String,
    first_mode_hz: Option<f64>,
    stroke_um: f64,
    position: &'static str,
    controllers: Vec<Figures>,
    /// Ticks whose samples did not come.
    lost: u64,
}

#[derive(Serialize)]
struct Figures {
    name: &'static str,
    #[serde(rename = "loop")]
    loop_kind: &'static str,
    rms_percent: BTreeMap<String, f64>,
    lag30_hz: Option<f64>,
    minus3db_hz: Option<f64>,
    noise_nm: Option<f64>,
}

/// Runs open and closed loop on every reference, one recording each.
pub(super) fn track(
    from: &str,
    bank: u8,
    range_um: Option<[f64; 2]>,
    controller: &Controller,
    json: bool,
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
        lost: 0,
    };
    let bar = progress::bar("on the board");
    let runs = (loops.len() * SHAPES.len()) as f64;
    for (l, &(loop_kind, feedback)) in loops.iter().enumerate() {
        let mut rms_percent = BTreeMap::new();
        for (r, (name, shape)) in SHAPES.into_iter().enumerate() {
            bar.set_message(format!("{name}, {loop_kind} loop"));
            let done = (l * SHAPES.len() + r) as f64;
            let judged = Judged::of(shape);
            let wish = Wish {
                bank,
                request: Request {
                    shape: of_the_board(shape),
                    frequency_hz: shape.frequency_hz(),
                    range_um,
                    seconds: RAMP_S + judged.from_s + judged.length_s,
                    feedforward: true,
                    feedback,
                },
                upload: None,
            };
            let captured = capture(from, wish.request.seconds, Start::Playing(&wish), &mut |share| {
                progress::advance(&bar, (done + share) / runs);
            })?;
            let (rms_um, stroke_um) = judged.error(&captured, name)?;
            rms_percent.insert(name.to_owned(), 100.0 * rms_um / stroke_um);
            answer.stroke_um = answer.stroke_um.max(stroke_um);
            answer.lost += captured.counts.lost;
            answer.stage = captured.about.board().to_owned();
            let played = captured.pieces.last();
            answer.table_sha256 = played.map_or_else(String::new, |piece| hex(&piece.table.hash));
        }
        answer.controllers.push(Figures {
            name: "complete",
            loop_kind,
            rms_percent,
            lag30_hz: None,
            minus3db_hz: None,
            noise_nm: None,
        });
    }
    bar.finish_and_clear();
    if json {
        output::print_json(&answer)?;
    } else {
        output::print(&text(&answer))?;
    }
    Ok(Done::Answered)
}

/// Which part of a run is judged: from so many seconds after the loop ran, whole periods.
struct Judged {
    from_s: f64,
    length_s: f64,
}

impl Judged {
    /// As on a simulated stage.
    fn of(shape: Shape) -> Self {
        let Reference {
            samples_um,
            judged_from,
        } = shape.reference([0.0, 1.0], 1.0 / USUAL_HZ);
        Self {
            from_s: judged_from as f64 / USUAL_HZ,
            length_s: (samples_um.len() - judged_from) as f64 / USUAL_HZ,
        }
    }

    /// Rms of reference less measured position, and the reference's peak to peak, micrometres.
    fn error(&self, captured: &Capture, name: &str) -> Result<(f64, f64), CliError> {
        let rate_hz = f64::from(captured.about.hello.sample_rate_hz);
        let ticks = captured.pieces.iter().flat_map(|piece| {
            let recording = &piece.recording;
            let numbered = (piece.start_tick..).zip(&recording.frames);
            numbered
                .zip(&recording.position_um)
                .map(|((tick, frame), &measured_um)| (tick, frame, measured_um))
        });
        if let Some((tick, fault)) = ticks.clone().find_map(|(tick, frame, _)| Some((tick, frame.fault()?))) {
            return Err(CliError::Option(format!(
                "{name}: the board stopped at tick {tick} with fault {fault:?}; clear it at the board, and give a narrower --range"
            )));
        }
        let began = ticks
            .clone()
            .find(|(_, frame, _)| frame.mode() == Mode::Running)
            .map_or(u64::MAX, |(tick, ..)| tick);
        let first = began.saturating_add((self.from_s * rate_hz).round() as u64);
        let end = first.saturating_add((self.length_s * rate_hz).round() as u64);
        let judged = ticks.filter(|(tick, frame, _)| (first..end).contains(tick) && frame.mode() == Mode::Running);
        let (mut squares, mut count, mut low, mut high) = (0.0, 0_u64, f64::INFINITY, f64::NEG_INFINITY);
        for (_, frame, measured_um) in judged {
            let reference_um = f64::from(frame.reference_um);
            squares += (reference_um - measured_um).powi(2);
            count += 1;
            (low, high) = (low.min(reference_um), high.max(reference_um));
        }
        // Half of the judged part may be lost to a slow probe; less tells little of whole periods.
        if 2 * count < end - first || high <= low {
            return Err(CliError::Option(format!(
                "{name}: of the {} ticks that are judged {count} came; a faster probe, or a shorter polling interval, loses fewer",
                end - first
            )));
        }
        Ok(((squares / count as f64).sqrt(), high - low))
    }
}

fn text(answer: &Answer) -> String {
    let mode = first_mode(answer.first_mode_hz);
    let mut text = format!(
        "BOARD {}, table {}; {mode} as identified; stroke {:.4} um\n\
         errors against the reference at the same instant, {} position; rms, % of peak to peak\n\n{:<6}{}\n",
        answer.stage,
        answer.table_sha256,
        answer.stroke_um,
        answer.position,
        "loop",
        heads()
    );
    for controller in &answer.controllers {
        // Writing to a String does not fail.
        let _ = writeln!(text, "{:<6}{}", controller.loop_kind, cells(&controller.rms_percent));
    }
    let _ = writeln!(text, "{} ticks lost", answer.lost);
    text
}
