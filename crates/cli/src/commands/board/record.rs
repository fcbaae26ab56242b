//! `hysteron board record`.

use crate::commands::board::wanted::Wanted;
use crate::commands::board::{Axis, Piece, fault_line, hex, known_delay_line, record, write};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_board::BoardError;
use hysteron_board::budget;
use hysteron_board::capture::{Start, capture};
use hysteron_board::telemetry::Capture;
use hysteron_data::{Dataset, Known, Record};
use serde::Serialize;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example, with OpenOCD at the board's ST-LINK:\n  \
    openocd -f board/st_nucleo_h743zi.cfg -c init -c 'rtt setup 0x20000000 0x20000 \"SEGGER RTT\"' \
    -c 'rtt start' -c 'rtt server start 9090 1'\n  \
    hysteron board record --from localhost:9090 --seconds 2 -o recorded\n  \
    hysteron board record --from localhost:9090 --run --bank 1 --shape triangle --hz 50 --seconds 2 -o triangle\n  \
    hysteron compare recorded model.toml")]
pub(crate) struct RecordArgs {
    /// Where the board's telemetry comes from: HOST:PORT of a server of its RTT channel 1, or a device or captured file
    #[arg(long, value_name = "HOST:PORT|PATH")]
    pub from: String,
    /// Length of the recording, seconds of the board's time
    #[arg(long, default_value_t = 10.0, allow_negative_numbers = true)]
    pub seconds: f64,
    /// Start the loop before, and stop it after; without it the board's button does
    #[arg(long)]
    pub run: bool,
    #[command(flatten)]
    pub wanted: Wanted,
    /// Which axis of a board with both; the other's command goes into the records as well. It stands still while a reference is played
    #[arg(long, default_value = "x")]
    pub axis: Axis,
    /// Folder of the new dataset
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Replace a dataset that is there already
    #[arg(long)]
    pub overwrite: bool,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// What was recorded.
#[derive(Serialize)]
struct Answer {
    board: String,
    /// Of the tables that ran, in their order.
    tables_sha256: Vec<String>,
    seconds: f64,
    samples: u64,
    lost: u64,
    /// Recordings without a gap.
    pieces: usize,
    /// Samples between two gaps, which are left out.
    alone: u64,
    /// Samples from before anybody listened, which are left out.
    unheard: u64,
    /// Bytes that belong to no packet.
    foreign_bytes: u64,
    /// Times that the board began anew.
    restarts: u64,
    /// Computed of the board; none where it is not known.
    known_delay_s: Option<f64>,
    /// Number of the first fault.
    fault: Option<u8>,
}

pub(crate) fn run(args: &RecordArgs) -> Result<Done, CliError> {
    output::refuse_to_replace(&args.output, args.overwrite)?;
    let wish = match args.wanted.is_nothing() {
        true => None,
        false if args.run => Some(args.wanted.wish(args.seconds)?),
        false => {
            return Err(CliError::Option(
                "a reference, a bank or a part is asked for before the loop starts: give --run as well".to_owned(),
            ));
        }
    };
    let bar = progress::bar("recording");
    let axis = usize::from(args.axis == Axis::Y);
    let mut wishes = [None; 2];
    wishes[axis] = wish;
    let start = match &wish {
        Some(_) => Start::Playing(&wishes[..=axis]),
        None if args.run => Start::Host,
        None => Start::Nobody,
    };
    let captured = capture(&args.from, args.seconds, start, &mut |share| {
        progress::advance(&bar, share);
    });
    bar.finish_and_clear();
    let mut captured = captured?;
    if axis >= captured.len() {
        return Err(BoardError::OneAxis.into());
    }
    let recorded = captured.swap_remove(axis);
    let answer = answer(&recorded);
    let fault = fault_line(recorded.pieces.iter().map(|piece| &piece.recording));
    let dataset = dataset(recorded, captured.first(), &answer);
    write(&dataset, &args.output, args.overwrite)?;
    if args.json {
        output::print_json(&answer)?;
    } else {
        output::print(&text(args, &answer, &fault))?;
    }
    Ok(Done::Answered)
}

fn answer(captured: &Capture) -> Answer {
    let about = &captured.about;
    let counts = captured.counts;
    let mut frames = captured.pieces.iter().flat_map(|piece| &piece.recording.frames);
    let mut tables: Vec<String> = captured.pieces.iter().map(|piece| hex(&piece.table.hash)).collect();
    tables.dedup();
    Answer {
        board: about.board().to_owned(),
        tables_sha256: tables,
        seconds: (counts.samples + counts.lost) as f64 / f64::from(about.hello.sample_rate_hz),
        samples: counts.samples,
        lost: counts.lost,
        pieces: captured.pieces.len(),
        alone: counts.alone,
        unheard: counts.unheard,
        foreign_bytes: counts.foreign_bytes,
        restarts: counts.restarts,
        known_delay_s: budget::known_delay_s(about),
        fault: frames.find_map(|frame| frame.fault()).map(|fault| fault as u8),
    }
}

/// A record a piece; with the command of the axis beside it where that came with every sample.
fn dataset(captured: Capture, beside: Option<&Capture>, answer: &Answer) -> Dataset {
    let period_s = 1.0 / f64::from(captured.about.hello.sample_rate_hz);
    let several = answer.tables_sha256.len() > 1;
    let pieces = captured.pieces.into_iter().enumerate().map(|(i, piece)| {
        let references = piece.recording.frames.iter().map(|frame| frame.reference_um);
        let [low, high] = references.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], um| {
            [low.min(um), high.max(um)]
        });
        let numbers = piece.recording.frames.iter().map(|frame| frame.number);
        let voltage2_v = beside.and_then(|beside| beside.commands_v(numbers));
        let record = record(Piece {
            file: format!("run-{:03}.csv", i + 1),
            excitation: format!(
                "reference of the board, {low} to {high} um{}",
                match several {
                    true => format!(", bank {}, table {}", piece.table.bank, hex(&piece.table.hash)),
                    false => String::new(),
                }
            ),
            start_s: piece.start_tick as f64 * period_s,
            period_s,
            recording: piece.recording,
        });
        Record { voltage2_v, ..record }
    });
    Dataset {
        name: format!("{}-recording", name(&answer.board)),
        description: format!(
            "recorded from {}{}: {} samples, {} lost, {}",
            name(&answer.board),
            match (beside, captured.about.axis) {
                (None, _) => "",
                (Some(_), 0) => ", the first axis",
                (Some(_), _) => ", the second axis",
            },
            answer.samples,
            answer.lost,
            tables(answer)
        ),
        known: Known {
            delay_s: answer.known_delay_s,
            ..Known::default()
        },
        records: pieces.collect(),
        notices: Vec::new(),
    }
}

fn tables(answer: &Answer) -> String {
    let plural = if answer.tables_sha256.len() > 1 { "s" } else { "" };
    format!("table{plural} {}", answer.tables_sha256.join(", then "))
}

fn name(board: &str) -> &str {
    if board.is_empty() { "board" } else { board }
}

fn text(args: &RecordArgs, answer: &Answer, fault: &str) -> String {
    let total = answer.samples + answer.lost;
    let mut text = format!(
        "{}: {} samples in {:.3} s, {} lost ({:.3} %), {} without a gap\n",
        name(&answer.board),
        answer.samples,
        answer.seconds,
        answer.lost,
        100.0 * answer.lost as f64 / total.max(1) as f64,
        match answer.pieces {
            1 => "1 record".to_owned(),
            pieces => format!("{pieces} records"),
        }
    );
    for (count, what) in [
        (answer.alone, "samples between two gaps left out"),
        (answer.unheard, "samples from before anybody listened left out"),
        (answer.foreign_bytes, "bytes that belong to no packet"),
        (answer.restarts, "restarts of the board"),
    ] {
        if count > 0 {
            text += &format!("{count} {what}\n");
        }
    }
    if answer.seconds < args.seconds {
        text += &format!("the stream ended before {} s\n", args.seconds);
    }
    text += fault;
    text += &known_delay_line(answer.known_delay_s);
    text + &format!("{}\nwritten to {}\n", tables(answer), args.output.display())
}
