//! Checks the parameter table and turns it, and one period of a cosine, into constants.
//!
//! `HYSTERON_TABLE` names other tables than `firmware/tables/paper-rate-mrpi.toml`, by full paths as `PATH` lists them: the image's
//! banks, from bank 0 on. `HYSTERON_TABLE_Y` names those of a second axis, as many.

use std::path::{Path, PathBuf};
use std::{env, fs, process::exit};

/// Intervals of the cosine: straight lines between them are off by at most (2 pi / 1024)^2 / 8 = 4.7e-6 of the amplitude.
const COSINE_INTERVALS: usize = 1024;

fn main() {
    let first = env::var("HYSTERON_TABLE").unwrap_or_else(|_| "../tables/paper-rate-mrpi.toml".to_owned());
    let second = env::var("HYSTERON_TABLE_Y").unwrap_or_else(|_| first.clone());
    let (mut source, banks, rate_hz) = constants(&first);
    let (source_y, banks_y, rate_y_hz) = constants(&second);
    if banks != banks_y {
        refuse(&format!(
            "HYSTERON_TABLE names {banks} tables and HYSTERON_TABLE_Y {banks_y}; both axes change their bank by one order"
        ));
    }
    if rate_hz != rate_y_hz {
        refuse(&format!(
            "sample_rate_hz is {rate_hz} in HYSTERON_TABLE and {rate_y_hz} in HYSTERON_TABLE_Y; both axes have one sample clock"
        ));
    }
    write("table_y.rs", &source_y);
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

/// Tables, checked, as Rust source, how many they are, and their rate, hertz.
fn constants(paths: &str) -> (String, usize, f64) {
    let paths: Vec<PathBuf> = env::split_paths(paths).collect();
    let texts: Vec<String> = paths.iter().map(|path| read(path)).collect();
    let read = paths.iter().zip(&texts).map(|(path, text)| {
        let table = hysteron_table::Table::parse(text);
        let table = table.unwrap_or_else(|error| refuse(&format!("{}: {error}", path.display())));
        (table, text.as_str())
    });
    let tables: Vec<_> = read.collect();
    let source = hysteron_table::constants_of_banks(&tables).unwrap_or_else(|(place, error)| {
        let path = paths
            .get(place)
            .map_or_else(String::new, |path| path.display().to_string());
        refuse(&format!("{path}: {error}"))
    });
    let rate_hz = tables.first().map_or(f64::NAN, |(table, _)| table.sample_rate_hz);
    (source, tables.len(), rate_hz)
}

fn read(path: &Path) -> String {
    println!("cargo::rerun-if-changed={}", path.display());
    fs::read_to_string(path).unwrap_or_else(|_| {
        refuse(&format!(
            "cannot read the table {}; write one with `hysteron export`",
            path.display()
        ))
    })
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
