//! `hysteron diagnose`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::Dataset;
use hysteron_diagnose::Signature;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_identify::effects::UserEffect;
use hysteron_identify::{Direction, Model};
use hysteron_report::{Context, diagnosis_details, diagnosis_page, diagnosis_text, facts};
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
    /// Print what the verdict rests on as well: where the model fails, and every candidate
    #[arg(short, long)]
    pub verbose: bool,
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
    let own = UserEffect::read_all(&args.effect)?;
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
        output::print(&text(args, &diagnosis))?;
    }
    Ok(Done::Answered)
}

fn text(args: &DiagnoseArgs, diagnosis: &Diagnosis) -> String {
    let mut text = diagnosis_text(diagnosis);
    // Writing to a String does not fail.
    if args.verbose {
        let _ = write!(text, "\n{}", diagnosis_details(diagnosis));
    } else {
        text.push_str("  - Every candidate, and where the model fails: --verbose\n");
    }
    if let Some(path) = &args.page {
        let _ = writeln!(text, "page with pictures: {}", path.display());
    }
    let blocked = diagnosis.cannot_answer.iter().any(|reason| reason.blocks());
    if let Some(effect) = diagnosis.verdict.effect().filter(|_| !blocked) {
        let own = |path: &&PathBuf| UserEffect::read(path).is_ok_and(|own| own.effect().name() == *effect);
        let named = args
            .effect
            .iter()
            .find(own)
            .map_or_else(|| effect.to_string(), |path| path.display().to_string());
        let stem = args.model.file_stem().unwrap_or_default().to_string_lossy();
        let next = args.model.with_file_name(format!("{stem}-{effect}.toml"));
        let (data, model) = (args.data.display(), args.model.display());
        let _ = writeln!(text, "next: hysteron add {named} {data} {model} -o {}", next.display());
    }
    text
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
    let title = format!("The effect missing from {} on {}", model.family, dataset.name);
    diagnosis_page(&title, diagnosis, shown, &context)
}
