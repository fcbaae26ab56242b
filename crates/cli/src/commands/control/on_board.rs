//! `hysteron track --board`: the references of the table by a real board, judged by its own sensor.

use crate::commands::board::hex;
use crate::commands::control::programme::{HARMONICS, TICKS_A_POINT, small_multisine};
use crate::commands::control::track::{cells, first_mode, heads, hertz, of_the_board};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use hysteron_board::capture::{Start, Wish, capture};
use hysteron_board::telemetry::Capture;
use hysteron_board::upload::Upload;
use hysteron_board::{Hello, Mode, Request, TABLE_POINTS};
use hysteron_tracking::bench::SHAPES;
use hysteron_tracking::design::Controller;
use hysteron_tracking::reference::{Reference, Shape};
use hysteron_tracking::response::{Crossing, Response, line_response};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The rate for which the lengths of settling and judging are worked out, hertz; a board of another rate gets as many seconds.
const USUAL_HZ: f64 = 50e3;

/// What a recording is longer than what is judged, seconds: the ramp from the safe level, 20 ms for the whole range, and as much again.
pub(super) const RAMP_S: f64 = 0.04;

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
    // The references, the small multisine, the rest.
    let runs_a_loop = SHAPES.len() + 2;
    let share = |l: usize, run: usize, share: f64| {
        ((l * runs_a_loop + run) as f64 + share) / (loops.len() * runs_a_loop) as f64
    };
    for (l, &(loop_kind, feedback)) in loops.iter().enumerate() {
        let mut rms_percent = BTreeMap::new();
        let mut table = None;
        for (r, (name, shape)) in SHAPES.into_iter().enumerate() {
            bar.set_message(format!("{name}, {loop_kind} loop"));
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
            let captured = capture(from, wish.request.seconds, Start::Playing(&wish), &mut |part| {
                progress::advance(&bar, share(l, r, part));
            })?;
            let (rms_um, stroke_um) = judged.error(&captured, name)?;
            rms_percent.insert(name.to_owned(), 100.0 * rms_um / stroke_um);
            answer.stroke_um = answer.stroke_um.max(stroke_um);
            answer.lost += captured.counts.lost;
            answer.stage = captured.about.board().to_owned();
            table = captured.pieces.last().map(|piece| piece.table).or(table);
        }
        let (response, noise_nm) = match &table {
            None => (Response::default(), None),
            Some(table) => {
                answer.table_sha256 = hex(&table.hash);
                let about = Small::about((from, bank, feedback), table, range_um);
                bar.set_message(format!("small multisine, {loop_kind} loop"));
                let part = |part| progress::advance(&bar, share(l, SHAPES.len(), part));
                let response = about.response(&mut answer.lost, &part)?;
                bar.set_message(format!("at rest, {loop_kind} loop"));
                let part = |part| progress::advance(&bar, share(l, SHAPES.len() + 1, part));
                (response, about.noise_nm(&mut answer.lost, &part)?)
            }
        };
        let frequency_hz = |crossing: Option<Crossing>| crossing.map(|crossing| crossing.frequency_hz);
        answer.controllers.push(Figures {
            name: "complete",
            loop_kind,
            rms_percent,
            lag30_hz: frequency_hz(response.lag_30_deg()),
            minus3db_hz: frequency_hz(response.minus_3_db()),
            noise_nm,
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

/// Small signals about the middle of what is followed.
struct Small<'a> {
    from: &'a str,
    bank: u8,
    feedback: bool,
    middle_um: f64,
    swing_um: f64,
    rate_hz: f64,
}

/// Swing of the small multisine either way, as a share of the range: what the board takes for an oscillation is several times as much.
const SMALL: f64 = 0.01;
/// Time before it and the rest are judged, seconds: ramp and ringing are over and fast creep stands.
const STANDS_S: f64 = 0.5;
/// Periods of the multisine that are judged.
const PERIODS: usize = 16;
/// Seed of its phases.
const PHASES: u64 = 1;
/// Length of the rest that is judged, seconds.
const REST_S: f64 = 0.5;

impl<'a> Small<'a> {
    fn about((from, bank, feedback): (&'a str, u8, bool), table: &Hello, range_um: Option<[f64; 2]>) -> Self {
        let [low_um, high_um] = range_um.unwrap_or([table.input_min_um, table.input_max_um].map(f64::from));
        Self {
            from,
            bank,
            feedback,
            middle_um: 0.5 * (low_um + high_um),
            swing_um: SMALL * (high_um - low_um),
            rate_hz: f64::from(table.sample_rate_hz),
        }
    }

    /// From reference to measured position, at the multisine's own lines; empty where a gap leaves no whole periods. Adds the ticks that
    /// did not come to `lost`.
    fn response(&self, lost: &mut u64, progress: &dyn Fn(f64)) -> Result<Response, CliError> {
        let period = TICKS_A_POINT as usize * TABLE_POINTS;
        let judged = PERIODS * period;
        let points = small_multisine(PHASES);
        let ticks = self.run(points, judged, lost, progress)?;
        let [reference_um, measured_um]: [Vec<f64>; 2] =
            [0, 1].map(|column| ticks.iter().map(|tick| tick[column]).collect());
        let all = line_response(&reference_um, &measured_um, 1.0 / self.rate_hz, PERIODS);
        Ok(all.up_to(HARMONICS as f64 * self.rate_hz / period as f64))
    }

    /// Standard deviation of the measured position about a straight line in time, nanometres: the sensor's own noise with it.
    fn noise_nm(&self, lost: &mut u64, progress: &dyn Fn(f64)) -> Result<Option<f64>, CliError> {
        let judged = (REST_S * self.rate_hz) as usize;
        let ticks = self.run([1 << 15; TABLE_POINTS], judged, lost, progress)?;
        let n = ticks.len() as f64;
        let time = |k: usize| (k as f64 + 0.5) / n - 0.5;
        let mean = ticks.iter().map(|tick| tick[1]).sum::<f64>() / n;
        let slope: f64 = (0..).zip(&ticks).map(|(k, tick)| time(k) * tick[1]).sum::<f64>() * 12.0 / n;
        let squares: f64 = (0..)
            .zip(&ticks)
            .map(|(k, tick)| (tick[1] - mean - slope * time(k)).powi(2))
            .sum();
        Ok((!ticks.is_empty()).then(|| 1e3 * (squares / n).sqrt()))
    }

    /// Plays points; reference and measured position of the last `judged` ticks, none where one of them is lost.
    fn run(
        &self,
        points: [u16; TABLE_POINTS],
        judged: usize,
        lost: &mut u64,
        progress: &dyn Fn(f64),
    ) -> Result<Vec<[f64; 2]>, CliError> {
        let range_um = [self.middle_um - self.swing_um, self.middle_um + self.swing_um];
        let wish = Wish {
            bank: self.bank,
            request: Request {
                shape: hysteron_board::Shape::Table,
                frequency_hz: self.rate_hz / f64::from(TICKS_A_POINT * TABLE_POINTS as u32),
                range_um: Some(range_um),
                seconds: STANDS_S + judged as f64 / self.rate_hz,
                feedforward: true,
                feedback: self.feedback,
            },
            upload: Some(Upload::new(range_um, points)),
        };
        let captured = capture(self.from, wish.request.seconds, Start::Playing(&wish), &mut |share| {
            progress(share);
        })?;
        no_fault(&captured, "small signals")?;
        *lost += captured.counts.lost;
        let Some(recording) = captured.pieces.last().map(|piece| &piece.recording) else {
            return Ok(Vec::new());
        };
        let rows = recording.frames.iter().zip(&recording.position_um);
        let running = rows.filter(|(frame, _)| frame.mode() == Mode::Running);
        let ticks: Vec<[f64; 2]> = running.map(|(frame, &y)| [f64::from(frame.reference_um), y]).collect();
        let first = ticks.len().checked_sub(judged);
        Ok(first.map_or_else(Vec::new, |first| ticks[first..].to_vec()))
    }
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
        no_fault(captured, name)?;
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
         errors against the reference at the same instant, {} position; rms, % of peak to peak; bandwidths by a small multisine;\n\
         noise at rest as the sensor has it\n\n{:<6}{} {:>9} {:>9} {:>6}\n",
        answer.stage,
        answer.table_sha256,
        answer.stroke_um,
        answer.position,
        "loop",
        heads(),
        "30 deg Hz",
        "-3 dB Hz",
        "nm"
    );
    for controller in &answer.controllers {
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<6}{} {:>9} {:>9} {:>6.2}",
            controller.loop_kind,
            cells(&controller.rms_percent),
            hertz(controller.lag30_hz),
            hertz(controller.minus3db_hz),
            controller.noise_nm.unwrap_or(f64::NAN)
        );
    }
    let _ = writeln!(text, "{} ticks lost", answer.lost);
    text
}
