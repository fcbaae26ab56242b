//! Free simulation of MRPI, N = 10, `f64`, one core, against the same loop in C with `cc -O3` in the same run.
//!
//! `cargo bench -p hysteron-core` prints nanoseconds a sample of both (the best of 120 runs over a million samples,
//! taken in turns), and their ratio. Without `cc` the comparison is left out, and said so.
#![expect(clippy::print_stdout, reason = "a bench prints its figures")]

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::envelope::Envelope;
use hysteron_core::model::Hysteresis;
use hysteron_core::mpi::MpiCoefficients;
use hysteron_core::mrpi::Mrpi;
use hysteron_core::thresholds::Thresholds;
use std::process::Command;
use std::time::Instant;

const N: usize = 10;
const SAMPLES: usize = 1_000_000;
/// Many short turns: on a machine that others use, each side then meets a quiet moment, and the same ones.
const ROUNDS: usize = 40;
const RUNS_A_ROUND: usize = 3;

fn model() -> Result<Mrpi<f64, N>, Box<dyn std::error::Error>> {
    let bank = PlayBank::new(
        Thresholds::new(std::array::from_fn(|i| 0.1 * i as f64))?,
        -10.0,
        10.0,
        50e3,
    )?;
    let weights = std::array::from_fn(|i| 0.1 / (i + 1) as f64);
    let coefficients = MpiCoefficients {
        offset: 0.0,
        cubic: -0.08,
        linear: 0.5,
        weights,
    };
    Ok(Mrpi::new(
        bank,
        coefficients,
        Envelope {
            alpha_s: 3e-4,
            beta_s: 1e-4,
        },
    )?)
}

#[inline(never)]
fn simulate(model: &Mrpi<f64, N>, inputs: &[f64], outputs: &mut [f64]) {
    let mut state = PlayState::virgin();
    for (output, &input) in outputs.iter_mut().zip(inputs) {
        *output = model.step(&mut state, input);
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = model()?;
    let turn = std::f64::consts::TAU * 97.0 / 50e3;
    let inputs: Vec<f64> = (0..SAMPLES).map(|k| 0.5 - 0.5 * (turn * k as f64).cos()).collect();
    let mut outputs = vec![0.0; SAMPLES];
    let c = compile_c();
    let (mut rust_ns, mut c_ns) = (f64::INFINITY, f64::INFINITY);
    let mut last_of_c = None;
    for _ in 0..ROUNDS {
        for _ in 0..RUNS_A_ROUND {
            let start = Instant::now();
            simulate(
                &model,
                std::hint::black_box(&inputs),
                std::hint::black_box(&mut outputs),
            );
            rust_ns = rust_ns.min(start.elapsed().as_secs_f64() * 1e9 / SAMPLES as f64);
        }
        if let Some(program) = &c {
            let printed = Command::new(program).arg(RUNS_A_ROUND.to_string()).output()?.stdout;
            let text = String::from_utf8(printed)?;
            let mut words = text.split_whitespace();
            c_ns = c_ns.min(words.next().ok_or("no time from C")?.parse()?);
            last_of_c = Some(words.next().ok_or("no output from C")?.parse::<f64>()?);
        }
    }
    println!(
        "MRPI, N = {N}, f64, free simulation of {SAMPLES} samples, best of {}:",
        ROUNDS * RUNS_A_ROUND
    );
    println!(
        "  Rust       {rust_ns:6.2} ns/sample  ({:.0} million samples/s)",
        1e3 / rust_ns
    );
    match last_of_c {
        Some(last) => {
            println!(
                "  C, cc -O3  {c_ns:6.2} ns/sample  ({:.0} million samples/s)",
                1e3 / c_ns
            );
            println!("  Rust / C   {:6.2}", rust_ns / c_ns);
            println!("  last output differs by {:.1e}", (last - outputs[SAMPLES - 1]).abs());
        }
        None => println!("  no cc on this machine: the comparison with C is left out"),
    }
    if let Some(program) = c {
        std::fs::remove_file(program)?;
    }
    Ok(())
}

/// Compiles the C twin into the temporary folder; `None` where there is no compiler.
fn compile_c() -> Option<std::path::PathBuf> {
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/mrpi.c");
    let program = std::env::temp_dir().join(format!("hysteron-mrpi-c-{}", std::process::id()));
    let built = Command::new("cc")
        .args(["-O3", "-o"])
        .arg(&program)
        .args([source, "-lm"])
        .status();
    built.is_ok_and(|status| status.success()).then_some(program)
}
