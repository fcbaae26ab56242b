//! A record made ready for a chain of effects: a period of run-in, and a grid fine enough for its drive.

use crate::grid::{drive, refinement, slow};
use crate::initial::rested;
use crate::start_state::InitialState;
use hysteron_data::Record;

/// A record as a chain sees it.
#[derive(Debug, Clone)]
pub(crate) struct Trace<'a> {
    pub record: &'a Record,
    pub initial: InitialState,
    /// Samples of run-in before the record.
    pub run_in: usize,
    /// Whether the stage rested before the record, where that is periodic.
    pub rested: bool,
    /// Samples of the grid a recorded one.
    pub every: usize,
    /// Sample period of the grid, seconds.
    pub period_s: f64,
    pub voltage_v: Vec<f64>,
    pub temperature_c: Option<Vec<f64>>,
    pub voltage2_v: Option<Vec<f64>>,
}

impl<'a> Trace<'a> {
    /// Prepares a record; `fine` asks for a finer grid where the drive needs one.
    pub(crate) fn new(record: &'a Record, initial: InitialState, fine: bool) -> Self {
        let voltage_v = &record.voltage_v;
        let (period, every) = match initial {
            InitialState::Periodic { samples } => (samples, if fine { refinement(&voltage_v[..samples]) } else { 1 }),
            InitialState::Remanent { .. } => (0, 1),
        };
        let slow = |column: &Option<Vec<f64>>| column.as_ref().map(|values| slow(values, period, every));
        Self {
            record,
            initial,
            run_in: period * every,
            rested: period > 0 && rested(&record.position_um, period),
            every,
            period_s: record.period_s / every as f64,
            voltage_v: drive(voltage_v, period, every),
            temperature_c: slow(&record.temperature_c.as_ref().map(|t| smoothed(t))),
            voltage2_v: slow(&record.voltage2_v),
        }
    }

    /// The same record from another state.
    pub(crate) fn starting_at(&self, initial: InitialState, fine: bool) -> Self {
        let mut other = match (self.initial, initial) {
            // The series stay as they are.
            (InitialState::Remanent { .. }, InitialState::Remanent { .. }) => self.clone(),
            _ => Self::new(self.record, initial, fine),
        };
        other.initial = initial;
        other
    }

    /// Whether the grid is the record's samples and no more.
    pub(crate) fn is_the_record(&self) -> bool {
        self.run_in == 0 && self.every == 1
    }

    /// The grid's sample of each recorded one.
    pub(crate) fn at(&self, recorded: usize) -> usize {
        self.run_in + recorded * self.every
    }
}

/// Temperature moves in minutes: the mean over an eighth of the record, at most over ten seconds' worth of its noise.
fn smoothed(values: &[f64]) -> Vec<f64> {
    let half = (values.len() / 16).max(1);
    let mut sums = Vec::with_capacity(values.len() + 1);
    sums.push(0.0);
    for &value in values {
        sums.push(sums[sums.len() - 1] + value);
    }
    (0..values.len())
        .map(|k| {
            // Symmetric, so that a drift in a straight line stays where it is.
            let reach = half.min(k).min(values.len() - 1 - k);
            (sums[k + reach + 1] - sums[k - reach]) / (2 * reach + 1) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_smoothing_keeps_a_straight_line() {
        let line: Vec<f64> = (0..200).map(|k| 20.0 + 0.01 * f64::from(k)).collect();
        for (a, b) in line.iter().zip(smoothed(&line)) {
            assert!((a - b).abs() < 1e-10);
        }
    }
}
