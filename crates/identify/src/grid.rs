//! A grid finer than the samples, where a periodic drive is known between them.

use crate::family::range;
use realfft::RealFftPlanner;

/// The command on the grid, with a period of run-in before it; `every` samples of the grid a recorded one.
pub fn drive(voltage_v: &[f64], period: usize, every: usize) -> Vec<f64> {
    if every == 1 {
        return voltage_v[..period].iter().chain(voltage_v).copied().collect();
    }
    let fine = refined(&voltage_v[..period], every);
    let n = period * every + (voltage_v.len() - 1) * every + 1;
    (0..n).map(|k| fine[k % fine.len()]).collect()
}

/// A slow series on the grid: straight lines between its samples, the first `period` of them as run-in before it.
pub fn slow(values: &[f64], period: usize, every: usize) -> Vec<f64> {
    let n = (values.len() - 1) * every + 1;
    let body = (0..n).map(|k| between(values, k, every));
    (0..period * every)
        .map(|k| between(values, k, every))
        .chain(body)
        .collect()
}

/// Straight lines between recorded samples.
fn between(values: &[f64], k: usize, every: usize) -> f64 {
    let (i, share) = (k / every, (k % every) as f64 / every as f64);
    let next = values[(i + 1).min(values.len() - 1)];
    values[i] + share * (next - values[i])
}

/// Straight lines between samples cost `(w T)^2 / 12`: beyond this share (mean over the drive's power) the grid is refined.
const STRAIGHT_LINES: f64 = 2e-3;

/// A drive whose upper half band holds less than this share of its power is what its samples say in between, too: a step
/// has 1e-4 there, four written digits 1e-8.
const BAND_LIMITED: f64 = 1e-6;

/// Finest grid, samples a recorded one.
const FINEST: usize = 16;

/// How many grid samples a recorded one a periodic drive needs: 1 unless it is band-limited and close to what its sample
/// rate can hold.
///
/// # Cost
/// A Fourier transform of the period.
pub fn refinement(period: &[f64]) -> usize {
    let (low, high) = range(period.iter().copied());
    let n = period.len();
    if n < 8 || high <= low {
        return 1;
    }
    let mut spectrum = spectrum(period);
    spectrum[0] = 0.0;
    let total: f64 = spectrum.iter().sum();
    let upper: f64 = spectrum[n / 4 + 1..].iter().sum();
    if upper > BAND_LIMITED * total {
        return 1;
    }
    let bent: f64 = spectrum
        .iter()
        .enumerate()
        .map(|(k, power)| power * (std::f64::consts::TAU * k as f64 / n as f64).powi(2))
        .sum();
    let cost = bent / total / 12.0;
    if cost < STRAIGHT_LINES {
        1
    } else {
        ((cost / STRAIGHT_LINES).sqrt().ceil() as usize).clamp(2, FINEST)
    }
}

/// Power of each line of one period.
fn spectrum(period: &[f64]) -> Vec<f64> {
    let forward = RealFftPlanner::<f64>::new().plan_fft_forward(period.len());
    let mut lines = forward.make_output_vec();
    let mut time = period.to_vec();
    match forward.process(&mut time, &mut lines) {
        Ok(()) => lines.iter().map(|line| line.norm_sqr()).collect(),
        Err(_) => vec![0.0; lines.len()],
    }
}

/// One period on a grid `every` times finer, band-limited.
fn refined(period: &[f64], every: usize) -> Vec<f64> {
    let n = period.len();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(n), planner.plan_fft_inverse(n * every));
    let (mut lines, mut fine_lines) = (forward.make_output_vec(), inverse.make_input_vec());
    let (mut time, mut fine) = (period.to_vec(), inverse.make_output_vec());
    let transformed = forward.process(&mut time, &mut lines).is_ok() && {
        for (fine, line) in fine_lines.iter_mut().zip(&lines) {
            *fine = *line / n as f64;
        }
        inverse.process(&mut fine_lines, &mut fine).is_ok()
    };
    if !transformed {
        return (0..n * every).map(|k| between(period, k, every)).collect();
    }
    // The samples themselves stay bit for bit.
    for (k, &value) in period.iter().enumerate() {
        fine[k * every] = value;
    }
    fine
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn val_a_band_limited_drive_is_refined_to_what_it_is_in_between() {
        // Four samples a period of the fastest line, as a recording at 1600 Hz of 400 Hz.
        let at = |x: f64| (TAU * 24.0 * x / 100.0 + 0.3).sin() + (TAU * 3.0 * x / 100.0).cos();
        let period: Vec<f64> = (0..100).map(|k| at(f64::from(k))).collect();
        let every = refinement(&period);
        assert!(every >= 4, "{every}");
        for (k, value) in refined(&period, every).iter().enumerate() {
            let wanted = at(k as f64 / every as f64);
            assert!((value - wanted).abs() < 1e-12, "{k}: {value} {wanted}");
        }
    }

    #[test]
    fn val_steps_triangles_and_slow_sines_are_left_alone() {
        let step: Vec<f64> = (0..100).map(|k| if k < 50 { 0.0 } else { 1.0 }).collect();
        let triangle: Vec<f64> = (0..100).map(|k: i32| f64::from((k - 50).abs())).collect();
        let sine: Vec<f64> = (0..100).map(|k| (TAU * f64::from(k) / 100.0).sin()).collect();
        for drive in [step, triangle, sine, vec![1.0; 100]] {
            assert_eq!(refinement(&drive), 1);
        }
    }
}
