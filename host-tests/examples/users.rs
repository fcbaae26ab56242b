//! Writes a case as users record them: the dataset, the records held out, and the truth.
//!
//! `cargo run --release -p host-tests --example users -- SEED DIR`, or `-- SEED COUNT list` for a line each of COUNT seeds.
//! `-- SEED COUNT rig` counts what is found of the rigs, beside what was hidden.
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use host_tests::users::{Case, Spec};
use hysteron_acquisition::{Finding, inspect};
use hysteron_data::{Overwrite, write_dataset};
use rayon::prelude::*;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match words.as_slice() {
        [seed, folder] => {
            let case = Case::generate(seed.parse()?, &Spec::default());
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
            let mut found: Vec<String> = seeds.par_iter().flat_map_iter(|&seed| rig(seed)).collect();
            found.sort();
            found.iter().for_each(|line| println!("{line}"));
        }
        _ => return Err("users SEED DIR, or users SEED COUNT list, or users SEED COUNT rig".into()),
    }
    Ok(())
}

/// What is found of a case's rig, a line each.
fn rig(seed: u64) -> Vec<String> {
    let case = Case::generate(seed, &Spec::default());
    let parts: Vec<&str> = case.truth.parts.iter().map(|part| part.hidden.name()).collect();
    let (programme, hidden) = (case.programme.name(), parts.join(" + "));
    let said = |finding: &Finding| format!("{}\tseed {seed}\t{programme}\t{hidden}", finding.kind.title());
    inspect(&case.dataset).findings.iter().map(said).collect()
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
