//! Writes a case as users record them: the dataset, the records held out, and the truth.
//!
//! `cargo run --release -p host-tests --example users -- SEED DIR`, or `-- SEED COUNT list` for a line each of COUNT seeds.
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use host_tests::users::{Case, Spec};
use hysteron_data::{Overwrite, write_dataset};
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
        _ => return Err("users SEED DIR, or users SEED COUNT list".into()),
    }
    Ok(())
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
