//! Mains hum: lines at 50 or 60 Hz and harmonics, whose phase belongs to no record.

use crate::witness::traces::Traces;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Hum found in the residuals.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Hum {
    pub frequency_hz: f64,
    /// Amplitude of the fundamental, median over records, micrometres.
    pub amplitude_um: f64,
    /// Power at the lines over the power beside them, in the record that shows it best.
    pub contrast: f64,
    /// Records that show it, of those that could.
    pub seen_in: usize,
    pub of: usize,
    /// Mean squared error that it takes from each record.
    pub taken_um2: Vec<f64>,
    /// What records too short to tell may hold of it: a stretch of a line may have twice its mean power.
    pub untold_um2: Vec<f64>,
}

const HARMONICS: usize = 5;

/// Share of the lines' power that the first two hold: the mains' own and a rectifier's. A fan may turn at a higher one alone.
const LOWEST_TWO: f64 = 0.25;

/// Mains deviates by at most 0.5 Hz in large grids.
const BAND_HZ: f64 = 0.5;

/// Records sampled more slowly have fewer than four samples a period of the mains.
const LONGEST_PERIOD_S: f64 = 1.0 / 240.0;

/// Three periods of the mains.
const SHORTEST_S: f64 = 3.0 / 50.0;

/// Looks for lines in the residuals (full rate, run-in included, one a record).
pub(crate) fn find(traces: &Traces, residuals: &[Vec<f64>], noise_um: f64) -> Option<Hum> {
    let usable: Vec<usize> = (0..traces.each.len())
        .filter(|&i| {
            let t = &traces.each[i];
            t.period_s < LONGEST_PERIOD_S && (t.len() - t.from) as f64 * t.period_s > SHORTEST_S
        })
        .collect();
    let lines = |i: usize, f: f64| {
        let t = &traces.each[i];
        Lines::fit(&residuals[i][t.from..], t.period_s, f)
    };
    let power = |f: f64| -> f64 {
        let of_record = |&i: &usize| {
            let lines = lines(i, f);
            // Relative to the residual: a badly fitted record must not decide.
            lines.of_the_mains() / (lines.all_um2 + noise_um * noise_um)
        };
        usable.iter().map(of_record).sum()
    };
    let frequencies: Vec<f64> = candidates().collect();
    let powers: Vec<f64> = frequencies.par_iter().map(|&f| power(f)).collect();
    let best = (0..powers.len())
        .rev()
        .max_by(|&a, &b| powers[a].total_cmp(&powers[b]))?;
    let frequency_hz = frequencies[best];
    let mut taken_um2 = vec![0.0; traces.each.len()];
    let (mut contrast, mut seen, mut amplitudes) = (0.0f64, 0, Vec::new());
    for &i in &usable {
        let t = &traces.each[i];
        let taken = lines(i, frequency_hz).of_the_mains();
        let length_s = (t.len() - t.from) as f64 * t.period_s;
        let aside =
            |shift_hz: f64| Lines::fit_aside(&residuals[i][t.from..], t.period_s, frequency_hz, shift_hz).taken();
        let beside = beside(aside, frequency_hz, length_s);
        let ratio = taken / beside.max(1e-3 * noise_um * noise_um);
        if ratio > CONTRAST {
            seen += 1;
            taken_um2[i] = taken;
            amplitudes.push((2.0 * taken).sqrt());
        }
        contrast = contrast.max(ratio);
    }
    amplitudes.sort_by(f64::total_cmp);
    let median_um2 = amplitudes.get(amplitudes.len() / 2).map_or(0.0, |a| a * a / 2.0);
    let untold = |&taken: &f64| if taken > 0.0 { 0.0 } else { 2.0 * median_um2 };
    Some(Hum {
        untold_um2: taken_um2.iter().map(untold).collect(),
        frequency_hz,
        amplitude_um: amplitudes.get(amplitudes.len() / 2).copied().unwrap_or(0.0),
        contrast,
        seen_in: seen,
        of: usable.len(),
        taken_um2,
    })
}

/// Power at the lines over the larger power beside them, from which on a record shows hum.
const CONTRAST: f64 = 6.0;

/// Both nets, their band in twenty steps.
fn candidates() -> impl Iterator<Item = f64> {
    let nearby = |nominal: f64| (-10..=10).map(move |k| nominal + BAND_HZ * f64::from(k) / 10.0);
    [50.0, 60.0].into_iter().flat_map(nearby)
}

/// The largest power of the lines moved aside by two resolutions of the record and twice that, on both sides: what is there without hum.
/// Half way between the lines is as far as they go: a short record's resolution reaches from one line to the next.
fn beside(aside: impl Fn(f64) -> f64, frequency_hz: f64, length_s: f64) -> f64 {
    let shift_hz = |times: f64| (times * (2.0 / length_s).max(2.0)).min(0.5 * frequency_hz);
    [-shift_hz(2.0), -shift_hz(1.0), shift_hz(1.0), shift_hz(2.0)]
        .into_iter()
        .map(aside)
        .fold(0.0, f64::max)
}

/// Lines at a frequency and its harmonics, fitted to a series beside a straight line.
struct Lines {
    /// Angle of the fundamental a sample.
    omega: f64,
    /// Angle a sample by which all lines are moved aside.
    shift: f64,
    /// Cosine and sine of each harmonic.
    amplitudes: Vec<f64>,
    rows: usize,
    stride: usize,
    /// Mean square of the series about its mean.
    all_um2: f64,
}

impl Lines {
    fn fit(own: &[f64], period_s: f64, f: f64) -> Self {
        Self::fit_aside(own, period_s, f, 0.0)
    }

    /// As [`Self::fit`], every line moved by the same frequency.
    fn fit_aside(own: &[f64], period_s: f64, f: f64, shift_hz: f64) -> Self {
        // No more than 4000 rows, but at least 12 samples a period of the fundamental.
        let stride = (own.len() / 4000).clamp(1, ((1.0 / (12.0 * 60.0)) / period_s).max(1.0) as usize);
        let rows: Vec<usize> = (0..own.len()).step_by(stride).collect();
        let y = DVector::from_iterator(rows.len(), rows.iter().map(|&k| own[k]));
        let mean = y.mean();
        let mut lines = Self {
            omega: std::f64::consts::TAU * f * period_s,
            shift: std::f64::consts::TAU * shift_hz * period_s,
            amplitudes: Vec::new(),
            rows: rows.len(),
            stride,
            all_um2: y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / rows.len() as f64,
        };
        // Above half the sampling rate they come back folded, at frequencies as well known.
        if rows.len() < 4 * HARMONICS + 4 {
            return lines;
        }
        let mut columns = DMatrix::zeros(rows.len(), 2 * HARMONICS + 2);
        for (r, &k) in rows.iter().enumerate() {
            let line = [1.0, k as f64 / own.len() as f64 - 0.5];
            let row = line.into_iter().chain(lines.waves(k as f64));
            columns
                .row_mut(r)
                .iter_mut()
                .zip(row)
                .for_each(|(cell, value)| *cell = value);
        }
        // Folded harmonics may lie on one another (50 Hz in 100 samples a second), or on the straight line.
        let ridge = DMatrix::identity(columns.ncols(), columns.ncols()) * (1e-6 * rows.len() as f64);
        let gram = columns.transpose() * &columns + ridge;
        if let Some(factor) = gram.cholesky() {
            lines.amplitudes = factor.solve(&columns.tr_mul(&y)).iter().skip(2).copied().collect();
        }
        lines
    }

    /// Cosine and sine of each harmonic at a sample, each from the one before it.
    fn waves(&self, k: f64) -> impl Iterator<Item = f64> {
        let (sin, cos) = (self.omega * k).sin_cos();
        let (first_sin, first_cos) = ((self.omega + self.shift) * k).sin_cos();
        std::iter::successors(Some((first_cos, first_sin)), move |&(c, s)| {
            Some((c * cos - s * sin, s * cos + c * sin))
        })
        .take(HARMONICS)
        .flat_map(|(c, s)| [c, s])
    }

    /// The lines at a sample.
    fn at(&self, k: f64) -> f64 {
        self.amplitudes
            .iter()
            .zip(self.waves(k))
            .map(|(a, wave)| a * wave)
            .sum()
    }

    /// Mean square that the lines take, nothing where they are not the mains'.
    fn of_the_mains(&self) -> f64 {
        let power = |lines: &[f64]| lines.iter().map(|a| a * a).sum::<f64>();
        let lowest = self.amplitudes.get(..4).map_or(0.0, power);
        if lowest > LOWEST_TWO * power(&self.amplitudes) {
            self.taken()
        } else {
            0.0
        }
    }

    /// Mean square that the lines take.
    fn taken(&self) -> f64 {
        let at = |r: usize| self.at((r * self.stride) as f64).powi(2);
        (0..self.rows).map(at).sum::<f64>() / self.rows.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Takes lines at a frequency and its harmonics out of a series that has them.
    fn take_out(own: &mut [f64], period_s: f64, frequency_hz: f64) {
        let length_s = own.len() as f64 * period_s;
        if length_s <= SHORTEST_S {
            return;
        }
        let lines = Lines::fit(own, period_s, frequency_hz);
        let aside = |shift_hz: f64| Lines::fit_aside(own, period_s, frequency_hz, shift_hz).taken();
        if lines.of_the_mains() > CONTRAST * beside(aside, frequency_hz, length_s) {
            own.iter_mut().enumerate().for_each(|(k, y)| *y -= lines.at(k as f64));
        }
    }

    /// A series without the lines of the mains, or as it is where it has none or cannot tell.
    fn taken_out(own: &[f64], period_s: f64) -> Vec<f64> {
        let power = |f: f64| Lines::fit(own, period_s, f).of_the_mains();
        let powers = candidates().map(|f| (power(f), f));
        let mut humless = own.to_vec();
        if let Some((_, frequency_hz)) = powers.max_by(|a, b| a.0.total_cmp(&b.0)) {
            take_out(&mut humless, period_s, frequency_hz);
        }
        humless
    }

    #[test]
    fn val_a_hum_is_taken_out_and_noise_stays() {
        let noise = |k: usize| ((k * 7919) % 1000) as f64 * 1e-6;
        let hum = |k: usize| {
            let t = k as f64 * 2e-4;
            0.2 * (TAU * 60.08 * t + 0.4).sin() + 0.05 * (TAU * 180.24 * t).cos()
        };
        let own: Vec<f64> = (0..2500).map(|k| noise(k) + hum(k)).collect();
        let left = taken_out(&own, 2e-4);
        let mean = left.iter().sum::<f64>() / 2500.0;
        let rms = (left.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / 2500.0).sqrt();
        assert!(rms < 0.004, "{rms}");
        let quiet: Vec<f64> = (0..2500).map(noise).collect();
        assert_eq!(taken_out(&quiet, 2e-4), quiet);
    }

    /// Five periods of the mains tell its lines from those half way between them; noise shows none.
    #[test]
    fn val_a_hum_of_a_tenth_of_a_second_is_taken_out() {
        let noise = |k: usize| ((k * 7919) % 1000) as f64 * 1e-5;
        let hum = |k: usize| {
            let t = k as f64 * 1e-4;
            0.2 * (TAU * 50.02 * t + 0.4).sin() + 0.05 * (TAU * 100.04 * t).cos()
        };
        let spread = |own: &[f64]| {
            let mean = own.iter().sum::<f64>() / own.len() as f64;
            (own.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / own.len() as f64).sqrt()
        };
        let own: Vec<f64> = (0..1000).map(|k| noise(k) + hum(k)).collect();
        assert!(spread(&taken_out(&own, 1e-4)) < 0.004);
        let quiet: Vec<f64> = (0..1000).map(noise).collect();
        assert_eq!(taken_out(&quiet, 1e-4), quiet);
    }

    /// 12 020 turns a minute are four times 50.08 Hz.
    #[test]
    fn val_a_vibration_at_a_harmonic_alone_is_no_hum() {
        let fan = |k: usize| 0.2 * (TAU * 200.33 * k as f64 * 2e-4).sin() + ((k * 7919) % 1000) as f64 * 1e-6;
        let own: Vec<f64> = (0..2500).map(fan).collect();
        assert_eq!(taken_out(&own, 2e-4), own);
    }

    /// 50.028 Hz in 100 samples a second: odd harmonics come back a sample apart in sign, even ones as slow as a drift.
    #[test]
    fn val_harmonics_that_fold_onto_one_another_are_taken_out() {
        let hum = |k: usize| {
            let turn = TAU * 50.028 * k as f64 * 1e-2;
            0.09 * (turn + 0.7).sin() + 0.02 * (3.0 * turn).cos() + 0.01 * (2.0 * turn).sin()
        };
        let own: Vec<f64> = (0..4800).map(hum).collect();
        for (part, at) in own.chunks(100).zip((0..).step_by(100)) {
            let lines = Lines::fit(part, 1e-2, 50.028);
            let left = part.iter().enumerate().map(|(k, y)| (y - lines.at(k as f64)).abs());
            let largest = left.fold(0.0, f64::max);
            assert!(largest < 0.02, "from {at}: {largest}");
        }
    }
}
