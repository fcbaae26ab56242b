//! How the presets were made to show the paper's loop openings.

use crate::config::StageConfig;
use crate::error::{StageError, within};
use crate::opening::loop_opening;
use crate::stage::Stage;
use hysteron_excitation::{Excitation, Sine};

/// The paper's loop openings, section 4.2: fractions at 10, 100 and 500 Hz with a sine of 26 V peak to peak.
pub const PAPER_OPENINGS: [(f64, f64); 3] = [(10.0, 0.1644), (100.0, 0.2256), (500.0, 0.4551)];

/// Measures a stage's loop openings at the paper's three frequencies: a sine from `low_v` to `high_v`, sampled by the controller, last period taken.
///
/// At least 3 periods and 60 ms before, so that ringing and the first loop are over.
///
/// # Errors
/// As [`Stage::new`] and [`loop_opening`].
pub fn measured_openings(config: &StageConfig, low_v: f64, high_v: f64, seed: u64) -> Result<[f64; 3], StageError> {
    let mut openings = [0.0; 3];
    for (opening, (frequency_hz, _)) in openings.iter_mut().zip(PAPER_OPENINGS) {
        let mut stage = Stage::new(config, seed)?;
        if low_v != 0.0 {
            stage.move_and_rest(low_v, 0.05, 0.05)?;
        }
        let periods = f64::ceil(3.0_f64.max(0.06 * frequency_hz)) + 1.0;
        let command_v = Sine {
            frequency_hz,
            low_v,
            high_v,
            periods,
        }
        .samples(config.sample_period_s)?;
        let run = stage.run(&command_v, config.sample_period_s)?;
        let last = command_v.len() - (1.0 / (frequency_hz * config.sample_period_s)).round() as usize;
        // One sample more closes the loop, so that both crossings are inside.
        let from = last.saturating_sub(1);
        *opening = loop_opening(&command_v[from..], &run.position_um[from..])?;
    }
    Ok(openings)
}

/// Finds the three parameters with which a stage shows the paper's openings, by Newton's method on differences.
///
/// `build` makes the stage from the parameters; its sensor noise and rounding are switched off here, because the openings asked for are those of the
/// noise-free loop. Every parameter is varied relative to its start.
///
/// # Errors
/// As [`measured_openings`]; also if 20 iterations do not bring all three within 0.001 points.
pub fn calibrate(build: impl Fn([f64; 3]) -> StageConfig, start: [f64; 3]) -> Result<[f64; 3], StageError> {
    let miss = |parameters: [f64; 3]| -> Result<[f64; 3], StageError> {
        let mut config = build(parameters);
        config.sensor.noise_rms_um = 0.0;
        config.sensor.adc = None;
        config.dac = None;
        let found = measured_openings(&config, 0.0, 26.0, 0)?;
        Ok(std::array::from_fn(|i| found[i] - PAPER_OPENINGS[i].1))
    };
    let mut parameters = start;
    let mut error = miss(parameters)?;
    for _ in 0..20 {
        let mut columns = [[0.0; 3]; 3];
        for (j, column) in columns.iter_mut().enumerate() {
            let mut varied = parameters;
            let change = 1e-3 * start[j].abs();
            varied[j] += change;
            let other = miss(varied)?;
            *column = std::array::from_fn(|i| (other[i] - error[i]) / change);
        }
        let correction = solve(columns, error);
        // Never more than half of the start at once: the openings bend.
        for (j, parameter) in parameters.iter_mut().enumerate() {
            let most = 0.5 * start[j].abs();
            *parameter -= correction[j].clamp(-most, most);
        }
        error = miss(parameters)?;
        if error.iter().all(|e| e.abs() < 1e-5) {
            return Ok(parameters);
        }
    }
    let worst = error.iter().fold(0.0_f64, |worst, e| worst.max(e.abs()));
    within(
        "calibration: largest miss of the loop opening",
        worst,
        0.0,
        1e-5,
        "start nearer, or give other parameters",
    )?;
    Ok(parameters)
}

/// Finds the one parameter with which a stage shows the paper's opening at 10 Hz, by the secant method.
///
/// For stages whose loops at higher frequencies follow from parameters that are given (lag, latency, modes).
///
/// # Errors
/// As [`measured_openings`]; also if 20 steps do not bring it within 0.001 points.
pub fn calibrate_one(build: impl Fn(f64) -> StageConfig, start: f64) -> Result<f64, StageError> {
    let miss = |parameter: f64| -> Result<f64, StageError> {
        let mut config = build(parameter);
        config.sensor.noise_rms_um = 0.0;
        config.sensor.adc = None;
        config.dac = None;
        Ok(measured_openings(&config, 0.0, 26.0, 0)?[0] - PAPER_OPENINGS[0].1)
    };
    let (mut before, mut now) = (0.95 * start, start);
    let (mut error_before, mut error) = (miss(before)?, miss(now)?);
    for _ in 0..20 {
        if error.abs() < 1e-5 {
            return Ok(now);
        }
        let next = now - error * (now - before) / (error - error_before);
        (before, error_before) = (now, error);
        now = next;
        error = miss(now)?;
    }
    within(
        "calibration: miss of the loop opening at 10 Hz",
        error.abs(),
        0.0,
        1e-5,
        "start nearer, or give other parameters",
    )?;
    Ok(now)
}

/// Cramer's rule for three unknowns, the matrix given by columns.
fn solve(columns: [[f64; 3]; 3], right: [f64; 3]) -> [f64; 3] {
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let [a, b, c] = columns;
    let determinant = dot(a, cross(b, c));
    [
        dot(right, cross(b, c)),
        dot(right, cross(c, a)),
        dot(right, cross(a, b)),
    ]
    .map(|numerator| numerator / determinant)
}
