//! What sines came to on the stage while no fit had seen their records yet: the last pass of a campaign.

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

/// Frequencies that differ by this share are the same.
const SAME: f64 = 0.01;

/// The error along one sine, reference less reading, by octaves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOut {
    /// Of the sine, hertz.
    pub frequency_hz: f64,
    /// Frequency, hertz, and rms of the error there, percent of peak to peak; its mean is at 0 Hz.
    pub errors: Vec<[f64; 2]>,
}

/// The sines of the last pass, by ascending frequency, of each frequency the widest; none where a dataset has no pass.
pub(super) fn held_out(dataset: &Dataset) -> Vec<HeldOut> {
    let pass = |record: &Record| -> Option<u32> {
        let (number, _) = record.file.strip_prefix(TRAINING)?.split_once('-')?;
        number.parse().ok()
    };
    let records = || dataset.with_role(Role::Identify);
    let last = records().filter_map(pass).max();
    let of_the_last = records().filter(|record| last.is_some() && pass(record) == last);
    let mut found: Vec<(f64, HeldOut)> = of_the_last.filter_map(HeldOut::of).collect();
    found.sort_by(|(_, a), (_, b)| a.frequency_hz.total_cmp(&b.frequency_hz));
    found.dedup_by(|(stroke_um, next), (widest_um, kept)| {
        let same = next.frequency_hz <= (1.0 + SAME) * kept.frequency_hz;
        if same && stroke_um > widest_um {
            std::mem::swap(stroke_um, widest_um);
            std::mem::swap(next, kept);
        }
        same
    });
    found.into_iter().map(|(_, held_out)| held_out).collect()
}

impl HeldOut {
    /// Of a record along a sine, over whole periods of its second half, and the sine's peak to peak; none of another reference.
    fn of(record: &Record) -> Option<(f64, Self)> {
        let reference_um = record.reference_um.as_ref()?;
        let ends_um = range(reference_um.iter().copied());
        let series = (record.period_s, &reference_um[..]);
        let frequency_hz = swing_hz(std::iter::once(series), [ends_um.0, ends_um.1]);
        let a_period = 1.0 / (frequency_hz * record.period_s);
        let periods = (0.5 * reference_um.len() as f64 / a_period).floor();
        if !(periods >= 1.0 && periods.is_finite()) {
            return None;
        }
        let samples = (periods * a_period).round() as usize;
        let from = reference_um.len() - samples;
        let reference_um = &reference_um[from..];
        is_sine(reference_um, TAU * periods / samples as f64)?;
        let stroke_um = peak_to_peak(reference_um);
        let missed = reference_um.iter().zip(record.position_um.get(from..)?);
        let missed_percent: Vec<f64> = missed.map(|(due, found)| 100.0 * (due - found) / stroke_um).collect();
        let held_out = Self {
            frequency_hz,
            errors: by_octaves(missed_percent, 1.0 / (samples as f64 * record.period_s)),
        };
        Some((stroke_um, held_out))
    }

    /// Rms of the error along a sine of another frequency, its spectrum moved with it, where so much is left of each line; percent of peak
    /// to peak.
    pub fn percent(&self, frequency_hz: f64, left: &dyn Fn(f64) -> f64) -> f64 {
        let moved = frequency_hz / self.frequency_hz;
        let squares = self
            .errors
            .iter()
            .map(|[hz, percent]| (left(moved * hz) * percent).powi(2));
        squares.sum::<f64>().sqrt()
    }
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

    /// 0.2 % in the mean, and 0.03 / sqrt 2 of 10 um rms at 300 Hz; three times slower it lies at 100 Hz.
    #[test]
    fn val_an_error_is_told_by_frequency() {
        let found = &of(vec![record("training2-100hz.csv", f64::cos)])[0];
        assert!((found.frequency_hz / 100.0 - 1.0).abs() < 1e-6, "{found:?}");
        let third = 0.3 / 2.0_f64.sqrt();
        let all = found.percent(100.0, &|_| 1.0);
        assert!((all - (0.04 + third * third).sqrt()).abs() < 1e-4, "{all}");
        let above = |limit_hz: f64| move |hz: f64| f64::from(hz > limit_hz);
        assert!((found.percent(100.0, &above(250.0)) - third).abs() < 1e-4);
        assert!((found.percent(100.0, &above(310.0))) < 1e-4);
        assert!((found.percent(100.0 / 3.0, &above(95.0)) - third).abs() < 1e-4);
        assert!((found.percent(100.0 / 3.0, &above(105.0))) < 1e-4);
    }

    /// The last pass counts, and of it the sines; of two at one frequency the wider.
    #[test]
    fn val_the_last_pass_is_held_out() {
        let squared = |phase: f64| phase.cos().signum() * phase.cos().abs().sqrt();
        let names = ["training1-a.csv", "training2-b.csv", "large-c.csv", "training-d.csv"];
        let mut records: Vec<Record> = names.map(|name| record(name, f64::cos)).into();
        records.push(record("training2-e.csv", squared));
        let wide = of(records.clone());
        assert_eq!(wide.len(), 1);
        let mut small = record("training2-a.csv", |phase| 0.5 * phase.cos());
        small.reference_um.iter_mut().flatten().for_each(|um| *um += 0.1);
        assert_ne!(of(vec![small.clone()])[0].errors, wide[0].errors);
        records.insert(0, small);
        assert_eq!(of(records.clone()), wide);
        records.push(record("training10-f.csv", squared));
        assert_eq!(of(records), Vec::new());
        assert_eq!(of(Vec::new()), Vec::new());
    }
}
