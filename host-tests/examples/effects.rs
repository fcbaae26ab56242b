//! `add_effect` on stages that have the effect: error and parameters against the truth, and the time. How far the error
//! stays above that of the same model, fitted to the same stage without the effect, is counted at the end.
//!
//! `cargo run --release -p host-tests --example effects -- [SEEDS] [FIRST_SEED] [WORD]`
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use host_tests::hidden::generate;
use hysteron_identify::{FitOptions, fit};
use hysteron_plant::challenge::{CATALOGUE, Spec, StageFamily, Strength};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let seeds = words.next().map_or(Ok(2), |word| word.parse::<u64>())?;
    let first = words.next().map_or(Ok(500), |word| word.parse::<u64>())?;
    let word = words.next().unwrap_or_default();
    println!(
        "effect               seed  without  before   after  after/without  (validation, % of peak to peak)  time"
    );
    let mut ratios = Vec::new();
    for effect in CATALOGUE {
        if !effect.name().contains(&word) {
            continue;
        }
        for seed in first..first + seeds {
            let mut spec = Spec::one(effect, Strength::Medium);
            spec.family = Some(StageFamily::Preisach);
            let Ok(with) = generate(seed, &spec) else { continue };
            spec.hidden.clear();
            let without = generate(seed, &spec)?;
            let options = FitOptions::new(with.start);
            let bare = fit(&without.dataset, &options, &|_| ())?.model;
            let floor = hysteron_diagnose::compare(&without.dataset, &bare, &|_| ());
            let model = fit(&with.dataset, &options, &|_| ())?.model;
            let started = Instant::now();
            let id = effect.name().parse()?;
            let added = match hysteron_diagnose::add(&with.dataset, &model, id, &|_| ()) {
                Ok(added) => added,
                Err(refused) => {
                    println!("{:<20} {seed:>5}  {refused}", effect.name());
                    continue;
                }
            };
            let time_s = started.elapsed().as_secs_f64();
            let without_percent = floor.validate.map_or(f64::NAN, |p| p.nrmse_percent);
            let after_percent = added.after.validate_percent.unwrap_or(f64::NAN);
            ratios.push(after_percent / without_percent);
            println!(
                "{:<20} {seed:>5}  {without_percent:>7.3} {:>7.3} {after_percent:>7.3} {:>7.2}  {} {time_s:.2} s",
                effect.name(),
                added.before.validate_percent.unwrap_or(f64::NAN),
                after_percent / without_percent,
                with.start
            );
            for parameter in &with.truth.hidden[0].parameters {
                println!(
                    "      true  {:<24} {:>12.5e} {}",
                    parameter.name, parameter.value, parameter.unit
                );
            }
            for fitted in &added.model.effects {
                for p in &fitted.parameters {
                    println!(
                        "      found {:<24} {:>12.5e} {} +- {:?}",
                        p.name, p.value, p.unit, p.standard_error
                    );
                }
            }
        }
    }
    let within = ratios.iter().filter(|ratio| **ratio <= 1.5).count();
    let worst = ratios.iter().copied().fold(f64::NAN, f64::max);
    println!("within 1.5 times: {within} of {}, worst {worst:.2}", ratios.len());
    Ok(())
}
