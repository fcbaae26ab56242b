//! `hysteron compare`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::{Dataset, Role};
use hysteron_diagnose::{Comparison, Pooled};
use hysteron_identify::Model;
use hysteron_report::{Context, comparison_page, facts};
use std::fmt::Write;
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
        output::print(&text(&comparison))?;
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

/// The answer in words and a table.
fn text(comparison: &Comparison) -> String {
    let unit = comparison.output_unit;
    let mut text = String::new();
    // Writing to a String does not fail.
    let _ = writeln!(text, "noise floor {}\n", comparison.noise_in_words());
    let error = format!("error % p-p   fit %   rms {unit}   max {unit}   x noise");
    let widest = comparison
        .records
        .iter()
        .map(|record| record.file.chars().count())
        .max()
        .unwrap_or(0)
        .max(24);
    let _ = writeln!(text, "{:<9} {:<widest$} {error}", "role", "record");
    for record in &comparison.records {
        let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"));
        let _ = writeln!(
            text,
            "{:<9} {:<widest$} {:>11} {:>7} {:>8.4} {:>8.4} {:>9.1}",
            role(record.role),
            record.file,
            percent(record.nrmse_percent),
            percent(record.fit_percent),
            record.rms_um,
            record.max_um,
            record.noise_ratio
        );
    }
    text.push('\n');
    for (name, pooled) in [("identify", comparison.identify), ("validate", comparison.validate)] {
        if let Some(Pooled {
            nrmse_percent,
            fit_percent,
            rms_um,
            records,
        }) = pooled
        {
            let _ = writeln!(
                text,
                "pooled over {records} {name} records: {nrmse_percent:.2} % of peak to peak, fit {fit_percent:.2} %, \
                 {rms_um:.4} {unit} rms, {:.1} times the noise floor",
                rms_um / comparison.noise_rms_um
            );
        }
    }
    if let Some(sentence) = comparison.beside_a_straight_line() {
        let _ = writeln!(text, "{sentence}");
    }
    text.push_str("\nwhere the error is:\n");
    for breakdown in &comparison.r#where {
        let _ = writeln!(text, "  by {:<12} {}", breakdown.by, breakdown.finding);
    }
    for notice in &comparison.notices {
        let _ = write!(text, "\nnote: {notice}");
    }
    if !comparison.notices.is_empty() {
        text.push('\n');
    }
    text
}

fn role(role: Role) -> &'static str {
    match role {
        Role::Identify => "identify",
        Role::Validate => "validate",
    }
}

fn percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("a percentage of peak to peak, 0 or more, such as 2.5".to_owned()),
    }
}
