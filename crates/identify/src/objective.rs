//! What a fit makes small: the weighted sum of squared errors over the records, eq. 17.

use crate::columns::Run;
use crate::family::{Direction, peak_to_peak};
use crate::initial;
use crate::loop_opening::{opening_percent, weights};
use crate::period;
use crate::start_state::InitialState;
use hysteron_data::{Dataset, Record, Role};
use serde::{Deserialize, Serialize};

/// How the squared errors of different records are weighed against each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weighting {
    /// Each record counts by its mean squared error relative to its peak to peak, the square of eq. 19: what `compare`
    /// reports pooled. Strokes below a tenth of the largest count as a tenth, so that rests do not rule.
    Record,
    /// Eqs 17 and 18: each sample counts, weighed by its record's measured loop opening over the smallest one.
    LoopOpening,
}

/// Strokes below this share of the largest are weighed as if they were this share.
const SMALLEST_STROKE: f64 = 0.1;

/// Positions at which readings are clipped; none for an inverse, whose output is the voltage.
pub fn clipped(dataset: &Dataset, direction: Direction) -> Vec<f64> {
    match direction {
        Direction::Forward => hysteron_acquisition::clipped_at(&dataset.records),
        Direction::Inverse => Vec::new(),
    }
}

/// The records to fit to, with their weights and first guesses of the initial state; readings that are one of `clipped` do not count.
pub(crate) fn runs<'a>(
    dataset: &'a Dataset,
    direction: Direction,
    weighting: Weighting,
    clipped: &'a [f64],
) -> Vec<Run<'a>> {
    let mut runs: Vec<Run<'a>> = dataset
        .with_role(Role::Identify)
        .map(|record| Run {
            clipped,
            ..run_of(record, direction, None)
        })
        .collect();
    let of_record: Vec<f64> = match weighting {
        Weighting::Record => {
            let strokes: Vec<f64> = runs.iter().map(|run| peak_to_peak(run.output)).collect();
            let floor = SMALLEST_STROKE * strokes.iter().copied().fold(0.0, f64::max);
            let scale = |stroke: f64| stroke.max(floor).max(f64::MIN_POSITIVE.sqrt());
            runs.iter()
                .zip(strokes)
                .map(|(run, s)| 1.0 / (run.output.len() as f64 * scale(s).powi(2)))
                .collect()
        }
        Weighting::LoopOpening => {
            let openings: Vec<_> = dataset.with_role(Role::Identify).map(measured_opening).collect();
            weights(&openings)
        }
    };
    for (run, weight) in runs.iter_mut().zip(of_record) {
        run.weight = weight;
    }
    runs
}

/// One record as a run of weight 1, with a guessed initial state unless one is given.
pub(crate) fn run_of(record: &Record, direction: Direction, initial: Option<InitialState>) -> Run<'_> {
    let (input, output) = (direction.input(record), direction.output(record));
    // The voltage is the noise-free command in both directions: it decides whether the record is periodic.
    let initial = initial.unwrap_or_else(|| initial::guess(&record.voltage_v, &record.position_um));
    Run {
        input,
        output,
        period_s: record.period_s,
        initial,
        weight: 1.0,
        fit_from: 0,
        level_free: false,
        clipped: &[],
    }
}

/// Loop opening of a record, percent of the stroke; `None` where the drive is not periodic with two branches.
pub fn measured_opening(record: &Record) -> Option<f64> {
    let periodic = period::detect(&record.voltage_v)?;
    opening_percent(&record.voltage_v, &record.position_um, periodic)
}
