//! Iterative learning: a reference that repeats is corrected by what is left of its own error, run by run.

use crate::bench::Bench;
use crate::complete;
use crate::design::{CompleteLaw, Controller, ReferenceKind};
use crate::error::TrackingError;
use crate::figures::judge;
use crate::reference::{RISE_S, Reference, Shape};
use rayon::prelude::*;
use realfft::RealFftPlanner;
use std::f64::consts::PI;

/// What is learned with.
///
/// The law undoes the model already, so that reference to position is 1 and its inverse as well: `u <- u + L e` with a real L. With
/// an incremental gain of 0.6 to 1.3 of the stage, which changes with the branch, `|1 - L g|` stays below 0.6.
const GAIN: f64 = 0.7;
/// Learned in full up to this share of the band in which the law's own gain and phase are within 3 dB and 30 degrees, and less and
/// less up to its end: above it, where the mode is, learning would diverge.
const WHOLE: f64 = 0.6;
/// A run that is better by less than this has not learned: noise of 1 nm over four periods moves a floor of 2 nm by less.
const PROGRESS: f64 = 0.02;
/// So many runs in a row without progress end it.
const PATIENCE: usize = 3;

/// References that are learned, by the names of [`crate::bench::SHAPES`]: the period of 503 Hz is no whole number of samples.
pub const LEARNED: [&str; 5] = ["10", "100", "500", "complex-harmonic-100", "triangle-100"];

/// One run.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Iteration {
    /// Rms of reference minus sensor's reading, percent of peak to peak: all that learning knows.
    pub measured_percent: f64,
    /// The same of the true position.
    pub true_percent: f64,
}

/// What became of one reference.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct LearnedReference {
    /// Its name.
    pub name: String,
    /// Every run, the first without a correction.
    pub iterations: Vec<Iteration>,
    /// The run whose correction is kept: that of the lowest measured error.
    pub kept: usize,
    /// Why there are no more.
    pub stopped: &'static str,
}

/// Learns each reference of [`LEARNED`] in open loop, with at most `most` corrections.
///
/// Each run begins with the stage at rest and has noise of its own. The error of the judged periods is averaged to one period; its
/// harmonics, times a real gain that falls to nothing within the law's band, correct the reference: no phase is added, the period is
/// closed.
///
/// # Errors
/// A controller for references that are not known ahead, a stage or controller that cannot be run.
///
/// # Cost
/// A run of each reference for each iteration, some 0.1 s for ten of them.
pub fn learn_references(
    bench: &Bench<'_>,
    controller: &Controller,
    most: usize,
) -> Result<Vec<LearnedReference>, TrackingError> {
    if controller.reference == ReferenceKind::Live {
        return Err(TrackingError::Design {
            what: "iterative learning needs a reference that is known ahead and repeats, and this controller is for live ones".into(),
            advice: "design it with --reference previewed",
        });
    }
    let law = controller.without_feedback().law::<f64>()?;
    let band_hz = controller.preview_quality()?.bandwidth_hz;
    let learned = crate::bench::SHAPES
        .into_par_iter()
        .filter(|(name, _)| LEARNED.contains(name));
    learned
        .map(|(name, shape)| learn(bench, &law, name, shape, band_hz, most))
        .collect()
}

fn learn(
    bench: &Bench<'_>,
    law: &CompleteLaw<f64>,
    name: &str,
    shape: Shape,
    band_hz: f64,
    most: usize,
) -> Result<LearnedReference, TrackingError> {
    let period_s = bench.stage.sample_period_s;
    let wanted = shape.reference(bench.range_um, period_s);
    let rise = (RISE_S / period_s).round() as usize;
    let samples = (1.0 / shape.frequency_hz() / period_s).round() as usize;
    let mut correction_um = vec![0.0; samples];
    let mut learned = LearnedReference {
        name: name.to_owned(),
        iterations: Vec::new(),
        kept: 0,
        stopped: "all runs that were asked for are done",
    };
    for number in 0..=most {
        let mut asked_um = wanted.samples_um.clone();
        for (k, value) in asked_um.iter_mut().skip(rise).enumerate() {
            *value += correction_um[k % samples];
        }
        let asked = Reference {
            samples_um: asked_um,
            judged_from: wanted.judged_from,
        };
        let seed = bench.seed.wrapping_add(number as u64);
        let mut run = complete::track(bench.stage, seed, law, &asked)?.from(wanted.judged_from);
        // What is wanted, not what was asked for.
        run.reference_um = wanted.samples_um[wanted.judged_from..].to_vec();
        let Some(figures) = judge(&run, period_s) else {
            learned.stopped = "the reference does not move";
            break;
        };
        learned.iterations.push(Iteration {
            measured_percent: figures.measured_percent,
            true_percent: figures.true_percent,
        });
        let best = learned.iterations[learned.kept].measured_percent;
        if number > 0 && figures.measured_percent < (1.0 - PROGRESS) * best {
            learned.kept = number;
        }
        if number >= learned.kept + PATIENCE {
            learned.stopped = if figures.measured_percent > 1.1 * best {
                "the error grew again: what is left does not repeat, or lies where the law is no inverse"
            } else {
                "the error no longer falls: what is left is noise, or lies above the band that is learned in"
            };
            break;
        }
        let error = run.reference_um.iter().zip(&run.measured_um).map(|(r, y)| r - y);
        // The judged part begins a whole number of periods after the rise.
        let mut mean_um = vec![0.0; samples];
        let periods = run.reference_um.len() / samples;
        error
            .take(periods * samples)
            .enumerate()
            .for_each(|(k, e)| mean_um[k % samples] += e / periods as f64);
        let step_um = filtered(&mean_um, |hz| GAIN * share(hz, band_hz), period_s);
        correction_um
            .iter_mut()
            .zip(step_um)
            .for_each(|(value, step)| *value += step);
    }
    Ok(learned)
}

/// 1 up to [`WHOLE`] of the band, half a cosine to 0 at its end.
fn share(frequency_hz: f64, band_hz: f64) -> f64 {
    let above = (frequency_hz / band_hz - WHOLE) / (1.0 - WHOLE);
    0.5 + 0.5 * (PI * above.clamp(0.0, 1.0)).cos()
}

/// One period through a real gain: its harmonics keep their phases.
fn filtered(period: &[f64], gain: impl Fn(f64) -> f64, period_s: f64) -> Vec<f64> {
    let n = period.len();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, back) = (planner.plan_fft_forward(n), planner.plan_fft_inverse(n));
    let mut time = period.to_vec();
    let mut spectrum = forward.make_output_vec();
    // Lengths are the plans' own.
    let done = forward.process(&mut time, &mut spectrum);
    for (harmonic, value) in spectrum.iter_mut().enumerate() {
        *value *= gain(harmonic as f64 / (n as f64 * period_s)) / n as f64;
    }
    match done.and_then(|()| back.process(&mut spectrum, &mut time)) {
        Ok(()) => time,
        Err(_) => vec![0.0; n],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Harmonics 1 and 7 of 100 Hz in a band of 1 kHz: the first comes through in full, the seventh at its share, neither shifted.
    #[test]
    fn val_filter_keeps_phases() {
        let at = |k: usize, harmonic: f64, phase: f64| (TAU * harmonic * k as f64 / 500.0 + phase).cos();
        let period: Vec<f64> = (0..500).map(|k| at(k, 1.0, 0.3) + at(k, 7.0, -1.0)).collect();
        let found = filtered(&period, |hz| share(hz, 1e3), 20e-6);
        let seventh = 0.5 + 0.5 * (PI * 0.25).cos();
        for (k, found) in found.iter().enumerate() {
            let wanted = at(k, 1.0, 0.3) + seventh * at(k, 7.0, -1.0);
            assert!((found - wanted).abs() < 1e-12, "{k}: {found} {wanted}");
        }
        assert_eq!((share(1e3, 1e3), share(2e3, 1e3)), (0.0, 0.0));
    }
}
