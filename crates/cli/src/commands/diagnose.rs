//! `hysteron diagnose`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::Dataset;
use hysteron_diagnose::Signature;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_identify::{Direction, Model};
use hysteron_report::{Context, diagnosis_lines, diagnosis_page, facts, failing_lines, verdict_sentence};
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "Examples:\n  hysteron diagnose stage model.toml -o next.csv\n  \
    hysteron diagnose stage model.toml --page missing.html\n  \
    hysteron diagnose stage model.toml --effect my-effect.toml")]
pub(crate) struct DiagnoseArgs {
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The model to start from
    pub model: PathBuf,
    /// Write the voltage of the record to take next
    #[arg(short, long, value_name = "NEXT.csv")]
    pub output: Option<PathBuf>,
    /// Write a page with a picture of what each candidate that counts, or each of the first three, does to the data
    #[arg(long, value_name = "PAGE.html")]
    pub page: Option<PathBuf>,
    /// An effect file of your own, among the candidates; may be repeated
    #[arg(long, value_name = "FILE.toml")]
    pub effect: Vec<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &DiagnoseArgs) -> Result<Done, CliError> {
    let model = load::model(&args.model)?;
    if model.direction == Direction::Inverse {
        return Err(CliError::Option(format!(
            "{}: an inverse model has no place for physical effects; give a forward model (hysteron fit --direction forward)",
            args.model.display()
        )));
    }
    let own = load::effect_files(&args.effect)?;
    let dataset = load::dataset(&args.data)?;
    let bar = progress::bar("diagnosing");
    let mut diagnosis = hysteron_diagnose::diagnose_with(&dataset, &model, &own, &|share, effect| {
        bar.set_message(effect.to_owned());
        progress::advance(&bar, if args.page.is_some() { 0.5 * share } else { share });
    })?;
    if let Some(path) = &args.page {
        let pictured = |share: f64, effect: &str| {
            bar.set_message(format!("{effect}, picture"));
            progress::advance(&bar, 0.5 + 0.5 * share);
        };
        let comparison = hysteron_diagnose::compare(&dataset, &model, &|_| ());
        let shown = hysteron_diagnose::signatures(&dataset, &model, &comparison, &diagnosis, &own, &pictured);
        output::write_file(path, &page(args, path, &dataset, &model, &diagnosis, &shown))?;
    }
    bar.finish_and_clear();
    if let (Some(path), Some(next)) = (&args.output, &mut diagnosis.next_record) {
        output::write_file(path, &next.csv())?;
        next.file = Some(path.display().to_string());
    }
    if args.json {
        output::print_json(&diagnosis)?;
    } else {
        let mut text = text(&diagnosis);
        if let Some(path) = &args.page {
            // Writing to a String does not fail.
            let _ = writeln!(text, "\npage with pictures: {}", path.display());
        }
        output::print(&text)?;
    }
    Ok(Done::Answered)
}

/// The page with pictures.
fn page(
    args: &DiagnoseArgs,
    file: &Path,
    dataset: &Dataset,
    model: &Model,
    diagnosis: &Diagnosis,
    shown: &[Signature],
) -> String {
    let [data, model_file] = [&args.data, &args.model].map(|path| path.display().to_string());
    let own: String = args
        .effect
        .iter()
        .map(|path| format!(" --effect {}", path.display()))
        .collect();
    let context = Context {
        facts: &facts(&data, &model_file, dataset, model),
        command: &format!("hysteron diagnose {data} {model_file}{own} --page {}", file.display()),
        version: env!("CARGO_PKG_VERSION"),
    };
    let title = format!("What {} lacks on {}", model.family, dataset.name);
    diagnosis_page(&title, diagnosis, shown, &context)
}

fn text(d: &Diagnosis) -> String {
    let mut text = String::new();
    is_anything_missing(&mut text, d);
    text.push('\n');
    for line in failing_lines(d) {
        text.push_str(&line);
        text.push('\n');
    }
    // Writing to a String does not fail.
    let _ = writeln!(text, "\nverdict: {}\n{}", d.verdict, verdict_sentence(d));
    for line in diagnosis_lines(d) {
        let _ = writeln!(text, "  - {line}");
    }
    match d.next_record.as_ref().map(|next| &next.file) {
        Some(Some(file)) => {
            let _ = writeln!(text, "    written to {file}");
        }
        Some(None) => text.push_str("    `-o next.csv` writes it\n"),
        None => {}
    }
    ranking(&mut text, d);
    let left = &d.unexplained;
    let _ = writeln!(
        text,
        "\nleft unexplained: {:.3} % of peak to peak, of which noise {:.3} %",
        left.percent, left.noise_percent
    );
    text
}

fn instead(d: &Diagnosis) -> &'static str {
    if d.shape_determined {
        "a hysteresis of free shape instead"
    } else {
        "its plays, fitted anew"
    }
}

fn is_anything_missing(text: &mut String, d: &Diagnosis) {
    let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3} %"));
    if let Some(noise) = &d.noise {
        let _ = writeln!(text, "noise floor {noise}");
    }
    let _ = writeln!(
        text,
        "{:<38} {:>10} {:>10}",
        "error, % of peak to peak", "identify", "validate"
    );
    for (name, error) in [("the model", d.before), (instead(d), d.free_shape)] {
        let (identify, validate) = (percent(error.identify_percent), percent(error.validate_percent));
        let _ = writeln!(text, "{name:<38} {identify:>10} {validate:>10}");
    }
}

fn ranking(text: &mut String, diagnosis: &Diagnosis) {
    let _ = writeln!(
        text,
        "\n  {:<20} {:<9} {:>10} {:>10} {:>10} {:>9} {:>7}",
        "candidate", "level", "identify %", "validate %", "statistic", "threshold", "share"
    );
    for effect in &diagnosis.ranking {
        let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |percent| format!("{percent:.3}"));
        let (identify, validate) = (
            percent(effect.errors.identify_percent),
            percent(effect.errors.validate_percent),
        );
        let level = effect.level.name();
        let _ = writeln!(
            text,
            "{} {:<20} {level:<9} {identify:>10} {validate:>10} {:>10.2} {:>9.2} {:>6.0}%",
            if effect.significant { '*' } else { ' ' },
            effect.effect,
            effect.statistic,
            effect.threshold,
            100.0 * effect.share
        );
        if effect.significant && !effect.parameters.is_empty() {
            let parameters: Vec<String> = effect
                .parameters
                .iter()
                .map(|p| format!("{} {:.4e} {}", p.name, p.value, p.unit))
                .collect();
            let _ = writeln!(text, "      {}", parameters.join(", "));
        }
    }
    text.push_str("  (* significant and large enough to matter; share: what it takes of the squared error)\n");
}
