//! `hysteron board flash`.

use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::Args;
use hysteron_board::flash::flash;
use serde::Serialize;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example, with the board at a USB port and its amplifier off:\n  \
    cargo xtask firmware release                    # ready images, into firmware/target/released\n  \
    hysteron board flash firmware/target/released/nucleo-h743zi.elf\n  \
    hysteron board upload table.toml --to 192.168.7.2:9090 --restart\n\n\
    probe-rs writes the image: cargo install probe-rs-tools --locked. The image says which board it is for; another one is refused by the \
    probe. Tables in the board's slots stay.")]
pub(crate) struct FlashArgs {
    /// The image of a board
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// The debug probe, where there are several: its serial number, or VID:PID
    #[arg(long, value_name = "PROBE")]
    pub probe: Option<String>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// The answer for machines.
#[derive(Serialize)]
struct Answer {
    board: &'static str,
    image: String,
}

pub(crate) fn run(args: &FlashArgs) -> Result<Done, CliError> {
    let answer = Answer {
        board: flash(&args.image, args.probe.as_deref())?.name(),
        image: args.image.display().to_string(),
    };
    if args.json {
        output::print_json(&answer)?;
    } else {
        output::print(&format!("{} has {} and starts with it\n", answer.board, answer.image))?;
    }
    Ok(Done::Answered)
}
