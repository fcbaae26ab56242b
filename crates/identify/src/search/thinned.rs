//! Records with no more samples than a search looks at.
//!
//! A comparison looks at some thousand samples of a record. Plays are exact at these, whatever lies between, as long as the drive does not turn
//! there; what moves signals in time runs on straight lines between them.

use super::records::rows_a_record;
use crate::family::{peak_to_peak, range};
use crate::period;
use crate::start_state::InitialState;
use hysteron_data::{Dataset, Record};
use rayon::prelude::*;
use std::borrow::Cow;

/// Largest departure of a drive from straight lines between the samples that are kept, share of its range: a sine keeps 70 samples a
/// period.
const STRAIGHT: f64 = 5e-4;

/// Departure of a position from such lines, rms as a share of the largest stroke, that is no more than that of a slow sine.
const SMOOTH: f64 = 1e-3;

/// Departure of white noise from lines between noisy ends, over its rms: at most `sqrt(5 / 3)`.
const OF_NOISE: f64 = 1.3;

/// A dataset, and the same records with every so-many-th sample.
#[derive(Debug, Clone)]
pub struct Thinned<'d> {
    full: &'d Dataset,
    records: Vec<Cow<'d, Record>>,
    /// Samples of each record a sample that is kept.
    every: Vec<usize>,
}

impl<'d> Thinned<'d> {
    /// Thins records where nothing that counts lies between the samples that are kept; `noise_um` is the noise of the readings, rms.
    ///
    /// # Cost
    /// Some passes over the records, and a copy of what is kept.
    pub fn of(full: &'d Dataset, noise_um: f64) -> Self {
        let (low, high) = range(full.records.iter().flat_map(|record| record.voltage_v.iter().copied()));
        let strokes = full.records.iter().map(|record| peak_to_peak(&record.position_um));
        let rows = Rows {
            most: rows_a_record(full.records.len()),
            drive_v: STRAIGHT * (high - low),
            position_um: (OF_NOISE * noise_um).hypot(SMOOTH * strokes.fold(0.0, f64::max)),
        };
        let every: Vec<usize> = full.records.par_iter().map(|record| rows.every(record)).collect();
        let each = full.records.par_iter().zip(&every);
        let records = each.map(|(record, &every)| match every {
            1 => Cow::Borrowed(record),
            _ => Cow::Owned(thinned(record, every)),
        });
        Self {
            full,
            records: records.collect(),
            every,
        }
    }

    /// The records as they were recorded.
    pub fn full(&self) -> &'d Dataset {
        self.full
    }

    /// The samples that are kept.
    pub(super) fn records(&self) -> &[Cow<'d, Record>] {
        &self.records
    }

    /// Samples of a record a sample that is kept.
    pub(super) fn every(&self, record: usize) -> usize {
        self.every[record]
    }

    /// A state of the plays before a record that was thinned, before the record as it was recorded.
    pub(super) fn state_before_full(&self, record: usize, state: InitialState) -> InitialState {
        match state {
            InitialState::Periodic { samples } => InitialState::Periodic {
                samples: samples * self.every[record],
            },
            InitialState::Remanent { .. } => state,
        }
    }
}

/// What must not be lost between the samples that are kept.
struct Rows {
    /// Samples of a record that are looked at.
    most: usize,
    drive_v: f64,
    position_um: f64,
}

impl Rows {
    /// The most samples of a record, one of which stands for all.
    fn every(&self, record: &Record) -> usize {
        let most = record.len().div_ceil(self.most);
        if most < 2 {
            return 1;
        }
        let periodic = period::detect(&record.voltage_v).filter(|found| found.from == 0);
        let whole = |every: &usize| periodic.is_none_or(|found| found.samples.is_multiple_of(*every));
        (2..=most)
            .rev()
            .filter(whole)
            .find(|&every| self.keep(record, every))
            .unwrap_or(1)
    }

    /// Whether every so-many-th sample of a record keeps all of it.
    fn keep(&self, record: &Record, every: usize) -> bool {
        let straight = |series: &[f64], most: f64| departures(series, every).all(|departure| departure.abs() <= most);
        let other = record.voltage2_v.as_deref();
        straight(&record.voltage_v, self.drive_v)
            && other.is_none_or(|other| straight(other, STRAIGHT * peak_to_peak(other)))
            && {
                let squares: f64 = departures(&record.position_um, every)
                    .map(|departure| departure.powi(2))
                    .sum();
                let between = record.len() - record.len().div_ceil(every);
                squares <= between as f64 * self.position_um.powi(2)
            }
    }
}

/// What stands between every so-many-th value of a series, minus straight lines between those.
fn departures(series: &[f64], every: usize) -> impl Iterator<Item = f64> + '_ {
    let ends = series
        .iter()
        .step_by(every)
        .zip(series.iter().skip(every).step_by(every));
    ends.zip(series.chunks_exact(every))
        .flat_map(move |((from, to), between)| {
            let slope = (to - from) / every as f64;
            let inner = between.iter().enumerate().skip(1);
            inner.map(move |(k, value)| value - from - slope * k as f64)
        })
}

fn thinned(record: &Record, every: usize) -> Record {
    let kept = |series: &[f64]| series.iter().copied().step_by(every).collect::<Vec<_>>();
    Record {
        file: record.file.clone(),
        role: record.role,
        excitation: record.excitation.clone(),
        start_s: record.start_s,
        period_s: record.period_s * every as f64,
        voltage_v: kept(&record.voltage_v),
        position_um: kept(&record.position_um),
        reference_um: record.reference_um.as_deref().map(kept),
        temperature_c: record.temperature_c.as_deref().map(kept),
        voltage2_v: record.voltage2_v.as_deref().map(kept),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_data::Role;
    use std::f64::consts::TAU;

    fn every(voltage_v: Vec<f64>, position_um: Vec<f64>, noise_um: f64) -> usize {
        let dataset = Dataset {
            records: vec![Record::new("r.csv", Role::Identify, 1e-5, voltage_v, position_um)],
            ..Dataset::default()
        };
        Thinned::of(&dataset, noise_um).every[0]
    }

    fn sine(samples: usize, a_period: f64) -> Vec<f64> {
        (0..samples)
            .map(|k| 50.0 - 50.0 * (TAU * k as f64 / a_period).cos())
            .collect()
    }

    #[test]
    fn bva_a_sine_keeps_seventy_samples_a_period() {
        let thinned = |a_period: f64| {
            let drive = sine(200_000, a_period);
            every(drive.clone(), drive.iter().map(|v| 0.1 * v).collect(), 1e-3)
        };
        // As many as a comparison looks at are always kept.
        assert_eq!(thinned(50_000.0), 10);
        assert_eq!(thinned(720.0), 10);
        assert!(thinned(640.0) < 10);
        assert_eq!(thinned(130.0), 1);
    }

    #[test]
    fn val_a_period_stays_a_whole_number_of_samples() {
        let drive = sine(100_000, 2003.0);
        assert_eq!(every(drive.clone(), drive, 1e-3), 1);
        let drive = sine(100_000, 2000.0);
        assert_eq!(every(drive.clone(), drive, 1e-3), 5);
    }

    #[test]
    fn val_steps_and_corners_between_samples_stay() {
        let step: Vec<f64> = (0..100_000).map(|k| if k < 50_003 { 0.0 } else { 100.0 }).collect();
        assert_eq!(every(step.clone(), step, 1e-3), 1);
        // Corners at every 50th sample.
        let triangle: Vec<f64> = (0..100_000).map(|k: i32| f64::from((k % 100 - 50).abs())).collect();
        assert_eq!(every(triangle.clone(), triangle, 1e-3), 5);
    }

    #[test]
    fn bva_what_stands_out_of_the_noise_between_samples_stays() {
        let drive = sine(100_000, 50_000.0);
        // A ripple that turns from sample to sample.
        let with = |ripple_um: f64| {
            let ripple = (0..).map(|k| if k % 2 == 0 { ripple_um } else { -ripple_um });
            let position_um = drive.iter().zip(ripple).map(|(v, ripple)| 0.01 * v + ripple);
            every(drive.clone(), position_um.collect(), 0.01)
        };
        assert_eq!(with(0.008), 5);
        assert_eq!(with(0.02), 1);
    }

    #[test]
    fn val_columns_times_and_states_belong_to_the_samples_that_are_kept() {
        let drive = sine(100_000, 50_000.0);
        let mut record = Record::new("r.csv", Role::Validate, 1e-5, drive.clone(), drive.clone());
        record.temperature_c = Some((0..100_000).map(f64::from).collect());
        let dataset = Dataset {
            records: vec![record],
            ..Dataset::default()
        };
        let thinned = Thinned::of(&dataset, 1e-3);
        let kept = &thinned.records()[0];
        assert_eq!((kept.len(), kept.period_s, kept.role), (20_000, 5e-5, Role::Validate));
        assert_eq!(kept.voltage_v[7], drive[35]);
        assert_eq!(kept.temperature_c.as_ref().map(|t| t[7]), Some(35.0));
        assert_eq!(
            thinned.state_before_full(0, InitialState::Periodic { samples: 10_000 }),
            InitialState::Periodic { samples: 50_000 }
        );
        assert_eq!(thinned.state_before_full(0, InitialState::REST), InitialState::REST);
    }
}
