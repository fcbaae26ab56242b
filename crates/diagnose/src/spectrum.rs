//! Spectra of error and measurement.

use crate::comparison::{Comparison, RecordComparison, Spectrum};
use realfft::RealFftPlanner;
use std::f64::consts::TAU;

/// One-sided powers of a series by bins of 1 / duration; their sum is the mean square of the series.
pub(crate) fn periodogram(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let mut time = values.to_vec();
    let mut bins = fft.make_output_vec();
    if fft.process(&mut time, &mut bins).is_err() {
        return Vec::new();
    }
    let scale = 1.0 / (n as f64 * n as f64);
    let last = bins.len() - 1;
    bins.iter()
        .enumerate()
        .map(|(k, bin)| {
            let alone = k == 0 || (k == last && n.is_multiple_of(2));
            bin.norm_sqr() * scale * if alone { 1.0 } else { 2.0 }
        })
        .collect()
}

/// Longest segment of Welch's method.
const LONGEST_SEGMENT: usize = 8192;

/// Amplitude spectral densities by Welch's method (Hann window, half overlapping segments; Welch 1967), pooled over the
/// moving records of the most common sample rate.
pub(crate) fn spectrum(records: &[RecordComparison], noise_rms: f64) -> Spectrum {
    let period_s = |record: &RecordComparison| record.series.period_s;
    let moving: Vec<&RecordComparison> = records
        .iter()
        .filter(|r| r.nrmse_percent.is_some() && r.samples >= 64)
        .collect();
    let same = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-6;
    let common = moving.iter().map(|record| period_s(record)).max_by_key(|&p| {
        moving
            .iter()
            .filter(|record| same(period_s(record), p))
            .map(|r| r.samples)
            .sum::<usize>()
    });
    let Some(common) = common.filter(|&p| p > 0.0) else {
        return Spectrum::default();
    };
    let pool: Vec<&&RecordComparison> = moving.iter().filter(|record| same(period_s(record), common)).collect();
    let shortest = pool.iter().map(|record| record.samples).min().unwrap_or(0);
    let segment = LONGEST_SEGMENT.min(shortest / 2 * 2);
    let mut residual = vec![0.0; segment / 2 + 1];
    let mut measured = residual.clone();
    let mut segments = 0.0;
    for record in pool {
        let errors: Vec<f64> = record
            .series
            .measured
            .iter()
            .zip(&record.series.modelled)
            .map(|(y, m)| y - m)
            .collect();
        for start in (0..=record.samples - segment).step_by(segment / 2) {
            add_segment(&errors[start..start + segment], &mut residual);
            add_segment(&record.series.measured[start..start + segment], &mut measured);
            segments += 1.0;
        }
    }
    let (frequency_hz, residual_um_per_rthz) = densities(&residual, segments, segment, common);
    let (_, measured_um_per_rthz) = densities(&measured, segments, segment, common);
    let white = noise_rms * (2.0 * common).sqrt();
    Spectrum {
        noise_um_per_rthz: vec![white; frequency_hz.len()],
        frequency_hz,
        residual_um_per_rthz,
        measured_um_per_rthz,
    }
}

/// The same of one record of a comparison; empty where it does not move or has fewer than 64 samples.
pub fn of_record(comparison: &Comparison, record: usize) -> Spectrum {
    let records = comparison.records.get(record).map_or(&[][..], std::slice::from_ref);
    spectrum(records, comparison.noise_rms_um)
}

/// Amplitude spectral density of one series by the same method: frequencies, hertz, and the series' unit a root hertz; empty of fewer
/// than 64 samples.
pub fn density(values: &[f64], period_s: f64) -> (Vec<f64>, Vec<f64>) {
    if values.len() < 64 {
        return (Vec::new(), Vec::new());
    }
    let segment = LONGEST_SEGMENT.min(values.len() / 2 * 2);
    let mut sums = vec![0.0; segment / 2 + 1];
    let mut segments = 0.0;
    for start in (0..=values.len() - segment).step_by(segment / 2) {
        add_segment(&values[start..start + segment], &mut sums);
        segments += 1.0;
    }
    densities(&sums, segments, segment, period_s)
}

/// Frequencies and densities of summed powers. Mean square of the Hann window is 3/8; density per hertz by the bin width
/// 1 / (segment x period). The first two bins hold the mean, spread by the window.
fn densities(sums: &[f64], segments: f64, segment: usize, period_s: f64) -> (Vec<f64>, Vec<f64>) {
    let bins = 2..segment / 2;
    let hertz = bins.clone().map(|k| k as f64 / (segment as f64 * period_s));
    let density = bins.map(|k| (sums[k] / segments / 0.375 * segment as f64 * period_s).sqrt());
    (hertz.collect(), density.collect())
}

fn add_segment(values: &[f64], sums: &mut [f64]) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let windowed: Vec<f64> = values
        .iter()
        .enumerate()
        .map(|(k, v)| (v - mean) * (0.5 - 0.5 * (TAU * k as f64 / n).cos()))
        .collect();
    for (sum, power) in sums.iter_mut().zip(periodogram(&windowed)) {
        *sum += power;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_powers_add_up_to_the_mean_square() {
        for n in [64, 65] {
            let values: Vec<f64> = (0..n).map(|k| (f64::from(k) * 0.7).sin() + 0.3).collect();
            let mean_square = values.iter().map(|v| v * v).sum::<f64>() / f64::from(n);
            assert!((periodogram(&values).iter().sum::<f64>() - mean_square).abs() < 1e-12);
        }
    }

    #[test]
    fn val_white_noise_lies_on_its_own_density() {
        use hysteron_data::Role;
        use rand::SeedableRng;
        use rand_distr::{Distribution, Normal};
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let normal = Normal::new(0.0, 0.01).unwrap();
        let n = 80_000;
        let measured: Vec<f64> = (0..n).map(|_| normal.sample(&mut random)).collect();
        let series = crate::Series {
            start_s: 0.0,
            period_s: 2e-5,
            input: vec![0.0; n as usize],
            modelled: vec![0.0; n as usize],
            measured,
        };
        let record = RecordComparison {
            file: String::new(),
            role: Role::Validate,
            nrmse_percent: Some(1.0),
            fit_percent: Some(1.0),
            rms_um: 0.01,
            max_um: 0.04,
            noise_ratio: 1.0,
            samples: n as usize,
            initial_state: String::new(),
            start_estimated: false,
            series,
        };
        let found = spectrum(&[record], 0.01);
        let mean = |v: &[f64]| v.iter().map(|a| a * a).sum::<f64>() / v.len() as f64;
        let ratio = mean(&found.residual_um_per_rthz) / mean(&found.noise_um_per_rthz);
        // 80 000 samples: power known to sqrt(2/n) = 0.5 %, a little worse by the window.
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    }
}
