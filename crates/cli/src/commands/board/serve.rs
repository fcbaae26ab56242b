//! `hysteron board serve`.

use crate::commands::board::run::EmulatorName;
use crate::commands::simulate::StageName;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::Args;
use hysteron_board::served::Served;
use hysteron_plant::Stage;
use std::path::PathBuf;

#[derive(Args)]
#[command(group(clap::ArgGroup::new("law").required(true).args(["table", "emulator"])))]
#[command(after_help = "Examples:\n  \
    hysteron board serve table.toml --stage 8k\n  \
    hysteron board serve --emulator mps2-an386 --image firmware/target/images/tables/tracking-8k --stage 8k\n  \
    hysteron board record --from 127.0.0.1:PORT --run --hz 50 --seconds 2 -o recorded\n\n\
    For a rehearsal without hardware: `board record`, `board upload` and the workbench take it for a real one. The law of a\n\
    table runs in real time where the machine is fast enough, an image as slowly as the emulator is. Ctrl-C ends it.")]
pub(crate) struct ServeArgs {
    /// Table of a complete law, as `hysteron export` writes it of a designed controller
    pub table: Option<PathBuf>,
    /// An image in the emulator instead
    #[arg(long, value_enum, requires = "image")]
    pub emulator: Option<EmulatorName>,
    /// The firmware's image
    #[arg(long, value_name = "FILE", requires = "emulator")]
    pub image: Option<PathBuf>,
    /// The simulated stage at its converters
    #[arg(long, value_enum)]
    pub stage: StageName,
    /// Seed of the stage's noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

pub(crate) fn run(args: &ServeArgs) -> Result<Done, CliError> {
    let stage = Stage::new(&args.stage.config(), args.seed)?;
    let served = match (&args.table, args.emulator, &args.image) {
        (Some(path), ..) => {
            let text = std::fs::read_to_string(path).map_err(|source| CliError::Read {
                path: path.clone(),
                source,
            })?;
            Served::start(&text, stage)?
        }
        (None, Some(machine), Some(image)) => Served::emulated(machine.machine(), image, stage)?,
        _ => return Err(CliError::Option("give a table, or --emulator with --image".to_owned())),
    };
    output::print(&format!(
        "board: {}\nstage: {}\nCtrl-C ends it\n",
        served.address(),
        args.stage.name()
    ))?;
    loop {
        std::thread::park();
    }
}
