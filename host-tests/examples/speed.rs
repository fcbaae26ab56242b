//! Times of fit, diagnosis and learning on an example, from every family to start from; times and memory of diagnosis on more and more
//! samples.
//!
//! `cargo run --release --package host-tests --example speed`, about three minutes on two cores.
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use host_tests::users::tool;
use hysteron_challenge::examples::{Example, Made};
use hysteron_data::{Dataset, Record, Role};
use hysteron_diagnose::{diagnose, learn_from};
use hysteron_identify::Family;
use hysteron_plant::{Stage, preset};
use std::error::Error;
use std::f64::consts::TAU;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let Made::Dataset { dataset, .. } = Example::HiddenCreep.make(&|_| {})? else {
        return Err("the example is no dataset".into());
    };
    let samples: usize = dataset.records.iter().map(|record| record.voltage_v.len()).sum();
    println!(
        "`hidden-creep`, {} records of {samples} samples together:\n",
        dataset.records.len()
    );
    println!("| start model | fit, s | diagnosis, s | learn, s | learn over diagnosis | steps tried |");
    println!("|---|---|---|---|---|---|");
    for family in [Family::Pi, Family::Mpi, Family::Mrpi, Family::PlayPolynomial] {
        row(&dataset, family)?;
    }
    println!(
        "\nSines of two, four and eight periods a record, 50 kHz, on the paper's stage; the start model is of family `mpi`:\n"
    );
    println!("| records | samples of each | samples together | diagnosis, s | verdict | largest memory so far, MB |");
    println!("|---|---|---|---|---|---|");
    for (records, samples) in [(15, 4000), (300, 200), (1, 1_000_000), (15, 66_667), (15, 200_000)] {
        grown(records, samples)?;
    }
    Ok(())
}

fn grown(records: usize, samples: usize) -> Result<(), Box<dyn Error>> {
    let dataset = sines(records, samples)?;
    let model = tool::start(&dataset, Family::Mpi)?;
    let (diagnosis, diagnosed_s) = timed(|| diagnose(&dataset, &model, &|_, _| {}));
    println!(
        "| {records} | {samples} | {} | {diagnosed_s:.2} | {} | {} |",
        records * samples,
        diagnosis.verdict,
        largest_memory_mb().map_or_else(|| "-".to_owned(), |mb| format!("{mb:.0}"))
    );
    Ok(())
}

/// Records of whole periods, from three ranges in turn, after one that settles.
fn sines(records: usize, samples: usize) -> Result<Dataset, Box<dyn Error>> {
    let config = preset::paper_rate();
    let period_s = 20e-6;
    let record = |i: usize| -> Result<Record, Box<dyn Error>> {
        let periods = [2, 4, 8][i % 3];
        let amplitude_v = [13.0, 8.0, 4.0][i / 3 % 3];
        let angle = |k: usize| TAU * (periods * k) as f64 / samples as f64;
        let drive = |k: usize| amplitude_v - amplitude_v * angle(k).cos();
        let mut stage = Stage::new(&config, 1 + i as u64)?;
        stage.run(&(0..samples / periods).map(drive).collect::<Vec<_>>(), period_s)?;
        let voltage_v: Vec<f64> = (0..samples).map(drive).collect();
        let position_um = stage.run(&voltage_v, period_s)?.position_um;
        // One record alone is fitted, and held out in parts.
        let role = if i % 5 == 4 { Role::Validate } else { Role::Identify };
        Ok(Record::new(
            format!("{i:03}.csv"),
            role,
            period_s,
            voltage_v,
            position_um,
        ))
    };
    Ok(Dataset {
        name: "sines".to_owned(),
        records: (0..records).map(record).collect::<Result<_, _>>()?,
        ..Dataset::default()
    })
}

/// The most memory that the program has held, megabytes; `None` where the system does not say.
fn largest_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kilobytes = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(kilobytes.split_whitespace().next()?.parse::<f64>().ok()? / 1e3)
}

fn row(dataset: &Dataset, family: Family) -> Result<(), Box<dyn Error>> {
    let (model, fitted_s) = timed(|| tool::start(dataset, family));
    let model = model?;
    let (_, diagnosed_s) = timed(|| diagnose(dataset, &model, &|_, _| {}));
    let (learned, learned_s) = timed(|| learn_from(dataset, model, &|_, _| {}));
    let steps = learned?.attempts.len();
    println!(
        "| {family} | {fitted_s:.2} | {diagnosed_s:.2} | {learned_s:.2} | {:.1} | {steps} |",
        learned_s / diagnosed_s
    );
    Ok(())
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let clock = Instant::now();
    let done = work();
    (done, clock.elapsed().as_secs_f64())
}
