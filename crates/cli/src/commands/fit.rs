//! `hysteron fit`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::{Args, ValueEnum};
use hysteron_identify::family::FADING_ELEMENTS;
use hysteron_identify::objective::Weighting;
use hysteron_identify::{Direction, Family, FitOptions, FitReport, Method, Model, Placement};
use hysteron_report::model_text;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron fit stage --model mrpi --plays 10 -o model.toml")]
pub(crate) struct FitArgs {
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The hysteresis model
    #[arg(long, value_enum, default_value_t = ModelName::Mpi)]
    pub model: ModelName,
    /// Number of play operators, or of fading elements, 1 to 64; 10, and 4 of duhem
    #[arg(long)]
    pub plays: Option<usize>,
    /// Where the thresholds of the plays stand
    #[arg(long, value_enum, default_value_t = ThresholdsName::Data)]
    pub thresholds: ThresholdsName,
    /// forward: voltage to position; inverse: position to voltage, for feedforward
    #[arg(long, value_enum, default_value_t = DirectionName::Forward)]
    pub direction: DirectionName,
    /// separable: least squares, deterministic; mpso: the paper's particle swarm with its weights (eqs 17, 18)
    #[arg(long, value_enum, default_value_t = MethodName::Separable)]
    pub method: MethodName,
    /// Seed of the particle swarm
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Where to write the model
    #[arg(short, long, default_value = "model.toml")]
    pub output: PathBuf,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ModelName {
    /// Prandtl-Ishlinskii (eq. 5)
    Pi,
    /// Modified Prandtl-Ishlinskii (eq. 6)
    Mpi,
    /// Rate-dependent weights
    Wrpi,
    /// Modified rate-dependent Prandtl-Ishlinskii (eq. 10)
    Mrpi,
    /// A cubic of each play's output
    PlayPolynomial,
    /// Powers of the voltage that fade along its path
    Duhem,
}

impl ModelName {
    /// As many plays as are asked for, the paper's ten, or the fading elements that do.
    pub(crate) fn plays(self, asked: Option<usize>) -> usize {
        asked.unwrap_or(if self == Self::Duhem { FADING_ELEMENTS } else { 10 })
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DirectionName {
    /// Voltage to position
    Forward,
    /// Position to voltage (eqs 12, 13)
    Inverse,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodName {
    /// Separable least squares
    Separable,
    /// Modified particle swarm
    Mpso,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ThresholdsName {
    /// Where the records exercise the plays
    Data,
    /// Evenly spaced from zero (eq. 16)
    Eq16,
    /// Logarithmic from half a percent of the range
    Log,
}

pub(crate) fn run(args: &FitArgs) -> Result<Done, CliError> {
    let dataset = load::dataset(&args.data)?;
    let options = options(args);
    let bar = progress::bar(&format!("fitting {}", options.family));
    let report = hysteron_identify::fit(&dataset, &options, &|share| progress::advance(&bar, share))?;
    bar.finish_and_clear();
    report.model.write(&args.output)?;
    if args.json {
        output::print_json(&json(args, &report))?;
    } else {
        output::print(&text(args, &report))?;
    }
    Ok(Done::Answered)
}

impl From<ModelName> for Family {
    fn from(name: ModelName) -> Self {
        match name {
            ModelName::Pi => Self::Pi,
            ModelName::Mpi => Self::Mpi,
            ModelName::Wrpi => Self::Wrpi,
            ModelName::Mrpi => Self::Mrpi,
            ModelName::PlayPolynomial => Self::PlayPolynomial,
            ModelName::Duhem => Self::Duhem,
        }
    }
}

fn options(args: &FitArgs) -> FitOptions {
    let method = match args.method {
        MethodName::Separable => Method::Separable,
        MethodName::Mpso => Method::Mpso,
    };
    FitOptions {
        family: args.model.into(),
        direction: match args.direction {
            DirectionName::Forward => Direction::Forward,
            DirectionName::Inverse => Direction::Inverse,
        },
        plays: args.model.plays(args.plays),
        placement: match args.thresholds {
            ThresholdsName::Data => Placement::Data,
            ThresholdsName::Eq16 => Placement::Eq16,
            ThresholdsName::Log => Placement::Log,
        },
        method,
        // The paper's swarm minimises the paper's objective.
        weighting: if method == Method::Mpso {
            Weighting::LoopOpening
        } else {
            Weighting::Record
        },
        seed: args.seed,
    }
}

fn text(args: &FitArgs, report: &FitReport) -> String {
    let (data, output) = (args.data.display(), args.output.display());
    format!(
        "{}\nwritten to {output}\nnext: hysteron compare {data} {output}\n",
        model_text(&report.model)
    )
}

fn json(args: &FitArgs, report: &FitReport) -> serde_json::Value {
    let model: &Model = &report.model;
    let parameters: Vec<_> = model
        .parameters()
        .into_iter()
        .map(|p| serde_json::json!({"name": p.name, "value": p.value, "unit": p.unit, "standard_error": p.standard_error}))
        .collect();
    serde_json::json!({
        "model": model.family.name(),
        "direction": model.direction.name(),
        "file": args.output,
        "objective": report.objective,
        "input_unit": model.direction.input_unit(),
        "thresholds": model.thresholds,
        "parameters": parameters,
        "fitted_on": model.fitted_on,
        "notices": model.notices,
    })
}
