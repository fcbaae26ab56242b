//! Ringing after a step of the drive: a decaying sine needs no hysteresis model to be seen.

use crate::diagnosis::{Before, Level, RankedEffect, parameter};
use crate::witness::traces::Traces;
use hysteron_identify::EffectId;
use hysteron_identify::family::peak_to_peak;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// A step is at least this share of the span in one sample.
const STEP: f64 = 0.05;

/// Samples after a step that are looked at.
const WINDOW: usize = 300;

/// The ring must be this many times the noise.
const TIMES_NOISE: f64 = 5.0;

/// The decaying sine must take this share of what else is in the window.
const LEAST_SHARE: f64 = 0.5;

/// Largest damping ratio of what is seen as ringing: beyond it, less than a sixth is left after four cycles, and
/// relaxation of the hysteresis after the step passes for it.
const MOST_RINGING: f64 = 0.07;

struct Ring {
    frequency_hz: f64,
    zeta: f64,
    amplitude_um: f64,
    share: f64,
    samples: usize,
}

/// What rings before a step as well, by this share of what rings after it, is a vibration.
const BEFORE: f64 = 0.3;

/// Where more than this of a ring should be left when the drive moves on, nobody can tell whether it dies.
const CANNOT_TELL: f64 = 0.8;

/// Fewest samples before a step that tell; else the ring must have died down by half within the window.
const FEWEST_BEFORE: usize = 40;

impl Ring {
    fn is_of_the_step(&self, before: &[f64], period_s: f64, window: usize) -> bool {
        if before.len() < FEWEST_BEFORE {
            return (-self.zeta * TAU * self.frequency_hz * window as f64 * period_s).exp() < 0.5;
        }
        self.amplitude_in(before, period_s) < BEFORE * self.amplitude_um
    }

    /// Whether it dies down as its damping says, `own` being the residual from the step on while the drive stands: where the gain is
    /// modulated it rings on.
    fn dies(&self, own: &[f64], period_s: f64) -> bool {
        let a_sample = self.zeta * TAU * self.frequency_hz * period_s;
        let down_to_a_tenth = (10f64.ln() / a_sample).ceil() as usize;
        let from = down_to_a_tenth.min(own.len().saturating_sub(WINDOW));
        let later = &own[from..(from + WINDOW).min(own.len())];
        let left = (-a_sample * from as f64).exp();
        left > CANNOT_TELL || self.amplitude_in(later, period_s) < 0.5 * (1.0 + left) * self.amplitude_um
    }

    fn amplitude_in(&self, own: &[f64], period_s: f64) -> f64 {
        squared_error(
            &DVector::from_column_slice(own),
            period_s,
            Some((self.frequency_hz, 0.0)),
        )
        .1
    }
}

/// The clearest ring after any step, as an entry of the ranking.
///
/// `residuals` are at the full rate, run-in included; `left` holds the errors that remain.
pub(crate) fn find(traces: &Traces, residuals: &[Vec<f64>], noise_um: f64, left: &Before) -> Option<RankedEffect> {
    let left_um = left.pooled().unwrap_or(0.0) / 100.0 * traces.stroke_um;
    let mut best: Option<Ring> = None;
    for (trace, residual) in traces.each.iter().zip(residuals) {
        let steps = (trace.from + 1..trace.len()).filter(|&k| (trace.drive[k] - trace.drive[k - 1]).abs() > 2.0 * STEP);
        for k in steps.take(8) {
            // The first samples after a step are the stage's delay and the sensor's: the ring is in what follows.
            let after = (k + 2).min(residual.len())..(k + WINDOW).min(residual.len());
            let window = &residual[after.clone()];
            // A drive that moves on by more than the step leaves errors of its own.
            let step = (trace.drive[k] - trace.drive[k - 1]).abs();
            if window.len() < 40 || peak_to_peak(&trace.drive[after]) > step {
                continue;
            }
            let held = &trace.drive[k + 2..];
            let standing = held.iter().take_while(|v| (*v - held[0]).abs() <= step).count();
            if let Some(ring) = fit(window, trace.period_s, noise_um)
                && ring.dies(&residual[k + 2..][..standing], trace.period_s)
                && ring.is_of_the_step(
                    &residual[k.saturating_sub(WINDOW).max(trace.from)..k],
                    trace.period_s,
                    window.len(),
                )
                && best.as_ref().is_none_or(|b| ring.share > b.share)
            {
                best = Some(ring);
            }
        }
    }
    // Beside an error as large as itself it may be that error's own beginning.
    let ring = best.filter(|ring| ring.amplitude_um > left_um)?;
    Some(RankedEffect {
        effect: EffectId::Resonance.into(),
        errors: *left,
        statistic: ring.amplitude_um / noise_um,
        threshold: TIMES_NOISE,
        log_likelihood_gain: -0.5 * ring.samples as f64 * (1.0 - ring.share).ln(),
        effective_samples: ring.samples as f64,
        share: ring.share,
        significant: true,
        level: Level::Physical,
        on_bound: false,
        parameters: vec![
            parameter("frequency", ring.frequency_hz, "Hz"),
            parameter("damping_ratio", ring.zeta, ""),
            parameter("amplitude_after_step", ring.amplitude_um, "um"),
        ],
    })
}

/// Least squares of a decaying sine on a line, over frequency and damping.
fn fit(window: &[f64], period_s: f64, noise_um: f64) -> Option<Ring> {
    let n = window.len();
    let y = DVector::from_column_slice(window);
    let line = squared_error(&y, period_s, None).0;
    // Three periods in the window, four and a half samples a period.
    let (low, high) = (3.0 / (n as f64 * period_s), 1.0 / (4.5 * period_s));
    if high <= low {
        return None;
    }
    let mut best = (f64::INFINITY, 0.0, 0.0);
    let scan = |best: &mut (f64, f64, f64), f: f64, zeta: f64| {
        let error = squared_error(&y, period_s, Some((f, zeta))).0;
        if error < best.0 {
            *best = (error, f, zeta);
        }
    };
    let steps = 80;
    for i in 0..=steps {
        for zeta in [0.01, 0.03, 0.08] {
            scan(
                &mut best,
                low * (high / low).powf(f64::from(i) / f64::from(steps)),
                zeta,
            );
        }
    }
    let (centre, width) = (best.1, (high / low).powf(1.0 / f64::from(steps)).ln());
    for i in -8..=8 {
        for zeta in [0.005, 0.01, 0.02, 0.03, 0.045, 0.065, 0.09] {
            scan(&mut best, centre * (width * f64::from(i) / 8.0).exp(), zeta);
        }
    }
    let (error, frequency_hz, zeta) = best;
    let amplitude_um = squared_error(&y, period_s, Some((frequency_hz, zeta))).1;
    let noise = noise_um.powi(2) * n as f64;
    let share = (line - error) / (line - noise).max(line * 0.1);
    let cycles = n as f64 * period_s * frequency_hz;
    (share > LEAST_SHARE && amplitude_um > TIMES_NOISE * noise_um && zeta <= MOST_RINGING && cycles > 4.0).then_some(
        Ring {
            frequency_hz,
            zeta,
            amplitude_um,
            share: share.min(1.0),
            samples: n,
        },
    )
}

/// Squared error about a line, with a decaying sine where one is given, and the sine's amplitude at the start.
fn squared_error(y: &DVector<f64>, period_s: f64, ring: Option<(f64, f64)>) -> (f64, f64) {
    let n = y.len();
    let columns = DMatrix::from_fn(n, if ring.is_some() { 4 } else { 2 }, |k, c| {
        let t = k as f64 * period_s;
        let decay = ring.map_or(0.0, |(f, zeta)| (-zeta * TAU * f * t).exp());
        let angle = ring.map_or(0.0, |(f, _)| TAU * f * t);
        match c {
            0 => 1.0,
            1 => k as f64 / n as f64 - 0.5,
            2 => decay * angle.cos(),
            _ => decay * angle.sin(),
        }
    });
    let gram = columns.tr_mul(&columns) + DMatrix::identity(columns.ncols(), columns.ncols()) * 1e-12;
    let Some(factor) = gram.cholesky() else {
        return (y.norm_squared(), 0.0);
    };
    let x = factor.solve(&columns.tr_mul(y));
    let amplitude = if ring.is_some() { x[2].hypot(x[3]) } else { 0.0 };
    ((y - &columns * x).norm_squared(), amplitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 5e-5;

    /// A sine of 0.1 um at 500 Hz that dies down with its damping, and noise of 1 nm.
    fn ring(zeta: f64) -> Vec<f64> {
        (0..4000)
            .map(|k| {
                let angle = TAU * 500.0 * f64::from(k) * PERIOD_S;
                let noise = f64::from(k * 7919 % 1000) * 2e-6 - 1e-3;
                0.1 * (-zeta * angle).exp() * angle.sin() + noise
            })
            .collect()
    }

    #[test]
    fn val_a_ring_dies_down_and_a_modulation_does_not() {
        for (zeta, dies) in [(0.005, true), (0.02, true), (0.06, true), (0.0, false)] {
            let own = ring(zeta);
            let found = fit(&own[..WINDOW], PERIOD_S, 1e-3).unwrap();
            assert_eq!(
                found.dies(&own, PERIOD_S),
                dies,
                "damping {zeta}, fitted {}",
                found.zeta
            );
        }
    }

    /// The drive moves on before a ring of light damping could have died: that proves nothing against it.
    #[test]
    fn bva_a_short_rest_proves_nothing() {
        let own = ring(0.0);
        let found = fit(&own[..WINDOW], PERIOD_S, 1e-3).unwrap();
        assert!(found.dies(&own[..WINDOW], PERIOD_S), "fitted {}", found.zeta);
    }
}
