//! Checks the parameter table and turns it, and one period of a cosine, into constants.
//!
//! `HYSTERON_TABLE` names another table than `firmware/tables/paper-rate-mrpi.toml`, by a full path; `HYSTERON_TABLE_Y` that of a second
//! axis.

use std::{env, fs, path::Path, process::exit};

/// Intervals of the cosine: straight lines between them are off by at most (2 pi / 1024)^2 / 8 = 4.7e-6 of the amplitude.
const COSINE_INTERVALS: usize = 1024;

fn main() {
    let first = env::var("HYSTERON_TABLE").unwrap_or_else(|_| "../tables/paper-rate-mrpi.toml".to_owned());
    let second = env::var("HYSTERON_TABLE_Y").unwrap_or_else(|_| first.clone());
    let mut source = constants(&first);
    write("table_y.rs", &constants(&second));
    let turn = |i: usize| 2.0 * std::f64::consts::PI * i as f64 / COSINE_INTERVALS as f64;
    let cosine: Vec<String> = (0..=COSINE_INTERVALS)
        .map(|i| format!("{:?}", turn(i).cos() as f32))
        .collect();
    source += &format!(
        "pub const COSINE: [f32; {}] = [{}];\n",
        COSINE_INTERVALS + 1,
        cosine.join(", ")
    );
    write("table.rs", &source);
    println!("cargo::rerun-if-env-changed=HYSTERON_TABLE");
    println!("cargo::rerun-if-env-changed=HYSTERON_TABLE_Y");
}

/// A table, checked, as Rust source.
fn constants(path: &str) -> String {
    println!("cargo::rerun-if-changed={path}");
    let Ok(text) = fs::read_to_string(path) else {
        refuse(&format!(
            "cannot read the table {path}; write one with `hysteron export`"
        ));
    };
    let table = hysteron_table::Table::parse(&text);
    let source = table.and_then(|table| table.constants(&text));
    source.unwrap_or_else(|error| refuse(&format!("{path}: {error}")))
}

fn write(name: &str, source: &str) {
    let folder = env::var("OUT_DIR").unwrap_or_else(|_| refuse("cargo did not set OUT_DIR"));
    if let Err(error) = fs::write(Path::new(&folder).join(name), source) {
        refuse(&format!("cannot write to {folder}: {error}"));
    }
}

fn refuse(reason: &str) -> ! {
    println!("cargo::error={reason}");
    exit(1);
}
