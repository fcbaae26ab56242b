//! `hysteron demo`.

mod page;

use crate::commands::campaign::{default_campaign, record};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::{Dataset, Overwrite, write_dataset};
use hysteron_diagnose::{Comparison, Pooled};
use hysteron_identify::{Family, FitOptions, Model, fit};
use hysteron_plant::preset;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron demo -o my-first-look\n\n\
    Takes some ten seconds; what is there already in the folder is replaced.")]
pub(crate) struct DemoArgs {
    /// Folder for the dataset, the models and the page
    #[arg(short, long, value_name = "FOLDER", default_value = "hysteron-demo")]
    pub output: PathBuf,
    /// Seed of the sensor noise and of random excitations
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// A fitted model and how far it is off.
struct Judged {
    model: Model,
    comparison: Comparison,
}

pub(crate) fn run(args: &DemoArgs) -> Result<Done, CliError> {
    let bar = progress::bar("simulating the stage");
    let stage = preset::paper_rate();
    let plan = default_campaign(stage.hysteresis.reference_v, args.seed);
    let dataset = record(
        "paper-rate",
        &stage,
        &plan,
        stage.sample_period_s,
        args.seed,
        &|share| {
            progress::advance(&bar, share);
        },
    )?;
    bar.finish_and_clear();
    write_dataset(&dataset, &args.output.join("stage"), Overwrite::Allow)?;
    let mut judged = Vec::new();
    for family in Family::ALL {
        judged.push(judge(family, &dataset, args)?);
    }
    let page = args.output.join("demo.html");
    output::write_file(&page, &page::page(&dataset, &judged, args))?;
    output::print(&text(&judged, args))?;
    Ok(Done::Answered)
}

/// Fits one model, writes it, compares it with every record.
fn judge(family: Family, dataset: &Dataset, args: &DemoArgs) -> Result<Judged, CliError> {
    let bar = progress::bar(&format!("fitting {family}"));
    let model = fit(dataset, &FitOptions::new(family), &|share| {
        progress::advance(&bar, 0.7 * share)
    })?
    .model;
    model.write(&args.output.join(format!("{family}.toml")))?;
    let comparison = hysteron_diagnose::compare(dataset, &model, &|share| progress::advance(&bar, 0.7 + 0.3 * share));
    bar.finish_and_clear();
    Ok(Judged { model, comparison })
}

/// The model with the smallest error on records that it was not fitted to.
fn best(judged: &[Judged]) -> Option<&Judged> {
    let error = |judged: &Judged| validated(judged).map_or(f64::INFINITY, |pooled| pooled.nrmse_percent);
    judged.iter().min_by(|a, b| error(a).total_cmp(&error(b)))
}

fn validated(judged: &Judged) -> Option<&Pooled> {
    judged.comparison.validate.as_ref()
}

/// What to do next, with the files that are there.
fn next_commands(args: &DemoArgs, judged: &[Judged]) -> Vec<String> {
    let folder = args.output.display();
    let family = best(judged).map_or(Family::Mrpi, |judged| judged.model.family);
    vec![
        format!("hysteron compare {folder}/stage {folder}/{family}.toml -o {folder}/{family}.html"),
        format!("hysteron fit {folder}/stage --model {family} --plays 20 -o {folder}/{family}-20.toml"),
        "hysteron paper -o paper.html".to_owned(),
        "hysteron import scope.csv -o my-stage    # your own recordings".to_owned(),
    ]
}

fn text(judged: &[Judged], args: &DemoArgs) -> String {
    let mut text = String::from("error, % of peak to peak      fitted to   not fitted to\n");
    for one in judged {
        let percent =
            |pooled: Option<&Pooled>| pooled.map_or_else(|| "-".to_owned(), |p| format!("{:.2}", p.nrmse_percent));
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "  {:<26} {:>10}      {:>10}",
            one.model.family.name(),
            percent(one.comparison.identify.as_ref()),
            percent(validated(one))
        );
    }
    let folder = args.output.display();
    let _ = writeln!(
        text,
        "\nopen {folder}/demo.html in a browser; the dataset is {folder}/stage\nnext:"
    );
    for command in next_commands(args, judged) {
        let _ = writeln!(text, "  {command}");
    }
    text
}
