//! Records made ready for a search: their states, the samples that are looked at, and the parts that are held out by turns.

use super::thinned::Thinned;
use crate::chain_trace::Trace;
use crate::columns::{Design, Run};
use crate::family::{peak_to_peak, range};
use crate::initial;
use crate::start_state::InitialState;
use hysteron_data::{Record, Role};
use rayon::prelude::*;
use std::ops::Range;

/// Samples that a search looks at, over all records that are fitted.
const SEARCH_ROWS: usize = 5_000;

/// Samples behind a comparison, over all records; a record that is alone has as many as fifteen together.
const ALL_ROWS: usize = 18_000;

/// Fewest samples of a record that are looked at: 60 periods of 20.
const LEAST_ROWS: usize = 1_200;

/// Fewest samples of a record that a search looks at, of [`LEAST_ROWS`].
const LEAST_FEW_ROWS: usize = 25;

/// Fewer records than this are held out in parts.
const FEW_RECORDS: usize = 4;

/// Parts that few records are cut into, all together.
const PARTS: usize = 8;

/// A record as a search sees it.
#[derive(Debug, Clone)]
pub(crate) struct Prepared<'a> {
    /// The record on its samples.
    plain: Trace<'a>,
    /// On a finer grid, where its drive needs one for what moves signals in time.
    fine: Option<Trace<'a>>,
    /// Whether it takes part in the fit.
    pub fits: bool,
    /// Peak to peak of the position; 0 where the drive stands still or no sample counts.
    pub stroke_um: f64,
    /// Whether the widest plays hold something over it that it does not show.
    pub holds_a_level: bool,
    /// First sample at which the plays have settled.
    pub settled: usize,
    /// Samples of a comparison.
    pub rows: Vec<usize>,
    /// Samples of a search, some of [`Self::rows`].
    pub few_rows: Vec<usize>,
    /// Parts of [`Self::rows`] that are held out by turns; the whole where there are records enough.
    pub parts: Vec<Range<usize>>,
}

impl<'a> Prepared<'a> {
    /// The record as a chain runs over it.
    pub(crate) fn trace(&self, dynamic: bool) -> &Trace<'a> {
        match &self.fine {
            Some(fine) if dynamic => fine,
            _ => &self.plain,
        }
    }

    pub(crate) fn record(&self) -> &'a Record {
        self.plain.record
    }

    pub(crate) fn initial(&self) -> InitialState {
        self.plain.initial
    }

    pub(crate) fn moves(&self) -> bool {
        self.stroke_um > 0.0
    }

    /// The same record from another state.
    pub(crate) fn start_in(&mut self, initial: InitialState) {
        self.plain = self.plain.starting_at(initial, false);
        self.fine = finer(&self.plain);
    }
}

fn finer<'a>(plain: &Trace<'a>) -> Option<Trace<'a>> {
    let fine = Trace::new(plain.record, plain.initial, true);
    (fine.every > 1).then_some(fine)
}

/// Samples behind a comparison of one of so many records.
pub(super) fn rows_a_record(records: usize) -> usize {
    (ALL_ROWS / records.max(1)).max(LEAST_ROWS)
}

/// Prepares all records: those with role `identify` are fitted, or all of them where none has. Readings that are clipped do not count.
pub(crate) fn prepare<'a>(thinned: &'a Thinned<'_>, design: &Design) -> Vec<Prepared<'a>> {
    let dataset = thinned.full();
    let some_fit = dataset.with_role(Role::Identify).next().is_some();
    let fits = |record: &Record| !some_fit || record.role == Role::Identify;
    let clipped_um = hysteron_acquisition::clipped_at(&dataset.records);
    let fitted = dataset.records.iter().filter(|r| fits(r));
    let readings = fitted.flat_map(|r| r.voltage_v.iter().zip(&r.position_um));
    let (low, high) = range(readings.filter(|(_, y)| !clipped_um.contains(y)).map(|(v, _)| *v));
    let moving = dataset
        .records
        .iter()
        .filter(|r| fits(r) && peak_to_peak(&r.voltage_v) > 0.0)
        .count();
    let each = Budget {
        fitted: dataset.records.iter().filter(|r| fits(r)).count().max(1),
        all: dataset.records.len(),
        parts: if moving < FEW_RECORDS {
            PARTS.div_ceil(moving.max(1))
        } else {
            1
        },
        range_v: [low, high],
        clipped_um,
    };
    thinned
        .records()
        .par_iter()
        .map(|record| one(record, fits(record), design, &each))
        .collect()
}

struct Budget {
    fitted: usize,
    all: usize,
    parts: usize,
    range_v: [f64; 2],
    clipped_um: Vec<f64>,
}

fn one<'a>(record: &'a Record, fits: bool, design: &Design, budget: &Budget) -> Prepared<'a> {
    let guess = initial::guess(&record.voltage_v, &record.position_um);
    let mut run = Run {
        input: &record.voltage_v,
        output: &record.position_um,
        period_s: record.period_s,
        initial: guess,
        weight: 1.0,
        fit_from: 0,
        level_free: false,
        clipped: &budget.clipped_um,
    };
    let still = Design::still(design.family, design.thresholds.clone());
    initial::skip_unsettled(&still, &mut run);
    let plain = Trace::new(record, guess, false);
    let moves = peak_to_peak(&record.voltage_v) > 0.0;
    let known = inside(&record.voltage_v, budget.range_v, fits);
    let spread = |budget: usize| -> Vec<usize> {
        let samples = record.len() - run.fit_from;
        let stride = samples.div_ceil(budget.max(1)).max(1);
        (run.fit_from..record.len())
            .step_by(stride)
            .filter(|&k| run.counts(k) && known.as_ref().is_none_or(|known| known[k]))
            .collect()
    };
    let rows = spread(rows_a_record(budget.all));
    let few = (SEARCH_ROWS / budget.fitted).max(LEAST_FEW_ROWS);
    let every = rows.len().div_ceil(few).max(1);
    let count = if fits { budget.parts } else { 1 };
    let part = rows.len().div_ceil(count).max(1);
    Prepared {
        fine: finer(&plain),
        plain,
        fits,
        stroke_um: if moves && !rows.is_empty() {
            peak_to_peak(&record.position_um)
        } else {
            0.0
        },
        holds_a_level: initial::holds_a_level(design, &record.voltage_v, guess),
        settled: run.fit_from,
        few_rows: rows.iter().copied().step_by(every).collect(),
        parts: (0..rows.len())
            .step_by(part)
            .map(|from| from..(from + part).min(rows.len()))
            .collect(),
        rows,
    }
}

/// A sample counts beyond the fitted range by this share of it: converters and noise of a command.
const BESIDE: f64 = 2e-3;

/// Which samples of a record that is not fitted lie inside the fitted voltages, with all that they remember of beyond
/// forgotten; `None` where all do.
fn inside(voltage_v: &[f64], [low, high]: [f64; 2], fits: bool) -> Option<Vec<bool>> {
    let beside = BESIDE * (high - low);
    let beyond = |v: f64| v < low - beside || v > high + beside;
    if fits || !voltage_v.iter().any(|&v| beyond(v)) {
        return None;
    }
    // What was left by an excursion is wiped out once the drive has gone from one end of the range to the other.
    let (mut last, mut ends) = (false, [true; 2]);
    let known = voltage_v.iter().map(|&v| {
        if beyond(v) {
            (last, ends) = (true, [false; 2]);
            return false;
        }
        ends[0] |= v < low + 0.05 * (high - low);
        ends[1] |= v > high - 0.05 * (high - low);
        last &= !(ends[0] && ends[1]);
        !last
    });
    let known: Vec<bool> = known.collect();
    // A record that is never inside for long is judged where its drive is, whatever it remembers.
    if known.iter().filter(|k| **k).count() * 4 >= voltage_v.len() {
        return Some(known);
    }
    Some(voltage_v.iter().map(|&v| !beyond(v)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::Family;
    use hysteron_data::Dataset;
    use std::f64::consts::TAU;

    #[test]
    fn val_samples_beyond_the_fitted_range_do_not_count() {
        let triangle = |top: f64| (0..200).map(move |k| top * (1.0 - (f64::from(k) / 100.0 - 1.0).abs()));
        let drive: Vec<f64> = triangle(120.0).chain(triangle(100.0)).chain(triangle(100.0)).collect();
        assert!(inside(&drive, [0.0, 100.0], true).is_none());
        assert!(inside(&drive[200..], [0.0, 100.0], false).is_none());
        let known = inside(&drive, [0.0, 100.0], false).unwrap();
        assert!(known[50] && !known[100] && !known[150], "{known:?}");
        assert!(known[450], "forgotten after both ends");
    }

    #[test]
    fn val_clipped_readings_do_not_count() {
        let drive = || (0..4000).map(|k| 50.0 - 50.0 * (f64::from(k) * TAU / 1000.0).cos());
        // Noise below the converter's end, none at it.
        let noise = |k: usize| 1e-3 * ((k * 7919 % 1000) as f64 / 1000.0 - 0.5);
        let position = |end_um: f64| -> Vec<f64> {
            let free = drive().enumerate().map(|(k, v)| 0.1 * v + noise(k));
            free.map(|y| y.min(end_um)).collect()
        };
        let rows_of = |position_um: Vec<f64>| {
            let record = Record::new("sine.csv", Role::Identify, 1e-4, drive().collect(), position_um);
            let dataset = Dataset {
                records: vec![record],
                ..Dataset::default()
            };
            let design = Design::still(Family::Mpi, vec![0.0, 10.0]);
            prepare(&Thinned::of(&dataset, 1e-3), &design)[0].rows.clone()
        };
        let all = rows_of(position(20.0));
        let kept = rows_of(position(8.0));
        assert!(all.len() > kept.len() + all.len() / 5, "{} {}", all.len(), kept.len());
        let cut_off = |rows: &[usize]| rows.iter().filter(|&&k| position(8.0)[k] == 8.0).count();
        assert!(cut_off(&all) > 0);
        assert_eq!(cut_off(&kept), 0);
    }
}
