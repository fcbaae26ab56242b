//! `hysteron board run`.

use crate::commands::board::wanted::Wanted;
use crate::commands::board::{Piece, fault_line, hex, record, write};
use crate::commands::simulate::StageName;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::{Args, ValueEnum};
use hysteron_board::capture::Wish;
use hysteron_board::upload::Upload;
use hysteron_board::{Change, Hello, Machine, Outcome, Recording};
use hysteron_data::{Dataset, Known};
use hysteron_plant::Stage;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Args)]
#[command(after_help = "Example:\n  \
    cargo xtask firmware build\n  \
    hysteron board run --emulator mps2-an386 --stage paper-rate --hz 100 -o board\n  \
    hysteron compare board model.toml")]
pub(crate) struct RunArgs {
    /// The machine
    #[arg(long, value_enum)]
    pub emulator: EmulatorName,
    /// The simulated stage at its converters
    #[arg(long, value_enum)]
    pub stage: StageName,
    /// The firmware's image; by default firmware/target/images/EMULATOR
    #[arg(long, value_name = "FILE")]
    pub image: Option<PathBuf>,
    #[command(flatten)]
    pub wanted: Wanted,
    /// Length of the run, seconds of virtual time
    #[arg(long, default_value_t = 0.2)]
    pub seconds: f64,
    /// Seed of the stage's noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// End the emulator after this many seconds of wall time
    #[arg(long, default_value_t = 600)]
    pub patience: u64,
    /// Folder of the new dataset
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Replace a dataset that is there already
    #[arg(long)]
    pub overwrite: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EmulatorName {
    /// Cortex-M4F
    #[value(name = "mps2-an386")]
    Mps2An386,
    /// Cortex-M7
    #[value(name = "mps2-an500")]
    Mps2An500,
}

impl EmulatorName {
    pub(crate) fn machine(self) -> Machine {
        match self {
            Self::Mps2An386 => Machine::Mps2An386,
            Self::Mps2An500 => Machine::Mps2An500,
        }
    }
}

pub(crate) fn run(args: &RunArgs) -> Result<Done, CliError> {
    let machine = args.emulator.machine();
    let Wish { bank, request, upload } = args.wanted.wish(args.seconds)?;
    let image = args
        .image
        .clone()
        .unwrap_or_else(|| PathBuf::from("firmware/target/images").join(machine.name()));
    let stage = Stage::new(&args.stage.config(), args.seed)?;
    let bar = progress::bar("running");
    let patience = Duration::from_secs(args.patience);
    // An image begins with bank 0.
    let mut changes = Vec::from_iter((bank > 0).then_some(Change::Bank(bank)));
    changes.extend(upload.iter().flat_map(Upload::changes));
    let asked = (&request, &changes[..]);
    let (outcome, recording) = hysteron_board::run(machine, &image, stage, asked, patience, &mut |share| {
        progress::advance(&bar, share);
    })?;
    bar.finish_and_clear();
    let text = report(args, &outcome, &recording);
    write(&dataset(args, &outcome, recording), &args.output, args.overwrite)?;
    output::print(&text)?;
    Ok(Done::Answered)
}

fn dataset(args: &RunArgs, outcome: &Outcome, recording: Recording) -> Dataset {
    let config = args.stage.config();
    Dataset {
        name: format!("{}-board", args.stage.name()),
        description: format!(
            "{} in QEMU at the simulated stage {}, seed {}, {}",
            args.emulator.machine().name(),
            args.stage.name(),
            args.seed,
            table(outcome)
        ),
        known: Known {
            delay_s: Some(config.known_delay_s()),
            sensor_noise_um: None,
            voltage_min_v: Some(config.amplifier.min_v),
            voltage_max_v: Some(config.amplifier.max_v),
        },
        records: vec![record(Piece {
            file: "run.csv".to_owned(),
            excitation: format!(
                "reference {}, {} to {} um",
                args.wanted.words(),
                outcome.setup.low_um,
                outcome.setup.high_um
            ),
            start_s: 0.0,
            period_s: config.sample_period_s,
            recording,
        })],
        notices: Vec::new(),
    }
}

/// Which table ran.
fn table(outcome: &Outcome) -> String {
    let Hello { hash, bank, banks, .. } = &outcome.hello;
    match banks {
        1 => format!("table {}", hex(hash)),
        _ => format!("bank {bank} of {banks}, table {}", hex(hash)),
    }
}

/// Instructions in one period of the timer's 25 MHz at `-icount shift=3`: 40 ns of 8 ns each.
const INSTRUCTIONS_A_COUNT: u64 = 5;

fn report(args: &RunArgs, outcome: &Outcome, recording: &Recording) -> String {
    let timing = &outcome.summary;
    let ticks = recording.frames.len();
    let rms_um = recording.rms_um();
    let fault = fault_line([recording]);
    let instructions = |counts: u64| counts * INSTRUCTIONS_A_COUNT;
    format!(
        "{ticks} ticks, {} overruns, {} edges lost, latency {} to {} instructions, tick {} to {}, mean {:.0} (to {INSTRUCTIONS_A_COUNT})\n\
         {fault}later half of the run: sensor off the reference by {rms_um:.4} um rms, {:.2} % of peak to peak\n\
         {}\nwritten to {}\n",
        timing.overruns,
        timing.lost,
        instructions(timing.latency_min.into()),
        instructions(timing.latency_max.into()),
        instructions(timing.tick_min.into()),
        instructions(timing.tick_max.into()),
        instructions(timing.tick_sum) as f64 / ticks.max(1) as f64,
        100.0 * rms_um / f64::from(outcome.setup.high_um - outcome.setup.low_um),
        table(outcome),
        args.output.display(),
    )
}
