//! Linear elements on sampled series: lag, mode; exact for straight lines between samples, started at rest.

use nalgebra::Matrix4;
use std::f64::consts::TAU;

/// A lag or a mode, ready for one sample period: `y = b0 u + b1 u' + b2 u'' - a1 y' - a2 y''`.
pub(crate) struct Linear {
    b: [f64; 3],
    a: [f64; 2],
}

impl Linear {
    /// First-order lag, `1 / (tau s + 1)`.
    pub(crate) fn lag(tau_s: f64, period_s: f64) -> Self {
        let a = (-period_s / tau_s).exp();
        let share = (1.0 - a) * tau_s / period_s;
        Self {
            b: [1.0 - share, share - a, 0.0],
            a: [-a, 0.0],
        }
    }

    /// One mode, `w^2 / (s^2 + 2 zeta w s + w^2)`.
    pub(crate) fn mode(frequency_hz: f64, zeta: f64, period_s: f64) -> Self {
        let angle = TAU * frequency_hz * period_s;
        // The input runs in a straight line (augmented exponential, Van Loan 1978).
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
        // Shares of the last and of this sample of the input in position and rate.
        let (now, rate_now) = (e[(0, 3)], e[(1, 3)]);
        let (last, rate_last) = (e[(0, 2)] - now, e[(1, 2)] - rate_now);
        Self {
            b: [
                now,
                last - e[(1, 1)] * now + e[(0, 1)] * rate_now,
                e[(0, 1)] * rate_last - e[(1, 1)] * last,
            ],
            a: [-e[(0, 0)] - e[(1, 1)], e[(0, 0)] * e[(1, 1)] - e[(0, 1)] * e[(1, 0)]],
        }
    }

    /// Filters series that lie side by side, in place; settled at their first values.
    pub(crate) fn apply<const N: usize>(&self, series: &mut [[f64; N]]) {
        let Some(&first) = series.first() else { return };
        let ([b0, b1, b2], [a1, a2]) = (self.b, self.a);
        let (mut next, mut after) = (first.map(|u| (1.0 - b0) * u), first.map(|u| (b2 - a2) * u));
        for row in series {
            for l in 0..N {
                let u = row[l];
                let y = b0 * u + next[l];
                next[l] = (b1 * u + after[l]) - a1 * y;
                after[l] = b2 * u - a2 * y;
                row[l] = y;
            }
        }
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

    /// Three side by side, of which all have to come out the same.
    fn filtered(filter: &Linear, series: &[f64]) -> Vec<f64> {
        let mut rows: Vec<[f64; 3]> = series.iter().map(|&u| [u; 3]).collect();
        filter.apply(&mut rows);
        assert!(rows.iter().all(|[a, b, c]| a == b && b == c));
        rows.iter().map(|row| row[0]).collect()
    }

    #[test]
    fn val_lag_of_a_sine() {
        let (tau, f, t) = (2e-3, 20.0, 1e-4);
        let y = filtered(&Linear::lag(tau, t), &sine(f, t, 4000));
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
        let y = filtered(&Linear::mode(f0, zeta, t), &sine(f, t, 20_000));
        let (w, w0) = (TAU * f, TAU * f0);
        let (re, im) = (w0 * w0 - w * w, 2.0 * zeta * w0 * w);
        let gain = w0 * w0 / re.hypot(im);
        for (k, y) in y.iter().enumerate().skip(15_000) {
            let wanted = gain * (w * k as f64 * t - im.atan2(re)).sin();
            // (w t)^2 / 8 = 2e-4 of the input
            assert!((y - wanted).abs() < 5e-4);
        }
    }

    /// A mode above half the sampling rate, as slow records let it be fitted: exact on a ramp, behind by 2 zeta / w.
    #[test]
    fn val_mode_between_the_samples() {
        for f0 in [100.0, 742.0, 1231.0, 4000.0] {
            let (zeta, t) = (0.06, 1.0 / 1600.0);
            let y = filtered(
                &Linear::mode(f0, zeta, t),
                &(0..4000).map(f64::from).collect::<Vec<_>>(),
            );
            let behind = 2.0 * zeta / (TAU * f0 * t);
            let found = 3999.0 - y[3999];
            assert!((found - behind).abs() < 1e-9, "{f0}: {found} {behind}");
        }
    }
}
