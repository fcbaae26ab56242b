//! A fitted chain judged: what it leaves of each record, and what it would leave of a part that took no part in the fit.

use super::chosen_states;
use super::fitted::{Fitted, Known, Look, Tangent};
use super::records::Prepared;
use super::system::within_bounds;
use crate::effects::{Bounds, EffectName, Family};
use crate::normal::Normal;
use crate::start_state::InitialState;
use nalgebra::DVector;
use rayon::prelude::*;

/// How strongly a free shape may be held to a smooth one, chosen by leaving out one part at a time: a departure of a tenth
/// of the stroke under the first, and of a thousandth under the last, costs what each record costs with what is left of it.
const RIDGES: [f64; 5] = [1e2, 1e3, 1e4, 1e5, 1e6];

/// What families that are linear in their plays get: nothing but what rounding needs.
const LINEAR_RIDGE: f64 = 1e-12;

/// An error of a part that took no part in the fit counts at most so many times that when it does: what only one record shows
/// (the highest rate, the longest hold) cannot be foretold from the others, with or without an effect.
const MOST_HELD_OUT: f64 = 4.0;

/// What a hysteresis of free shape leaves where much is missing, share of the stroke: a record that is left with less is worth no more
/// than one with this.
const COARSENESS: f64 = 2e-3;

/// Smaller strokes than this share of the largest are reckoned with as if they were this share.
const SMALLEST_STROKE: f64 = 0.1;

/// A part of a record that is judged at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Index of the record.
    pub record: usize,
    /// Mean square of what is left where the part takes no part in the fit, square micrometres.
    pub held_out_um2: f64,
    /// The same as it is fitted (or foretold, where its record is not fitted).
    pub fitted_um2: f64,
    /// Samples of what is left that count as independent.
    pub independent: f64,
}

/// A chain, fitted and judged.
#[derive(Clone)]
pub struct Trial {
    pub(super) fitted: Fitted,
    /// Weight of each record's mean square that it was fitted under.
    pub(super) weights: Vec<f64>,
    /// Normal equations of each part of the fitted records, around the point.
    pub(super) systems: Vec<(usize, Normal)>,
    /// The states of the records that it was fitted in, where they are others than the search's.
    pub(super) states: Option<Vec<InitialState>>,
    /// The parts, in the order of the records.
    pub parts: Vec<Part>,
    /// Mean square of what is left of each record, square micrometres.
    pub left_um2: Vec<f64>,
}

/// Measured and modelled of one record at the rows of a comparison.
struct OfRecord {
    systems: Vec<Normal>,
    /// What the point before the last step leaves of it, mean square.
    left_um2: f64,
}

/// Fits a chain to all rows from a point near the bottom of its valley, ridge chosen and weights taken from what it leaves, and
/// judges it. `same_ridge` keeps the ridge of the point.
pub(super) fn judge(
    records: &[Prepared<'_>],
    point: Fitted,
    weights: &[f64],
    noise_um: f64,
    same_ridge: bool,
) -> Trial {
    let of_records: Vec<OfRecord> = records
        .par_iter()
        .enumerate()
        .map(|(i, record)| {
            if !record.fits {
                return OfRecord {
                    systems: Vec::new(),
                    left_um2: 0.0,
                };
            }
            let Tangent {
                columns,
                target,
                residual,
            } = point.tangent(record, i, Look::All, true, Known::default());
            let of_part = |part: &std::ops::Range<usize>| {
                let rows = columns.rows(part.start, part.len()).into_owned();
                Normal::of_columns(&rows, &target.rows(part.start, part.len()).into_owned())
            };
            OfRecord {
                systems: record.parts.iter().map(of_part).collect(),
                left_um2: mean_square(&residual),
            }
        })
        .collect();
    let systems: Vec<(usize, Normal)> = of_records
        .iter()
        .enumerate()
        .flat_map(|(i, of)| of.systems.iter().map(move |system| (i, system.clone())))
        .collect();
    let mut pool = Pool {
        systems: &systems,
        rows: records.iter().map(|record| record.rows.len().max(1)).collect(),
        weights: weights.to_vec(),
        floor_um2: floors_um2(records, noise_um),
        noise_um,
        point: &point,
    };
    let ridge = match point.chain.design.family {
        family if family.is_free() && !same_ridge => pool.best_ridge(),
        family if family.is_free() => point.ridge,
        _ => LINEAR_RIDGE,
    };
    let mut solution = pool.solve(ridge);
    for _ in 0..2 {
        pool.reweigh(&solution);
        solution = pool.solve(ridge);
    }
    let held_out = pool.held_out(&solution, ridge);
    let (weights, floor_um2) = (pool.weights.clone(), pool.floor_um2.clone());
    let mut fitted = point.moved_by(&solution);
    fitted.ridge = ridge;
    let mut residuals = residuals(records, &fitted);
    // Effects bend the error's valley: a step to where its tangents have their bottom may go up.
    let after = logarithms(records, &floor_um2, |i| mean_square(&residuals[i]));
    let before = if fitted.chain.linear() {
        let held = pool.held(&solution, ridge);
        let left = pool.left_um2(&held);
        let before = logarithms(records, &floor_um2, |i| left[i].unwrap_or(0.0));
        (after > before + UPHILL).then(|| point.moved_by(&held))
    } else {
        let before = logarithms(records, &floor_um2, |i| of_records[i].left_um2);
        (after > before).then(|| point.clone())
    };
    if let Some(before) = before {
        fitted = Fitted { ridge, ..before };
        residuals = self::residuals(records, &fitted);
    }
    conclude(records, fitted, weights, systems, &residuals, held_out)
}

/// Rise of the sum of logarithms from which a last step is taken back: the squared error of one record by a tenth.
const UPHILL: f64 = 0.1;

/// Sum of the logarithms of what is left of the fitted records.
pub(super) fn logarithms(records: &[Prepared<'_>], floor_um2: &[f64], left_um2: impl Fn(usize) -> f64) -> f64 {
    let taking_part = (0..records.len()).filter(|&i| records[i].fits);
    taking_part.map(|i| (floor_um2[i] + left_um2(i)).ln()).sum()
}

fn mean_square(residual: &DVector<f64>) -> f64 {
    residual.norm_squared() / residual.len().max(1) as f64
}

/// Measured minus modelled at the rows of each record.
fn residuals(records: &[Prepared<'_>], fitted: &Fitted) -> Vec<DVector<f64>> {
    let each = records.par_iter().enumerate();
    each.map(|(i, record)| residual(record, i, fitted)).collect()
}

fn residual(record: &Prepared<'_>, i: usize, fitted: &Fitted) -> DVector<f64> {
    let modelled = fitted.modelled(record, i);
    let measured = &record.record().position_um;
    let left = record.rows.iter().map(|&k| measured[k] - modelled[k]);
    DVector::from_iterator(record.rows.len(), left)
}

fn conclude(
    records: &[Prepared<'_>],
    fitted: Fitted,
    weights: Vec<f64>,
    systems: Vec<(usize, Normal)>,
    residuals: &[DVector<f64>],
    held_out: Vec<[f64; 2]>,
) -> Trial {
    let mut held_out = held_out.into_iter();
    let mut parts = Vec::new();
    for (i, (record, residual)) in records.iter().zip(residuals).enumerate() {
        for part in &record.parts {
            let own = residual.rows(part.start, part.len());
            let fitted_um2 = own.norm_squared() / part.len().max(1) as f64;
            // Held out and fitted as the normal equations see them: their ratio, on what is really left.
            let ratio = match record.fits.then(|| held_out.next()).flatten() {
                Some([out, fitted]) if fitted > 0.0 => (out / fitted).clamp(1.0, MOST_HELD_OUT),
                _ => 1.0,
            };
            parts.push(Part {
                record: i,
                held_out_um2: ratio * fitted_um2,
                fitted_um2,
                independent: independent(own.as_slice()),
            });
        }
    }
    let left_um2 = residuals.iter().map(mean_square).collect();
    Trial {
        fitted,
        weights,
        systems,
        states: None,
        parts,
        left_um2,
    }
}

fn floors_um2(records: &[Prepared<'_>], noise_um: f64) -> Vec<f64> {
    let largest_um = records.iter().map(|record| record.stroke_um).fold(0.0, f64::max);
    let of = |record: &Prepared<'_>| COARSENESS * record.stroke_um.max(SMALLEST_STROKE * largest_um);
    records
        .iter()
        .map(|record| noise_um.powi(2) + of(record).powi(2))
        .collect()
}

/// Normal equations of all parts, to be pooled without any one of them at next to no cost.
struct Pool<'p> {
    systems: &'p [(usize, Normal)],
    rows: Vec<usize>,
    weights: Vec<f64>,
    /// What no record's weight goes beyond.
    floor_um2: Vec<f64>,
    noise_um: f64,
    point: &'p Fitted,
}

impl Pool<'_> {
    fn weight(&self, record: usize) -> f64 {
        self.weights[record] / self.rows[record] as f64
    }

    /// All parts, each by the weight of its record.
    fn sum(&self) -> Normal {
        let mut sum = Normal::new(self.point.coefficients.len() + self.point.parameters());
        for (record, system) in self.systems {
            sum.add_scaled(system, self.weight(*record));
        }
        sum
    }

    fn solve(&self, ridge: f64) -> Vec<f64> {
        self.solve_sum(&self.sum(), ridge)
    }

    fn solve_sum(&self, sum: &Normal, ridge: f64) -> Vec<f64> {
        let n = self.point.coefficients.len();
        within_bounds(sum, n, self.point.held_by(ridge), 1e-9, &self.point.flat()).unwrap_or_else(|| {
            let mut stay = self.point.coefficients.clone();
            stay.resize(n + self.point.parameters(), 0.0);
            stay
        })
    }

    /// The solution with the parameters of the effects where they are.
    fn held(&self, solution: &[f64], ridge: f64) -> Vec<f64> {
        let n = self.point.coefficients.len();
        let sum = self.sum();
        let held: Vec<(Bounds, f64)> = self
            .point
            .flat()
            .iter()
            .map(|&(_, at)| (Bounds::fixed(at), at))
            .collect();
        let mut held =
            within_bounds(&sum, n, self.point.held_by(ridge), 1e-9, &held).unwrap_or_else(|| solution.to_vec());
        held[n..].fill(0.0);
        held
    }

    /// What a solution leaves of each record that takes part, mean square.
    fn left_um2(&self, solution: &[f64]) -> Vec<Option<f64>> {
        let mut sums = vec![(0.0, 0_usize); self.weights.len()];
        for (record, system) in self.systems {
            sums[*record].0 += system.squared_error(solution);
            sums[*record].1 += system.samples;
        }
        sums.into_iter()
            .map(|(squares, rows)| (rows > 0).then(|| squares / rows as f64))
            .collect()
    }

    fn mean_square(&self, part: usize, solution: &[f64]) -> f64 {
        let system = &self.systems[part].1;
        system.squared_error(solution) / system.samples.max(1) as f64
    }

    /// Each record weighed by what is left of it.
    fn reweigh(&mut self, solution: &[f64]) {
        let left_um2 = self.left_um2(solution);
        let records = self.weights.iter_mut().zip(&self.floor_um2).zip(left_um2);
        for ((weight, floor_um2), left_um2) in records {
            if let Some(left_um2) = left_um2 {
                *weight = 1.0 / (floor_um2 + left_um2);
            }
        }
    }

    /// The ridge under which the parts forecast each other best.
    fn best_ridge(&self) -> f64 {
        let all = self.sum();
        let errors: Vec<[f64; RIDGES.len()]> = (0..self.systems.len())
            .into_par_iter()
            .map(|out| {
                let (record, system) = &self.systems[out];
                let mut others = all.clone();
                others.add_scaled(system, -self.weight(*record));
                RIDGES.map(|ridge| {
                    let x = self.solve_sum(&others, ridge);
                    // The logarithm: where an effect is missing, the records that it spoils must not choose for the others.
                    (self.noise_um.powi(2) + self.mean_square(out, &x)).ln()
                })
            })
            .collect();
        let error = |k: usize| errors.iter().map(|each| each[k]).sum::<f64>();
        let best = (0..RIDGES.len()).min_by(|&a, &b| error(a).total_cmp(&error(b)));
        RIDGES[best.unwrap_or(2)]
    }

    /// Mean square of each part where it takes no part in the fit, and where it does.
    fn held_out(&self, solution: &[f64], ridge: f64) -> Vec<[f64; 2]> {
        let all = self.sum();
        (0..self.systems.len())
            .into_par_iter()
            .map(|out| {
                let (record, system) = &self.systems[out];
                let fitted = self.mean_square(out, solution);
                if self.systems.len() == 1 {
                    return [fitted; 2];
                }
                let mut others = all.clone();
                others.add_scaled(system, -self.weight(*record));
                [self.mean_square(out, &self.solve_sum(&others, ridge)), fitted]
            })
            .collect()
    }
}

/// `n / (1 + 2 sum rho)`, the sum up to where the autocorrelation first falls below a twentieth.
fn independent(residual: &[f64]) -> f64 {
    let n = residual.len();
    if n < 8 {
        return n as f64;
    }
    let mean = residual.iter().sum::<f64>() / n as f64;
    let centred: Vec<f64> = residual.iter().map(|r| r - mean).collect();
    let variance: f64 = centred.iter().map(|r| r * r).sum();
    if variance <= 0.0 {
        return n as f64;
    }
    let mut sum = 0.0;
    for lag in 1..n / 4 {
        let rho = centred[lag..].iter().zip(&centred).map(|(a, b)| a * b).sum::<f64>() / variance;
        if rho < 0.05 {
            break;
        }
        sum += rho;
    }
    (n as f64 / (1.0 + 2.0 * sum)).max(2.0)
}

impl Trial {
    /// Chooses the states of the records without part in the fit under the chain of this trial, where they are asked for, and judges
    /// these records in them; the states of all. Plays that a state of other coefficients has set aside shift such a record as a whole.
    pub(super) fn start_held_out(
        &mut self,
        records: &[Prepared<'_>],
        asked: impl Fn(usize) -> bool + Sync,
    ) -> Vec<InitialState> {
        let states = chosen_states(records, &self.fitted, |i, record| !record.fits && asked(i));
        for (i, (record, &state)) in records.iter().zip(&states).enumerate() {
            if state == record.initial() {
                continue;
            }
            let mut record = record.clone();
            record.start_in(state);
            let residual = residual(&record, i, &self.fitted);
            self.left_um2[i] = mean_square(&residual);
            for part in self.parts.iter_mut().filter(|part| part.record == i) {
                part.fitted_um2 = self.left_um2[i];
                part.held_out_um2 = self.left_um2[i];
                part.independent = independent(residual.as_slice());
            }
        }
        states
    }

    /// Family of the hysteresis.
    pub fn family(&self) -> Family {
        self.fitted.chain.design.family
    }

    /// How strongly the hysteresis is held to a smooth shape; of a family that is linear in its plays, the ridge.
    pub fn ridge(&self) -> f64 {
        self.fitted.ridge
    }
}

impl super::Search<'_> {
    /// Error of a trial over the records that move, each relative to its stroke, percent of peak to peak (eq. 19): those with
    /// or without part in the fit.
    pub fn percent(&self, trial: &Trial, fitted: bool) -> Option<f64> {
        let squares: Vec<f64> = self
            .records
            .iter()
            .zip(&trial.left_um2)
            .filter(|(record, _)| record.moves() && record.fits == fitted)
            .map(|(record, left)| 1e4 * left / record.stroke_um.powi(2))
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }

    /// Error of a trial over all records that move, each relative to its stroke, every part as it is foretold from what took part in
    /// the fit without it, percent of peak to peak.
    pub fn held_out_percent(&self, trial: &Trial) -> f64 {
        let parts = trial.parts.iter().filter(|part| self.records[part.record].moves());
        let squares: Vec<f64> = parts
            .map(|part| 1e4 * part.held_out_um2 / self.records[part.record].stroke_um.powi(2))
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }

    /// Sum of the logarithms of what a trial leaves of the fitted parts, each foretold from the others.
    pub(super) fn foretold(&self, trial: &Trial) -> f64 {
        let fitted = trial.parts.iter().filter(|part| self.records[part.record].fits);
        fitted
            .map(|part| (self.noise_um.powi(2) + part.held_out_um2).ln())
            .sum()
    }

    /// What an effect does to the position that a trial models, over all records that move, each relative to its stroke, percent;
    /// `None` where the trial does not have it.
    pub fn does_percent(&self, trial: &Trial, effect: &EffectName) -> Option<f64> {
        let with = &trial.fitted;
        let link = with.chain.links.iter().position(|link| link.is(effect))?;
        let mut without = with.clone();
        without.chain.links.remove(link);
        without.bounds.remove(link);
        without.own.iter_mut().for_each(|own| drop(own.remove(link)));
        let moving: Vec<usize> = (0..self.records.len()).filter(|&i| self.records[i].moves()).collect();
        let squares: Vec<f64> = moving
            .into_par_iter()
            .map(|i| {
                let record = &self.records[i];
                let (with, without) = (with.modelled(record, i), without.modelled(record, i));
                let sum: f64 = record.rows.iter().map(|&k| (with[k] - without[k]).powi(2)).sum();
                1e4 * sum / record.rows.len().max(1) as f64 / record.stroke_um.powi(2)
            })
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }

    /// Both pooled.
    pub fn pooled_percent(&self, trial: &Trial) -> f64 {
        let both = [true, false].map(|fitted| self.percent(trial, fitted).map_or(0.0, |p| p * p));
        let count = [true, false]
            .iter()
            .filter(|&&fitted| self.percent(trial, fitted).is_some())
            .count();
        (both.iter().sum::<f64>() / count.max(1) as f64).sqrt()
    }
}
