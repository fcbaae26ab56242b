//! Separable least squares against the paper's particle swarm: same model, same records, same objective (eqs 17, 18).
//!
//! `cargo bench -p hysteron-identify` prints objective and time of both, for the inverse MRPI of both presets (10, 100
//! and 500 Hz) and for a real recording where `../shared/data` is there; and the time for three sines of 50 000 samples.
#![expect(clippy::print_stdout, reason = "a bench prints its figures")]
#![expect(clippy::unwrap_used, reason = "a bench that cannot build its subject fails")]

#[path = "../tests/stage/mod.rs"]
mod stage;

use hysteron_data::Dataset;
use hysteron_identify::{Family, FitOptions, FitReport, Method, fit};
use std::path::Path;
use std::time::Instant;

fn timed(dataset: &Dataset, method: Method) -> (FitReport, f64) {
    let options = FitOptions {
        method,
        ..FitOptions::paper(Family::Mrpi)
    };
    let start = Instant::now();
    let report = fit(dataset, &options, &|_| ()).unwrap();
    (report, start.elapsed().as_secs_f64())
}

fn race(name: &str, dataset: &Dataset) {
    let (separable, quick) = timed(dataset, Method::Separable);
    let (swarm, slow) = timed(dataset, Method::Mpso);
    println!(
        "{name:<28} {:>12.4e} {quick:>9.3} {:>12.4e} {slow:>9.1} {:>9.3} {:>8.0}",
        separable.objective,
        swarm.objective,
        separable.objective / swarm.objective,
        slow / quick
    );
}

fn main() {
    println!("inverse MRPI, N = 10, objective 17 with weights 18; times in seconds");
    println!(
        "{:<28} {:>12} {:>9} {:>12} {:>9} {:>9} {:>8}",
        "records", "separable", "time", "swarm", "time", "obj ratio", "times"
    );
    let frequencies = [10.0, 100.0, 500.0];
    race(
        "paper-rate",
        &stage::sines(&hysteron_plant::preset::paper_rate(), &frequencies, None),
    );
    race(
        "paper-delay",
        &stage::sines(&hysteron_plant::preset::paper_delay(), &frequencies, None),
    );
    let real = Path::new("../../../shared/data/cubespec-fsm-lowband");
    if real.exists() {
        race("cubespec-fsm-lowband", &hysteron_data::read_dataset(real).unwrap());
    } else {
        println!("cubespec-fsm-lowband: not here, left out");
    }
    let long = stage::sines(&hysteron_plant::preset::paper_rate(), &frequencies, Some(50_000));
    let (_, seconds) = timed(&long, Method::Separable);
    println!("three sines of 50 000 samples, separable: {seconds:.2} s");
}
