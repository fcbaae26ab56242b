//! Says which tests `cargo test` alone leaves out on this machine. `cargo xtask test` installs what they need and leaves none out.
#![expect(clippy::print_stdout, reason = "its words are what it is for")]

use std::path::Path;
use std::process::{Command, Stdio};

/// A program, what is tested with it, and the argument to ask it for its version.
const NEEDED: [(&str, &str); 5] = [
    ("chromedriver", "the workbench in a browser"),
    ("qemu-system-arm", "the firmware in the emulator"),
    ("arm-none-eabi-gcc", "the cost of a tick beside the same in C"),
    ("python3", "stages and co-simulation units in another program"),
    ("rustup", "the build for the chip"),
];

fn main() {
    let there = |program: &str| {
        let mut asked = Command::new(program);
        asked.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
        asked.status().is_ok_and(|status| status.success())
    };
    let mut left_out: Vec<String> = NEEDED
        .into_iter()
        .filter(|(program, _)| !there(program))
        .map(|(program, tests)| format!("{tests} (no {program})"))
        .collect();
    if !Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).exists() {
        left_out.push("measured recordings (they are not part of the repository)".to_owned());
    }
    left_out
        .push("lints, the firmware's images, co-simulation units by FMPy, the commands of README and book".to_owned());
    println!("left to `cargo xtask test`:");
    for one in left_out {
        println!("  {one}");
    }
}
