//! `hysteron demo`: the whole way on a simulated stage with one hidden effect, as one page.

mod page;
mod way;

use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::Args;
use clap::builder::PossibleValuesParser;
use hysteron_data::{Overwrite, write_dataset};
use hysteron_report::{significant, verdict_sentence};
use hysteron_tracking::rehearsal::Hidden;
use std::fmt::Write;
use std::path::PathBuf;
use way::Way;

#[derive(Args)]
#[command(
    after_help = "Examples:\n  hysteron demo\n  hysteron demo --effect resonance -o my-first-look\n\n\
    Takes some twenty seconds; what is there already in the folder is replaced."
)]
pub(crate) struct DemoArgs {
    /// Folder for the records, the models, the page and one picture of it
    #[arg(short, long, value_name = "FOLDER", default_value = "hysteron-demo")]
    pub output: PathBuf,
    /// The effect to hide
    #[arg(long, default_value = "creep", value_parser = PossibleValuesParser::new(Hidden::ALL.map(Hidden::name)))]
    pub effect: String,
    /// Seed of the stage, the effect and the noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

pub(crate) fn run(args: &DemoArgs) -> Result<Done, CliError> {
    let hidden = Hidden::named(&args.effect).unwrap_or(Hidden::Creep);
    let way = way::go(hidden, args.seed)?;
    write_dataset(&way.records, &args.output.join("records"), Overwrite::Allow)?;
    way.first.write(&args.output.join("first.toml"))?;
    way.learned.model.write(&args.output.join("model.toml"))?;
    let next = next_commands(args, &way);
    output::write_file(&args.output.join("demo.html"), &page::page(&way, &next))?;
    output::write_file(&args.output.join("error-falls.svg"), &page::fall_svg(&way))?;
    output::print(&text(args, &way, &next))?;
    Ok(Done::Answered)
}

/// What to type next, with the files that are there.
fn next_commands(args: &DemoArgs, way: &Way) -> Vec<String> {
    let (program, folder) = (output::program(), args.output.display());
    let amplifier = &way.rehearsal.stage.amplifier;
    let [low_v, high_v] = [amplifier.min_v, amplifier.max_v];
    vec![
        format!("{program} compare {folder}/records {folder}/model.toml -o {folder}/compare.html"),
        format!("{program} design {folder}/model.toml --volts {low_v},{high_v} -o {folder}/controller.toml"),
        format!("{program} example scope -o scope"),
    ]
}

fn text(args: &DemoArgs, way: &Way, next: &[String]) -> String {
    let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{} %", significant(v)));
    let mut text = format!(
        "{} recordings of a simulated stage, one effect hidden in it\n\n{}\n\nerror of the model, records not fitted to, % of peak to peak\n",
        way.records.records.len(),
        verdict_sentence(&way.diagnosis)
    );
    // Writing to a String does not fail.
    for rung in way.steps() {
        let _ = writeln!(text, "  {:<22} {:>9}", rung.name(), percent(rung.percent()));
    }
    let _ = writeln!(text, "  {:<22} {:>9}", "noise floor", percent(way.noise_percent()));
    match &way.tracked {
        Ok(tracked) => {
            let _ = writeln!(
                text,
                "\ntracking error in open loop, % of the range{:>14} {:>9}",
                "without", "with"
            );
            for (name, without, with) in tracked.errors() {
                let _ = writeln!(
                    text,
                    "  {name:<40} {:>14} {:>9}",
                    percent(Some(without)),
                    percent(Some(with))
                );
            }
        }
        Err(reason) => {
            let _ = writeln!(text, "\nno controller: {reason}");
        }
    }
    let _ = writeln!(
        text,
        "\nhidden was: {}\nopen {}/demo.html in a browser\nnext:",
        way.rehearsal.truth,
        args.output.display()
    );
    for command in next {
        let _ = writeln!(text, "  {command}");
    }
    text
}
