//! `hysteron compare`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::Dataset;
use hysteron_diagnose::Comparison;
use hysteron_identify::Model;
use hysteron_report::{Context, comparison_page, comparison_text, facts};
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron compare stage model.toml -o page.html\n  \
    hysteron compare stage model.toml --json --fail-above 2.5    # in CI")]
pub(crate) struct CompareArgs {
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The model to compare with
    pub model: PathBuf,
    /// Exit with 1 if the pooled error (eq. 19) on validation records exceeds this percentage; on the records it was
    /// fitted to where there are no others
    #[arg(long, value_name = "PERCENT", allow_negative_numbers = true, value_parser = percent)]
    pub fail_above: Option<f64>,
    /// Write a page with pictures
    #[arg(short, long, value_name = "PAGE.html")]
    pub output: Option<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &CompareArgs) -> Result<Done, CliError> {
    let model = load::model(&args.model)?;
    let dataset = load::dataset(&args.data)?;
    let bar = progress::bar("comparing");
    let comparison = hysteron_diagnose::compare(&dataset, &model, &|share| progress::advance(&bar, share));
    bar.finish_and_clear();
    if let Some(path) = &args.output {
        output::write_file(path, &page(args, &dataset, &model, &comparison))?;
    }
    if args.json {
        output::print_json(&comparison)?;
    } else {
        output::print(&comparison_text(&comparison))?;
    }
    judge(args.fail_above, &comparison)
}

/// The page with pictures.
fn page(args: &CompareArgs, dataset: &Dataset, model: &Model, comparison: &Comparison) -> String {
    let [data, model_file] = [&args.data, &args.model].map(|path| path.display().to_string());
    let facts = facts(&data, &model_file, dataset, model);
    let command = format!(
        "hysteron compare {data} {model_file} -o {}",
        args.output.as_deref().unwrap_or(Path::new("page.html")).display()
    );
    let context = Context {
        facts: &facts,
        command: &command,
        version: env!("CARGO_PKG_VERSION"),
    };
    comparison_page(
        &format!("{} against {}", model.family, dataset.name),
        comparison,
        &context,
    )
}

/// Whether the limit that was asked for holds.
fn judge(limit: Option<f64>, comparison: &Comparison) -> Result<Done, CliError> {
    let Some(limit) = limit else { return Ok(Done::Answered) };
    let pooled = comparison.validate.or(comparison.identify).ok_or_else(|| {
        CliError::Option("--fail-above: no record moves, so there is no percentage to judge".to_owned())
    })?;
    Ok(if pooled.nrmse_percent > limit {
        Done::LimitExceeded
    } else {
        Done::Answered
    })
}

fn percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("a percentage of peak to peak, 0 or more, such as 2.5".to_owned()),
    }
}
