//! `hysteron challenge`.

use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::{Args, Subcommand};
use hysteron_challenge::Setting;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron challenge new riddle\n  \
    hysteron fit riddle --model mpi -o model.toml\n  hysteron diagnose riddle model.toml\n  \
    hysteron challenge answer riddle delay first-order-lag\n  hysteron challenge reveal riddle riddle.key")]
pub(crate) struct ChallengeArgs {
    #[command(subcommand)]
    command: ChallengeCommand,
}

#[derive(Subcommand)]
enum ChallengeCommand {
    /// Make a dataset with a hidden effect; the truth is encrypted, its key kept in a file apart
    New(NewArgs),
    /// Record an answer: one effect, several that cannot be told apart (or are both there), `none` or `unknown`
    Answer(AnswerArgs),
    /// Show the truth and judge the answer
    Reveal(RevealArgs),
}

#[derive(Args)]
struct NewArgs {
    /// Folder of the new dataset
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// Where the key is written [default: FOLDER.key, beside the folder]
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Hide this effect instead of a drawn one, for those who set riddles to others; `none` hides nothing; twice makes a pair
    #[arg(long, value_name = "EFFECT")]
    effect: Vec<String>,
    /// weak (adds 0.3 to 0.6 % of peak to peak to the error), medium (1 to 2 %) or strong (3 to 6 %)
    #[arg(long, default_value = "medium")]
    strength: String,
    /// Hide two effects of the catalogue
    #[arg(long, conflicts_with = "effect")]
    pair: bool,
    /// The stage's hysteresis: preisach, sigmoid-plays, maxwell-slip, mrpi, bouc-wen; drawn if not given
    #[arg(long, value_name = "FAMILY")]
    family: Option<String>,
    /// Make this stage and draw this effect again; whoever knows the seed knows the truth
    #[arg(long)]
    seed: Option<u64>,
}

#[derive(Args)]
struct AnswerArgs {
    /// Folder of the challenge
    folder: PathBuf,
    /// What is hidden in it; only one answer is taken
    #[arg(required = true, value_name = "EFFECT")]
    effects: Vec<String>,
}

#[derive(Args)]
struct RevealArgs {
    /// Folder of the challenge
    folder: PathBuf,
    /// The file with its key
    key: PathBuf,
    /// Print the truth and the judgement as JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &ChallengeArgs) -> Result<Done, CliError> {
    match &args.command {
        ChallengeCommand::New(args) => new(args),
        ChallengeCommand::Answer(args) => answer(args),
        ChallengeCommand::Reveal(args) => reveal(args),
    }
}

fn new(args: &NewArgs) -> Result<Done, CliError> {
    let key_file = args.key.clone().unwrap_or_else(|| {
        let mut beside = args.folder.as_os_str().to_owned();
        beside.push(".key");
        beside.into()
    });
    hysteron_challenge::refuse_places(&args.folder, &key_file)?;
    let setting = Setting {
        effects: args.effect.clone(),
        strength: args.strength.clone(),
        pair: args.pair,
        family: args.family.clone(),
        seed: args.seed,
    };
    setting.make()?.write(&args.folder, &key_file)?;
    let (folder, key) = (args.folder.display(), key_file.display());
    output::print(&format!(
        "a stage of its own in {folder}: 15 records, truth sealed; key in {key} (do not look for the truth, look at the data)\n\
         next:\n  hysteron fit {folder} --model mpi -o model.toml\n  hysteron diagnose {folder} model.toml\n  \
         hysteron challenge answer {folder} EFFECT\n  hysteron challenge reveal {folder} {key}\n"
    ))?;
    Ok(Done::Answered)
}

fn answer(args: &AnswerArgs) -> Result<Done, CliError> {
    let answer = hysteron_challenge::answer(&args.folder, &args.effects)?;
    output::print(&format!("answer taken: {}\n", answer.effects.join(", ")))?;
    Ok(Done::Answered)
}

fn reveal(args: &RevealArgs) -> Result<Done, CliError> {
    let revealed = hysteron_challenge::reveal(&args.folder, &args.key)?;
    if args.json {
        output::print_json(&revealed)?;
        return Ok(Done::Answered);
    }
    let mut text = revealed.truth.text();
    match (revealed.answer, revealed.judgement) {
        (Some(answer), Some(judgement)) => {
            // Writing to a String does not fail.
            let _ = writeln!(
                text,
                "\nanswered: {}\n{}: {}",
                answer.effects.join(", "),
                judgement.outcome.name(),
                judgement.because
            );
        }
        _ => text.push_str("\nno answer was given before\n"),
    }
    output::print(&text)?;
    Ok(Done::Answered)
}
