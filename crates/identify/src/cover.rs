//! Writes into a model what its records cover, small signals included.

use crate::control::Linear;
use crate::covered::{Covered, Line, SmallSignalBand, highest_run};
use crate::family::{Direction, peak_to_peak, range};
use crate::model::Model;
use hysteron_data::{Dataset, Record, Role};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;
use std::f64::consts::PI;

/// A drive is small where 70 % of it stays within this share of the range: its loops are slender, and its response is that of the
/// structure.
pub(crate) const SMALL: f64 = 0.2;
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
    let drives = dataset
        .with_role(Role::Identify)
        .flat_map(|record| record.voltage_v.iter().copied());
    let (low, high) = range(drives);
    let span_v = high - low;
    let linear = Linear::of(model);
    let modes_hz: Vec<f64> = linear.part.modes.iter().map(|mode| mode.frequency_hz).collect();
    let positions = dataset
        .with_role(Role::Identify)
        .flat_map(|record| record.position_um.iter().copied());
    let (lowest, highest) = range(positions);
    let mean_um_per_v = (highest - lowest) / span_v;
    let modelled = |hz: f64| mean_um_per_v * linear.response(2.0 * PI * hz);
    let bands = dataset.records.iter().filter_map(|record| {
        let swing = swing_v(&record.voltage_v) / span_v;
        if !(swing > 0.0 && swing <= SMALL) {
            return None;
        }
        let own = own_axis(model, record);
        let up_to_hz = highest_run(
            &lines(own.as_ref().unwrap_or(record), modelled, span_v)?,
            &modes_hz,
            swing,
        )?;
        Some(SmallSignalBand {
            up_to_hz,
            record: record.file.clone(),
        })
    });
    bands.max_by(|a, b| a.up_to_hz.total_cmp(&b.up_to_hz))
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

/// The measured response at the lines that the drive has, averaged over stretches of the record (Welch), beside the modelled one.
fn lines(record: &Record, modelled: impl Fn(f64) -> Complex64, span_v: f64) -> Option<Vec<Line>> {
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
        explained: measured[k].norm_sqr() / drive[k],
        all: position[k],
    });
    Some(lines.collect())
}
