//! A bench of a user's own, played by a simulated stage: commands in, recordings out.

use hysteron_plant::{Stage, preset};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What the bench's sensor reads at rest, micrometres.
pub(crate) const ZERO_UM: f64 = -3.0;

/// A command's sample period, seconds, and voltages.
fn command(file: &Path) -> (f64, Vec<f64>) {
    let text = std::fs::read_to_string(file).unwrap();
    let rows = text.lines().skip(1).map(|row| row.split_once(',').unwrap());
    let (times, volts): (Vec<f64>, Vec<f64>) = rows
        .map(|(t, v)| (t.parse::<f64>().unwrap(), v.parse::<f64>().unwrap()))
        .unzip();
    (times[1] - times[0], volts)
}

/// The recording of a command on a stage that was cycled, has been through `volts` just before and rested for `before` samples.
pub(crate) fn played(seed: u64, volts: &[f64], file: &Path, before: usize) -> String {
    let (period_s, mut voltage_v) = command(file);
    voltage_v.splice(0..0, vec![0.0; before]);
    let mut stage = Stage::new(&preset::tracking_8k(), seed).unwrap();
    if !volts.is_empty() {
        stage.run(volts, period_s).unwrap();
    }
    let run = stage.run(&voltage_v, period_s).unwrap();
    let mut text = String::from("time_s,voltage_v,position_um\n");
    for (k, (v, y)) in voltage_v.iter().zip(&run.position_um).enumerate() {
        writeln!(text, "{:.7},{v:.6},{:.5}", k as f64 * period_s, y + ZERO_UM).unwrap();
    }
    text
}

/// 2 s at 140 V and 20 ms of rest after them, at 50 kHz: too short a rest.
pub(crate) fn short_rest() -> Vec<f64> {
    let mut volts = vec![140.0; 100_000];
    volts.extend(vec![0.0; 1000]);
    volts
}

/// The commands of a pass, without the one of all of them.
pub(crate) fn commands(folder: &Path) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = files
        .filter(|file| file.extension().is_some_and(|end| end == "csv") && !file.ends_with("all.csv"))
        .collect();
    files.sort();
    files
}
