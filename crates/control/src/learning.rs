//! Iterative learning: a reference that repeats is corrected by what is left of its own error, run by run.

use crate::design::{Controller, ReferenceKind};
use crate::error::ControlError;
use crate::message::{Message, Setting};
use crate::reference::Shape;
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

/// References that are learned, by the names of [`crate::reference::SHAPES`]: the period of 503 Hz is no whole number of samples.
pub const LEARNED: [&str; 5] = ["10", "100", "500", "complex-harmonic-100", "triangle-100"];

/// One run.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Iteration {
    /// Rms of reference minus sensor's reading, percent of peak to peak: all that learning knows.
    pub measured_percent: f64,
    /// The same of the true position, where there is one to be had.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_percent: Option<f64>,
}

impl Iteration {
    /// Of the true position where there is one, of the sensor's readings otherwise.
    pub fn percent(&self) -> f64 {
        self.true_percent.unwrap_or(self.measured_percent)
    }
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
    /// What that run was asked for besides the reference, one period, micrometres.
    #[serde(skip)]
    pub correction_um: Vec<f64>,
}

/// A run, as far as learning sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Samples since the reference began, and there what is wanted less what the sensor read, micrometres. Some may be missing.
    pub error_um: Vec<(usize, f64)>,
    /// Its figures.
    pub iteration: Iteration,
}

/// How a reference is learned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learning {
    /// Samples of a period.
    pub samples: usize,
    /// Sample period, seconds.
    pub period_s: f64,
    /// Where learning ends, hertz; it fades from 0.6 of it on.
    pub band_hz: f64,
    /// Corrections at most.
    pub most: usize,
}

/// The band in which a controller's gain and phase are within 3 dB and 30 degrees, hertz: learning would diverge above it.
///
/// # Errors
/// A controller for references that are not known ahead.
pub fn band_hz(controller: &Controller) -> Result<f64, ControlError> {
    if controller.reference == ReferenceKind::Live {
        return Err(ControlError::Design {
            what: "iterative learning needs a reference that is known ahead and repeats, and this controller is for live ones".into(),
            advice: Message::from("design it with ").naming(Setting::Previewed),
        });
    }
    Ok(controller.preview_quality()?.bandwidth_hz)
}

/// Samples of a period of a shape; none where they are no whole number.
pub fn whole_period(shape: Shape, period_s: f64) -> Option<usize> {
    let samples = 1.0 / shape.frequency_hz() / period_s;
    ((samples - samples.round()).abs() < 1e-6 * samples).then(|| samples.round() as usize)
}

/// Lets a reference be run again and again, by number and correction of one period in micrometres, and corrects it by what is left.
///
/// The errors are averaged to one period; its harmonics, times a real gain that falls to nothing within the band, correct the
/// reference: no phase is added, the period is closed.
///
/// # Errors
/// Those of a run.
pub fn learn<E>(
    name: &str,
    learning: Learning,
    mut run: impl FnMut(usize, &[f64]) -> Result<Option<Run>, E>,
) -> Result<LearnedReference, E> {
    let samples = learning.samples;
    let mut correction_um = vec![0.0; samples];
    let mut learned = LearnedReference {
        name: name.to_owned(),
        iterations: Vec::new(),
        kept: 0,
        stopped: "all runs that were asked for are done",
        correction_um: correction_um.clone(),
    };
    for number in 0..=learning.most {
        let Some(run) = run(number, &correction_um)? else {
            learned.stopped = "the reference does not move";
            break;
        };
        learned.iterations.push(run.iteration);
        let measured_percent = run.iteration.measured_percent;
        let best = learned.iterations[learned.kept].measured_percent;
        if number > 0 && measured_percent < (1.0 - PROGRESS) * best {
            learned.kept = number;
            learned.correction_um.clone_from(&correction_um);
        }
        if number >= learned.kept + PATIENCE {
            learned.stopped = if measured_percent > 1.1 * best {
                "the error grew again: what is left does not repeat, or lies where the law is no inverse"
            } else {
                "the error no longer falls: what is left is noise, or lies above the band that is learned in"
            };
            break;
        }
        let (mut sum_um, mut count) = (vec![0.0; samples], vec![0.0; samples]);
        for (k, e) in run.error_um {
            sum_um[k % samples] += e;
            count[k % samples] += 1.0;
        }
        let mean_um: Vec<f64> = sum_um
            .iter()
            .zip(&count)
            .map(|(sum, n)| sum / f64::max(*n, 1.0))
            .collect();
        let gain = |hz| GAIN * share(hz, learning.band_hz);
        let step_um = filtered(&mean_um, samples, gain, learning.period_s);
        correction_um
            .iter_mut()
            .zip(step_um)
            .for_each(|(value, step)| *value += step);
    }
    Ok(learned)
}

/// A period of a shape over a range with what was learned, in so many points.
pub fn corrected(shape: Shape, [low_um, high_um]: [f64; 2], correction_um: &[f64], points: usize) -> Vec<f64> {
    let correction_um = filtered(correction_um, points, |_| 1.0, 1.0);
    let time_s = |i: usize| i as f64 / points as f64 / shape.frequency_hz();
    let at = |i: usize| low_um + (high_um - low_um) * shape.share(time_s(i));
    correction_um.iter().enumerate().map(|(i, c)| at(i) + c).collect()
}

/// 1 up to [`WHOLE`] of the band, half a cosine to 0 at its end.
fn share(frequency_hz: f64, band_hz: f64) -> f64 {
    let above = (frequency_hz / band_hz - WHOLE) / (1.0 - WHOLE);
    0.5 + 0.5 * (PI * above.clamp(0.0, 1.0)).cos()
}

/// One period through a real gain, in so many points: its harmonics keep their phases.
fn filtered(period: &[f64], points: usize, gain: impl Fn(f64) -> f64, period_s: f64) -> Vec<f64> {
    let n = period.len();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, back) = (planner.plan_fft_forward(n), planner.plan_fft_inverse(points));
    let mut time = period.to_vec();
    let mut spectrum = forward.make_output_vec();
    // Lengths are the plans' own.
    let done = forward.process(&mut time, &mut spectrum);
    for (harmonic, value) in spectrum.iter_mut().enumerate() {
        *value *= gain(harmonic as f64 / (n as f64 * period_s)) / n as f64;
    }
    let mut all = back.make_input_vec();
    all.iter_mut().zip(&spectrum).for_each(|(to, from)| *to = *from);
    // A real signal has a real end of its spectrum.
    if points.is_multiple_of(2)
        && let Some(end) = all.last_mut()
    {
        end.im = 0.0;
    }
    let mut time = back.make_output_vec();
    match done.and_then(|()| back.process(&mut all, &mut time)) {
        Ok(()) => time,
        Err(_) => vec![0.0; points],
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
        let found = filtered(&period, 500, |hz| share(hz, 1e3), 20e-6);
        let seventh = 0.5 + 0.5 * (PI * 0.25).cos();
        for (k, found) in found.iter().enumerate() {
            let wanted = at(k, 1.0, 0.3) + seventh * at(k, 7.0, -1.0);
            assert!((found - wanted).abs() < 1e-12, "{k}: {found} {wanted}");
        }
        assert_eq!((share(1e3, 1e3), share(2e3, 1e3)), (0.0, 0.0));
    }
}
