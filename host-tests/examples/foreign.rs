//! Tracking on stages that share no law with the simulated stage: `cargo run --release -p host-tests --example foreign -- [STAGES] [FIRST]`.
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use host_tests::foreign::{Foreign, HERTZ, Outcome, median_and_worst, outcome};
use rayon::prelude::*;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let mut number = |usual: u64| words.next().map_or(Ok(usual), |word| word.parse::<u64>());
    let (count, first) = (number(12)?, number(1)?);
    let seeds: Vec<u64> = (first..first + count).collect();
    let all: Vec<_> = seeds.par_iter().with_max_len(1).map(|seed| outcome(*seed)).collect();
    let head: Vec<String> = HERTZ.iter().map(|hz| format!("{hz} Hz")).collect();
    println!(
        "| seed | hysteresis | mode, Hz | untold | helps to, Hz | {} |\n|{}",
        head.join(" | "),
        "---|".repeat(5 + HERTZ.len())
    );
    for (seed, outcome) in seeds.iter().zip(&all) {
        let stage = Foreign::new(*seed);
        let cells = match outcome {
            Ok(Outcome {
                helps_to_hz, percent, ..
            }) => {
                let [open, closed] = percent;
                let each = open
                    .iter()
                    .zip(closed)
                    .map(|(open, closed)| format!(" | {open:.3} / {closed:.3}"));
                let helps = helps_to_hz.map_or("-".to_owned(), |hz| format!("{hz:.0}"));
                helps + &each.collect::<String>()
            }
            Err(refused) => format!("- | refused: {refused}{}", " | ".repeat(HERTZ.len() - 1)),
        };
        println!(
            "| {seed} | {} | {:.0} | {} | {cells} |",
            stage.family.name(),
            stage.mode_hz,
            stage.untold.words(),
        );
    }
    let made: Vec<&Outcome> = all.iter().flatten().collect();
    for (which, word) in ["median", "worst"].into_iter().enumerate() {
        let of = |k: usize, closed: usize| median_and_worst(made.iter().map(|o| o.percent[closed][k]))[which];
        let cells = (0..HERTZ.len()).map(|k| format!(" | {:.3} / {:.3}", of(k, 0), of(k, 1)));
        println!("| {word} | | | | {} |", cells.collect::<String>());
    }
    println!("\nFound over expected, open and closed, where the records cover it:\n");
    println!("| median | largest | at most 1.5 |\n|---|---|---|");
    let ratios: Vec<f64> = made.iter().flat_map(|outcome| outcome.over_expected()).collect();
    let [median, largest] = median_and_worst(ratios.iter().copied());
    let kept = ratios.iter().filter(|ratio| **ratio <= 1.5).count();
    println!("| {median:.2} | {largest:.2} | {kept} of {} |", ratios.len());
    Ok(())
}
