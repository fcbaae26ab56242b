//! What people play: signals from -1 to 1, one value a sample.

use rand::RngExt;
use rand_pcg::Pcg64;
use std::f64::consts::{PI, TAU};

/// Samples of a function of time.
pub(crate) fn of(seconds: f64, period_s: f64, f: impl Fn(f64) -> f64) -> Vec<f64> {
    let n = (seconds / period_s).round() as usize + 1;
    (0..n).map(|k| f(k as f64 * period_s)).collect()
}

/// A sine from its lowest point, of an amplitude about a middle.
pub(crate) fn sine(hz: f64, middle: f64, amplitude: f64) -> impl Fn(f64) -> f64 {
    move |t| middle - amplitude * (TAU * hz * t).cos()
}

/// A triangle from its lowest point.
pub(crate) fn triangle(hz: f64, middle: f64, amplitude: f64) -> impl Fn(f64) -> f64 {
    move |t| {
        let phase = (hz * t).fract();
        middle + amplitude * (1.0 - 2.0 * (2.0 * phase - 1.0).abs())
    }
}

/// A triangle from the low end whose tops fall from cycle to cycle to a share.
pub(crate) fn decaying(hz: f64, seconds: f64, down_to: f64) -> impl Fn(f64) -> f64 {
    move |t| {
        let top = 2.0 * (1.0 - (1.0 - down_to) * (hz * t).floor() / (hz * seconds).max(1.0));
        let phase = (hz * t).fract();
        -1.0 + top * (1.0 - (2.0 * phase - 1.0).abs())
    }
}

/// Steps to levels, each reached within a time and held.
pub(crate) fn steps(levels: Vec<f64>, hold_s: f64, rise_s: f64) -> impl Fn(f64) -> f64 {
    move |t| {
        let k = ((t / hold_s) as usize).min(levels.len() - 1);
        let from = if k == 0 { levels[0] } else { levels[k - 1] };
        let part = ((t - k as f64 * hold_s) / rise_s).clamp(0.0, 1.0);
        from + part * (levels[k] - from)
    }
}

/// Sines between two frequencies with phases by chance, from a rest at the low end over a rise; the peak is the amplitude.
pub(crate) fn noise(
    from_hz: f64,
    to_hz: f64,
    amplitude: f64,
    rise_s: f64,
    rng: &mut Pcg64,
) -> impl Fn(f64) -> f64 + use<> {
    let lines: Vec<[f64; 2]> = (0..24)
        .map(|_| [rng.random_range(from_hz..to_hz), rng.random_range(0.0..TAU)])
        .collect();
    let raw = move |t: f64| {
        lines
            .iter()
            .map(|[hz, phase]| (TAU * hz * t + phase).sin())
            .sum::<f64>()
    };
    let longest = 40.0 / from_hz;
    let peak = (0..8000)
        .map(|k| raw(longest * f64::from(k) / 8000.0).abs())
        .fold(0.0, f64::max);
    move |t| {
        let fade = 0.5 * (1.0 - (PI * (t / rise_s).min(1.0)).cos());
        let middle = -1.0 + fade;
        middle + fade * (amplitude * raw(t) / peak).clamp(-1.0, 1.0)
    }
}

/// Equal lines of a base frequency about a middle, phases after Schroeder (1970), after a rise from the low end.
pub(crate) fn multisine(base_hz: f64, lines: u32, middle: f64, amplitude: f64, rise_s: f64) -> impl Fn(f64) -> f64 {
    move |t| {
        let sum: f64 = (1..=lines)
            .map(|k| {
                let harmonic = f64::from(2 * k * k - 1);
                (TAU * base_hz * harmonic * t - PI * f64::from(k * k) / f64::from(lines)).cos()
            })
            .sum();
        let fade = 0.5 * (1.0 - (PI * (t / rise_s).min(1.0)).cos());
        -1.0 + fade * (middle + 1.0) + fade * amplitude * sum / (2.0 * f64::from(lines)).sqrt().max(1.0)
    }
}
