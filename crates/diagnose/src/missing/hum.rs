//! Mains hum: lines at 50 or 60 Hz and harmonics, whose phase belongs to no record.

use crate::missing::traces::Traces;
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
    /// The same, in records too short to tell what the others let expect.
    pub expected_um2: Vec<f64>,
}

const HARMONICS: usize = 5;

/// Mains deviates by at most 0.5 Hz in large grids.
const BAND_HZ: f64 = 0.5;

/// Looks for lines in the residuals (full rate, run-in included, one a record).
pub(crate) fn find(traces: &Traces, residuals: &[Vec<f64>], noise_um: f64) -> Option<Hum> {
    let usable: Vec<usize> = (0..traces.each.len())
        .filter(|&i| {
            let t = &traces.each[i];
            // Three periods of mains at least, ten samples a period.
            t.period_s < 1.0 / 600.0 && (t.len() - t.from) as f64 * t.period_s > 3.0 / 50.0
        })
        .collect();
    let power = |f: f64| -> f64 {
        let of_record = |&i: &usize| {
            let (taken, all) = lines(&traces.each[i], &residuals[i], f);
            // Relative to the residual: a badly fitted record must not decide.
            taken / (all + noise_um * noise_um)
        };
        usable.iter().map(of_record).sum()
    };
    let nearby = |nominal: f64| (-10..=10).map(move |k| nominal + BAND_HZ * f64::from(k) / 10.0);
    let frequencies: Vec<f64> = [50.0, 60.0].into_iter().flat_map(nearby).collect();
    let powers: Vec<f64> = frequencies.par_iter().map(|&f| power(f)).collect();
    let best = (0..powers.len())
        .rev()
        .max_by(|&a, &b| powers[a].total_cmp(&powers[b]))?;
    let frequency_hz = frequencies[best];
    let mut taken_um2 = vec![0.0; traces.each.len()];
    let (mut contrast, mut seen, mut amplitudes) = (0.0f64, 0, Vec::new());
    for &i in &usable {
        let t = &traces.each[i];
        let (taken, _) = lines(t, &residuals[i], frequency_hz);
        let length_s = (t.len() - t.from) as f64 * t.period_s;
        // Beside the lines by two resolutions of the record, on both sides: what is there without hum.
        let aside = (2.0 / length_s).max(2.0);
        let beside = [-2.0, -1.0, 1.0, 2.0]
            .iter()
            .map(|s| lines(t, &residuals[i], frequency_hz + s * aside).0)
            .fold(0.0, f64::max);
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
    let expected_um2 = (0..traces.each.len())
        // A stretch of a line may hold twice its mean power.
        .map(|i| {
            if taken_um2[i] > 0.0 {
                taken_um2[i]
            } else {
                2.0 * median_um2
            }
        })
        .collect();
    Some(Hum {
        expected_um2,
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

/// Mean square that lines at `f` and its harmonics take from a residual, and the mean square of it all about its mean.
fn lines(trace: &crate::missing::traces::Trace, residual: &[f64], f: f64) -> (f64, f64) {
    let own = &residual[trace.from..];
    // No more than 4000 rows, but at least 12 samples a period of the fundamental.
    let stride = (own.len() / 4000).clamp(1, ((1.0 / (12.0 * 60.0)) / trace.period_s).max(1.0) as usize);
    let nyquist = 0.45 / (trace.period_s * stride as f64);
    let harmonics = (1..=HARMONICS).filter(|&k| k as f64 * f < nyquist).count();
    let rows: Vec<usize> = (0..own.len()).step_by(stride).collect();
    let y = DVector::from_iterator(rows.len(), rows.iter().map(|&k| own[k]));
    let mean = y.mean();
    let all = y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / rows.len() as f64;
    if harmonics == 0 || rows.len() < 4 * harmonics + 4 {
        return (0.0, all);
    }
    let omega = std::f64::consts::TAU * f * trace.period_s;
    let columns = DMatrix::from_fn(rows.len(), 2 * harmonics + 2, |r, c| {
        let k = rows[r] as f64;
        match c {
            0 => 1.0,
            1 => k / own.len() as f64 - 0.5,
            _ if c % 2 == 0 => (omega * (c / 2) as f64 * k).cos(),
            _ => (omega * (c / 2) as f64 * k).sin(),
        }
    });
    let gram = columns.tr_mul(&columns) + DMatrix::identity(columns.ncols(), columns.ncols()) * 1e-9;
    let rhs = columns.tr_mul(&y);
    let Some(factor) = gram.cholesky() else {
        return (0.0, all);
    };
    let mut x = factor.solve(&rhs);
    x[0] = 0.0;
    x[1] = 0.0;
    let fitted = &columns * x;
    (fitted.norm_squared() / rows.len() as f64, all)
}
