//! `hysteron campaign`.

use crate::commands::control::stage;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::{Overwrite, write_dataset};
use hysteron_tracking::campaign::campaign;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "Example:\n  hysteron campaign --stage 8k -o records\n  hysteron design records -o controller.toml\n  \
    hysteron track controller.toml --stage 8k\n\n\
    What is recorded: a small multisine about a bias (modes, first guess of the lag), two holds of 12 s (creep),\n\
    large signals, and two passes along references with the inverse identified so far. 37 s of records; on disk 50 MB."
)]
pub(crate) struct CampaignArgs {
    /// The simulated stage: paper-rate, paper-delay, 8k, 2.5k or 739
    #[arg(long, value_name = "PRESET")]
    pub stage: String,
    /// Seed of the noise, and of excitations that are random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder of the new dataset
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Replace a dataset that is there already
    #[arg(long)]
    pub overwrite: bool,
}

pub(crate) fn run(args: &CampaignArgs) -> Result<Done, CliError> {
    let stage = stage(&args.stage)?;
    let bar = progress::bar("recording");
    let done = campaign(&args.stage, &stage, args.seed, &|share| progress::advance(&bar, share))?;
    bar.finish_and_clear();
    let overwrite = if args.overwrite {
        Overwrite::Allow
    } else {
        Overwrite::Refuse
    };
    write_dataset(&done.records, &args.output, overwrite)?;
    let mut text = String::new();
    let mut total_s = 0.0;
    for record in &done.records.records {
        total_s += record.duration_s();
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<32} {:>8} samples  {:>7.3} s  {}",
            record.file,
            record.len(),
            record.duration_s(),
            record.excitation
        );
    }
    let folder = args.output.display();
    let _ = writeln!(
        text,
        "\n{total_s:.1} s of records; identified from them: the inverse misses the commands by {:.3} % of their range",
        done.model.misfit_percent
    );
    let _ = writeln!(
        text,
        "written to {folder}\nnext: hysteron design {folder} -o controller.toml"
    );
    output::print(&text)?;
    Ok(Done::Answered)
}
