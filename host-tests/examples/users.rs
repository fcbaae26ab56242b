//! Writes a case as users record them: the dataset, the records held out, and the truth.
//!
//! `cargo run --release -p host-tests --example users -- SEED DIR [WORD]` with a word of `calibrate users`, or `-- SEED COUNT list` for a line each of COUNT seeds.
//! `-- SEED COUNT rig` counts what is found of the rigs, beside what was hidden.
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use host_tests::users::{Case, Spec};
use hysteron_acquisition::inspect;
use hysteron_data::{Overwrite, write_dataset};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match words.as_slice() {
        [seed, folder, only @ ..] if only.len() < 2 && folder.parse::<u64>().is_err() => {
            let spec = match only {
                [word] => Spec::only(word).ok_or_else(|| format!("there is no {word}"))?,
                _ => Spec::default(),
            };
            let case = Case::generate(seed.parse()?, &spec);
            write_dataset(&case.dataset, &Path::new(folder).join("user"), Overwrite::Refuse)?;
            write_dataset(&case.held_out, &Path::new(folder).join("held-out"), Overwrite::Refuse)?;
            println!("{}", line(&case));
        }
        [seed, count, word] if word == "list" => {
            let first: u64 = seed.parse()?;
            for seed in first..first + count.parse::<u64>()? {
                println!("{}", line(&Case::generate(seed, &Spec::default())));
            }
        }
        [seed, count, word] if word == "rig" => {
            let first: u64 = seed.parse()?;
            let seeds: Vec<u64> = (first..first + count.parse::<u64>()?).collect();
            let each: Vec<(&'static str, &'static str)> = seeds.par_iter().flat_map_iter(|&seed| rig(seed)).collect();
            let mut found: BTreeMap<&str, BTreeMap<&str, usize>> = BTreeMap::new();
            for (title, hidden) in each {
                *found.entry(title).or_default().entry(hidden).or_default() += 1;
            }
            println!("| finding | cases | hidden in them |\n|---|---|---|");
            for (title, hidden) in found {
                let cases: usize = hidden.values().sum();
                let hidden: Vec<String> = hidden.iter().map(|(name, cases)| format!("{name} {cases}")).collect();
                println!("| {title} | {cases} | {} |", hidden.join(", "));
            }
        }
        _ => return Err("users SEED DIR [WORD], or users SEED COUNT list, or users SEED COUNT rig".into()),
    }
    Ok(())
}

/// What is found of a case's rig, each kind once, beside the first effect that is hidden.
fn rig(seed: u64) -> Vec<(&'static str, &'static str)> {
    let case = Case::generate(seed, &Spec::default());
    let hidden = case.truth.parts.first().map_or("nothing", |part| part.hidden.name());
    let findings = inspect(&case.dataset).findings;
    let titles: BTreeSet<&str> = findings.iter().map(|finding| finding.kind.title()).collect();
    titles.into_iter().map(|title| (title, hidden)).collect()
}

fn line(case: &Case) -> String {
    let parts: Vec<String> = case
        .truth
        .parts
        .iter()
        .map(|part| format!("{} ({}) {:.2} %", part.hidden.name(), part.form, part.adds_percent))
        .collect();
    let samples: usize = case.dataset.records.iter().map(|record| record.len()).sum();
    format!(
        "{}\t{}\t{}\t{:?}\t{}\tbare {:.2} %\topening {:.1} %\t{} samples",
        case.seed,
        case.programme.name(),
        case.family.name(),
        case.truth.kind,
        parts.join(" + "),
        case.truth.bare_percent,
        case.truth.opening_percent,
        samples
    )
}
