//! `hysteron learn`.

use crate::commands::fit::ModelName;
use crate::commands::{ladder, load};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_diagnose::{Attempt, Learned, Stop};
use hysteron_identify::{Change, FitOptions};
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
    /// Number of play operators, 1 to 64
    #[arg(long, default_value_t = 10)]
    pub plays: usize,
    /// Where to write the model
    #[arg(short, long, default_value = "model.toml")]
    pub output: PathBuf,
    /// Write a page that shows how the error fell
    #[arg(long, value_name = "PAGE.html")]
    pub page: Option<PathBuf>,
    /// An effect file of your own, among the candidates; may be repeated
    #[arg(long, value_name = "FILE.toml")]
    pub effect: Vec<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &LearnArgs) -> Result<Done, CliError> {
    let own = load::effect_files(&args.effect)?;
    let dataset = load::dataset(&args.data)?;
    let options = FitOptions {
        plays: args.plays,
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
        let mut text = text(args, &learned);
        if let Some(ladder) = &ladder {
            let _ = write!(text, "\n{}", ladder::text(ladder));
        } else if args.page.is_some() {
            text.push_str("\nno step was kept, so there is no ladder and no page\n");
        }
        let _ = write!(text, "\nwritten to {}\n", args.output.display());
        output::print(&text)?;
    }
    Ok(Done::Answered)
}

fn text(args: &LearnArgs, learned: &Learned) -> String {
    let mut text = format!("{} fitted\n", hysteron_identify::Family::from(args.model));
    for attempt in &learned.attempts {
        text.push_str(&told(attempt));
    }
    let _ = writeln!(text, "stopped: {}", why(learned));
    if let Some(next) = &learned.diagnosis.next_record {
        let _ = writeln!(text, "record to take next: {}", next.excitation);
    }
    text
}

/// One attempt in a line.
fn told(attempt: &Attempt) -> String {
    let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3} %"));
    let (before, after) = (percent(attempt.before_percent), percent(attempt.after_percent));
    let what = match (attempt.change, attempt.kept) {
        (Change::Removed, _) => "taken out again: superfluous since the last step",
        (_, true) if attempt.uncertain => "helps on what was held out, and stays; its cause is uncertain",
        (_, true) => "added: what was held out confirms it",
        (_, false) => "tried and left out: what was held out does not confirm it",
    };
    let mut line = format!("{}: {what}, {before} -> {after}\n", attempt.effect);
    if !attempt.also_possible.is_empty() {
        let _ = writeln!(
            line,
            "  these records cannot tell it from: {}",
            output::list(&attempt.also_possible)
        );
    }
    line
}

fn why(learned: &Learned) -> String {
    match &learned.stop {
        Stop::NothingMissing => {
            "nothing more is missing; what is left is sensor noise and the known coarseness of the model".to_owned()
        }
        Stop::CannotTell { reasons } => {
            let words: Vec<&str> = reasons
                .iter()
                .map(|reason| hysteron_report::reason_in_words(*reason))
                .collect();
            format!("these records cannot answer: {}", words.join("; "))
        }
        Stop::Unknown { unexplained } => {
            let before = learned.diagnosis.before;
            let left = before.validate_percent.or(before.identify_percent).unwrap_or(f64::NAN);
            let mut text = format!(
                "nothing more can be told; of the {left:.3} % of peak to peak that are left, noise explains {:.3} %, and no \
                 effect of the catalogue the rest with certainty",
                unexplained.noise_percent
            );
            if let Some(lock) = unexplained.locked_to.first().filter(|lock| lock.share > 0.1) {
                let _ = write!(
                    text,
                    "; {:.0} % of it goes with {}",
                    100.0 * lock.share,
                    hysteron_report::lock_in_words(lock)
                );
            }
            text
        }
        Stop::EnoughSteps => "six steps are enough; what is left is better looked at by a person".to_owned(),
    }
}
