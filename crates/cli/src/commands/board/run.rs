//! `hysteron board run`.

use crate::commands::board::wanted::Wanted;
use crate::commands::board::{Axis, fault_line, write};
use crate::commands::simulate::StageName;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::{Args, ValueEnum};
use hysteron_board::{Machine, Outcome};
use hysteron_report::adapted_line;
use hysteron_tracking::scans::SHARES;
use hysteron_trials::recording::{Emulated, On, Ran};
use std::path::PathBuf;
use std::time::Duration;

#[derive(Args)]
#[command(after_help = "Example:\n  \
    cargo xtask firmware build\n  \
    hysteron board run --emulator mps2-an386 --stage paper-rate --hz 100 -o board\n  \
    hysteron compare board model.toml\n\n\
    Both axes:\n  \
    cargo xtask firmware build firmware/tables/tracking-x.toml --y firmware/tables/tracking-y.toml\n  \
    hysteron board run --emulator mps2-an386 --stage 8k --stage-y 739 --low 3 --high 13 --hz-y 37 -o board")]
pub(crate) struct RunArgs {
    /// The machine
    #[arg(long, value_enum)]
    pub emulator: EmulatorName,
    /// The simulated stage at its converters
    #[arg(long, value_enum)]
    pub stage: StageName,
    /// The second axis' simulated stage, for an image of both axes
    #[arg(long, value_enum, conflicts_with_all = ["bank", "trajectory"])]
    pub stage_y: Option<StageName>,
    /// Frequency of a sine of the second axis, hertz; without it that stands still
    #[arg(long, value_name = "HZ", requires = "stage_y")]
    pub hz_y: Option<f64>,
    /// Shares of Y's motion that reach X and of X's that reach Y; 0.01,-0.006 where they are not given
    #[arg(
        long,
        value_name = "OF_Y,OF_X",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true,
        requires = "stage_y"
    )]
    pub cross: Option<Vec<f64>>,
    /// Which axis is recorded; the other's command goes into the record as well
    #[arg(long, default_value = "x", requires = "stage_y")]
    pub axis: Axis,
    /// The firmware's image; by default firmware/target/images/EMULATOR, of both axes EMULATOR-xy
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
    output::refuse_to_replace(&args.output, args.overwrite)?;
    let bar = progress::bar("running");
    let ran = ran(args, &|share| progress::advance(&bar, share));
    bar.finish_and_clear();
    let mut ran = ran?;
    let text = report(args, &ran);
    let recorded = ran.swap_remove(usize::from(args.axis == Axis::Y));
    let dataset = recorded.dataset((args.emulator.machine(), args.seed), ran.pop());
    write(&dataset, &args.output, args.overwrite)?;
    output::print(&text)?;
    Ok(Done::Answered)
}

impl RunArgs {
    fn image(&self) -> PathBuf {
        let machine = self.emulator.machine().name();
        let both = if self.stage_y.is_some() { "-xy" } else { "" };
        let usual = || PathBuf::from(format!("firmware/target/images/{machine}{both}"));
        self.image.clone().unwrap_or_else(usual)
    }
}

fn ran(args: &RunArgs, progress: &dyn Fn(f64)) -> Result<Vec<Ran>, CliError> {
    let image = args.image();
    let emulated = Emulated {
        machine: args.emulator.machine(),
        image: &image,
        seed: args.seed,
        patience: Duration::from_secs(args.patience),
    };
    let wish = args.wanted.wish(args.seconds)?;
    let on = |stage: StageName, excitation| On {
        name: stage.name(),
        stage: stage.config(),
        excitation,
    };
    let x = on(args.stage, args.wanted.words());
    let Some(stage_y) = args.stage_y else {
        return Ok(vec![emulated.one(x, &wish, progress)?]);
    };
    let shares = match args.cross.as_deref() {
        None => SHARES,
        Some(&[of_y, of_x]) => [of_y, of_x],
        Some(given) => {
            return Err(CliError::Option(format!(
                "--cross {given:?}: two shares of the other's motion, that of Y in X first, such as 0.01,-0.006"
            )));
        }
    };
    let of_y = args
        .hz_y
        .map_or("stands still".to_owned(), |hz| format!("sine {hz} Hz"));
    let axes = [x, on(stage_y, of_y)];
    Ok(emulated.both(axes, shares, (&wish.request, args.hz_y), progress)?)
}

/// Times of the ticks, then a line an axis.
fn report(args: &RunArgs, ran: &[Ran]) -> String {
    let fault = fault_line(ran.iter().find_map(Ran::fault));
    let mut text = ran.first().map_or(String::new(), |first| {
        times(&first.outcome, first.recording.frames.len())
    });
    text += &fault;
    let several = ran.len() > 1;
    for (ran, axis) in ran.iter().zip(["X", "Y"]) {
        let rms_um = ran.recording.rms_um();
        let setup = &ran.outcome.setup;
        let of_axis = if several { format!("{axis}: ") } else { String::new() };
        text += &format!(
            "{of_axis}later half of the run: sensor off the reference by {rms_um:.4} um rms, {:.2} % of peak to peak\n{of_axis}{}\n",
            100.0 * rms_um / f64::from(setup.high_um - setup.low_um),
            ran.table(),
        );
        let learned = ran.adapted();
        text += &learned.map_or_else(String::new, |learned| format!("{of_axis}{}\n", adapted_line(&learned)));
    }
    text + &format!("written to {}\n", args.output.display())
}

fn times(outcome: &Outcome, ticks: usize) -> String {
    let (timing, a_count) = (&outcome.summary, outcome.instructions_a_count);
    let instructions = |counts: u32| u64::from(counts) * a_count;
    format!(
        "{ticks} ticks, {} overruns, {} edges lost, latency {} to {} instructions, tick {} to {}, {} but for the one that \
         starts, mean {:.0} (to {a_count})\n",
        timing.overruns,
        timing.lost,
        instructions(timing.latency_min),
        instructions(timing.latency_max),
        instructions(timing.tick_min),
        instructions(timing.tick_max),
        instructions(timing.running_max),
        (timing.tick_sum * a_count) as f64 / ticks.max(1) as f64,
    )
}
