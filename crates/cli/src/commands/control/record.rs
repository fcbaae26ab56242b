//! `hysteron campaign`: on a simulated stage, by a board at a real one, on a stage in a process, or as files for one's own.

use crate::commands::board::known_delay_line;
use crate::commands::control::{on_process::stage as process_stage, own_stage, range_um, stage};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_control::campaign::{Campaign, Protocol, on_process};
use hysteron_control::message::Setting;
use hysteron_control::plan::came_back::{Given, USUAL_SEED, within};
use hysteron_data::{Known, Overwrite, write_dataset};
use hysteron_report::{misfit_text, records_text};
use hysteron_tracking::campaign::campaign;
use hysteron_trials::campaign::{Asked, record};
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "Examples:\n  hysteron campaign --stage 8k -o records\n  hysteron design records -o controller.toml\n  \
    hysteron track controller.toml --stage 8k\n\n\
    What is recorded: a small multisine about a bias (modes, first guess of the lag), two holds of 12 s (creep),\n\
    large signals, and two passes along references with the inverse identified so far. 37 s of records; on disk 50 MB.\n\n\
    On a stage of your own, commands as files (time_s, voltage_v), each to be played from rest at 0 V, or all.csv:\n  \
    hysteron campaign --top-v 150 --rate-hz 50000 --latency-us 20 -o plan    # frf-small.csv, hold.csv, ..., all.csv, campaign.toml\n  \
    hysteron import recorded/*.csv -o back                                   # any names and order: voltages tell which is which\n  \
    hysteron campaign --recorded back -o records                             # checks; writes plan/pass1\n\n\
    Record what is in plan/pass1, import all of it again, and so on until nothing more is asked for.\n\n\
    On a stage of your own as a process that reads volts and writes positions, all of it at once:\n  \
    hysteron campaign --process 'python3 stage.py' --top-v 150 --rate-hz 50000 -o records\n\n\
    By a board that runs this firmware, with any table, at a stage that has rested at 0 V; sines, minor loops, multisine, noise, holds\n\
    in references of 256 points, 48 s of records and the rests between them:\n  \
    hysteron campaign --board localhost:9090 --range 0.5,14 -o records\n  \
    hysteron learn records --model play-polynomial -o model.toml\n  \
    hysteron design model.toml -o controller.toml"
)]
pub(crate) struct CampaignArgs {
    /// The simulated stage: paper-rate, paper-delay, 8k, 2.5k or 739
    #[arg(
        long,
        value_name = "PRESET",
        conflicts_with_all = ["top_v", "board"],
        required_unless_present_any = ["top_v", "board", "recorded"]
    )]
    pub stage: Option<String>,
    /// A board instead, which plays the references and reads the sensor: server of its telemetry's RTT channel 1
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "top_v")]
    pub board: Option<String>,
    /// A stage of your own in any language instead: a program, with its arguments, that reads volts and writes positions, a line each; see
    /// docs/reference/process.md
    #[arg(long, value_name = "COMMAND", conflicts_with_all = ["stage", "board", "recorded"], requires = "top_v")]
    pub process: Option<String>,
    /// Longest wait for an answer of the process, seconds
    #[arg(long, value_name = "S", default_value_t = 10.0, requires = "process")]
    pub timeout: f64,
    /// Which of the board's tables runs, from 0 on; 0 where it is not given
    #[arg(long, requires_all = ["board", "range"])]
    pub bank: Option<u8>,
    /// Lowest and highest reference of a board, micrometres by its table; by default the table's range less 2 % at either end
    #[arg(
        long,
        value_name = "LOW,HIGH",
        value_delimiter = ',',
        num_args = 1,
        requires = "board",
        allow_negative_numbers = true
    )]
    pub range: Option<Vec<f64>>,
    /// Slow references for `design --along` instead of the programme, over the middle and lower part of the range: 9 s of records
    #[arg(long, requires = "board")]
    pub training: bool,
    /// Rest at the board's safe level before each record, seconds: what creeps from one record into the next is in no file
    #[arg(long, value_name = "S", default_value_t = 10.0, requires = "board")]
    pub rest_s: f64,
    /// Instead of a simulated stage: the highest voltage to use on your own, volts at the actuator; the lowest is 0 V
    #[arg(long, value_name = "V", requires = "rate_hz")]
    pub top_v: Option<f64>,
    /// Sample rate that your controller will run at, and that the commands are played and recorded at, hertz
    #[arg(long, value_name = "HZ", requires = "top_v")]
    pub rate_hz: Option<f64>,
    /// What came back of a plan: a dataset with a record of each command, or one of all.csv; the voltages tell which is which
    #[arg(long, value_name = "DATASET", conflicts_with_all = ["stage", "board"])]
    pub recorded: Option<PathBuf>,
    /// Folder of the plan that was recorded; plan where it is not given
    #[arg(long, value_name = "FOLDER", requires = "recorded")]
    pub plan: Option<PathBuf>,
    /// Take records that began while the stage still moved: what it creeps there, the model takes for hysteresis
    #[arg(long, requires = "recorded")]
    pub short_rests: bool,
    /// Latency of your controller, microseconds: from the instant of a reading to the edge of the command that is computed from it, without the
    /// half sample for which a command is held on average
    #[arg(long, value_name = "US", conflicts_with_all = ["stage", "board"])]
    pub latency_us: Option<f64>,
    /// Bandwidth of your sensor, hertz: its filter of first order leaves 0.71 (-3 dB) there. The records cannot tell it from the amplifier's lag
    #[arg(long, value_name = "HZ", conflicts_with_all = ["stage", "board"])]
    pub sensor_bandwidth_hz: Option<f64>,
    /// Seed of the noise, and of excitations that are random; 1 where it is not given
    #[arg(long)]
    pub seed: Option<u64>,
    /// Folder of the new dataset
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Replace a dataset that is there already
    #[arg(long)]
    pub overwrite: bool,
}

pub(crate) fn run(args: &CampaignArgs) -> Result<Done, CliError> {
    if let Some(from) = &args.board {
        return by_a_board(args, from);
    }
    if let Some(name) = &args.stage {
        return simulated(args, name);
    }
    let given = given(args);
    if let Some(recorded) = &args.recorded {
        given.check_chain()?;
        return own_stage::came_back(args, &given, recorded);
    }
    let protocol = given.protocol()?;
    match &args.process {
        Some(command) => in_a_process(args, &protocol, command),
        None => own_stage::write_plan(args, &given),
    }
}

/// What a person says of a stage of their own.
fn given(args: &CampaignArgs) -> Given {
    Given {
        top_v: args.top_v,
        rate_hz: args.rate_hz,
        latency_us: args.latency_us,
        sensor_bandwidth_hz: args.sensor_bandwidth_hz,
        seed: args.seed,
        short_rests: args.short_rests,
    }
}

/// The seed that was given, or the usual one.
fn seed(args: &CampaignArgs) -> u64 {
    args.seed.unwrap_or(USUAL_SEED)
}

fn simulated(args: &CampaignArgs, name: &str) -> Result<Done, CliError> {
    let stage = stage(name)?;
    let bar = progress::bar("recording");
    let done = campaign(name, &stage, seed(args), &|share| progress::advance(&bar, share))?;
    bar.finish_and_clear();
    complete(args, &done)
}

fn in_a_process(args: &CampaignArgs, protocol: &Protocol, command: &str) -> Result<Done, CliError> {
    let latency_s = args.latency_us.map_or(0.0, |latency_us| 1e-6 * latency_us);
    output::refuse_to_replace(&args.output, args.overwrite)?;
    let stage = process_stage(command, args.timeout)?;
    let bar = progress::bar("recording on the process");
    let known = Known {
        delay_s: Some(latency_s + 0.5 * protocol.period_s),
        sensor_bandwidth_hz: args.sensor_bandwidth_hz,
        ..Known::default()
    };
    let done = on_process(&stage, protocol, known, &|share| progress::advance(&bar, share))?;
    bar.finish_and_clear();
    complete(args, &done)
}

/// Writes a campaign with all its passes.
fn complete(args: &CampaignArgs, done: &Campaign) -> Result<Done, CliError> {
    write_dataset(&done.records, &args.output, overwrite(args))?;
    let folder = args.output.display();
    output::print(&format!(
        "{}{}\nwritten to {folder}\nnext: hysteron design {folder} -o controller.toml\n",
        records_text(&done.records.records),
        misfit_text(done.model.misfit_percent)
    ))?;
    Ok(Done::Answered)
}

fn by_a_board(args: &CampaignArgs, from: &str) -> Result<Done, CliError> {
    within(Setting::RestS, args.rest_s, [0.0, 3600.0], "s")?;
    output::refuse_to_replace(&args.output, args.overwrite)?;
    let asked = Asked {
        from,
        bank: args.bank.unwrap_or(0),
        range_um: range_um(args.range.as_deref())?,
        rest_s: args.rest_s,
        training: args.training,
        seed: seed(args),
    };
    let bar = progress::bar("recording on the board");
    let records = record(&asked, &|what, share| progress::show(&bar, what, share));
    bar.finish_and_clear();
    let records = records?;
    write_dataset(&records, &args.output, overwrite(args))?;
    let folder = args.output.display();
    let next = match args.training {
        true => format!("hysteron design model.toml --along {folder} -o controller.toml"),
        false => format!("hysteron learn {folder} --model play-polynomial -o model.toml"),
    };
    output::print(&format!(
        "{}\n{}written to {folder}\nnext: {next}\n",
        records_text(&records.records),
        known_delay_line(records.known.delay_s)
    ))?;
    Ok(Done::Answered)
}

pub(super) fn overwrite(args: &CampaignArgs) -> Overwrite {
    if args.overwrite {
        Overwrite::Allow
    } else {
        Overwrite::Refuse
    }
}
