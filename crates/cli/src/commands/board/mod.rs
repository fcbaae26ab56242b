//! `hysteron board`: recordings of the firmware, in the emulator or on a board, tables for a board, and a board for whoever has none.

mod flash;
mod record;
mod run;
mod serve;
mod upload;
mod wanted;

pub(crate) use run::EmulatorName;

use crate::error::CliError;
use crate::exit::Done;
use clap::{Args, Subcommand, ValueEnum};
use hysteron_board::Fault;
use hysteron_data::{Dataset, Overwrite, write_dataset};
use std::path::Path;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    hysteron board run --emulator mps2-an386 --stage paper-rate --hz 100 -o board\n  \
    hysteron board record --from localhost:9090 --run --hz 50 --seconds 2 -o recorded\n  \
    hysteron board flash firmware/target/released/nucleo-h743zi.elf\n  \
    hysteron board upload table.toml --to localhost:9090 --restart")]
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
    /// Pretend to be a real board: a table's law or an image, at the simulated stage, for whoever connects
    Serve(serve::ServeArgs),
    /// Write an image to a real board's flash by its debug probe, and start it
    Flash(flash::FlashArgs),
    /// Send a table to a real board, into the slot of its flash that is not in use; no image is built
    Upload(upload::UploadArgs),
}

pub(crate) fn run(args: &BoardArgs) -> Result<Done, CliError> {
    match &args.command {
        BoardCommand::Run(args) => run::run(args),
        BoardCommand::Record(args) => record::run(args),
        BoardCommand::Serve(args) => serve::run(args),
        BoardCommand::Flash(args) => flash::run(args),
        BoardCommand::Upload(args) => upload::run(args),
    }
}

/// The axes of a board.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Axis {
    X,
    Y,
}

fn write(dataset: &Dataset, folder: &Path, overwrite: bool) -> Result<(), CliError> {
    let overwrite = if overwrite { Overwrite::Allow } else { Overwrite::Refuse };
    Ok(write_dataset(dataset, folder, overwrite)?)
}

/// The delay that a dataset of a board is given, as a line.
pub(crate) fn known_delay_line(delay_s: Option<f64>) -> String {
    match delay_s {
        Some(delay_s) => format!("known delay {:.1} us, computed\n", 1e6 * delay_s),
        None => "no known delay of this board: measure it, and write it to dataset.toml, [known] delay_s\n".to_owned(),
    }
}

/// A fault, as a line; nothing where there is none.
fn fault_line(fault: Option<(u32, Fault)>) -> String {
    fault.map_or_else(String::new, |(tick, fault)| {
        format!("fault at tick {tick}: {fault:?}\n")
    })
}
