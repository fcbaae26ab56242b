//! Verdicts on recordings as users make them: `cargo xtask calibrate users [CASES] [FIRST_SEED] [WORD] [--quick] [--harmless] [--json FILE]`.
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example of the command line"
)]

use host_tests::stored::{Stored, USERS, store};
use host_tests::users::harmless::{Harmless, turned};
use host_tests::users::score::{Outcome, Questions, json, line, run};
use host_tests::users::tables::markdown;
use host_tests::users::{Case, Kind, Spec};
use rayon::prelude::*;
use std::error::Error;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

const HELP: &str = "\
calibrate users [CASES] [FIRST_SEED] [WORD] [--quick] [--harmless] [--json FILE]

  CASES       how many, default 60: programmes and families in turn, what is hidden by the seed
  FIRST_SEED  default 1
  WORD        of all cases only a programme, a family, an effect, or one of nothing, one, outside, pair
  --quick     the first answer only: neither `learn` nor further records
  --harmless  instead, which harmless changes turn which verdicts
  --json      every case's outcome into a file, written anew after each case

Example: cargo xtask calibrate users 40 1 scope --json scope.json
";

struct Options {
    cases: u64,
    first: u64,
    spec: Spec,
    quick: bool,
    harmless: bool,
    json: Option<String>,
}

fn options() -> Result<Options, Box<dyn Error>> {
    let mut options = Options {
        cases: 60,
        first: 1,
        spec: Spec::default(),
        quick: false,
        harmless: false,
        json: None,
    };
    let mut place = 0;
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--quick" => options.quick = true,
            "--harmless" => options.harmless = true,
            "--json" => options.json = Some(words.next().ok_or(HELP)?),
            _ => {
                match place {
                    0 => {
                        options.cases = word
                            .parse()
                            .map_err(|_| format!("{word} is no number of cases\n{HELP}"))?
                    }
                    1 => options.first = word.parse().map_err(|_| format!("{word} is no seed\n{HELP}"))?,
                    2 => options.spec = Spec::only(&word).ok_or_else(|| format!("{word} is not known\n{HELP}"))?,
                    _ => return Err(HELP.into()),
                }
                place += 1;
            }
        }
    }
    Ok(options)
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    let seeds: Vec<u64> = (options.first..options.first + options.cases).collect();
    let started = Instant::now();
    if options.harmless {
        return harmless(&seeds, &options.spec);
    }
    let questions = Questions {
        learn: !options.quick,
        next: !options.quick,
    };
    let done = Mutex::new(Vec::new());
    let outcomes = run(&seeds, &options.spec, questions, |outcome| {
        eprintln!("{}", line(outcome));
        if let (Some(file), Ok(mut done)) = (&options.json, done.lock()) {
            done.push(json(outcome));
            if let Err(error) = std::fs::write(file, format!("{:#}\n", serde_json::Value::from(done.clone()))) {
                eprintln!("{file}: {error}");
            }
        }
    });
    println!("{}", markdown(&outcomes));
    store(
        Path::new(USERS),
        &outcomes.iter().filter_map(stored).collect::<Vec<_>>(),
    )?;
    let seconds = |n: usize| outcomes.iter().map(|o: &Outcome| o.took_s[n]).sum::<f64>() / outcomes.len().max(1) as f64;
    println!(
        "{} cases of seeds {} to {} in {:.0} s on {} threads; a case, seconds: {:.1} to make, {:.1} to answer, {:.1} to learn, {:.1} to ask again.",
        outcomes.len(),
        options.first,
        options.first + options.cases - 1,
        started.elapsed().as_secs_f64(),
        std::thread::available_parallelism()?,
        seconds(0),
        seconds(1),
        seconds(2),
        seconds(3),
    );
    Ok(())
}

/// What is set by cases in which enough is hidden: an effect that adds half a percent, or nothing of the catalogue.
fn stored(outcome: &Outcome) -> Option<Stored> {
    let most = outcome
        .truth
        .parts
        .iter()
        .map(|part| part.adds_percent)
        .fold(0.0, f64::max);
    let counts = matches!(outcome.truth.kind, Kind::Nothing | Kind::Outside) || most > 0.5;
    let said = outcome.said.as_ref().ok().filter(|_| counts)?;
    Some(Stored {
        seed: outcome.seed,
        accepted: outcome.truth.accepted().into_iter().map(str::to_owned).collect(),
        evidence: said.evidence.clone(),
    })
}

fn harmless(seeds: &[u64], spec: &Spec) -> Result<(), Box<dyn Error>> {
    let found: Vec<_> = seeds
        .par_iter()
        .with_max_len(1)
        .map(|seed| {
            let case = Case::generate(*seed, spec);
            let result = turned(&case);
            let hidden: Vec<&str> = case.truth.parts.iter().map(|part| part.hidden.name()).collect();
            match &result {
                Ok((turned, tried)) => {
                    let words: Vec<String> = turned
                        .iter()
                        .map(|t| format!("{}: {} -> {}", t.by.words(), t.before, t.after))
                        .collect();
                    eprintln!(
                        "seed {seed}\t{}\t[{}]\t{} of {tried} turned\t{}",
                        case.programme.name(),
                        hidden.join(" + "),
                        turned.len(),
                        words.join("; ")
                    );
                }
                Err(error) => eprintln!("seed {seed}\t{}\t{error}", case.programme.name()),
            }
            result
        })
        .collect();
    println!("| harmless change | verdicts turned | which |\n|---|---|---|");
    for by in Harmless::ALL {
        let turned: Vec<String> = seeds
            .iter()
            .zip(&found)
            .filter_map(|(seed, result)| Some((seed, result.as_ref().ok()?)))
            .flat_map(|(seed, (turned, _))| turned.iter().map(move |t| (seed, t)))
            .filter(|(_, t)| t.by == by)
            .map(|(seed, t)| format!("{seed}: {} -> {}", t.before, t.after))
            .collect();
        println!(
            "| {} | {} of {} cases | {} |",
            by.words(),
            turned.len(),
            seeds.len(),
            turned.join("; ")
        );
    }
    let tried: usize = found
        .iter()
        .filter_map(|result| result.as_ref().ok())
        .map(|(_, tried)| tried)
        .sum();
    println!("\n{tried} changes of {} cases.", seeds.len());
    Ok(())
}
