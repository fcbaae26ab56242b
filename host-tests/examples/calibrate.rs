//! Verdicts on hundreds of stages with hidden effects: the confusion matrix of the README.
//!
//! `cargo run --release -p host-tests --example calibrate -- [EACH] [FIRST_SEED] [WORD]`: EACH seeds for every effect and strength (default 4);
//! with WORD only cases whose hidden effect has it in its name, or `nothing`. With `pairs` as WORD: EACH stages with two hidden effects,
//! in one diagnosis; with `learn` the same stages, and what `learn` has in its model at the end. One line a case goes to standard error
//! as they come, the tables to standard output. The evidence of diagnoses goes to `target/calibration/evidence.jsonl`; with
//! `thresholds` as the only word, the verdicts on that evidence are printed with every threshold moved by 30 %. With `odds`, the
//! weights of the probabilities are fitted to the evidence of both calibrations; `--write` puts them where they stand.
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example of the command line"
)]

use host_tests::hidden::score::{calibration, learned, line, markdown, pairs, score, tool};
use host_tests::hidden::thresholds::table;
use host_tests::odds;
use host_tests::stored::{EVIDENCE, Stored, USERS, store, stored};
use std::path::Path;
use std::time::Instant;

/// Where the weights stand.
const WEIGHTS: &str = "crates/diagnose/src/odds/weights.rs";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1).peekable();
    if words.peek().is_some_and(|word| word == "thresholds") {
        print!("{}", table(&read(EVIDENCE, "cargo xtask calibrate")?));
        return Ok(());
    }
    if words.peek().is_some_and(|word| word == "odds") {
        return weights(words.any(|word| word == "--write"));
    }
    let each = words.next().map_or(Ok(4), |word| word.parse::<u64>())?;
    let first_seed = words.next().map_or(Ok(1_000), |word| word.parse::<u64>())?;
    let word = words.next();
    let learns = word.as_deref() == Some("learn");
    let two = learns || word.as_deref() == Some("pairs");
    let mut cases = if two {
        pairs(first_seed, each)
    } else {
        calibration(first_seed, each)
    };
    if let Some(word) = word.filter(|_| !two) {
        cases.retain(|(_, spec)| match spec.hidden.as_slice() {
            [] => word == "nothing",
            hidden => hidden.iter().any(|asked| asked.effect.name().contains(&word)),
        });
    }
    let started = Instant::now();
    let answer = if learns { learned } else { tool };
    let outcomes = score(&cases, answer, |outcome| eprintln!("{}", line(outcome)));
    println!("{}", markdown(&outcomes));
    if !learns {
        store(
            Path::new(EVIDENCE),
            &outcomes.iter().map(Stored::from).collect::<Vec<_>>(),
        )?;
    }
    println!(
        "{} cases of seeds {first_seed} to {}, {:.1} s each on {} threads; {} could not be made.",
        outcomes.len(),
        first_seed + cases.len() as u64,
        started.elapsed().as_secs_f64() / outcomes.len().max(1) as f64,
        std::thread::available_parallelism()?,
        cases.len() - outcomes.len(),
    );
    Ok(())
}

fn read(path: &str, command: &str) -> Result<Vec<Stored>, String> {
    stored(Path::new(path)).map_err(|error| format!("{path}: {error}; run `{command}` first"))
}

/// The weights of the probabilities, from the evidence of both calibrations.
fn weights(write: bool) -> Result<(), Box<dyn std::error::Error>> {
    let mut all = read(EVIDENCE, "cargo xtask calibrate")?;
    all.extend(read(USERS, "cargo xtask calibrate users")?);
    print!("{}", odds::tables(&all));
    let cases: Vec<odds::Case> = all.iter().filter_map(odds::Case::new).collect();
    let weights = odds::fit(&cases.iter().collect::<Vec<_>>());
    print!("\n{}", odds::weights(&weights));
    if write {
        std::fs::write(WEIGHTS, odds::source(&weights, cases.len()))?;
    }
    Ok(())
}
