//! Effects of the user's own among the candidates: the same equations that `add` fits, their parameters searched here.
//!
//! What such an effect does to the position is no column with a coefficient of its own: its parameters say how large it is.

use crate::missing::bench::{Bench, SEARCH_ROWS, Trial, solve_signed, target};
use crate::missing::chain::{self, Base, Effect, Shape};
use crate::missing::is_given;
use crate::missing::regression::Gram;
use crate::missing::traces::Trace;
use hysteron_identify::FittedEffect;
use hysteron_identify::effects::{Effect as _, Signals, UserEffect};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Places at which the parameters are tried that the position is not linear in: a ripple whose twentieth part of the stroke is
/// 5 % off runs out of step, and a decade has 46 of those.
const SCANNED: usize = 64;

/// Starts that are followed two steps down their valley, of each look.
const FOLLOWED: usize = 4;

/// Of those, how many go on to the bottom.
const FINISHED: usize = 2;

/// Steps to the bottom of a valley; the search has settled before, or runs along a flat one.
const STEPS: usize = 12;

/// Longest step, share of the way between a parameter's bounds: beyond it the straight line has no say.
const LONGEST: f64 = 0.2;

/// Step of derivatives, share of the bounds: a ripple of a thousandth of the bounds' pitch is still straight over it.
const APART: f64 = 1e-5;

/// An effect of the model's own chain.
pub(crate) fn given(fitted: &FittedEffect) -> Option<Effect> {
    let values = fitted.parameters.iter().map(|parameter| parameter.value).collect();
    fitted.own().map(|effect| Effect::User { effect, values })
}

fn signals<'a>(trace: &'a Trace, stack_v: &'a [f64], voltage2_v: Option<&'a [f64]>) -> Signals<'a> {
    Signals {
        period_s: trace.period_s,
        run_in: trace.from,
        rested: trace.rested,
        fraction: trace.fraction,
        at_stack_v: stack_v,
        temperature_c: trace.temperature_c.as_deref(),
        voltage2_v,
        own: &[],
    }
}

/// Voltage of the other axis, volts.
fn other_axis_v(trace: &Trace) -> Option<Vec<f64>> {
    let s = &trace.scales;
    let volts = |drive: &Vec<f64>| drive.iter().map(|x| s.middle2_v + s.unit2_v * x).collect();
    trace.drive2.as_ref().map(volts)
}

/// What effects before the hysteresis make of the drive, in place.
pub(crate) fn on_drive(effects: &[Effect], trace: &Trace, drive: &mut [f64]) {
    for effect in effects {
        if let Effect::User { effect, values } = effect
            && !effect.acts_on_position()
        {
            let s = &trace.scales;
            let other = other_axis_v(trace);
            drive.iter_mut().for_each(|x| *x = s.middle_v + s.unit_v * *x);
            effect.on_voltage(values, &signals(trace, &[], other.as_deref()), drive);
            drive.iter_mut().for_each(|v| *v = (*v - s.middle_v) / s.unit_v);
        }
    }
}

/// Effects behind the hysteresis, around a modelled position: what they make of it, and of small changes of it.
pub(crate) struct Bend<'a> {
    trace: &'a Trace,
    stack_v: Vec<f64>,
    other_axis_v: Option<Vec<f64>>,
    links: Vec<Link<'a>>,
    /// The position that comes out, micrometres.
    output_um: Vec<f64>,
}

struct Link<'a> {
    effect: UserEffect,
    values: &'a [f64],
    input_um: Vec<f64>,
    /// Where the output depends on the input at the same sample alone.
    slope: Option<Vec<f64>>,
}

impl<'a> Bend<'a> {
    /// None where there are no such effects, or no position yet.
    pub(crate) fn new(effects: &'a [Effect], trace: &'a Trace, reference_um: Option<&[f64]>) -> Option<Self> {
        let reference = reference_um?;
        let own: Vec<(UserEffect, &[f64])> = effects
            .iter()
            .filter_map(|effect| match effect {
                Effect::User { effect, values } if effect.acts_on_position() => Some((*effect, values.as_slice())),
                _ => None,
            })
            .collect();
        if own.is_empty() {
            return None;
        }
        let s = &trace.scales;
        let stack_v = if own.iter().any(|(effect, _)| effect.uses_stack_voltage()) {
            let drive = chain::drive_at_stack(effects, trace);
            drive.iter().map(|x| s.middle_v + s.unit_v * x).collect()
        } else {
            Vec::new()
        };
        let mut bend = Self {
            other_axis_v: other_axis_v(trace),
            trace,
            stack_v,
            links: Vec::new(),
            output_um: reference.iter().map(|y| y + s.middle_um).collect(),
        };
        for (effect, values) in own {
            let input_um = bend.output_um.clone();
            let mut link = Link {
                effect,
                values,
                input_um,
                slope: None,
            };
            if effect.is_pointwise() {
                let mut slope = vec![1.0; link.input_um.len()];
                effect.on_change(values, &bend.signals(), &link.input_um, &mut slope);
                link.slope = Some(slope);
            }
            let mut output = std::mem::take(&mut bend.output_um);
            effect.on_position(values, &bend.signals(), &mut output);
            bend.output_um = output;
            bend.links.push(link);
        }
        Some(bend)
    }

    fn signals(&self) -> Signals<'_> {
        signals(self.trace, &self.stack_v, self.other_axis_v.as_deref())
    }

    /// What becomes of a small change of the position.
    pub(crate) fn of_change(&self, change: &[f64]) -> Vec<f64> {
        let mut change = change.to_vec();
        for link in &self.links {
            match &link.slope {
                Some(slope) => change.iter_mut().zip(slope).for_each(|(c, s)| *c *= s),
                None => link
                    .effect
                    .on_change(link.values, &self.signals(), &link.input_um, &mut change),
            }
        }
        change
    }
}

/// What effects behind the hysteresis make of the position beyond what they make of the columns: `F(y) - F'(y) y` around
/// the position `y` modelled before; `None` where there are none.
pub(crate) fn beyond(effects: &[Effect], trace: &Trace, reference_um: Option<&[f64]>) -> Option<Vec<f64>> {
    let bend = Bend::new(effects, trace, reference_um)?;
    let linear = bend.of_change(reference_um?);
    let pairs = bend.output_um.iter().zip(linear);
    Some(pairs.map(|(y, l)| y - trace.scales.middle_um - l).collect())
}

/// Adds that to what the columns give.
pub(crate) fn add_beyond(effects: &[Effect], trace: &Trace, reference_um: Option<&[f64]>, modelled_um: &mut [f64]) {
    if let Some(beyond) = beyond(effects, trace, reference_um) {
        modelled_um.iter_mut().zip(beyond).for_each(|(y, b)| *y += b);
    }
}

/// The best form of every effect that is not there yet.
pub(crate) fn trials(
    bench: &Bench<'_>,
    current: &Trial,
    own: &[UserEffect],
    progress: &(dyn Fn(&str) + Sync),
) -> Vec<(&'static str, Trial)> {
    if bench.coarse.is_empty() {
        return Vec::new();
    }
    let absent = |effect: &&UserEffect| {
        let values = Vec::new();
        !is_given(
            &current.effects,
            &Effect::User {
                effect: **effect,
                values,
            },
        )
    };
    let try_one = |effect: &UserEffect| {
        progress(effect.description().name);
        let search = Search {
            bench,
            given: &current.effects,
            effect: *effect,
            columns: chain::width(&bench.base, &current.effects),
        };
        let found = search.best(current);
        let effects = search.with(&found.shares);
        // A strong effect bends so much that the fit must begin at the position which the search has found.
        let from = Trial {
            effects: effects.clone(),
            coefficients: found.coefficients,
            ..current.clone()
        };
        (
            effect.description().name,
            bench.referring_to(&from).fit_to_the_end(&effects),
        )
    };
    own.iter().filter(absent).map(try_one).collect()
}

/// The search for the parameters of one effect on a chain, all parameters as shares of the way between their bounds.
struct Search<'a> {
    bench: &'a Bench<'a>,
    given: &'a [Effect],
    effect: UserEffect,
    /// Columns of base and given effects; the effect has none of its own.
    columns: usize,
}

/// A point of the search: parameters, and the position of each record before the effect.
#[derive(Clone)]
struct Point {
    value: f64,
    shares: Vec<f64>,
    coefficients: DVector<f64>,
    /// Of the hysteresis alone, at the full rate.
    reference_um: Vec<Vec<f64>>,
    /// With all given effects, at the full rate.
    position_um: Vec<Vec<f64>>,
}

/// What a step leads to if everything were linear.
struct Ahead {
    shares: Vec<f64>,
    coefficients: DVector<f64>,
}

impl Search<'_> {
    fn with(&self, shares: &[f64]) -> Vec<Effect> {
        let mut effects = self.given.to_vec();
        effects.push(Effect::User {
            effect: self.effect,
            values: self.effect.values(shares),
        });
        effects
    }

    /// The bottom of the deepest valley that was found.
    fn best(&self, current: &Trial) -> Point {
        self.deepest(self.first_points(current)).swap_remove(0)
    }

    /// The bottoms of the valleys that go down deepest in the first steps, the deepest first.
    fn deepest(&self, mut points: Vec<Point>) -> Vec<Point> {
        for (count, steps) in [(usize::MAX, 2), (FINISHED, STEPS)] {
            points.truncate(count);
            points = points
                .into_par_iter()
                .with_max_len(1)
                .map(|point| self.descend(point, steps))
                .collect();
            points.sort_by(|a, b| a.value.total_cmp(&b.value));
        }
        points
    }

    /// The positions before the effect.
    fn positions(&self, effects: &[Effect], coefficients: &DVector<f64>) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let base = &self.bench.base;
        let all = chain::width(base, self.given);
        let each = self.bench.coarse.iter().map(|(_, trace)| {
            let reference = chain::simulate(base, effects, trace, None, coefficients, base.columns());
            // Without given effects the two are one.
            let position = if all == base.columns() {
                reference.clone()
            } else {
                chain::simulate(base, self.given, trace, Some(&reference), coefficients, all)
            };
            (reference, position)
        });
        each.unzip()
    }

    /// What the effect makes of the positions before it, at the rows of each record.
    fn modelled(&self, shares: &[f64], position_um: &[Vec<f64>]) -> Vec<DVector<f64>> {
        let (effect, values) = (self.effect, self.effect.values(shares));
        let effects = self.with(shares);
        let of_record = |((_, trace), position): (&(usize, Trace), &Vec<f64>)| {
            let s = &trace.scales;
            if !effect.acts_on_position() {
                return at_rows(position, trace);
            }
            let stack_v: Vec<f64> = if effect.uses_stack_voltage() {
                let drive = chain::drive_at_stack(&effects, trace);
                drive.iter().map(|x| s.middle_v + s.unit_v * x).collect()
            } else {
                Vec::new()
            };
            let other = other_axis_v(trace);
            let mut y: Vec<f64> = position.iter().map(|y| y + s.middle_um).collect();
            effect.on_position(&values, &signals(trace, &stack_v, other.as_deref()), &mut y);
            y.iter_mut().for_each(|y| *y -= s.middle_um);
            at_rows(&y, trace)
        };
        self.bench.coarse.iter().zip(position_um).map(of_record).collect()
    }

    /// As [`Bench::objective`], at given positions.
    fn value(&self, shares: &[f64], position_um: &[Vec<f64>]) -> f64 {
        let modelled = self.modelled(shares, position_um);
        let pairs = self.bench.coarse.iter().zip(modelled);
        pairs
            .map(|((_, trace), modelled)| {
                let rows = trace.rows.len().max(1) as f64;
                let mean = (target(trace, &[], None) - modelled).norm_squared() / rows;
                rows / SEARCH_ROWS as f64 * (self.bench.noise_um.powi(2) + mean).ln()
            })
            .sum()
    }

    /// Where descents begin: the best starts seen from the free shape, and, for an effect on the position, the bottoms seen from
    /// a stiff one. A free shape bends with a ripple of the reading, and the position before it is then off by its pitch.
    fn first_points(&self, current: &Trial) -> Vec<Point> {
        let mut points = self.quick_look(&current.coefficients);
        if self.effect.acts_on_position() {
            points.extend(self.seen_from_stiff(current));
        }
        points
    }

    /// The bottoms of the deepest valleys beside a stiff hysteresis, which does not bend with the effect.
    fn seen_from_stiff(&self, current: &Trial) -> Vec<Point> {
        let mut bench = self.bench.clone();
        bench.base = Base {
            shape: Shape::Stiff,
            thresholds: self.bench.base.thresholds.iter().copied().step_by(3).collect(),
            ridge: 1e-9,
        };
        let columns = chain::width(&bench.base, self.given);
        let pooled = bench.pooled(&bench.grams_of_identify(self.given), columns);
        let coefficients = solve_signed(&pooled, &bench.base, self.given);
        let stiff = Search {
            bench: &bench,
            columns,
            ..*self
        };
        let mut points = stiff.deepest(stiff.quick_look(&coefficients));
        for point in &mut points {
            point.value = f64::INFINITY;
            point.coefficients.clone_from(&current.coefficients);
        }
        points
    }

    /// Starts in the order of what their change of the modelled position takes of the squared error, up to a factor and
    /// everything that is linear fitted anew.
    fn quick_look(&self, x: &DVector<f64>) -> Vec<Point> {
        let bench = self.bench;
        let weight = |(i, trace): &(usize, Trace)| (bench.weights[*i] / trace.rows.len().max(1) as f64).sqrt();
        let stack = |parts: Vec<DVector<f64>>| -> DVector<f64> {
            let weighted = bench
                .coarse
                .iter()
                .zip(parts)
                .map(|(record, part)| part * weight(record));
            DVector::from_vec(weighted.flat_map(|part| part.data.as_vec().clone()).collect())
        };
        let plain: Vec<DMatrix<f64>> = bench
            .coarse
            .iter()
            .map(|(i, trace)| chain::matrix(&bench.base, self.given, trace, bench.reference(*i)))
            .collect();
        let rows: usize = plain.iter().map(DMatrix::nrows).sum();
        let mut stacked = DMatrix::zeros(rows, x.len());
        let mut from = 0;
        for (record, matrix) in bench.coarse.iter().zip(&plain) {
            stacked
                .rows_mut(from, matrix.nrows())
                .copy_from(&(matrix * weight(record)));
            from += matrix.nrows();
        }
        let basis = stacked.qr().q();
        let beyond = |v: DVector<f64>| {
            let explained = &basis * basis.tr_mul(&v);
            v - explained
        };
        let (reference_um, position_um) = self.positions(self.given, x);
        let modelled = stack(plain.iter().map(|matrix| matrix * x).collect());
        let measured = bench
            .coarse
            .iter()
            .map(|(i, t)| target(t, self.given, bench.reference(*i)));
        let left = beyond(stack(measured.collect()) - &modelled);
        let with = |values: &[f64]| {
            let shares = self.effect.shares(values);
            stack(if self.effect.acts_on_position() {
                self.modelled(&shares, &position_um)
            } else {
                self.modelled(&shares, &self.positions(&self.with(&shares), x).1)
            })
        };
        let mut starts = self.effect.starts();
        let linear = starts
            .first()
            .map_or_else(Vec::new, |values| self.linear(values, &with));
        if !linear.is_empty() {
            starts.truncate(SCANNED);
        }
        let mut scored: Vec<(f64, Vec<f64>)> = starts
            .into_par_iter()
            .map(|values| {
                let (taken, values) = if linear.is_empty() {
                    let change = beyond(with(&values) - &modelled);
                    let squares = change.norm_squared();
                    let share = if squares > 0.0 {
                        change.dot(&left).powi(2) / squares
                    } else {
                        0.0
                    };
                    (share, values)
                } else {
                    let (lacking, values) = self.best_linear(values, &linear, &with, &beyond, &left, &modelled);
                    (left.norm_squared() - lacking, values)
                };
                (taken, self.effect.shares(&values))
            })
            .collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        scored.truncate(FOLLOWED);
        let point = |(_, shares): (f64, Vec<f64>)| Point {
            value: f64::INFINITY,
            shares,
            coefficients: x.clone(),
            reference_um: reference_um.clone(),
            position_um: position_um.clone(),
        };
        scored.into_iter().map(point).collect()
    }

    /// The parameters in which the position is linear, zero among their values.
    fn linear(&self, values: &[f64], with: &(dyn Fn(&[f64]) -> DVector<f64> + Sync)) -> Vec<usize> {
        let n = values.len();
        let (lowest, most) = (self.effect.values(&vec![0.0; n]), self.effect.values(&vec![1.0; n]));
        let mut zero = values.to_vec();
        let mut linear = Vec::new();
        let same = |a: &DVector<f64>, b: &DVector<f64>| (a - b).norm() <= 1e-9 * a.norm();
        for j in (0..n).filter(|&j| lowest[j] <= 0.0 && most[j] > 0.0) {
            let at = |value: f64| {
                let mut values = values.to_vec();
                values[j] = value;
                with(&values)
            };
            let none = at(0.0);
            if same(&(at(most[j]) - &none), &(2.0 * (at(0.5 * most[j]) - &none))) {
                zero[j] = 0.0;
                linear.push(j);
            }
        }
        // Linear in each is not yet linear in all: a product of two is linear in either.
        let none = with(&zero);
        let (mut all, mut sum) = (zero.clone(), DVector::zeros(none.len()));
        for &j in &linear {
            let mut one = zero.clone();
            (one[j], all[j]) = (most[j], most[j]);
            sum += with(&one) - &none;
        }
        if linear.len() > 1 && !same(&(with(&all) - &none), &sum) {
            linear.truncate(1);
        }
        linear
    }

    /// What is lacking with the linear parameters at their best within their bounds, and all values.
    fn best_linear(
        &self,
        mut values: Vec<f64>,
        linear: &[usize],
        with: &(dyn Fn(&[f64]) -> DVector<f64> + Sync),
        beyond: &(dyn Fn(DVector<f64>) -> DVector<f64> + Sync),
        left: &DVector<f64>,
        modelled: &DVector<f64>,
    ) -> (f64, Vec<f64>) {
        let n = values.len();
        let (lowest, most) = (self.effect.values(&vec![0.0; n]), self.effect.values(&vec![1.0; n]));
        linear.iter().for_each(|&j| values[j] = 0.0);
        let none = with(&values);
        let lacking = left - beyond(&none - modelled);
        let columns: Vec<DVector<f64>> = linear
            .iter()
            .map(|&j| {
                let mut one = values.clone();
                one[j] = most[j];
                beyond(with(&one) - &none) / most[j]
            })
            .collect();
        let columns = DMatrix::from_columns(&columns);
        let Ok(best) = columns.clone().svd(true, true).solve(&lacking, 1e-9) else {
            return (f64::INFINITY, values);
        };
        for (&j, value) in linear.iter().zip(&best) {
            values[j] = value.clamp(lowest[j], most[j]);
        }
        let chosen = DVector::from_iterator(linear.len(), linear.iter().map(|&j| values[j]));
        ((lacking - columns * chosen).norm_squared(), values)
    }

    /// Gauss-Newton steps within the bounds, in parameters and positions at once.
    fn descend(&self, start: Point, steps: usize) -> Point {
        let mut here = start;
        for _ in 0..steps {
            let ahead = self.ahead(&here);
            let (reference_um, position_um) = self.positions(&self.with(&ahead.shares), &ahead.coefficients);
            let mut length = 1.0;
            let lower = (0..5).find_map(|_| {
                let mut point = here.towards(&ahead, &reference_um, &position_um, length);
                if !self.effect.acts_on_position() {
                    // What comes out of the plays does not lie on a line.
                    let from = self.with(&point.shares);
                    point.coefficients.clone_from(&ahead.coefficients);
                    (point.reference_um, point.position_um) = self.positions(&from, &ahead.coefficients);
                }
                let value = self.value(&point.shares, &point.position_um);
                length *= 0.4;
                (value < here.value).then_some(Point { value, ..point })
            });
            let Some(lower) = lower else { break };
            // A ten-thousandth of one record's logarithm is far below what any verdict rests on.
            let settled = here.value - lower.value < 1e-4;
            here = lower;
            if settled {
                break;
            }
        }
        here
    }

    /// The bottom if everything were linear; parameters stay on their bounds where it leads out of them.
    fn ahead(&self, here: &Point) -> Ahead {
        let (bench, count, n) = (self.bench, here.shares.len(), self.columns);
        let effects = self.with(&here.shares);
        let plain: Vec<(DMatrix<f64>, DVector<f64>)> = bench
            .coarse
            .iter()
            .zip(&here.reference_um)
            .map(|((_, trace), reference)| {
                let reference = Some(reference.as_slice());
                (
                    chain::matrix(&bench.base, &effects, trace, reference),
                    target(trace, &effects, reference),
                )
            })
            .collect();
        let pooled = |matrices: &[DMatrix<f64>], n: usize| {
            let each = bench.coarse.iter().zip(matrices).zip(&plain);
            let grams: Vec<(usize, Gram)> = each
                .map(|(((i, _), matrix), (_, target))| (*i, Gram::new(matrix, target)))
                .collect();
            bench.pooled(&grams, n)
        };
        let beside = |j: usize| {
            let mut shares = here.shares.clone();
            let apart = if shares[j] + APART > 1.0 { -APART } else { APART };
            shares[j] += apart;
            (apart, shares)
        };
        let mut matrices: Vec<DMatrix<f64>> = plain.iter().map(|(matrix, _)| matrix.clone()).collect();
        let changes: Vec<Vec<DVector<f64>>> = if self.effect.acts_on_position() {
            let now = self.modelled(&here.shares, &here.position_um);
            let change = |j: usize| {
                let (apart, shares) = beside(j);
                let there = self.modelled(&shares, &here.position_um);
                there
                    .iter()
                    .zip(&now)
                    .map(|(there, now)| (there - now) / apart)
                    .collect()
            };
            (0..count).map(change).collect()
        } else {
            let x = solve_signed(&pooled(&matrices, n), &bench.base, &effects);
            let change = |j: usize| {
                let (apart, shares) = beside(j);
                let moved = self.with(&shares);
                let each = bench.coarse.iter().zip(&here.reference_um).zip(&plain);
                each.map(|(((_, trace), reference), (matrix, _))| {
                    (chain::matrix(&bench.base, &moved, trace, Some(reference)) - matrix) * &x / apart
                })
                .collect()
            };
            (0..count).map(change).collect()
        };
        for (k, matrix) in matrices.iter_mut().enumerate() {
            *matrix = std::mem::take(matrix).resize_horizontally(n + count, 0.0);
            for (j, change) in changes.iter().enumerate() {
                matrix.set_column(n + j, &change[k]);
            }
        }
        self.solve(&pooled(&matrices, n + count), here)
    }

    fn solve(&self, system: &Gram, here: &Point) -> Ahead {
        let (count, n) = (here.shares.len(), self.columns);
        let mut keep = vec![true; n + count];
        loop {
            let solution = system.solve(self.bench.base.columns(), self.bench.base.ridge, &keep);
            let step: Vec<f64> = solution.iter().skip(n).copied().collect();
            let leads_out = |j: &usize| {
                let outwards = if step[*j] > 0.0 {
                    here.shares[*j] >= 1.0
                } else {
                    here.shares[*j] <= 0.0
                };
                keep[n + *j] && step[*j] != 0.0 && outwards
            };
            if let Some(out) = (0..count).find(leads_out) {
                keep[n + out] = false;
                continue;
            }
            let most = step.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
            let scale = if most > LONGEST { LONGEST / most } else { 1.0 };
            let pairs = here.shares.iter().zip(&step);
            return Ahead {
                shares: pairs
                    .map(|(share, step)| (share + scale * step).clamp(0.0, 1.0))
                    .collect(),
                coefficients: solution.rows(0, n).into_owned(),
            };
        }
    }
}

impl Point {
    /// Part of the way to another point.
    fn towards(&self, ahead: &Ahead, reference_um: &[Vec<f64>], position_um: &[Vec<f64>], length: f64) -> Self {
        let line =
            |from: &[f64], to: &[f64]| -> Vec<f64> { from.iter().zip(to).map(|(a, b)| a + length * (b - a)).collect() };
        let lines = |from: &[Vec<f64>], to: &[Vec<f64>]| from.iter().zip(to).map(|(a, b)| line(a, b)).collect();
        Self {
            value: self.value,
            shares: line(&self.shares, &ahead.shares),
            coefficients: &self.coefficients + length * (&ahead.coefficients - &self.coefficients),
            reference_um: lines(&self.reference_um, reference_um),
            position_um: lines(&self.position_um, position_um),
        }
    }
}

fn at_rows(series: &[f64], trace: &Trace) -> DVector<f64> {
    DVector::from_iterator(trace.rows.len(), trace.rows.iter().map(|&k| series[k]))
}
