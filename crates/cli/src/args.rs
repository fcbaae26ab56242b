//! The command line: names, defaults, help with an example each.

use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Model a piezo stage's hysteresis, compare it with measurements, see where it fails.
#[derive(Parser)]
#[command(name = "hysteron", version, propagate_version = true, arg_required_else_help = true)]
#[command(after_help = "Start with `hysteron demo`, or with your own recordings:\n  \
    hysteron import scope.csv -o stage\n  hysteron fit stage --model mrpi -o model.toml\n  \
    hysteron compare stage model.toml -o page.html\n\n\
    Exit codes: 0 an answer was given; 1 a limit asked for is exceeded; 2 bad input.")]
pub(crate) struct Args {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Identify a model from the records with role `identify`
    Fit(FitArgs),
    /// Compare a model with every record: how far off, and where
    Compare(CompareArgs),
}

#[derive(ClapArgs)]
#[command(after_help = "Example:\n  hysteron fit stage --model mrpi --plays 10 -o model.toml")]
pub(crate) struct FitArgs {
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The hysteresis model
    #[arg(long, value_enum)]
    pub model: ModelName,
    /// Number of play operators, 1 to 64
    #[arg(long, default_value_t = 10)]
    pub plays: usize,
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

#[derive(ClapArgs)]
#[command(after_help = "Example:\n  hysteron compare stage model.toml -o page.html\n  \
    hysteron compare stage model.toml --json --fail-above 2.5    # in CI")]
pub(crate) struct CompareArgs {
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The model to compare with
    pub model: PathBuf,
    /// Exit with 1 if the pooled error (eq. 19) on validation records exceeds this percentage; on the records it was
    /// fitted to where there are no others
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    pub fail_above: Option<f64>,
    /// Write a page with pictures
    #[arg(short, long, value_name = "PAGE.html")]
    pub output: Option<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(ClapArgs)]
#[command(after_help = "Example:\n  hysteron paper -o paper.html")]
pub(crate) struct PaperArgs {
    /// Write a page with pictures
    #[arg(short, long, value_name = "PAGE.html")]
    pub output: Option<PathBuf>,
    /// Seed of the sensor noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

#[derive(ClapArgs)]
#[command(after_help = "Example:\n  hysteron demo -o my-first-look")]
pub(crate) struct DemoArgs {
    /// Folder for the dataset, the models and the page
    #[arg(short, long, default_value = "hysteron-demo")]
    pub output: PathBuf,
    /// Seed of the sensor noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
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

fn percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("a percentage of peak to peak, 0 or more, such as 2.5".to_owned()),
    }
}
