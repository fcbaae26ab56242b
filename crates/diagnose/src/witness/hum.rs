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
            |shift_hz: f64| Lines::fit_aside(&residuals[i][t.from..], t.period_s, frequency_hz, shift_hz).taken_um2;
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
    /// Mean square that the lines take.
    taken_um2: f64,
    /// Mean square of the series about its mean.
    all_um2: f64,
}

/// Columns of the straight line.
const LINE: usize = 2;

impl Lines {
    fn fit(own: &[f64], period_s: f64, f: f64) -> Self {
        Self::fit_aside(own, period_s, f, 0.0)
    }

    /// As [`Self::fit`], every line moved by the same frequency.
    ///
    /// # Cost
    /// One pass over some 4000 rows: products of the waves with each other are known in closed form.
    fn fit_aside(own: &[f64], period_s: f64, f: f64, shift_hz: f64) -> Self {
        // No more than 4000 rows, but at least 12 samples a period of the fundamental.
        let stride = (own.len() / 4000).clamp(1, ((1.0 / (12.0 * 60.0)) / period_s).max(1.0) as usize);
        let rows = || own.iter().step_by(stride);
        let count = rows().len();
        let mean = rows().sum::<f64>() / count as f64;
        let mut lines = Self {
            omega: std::f64::consts::TAU * f * period_s,
            shift: std::f64::consts::TAU * shift_hz * period_s,
            amplitudes: Vec::new(),
            taken_um2: 0.0,
            all_um2: rows().map(|v| (v - mean).powi(2)).sum::<f64>() / count as f64,
        };
        // Above half the sampling rate they come back folded, at frequencies as well known.
        if count < 4 * HARMONICS + 4 {
            return lines;
        }
        let apart = stride as f64 / own.len() as f64;
        // Of the straight line's products with the waves those below the diagonal, which is what the factors are made of.
        let mut gram = lines.products(count, stride as f64);
        let mut with_series = DVector::zeros(LINE + 2 * HARMONICS);
        for (r, &y) in rows().enumerate() {
            let k = (r * stride) as f64;
            let line = [1.0, r as f64 * apart - 0.5];
            for (i, &x) in line.iter().enumerate() {
                with_series[i] += x * y;
                line.iter().enumerate().for_each(|(j, other)| gram[(j, i)] += x * other);
            }
            for (j, wave) in lines.waves(k).enumerate() {
                with_series[LINE + j] += wave * y;
                gram[(LINE + j, 0)] += wave;
                gram[(LINE + j, 1)] += wave * line[1];
            }
        }
        // Folded harmonics may lie on one another (50 Hz in 100 samples a second), or on the straight line.
        let ridge = DMatrix::identity(gram.ncols(), gram.ncols()) * (1e-6 * count as f64);
        if let Some(factor) = (&gram + ridge).cholesky() {
            let solution = factor.solve(&with_series);
            let amplitudes = solution.rows_range(LINE..);
            let of_waves = gram.view_range(LINE.., LINE..);
            lines.taken_um2 = (of_waves * amplitudes).dot(&amplitudes).max(0.0) / count as f64;
            lines.amplitudes = amplitudes.iter().copied().collect();
        }
        lines
    }

    /// Sums of products of the waves over rows so many samples apart: cosines and sines of sums and of differences of angles.
    fn products(&self, count: usize, stride: f64) -> DMatrix<f64> {
        let of = |angle: f64| turns(angle * stride, count);
        let apart = |lines: usize| of(lines as f64 * self.omega);
        let together = |lines: usize| of(lines as f64 * self.omega + 2.0 * self.shift);
        let differences: [[f64; 2]; HARMONICS] = std::array::from_fn(apart);
        let sums: [[f64; 2]; 2 * HARMONICS + 1] = std::array::from_fn(together);
        let mut products = DMatrix::zeros(LINE + 2 * HARMONICS, LINE + 2 * HARMONICS);
        for a in 0..HARMONICS {
            for b in 0..HARMONICS {
                let [cos_apart, sin_apart] = differences[a.abs_diff(b)];
                let sin_apart = if a < b { -sin_apart } else { sin_apart };
                let [cos, sin] = sums[a + b + 2];
                let (row, column) = (LINE + 2 * a, LINE + 2 * b);
                products[(row, column)] = 0.5 * (cos_apart + cos);
                products[(row + 1, column + 1)] = 0.5 * (cos_apart - cos);
                products[(row + 1, column)] = 0.5 * (sin + sin_apart);
                products[(row, column + 1)] = 0.5 * (sin - sin_apart);
            }
        }
        products
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

    /// Mean square that the lines take, nothing where they are not the mains'.
    fn of_the_mains(&self) -> f64 {
        let power = |lines: &[f64]| lines.iter().map(|a| a * a).sum::<f64>();
        let lowest = self.amplitudes.get(..4).map_or(0.0, power);
        if lowest > LOWEST_TWO * power(&self.amplitudes) {
            self.taken_um2
        } else {
            0.0
        }
    }
}

/// Sums of the cosines and of the sines of the first multiples of an angle, from 0 on (Dirichlet's kernel).
fn turns(angle: f64, count: usize) -> [f64; 2] {
    let n = count as f64;
    // About the nearest whole turn, where the sum is as large as can be.
    let half = 0.5 * (angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round());
    let size = if half.abs() < 1e-12 {
        n
    } else {
        (n * half).sin() / half.sin()
    };
    let (sin, cos) = ((n - 1.0) * half).sin_cos();
    [size * cos, size * sin]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    impl Lines {
        /// The lines at a sample.
        fn at(&self, k: f64) -> f64 {
            self.amplitudes
                .iter()
                .zip(self.waves(k))
                .map(|(a, wave)| a * wave)
                .sum()
        }
    }

    /// The closed form against sums term by term: any angle, one near a whole turn, harmonics that fold onto one another.
    #[test]
    fn val_products_of_waves_are_those_of_their_rows() {
        for (omega, shift, count, stride) in [
            (0.0628, 0.0, 4000, 1.0),
            (0.31, 0.0071, 700, 3.0),
            (std::f64::consts::PI, 0.0, 100, 1.0),
            (TAU / 4.0 + 1e-7, -1e-5, 480, 1.0),
        ] {
            let lines = Lines {
                omega,
                shift,
                amplitudes: Vec::new(),
                taken_um2: 0.0,
                all_um2: 0.0,
            };
            let rows: Vec<Vec<f64>> = (0..count)
                .map(|r| lines.waves(f64::from(r) * stride).collect())
                .collect();
            let products = lines.products(count as usize, stride);
            for a in 0..2 * HARMONICS {
                for b in 0..2 * HARMONICS {
                    let sum: f64 = rows.iter().map(|row| row[a] * row[b]).sum();
                    let closed = products[(LINE + a, LINE + b)];
                    assert!(
                        (sum - closed).abs() < 1e-8 * f64::from(count),
                        "{a} {b}: {sum} {closed}"
                    );
                }
            }
        }
    }

    /// What the lines take is the mean square of the lines at the rows.
    #[test]
    fn val_what_is_taken_is_what_the_lines_are() {
        let own: Vec<f64> = (0..2500)
            .map(|k| (f64::from(k) * 0.07).sin() + f64::from(k % 17) * 0.01)
            .collect();
        let lines = Lines::fit_aside(&own, 2e-4, 50.1, 3.0);
        let mean = (0..2500).map(|k| lines.at(f64::from(k)).powi(2)).sum::<f64>() / 2500.0;
        assert!(
            (lines.taken_um2 - mean).abs() < 1e-9 * mean,
            "{} {mean}",
            lines.taken_um2
        );
    }

    /// Takes lines at a frequency and its harmonics out of a series that has them.
    fn take_out(own: &mut [f64], period_s: f64, frequency_hz: f64) {
        let length_s = own.len() as f64 * period_s;
        if length_s <= SHORTEST_S {
            return;
        }
        let lines = Lines::fit(own, period_s, frequency_hz);
        let aside = |shift_hz: f64| Lines::fit_aside(own, period_s, frequency_hz, shift_hz).taken_um2;
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
