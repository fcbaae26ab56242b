//! What an error goes with: time, position, speed, temperature, the other axis, cycles, the records' order, the sample clock.

use crate::diagnosis::{Lock, LockTo};
use crate::witness::lines;
use crate::witness::regression::Gram;
use crate::witness::sample_clock;
use crate::witness::traces::{Trace, Traces};
use hysteron_identify::family::range;
use hysteron_identify::period::{self, Periodic};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Cells of an average over a quantity that all records share.
const CELLS: usize = 64;

/// Cells of an average over a record's time, where the drive does not repeat.
const TIME_CELLS: usize = 24;

/// Cells of an average over the other axis' voltage.
const OTHER_CELLS: usize = 24;

/// Rows of a record behind gains and zeros of its own.
const ROWS: usize = 4000;

/// Cells a decade of speed, and decades that are looked at.
const SPEED_CELLS: f64 = 3.0;
const SPEED_DECADES: f64 = 4.0;

/// Edges between counts of cycles since a record's start.
const CYCLES: [f64; 14] = [
    0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 64.0,
];

/// The error of one record.
pub(crate) struct Course<'a> {
    pub trace: &'a Trace,
    pub error_um: &'a [f64],
    /// The error without the mean course over a period of the drive, where that repeats.
    pub unrepeated_um: Vec<f64>,
    /// The error without a gain and a zero of the record's own.
    bent_um: Vec<f64>,
    /// Position without the error, micrometres above the lowest of all records.
    pub position_um: Vec<f64>,
    pub period: Option<Periodic>,
    /// Cell of the cycles since the record's start, one a sample.
    cycle_cell: Vec<u8>,
    /// Of a squared error: as in percentages of peak to peak, every record alike.
    pub weight: f64,
}

/// The errors of all records, each as long as the record.
pub(crate) struct Courses<'a> {
    pub each: Vec<Course<'a>>,
    /// Weighted sum of their squares.
    pub all: f64,
    largest_um: f64,
}

/// Weighted squares that gains take: those of all records, and from each record those of the others, which take nothing that is
/// there by chance.
struct Taken {
    by_all: f64,
    by_others: f64,
}

impl<'a> Courses<'a> {
    pub(crate) fn new(traces: &'a Traces, errors_um: impl Iterator<Item = &'a [f64]>) -> Self {
        let mut each: Vec<Course<'a>> = traces
            .each
            .iter()
            .zip(errors_um)
            .map(|(t, e)| Course::new(t, e, traces))
            .collect();
        let (low, high) = range(each.iter().flat_map(|c| &c.position_um).copied());
        each.iter_mut().flat_map(|c| &mut c.position_um).for_each(|y| *y -= low);
        let all = each.iter().map(|c| c.weight * squares(c.error_um)).sum();
        Self {
            each,
            all,
            largest_um: (high - low).max(f64::MIN_POSITIVE),
        }
    }

    /// Shares of the squared error, which overlap: the largest first, single records behind what says more.
    pub(crate) fn locks(&self) -> Vec<Lock> {
        if self.all <= 0.0 {
            return Vec::new();
        }
        let position = |c: &Course<'_>, k: usize| self.position_cell(c, k);
        let fastest = self.each.iter().flat_map(|c| (0..c.len()).map(|k| c.speed(k).abs()));
        let fastest = fastest.fold(f64::MIN_POSITIVE, f64::max);
        let speed = |c: &Course<'_>, k: usize| speed_cell(c.speed(k) / fastest);
        let (by_position, by_speed) = (self.of_cells(position), self.of_cells(speed));
        let both = self.of_cells(|c, k| position(c, k) / 4 * SPEEDS + speed(c, k));
        let beyond = |i: usize| both[i] - by_position[i].max(0.0) - by_speed[i].max(0.0);
        let larger = |[a, b]: [f64; 2]| a.max(b);
        let mut locks = vec![
            Lock::new(LockTo::Position, larger(by_position)),
            Lock::new(LockTo::Speed, larger(by_speed)),
            Lock::new(LockTo::PositionAndSpeed, larger([beyond(0), beyond(1)])),
            Lock::new(LockTo::Time, self.of_time()),
            Lock::new(LockTo::CycleCount, self.of_cycles()),
        ];
        locks.extend(self.of_records());
        locks.extend(self.of_other_axis());
        locks.extend(lines::lock(self));
        locks.extend(sample_clock::locks(self));
        for lock in &mut locks {
            lock.share = (lock.share / self.all).clamp(0.0, 1.0);
        }
        // Whatever changes a record's gain looks in part like a gain of its own: that stands behind what has half its share.
        let rank = |lock: &Lock| lock.share * if lock.to == LockTo::Record { 0.5 } else { 1.0 };
        locks.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
        // Two ways to go with one thing, as a drift and a line with time: the larger counts.
        let mut named = Vec::new();
        locks.retain(|lock| {
            let first = !named.contains(&lock.to);
            named.push(lock.to);
            first
        });
        locks
    }

    fn position_cell(&self, course: &Course<'_>, k: usize) -> usize {
        ((course.position_um[k] / self.largest_um * CELLS as f64) as usize).min(CELLS - 1)
    }

    /// What averages over cells take: those of all records, beside a gain and a zero of each record's own, and those of the other
    /// records without. Both are less than what goes with the cells: gains may go with them as well, other errors are in the way.
    fn of_cells(&self, cell: impl Fn(&Course<'_>, usize) -> usize + Sync) -> [f64; 2] {
        [
            self.taken(|c| &c.bent_um, &cell, |_, _| 1.0).by_all,
            self.taken(|c| c.error_um, &cell, |_, _| 1.0).by_others,
        ]
    }

    /// What a least-squares gain on `x` in each cell takes.
    fn taken(
        &self,
        error: impl for<'c> Fn(&'c Course<'_>) -> &'c [f64] + Sync,
        cell: impl Fn(&Course<'_>, usize) -> usize + Sync,
        x: impl Fn(&Course<'_>, usize) -> f64 + Sync,
    ) -> Taken {
        let of_record = |c: &Course<'_>| {
            let mut sums: Vec<[f64; 2]> = Vec::new();
            for (k, e) in error(c).iter().enumerate() {
                let at = cell(c, k);
                if at >= sums.len() {
                    sums.resize(at + 1, [0.0; 2]);
                }
                let x = x(c, k);
                sums[at][0] += c.weight * x * e;
                sums[at][1] += c.weight * x * x;
            }
            sums
        };
        let records: Vec<Vec<[f64; 2]>> = self.each.par_iter().map(of_record).collect();
        let mut all = vec![[0.0; 2]; records.iter().map(Vec::len).max().unwrap_or(0)];
        for own in &records {
            all.iter_mut()
                .zip(own)
                .for_each(|(a, b)| *a = [a[0] + b[0], a[1] + b[1]]);
        }
        let filled = all.iter().filter(|[_, square]| *square > 0.0);
        let mut taken = Taken {
            by_all: filled.map(|[product, square]| product * product / square).sum(),
            by_others: 0.0,
        };
        for own in &records {
            for ([product, square], [own_product, own_square]) in all.iter().zip(own) {
                let others = square - own_square;
                if others > 1e-9 * square {
                    let gain = (product - own_product) / others;
                    taken.by_others += gain * (2.0 * own_product - gain * own_square);
                }
            }
        }
        taken
    }

    /// What drifts and jumps take that do not repeat with the drive.
    fn of_time(&self) -> f64 {
        self.each.par_iter().map(|c| c.weight * c.moved_in_time()).sum()
    }

    /// What a gain takes that changes with the cycles since a record's start, beyond a constant one.
    fn of_cycles(&self) -> f64 {
        let gain = |c: &Course<'_>, k: usize| c.position_um[k];
        let changing = self.taken(|c| c.error_um, |c, k| usize::from(c.cycle_cell[k]), gain);
        changing.by_all - self.taken(|c| c.error_um, |_, _| 0, gain).by_all
    }

    /// What a gain and a zero take that differ from record to record, and what of it follows their order, the temperature or the
    /// other axis' voltage.
    fn of_records(&self) -> Vec<Lock> {
        let moving: Vec<&Course<'_>> = self.each.iter().filter(|c| c.moves()).collect();
        let m = moving.len();
        let mut locks = Vec::new();
        // A parabola has two coefficients beside the constant: fewer records would always follow one.
        if m < 5 {
            return locks;
        }
        let constant = left(&moving, 0, |_, _| 0.0);
        let own: f64 = moving.iter().map(|c| c.weight * squares(&c.bent_um)).sum();
        let mut following = |to: LockTo, degree: usize, q: &(dyn Fn(usize, usize) -> f64 + Sync)| {
            let with = left(&moving, degree, q);
            // Gains and zeros in no order follow a polynomial by this share of what they take.
            let by_chance = degree as f64 / (m - 1) as f64;
            let share = (constant - with) - by_chance / (1.0 - by_chance) * (with - own).max(0.0);
            locks.push(Lock::new(to, share.max(0.0)));
            share.max(0.0)
        };
        let in_order = following(LockTo::RecordOrder, 2, &|i, _| i as f64 / (m - 1) as f64);
        if moving.iter().all(|c| c.trace.temperature_c.is_some()) {
            let temperature = |i: usize, k: usize| {
                moving[i]
                    .trace
                    .temperature_c
                    .as_ref()
                    .map_or(0.0, |t| t[moving[i].trace.from + k])
            };
            let first = temperature(0, 0);
            following(LockTo::Temperature, 1, &|i, k| temperature(i, k) - first);
        }
        locks.push(Lock::new(LockTo::Record, (constant - own - in_order).max(0.0)));
        locks
    }

    /// What averages over the other axis' voltage take.
    fn of_other_axis(&self) -> Option<Lock> {
        let cell = |c: &Course<'_>, k: usize| {
            let drive = c.trace.drive2.as_ref().map(|v| v[c.trace.from + k]);
            drive.map_or(0, |v| 1 + ((v + 1.0) / 2.0 * OTHER_CELLS as f64) as usize)
        };
        let known = self.each.iter().any(|c| c.trace.drive2.is_some());
        known.then(|| Lock::new(LockTo::OtherAxis, self.of_cells(cell)[0]))
    }
}

/// Weighted squared error beside a gain and a zero that are polynomials of a quantity (record, sample), the same for all records.
fn left(courses: &[&Course<'_>], degree: usize, quantity: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
    let of_record = |(i, c): (usize, &&Course<'_>)| {
        let every = c.len().div_ceil(ROWS).max(1);
        let rows: Vec<usize> = (0..c.len()).step_by(every).collect();
        let target = DVector::from_iterator(rows.len(), rows.iter().map(|&k| c.error_um[k]));
        let columns = DMatrix::from_fn(rows.len(), 2 * (degree + 1), |row, column| {
            let k = rows[row];
            let factor = if column % 2 == 0 { 1.0 } else { c.position_um[k] };
            factor * quantity(i, k).powi(column as i32 / 2)
        });
        (
            Gram::new(&columns, &target),
            c.weight * c.len() as f64 / rows.len() as f64,
        )
    };
    let grams: Vec<(Gram, f64)> = courses.par_iter().enumerate().map(of_record).collect();
    let mut all = Gram::zeros(2 * (degree + 1));
    grams.iter().for_each(|(gram, weight)| all.add(gram, *weight));
    all.squared_error(&all.solve(0, 0.0, &[]))
}

impl<'a> Course<'a> {
    fn new(trace: &'a Trace, error_um: &'a [f64], traces: &Traces) -> Self {
        let stroke_um = if trace.stroke_um > 0.0 {
            trace.stroke_um
        } else {
            traces.stroke_um
        };
        let measured = &trace.position_um[trace.from..];
        let position_um: Vec<f64> = measured.iter().zip(error_um).map(|(y, e)| y - e).collect();
        let period = period::detect(&trace.drive[trace.from..]);
        Self {
            trace,
            error_um,
            unrepeated_um: period.map_or_else(|| error_um.to_vec(), |period| unrepeated(error_um, period)),
            bent_um: beside_a_line(error_um, &position_um),
            position_um,
            cycle_cell: cycle_cells(&trace.drive[trace.from..]),
            period,
            weight: 1.0 / (stroke_um.max(f64::MIN_POSITIVE).powi(2) * error_um.len() as f64),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.error_um.len()
    }

    pub(crate) fn moves(&self) -> bool {
        self.trace.stroke_um > 0.0
    }

    /// Speed of the position without the error, micrometres a second.
    pub(crate) fn speed(&self, k: usize) -> f64 {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(self.len() - 1));
        let way_um = self.position_um[after] - self.position_um[before];
        way_um / ((after - before).max(1) as f64 * self.trace.period_s)
    }

    /// Squared error that goes with time: means of periods and what slowly changes within them, or of parts of the record.
    fn moved_in_time(&self) -> f64 {
        let mean = self.error_um.iter().sum::<f64>() / self.len() as f64;
        let part = self.len().div_ceil(TIME_CELLS);
        let Some(period) = self.period.filter(|_| self.moves()) else {
            let centred: Vec<f64> = self.error_um.iter().map(|e| e - mean).collect();
            return of_parts(&centred, part);
        };
        let mut moved = 0.0;
        let mut rest = self.unrepeated_um[period.from..].to_vec();
        // A gain that changes is no drift: it is taken out of each period together with the mean, and does not count.
        let positions = self.position_um[period.from..].chunks(period.samples);
        for (own, position) in rest.chunks_mut(period.samples).zip(positions) {
            moved += own.iter().sum::<f64>().powi(2) / own.len() as f64;
            let beside = beside_a_line(own, position);
            own.copy_from_slice(&beside);
        }
        moved + of_parts(&rest, part)
    }
}

/// Cells of cycles since a drive's start, the way it went over twice its whole range of -1 to 1.
fn cycle_cells(drive: &[f64]) -> Vec<u8> {
    let mut way = 0.0;
    let mut before = drive.first().copied().unwrap_or(0.0);
    let cell = |v: &f64| {
        way += (v - before).abs();
        before = *v;
        CYCLES.partition_point(|&cycles| cycles < way / 4.0) as u8
    };
    drive.iter().map(cell).collect()
}

/// Cells of [`speed_cell`].
const SPEEDS: usize = 2 * (SPEED_CELLS * SPEED_DECADES) as usize + 1;

/// Cell of a speed relative to the fastest, by decades on either side of rest.
fn speed_cell(relative: f64) -> usize {
    let decades = (relative.abs().log10() + SPEED_DECADES).max(0.0);
    let step = ((decades * SPEED_CELLS).ceil() as usize).min(SPEEDS / 2);
    if relative < 0.0 {
        SPEEDS / 2 - step
    } else {
        SPEEDS / 2 + step
    }
}

/// An error without its mean course over the periods of the drive; as it is before the drive repeats.
fn unrepeated(error_um: &[f64], period: Periodic) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); period.samples];
    for (k, e) in error_um[period.from..].iter().enumerate() {
        let (sum, count) = &mut sums[k % period.samples];
        (*sum, *count) = (*sum + e, *count + 1.0);
    }
    let mut left = error_um.to_vec();
    for (k, e) in left[period.from..].iter_mut().enumerate() {
        let (sum, count) = sums[k % period.samples];
        *e -= sum / count;
    }
    left
}

/// An error without its mean and its slope over the position.
fn beside_a_line(error_um: &[f64], position_um: &[f64]) -> Vec<f64> {
    let mean = |own: &[f64]| own.iter().sum::<f64>() / own.len().max(1) as f64;
    let (e0, y0) = (mean(error_um), mean(position_um));
    let (mut product, mut square) = (0.0, f64::MIN_POSITIVE);
    for (e, y) in error_um.iter().zip(position_um) {
        product += (e - e0) * (y - y0);
        square += (y - y0).powi(2);
    }
    let slope = product / square;
    error_um
        .iter()
        .zip(position_um)
        .map(|(e, y)| e - e0 - slope * (y - y0))
        .collect()
}

/// Squares that the means of parts take.
fn of_parts(own: &[f64], part: usize) -> f64 {
    own.chunks(part.max(1))
        .map(|c| c.iter().sum::<f64>().powi(2) / c.len() as f64)
        .sum()
}

pub(crate) fn squares(own: &[f64]) -> f64 {
    own.iter().map(|e| e * e).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::witness::made::{noise, traces};
    use hysteron_data::Record;
    use std::f64::consts::TAU;

    /// The locks of an error beside white noise of 2 nm.
    fn locks_of(error_um: impl Fn(usize, usize, &Record) -> f64) -> Vec<Lock> {
        let (traces, errors) = traces(|i, record| {
            let mut noise = noise(i as u64);
            (0..record.len())
                .map(|k| error_um(i, k, record) + 2e-3 * noise())
                .collect()
        });
        Courses::new(&traces, errors.iter().map(Vec::as_slice)).locks()
    }

    /// Of a record at a sample.
    type Error<'a> = &'a dyn Fn(usize, usize, &Record) -> f64;

    /// As a fitted model leaves them: no gain and no zero that all records share.
    #[test]
    fn val_an_error_goes_with_what_makes_it() {
        let gain = |i: usize| 0.01 * (i as f64 / 7.0 - 0.5);
        let scattered = |i: usize| -> f64 { [0.004, -0.006, 0.005, -0.003, 0.006, 0.004, -0.007, -0.005][i] };
        let cases: [(LockTo, Error<'_>); 8] = [
            (LockTo::Position, &|_, k, r| 0.02 * (TAU * r.position_um[k] / 1.3).sin()),
            (LockTo::Speed, &|_, k, r| {
                let speed = (r.voltage_v[k] - r.voltage_v[k.saturating_sub(1)]) / r.period_s;
                1e-3 * speed.signum() * speed.abs().sqrt()
            }),
            (LockTo::PositionAndSpeed, &|_, k, r| {
                let speed = (r.voltage_v[k] - r.voltage_v[k.saturating_sub(1)]).signum();
                0.02 * speed * (TAU * r.position_um[k] / 2.5).sin()
            }),
            (LockTo::Time, &|i, k, _| {
                0.1 * scattered(i).signum() * ((k as f64 / 12_000.0).powi(2) - 1.0 / 3.0)
            }),
            (LockTo::CycleCount, &|_, k, r| {
                let cycles = k as f64 / 2000.0 * r.voltage_v[1000] / 100.0;
                0.02 * r.position_um[k] * ((-cycles / 1.5).exp() - 0.35)
            }),
            (LockTo::RecordOrder, &|i, k, r| gain(i) * r.position_um[k]),
            (LockTo::Record, &|i, k, r| scattered(i) * r.position_um[k]),
            (LockTo::Time, &|_, k, r| {
                0.02 * (TAU * 173.2 * k as f64 * r.period_s).sin()
            }),
        ];
        for (to, error_um) in cases {
            let locks = locks_of(error_um);
            assert_eq!(locks[0].to, to, "{locks:?}");
            assert!(locks[0].share > 0.5, "{locks:?}");
        }
    }

    #[test]
    fn val_a_line_has_its_frequency() {
        let locks = locks_of(|_, k, r| 0.02 * (TAU * 173.2 * k as f64 * r.period_s + 0.3).sin());
        let (hz, share) = (locks[0].parameters[0].value, locks[0].share);
        assert!((hz - 173.2).abs() < 0.02, "{hz}");
        assert!(share > 0.95, "{share}");
    }

    /// White noise goes with nothing.
    #[test]
    fn val_noise_goes_with_nothing() {
        let locks = locks_of(|_, _, _| 0.0);
        assert!(locks.iter().all(|lock| lock.share < 0.05), "{locks:?}");
    }

    /// Nothing is left: there is nothing to go with anything, and no share of 0 / 0.
    #[test]
    fn bva_no_error_no_lock() {
        let (traces, errors) = traces(|_, record| vec![0.0; record.len()]);
        assert!(
            Courses::new(&traces, errors.iter().map(Vec::as_slice))
                .locks()
                .is_empty()
        );
    }
}
