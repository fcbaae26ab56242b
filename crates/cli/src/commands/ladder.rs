//! `hysteron ladder`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::Args;
use hysteron_diagnose::Ladder;
use hysteron_report::{Context, ladder_details, ladder_page, ladder_text};
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron ladder model3.toml -o page.html")]
pub(crate) struct LadderArgs {
    /// A model to which effects were added
    pub model: PathBuf,
    /// Write a page with pictures
    #[arg(short, long, value_name = "PAGE.html")]
    pub output: Option<PathBuf>,
    /// Print the errors by other measures as well: percent of the output's rms, and of the last period
    #[arg(short, long)]
    pub verbose: bool,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &LadderArgs) -> Result<Done, CliError> {
    let model = load::model(&args.model)?;
    let ladder = hysteron_diagnose::ladder(&model).ok_or_else(|| {
        CliError::Option(format!(
            "{0}: nothing was added to this model yet, so there are no steps to show; hysteron add EFFECT DATA {0} -o MODEL2",
            args.model.display()
        ))
    })?;
    if let Some(path) = &args.output {
        output::write_file(path, &page(&ladder, &args.model, path))?;
    }
    if args.json {
        output::print_json(&ladder)?;
    } else {
        let mut text = ladder_text(&ladder);
        if args.verbose {
            text.push_str(&ladder_details(&ladder));
        }
        output::print(&text)?;
    }
    Ok(Done::Answered)
}

/// The page of a ladder.
pub(super) fn page(ladder: &Ladder, model: &Path, page: &Path) -> String {
    let facts = [
        ("model", format!("{} ({})", ladder.model, model.display())),
        ("fitted on", ladder.dataset.clone()),
    ];
    let command = format!("hysteron ladder {} -o {}", model.display(), page.display());
    ladder_page(
        ladder,
        &Context {
            facts: &facts,
            command: &command,
            version: env!("CARGO_PKG_VERSION"),
        },
    )
}
