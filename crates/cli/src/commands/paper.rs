//! `hysteron paper`.

use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_studies::{Redone, Rivals};
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron paper -o paper.html\n\n\
    The paper: Modeling and compensating the dynamic hysteresis of piezoelectric actuators via a modified\n\
    rate-dependent Prandtl-Ishlinskii model. Nothing here is tuned to its figures but the loop openings of the\n\
    two simulated stages. Takes about a minute on two cores, most of it the particle swarm.")]
pub(crate) struct PaperArgs {
    /// Write a page with pictures
    #[arg(short, long, value_name = "PAGE.html")]
    pub output: Option<PathBuf>,
    /// The models of Table 1 instead: each identified, in the same two loops, beside the paper's
    #[arg(long, conflicts_with = "output")]
    pub rivals: bool,
    /// Seed of the sensor noise, the bandwidth's noise and the particle swarm
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &PaperArgs) -> Result<Done, CliError> {
    let bar = progress::bar("redoing the paper");
    let (text, json) = if args.rivals {
        let rivals = Rivals::new(args.seed)?;
        (rivals.text(), rivals.json())
    } else {
        let redone = Redone::new(args.seed, &|share| progress::advance(&bar, share))?;
        if let Some(path) = &args.output {
            output::write_file(path, &redone.page())?;
        }
        (redone.text(), redone.json())
    };
    bar.finish_and_clear();
    if args.json {
        output::print_json(&json)?;
    } else {
        output::print(&text)?;
    }
    Ok(Done::Answered)
}
