//! The measured mirror of the book's evidence: its error after each effect that is added, and after `learn`, as tables.
//!
//! `cargo run --release --package host-tests --example mirror`; the recordings lie in `../shared/data` beside the project.
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example of the command line"
)]

use hysteron_data::{Dataset, Role, read_dataset};
use hysteron_diagnose::{Stop, add, learn};
use hysteron_identify::{EffectId, Family, FitOptions, Model, RecordError, fit, present_step, record_errors};
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// Effects in the order in which a user adds them by hand.
const BY_HAND: [EffectId; 3] = [EffectId::Delay, EffectId::Resonance, EffectId::ThermalDrift];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/cubespec-fsm-lowband");
    let dataset = read_dataset(&folder)?;
    let options = FitOptions::new(Family::Pi);
    let clock = Instant::now();
    let mut model = fit(&dataset, &options, &|_| {})?.model;
    let mut rungs = vec![("`pi`".to_owned(), model.clone())];
    for effect in BY_HAND {
        model = add(&dataset, &model, effect, &|_| {})?.model;
        rungs.push((format!("`+ {effect}`"), model.clone()));
        eprintln!("{effect} added after {:.0} s", clock.elapsed().as_secs_f64());
    }
    let learned = learn(&dataset, &options, &|_, _| {})?;
    eprintln!("learned after {:.0} s", clock.elapsed().as_secs_f64());
    let effects: Vec<String> = learned.model.effects.iter().map(|one| one.name.to_string()).collect();
    rungs.push((format!("`learn`: {}", effects.join(", ")), learned.model));
    let judged = dataset.records.iter().filter(|record| record.role == Role::Validate);
    let files: Vec<&str> = judged.map(|record| record.file.as_str()).collect();
    println!("Error over the whole record, rms, percent of peak to peak; pooled as root mean square:\n");
    table(&dataset, &rungs, &files, |error| error.percent, true);
    println!(
        "\nError in the last period of the drive over the output there, rms, each about its mean, percent: a drift from \
         period to period does not count.\n"
    );
    table(&dataset, &rungs, &files, |error| error.last_period_percent, false);
    println!("\n`learn` stopped: {}.", stopped(&learned.stop));
    Ok(())
}

fn table(
    dataset: &Dataset,
    rungs: &[(String, Model)],
    files: &[&str],
    figure: impl Fn(&RecordError) -> Option<f64>,
    pooled: bool,
) {
    let last = if pooled { " pooled |" } else { "" };
    println!("| model | {} |{last}", files.join(" | "));
    println!(
        "|---|{}{}",
        "---|".repeat(files.len()),
        if pooled { "---|" } else { "" }
    );
    for (name, model) in rungs {
        let errors = record_errors(dataset, model);
        let of = |file: &&str| errors.iter().find(|error| error.file == **file).and_then(&figure);
        let mut cells: Vec<String> = files.iter().map(|file| cell(of(file))).collect();
        if pooled {
            cells.push(cell(present_step(dataset, model).validate_percent));
        }
        println!("| {name} | {} |", cells.join(" | "));
    }
}

fn cell(percent: Option<f64>) -> String {
    percent.map_or_else(|| "-".to_owned(), |percent| format!("{percent:.2}"))
}

fn stopped(stop: &Stop) -> &'static str {
    match stop {
        Stop::NothingMissing => "nothing is missing",
        Stop::CannotTell { .. } => "the records cannot answer",
        Stop::Unknown { .. } => "structure remains that nothing in the catalogue explains",
        Stop::EnoughSteps => "as many steps as are allowed",
    }
}
