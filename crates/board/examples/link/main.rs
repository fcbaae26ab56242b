//! The link of a board with two axes over a cable of this process: `cargo run --release -p hysteron-board --example link -- [SECONDS]`.
//!
//! Twice, of the board's time: nothing lost, and one datagram of a hundred.
#![expect(clippy::print_stdout, reason = "an example of the command line")]

#[allow(dead_code, reason = "some of it is the tests' alone")]
mod bench;
#[allow(dead_code, reason = "some of it is the tests' alone")]
mod cable;

use bench::{Bench, Failure};
use cable::Heard;

fn main() -> Result<(), Failure> {
    let seconds: f64 = match std::env::args().nth(1) {
        Some(word) => word.parse().map_err(|_| format!("{word} is no number of seconds"))?,
        None => 600.0,
    };
    println!(
        "| seconds | datagrams lost on purpose | samples that came | not as they were sent | ticks missing by their numbers | gaps |"
    );
    println!("|---|---|---|---|---|---|");
    for loses in [0, 100] {
        let mut bench = Bench::new(loses)?;
        bench.connect(true)?;
        let mut heard = Heard::default();
        bench.run((seconds * 50_000.0) as u32, &mut heard, &mut |_| {});
        println!(
            "| {seconds:.0} | {} | {} | {} | {} | {} |",
            bench.board.end.lost, heard.samples, heard.wrong, heard.missing, heard.gaps
        );
    }
    Ok(())
}
