//! `hysteron learn`.

use crate::commands::fit::ModelName;
use crate::commands::{ladder, load};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_identify::FitOptions;
use hysteron_identify::effects::UserEffect;
use hysteron_report::{ladder_details, ladder_text, learned_text};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "Examples:\n  hysteron learn stage --model mpi -o model.toml --page ladder.html\n  \
    hysteron learn stage --effect my-effect.toml -o model.toml"
)]
pub(crate) struct LearnArgs {
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The hysteresis model to start from
    #[arg(long, value_enum, default_value_t = ModelName::Mpi)]
    pub model: ModelName,
    /// Number of play operators, or of fading elements, 1 to 64; 10, and 4 of duhem
    #[arg(long)]
    pub plays: Option<usize>,
    /// Where to write the model
    #[arg(short, long, default_value = "model.toml")]
    pub output: PathBuf,
    /// Write a page that shows how the error fell
    #[arg(long, value_name = "PAGE.html")]
    pub page: Option<PathBuf>,
    /// An effect file of your own, among the candidates; may be repeated
    #[arg(long, value_name = "FILE.toml")]
    pub effect: Vec<PathBuf>,
    /// Print the errors by other measures as well: percent of the output's rms, and of the last period
    #[arg(short, long)]
    pub verbose: bool,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &LearnArgs) -> Result<Done, CliError> {
    let own = UserEffect::read_all(&args.effect)?;
    let dataset = load::dataset(&args.data)?;
    let options = FitOptions {
        plays: args.model.plays(args.plays),
        ..FitOptions::new(args.model.into())
    };
    let bar = progress::bar("learning");
    let learned = hysteron_diagnose::learn_with(&dataset, &options, &own, &|what, share| {
        if bar.message() != what {
            bar.set_message(what.to_owned());
            bar.set_position(0);
        }
        progress::advance(&bar, share);
    })?;
    bar.finish_and_clear();
    learned.model.write(&args.output)?;
    let ladder = hysteron_diagnose::ladder(&learned.model);
    if let (Some(path), Some(ladder)) = (&args.page, &ladder) {
        output::write_file(path, &ladder::page(ladder, &args.output, path))?;
    }
    if args.json {
        output::print_json(&serde_json::json!({
            "file": args.output,
            "page": args.page.as_ref().filter(|_| ladder.is_some()),
            "effects": learned.model.effects,
            "attempts": learned.attempts,
            "stop": learned.stop,
            "ladder": ladder,
            "diagnosis": learned.diagnosis,
        }))?;
    } else {
        let mut text = learned_text(args.model.into(), &learned);
        if let Some(ladder) = &ladder {
            let _ = write!(text, "\n{}", ladder_text(ladder));
            if args.verbose {
                text.push_str(&ladder_details(ladder));
            }
        } else if args.page.is_some() {
            text.push_str("\nno step was kept, so there is no ladder and no page\n");
        }
        let _ = write!(text, "\nwritten to {}\n", args.output.display());
        output::print(&text)?;
    }
    Ok(Done::Answered)
}
