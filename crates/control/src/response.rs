//! Frequency responses by averaged cross spectra, and the bandwidths read from them.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

/// A frequency response on a logarithmic grid.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Response {
    /// Frequency, hertz.
    pub frequency_hz: Vec<f64>,
    /// Gain, output over input.
    pub gain: Vec<f64>,
    /// Phase, degrees, unwrapped from the lowest frequency on.
    pub phase_deg: Vec<f64>,
    /// Coherence, 0 to 1: the share of the output's power that is linear in the input.
    pub coherence: Vec<f64>,
}

/// Samples of a segment at most: 0.66 s at 50 kHz, lines 1.5 Hz apart, so that 36 Hz has a grid finer than 5 %.
const SEGMENT: usize = 32_768;
/// Cells of the grid a decade: 2.4 % apart.
const CELLS_A_DECADE: f64 = 96.0;

/// Estimates the response from `input` to `output` up to `highest_hz`: Welch's segments (Hann window, half overlapped,
/// means removed), spectra summed over segments and over the lines of each cell of a logarithmic grid, then
/// `H = S_xy / S_xx` and `coherence = |S_xy|^2 / (S_xx S_yy)`.
///
/// Empty for fewer than two segments' worth of samples.
///
/// # Reference
/// Bendat and Piersol, Random Data (2010), sections 9.2 and 11.5.
pub fn response(input: &[f64], output: &[f64], sample_period_s: f64, highest_hz: f64) -> Response {
    let length = input.len().min(output.len());
    let segment = SEGMENT.min(2 * (length / 4));
    if segment < 16 {
        return Response::default();
    }
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(segment);
    let window: Vec<f64> = (0..segment)
        .map(|k| (std::f64::consts::PI * (k as f64 + 0.5) / segment as f64).sin().powi(2))
        .collect();
    let spectrum = |values: &[f64]| -> Vec<Complex64> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let mut time: Vec<f64> = values.iter().zip(&window).map(|(v, w)| (v - mean) * w).collect();
        let mut lines = fft.make_output_vec();
        // Lengths are the plan's own.
        let _ = fft.process(&mut time, &mut lines);
        lines
    };
    let spacing_hz = 1.0 / (segment as f64 * sample_period_s);
    let mut lines = vec![(0.0, 0.0, Complex64::default()); segment / 2 + 1];
    let mut first = 0;
    while first + segment <= length {
        let x = spectrum(&input[first..first + segment]);
        let y = spectrum(&output[first..first + segment]);
        for (sum, (x, y)) in lines.iter_mut().zip(x.iter().zip(&y)) {
            sum.0 += x.norm_sqr();
            sum.1 += y.norm_sqr();
            sum.2 += x.conj() * y;
        }
        first += segment / 2;
    }
    // The two lowest lines hold what the window lets through of the mean.
    let cell = |line: usize| (CELLS_A_DECADE * (line as f64 * spacing_hz).log10()).round() as i64;
    let mut found = Response::default();
    let mut line = 2;
    while line < lines.len() && line as f64 * spacing_hz <= highest_hz {
        let this = cell(line);
        let (mut xx, mut yy, mut xy, mut count, mut sum_hz) = (0.0, 0.0, Complex64::default(), 0.0, 0.0);
        while line < lines.len() && cell(line) == this && line as f64 * spacing_hz <= highest_hz {
            xx += lines[line].0;
            yy += lines[line].1;
            xy += lines[line].2;
            count += 1.0;
            sum_hz += line as f64 * spacing_hz;
            line += 1;
        }
        if xx > 0.0 && yy > 0.0 {
            found.push(sum_hz / count, xy / xx, xy.norm_sqr() / (xx * yy));
        }
    }
    found
}

/// The response at the lines of a periodic input, `periods` whole periods of it in periodic state; neighbouring lines within
/// a cell of the logarithmic grid are summed as in [`response`].
pub fn line_response(input: &[f64], output: &[f64], sample_period_s: f64, periods: usize) -> Response {
    let length = input.len().min(output.len());
    if length < 16 || periods == 0 {
        return Response::default();
    }
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let spectrum = |values: &[f64]| {
        let mut time = values[..length].to_vec();
        let mut lines = fft.make_output_vec();
        // Lengths are the plan's own.
        let _ = fft.process(&mut time, &mut lines);
        lines
    };
    let (x, y) = (spectrum(input), spectrum(output));
    let largest = x.iter().skip(1).map(|line| line.norm()).fold(0.0, f64::max);
    let spacing_hz = 1.0 / (length as f64 * sample_period_s);
    let lines: Vec<usize> = (periods..x.len())
        .step_by(periods)
        .filter(|&line| x[line].norm() > 0.1 * largest)
        .collect();
    let cell = |line: usize| (CELLS_A_DECADE * (line as f64 * spacing_hz).log10()).round() as i64;
    let mut found = Response::default();
    for cells in lines.chunk_by(|&a, &b| cell(a) == cell(b)) {
        let (mut xx, mut yy, mut xy) = (0.0, 0.0, Complex64::default());
        for &line in cells {
            xx += x[line].norm_sqr();
            yy += y[line].norm_sqr();
            xy += x[line].conj() * y[line];
        }
        let mean_hz = cells.iter().map(|&line| line as f64 * spacing_hz).sum::<f64>() / cells.len() as f64;
        if xx > 0.0 && yy > 0.0 {
            found.push(mean_hz, xy / xx, xy.norm_sqr() / (xx * yy));
        }
    }
    found
}

impl Response {
    fn push(&mut self, frequency_hz: f64, response: Complex64, coherence: f64) {
        let mut phase_deg = response.arg().to_degrees();
        if let Some(before) = self.phase_deg.last() {
            phase_deg -= 360.0 * ((phase_deg - before) / 360.0).round();
        }
        self.frequency_hz.push(frequency_hz);
        self.gain.push(response.norm());
        self.phase_deg.push(phase_deg);
        self.coherence.push(coherence);
    }

    /// Its cells to a frequency: beyond the lines that were meant there are images of them.
    #[must_use]
    pub fn up_to(mut self, highest_hz: f64) -> Self {
        // Half a cell of the grid more.
        let cells = self.frequency_hz.partition_point(|&hz| hz < 1.01 * highest_hz);
        for column in [
            &mut self.frequency_hz,
            &mut self.gain,
            &mut self.phase_deg,
            &mut self.coherence,
        ] {
            column.truncate(cells);
        }
        self
    }

    /// First frequency at which `value` falls below `limit`, interpolated over log frequency; `None` where it does not.
    fn falls_below(&self, values: &[f64], limit: f64) -> Option<Crossing> {
        let at = values.iter().position(|&value| value < limit)?;
        let (coherence, hz) = (self.coherence[at], self.frequency_hz[at]);
        if at == 0 {
            return Some(Crossing {
                frequency_hz: hz,
                coherence,
                below_the_first: true,
            });
        }
        let share = (values[at - 1] - limit) / (values[at - 1] - values[at]);
        let before = self.frequency_hz[at - 1];
        Some(Crossing {
            frequency_hz: before * (hz / before).powf(share),
            coherence: coherence.min(self.coherence[at - 1]),
            below_the_first: false,
        })
    }

    /// The frequency up to which the output lags by less than 30 degrees, the paper's control bandwidth.
    pub fn lag_30_deg(&self) -> Option<Crossing> {
        self.falls_below(&self.phase_deg, -30.0)
    }

    /// The frequency up to which the gain stays above -3 dB of one.
    pub fn minus_3_db(&self) -> Option<Crossing> {
        self.falls_below(&self.gain, 0.5_f64.sqrt())
    }

    /// `|1 - H|` at a frequency, by the nearest cell: the error that a small sine would have, as a share of its amplitude.
    pub fn error_gain(&self, frequency_hz: f64) -> Option<f64> {
        let distance = |f: &f64| (f / frequency_hz).ln().abs();
        let at = (0..self.frequency_hz.len())
            .min_by(|&a, &b| distance(&self.frequency_hz[a]).total_cmp(&distance(&self.frequency_hz[b])))?;
        let h = Complex64::from_polar(self.gain[at], self.phase_deg[at].to_radians());
        Some((Complex64::new(1.0, 0.0) - h).norm())
    }
}

/// Where a response crosses a limit.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Crossing {
    /// The frequency, hertz.
    pub frequency_hz: f64,
    /// The lower coherence of the two neighbouring cells.
    pub coherence: f64,
    /// Whether the response is beyond the limit from the lowest frequency on.
    pub below_the_first: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::noise;

    /// A first-order lag behind two samples of delay, band-limited noise through it: gain, phase and crossings are known.
    #[test]
    fn val_lag_and_delay() {
        let (period_s, tau_s) = (20e-6, 0.5e-3);
        let reference = noise([-1.0, 1.0], 0.1, 5e3, 4.0, 3, period_s).unwrap();
        let input = &reference.samples_um[reference.judged_from..];
        let keep = (-period_s / tau_s).exp();
        let mut state = 0.0;
        let output: Vec<f64> = (0..input.len())
            .map(|k| {
                state = keep * state + (1.0 - keep) * if k < 2 { 0.0 } else { input[k - 2] };
                state
            })
            .collect();
        let found = response(input, &output, period_s, 4e3);
        let exact = |hz: f64| {
            let z = Complex64::from_polar(1.0, -std::f64::consts::TAU * hz * period_s);
            z * z * (1.0 - keep) / (1.0 - keep * z)
        };
        for (k, &hz) in found.frequency_hz.iter().enumerate().filter(|(_, hz)| **hz > 20.0) {
            let h = exact(hz);
            // Leakage between lines 1.5 Hz apart and the cell's width bound the error; both are well below a percent.
            assert!(
                (found.gain[k] / h.norm() - 1.0).abs() < 0.01,
                "{hz} Hz: {}",
                found.gain[k]
            );
            assert!(
                (found.phase_deg[k] - h.arg().to_degrees()).abs() < 0.5,
                "{hz} Hz: {}",
                found.phase_deg[k]
            );
            assert!(found.coherence[k] > 0.999, "{hz} Hz: {}", found.coherence[k]);
        }
        // atan(w tau) + 2 w T (+ half a sample of the recursion) = 30 degrees, by bisection of the exact response.
        let (mut low, mut high) = (10.0, 1000.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if exact(middle).arg().to_degrees() < -30.0 {
                high = middle
            } else {
                low = middle
            }
        }
        let crossing = found.lag_30_deg().unwrap();
        assert!((crossing.frequency_hz / low - 1.0).abs() < 0.01, "{crossing:?} {low}");
        let lower = found.clone().up_to(500.0);
        assert!(lower.frequency_hz.iter().all(|&hz| hz < 510.0) && lower.lag_30_deg() == Some(crossing));
        let db = found.minus_3_db().unwrap().frequency_hz;
        assert!((db * std::f64::consts::TAU * tau_s - 1.0).abs() < 0.02, "{db}");
        assert!((found.error_gain(1000.0).unwrap() - (Complex64::new(1.0, 0.0) - exact(1000.0)).norm()).abs() < 0.03);
    }

    /// Noise that has nothing to do with the input lowers the coherence to its share of the power, here one half.
    #[test]
    fn val_coherence_is_a_share_of_power() {
        let a = noise([-1.0, 1.0], 0.1, 5e3, 4.0, 3, 20e-6).unwrap();
        let b = noise([-1.0, 1.0], 0.1, 5e3, 4.0, 4, 20e-6).unwrap();
        let (a, b) = (&a.samples_um[a.judged_from..], &b.samples_um[b.judged_from..]);
        let sum: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + b).collect();
        let found = response(a, &sum, 20e-6, 4e3);
        let upper: Vec<f64> = found
            .frequency_hz
            .iter()
            .zip(&found.coherence)
            .filter(|(f, _)| **f > 1e3)
            .map(|(_, c)| *c)
            .collect();
        let mean = upper.iter().sum::<f64>() / upper.len() as f64;
        // Cells above 1 kHz hold 16 lines and more of 11 segments: about 100 averages, 57 cells.
        assert!((mean - 0.5).abs() < 0.03, "{mean}");
    }

    /// Two and a half samples of delay on a settled multisine: gain 1 and 30 degrees at 1 / (12 x 50 us) = 1667 Hz.
    #[test]
    fn val_line_response_of_a_delay() {
        let lines = [20.0, 60.0, 140.0, 300.0, 620.0, 1260.0, 1660.0, 1680.0, 2540.0, 5100.0];
        let wave = |late_s: f64| -> Vec<f64> {
            (0..5000)
                .map(|k| {
                    let t = f64::from(k) * 20e-6 - late_s;
                    lines
                        .iter()
                        .map(|f| (std::f64::consts::TAU * f * t + f * f).sin())
                        .sum()
                })
                .collect()
        };
        let found = line_response(&wave(0.0), &wave(50e-6), 20e-6, 2);
        let hz = found.lag_30_deg().unwrap().frequency_hz;
        assert!((hz - 1e6 / 600.0).abs() < 1.0, "{hz}");
        assert!(found.gain.iter().all(|gain| (gain - 1.0).abs() < 1e-9));
    }

    #[test]
    fn refuse_nothing_but_give_nothing_for_short_records() {
        assert_eq!(response(&[1.0; 10], &[1.0; 10], 20e-6, 1e3), Response::default());
        assert_eq!(Response::default().lag_30_deg(), None);
    }
}
