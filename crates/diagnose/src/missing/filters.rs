//! Linear elements on sampled series: delay, lag, mode; exact for straight lines between samples, started at rest.

use nalgebra::{Matrix4, Vector2};
use std::f64::consts::TAU;

/// `u(t - delay)` by the cubic through the four nearest samples; before the series its first value.
pub(crate) fn delayed(series: &[f64], delay_samples: f64) -> Vec<f64> {
    let whole = delay_samples.floor();
    let part = delay_samples - whole;
    let back = whole as isize;
    let last = series.len() as isize - 1;
    let at = |k: isize| series[k.clamp(0, last) as usize];
    // Lagrange's cubic at a distance `part` behind sample k - back, between it and its predecessor.
    let s = part;
    let weights = [
        -s * (1.0 - s) * (2.0 - s) / 6.0,
        (1.0 + s) * (1.0 - s) * (2.0 - s) / 2.0,
        (1.0 + s) * s * (2.0 - s) / 2.0,
        -(1.0 + s) * s * (1.0 - s) / 6.0,
    ];
    (0..=last)
        .map(|k| {
            let near = k - back;
            weights[0] * at(near + 1) + weights[1] * at(near) + weights[2] * at(near - 1) + weights[3] * at(near - 2)
        })
        .collect()
}

/// First-order lag `1 / (tau s + 1)`, in place.
pub(crate) fn lag(series: &mut [f64], period_s: f64, tau_s: f64) {
    let Some(&first) = series.first() else { return };
    let a = (-period_s / tau_s).exp();
    let share = (1.0 - a) * tau_s / period_s;
    let (now, before) = (1.0 - share, share - a);
    let (mut output, mut last) = (first, first);
    for value in series {
        output = a * output + now * *value + before * last;
        last = *value;
        *value = output;
    }
}

/// One mode, `w^2 / (s^2 + 2 zeta w s + w^2)`, ready for one sample period.
pub(crate) struct Mode {
    transition: [[f64; 2]; 2],
    of_last: [f64; 2],
    of_now: [f64; 2],
}

impl Mode {
    pub(crate) fn new(frequency_hz: f64, zeta: f64, period_s: f64) -> Self {
        let angle = TAU * frequency_hz * period_s;
        // State: output and its rate per sample; the input runs in a straight line (augmented exponential, Van Loan 1978).
        let system = Matrix4::new(
            0.0,
            1.0,
            0.0,
            0.0, //
            -angle * angle,
            -2.0 * zeta * angle,
            angle * angle,
            0.0, //
            0.0,
            0.0,
            0.0,
            1.0, //
            0.0,
            0.0,
            0.0,
            0.0,
        );
        let e = system.exp();
        let slope = Vector2::new(e[(0, 3)], e[(1, 3)]);
        let level = Vector2::new(e[(0, 2)], e[(1, 2)]);
        Self {
            transition: [[e[(0, 0)], e[(0, 1)]], [e[(1, 0)], e[(1, 1)]]],
            of_last: [level[0] - slope[0], level[1] - slope[1]],
            of_now: [slope[0], slope[1]],
        }
    }

    pub(crate) fn apply(&self, series: &mut [f64]) {
        let Some(&first) = series.first() else { return };
        let (mut x, mut rate, mut last) = (first, 0.0, first);
        let a = &self.transition;
        for value in series {
            let now = *value;
            let next = a[0][0] * x + a[0][1] * rate + self.of_last[0] * last + self.of_now[0] * now;
            rate = a[1][0] * x + a[1][1] * rate + self.of_last[1] * last + self.of_now[1] * now;
            x = next;
            last = now;
            *value = x;
        }
    }
}

/// A rate limit, in place; starts at the first value.
pub(crate) fn slew(series: &mut [f64], largest_step: f64) {
    let Some(&first) = series.first() else { return };
    let mut output = first;
    for value in series {
        output += (*value - output).clamp(-largest_step, largest_step);
        *value = output;
    }
}

/// Centred running mean over `2 half + 1` samples, fewer at the ends.
pub(crate) fn running_mean(series: &[f64], half: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(series.len() + 1);
    sums.push(0.0);
    let mut sum = 0.0;
    for value in series {
        sum += value;
        sums.push(sum);
    }
    (0..series.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(half), (k + half + 1).min(series.len()));
            (sums[to] - sums[from]) / (to - from) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(frequency_hz: f64, period_s: f64, n: usize) -> Vec<f64> {
        (0..n)
            .map(|k| (TAU * frequency_hz * period_s * k as f64).sin())
            .collect()
    }

    #[test]
    fn val_delay_of_a_sine() {
        // 40 samples a period: the cubic errs by less than (2 pi / 40)^4 / 24 = 3e-5.
        let u = sine(25.0, 1e-3, 400);
        let y = delayed(&u, 3.3);
        for (k, y) in y.iter().enumerate().skip(10) {
            let wanted = (TAU * 25.0 * (k as f64 - 3.3) * 1e-3).sin();
            assert!((y - wanted).abs() < 3e-5, "{k}: {} {wanted}", y);
        }
    }

    #[test]
    fn val_lag_of_a_sine() {
        let (tau, f, t) = (2e-3, 20.0, 1e-4);
        let mut y = sine(f, t, 4000);
        lag(&mut y, t, tau);
        let w = TAU * f;
        for (k, y) in y.iter().enumerate().skip(2000) {
            let wanted = (w * k as f64 * t - (w * tau).atan()).sin() / (1.0 + (w * tau).powi(2)).sqrt();
            // straight lines between 500 samples a period: (w t)^2 / 8 = 2e-5
            assert!((y - wanted).abs() < 3e-5);
        }
    }

    #[test]
    fn val_mode_of_a_sine() {
        let (f0, zeta, f, t) = (100.0, 0.05, 60.0, 1e-4);
        let mut y = sine(f, t, 20_000);
        Mode::new(f0, zeta, t).apply(&mut y);
        let (w, w0) = (TAU * f, TAU * f0);
        let (re, im) = (w0 * w0 - w * w, 2.0 * zeta * w0 * w);
        let gain = w0 * w0 / re.hypot(im);
        for (k, y) in y.iter().enumerate().skip(15_000) {
            let wanted = gain * (w * k as f64 * t - im.atan2(re)).sin();
            // (w t)^2 / 8 = 2e-4 of the input
            assert!((y - wanted).abs() < 5e-4);
        }
    }
}
