//! `hysteron example`: small datasets of simulated stages, for README, book and first steps.

use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use hysteron_challenge::examples::{Example, ExampleTruth, Made, import_command};
use hysteron_data::{Overwrite, write_dataset};
use hysteron_plant::challenge::Truth;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(
    after_help = "Examples:\n  hysteron example\n  hysteron example hidden-creep -o stage\n\n\
    Every example is simulated from a fixed seed: the same files on every machine, in a few seconds."
)]
pub(crate) struct ExampleArgs {
    /// The example; without a name all of them are listed
    #[arg(value_parser = names())]
    pub name: Option<Example>,
    /// Folder of the new dataset [default: the example's name]
    #[arg(short, long, value_name = "FOLDER", requires = "name")]
    pub output: Option<PathBuf>,
    /// Replace a dataset that is there already
    #[arg(long)]
    pub overwrite: bool,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// An example in `--json`.
#[derive(Serialize)]
struct Told {
    name: String,
    about: &'static str,
    /// The folder it was written to; none in the list.
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<PathBuf>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    files: Vec<String>,
    /// The simulated truth in words; none in the list.
    #[serde(skip_serializing_if = "Option::is_none")]
    truth: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    next: Vec<String>,
}

/// The names on the command line.
fn names() -> impl TypedValueParser<Value = Example> {
    let named = |example: Example| PossibleValue::new(example.name()).help(example.about());
    PossibleValuesParser::new(Example::ALL.map(named)).try_map(|name| name.parse::<Example>())
}

pub(crate) fn run(args: &ExampleArgs) -> Result<Done, CliError> {
    let Some(name) = args.name else {
        list(args.json)?;
        return Ok(Done::Answered);
    };
    let folder = args.output.clone().unwrap_or_else(|| PathBuf::from(name.name()));
    let bar = progress::bar(&format!("simulating {}", name.name()));
    let made = name.make(&|share| progress::advance(&bar, share))?;
    bar.finish_and_clear();
    let (files, truth) = match made {
        Made::Dataset { dataset, truth } => {
            let overwrite = if args.overwrite {
                Overwrite::Allow
            } else {
                Overwrite::Refuse
            };
            write_dataset(&dataset, &folder, overwrite)?;
            (dataset.records.into_iter().map(|record| record.file).collect(), truth)
        }
        Made::Files { files, truth } => (write_raw(files, &folder, args.overwrite)?, truth),
    };
    let next = next_commands(name, &folder);
    if args.json {
        output::print_json(&Told {
            name: name.name().to_owned(),
            about: name.about(),
            folder: Some(folder),
            files,
            truth: Some(in_words(&truth)),
            next,
        })?;
    } else {
        let mut text = format!(
            "{}: {}\n{} files written to {}\nthe truth: {}\nnext:\n",
            name.name(),
            name.about(),
            files.len(),
            folder.display(),
            in_words(&truth)
        );
        for command in next {
            // Writing to a String does not fail.
            let _ = writeln!(text, "  {command}");
        }
        output::print(&text)?;
    }
    Ok(Done::Answered)
}

/// All examples, one a line.
fn list(json: bool) -> Result<(), CliError> {
    let all = Example::ALL;
    if json {
        let told = all.into_iter().map(|example| Told {
            name: example.name().to_owned(),
            about: example.about(),
            folder: None,
            files: Vec::new(),
            truth: None,
            next: Vec::new(),
        });
        return output::print_json(&told.collect::<Vec<_>>());
    }
    let mut text = String::new();
    for example in all {
        // Writing to a String does not fail.
        let _ = writeln!(text, "{:<18} {}", example.name(), example.about());
    }
    let _ = writeln!(text, "\nnext: {} example hidden-creep -o stage", output::program());
    output::print(&text)
}

/// Writes files of an instrument, none of them over one that is there.
fn write_raw(files: Vec<(String, String)>, folder: &Path, overwrite: bool) -> Result<Vec<String>, CliError> {
    if let Some((taken, _)) = files.iter().find(|(name, _)| folder.join(name).exists())
        && !overwrite
    {
        return Err(CliError::Option(format!(
            "{}: is there already; give another folder with -o, or --overwrite",
            folder.join(taken).display()
        )));
    }
    let mut names = Vec::with_capacity(files.len());
    for (name, text) in files {
        output::write_file(&folder.join(&name), &text)?;
        names.push(name);
    }
    Ok(names)
}

fn next_commands(name: Example, folder: &Path) -> Vec<String> {
    let (program, folder) = (output::program(), folder.display());
    let learned = format!("{program} learn {folder} -o model.toml --page ladder.html");
    let compared = format!("{program} compare {folder} model.toml -o page.html");
    match name {
        Example::Scope => vec![
            format!("{program} {}", import_command(&folder.to_string())),
            format!("{program} fit stage --model mrpi -o model.toml"),
        ],
        Example::PaperStage => vec![format!("{program} fit {folder} --model mrpi -o model.toml"), compared],
        _ => vec![learned, compared],
    }
}

/// What was simulated.
fn in_words(truth: &ExampleTruth) -> String {
    match truth {
        ExampleTruth::Said(words) => (*words).to_owned(),
        ExampleTruth::Case(truth) => case_in_words(truth),
    }
}

/// The hidden effects with their parameters.
fn case_in_words(truth: &Truth) -> String {
    let mut text = format!(
        "{:.1} um at {:.0} V, {:.1} nm of noise",
        truth.stroke_um,
        truth.full_v,
        1e3 * truth.noise_rms_um
    );
    for hidden in &truth.hidden {
        let parameters: Vec<String> = hidden
            .parameters
            .iter()
            .map(|p| format!("{} {} {}", p.name, hysteron_report::significant(p.value), p.unit))
            .collect();
        // Writing to a String does not fail.
        let _ = write!(
            text,
            "; {} ({}), which alone adds {:.1} % of peak to peak to the error",
            hidden.effect.name(),
            parameters.join(", "),
            hidden.contribution_percent
        );
    }
    if truth.hidden.is_empty() {
        text.push_str("; nothing is hidden");
    }
    text
}
