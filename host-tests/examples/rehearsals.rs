//! The tables of hidden effects, learned and undone: `hysteron rehearse` of each effect and seed.
//!
//! `cargo run --release -p host-tests --example rehearsals -- SEEDS` builds the program and runs it.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "an example prints its tables")]

use serde_json::Value;
use std::error::Error;
use std::process::{Command, Stdio};

const EFFECTS: [&str; 6] = [
    "delay",
    "first-order-lag",
    "resonance",
    "cross-coupling",
    "mains-hum",
    "creep",
];
const REFERENCES: [&str; 4] = ["10", "100", "500", "hold"];
/// An effect dominates a reference where it leaves so many times what the trained hysteresis leaves with nothing hidden.
const DOMINATES: f64 = 6.0;
/// An effect is undone where the error falls by more than this factor.
const UNDONE: f64 = 5.0;

/// One rehearsal, as far as the tables need it; errors in percent of the range, by reference.
struct Rehearsed {
    effect: &'static str,
    seed: u64,
    named: bool,
    truth: String,
    before: [f64; 4],
    open: [f64; 4],
    closed: [f64; 4],
    bare: [f64; 4],
}

fn main() -> Result<(), Box<dyn Error>> {
    let seeds: u64 = std::env::args().nth(1).as_deref().unwrap_or("5").parse()?;
    let mut all = Vec::new();
    for seed in 1..=seeds {
        for effect in EFFECTS {
            eprintln!("> {effect}, seed {seed}");
            all.push(rehearse(effect, seed)?);
        }
    }
    every_reference(&all);
    every_seed(&all, seeds);
    counts(&all);
    Ok(())
}

fn rehearse(effect: &'static str, seed: u64) -> Result<Rehearsed, Box<dyn Error>> {
    let run = Command::new("cargo")
        .args(["run", "--quiet", "--release", "--locked", "-p", "hysteron-cli", "--"])
        .args(["rehearse", effect, "--seed", &seed.to_string(), "--json"])
        .stderr(Stdio::inherit())
        .output()?;
    let answer: Value = serde_json::from_slice(&run.stdout)?;
    let trained = |loop_kind: &str| {
        let rungs = answer["rungs"].as_array().into_iter().flatten();
        let mut of_loop = rungs.filter(|rung| rung["trained"] == true && rung["loop"] == loop_kind);
        of_loop.next().map(|rung| percents(&rung["tracking_percent"]))
    };
    Ok(Rehearsed {
        effect,
        seed,
        named: answer["named"] == true,
        truth: answer["truth"].as_str().unwrap_or_default().to_owned(),
        before: percents(&answer["without_compensator_percent"]),
        open: trained("open").unwrap_or([f64::NAN; 4]),
        closed: trained("closed").unwrap_or([f64::NAN; 4]),
        bare: percents(&answer["without_effect_percent"]),
    })
}

fn percents(of: &Value) -> [f64; 4] {
    REFERENCES.map(|reference| of[reference].as_f64().unwrap_or(f64::NAN))
}

/// Seed 1 on every reference.
fn every_reference(all: &[Rehearsed]) {
    println!("**Seed 1, open loop: error before / after, percent of the range**\n");
    println!("| hidden | named | 10 Hz | 100 Hz | 500 Hz | hold | 500 Hz, closed |\n|---|---|---|---|---|---|---|");
    for one in all.iter().filter(|one| one.seed == 1) {
        let pairs: Vec<String> = (0..4)
            .map(|i| format!("{:.3} / {:.3}", one.before[i], one.open[i]))
            .collect();
        let named = if one.named { "yes" } else { "no" };
        println!(
            "| {}: {} | {named} | {} | {:.3} |",
            one.effect,
            one.truth,
            pairs.join(" | "),
            one.closed[2]
        );
    }
    println!();
}

/// Every seed at 500 Hz.
fn every_seed(all: &[Rehearsed], seeds: u64) {
    println!("**500 Hz, open loop: error before / after, percent of the range**\n");
    println!("| seed | nothing hidden | {} |", EFFECTS.join(" | "));
    println!("|---|---|{}", "---|".repeat(EFFECTS.len()));
    for seed in 1..=seeds {
        let of_seed: Vec<&Rehearsed> = all.iter().filter(|one| one.seed == seed).collect();
        let pairs: Vec<String> = of_seed
            .iter()
            .map(|one| format!("{:.3} / {:.3}", one.before[2], one.open[2]))
            .collect();
        let bare = of_seed.first().map_or(f64::NAN, |one| one.bare[2]);
        println!("| {seed} | {bare:.3} | {} |", pairs.join(" | "));
    }
    println!();
}

/// How many are named, and how many errors fall where the effect dominates.
fn counts(all: &[Rehearsed]) {
    let named = all.iter().filter(|one| one.named).count();
    println!("| counted | of | found |\n|---|---|---|");
    println!("| effects named | {} | {named} |", all.len());
    for (loop_kind, of) in [
        ("open", (|one| one.open) as fn(&Rehearsed) -> [f64; 4]),
        ("closed", |one| one.closed),
    ] {
        let pairs = all.iter().flat_map(|one| {
            let largest = one.bare.iter().copied().fold(0.0, f64::max);
            let dominated = (0..4).filter(move |&i| one.before[i] > DOMINATES * largest);
            dominated.map(move |i| (one.before[i], of(one)[i]))
        });
        let pairs: Vec<(f64, f64)> = pairs.collect();
        let undone = pairs.iter().filter(|(before, after)| *before > UNDONE * after).count();
        println!(
            "| errors that the effect dominates, down more than {UNDONE:.0} times, {loop_kind} loop | {} | {undone} |",
            pairs.len()
        );
    }
    let mut after: Vec<f64> = all.iter().flat_map(|one| one.open).collect();
    after.sort_by(f64::total_cmp);
    println!(
        "| errors after, open loop, percent of the range: median, largest | {} | {:.3}, {:.3} |",
        after.len(),
        after[after.len() / 2],
        after[after.len() - 1]
    );
}
