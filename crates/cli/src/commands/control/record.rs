//! `hysteron campaign`: on a simulated stage, by a board at a real one, on a stage in a process, or as files for one's own.

use crate::commands::board::known_delay_line;
use crate::commands::control::campaign_on_board::{self, Asked};
use crate::commands::control::{on_process::stage as process_stage, range_um, stage};
use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_control::ControlError;
use hysteron_control::campaign::{Campaign, Command, Protocol, TRAINING_PASSES, on_process};
use hysteron_control::usable::usable;
use hysteron_data::{Dataset, Overwrite, Record, write_dataset};
use hysteron_identify::control::identify;
use hysteron_tracking::campaign::campaign;
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(
    after_help = "Examples:\n  hysteron campaign --stage 8k -o records\n  hysteron design records -o controller.toml\n  \
    hysteron track controller.toml --stage 8k\n\n\
    What is recorded: a small multisine about a bias (modes, first guess of the lag), two holds of 12 s (creep),\n\
    large signals, and two passes along references with the inverse identified so far. 37 s of records; on disk 50 MB.\n\n\
    On a stage of your own, commands as files (time_s, voltage_v), each to be played from rest at 0 V:\n  \
    hysteron campaign --top-v 150 --rate-hz 50000 -o plan                  # frf-small.csv, hold.csv, large-...csv\n  \
    hysteron import recorded/*.csv -o back                                 # same names, with position_um\n  \
    hysteron campaign --top-v 150 --rate-hz 50000 --recorded back --latency-us 30 -o records    # checks; writes records/next\n\n\
    Play what is in records/next, import all of it again, and so on until nothing more is asked for.\n\n\
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
        required_unless_present_any = ["top_v", "board"]
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
    /// What came back: a dataset with a record of each command, under the command's name
    #[arg(long, value_name = "DATASET", requires = "top_v")]
    pub recorded: Option<PathBuf>,
    /// Latency of your controller from reading to command, microseconds: where the dataset does not say it, or where the process has it
    #[arg(long, value_name = "US", requires = "top_v")]
    pub latency_us: Option<f64>,
    /// Seed of the noise, and of excitations that are random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
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
    match (&args.stage, args.top_v, args.rate_hz) {
        (Some(name), ..) => simulated(args, name),
        (None, Some(top_v), Some(rate_hz)) => {
            within("--top-v", top_v, [1.0, 1e3], "V")?;
            within("--rate-hz", rate_hz, [1e3, 1e6], "Hz")?;
            let protocol = Protocol {
                period_s: 1.0 / rate_hz,
                top_v,
                seed: args.seed,
            };
            match (&args.process, &args.recorded) {
                (Some(command), _) => in_a_process(args, &protocol, command),
                (None, Some(recorded)) => came_back(args, &protocol, recorded),
                (None, None) if args.latency_us.is_some() => Err(CliError::Option(
                    "--latency-us belongs to what was recorded: give --recorded DATASET or --process COMMAND"
                        .to_owned(),
                )),
                (None, None) => plan(args, &protocol),
            }
        }
        // What clap has refused already.
        _ => Err(CliError::Option(
            "give --stage, --board, or --top-v and --rate-hz".to_owned(),
        )),
    }
}

fn within(option: &str, value: f64, [min, max]: [f64; 2], unit: &str) -> Result<(), CliError> {
    // A NaN fails both comparisons.
    if value >= min && value <= max {
        return Ok(());
    }
    Err(CliError::Option(format!(
        "{option} {value}: give {min} to {max} {unit}"
    )))
}

fn simulated(args: &CampaignArgs, name: &str) -> Result<Done, CliError> {
    let stage = stage(name)?;
    let bar = progress::bar("recording");
    let done = campaign(name, &stage, args.seed, &|share| progress::advance(&bar, share))?;
    bar.finish_and_clear();
    complete(args, &done)
}

fn in_a_process(args: &CampaignArgs, protocol: &Protocol, command: &str) -> Result<Done, CliError> {
    let latency_s = latency_s(args)?.unwrap_or(0.0);
    output::refuse_to_replace(&args.output, args.overwrite)?;
    let stage = process_stage(command, args.timeout)?;
    let bar = progress::bar("recording on the process");
    let done = on_process(&stage, protocol, latency_s, &|share| progress::advance(&bar, share))?;
    bar.finish_and_clear();
    complete(args, &done)
}

/// Writes a campaign with all its passes.
fn complete(args: &CampaignArgs, done: &Campaign) -> Result<Done, CliError> {
    write_dataset(&done.records, &args.output, overwrite(args))?;
    let folder = args.output.display();
    output::print(&format!(
        "{}{}\nwritten to {folder}\nnext: hysteron design {folder} -o controller.toml\n",
        listed(&done.records.records),
        misses(done.model.misfit_percent)
    ))?;
    Ok(Done::Answered)
}

/// The latency that was given.
fn latency_s(args: &CampaignArgs) -> Result<Option<f64>, CliError> {
    if let Some(latency_us) = args.latency_us {
        within("--latency-us", latency_us, [0.0, 1e4], "us")?;
    }
    Ok(args.latency_us.map(|latency_us| 1e-6 * latency_us))
}

fn by_a_board(args: &CampaignArgs, from: &str) -> Result<Done, CliError> {
    within("--rest-s", args.rest_s, [0.0, 3600.0], "s")?;
    output::refuse_to_replace(&args.output, args.overwrite)?;
    let records = campaign_on_board::record(&Asked {
        from,
        bank: args.bank.unwrap_or(0),
        range_um: range_um(args.range.as_deref())?,
        rest_s: args.rest_s,
        training: args.training,
        seed: args.seed,
    })?;
    write_dataset(&records, &args.output, overwrite(args))?;
    let folder = args.output.display();
    let next = match args.training {
        true => format!("hysteron design model.toml --along {folder} -o controller.toml"),
        false => format!("hysteron learn {folder} --model play-polynomial -o model.toml"),
    };
    output::print(&format!(
        "{}\n{}written to {folder}\nnext: {next}\n",
        listed(&records.records),
        known_delay_line(records.known.delay_s)
    ))?;
    Ok(Done::Answered)
}

fn overwrite(args: &CampaignArgs) -> Overwrite {
    if args.overwrite {
        Overwrite::Allow
    } else {
        Overwrite::Refuse
    }
}

/// How well what is identified from records explains their commands.
fn misses(misfit_percent: f64) -> String {
    format!("identified from them: the inverse misses the commands by {misfit_percent:.3} % of their range\n")
}

/// The records.
fn listed(records: &[Record]) -> String {
    let mut text = String::new();
    let mut total_s = 0.0;
    for record in records {
        total_s += record.duration_s();
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<32} {:>8} samples  {:>7.3} s  {}",
            record.file,
            record.len(),
            record.duration_s(),
            record.excitation
        );
    }
    let _ = writeln!(text, "\n{total_s:.1} s of records");
    text
}

/// The commands to begin with, as files.
fn plan(args: &CampaignArgs, protocol: &Protocol) -> Result<Done, CliError> {
    let text = write_commands(&protocol.first()?, &args.output)?;
    output::print(&format!(
        "{text}\nplay each from rest at 0 V and record it from its first sample on, with the position, under the same name\nnext: {}\n",
        again(args, "BACK")
    ))?;
    Ok(Done::Answered)
}

/// How to come back with records.
fn again(args: &CampaignArgs, recorded: &str) -> String {
    let latency = args
        .latency_us
        .map_or("US".to_owned(), |latency_us| latency_us.to_string());
    format!(
        "hysteron campaign --top-v {} --rate-hz {} --recorded {recorded} --latency-us {latency} -o records",
        args.top_v.unwrap_or(f64::NAN),
        args.rate_hz.unwrap_or(f64::NAN)
    )
}

/// Checks what came back, identifies, and asks for the next pass until both are there.
fn came_back(args: &CampaignArgs, protocol: &Protocol, folder: &Path) -> Result<Done, CliError> {
    let latency_s = latency_s(args)?;
    let recorded = load::dataset(folder)?;
    let checked = |commands: &[Command]| {
        usable(commands, &recorded).map_err(|wrong| ControlError::Unusable {
            wrong,
            asked: commands.len(),
        })
    };
    let mut dataset = Dataset {
        name: recorded.name.clone(),
        description: format!("campaign for control, seed {}", args.seed),
        known: recorded.known,
        records: checked(&protocol.first()?)?,
        ..Dataset::default()
    };
    dataset.known.delay_s = latency_s.or(dataset.known.delay_s);
    if dataset.known.delay_s.is_none() {
        return Err(CliError::Option(
            "the latency of your controller, from reading to command, is not known: give --latency-us, or delay_s under [known] in \
             dataset.toml"
                .to_owned(),
        ));
    }
    dataset.known.voltage_min_v = dataset.known.voltage_min_v.or(Some(0.0));
    dataset.known.voltage_max_v = dataset.known.voltage_max_v.or(Some(protocol.top_v));
    let mut model = identify(&dataset)?;
    let mut next = None;
    for pass in 1..=TRAINING_PASSES {
        let commands = protocol.training(&model, pass)?;
        let any = commands
            .iter()
            .any(|command| recorded.records.iter().any(|record| record.file == command.file));
        if !any {
            next = Some(commands);
            break;
        }
        dataset.records.extend(checked(&commands)?);
        model = identify(&dataset)?;
    }
    write_dataset(&dataset, &args.output, overwrite(args))?;
    let mut text = listed(&dataset.records) + &misses(model.misfit_percent);
    let folder = args.output.display();
    // Writing to a String does not fail.
    let _ = match next {
        Some(commands) => {
            let to = args.output.join("next");
            let list = write_commands(&commands, &to)?;
            writeln!(
                text,
                "\nwritten to {folder}; play these as well, made with what is known so far:\n\n{list}\nnext: import all records so far, \
                 then {} --overwrite",
                again(args, "ALL")
            )
        }
        None => writeln!(
            text,
            "\nwritten to {folder}\nnext: hysteron design {folder} -o controller.toml"
        ),
    };
    output::print(&text)?;
    Ok(Done::Answered)
}

/// Commands as files; which ones, in words.
fn write_commands(commands: &[Command], folder: &Path) -> Result<String, CliError> {
    let mut list = String::new();
    for command in commands {
        let mut text = String::from("time_s,voltage_v\n");
        for (k, voltage_v) in command.voltage_v.iter().enumerate() {
            // Writing to a String does not fail.
            let _ = writeln!(text, "{:.7},{voltage_v:.6}", k as f64 * command.period_s);
        }
        let path = folder.join(&command.file);
        output::write_file(&path, &text)?;
        let n = command.voltage_v.len();
        let _ = writeln!(
            list,
            "{:<40} {n:>8} samples  {:>7.3} s  {}",
            path.display(),
            n as f64 * command.period_s,
            command.words
        );
    }
    Ok(list)
}
