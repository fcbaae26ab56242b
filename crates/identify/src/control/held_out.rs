//! What references came to on the stage while no fit had seen their records yet: the last pass of a campaign.

use crate::covered::swing_hz;
use crate::family::{peak_to_peak, range};
use hysteron_data::{Dataset, Record, Role};
use realfft::RealFftPlanner;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Records whose file begins so, and with the number of their pass, are those of references that the inverse of the passes before was
/// asked to follow.
const TRAINING: &str = "training";
/// What of a sine's amplitude another reference may have beside it, rms.
const ANOTHER: f64 = 0.01;

/// The error along one reference, reference less reading, by octaves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOut {
    /// Of a sine, hertz; none of another reference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sine_hz: Option<f64>,
    /// The reference's peak to peak, micrometres.
    pub stroke_um: f64,
    /// Frequency, hertz, and rms of the error there, micrometres; its mean is at 0 Hz.
    pub errors_um: Vec<[f64; 2]>,
}

/// The references of the last pass; none where a dataset has no pass.
pub(super) fn held_out(dataset: &Dataset) -> Vec<HeldOut> {
    let pass = |record: &Record| -> Option<u32> {
        let (number, _) = record.file.strip_prefix(TRAINING)?.split_once('-')?;
        number.parse().ok()
    };
    let records = || dataset.with_role(Role::Identify);
    let last = records().filter_map(pass).max();
    let of_the_last = records().filter(|record| last.is_some() && pass(record) == last);
    of_the_last.filter_map(HeldOut::of).collect()
}

impl HeldOut {
    /// Of the second half of a record along a reference, of a sine over whole periods of it; none where nothing was to be followed.
    fn of(record: &Record) -> Option<Self> {
        let reference_um = record.reference_um.as_ref()?;
        let sine = sine(reference_um, record.period_s);
        let from = sine.map_or(reference_um.len() / 2, |(_, from)| from);
        let followed_um = reference_um.get(from..)?;
        let stroke_um = peak_to_peak(followed_um);
        let missed_um: Vec<f64> = followed_um
            .iter()
            .zip(record.position_um.get(from..)?)
            .map(|(due, found)| due - found)
            .collect();
        if missed_um.len() < 2 || stroke_um <= 0.0 {
            return None;
        }
        let line_hz = 1.0 / (missed_um.len() as f64 * record.period_s);
        Some(Self {
            sine_hz: sine.map(|(hz, _)| hz),
            stroke_um,
            errors_um: by_octaves(missed_um, line_hz),
        })
    }

    /// Rms of the error along a sine of a frequency and so many micrometres peak to peak, where so much is left of each line. A sine's
    /// spectrum moves with the frequency; of another reference only what is not faster counts. The error of a smaller sine is as large: it
    /// is of turns and of what was before, not of the way between.
    pub fn rms_um(&self, frequency_hz: f64, stroke_um: f64, left: &dyn Fn(f64) -> f64) -> f64 {
        let moved = self.sine_hz.map_or(1.0, |sine_hz| frequency_hz / sine_hz);
        let counts = |hz: &f64| self.sine_hz.is_some() || *hz <= frequency_hz;
        let lines = self.errors_um.iter().filter(|[hz, _]| counts(hz));
        let squares: f64 = lines.map(|[hz, um]| (left(moved * hz) * um).powi(2)).sum();
        (stroke_um / self.stroke_um).max(1.0) * squares.sqrt()
    }
}

/// Frequency of a sine, hertz, and the sample from which whole periods of it last to the end, in the second half; none of another reference.
fn sine(reference_um: &[f64], period_s: f64) -> Option<(f64, usize)> {
    let ends_um = range(reference_um.iter().copied());
    let frequency_hz = swing_hz(std::iter::once((period_s, reference_um)), [ends_um.0, ends_um.1]);
    let a_period = 1.0 / (frequency_hz * period_s);
    let periods = (0.5 * reference_um.len() as f64 / a_period).floor();
    if !(periods >= 1.0 && periods.is_finite()) {
        return None;
    }
    let samples = (periods * a_period).round() as usize;
    let from = reference_um.len().checked_sub(samples)?;
    is_sine(&reference_um[from..], TAU * periods / samples as f64)?;
    Some((frequency_hz, from))
}

/// `Some` of whole periods of a sine, so many radians from sample to sample.
fn is_sine(values: &[f64], step: f64) -> Option<()> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let along = |of: fn(f64) -> f64| -> f64 {
        let products = (0..).zip(values).map(|(k, value)| value * of(step * f64::from(k)));
        2.0 / n * products.sum::<f64>()
    };
    let (cos, sin) = (along(f64::cos), along(f64::sin));
    let beside = (0..).zip(values).map(|(k, value)| {
        let phase = step * f64::from(k);
        (value - mean - cos * phase.cos() - sin * phase.sin()).powi(2)
    });
    ((beside.sum::<f64>() / n).sqrt() <= ANOTHER * cos.hypot(sin)).then_some(())
}

/// Mean, then rms by octaves, at the mean frequency of their power.
fn by_octaves(mut values: Vec<f64>, line_hz: f64) -> Vec<[f64; 2]> {
    let n = values.len() as f64;
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(values.len());
    let mut lines = fft.make_output_vec();
    // Lengths are the plan's own.
    let _ = fft.process(&mut values, &mut lines);
    let powers: Vec<f64> = lines.iter().map(|line| 2.0 * line.norm_sqr() / (n * n)).collect();
    let mean = powers.first().map_or(0.0, |twice| (0.5 * twice).sqrt());
    let mut found = vec![[0.0, mean]];
    let mut first = 1;
    while let Some(octave) = powers
        .get(first..powers.len().min(2 * first))
        .filter(|octave| !octave.is_empty())
    {
        let power: f64 = octave.iter().sum();
        let weighted: f64 = (first..).zip(octave).map(|(k, power)| k as f64 * power).sum();
        if power > 0.0 {
            found.push([line_hz * weighted / power, power.sqrt()]);
        }
        first *= 2;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 20e-6;

    /// Along 100 Hz over 10 um, with an error of 0.02 um in the mean and 0.03 um of the third harmonic.
    fn record(file: &str, shape: fn(f64) -> f64) -> Record {
        let phases = || (0..5000).map(|k| TAU * 100.0 * f64::from(k) * PERIOD_S);
        let reference_um: Vec<f64> = phases().map(|phase| 5.0 - 5.0 * shape(phase)).collect();
        let missed = phases().map(|phase| 0.02 + 0.03 * (3.0 * phase).sin());
        let position_um = reference_um
            .iter()
            .zip(missed)
            .map(|(due, missed)| due - missed)
            .collect();
        Record {
            reference_um: Some(reference_um.clone()),
            ..Record::new(file, Role::Identify, PERIOD_S, reference_um, position_um)
        }
    }

    fn of(records: Vec<Record>) -> Vec<HeldOut> {
        held_out(&Dataset {
            records,
            ..Dataset::default()
        })
    }

    /// 20 nm in the mean, and 30 / sqrt 2 nm rms at 300 Hz; three times slower it lies at 100 Hz, and twice as wide it is twice as much.
    #[test]
    fn val_an_error_is_told_by_frequency() {
        let found = &of(vec![record("training2-100hz.csv", f64::cos)])[0];
        assert!((found.sine_hz.unwrap() / 100.0 - 1.0).abs() < 1e-6, "{found:?}");
        let third = 0.03 / 2.0_f64.sqrt();
        let all = found.rms_um(100.0, 10.0, &|_| 1.0);
        assert!((all - (4e-4 + third * third).sqrt()).abs() < 1e-5, "{all}");
        assert!((found.rms_um(100.0, 5.0, &|_| 1.0) - all).abs() < 1e-9);
        assert!((found.rms_um(100.0, 20.0, &|_| 1.0) - 2.0 * all).abs() < 1e-9);
        let above = |limit_hz: f64| move |hz: f64| f64::from(hz > limit_hz);
        assert!((found.rms_um(100.0, 10.0, &above(250.0)) - third).abs() < 1e-5);
        assert!((found.rms_um(100.0, 10.0, &above(310.0))) < 1e-5);
        assert!((found.rms_um(100.0 / 3.0, 10.0, &above(95.0)) - third).abs() < 1e-5);
        assert!((found.rms_um(100.0 / 3.0, 10.0, &above(105.0))) < 1e-5);
    }

    /// Of a reference that is no sine what is not faster counts, where it is.
    #[test]
    fn val_another_reference_tells_of_what_is_slower() {
        let found = &of(vec![record("training2-noise.csv", |phase| {
            phase.cos().signum() * phase.cos().abs().sqrt()
        })])[0];
        assert_eq!(found.sine_hz, None);
        let at = |hz: f64| found.rms_um(hz, 10.0, &|_| 1.0);
        assert!((at(200.0) - 0.02).abs() < 1e-5 && (at(400.0).powi(2) - 4e-4 - 4.5e-4).abs() < 1e-6);
    }

    /// The last pass counts, and every reference of it.
    #[test]
    fn val_the_last_pass_is_held_out() {
        let names = ["training1-a.csv", "training2-b.csv", "large-c.csv", "training-d.csv"];
        let mut records: Vec<Record> = names.map(|name| record(name, f64::cos)).into();
        records.push(record("training2-e.csv", |phase| 0.5 * phase.cos()));
        let found = of(records.clone());
        let strokes: Vec<f64> = found.iter().map(|held_out| held_out.stroke_um.round()).collect();
        assert_eq!(strokes, [10.0, 5.0]);
        records.push(record("training10-f.csv", f64::cos));
        assert_eq!(of(records).len(), 1);
        assert_eq!(of(vec![record("training1-still.csv", |_| 0.0)]), Vec::new());
        assert_eq!(of(Vec::new()), Vec::new());
    }
}
