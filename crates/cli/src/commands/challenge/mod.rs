//! `hysteron challenge`.

mod judge;
mod seal;
mod truth;

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::{Args, Subcommand};
use hysteron_data::{Dataset, Known, Overwrite, Record, Role, write_dataset};
use hysteron_plant::challenge::{
    Asked, CATALOGUE, Case, CaseRecord, Effect, OUTSIDE, Spec, StageFamily, Strength, Use, generate,
};
use judge::{Answer, judge};
use rand::RngExt;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use truth::SealedTruth;

/// The file of a challenge that holds the truth, sealed.
const SEALED: &str = "sealed.txt";
/// The file that holds the answer.
const ANSWER: &str = "answer.json";
/// The file that holds the truth once it has been shown.
const REVEALED: &str = "truth.json";

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
    if key_file.starts_with(&args.folder) {
        return Err(CliError::Option(format!(
            "--key {}: the key must lie outside of the folder that it opens",
            key_file.display()
        )));
    }
    for path in [&key_file, &args.folder.join(SEALED)] {
        if path.exists() {
            return Err(CliError::Option(format!(
                "{} is there already; a challenge is never replaced, choose another folder",
                path.display()
            )));
        }
    }
    let strength = one_of("--strength", &args.strength, &Strength::ALL, Strength::name)?;
    let family = match &args.family {
        Some(name) => Some(one_of("--family", name, &StageFamily::ALL, StageFamily::name)?),
        None => None,
    };
    let (seed, (case, truth)) = make(args, strength, family)?;
    // The name of the folder is the reader's own; nothing else in the dataset differs from one effect to the other.
    write_dataset(&dataset(case), &args.folder, Overwrite::Refuse)?;
    let sealed = SealedTruth::new(&truth, seed);
    let (key, text) = seal::seal(&serde_json::to_string(&sealed)?);
    output::write_file(&args.folder.join(SEALED), &text)?;
    output::write_file(&key_file, &key)?;
    let (folder, key) = (args.folder.display(), key_file.display());
    output::print(&format!(
        "a stage of its own in {folder}: 15 records, truth sealed; key in {key} (do not look for the truth, look at the data)\n\
         next:\n  hysteron fit {folder} --model mpi -o model.toml\n  hysteron diagnose {folder} model.toml\n  \
         hysteron challenge answer {folder} EFFECT\n  hysteron challenge reveal {folder} {key}\n"
    ))?;
    Ok(Done::Answered)
}

/// Draws what to hide, and makes the case. A drawn seed whose stage cannot show the effect at its strength is drawn anew.
fn make(
    args: &NewArgs,
    strength: Strength,
    family: Option<StageFamily>,
) -> Result<(u64, (Case, hysteron_plant::challenge::Truth)), CliError> {
    const DRAWS: usize = 5;
    let mut refusal = None;
    for _ in 0..if args.seed.is_some() { 1 } else { DRAWS } {
        let seed = args.seed.unwrap_or_else(|| rand::rng().random());
        let hidden = hidden(args, seed)?
            .into_iter()
            .map(|effect| Asked { effect, strength })
            .collect();
        let spec = Spec {
            hidden,
            family,
            noise_seed: 0,
        };
        match generate(seed, &spec) {
            Ok(made) => return Ok((seed, made)),
            Err(error) => refusal = Some(error),
        }
    }
    Err(refusal.map_or_else(|| CliError::Option("no stage drawn".to_owned()), CliError::from))
}

/// The effects to hide: those asked for; else drawn from the seed: nothing or one of outside of the catalogue once in eight each.
fn hidden(args: &NewArgs, seed: u64) -> Result<Vec<Effect>, CliError> {
    if !args.effect.is_empty() {
        return asked(&args.effect);
    }
    // A stream of its own (splitmix64): the stage is drawn from the same seed.
    let mut state = seed ^ 0x6A09_E667_F3BC_C908;
    let mut draw = |n: usize| {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % n as u64) as usize
    };
    let first = CATALOGUE[draw(CATALOGUE.len())];
    if args.pair {
        let others: Vec<Effect> = CATALOGUE.into_iter().filter(|&other| other != first).collect();
        return Ok(vec![first, others[draw(others.len())]]);
    }
    Ok(match draw(8) {
        0 => Vec::new(),
        1 => vec![OUTSIDE[draw(OUTSIDE.len())]],
        _ => vec![first],
    })
}

fn asked(names: &[String]) -> Result<Vec<Effect>, CliError> {
    if let [only] = names
        && only == "none"
    {
        return Ok(Vec::new());
    }
    let all: Vec<Effect> = CATALOGUE.into_iter().chain(OUTSIDE).collect();
    let effects: Vec<Effect> = names
        .iter()
        .map(|name| one_of("--effect", name, &all, Effect::name))
        .collect::<Result<_, _>>()?;
    match effects[..] {
        [_] => Ok(effects),
        [a, b] if a != b => Ok(effects),
        _ => Err(CliError::Option(format!(
            "--effect {}: one effect, two different ones, or `none` alone",
            names.join(" ")
        ))),
    }
}

fn one_of<T: Copy>(option: &str, name: &str, all: &[T], of: impl Fn(T) -> &'static str) -> Result<T, CliError> {
    all.iter().copied().find(|&one| of(one) == name).ok_or_else(|| {
        let allowed: Vec<&str> = all.iter().map(|&one| of(one)).collect();
        CliError::Option(format!("{option} {name}: allowed are {}", allowed.join(", ")))
    })
}

fn dataset(case: Case) -> Dataset {
    Dataset {
        name: "challenge".to_owned(),
        description: format!(
            "piezo stage, open loop, 0 to {} V; records in the order taken",
            case.full_v
        ),
        known: Known::default(),
        records: case.records.into_iter().map(record).collect(),
        notices: Vec::new(),
    }
}

fn record(record: CaseRecord) -> Record {
    Record {
        file: format!("{}.csv", record.name),
        role: match record.role {
            Use::Identify => Role::Identify,
            Use::Validate => Role::Validate,
        },
        excitation: record.excitation,
        start_s: 0.0,
        period_s: record.period_s,
        voltage_v: record.voltage_v,
        position_um: record.position_um,
        reference_um: None,
        temperature_c: record.temperature_c,
        voltage2_v: record.voltage2_v,
    }
}

fn answer(args: &AnswerArgs) -> Result<Done, CliError> {
    sealed_text(&args.folder)?;
    if args.folder.join(REVEALED).exists() {
        return Err(CliError::Option(format!(
            "{}: its truth has been shown; an answer comes before that",
            args.folder.display()
        )));
    }
    let place = args.folder.join(ANSWER);
    if place.exists() {
        let before = read_answer(&args.folder)?.map_or_else(String::new, |answer| answer.effects.join(", "));
        return Err(CliError::Option(format!(
            "{}: `{before}` was answered before, and the first answer counts; `hysteron challenge reveal` shows the truth",
            args.folder.display()
        )));
    }
    let answer = Answer::new(&args.effects).map_err(CliError::Option)?;
    // An answer needs data that can be read: it may be judged by others.
    load::dataset(&args.folder)?;
    output::write_file(&place, &(serde_json::to_string_pretty(&answer)? + "\n"))?;
    output::print(&format!("answer taken: {}\n", answer.effects.join(", ")))?;
    Ok(Done::Answered)
}

fn reveal(args: &RevealArgs) -> Result<Done, CliError> {
    let sealed = sealed_text(&args.folder)?;
    let key = read(&args.key)?;
    let text =
        seal::open(&sealed, &key).map_err(|reason| CliError::Option(format!("{}: {reason}", args.key.display())))?;
    let truth: SealedTruth = serde_json::from_str(&text)?;
    let answer = read_answer(&args.folder)?;
    output::write_file(
        &args.folder.join(REVEALED),
        &(serde_json::to_string_pretty(&truth)? + "\n"),
    )?;
    let judgement = answer.as_ref().map(|answer| judge(answer, &truth));
    if args.json {
        output::print_json(&serde_json::json!({"truth": truth, "answer": answer, "judgement": judgement}))?;
        return Ok(Done::Answered);
    }
    let mut text = truth.text();
    match (answer, judgement) {
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

fn sealed_text(folder: &Path) -> Result<String, CliError> {
    let place = folder.join(SEALED);
    if !place.exists() {
        return Err(CliError::Option(format!(
            "{}: no challenge (it has no {SEALED}); `hysteron challenge new FOLDER` makes one",
            folder.display()
        )));
    }
    read(&place)
}

fn read_answer(folder: &Path) -> Result<Option<Answer>, CliError> {
    let place = folder.join(ANSWER);
    if !place.exists() {
        return Ok(None);
    }
    let text = read(&place)?;
    let answer: Answer = serde_json::from_str(&text).map_err(|error| {
        CliError::Option(format!(
            "{}: no answer as this program writes it: {error}",
            place.display()
        ))
    })?;
    Answer::new(&answer.effects)
        .map(Some)
        .map_err(|reason| CliError::Option(format!("{}: {reason}", place.display())))
}

fn read(path: &Path) -> Result<String, CliError> {
    std::fs::read_to_string(path).map_err(|error| CliError::Option(format!("{}: {error}", path.display())))
}
