//! Public benchmarks: error on the test records of a start model and of `learn`, beside a linear model and a NARX of a library.
//!
//! `cargo xtask benchmark [bouc-wen|duffing|friction] [--quick] [-o FOLDER]`: with `--quick` without `learn`; the datasets go to FOLDER
//! (default `target/benchmark`). The NARX runs in `python3` where `sysidentpy` is installed, in that of `HYSTERON_PYTHON` if set.
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example of the command line"
)]

use host_tests::benchmark::System;
use host_tests::benchmark::linear::Linear;
use host_tests::users::tool;
use hysteron_data::{Dataset, Overwrite, Record, Role, write_dataset};
use hysteron_identify::{Family, Model};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut only = None;
    let (mut quick, mut folder) = (false, PathBuf::from("target/benchmark"));
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--quick" => quick = true,
            "-o" => folder = words.next().ok_or("-o wants a folder")?.into(),
            name => {
                let known = System::ALL.into_iter().find(|system| system.name() == name);
                only = Some(known.ok_or_else(|| format!("{name} is none of bouc-wen, duffing, friction"))?);
            }
        }
    }
    println!(
        "| system | test record | noise of training | constant | linear | NARX | start model | learn | learn's effects |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for system in System::ALL
        .into_iter()
        .filter(|system| only.is_none_or(|only| only == *system))
    {
        rows(system, quick, &folder)?;
    }
    println!("\nErrors in um rms, free simulation from rest.");
    Ok(())
}

fn rows(system: System, quick: bool, folder: &Path) -> Result<(), Box<dyn Error>> {
    let made = system.benchmark(1);
    let dataset = &made.dataset;
    let folder = folder.join(system.name());
    write_dataset(dataset, &folder, Overwrite::Allow)?;
    let linear = Linear::fit(dataset);
    let narx = narx(&folder);
    let clock = Instant::now();
    let start = tool::start(dataset, Family::Mpi)?;
    eprintln!("{}: fitted in {:.1} s", system.name(), clock.elapsed().as_secs_f64());
    let learned = (!quick).then(|| tool::learned(dataset, start.clone())).transpose()?;
    eprintln!("{}: learned in {:.1} s", system.name(), clock.elapsed().as_secs_f64());
    for record in dataset.with_role(Role::Validate) {
        let linear = linear
            .as_ref()
            .map_or("-".to_owned(), |model| figure(model.rms_um(record)));
        let narx = narx
            .iter()
            .find(|(file, _)| *file == record.file)
            .map_or("not run", |(_, rms)| rms.as_str());
        let (after, effects) = learned
            .as_ref()
            .map_or(("not run".to_owned(), String::new()), |(model, effects)| {
                (figure(rms_um(model, record)), effects.join(", "))
            });
        println!(
            "| {} | {} | {} | {} | {linear} | {narx} | {} | {after} | {effects} |",
            system.name(),
            record.file,
            figure(made.noise_um),
            figure(about_mean(dataset, record)),
            figure(rms_um(&start, record)),
        );
    }
    Ok(())
}

fn figure(um: f64) -> String {
    format!("{um:.3}")
}

fn rms_um(model: &Model, record: &Record) -> f64 {
    let squares = model
        .simulate(record)
        .output
        .into_iter()
        .zip(&record.position_um)
        .map(|(m, y)| (y - m).powi(2));
    (squares.sum::<f64>() / record.len() as f64).sqrt()
}

/// What the mean of the train records leaves.
fn about_mean(dataset: &Dataset, record: &Record) -> f64 {
    let train: Vec<f64> = dataset
        .with_role(Role::Identify)
        .flat_map(|r| r.position_um.iter().copied())
        .collect();
    let mean = train.iter().sum::<f64>() / train.len() as f64;
    (record.position_um.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / record.len() as f64).sqrt()
}

/// Test record and error of the library's model, as its program prints them; nothing, and a word why, where it cannot run.
fn narx(folder: &Path) -> Vec<(String, String)> {
    let python = std::env::var("HYSTERON_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/benchmark_narx.py");
    match Command::new(&python).arg(script).arg(folder).output() {
        Ok(output) if output.status.success() => String::from_utf8_lossy(&output.stdout)
            .lines()
            .filter_map(|line| line.split_once('\t'))
            .map(|(file, rms)| (file.to_owned(), rms.to_owned()))
            .collect(),
        Ok(output) => {
            let said = String::from_utf8_lossy(&output.stderr);
            eprintln!("NARX not run: {}", said.lines().last().unwrap_or_default());
            Vec::new()
        }
        Err(error) => {
            eprintln!("NARX not run: {python}: {error}");
            Vec::new()
        }
    }
}
