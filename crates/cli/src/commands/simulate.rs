//! `hysteron simulate`.

use crate::commands::excitation::ExcitationChoice;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::{Args, ValueEnum};
use hysteron_challenge::examples::{Planned, default_campaign, record};
use hysteron_data::{Overwrite, Role, write_dataset};
use hysteron_plant::{StageConfig, preset};
use std::collections::HashMap;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Examples:\n  hysteron simulate --stage paper-rate -o stage\n  \
    hysteron simulate --stage paper-delay --excitation sine:hz=100,high_v=26,periods=5 \\\n      \
    --excitation multisine:high_hz=1000 --validate noise:band_hz=200,seconds=0.5 --seed 7 -o stage\n\n\
    SPEC is one of these, each value with its default:\n  \
    sine:hz=100,low_v=0,high_v=26,periods=5\n  \
    triangle:hz=10,low_v=0,high_v=26,periods=3\n  \
    complex-harmonic:hz=100,full_v=26,periods=5\n  \
    decaying-triangle:high_v=26,centre_v=13,decay=0.85,turns=12,slope_v_per_s=2000\n  \
    staircase:high_v=26,levels=5,hold_s=0.1,transition_s=0.001\n  \
    rest:v=13,seconds=0.2\n  \
    sweep:from_hz=10,to_hz=500,seconds=1,low_v=0,high_v=26\n  \
    multisine:low_hz=5,high_hz=500,period_s=0.2,periods=3,bias_v=13,peak_v=12\n  \
    noise:band_hz=300,seconds=0.5,rms_v=4,low_v=0,high_v=26")]
pub(crate) struct SimulateArgs {
    /// The simulated stage
    #[arg(long, value_enum)]
    pub stage: StageName,
    /// An excitation whose record models are fitted to; may be given several times
    #[arg(long, value_name = "SPEC")]
    pub excitation: Vec<ExcitationChoice>,
    /// An excitation whose record models are judged on; may be given several times
    #[arg(long, value_name = "SPEC")]
    pub validate: Vec<ExcitationChoice>,
    /// Sample rate of the records, hertz; at most the controller's 50000
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
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

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum StageName {
    /// The paper's stage, its rate dependence in the hysteresis, and a mode at 8 kHz
    PaperRate,
    /// The paper's stage, static hysteresis behind a delay and the sensor's filter
    PaperDelay,
    /// A stage for tracking, 20 um at 200 V with creep, its first mode at 8 kHz
    #[value(name = "8k")]
    Tracking8k,
    /// The same with modes at 2.5 and 7.75 kHz
    #[value(name = "2.5k")]
    Tracking2k5,
    /// The same with modes at 739 Hz and 2.29 kHz
    #[value(name = "739")]
    Tracking739,
}

impl StageName {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::PaperRate => "paper-rate",
            Self::PaperDelay => "paper-delay",
            Self::Tracking8k => "8k",
            Self::Tracking2k5 => "2.5k",
            Self::Tracking739 => "739",
        }
    }

    pub(crate) fn config(self) -> StageConfig {
        match self {
            Self::PaperRate => preset::paper_rate(),
            Self::PaperDelay => preset::paper_delay(),
            Self::Tracking8k => preset::tracking_8k(),
            Self::Tracking2k5 => preset::tracking_2k5(),
            Self::Tracking739 => preset::tracking_739(),
        }
    }
}

pub(crate) fn run(args: &SimulateArgs) -> Result<Done, CliError> {
    let stage = args.stage.config();
    let controller_hz = 1.0 / stage.sample_period_s;
    let rate_hz = args.rate.unwrap_or(controller_hz);
    if !(rate_hz.is_finite() && rate_hz > 0.0 && rate_hz <= controller_hz * (1.0 + 1e-9)) {
        return Err(CliError::Option(format!(
            "--rate {rate_hz}: a number of hertz above 0 and at most {controller_hz:.0}, the stage's controller"
        )));
    }
    let plan = plan(args);
    let bar = progress::bar("simulating");
    let dataset = record(args.stage.name(), &stage, &plan, 1.0 / rate_hz, args.seed, &|share| {
        progress::advance(&bar, share);
    })?;
    bar.finish_and_clear();
    let overwrite = if args.overwrite {
        Overwrite::Allow
    } else {
        Overwrite::Refuse
    };
    write_dataset(&dataset, &args.output, overwrite)?;
    let mut text = String::new();
    for record in &dataset.records {
        let role = record.role.name();
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{role:<9} {:<28} {:>8} samples  {}",
            record.file,
            record.len(),
            record.excitation
        );
    }
    let folder = args.output.display();
    let _ = writeln!(text, "\nwritten to {folder}\nnext: hysteron fit {folder} --model mrpi");
    output::print(&text)?;
    Ok(Done::Answered)
}

/// What was asked for, or the default campaign; files of one kind get numbers.
fn plan(args: &SimulateArgs) -> Vec<Planned> {
    if args.excitation.is_empty() && args.validate.is_empty() {
        return default_campaign(args.stage.config().hysteresis.reference_v, args.seed);
    }
    let mut taken: HashMap<String, usize> = HashMap::new();
    let identify = args.excitation.iter().map(|choice| (Role::Identify, choice));
    let validate = args.validate.iter().map(|choice| (Role::Validate, choice));
    identify
        .chain(validate)
        .enumerate()
        .map(|(number, (role, choice))| {
            let stem = choice.stem();
            let count = taken.entry(stem.clone()).or_default();
            *count += 1;
            Planned {
                name: if *count == 1 { stem } else { format!("{stem}-{count}") },
                role,
                periodic: choice.is_periodic(),
                excitation: choice.build(args.seed.wrapping_add(number as u64)),
            }
        })
        .collect()
}
