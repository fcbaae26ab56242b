//! The records of a stage, played by the board at it.

use crate::error::TrialError;
use crate::on_board::{RAMP_S, no_fault};
use crate::programme::{Piece, programme, training_programme};
use hysteron_board::budget;
use hysteron_board::capture::{Start, Wish, capture};
use hysteron_board::telemetry::Capture;
use hysteron_board::upload::Upload;
use hysteron_board::{Mode, Recording, Request, Shape, whole_range_um};
use hysteron_control::usable::moved;
use hysteron_data::{Dataset, Known, Record};
use hysteron_tracking::rehearsal::Rehearsal;
use std::time::{Duration, Instant};

/// Times that a reference is played until its record has no gap.
const TIMES: usize = 3;

/// What is asked of whom.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// The server of the board's telemetry.
    pub from: &'a str,
    /// Which of the board's tables runs.
    pub bank: u8,
    /// Lowest and highest reference, micrometres; none for all that the table allows.
    pub range_um: Option<[f64; 2]>,
    /// Rest before each record, seconds.
    pub rest_s: f64,
    /// Slow references only.
    pub training: bool,
    /// Of the references that are drawn.
    pub seed: u64,
}

/// Plays the programme open loop, whatever table the board has, and keeps what it commanded and read. Where the board has both axes, the
/// second goes up and down meanwhile, at a rate of its own for each record, and its command is kept as well. Stops at the first record
/// that is of no use. Progress gets what runs and the share done, 0 to 1.
///
/// # Errors
/// A board that does not answer or stops, a record that never comes whole, or that is of no use.
pub fn record(asked: &Asked<'_>, progress: &dyn Fn(&str, f64)) -> Result<Dataset, TrialError> {
    let mut pieces = programme(asked.seed)?;
    if asked.training {
        pieces.retain(|piece| !piece.moves());
        pieces.extend(training_programme(asked.seed));
    }
    // The rest comes first: it says which board it is, what its table allows, and what the sensor's noise is.
    pieces.sort_by_key(Piece::moves);
    let total_s: f64 = pieces.iter().map(|piece| asked.rest_s + RAMP_S + piece.kept_s).sum();
    let mut done_s = 0.0;
    let mut range_um = asked.range_um;
    let mut both = false;
    let mut dataset = Dataset::default();
    for (number, piece) in pieces.iter().enumerate() {
        let before = format!("before {}, at rest", piece.name);
        rest(asked.rest_s, &|s| progress(&before, (done_s + s) / total_s));
        done_s += asked.rest_s;
        let length_s = RAMP_S + piece.kept_s;
        let beside_hz = both.then(|| Rehearsal::cycles_beside(number) / piece.kept_s);
        let axes = without_a_gap(asked, (piece, beside_hz), range_um.unwrap_or_default(), &|share| {
            progress(piece.name, (done_s + share * length_s) / total_s);
        })?;
        done_s += length_s;
        let [captured, beside @ ..] = axes.as_slice() else {
            continue;
        };
        both = !beside.is_empty();
        let record = rows(captured, beside.first(), piece);
        if let Some(at_rest) = dataset.records.first() {
            moved(&record, at_rest).map_err(|why| TrialError::Useless {
                name: piece.name.to_owned(),
                why,
            })?;
        } else {
            let [low_um, high_um] = *range_um.get_or_insert_with(|| whole_range_um(&captured.about.hello));
            dataset = about(captured);
            dataset.description = format!(
                "played and read by a board, open loop, references from {low_um:.4} to {high_um:.4} um by its table, {} s of rest before \
                 each record",
                asked.rest_s
            );
        }
        dataset.records.push(record);
    }
    Ok(dataset)
}

/// A dataset without records of the board.
fn about(captured: &Capture) -> Dataset {
    let board = captured.about.board();
    let [min_v, max_v] = captured.about.dac_v.map(f64::from);
    Dataset {
        name: format!("campaign-{board}"),
        known: Known {
            delay_s: budget::known_delay_s(&captured.about),
            voltage_min_v: Some(min_v),
            voltage_max_v: Some(max_v),
            ..Known::default()
        },
        ..Dataset::default()
    }
}

/// Waits, in steps that a progress bar shows.
fn rest(seconds: f64, progress: &dyn Fn(f64)) {
    let begun = Instant::now();
    while begun.elapsed().as_secs_f64() < seconds {
        progress(begun.elapsed().as_secs_f64());
        let left_s = seconds - begun.elapsed().as_secs_f64();
        std::thread::sleep(Duration::from_secs_f64(left_s.clamp(0.0, 0.2)));
    }
}

/// A recording of a piece in which no tick is missing, of each axis; the second goes up and down over its table's range at `beside_hz`.
fn without_a_gap(
    asked: &Asked<'_>,
    (piece, beside_hz): (&Piece, Option<f64>),
    [low_um, high_um]: [f64; 2],
    progress: &dyn Fn(f64),
) -> Result<Vec<Capture>, TrialError> {
    let range_um = piece.range.map(|share| low_um + share * (high_um - low_um));
    let wish = Wish {
        bank: asked.bank,
        request: Request {
            shape: piece.shape,
            frequency_hz: piece.frequency_hz,
            range_um: Some(range_um),
            seconds: RAMP_S + piece.kept_s,
            feedforward: true,
            feedback: false,
        },
        upload: piece.points.map(|points| Upload::new(range_um, points)),
    };
    let beside = beside_hz.map(|frequency_hz| Wish {
        request: Request {
            shape: Shape::Sine,
            frequency_hz,
            range_um: None,
            ..wish.request
        },
        upload: None,
        ..wish
    });
    let wishes: Vec<Option<Wish>> = [Some(wish), beside].into_iter().filter(Option::is_some).collect();
    let mut lost = 0;
    for _ in 0..TIMES {
        let (start, seconds) = if piece.moves() {
            (Start::Playing(&wishes), wish.request.seconds)
        } else {
            (Start::Nobody, piece.kept_s)
        };
        let axes = capture(asked.from, seconds, start, &mut |share| progress(share))?;
        for axis in &axes {
            no_fault(axis, piece.name)?;
            lost = axis.counts.lost;
        }
        if let [captured, beside @ ..] = axes.as_slice()
            && captured.pieces.len() == 1
            && !kept(captured, piece).is_empty()
            && beside.iter().all(|beside| beside_v(captured, beside, piece).is_some())
        {
            return Ok(axes);
        }
    }
    Err(TrialError::Gaps {
        name: piece.name.to_owned(),
        times: TIMES,
        lost,
    })
}

fn rate_hz(captured: &Capture) -> f64 {
    f64::from(captured.about.hello.sample_rate_hz)
}

/// The ticks of a record: from the start, the rise with it, to the reference's end; of a rest all that came.
fn kept(captured: &Capture, piece: &Piece) -> std::ops::Range<usize> {
    let Some(recording) = captured.pieces.first().map(|piece| &piece.recording) else {
        return 0..0;
    };
    let begun = recording.frames.iter().position(|frame| frame.mode() == Mode::Running);
    let begun = if piece.moves() {
        begun.unwrap_or(recording.frames.len())
    } else {
        0
    };
    let end = begun + (piece.kept_s * rate_hz(captured)).ceil() as usize;
    if end > recording.frames.len() { 0..0 } else { 0..end }
}

/// The command of the axis beside in each tick of a record, volts; none where one is missing.
fn beside_v(captured: &Capture, beside: &Capture, piece: &Piece) -> Option<Vec<f64>> {
    let frames = &captured.pieces.first()?.recording.frames;
    let kept = frames.get(kept(captured, piece))?;
    beside.commands_v(kept.iter().map(|frame| frame.number))
}

/// Commands and readings of the same ticks: what lies between them is the known delay. With the command of the axis beside where there is
/// one.
fn rows(captured: &Capture, beside: Option<&Capture>, piece: &Piece) -> Record {
    let ticks = kept(captured, piece);
    let recording = captured.pieces.first().map(|piece| &piece.recording);
    let column = |of: fn(&Recording) -> &[f64]| -> Vec<f64> {
        let values = recording.map_or(&[][..], of);
        ticks.clone().step_by(piece.every).map(|k| values[k]).collect()
    };
    let beside_v = beside.and_then(|beside| beside_v(captured, beside, piece));
    Record {
        file: format!("{}.csv", piece.name),
        role: piece.role,
        excitation: piece.words(),
        start_s: 0.0,
        period_s: piece.every as f64 / rate_hz(captured),
        voltage_v: column(|recording| &recording.voltage_v),
        position_um: column(|recording| &recording.position_um),
        reference_um: None,
        temperature_c: None,
        voltage2_v: beside_v.map(|values| values.into_iter().step_by(piece.every).collect()),
    }
}
