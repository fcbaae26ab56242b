//! `hysteron report`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_identify::Direction;
use hysteron_report::{Findings, frozen, hashes};
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron report stage model.toml -o report.html")]
pub(crate) struct ReportArgs {
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The model
    pub model: PathBuf,
    /// Where to write the page
    #[arg(short, long, value_name = "REPORT.html", default_value = "report.html")]
    pub output: PathBuf,
}

pub(crate) fn run(args: &ReportArgs) -> Result<Done, CliError> {
    let model = load::model(&args.model)?;
    let dataset = load::dataset(&args.data)?;
    let bar = progress::bar("comparing");
    let comparison = hysteron_diagnose::compare(&dataset, &model, &|share| progress::advance(&bar, 0.2 * share));
    let diagnosis = (model.direction == Direction::Forward).then(|| {
        hysteron_diagnose::diagnose(&dataset, &model, &|share, effect| {
            bar.set_message(effect.to_owned());
            progress::advance(&bar, 0.2 + 0.8 * share);
        })
    });
    bar.finish_and_clear();
    let findings = Findings {
        model: &model,
        comparison: &comparison,
        diagnosis: diagnosis.as_ref(),
        hashes: &hashes(&args.data, &args.model, &dataset).map_err(|(path, source)| CliError::Read { path, source })?,
    };
    let shown = |path: &Path| path.display().to_string();
    let files = [shown(&args.data), shown(&args.model), shown(&args.output)];
    let page = frozen(&files, &dataset, &findings, env!("CARGO_PKG_VERSION"));
    output::write_file(&args.output, &page)?;
    output::print(&format!("written to {}\n", args.output.display()))?;
    Ok(Done::Answered)
}
