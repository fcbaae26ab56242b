//! Time stamps as recorders write them: repeated, jittering, with gaps; and the uniform clocks behind them.

use std::fmt;
use std::ops::Range;

use super::options::{Gaps, ImportOptions, Jitter};
use super::table::Table;
use crate::clock::{self, Clock};
use crate::error::DataError;
use crate::place::brief;

/// A step longer than this many usual steps, and not made up for by the next three, is a gap.
const GAP_STEPS: f64 = 1.5;

/// Jitter up to this part of a period is taken as that of the stamps, not of the samples: it moves a sample of a
/// full-stroke sine with 50 samples a period by at most 0.6 % of the stroke if it was the samples' after all.
const SMALL_JITTER: f64 = 0.1;

/// Part of the steps that may be gaps; with more, the steps have no usual length.
const MOST_GAPS: f64 = 0.1;

/// Repeated stamps that make a coarse clock: fewer could be slips.
const LEAST_REPEATS: usize = 3;

/// Longest period of a coarse clock, in printed units: above it fewer than a tenth of the stamps repeat, which a
/// logger that writes a row twice now and then does as well.
const COARSE_PERIOD: f64 = 0.9;

/// A stretch of rows with one clock, in the unit of the stamps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stretch {
    pub(crate) rows: Range<usize>,
    pub(crate) clock: Clock,
    /// Whether the samples must be interpolated to the clock.
    pub(crate) resample: bool,
}

/// Finds the clocks of the stamps in a column; drops rows that are written twice.
pub(crate) fn stretches(
    table: &mut Table,
    column: usize,
    file: &str,
    options: &ImportOptions,
    notices: &mut Vec<String>,
) -> Result<Vec<Stretch>, DataError> {
    let rows = table.rows();
    if rows < 2 {
        return Ok(Vec::new());
    }
    if let Ok(clock) = clock::infer(&table.values[column], table.printed) {
        return Ok(vec![Stretch {
            rows: 0..rows,
            clock,
            resample: false,
        }]);
    }
    if let Some(clock) = repeats(table, column, file, options, notices)? {
        return Ok(vec![Stretch {
            rows: 0..rows,
            clock,
            resample: false,
        }]);
    }
    if table.rows() < 2 {
        return Ok(Vec::new());
    }
    let stamps = Stamps { table, column, file };
    let breaks = stamps.breaks()?;
    if options.gaps == Gaps::Refuse
        && let Some(&first) = breaks.first()
    {
        return Err(stamps.gap(first, breaks.len()));
    }
    let mut stretches = Vec::new();
    let mut begin = 0;
    for end in breaks.into_iter().chain([stamps.all().len()]) {
        if end - begin >= 2 {
            stretches.push(stamps.uniform(begin..end, options, notices)?);
        } else {
            notices.push(format!(
                "{}: a single sample between two gaps left out",
                table.place(file, begin, column)
            ));
        }
        begin = end;
    }
    Ok(stretches)
}

/// Repeated stamps: a clock printed too coarsely, or rows written twice.
fn repeats(
    table: &mut Table,
    column: usize,
    file: &str,
    options: &ImportOptions,
    notices: &mut Vec<String>,
) -> Result<Option<Clock>, DataError> {
    let stamps = &table.values[column];
    let repeated: Vec<usize> = (1..stamps.len())
        .filter(|&row| stamps[row] == stamps[row - 1])
        .collect();
    if repeated.is_empty() {
        return Ok(None);
    }
    let copies = repeated
        .iter()
        .filter(|&&row| table.values.iter().all(|values| values[row] == values[row - 1]))
        .count();
    let coarse = coarse_clock(table, column, repeated.len());
    let unit = table.chosen[column].unit;
    if let Some(clock) = coarse
        && (2 * copies < repeated.len() || options.jitter == Jitter::Clock)
    {
        notices.push(format!(
            "{} of {} time stamps repeat the one before: printed too coarsely; the clock is that of all samples over \
             all of the time, {} {} a sample",
            repeated.len(),
            stamps.len(),
            brief(clock.period),
            unit.symbol
        ));
        return Ok(Some(clock));
    }
    if coarse.is_none() && copies == repeated.len() {
        notices.push(format!(
            "{copies} rows left out that repeat the row before, stamp and values"
        ));
        table.drop_rows(repeated);
        return Ok(None);
    }
    if options.jitter == Jitter::Clock {
        return Ok(None);
    }
    Err(repeated_stamp(table, column, file, &repeated, copies))
}

fn repeated_stamp(table: &Table, column: usize, file: &str, repeated: &[usize], copies: usize) -> DataError {
    let twice = if copies == repeated.len() {
        ", and so do the values"
    } else {
        ""
    };
    DataError::Clock {
        at: table.place(file, repeated[0], column),
        found: format!(
            "time {:?} {} repeats the stamp before it{twice}; {} of {} stamps do",
            table.values[column][repeated[0]],
            table.chosen[column].unit.symbol,
            repeated.len(),
            table.rows()
        ),
        what_to_do:
            "if the samples were taken uniformly give the rate with `--rate HZ` or say `--jitter clock`; if rows \
                     were written twice, delete one of them"
                .into(),
    }
}

/// The clock of stamps that are rounded to a unit longer than its period: each stamp less its time on that clock lies
/// within one unit. Needs [`LEAST_REPEATS`] and a period of at most [`COARSE_PERIOD`] units, else it is rows written twice.
fn coarse_clock(table: &Table, column: usize, repeats: usize) -> Option<Clock> {
    let stamps = &table.values[column];
    let (first, last) = (*stamps.first()?, *stamps.last()?);
    let steps = (stamps.len() - 1) as f64;
    let chord = (last - first) / steps;
    let rounding = table.printed.rounding(first.abs().max(last.abs()));
    if !(repeats >= LEAST_REPEATS && chord > 0.0 && chord <= COARSE_PERIOD * rounding) {
        return None;
    }
    let within = |period: f64| {
        let off = stamps
            .iter()
            .enumerate()
            .map(|(row, stamp)| stamp - first - row as f64 * period);
        let (least, most) = off.fold((0.0, 0.0), |(least, most): (f64, f64), off| {
            (least.min(off), most.max(off))
        });
        most - least <= rounding * (1.0 + 1e-9)
    };
    let candidates = clock::simplest(chord, rounding / steps).chain([fit(stamps).period]);
    candidates
        .into_iter()
        .find(|&period| within(period))
        .map(|period| Clock { start: first, period })
}

/// The column of time, with what is needed to say where something is.
struct Stamps<'a> {
    table: &'a Table,
    column: usize,
    file: &'a str,
}

impl Stamps<'_> {
    fn all(&self) -> &[f64] {
        &self.table.values[self.column]
    }

    fn symbol(&self) -> &'static str {
        self.table.chosen[self.column].unit.symbol
    }

    fn usual_step(&self) -> f64 {
        let mut steps: Vec<f64> = self.all().windows(2).map(|pair| pair[1] - pair[0]).collect();
        let middle = steps.len() / 2;
        let median = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
        // more than half of the stamps repeat: the step is that of all samples over all of the time
        let chord = (self.all()[self.all().len() - 1] - self.all()[0]) / (self.all().len() - 1) as f64;
        if median == 0.0 { chord } else { median }
    }

    /// Rows before which time jumps.
    fn breaks(&self) -> Result<Vec<usize>, DataError> {
        let stamps = self.all();
        let usual = self.usual_step();
        let jumps = |row: usize| {
            let step = stamps[row] - stamps[row - 1];
            let stays_late = || {
                let late = |next: usize| {
                    stamps
                        .get(next)
                        .map(|stamp| stamp - stamps[row - 1] - (next - row + 1) as f64 * usual)
                };
                (row..row + 4)
                    .filter_map(late)
                    .all(|late| late > (GAP_STEPS - 1.0) * usual)
            };
            step < 0.0 || (step > GAP_STEPS * usual && stays_late())
        };
        let breaks: Vec<usize> = (1..stamps.len()).filter(|&row| jumps(row)).collect();
        if !(usual > 0.0 && usual.is_finite())
            || (breaks.len() > 1 && breaks.len() as f64 > MOST_GAPS * stamps.len() as f64)
        {
            let row = breaks.first().copied().unwrap_or(1);
            return Err(DataError::Clock {
                at: self.table.place(self.file, row, self.column),
                found: format!(
                    "the stamps have no usual step: {:?} {} follows {:?} {}, and so for {} of {} steps",
                    stamps[row],
                    self.symbol(),
                    stamps[row - 1],
                    self.symbol(),
                    breaks.len(),
                    stamps.len() - 1
                ),
                what_to_do: "check that this is the column of time, that decimal signs are not separators, and that \
                             the record was taken at one rate; the rate can be given with `--rate HZ`"
                    .into(),
            });
        }
        Ok(breaks)
    }

    fn gap(&self, row: usize, count: usize) -> DataError {
        let stamps = self.all();
        let step = stamps[row] - stamps[row - 1];
        let symbol = self.symbol();
        let more = if count > 1 {
            format!(" ({} more such places)", count - 1)
        } else {
            String::new()
        };
        let found = if step < 0.0 {
            format!(
                "time goes back from {:?} {symbol} to {:?} {symbol}{more}",
                stamps[row - 1],
                stamps[row]
            )
        } else {
            let samples = (step / self.usual_step() - 1.0).round();
            let (step, usual) = (brief(step), brief(self.usual_step()));
            format!(
                "a step of {step} {symbol} to {:?} {symbol}: some {samples} samples of {usual} {symbol} are missing{more}",
                stamps[row]
            )
        };
        DataError::Clock {
            at: self.table.place(self.file, row, self.column),
            found,
            what_to_do: "`--gaps split` makes a record of each part".into(),
        }
    }

    /// The clock of a stretch without gaps.
    fn uniform(
        &self,
        rows: Range<usize>,
        options: &ImportOptions,
        notices: &mut Vec<String>,
    ) -> Result<Stretch, DataError> {
        let stamps = &self.all()[rows.clone()];
        if let Ok(clock) = clock::infer(stamps, self.table.printed) {
            return Ok(Stretch {
                rows,
                clock,
                resample: false,
            });
        }
        let line = fit(stamps);
        let jitter = JitterSize::of(stamps, line);
        let symbol = self.symbol();
        // a valid clock has a positive, finite period: NaN fails this as well
        let usable =
            line.period > 0.0 && line.period.is_finite() && line.start.is_finite() && jitter.largest.is_finite();
        if usable && (jitter.largest <= SMALL_JITTER || options.jitter == Jitter::Clock) {
            let period = brief(line.period);
            notices.push(format!(
                "time stamps jitter ({jitter}): put on the clock that fits best, {period} {symbol} a sample"
            ));
            return Ok(Stretch {
                rows,
                clock: line,
                resample: false,
            });
        }
        if usable && options.jitter == Jitter::Interpolate && stamps.windows(2).all(|pair| pair[1] > pair[0]) {
            let period = brief(line.period);
            notices.push(format!(
                "time stamps jitter ({jitter}): samples interpolated to {period} {symbol} a sample"
            ));
            return Ok(Stretch {
                clock: Clock {
                    start: stamps[0],
                    ..line
                },
                rows,
                resample: true,
            });
        }
        Err(DataError::Clock {
            at: self.table.place(self.file, rows.start + jitter.worst, self.column),
            found: format!(
                "the time stamps jitter by {jitter}, most at {:?} {symbol}",
                stamps[jitter.worst]
            ),
            what_to_do:
                "say `--jitter clock` if the samples were taken uniformly and only the stamps are late, `--jitter \
                         interpolate` if they were taken when the stamps say, or give the rate with `--rate HZ`"
                    .into(),
        })
    }
}

/// How far stamps are off a clock, in periods.
struct JitterSize {
    worst: usize,
    largest: f64,
    rms: f64,
}

impl JitterSize {
    fn of(stamps: &[f64], clock: Clock) -> JitterSize {
        let off = |row: usize| ((stamps[row] - clock.start - row as f64 * clock.period) / clock.period).abs();
        let worst = (0..stamps.len())
            .max_by(|&a, &b| off(a).total_cmp(&off(b)))
            .unwrap_or(0);
        let mean_square = (0..stamps.len()).map(|row| off(row).powi(2)).sum::<f64>() / stamps.len() as f64;
        JitterSize {
            worst,
            largest: off(worst),
            rms: mean_square.sqrt(),
        }
    }
}

impl fmt::Display for JitterSize {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (largest, rms) = (100.0 * self.largest, 100.0 * self.rms);
        write!(out, "{largest:.1} % of a sample period at most, {rms:.1} % rms")
    }
}

/// The straight line through the stamps with the least squares of deviations.
fn fit(stamps: &[f64]) -> Clock {
    let count = stamps.len() as f64;
    let middle = (count - 1.0) / 2.0;
    let first = stamps[0];
    let mean = stamps.iter().map(|stamp| stamp - first).sum::<f64>() / count;
    let moment: f64 = stamps
        .iter()
        .enumerate()
        .map(|(row, stamp)| (row as f64 - middle) * (stamp - first - mean))
        .sum();
    // sum of (i - middle)^2 over i = 0..n is n (n^2 - 1) / 12
    let period = moment / (count * (count * count - 1.0) / 12.0);
    Clock {
        start: first + mean - period * middle,
        period,
    }
}

/// A column interpolated linearly from its stamps, which increase, to a uniform clock that begins with them.
pub(crate) fn resample(values: &[f64], stamps: &[f64], clock: Clock) -> Vec<f64> {
    let last = stamps[stamps.len() - 1];
    // the jitter of a stretch without gaps cannot make more than twice as many samples
    let samples = (((last - clock.start) / clock.period).floor() as usize + 1).min(2 * stamps.len());
    let mut after = 1;
    (0..samples)
        .map(|sample| {
            let time = clock.start + sample as f64 * clock.period;
            while after + 1 < stamps.len() && stamps[after] < time {
                after += 1;
            }
            let (from, to) = (stamps[after - 1], stamps[after]);
            let part = ((time - from) / (to - from)).clamp(0.0, 1.0);
            values[after - 1] + part * (values[after] - values[after - 1])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_line_through_stamps() {
        let line = fit(&[1.0, 3.0, 5.0, 7.0]);
        assert_eq!((line.start, line.period), (1.0, 2.0));
        // one stamp of four late by 0.4: the slope of least squares is 2 + 0.4 * 1.5 / 5
        let line = fit(&[1.0, 3.0, 5.0, 7.4]);
        assert!((line.period - 2.12).abs() < 1e-12, "{line:?}");
    }

    #[test]
    fn val_interpolation_is_exact_for_a_ramp() {
        let stamps = [0.0, 1.2, 1.9, 3.1, 4.0];
        let ramp = stamps.map(|stamp| 10.0 - 3.0 * stamp);
        let found = resample(
            &ramp,
            &stamps,
            Clock {
                start: 0.0,
                period: 0.5,
            },
        );
        assert_eq!(found.len(), 9);
        for (sample, value) in found.iter().enumerate() {
            assert!((value - (10.0 - 1.5 * sample as f64)).abs() < 1e-12);
        }
    }
}
