//! Writes into a model what its records cover, small signals included.

use crate::control::Linear;
use crate::covered::{Covered, Line, SMALL, SmallSignalBand, highest_run, mean_gain};
use crate::family::{Direction, peak_to_peak, range};
use crate::model::Model;
use hysteron_data::{Dataset, Record, Role};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;
use std::f64::consts::PI;

/// A stretch of it that is looked at stays within this share, peak to peak.
const SMALL_STRETCH: f64 = 1.0 / 3.0;
/// Length of a stretch, seconds: lines 10 Hz apart.
const STRETCH_S: f64 = 0.1;
/// Stretches that a response is averaged over at least.
const STRETCHES: usize = 3;
/// Power of the drive at a line, as a share of its strongest line, from which on the line counts.
const EXCITED: f64 = 1e-3;

impl Model {
    /// Writes into the model what records cover: those that it was fitted to, and for small signals those it is judged by as well.
    ///
    /// # Cost
    /// A Fourier transform of each record of small signals.
    pub fn cover(&mut self, dataset: &Dataset) {
        let small_signal = match self.direction {
            Direction::Forward => told(self, dataset),
            // Positions in, voltages out: no loop is closed around it without the stage's own data.
            Direction::Inverse => None,
        };
        self.covered = Covered {
            small_signal,
            ..Covered::by(dataset)
        };
    }
}

/// The widest band that one of the records tells; none where no record of small signals does.
fn told(model: &Model, dataset: &Dataset) -> Option<SmallSignalBand> {
    let modes_hz = modes_hz(&Linear::of(model));
    let bands = small_signals(model, dataset).into_iter().filter_map(|small| {
        Some(SmallSignalBand {
            up_to_hz: highest_run(&small.lines, &modes_hz, small.swing)?,
            record: small.record.file.clone(),
        })
    });
    bands.max_by(|a, b| a.up_to_hz.total_cmp(&b.up_to_hz))
}

/// A record of small signals.
struct Small<'a> {
    record: &'a Record,
    lines: Vec<Line>,
    /// Stretches that the lines are averaged over.
    stretches: usize,
    /// Swing of the drive, as a share of the range.
    swing: f64,
}

/// The records of small signals, with the response that each shows.
fn small_signals<'a>(model: &Model, dataset: &'a Dataset) -> Vec<Small<'a>> {
    let drives = dataset
        .with_role(Role::Identify)
        .flat_map(|record| record.voltage_v.iter().copied());
    let (low, high) = range(drives);
    let span_v = high - low;
    let linear = Linear::of(model);
    let positions = dataset
        .with_role(Role::Identify)
        .flat_map(|record| record.position_um.iter().copied());
    let (lowest, highest) = range(positions);
    let mean_um_per_v = (highest - lowest) / span_v;
    let modelled = |hz: f64| mean_um_per_v * linear.response(2.0 * PI * hz);
    let of_record = |record: &'a Record| {
        let swing = swing_v(&record.voltage_v) / span_v;
        if !(swing > 0.0 && swing <= SMALL) {
            return None;
        }
        let own = own_axis(model, record);
        let (lines, stretches) = lines(own.as_ref().unwrap_or(record), modelled, span_v)?;
        Some(Small {
            record,
            lines,
            stretches,
            swing,
        })
    };
    dataset.records.iter().filter_map(of_record).collect()
}

fn modes_hz(linear: &Linear) -> Vec<f64> {
    linear.part.modes.iter().map(|mode| mode.frequency_hz).collect()
}

/// What a stage answers to small signals in one record, beside the linear part of its model.
#[derive(Debug, Clone, PartialEq)]
pub struct SmallSignalResponse {
    /// The record.
    pub record: String,
    /// Its lines, hertz, ascending.
    pub frequency_hz: Vec<f64>,
    /// Position over voltage as measured, micrometres per volt.
    pub measured: Vec<Complex64>,
    /// Standard deviation of the measured response, as a share of its size; the same in radians of its phase.
    pub deviation: Vec<f64>,
    /// The model's linear part at the measured response's gain, micrometres per volt.
    pub modelled: Vec<Complex64>,
    /// This gain over the mean one of the whole range: small loops are flatter.
    pub gain: f64,
    /// Up to where the model does what the stage does, hertz; none where it nowhere does over an octave.
    pub told_to_hz: Option<f64>,
}

impl SmallSignalResponse {
    /// Phases at the lines, degrees: the model's without jumps, the measured ones within half a turn of it.
    pub fn phases_deg(&self) -> [Vec<f64>; 2] {
        let mut before = Complex64::new(1.0, 0.0);
        let mut phase = 0.0;
        let modelled: Vec<f64> = self
            .modelled
            .iter()
            .map(|now| {
                phase += (now / before).arg();
                before = *now;
                phase.to_degrees()
            })
            .collect();
        let both = self.measured.iter().zip(&self.modelled).zip(&modelled);
        let measured = both.map(|((measured, own), phase)| phase + (measured / own).arg().to_degrees());
        [measured.collect(), modelled]
    }
}

/// Averages that stretches of which each shares half with the next are worth (Welch 1967: Hann's window, correlation 1/6).
const WORTH: f64 = 1.0 / (1.0 + 2.0 / 36.0);

/// The response of the record of small signals that tells the stage to the highest frequency; none where there is no such record.
///
/// Random errors are those of an averaged cross spectrum, `sqrt((1 - c) / (2 c n))` with the coherence c over n averages.
///
/// # Reference
/// Bendat and Piersol, Random Data (2010), section 9.2.3.
///
/// # Cost
/// A Fourier transform of each record of small signals.
pub fn small_signal_response(model: &Model, dataset: &Dataset) -> Option<SmallSignalResponse> {
    if model.direction == Direction::Inverse {
        return None;
    }
    let modes_hz = modes_hz(&Linear::of(model));
    let told = |small: &Small<'_>| highest_run(&small.lines, &modes_hz, small.swing);
    let all = small_signals(model, dataset)
        .into_iter()
        .map(|small| (told(&small), small));
    let widest = |(told, small): &(Option<f64>, Small<'_>)| (told.unwrap_or(0.0), small.lines.len());
    let (told_to_hz, small) = all.max_by(|a, b| {
        let (a, b) = (widest(a), widest(b));
        a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
    })?;
    let gain = mean_gain(&small.lines)?.norm();
    let averages = WORTH * small.stretches as f64;
    let deviation = |line: &Line| {
        let coherence = (line.explained / line.all).clamp(f64::MIN_POSITIVE, 1.0);
        ((1.0 - coherence) / (2.0 * coherence * averages)).sqrt()
    };
    let lines = &small.lines;
    Some(SmallSignalResponse {
        record: small.record.file.clone(),
        frequency_hz: lines.iter().map(|line| line.hz).collect(),
        measured: lines.iter().map(|line| line.measured / line.drive).collect(),
        deviation: lines.iter().map(deviation).collect(),
        modelled: lines.iter().map(|line| gain * line.modelled / line.drive).collect(),
        gain,
        told_to_hz,
    })
}

/// A record without what the model's effects make of the other axis' motion, which is no answer to the drive; `None` where that axis
/// stands still.
fn own_axis(model: &Model, record: &Record) -> Option<Record> {
    let other_v = record.voltage2_v.as_ref().filter(|v| peak_to_peak(v) > 0.0)?;
    let mut own = record.clone();
    own.voltage2_v = Some(vec![other_v[0]; other_v.len()]);
    let (both, alone) = (model.simulate(record).output, model.simulate(&own).output);
    let pairs = own.position_um.iter_mut().zip(both.iter().zip(&alone));
    pairs.for_each(|(y, (both, alone))| *y -= both - alone);
    Some(own)
}

/// Swing of a drive for 70 % of its time: what it does but for a rise to where it is.
fn swing_v(voltage_v: &[f64]) -> f64 {
    let mut sorted = voltage_v.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| {
        sorted
            .get((share * sorted.len() as f64) as usize)
            .copied()
            .unwrap_or(f64::NAN)
    };
    at(0.85) - at(0.15)
}

/// The measured response at the lines that the drive has, averaged over stretches of the record (Welch), beside the modelled one; and
/// how many stretches.
fn lines(record: &Record, modelled: impl Fn(f64) -> Complex64, span_v: f64) -> Option<(Vec<Line>, usize)> {
    let length = ((STRETCH_S / record.period_s).round() as usize).min(record.len() / (STRETCHES + 1)) & !1;
    if length < 64 {
        return None;
    }
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let spectrum = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / length as f64;
        let window = |k: usize| 0.5 * (1.0 - (2.0 * PI * k as f64 / length as f64).cos());
        let mut time: Vec<f64> = values.iter().enumerate().map(|(k, v)| (v - mean) * window(k)).collect();
        let mut lines = fft.make_output_vec();
        // Lengths are the plan's own.
        let _ = fft.process(&mut time, &mut lines);
        lines
    };
    let count = length / 2;
    let (mut drive, mut position) = (vec![0.0; count], vec![0.0; count]);
    let mut measured = vec![Complex64::default(); count];
    let mut stretches = 0;
    for from in (0..=record.len() - length).step_by(length / 2) {
        let voltage_v = &record.voltage_v[from..from + length];
        let swing_v = peak_to_peak(voltage_v);
        if swing_v <= 0.0 || swing_v > SMALL_STRETCH * span_v {
            continue;
        }
        stretches += 1;
        let (v, y) = (spectrum(voltage_v), spectrum(&record.position_um[from..from + length]));
        for k in 0..count {
            drive[k] += v[k].norm_sqr();
            position[k] += y[k].norm_sqr();
            measured[k] += y[k] * v[k].conj();
        }
    }
    if stretches < STRETCHES {
        return None;
    }
    let strongest = drive.iter().skip(2).copied().fold(0.0, f64::max);
    let hz = |k: usize| k as f64 / (length as f64 * record.period_s);
    let excited = (2..count).filter(|&k| drive[k] > EXCITED * strongest);
    let lines = excited.map(|k| Line {
        hz: hz(k),
        measured: measured[k],
        modelled: drive[k] * modelled(hz(k)),
        drive: drive[k],
        explained: measured[k].norm_sqr() / drive[k],
        all: position[k],
    });
    Some((lines.collect(), stretches))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Family, FitOptions, fit};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    const PERIOD_S: f64 = 1e-4;
    /// What the stage keeps of its position from sample to sample: a lag of three samples.
    const KEPT: f64 = 0.7;

    /// A stage of 0.1 um/V behind a lag, with noise on its sensor.
    fn recorded(file: &str, role: Role, voltage_v: Vec<f64>, random: &mut Pcg64Mcg) -> Record {
        let mut lagged = voltage_v[0];
        let position_um = voltage_v
            .iter()
            .map(|v| {
                lagged = KEPT * lagged + (1.0 - KEPT) * v;
                0.1 * lagged + 0.05 * random.random_range(-1.0..1.0)
            })
            .collect();
        Record::new(file, role, PERIOD_S, voltage_v, position_um)
    }

    /// The measured response is that of the stage, off by what its deviations say; the model, which has no lag, keeps its phase.
    #[test]
    fn val_a_measured_response_is_off_by_its_deviation() {
        let mut random = Pcg64Mcg::seed_from_u64(11);
        let large: Vec<f64> = (0..4000)
            .map(|k| 50.0 - 50.0 * (2.0 * PI * f64::from(k) / 1000.0).cos())
            .collect();
        let small: Vec<f64> = (0..40_000).map(|_| 50.0 + random.random_range(-5.0..5.0)).collect();
        let dataset = Dataset {
            records: vec![
                recorded("large.csv", Role::Identify, large, &mut random),
                recorded("small.csv", Role::Validate, small, &mut random),
            ],
            ..Dataset::default()
        };
        let model = fit(&dataset, &FitOptions::new(Family::Mpi), &|_| ()).unwrap().model;
        let found = small_signal_response(&model, &dataset).unwrap();
        assert_eq!(found.record, "small.csv");
        assert!(found.frequency_hz.len() > 400, "{}", found.frequency_hz.len());
        let mut squares = 0.0;
        for (k, hz) in found.frequency_hz.iter().enumerate() {
            let late = Complex64::from_polar(1.0, -2.0 * PI * hz * PERIOD_S);
            let exact = 0.1 * (1.0 - KEPT) / (1.0 - KEPT * late);
            squares += ((found.measured[k] / exact - 1.0) / found.deviation[k]).norm_sqr();
            assert!(found.modelled[k].im.abs() < 1e-12 && (0.03..0.11).contains(&found.modelled[k].re));
        }
        // In size and in phase by one deviation each.
        let each = squares / (2 * found.frequency_hz.len()) as f64;
        assert!((0.8..1.25).contains(&each), "{each}");
        let [measured, modelled] = found.phases_deg();
        let late = measured
            .iter()
            .zip(&found.measured)
            .all(|(deg, h)| (deg - h.arg().to_degrees()).abs() < 1e-9);
        assert!(late && modelled.iter().all(|deg| deg.abs() < 1e-9));
        let told = found.told_to_hz.unwrap();
        // |1 - H| / |H| of this lag is 0.3 of itself at 200 Hz.
        assert!((100.0..400.0).contains(&told), "{told}");
        let only_large = Dataset {
            records: dataset.records[..1].to_vec(),
            ..Dataset::default()
        };
        assert_eq!(small_signal_response(&model, &only_large), None);
    }
}
