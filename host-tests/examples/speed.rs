//! Times of fit, diagnosis and learning on an example, from every family to start from.
//!
//! `cargo run --release --package host-tests --example speed`, about two minutes on two cores.
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use host_tests::users::tool;
use hysteron_challenge::examples::{Example, Made};
use hysteron_data::Dataset;
use hysteron_diagnose::{diagnose, learn_from};
use hysteron_identify::Family;
use std::error::Error;
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
    Ok(())
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
