//! `hysteron board`: recordings of the firmware, in the emulator or on a board.

mod record;
mod run;
mod wanted;

pub(crate) use run::EmulatorName;

use crate::error::CliError;
use crate::exit::Done;
use clap::{Args, Subcommand, ValueEnum};
use hysteron_board::Recording;
use hysteron_data::{Dataset, Overwrite, Record, Role, write_dataset};
use std::fmt::Write;
use std::path::Path;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    hysteron board run --emulator mps2-an386 --stage paper-rate --hz 100 -o board\n  \
    hysteron board record --from localhost:9090 --run --hz 50 --seconds 2 -o recorded")]
pub(crate) struct BoardArgs {
    #[command(subcommand)]
    pub command: BoardCommand,
}

#[derive(Subcommand)]
pub(crate) enum BoardCommand {
    /// Run the image in QEMU against the simulated stage and record it as a dataset
    Run(run::RunArgs),
    /// Record what a real board sends of every tick as a dataset
    Record(record::RecordArgs),
}

pub(crate) fn run(args: &BoardArgs) -> Result<Done, CliError> {
    match &args.command {
        BoardCommand::Run(args) => run::run(args),
        BoardCommand::Record(args) => record::run(args),
    }
}

/// The axes of a board.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Axis {
    X,
    Y,
}

/// A recording without gaps, and what the dataset says of it.
struct Piece {
    file: String,
    excitation: String,
    start_s: f64,
    period_s: f64,
    recording: Recording,
}

/// The record of a recording: the loop's reference, the DAC's voltage, the sensor's position.
fn record(piece: Piece) -> Record {
    let Recording {
        frames,
        position_um,
        voltage_v,
        ..
    } = piece.recording;
    Record {
        file: piece.file,
        role: Role::Validate,
        excitation: piece.excitation,
        start_s: piece.start_s,
        period_s: piece.period_s,
        reference_um: Some(frames.iter().map(|frame| f64::from(frame.reference_um)).collect()),
        voltage_v,
        position_um,
        temperature_c: None,
        voltage2_v: None,
    }
}

fn write(dataset: &Dataset, folder: &Path, overwrite: bool) -> Result<(), CliError> {
    let overwrite = if overwrite { Overwrite::Allow } else { Overwrite::Refuse };
    Ok(write_dataset(dataset, folder, overwrite)?)
}

pub(crate) fn hex(hash: &[u8; 32]) -> String {
    hash.iter().fold(String::new(), |mut text, byte| {
        // Writing to a String does not fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// The delay that a dataset of a board is given, as a line.
pub(crate) fn known_delay_line(delay_s: Option<f64>) -> String {
    match delay_s {
        Some(delay_s) => format!("known delay {:.1} us, computed\n", 1e6 * delay_s),
        None => "no known delay of this board: measure it, and write it to dataset.toml, [known] delay_s\n".to_owned(),
    }
}

/// The first fault, as a line; nothing where there is none.
fn fault_line<'a>(recordings: impl IntoIterator<Item = &'a Recording>) -> String {
    let mut frames = recordings.into_iter().flat_map(|recording| &recording.frames);
    let fault = frames.find_map(|frame| Some((frame.number, frame.fault()?)));
    fault.map_or_else(String::new, |(tick, fault)| {
        format!("fault at tick {tick}: {fault:?}\n")
    })
}
