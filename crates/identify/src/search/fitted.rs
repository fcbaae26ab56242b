//! A chain with all of its numbers, its answer on the records, and the way down to the bottom of its valley.

use super::expected::Held;
use super::records::Prepared;
use super::system::within_bounds;
use crate::chain::{Chain, Own, Stroke};
use crate::effects::Bounds;
use crate::normal::Normal;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// A chain with its coefficients, and what may be fitted of it.
#[derive(Clone)]
pub(crate) struct Fitted {
    pub chain: Chain,
    /// Bounds of each link's parameters, in the order of the chain.
    pub bounds: Vec<Vec<Bounds>>,
    /// Of the functions of [`Chain::basis`].
    pub coefficients: Vec<f64>,
    /// Numbers of each record alone.
    pub own: Vec<Own>,
    /// What departures from a smooth shape cost, where the hysteresis is a free one.
    pub expected: Option<Arc<DMatrix<f64>>>,
    /// How strongly it is held to that; a ridge on the scaled columns of the other families.
    pub ridge: f64,
}

/// Which samples are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Look {
    /// Those of a search.
    Few,
    /// Those of a comparison.
    All,
}

impl Look {
    pub(super) fn rows<'r>(self, record: &'r Prepared<'_>) -> &'r [usize] {
        match self {
            Self::Few => &record.few_rows,
            Self::All => &record.rows,
        }
    }
}

/// The level of a record whose widest plays hold something since before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Levels {
    /// As the state before the record gives it.
    OfTheState,
    /// Whatever it is.
    Free,
}

impl Levels {
    fn free(self, record: &Prepared<'_>) -> bool {
        self == Self::Free && record.holds_a_level
    }
}

/// The answer of a chain on one record, at the rows, and how it changes with each coefficient and parameter.
pub(super) struct Tangent {
    pub columns: DMatrix<f64>,
    /// Measured minus modelled.
    pub residual: DVector<f64>,
    /// What the columns have to give: the residual and what the coefficients give already.
    pub target: DVector<f64>,
}

/// What is known before a tangent is asked for.
#[derive(Clone, Copy, Default)]
pub(super) struct Known<'k> {
    /// The coefficients' columns from a point nearby, where they need not be made anew.
    pub linear: Option<&'k DMatrix<f64>>,
    /// The hysteresis' part of the answer at this point.
    pub stroke: Option<&'k Stroke>,
}

/// Step of numerical derivatives, in units of a parameter's scale: between rounding and bends.
const DIFFERENCE: f64 = 1e-3;

/// Steps of the search; one that has not settled by then follows a flat valley.
const MOST_STEPS: usize = 25;

impl Fitted {
    /// What holds its coefficients where the records do not.
    pub(super) fn held(&self) -> Held<'_> {
        self.held_by(self.ridge)
    }

    /// The same, more or less strongly.
    pub(super) fn held_by(&self, by: f64) -> Held<'_> {
        Held {
            expected: self.expected.as_deref(),
            by,
        }
    }

    /// Number of parameters of all effects, fitted or not.
    pub(super) fn parameters(&self) -> usize {
        self.bounds.iter().map(Vec::len).sum()
    }

    /// Lets each effect choose the numbers that belong to one record alone.
    pub(super) fn settle(&mut self, records: &[Prepared<'_>]) {
        let dynamic = self.chain.dynamic();
        self.own = records
            .par_iter()
            .map(|record| self.chain.settle(&self.coefficients, record.trace(dynamic)))
            .collect();
    }

    /// The modelled position at every sample of a record.
    pub(super) fn modelled(&self, record: &Prepared<'_>, i: usize) -> Vec<f64> {
        let trace = record.trace(self.chain.dynamic());
        self.chain.respond(&self.coefficients, trace, &self.own[i])
    }

    /// The answer on one record; `derivatives` asks for the columns of the effects' parameters as well.
    pub(super) fn tangent(
        &self,
        record: &Prepared<'_>,
        i: usize,
        look: Look,
        derivatives: bool,
        known: Known<'_>,
    ) -> Tangent {
        let rows = look.rows(record);
        let trace = record.trace(self.chain.dynamic());
        let own = &self.own[i];
        let stroke = known.stroke.map(Cow::Borrowed);
        let (stroke, linear) = match known.linear {
            Some(linear) => {
                let run = || Cow::Owned(self.chain.stroke(&self.coefficients, trace, own));
                (stroke.unwrap_or_else(run), linear.clone())
            }
            None => {
                let (chain, stroke) = (&self.chain, stroke.map(Cow::into_owned));
                let (stroke, columns) = chain.stroke_and_columns(&self.coefficients, trace, own, rows, stroke);
                (Cow::Owned(stroke), columns)
            }
        };
        let modelled = self.chain.respond_from(&self.coefficients, trace, own, &stroke);
        let measured = &record.record().position_um;
        let residual = DVector::from_iterator(rows.len(), rows.iter().map(|&k| measured[k] - modelled[k]));
        let target = &residual + &linear * DVector::from_column_slice(&self.coefficients);
        let (n, more) = (linear.ncols(), if derivatives { self.parameters() } else { 0 });
        if more == 0 {
            return Tangent {
                columns: linear,
                residual,
                target,
            };
        }
        let mut columns = linear.resize_horizontally(n + more, 0.0);
        let mut column = n;
        for (link, bounds) in self.bounds.iter().enumerate() {
            for (j, b) in bounds.iter().enumerate() {
                if b.fitted {
                    let value = self.chain.links[link].values[j];
                    let forward = DIFFERENCE * b.scale;
                    let step = if value + forward <= b.max { forward } else { -forward };
                    let mut shifted = self.chain.clone();
                    shifted.links[link].values[j] = value + step;
                    let there = shifted.respond_again(link, &self.coefficients, trace, own, &stroke);
                    for (cell, &k) in columns.column_mut(column).iter_mut().zip(rows) {
                        *cell = (there[k] - modelled[k]) / step;
                    }
                }
                column += 1;
            }
        }
        Tangent {
            columns,
            residual,
            target,
        }
    }

    /// Normal equations of each fitted record around this point, beside the coefficients' columns from a point nearby, or these columns
    /// anew; `strokes` are those of this point.
    fn systems(
        &self,
        records: &[Prepared<'_>],
        derivatives: bool,
        levels: Levels,
        linear: Option<&LinearColumns>,
        strokes: Option<&Strokes>,
    ) -> (Vec<Normal>, LinearColumns) {
        let taking_part: Vec<usize> = (0..records.len()).filter(|&i| records[i].fits).collect();
        let each = taking_part.par_iter().enumerate().map(|(place, &i)| {
            let kept = linear.map(|linear| &linear[place]);
            let known = Known {
                linear: kept.map(Arc::as_ref),
                stroke: strokes.map(|strokes| &strokes[place]),
            };
            let tangent = self.tangent(&records[i], i, Look::Few, derivatives, known);
            let system = Normal::of_columns(&tangent.columns, &tangent.target);
            let system = if levels.free(&records[i]) {
                system.level_free()
            } else {
                system
            };
            let linear = kept.cloned().unwrap_or_else(|| {
                let n = self.coefficients.len();
                Arc::new(tangent.columns.columns(0, n).into_owned())
            });
            (system, linear)
        });
        each.unzip()
    }

    pub(super) fn flat(&self) -> Vec<(Bounds, f64)> {
        self.bounds
            .iter()
            .zip(&self.chain.links)
            .flat_map(|(bounds, link)| bounds.iter().copied().zip(link.values.iter().copied()))
            .collect()
    }

    /// The point that a solution of the normal equations leads to.
    pub(super) fn moved_by(&self, solution: &[f64]) -> Self {
        let linear = self.coefficients.len();
        let mut moved = self.clone();
        moved.coefficients = solution[..linear].to_vec();
        let mut changes = solution[linear..].iter();
        for (link, bounds) in moved.chain.links.iter_mut().zip(&self.bounds) {
            for ((value, b), change) in link.values.iter_mut().zip(bounds).zip(&mut changes) {
                if b.fitted {
                    *value = (*value + change).clamp(b.min, b.max);
                }
            }
        }
        moved
    }
}

/// A search over the parameters of a chain's effects: the linear coefficients in closed form for every trial (variable projection,
/// Golub and Pereyra 1973), the others by damped Gauss-Newton steps within physical bounds.
///
/// What falls is the sum of the logarithms of the records' mean squares: a record explained to a tenth counts as much as another
/// one explained to a tenth, and the records that lack an effect do not speak for the others.
#[derive(Clone, Copy)]
pub(super) struct Descent<'s> {
    pub records: &'s [Prepared<'s>],
    /// Noise of the readings, micrometres rms: below it no record is worth more.
    pub noise_um: f64,
    /// Fall of the sum of logarithms below which it has settled.
    pub settled: f64,
    /// Whether it has settled only where its columns, made anew, say so too.
    pub closely: bool,
    /// The levels that count.
    pub levels: Levels,
}

/// How the answer on each fitted record changes with the coefficients, at the rows of a search.
type LinearColumns = Vec<Arc<DMatrix<f64>>>;

/// The hysteresis' part of the answer on each fitted record.
type Strokes = Vec<Stroke>;

/// A point and the sum of the logarithms of what it leaves of each record.
pub(super) struct Standing {
    pub fitted: Fitted,
    pub error: f64,
    /// The coefficients' columns, where a point nearby has them.
    pub linear: Option<LinearColumns>,
    /// The hysteresis' part of the answers, where it is known.
    pub strokes: Option<Strokes>,
}

/// Rounds in which each record is weighed by what is left of it.
const REWEIGHED: usize = 3;

/// Least squares over records, each weighed by what a solution leaves of it: coefficients, and the sum of logarithms.
pub(super) fn reweighed(
    systems: &[Normal],
    noise_um: f64,
    first: Option<&[f64]>,
    rounds: usize,
    solve: impl Fn(&Normal) -> Option<Vec<f64>>,
) -> Option<(Vec<f64>, f64)> {
    let mean_square = |system: &Normal, x: &[f64]| system.squared_error(x) / system.samples.max(1) as f64;
    let noise_um2 = noise_um.powi(2).max(f64::MIN_POSITIVE);
    let mut solution = first.map(<[f64]>::to_vec);
    for _ in 0..rounds {
        let mut sum = Normal::new(systems.first()?.columns());
        for system in systems {
            let left = solution.as_deref().map_or(0.0, |x| mean_square(system, x));
            // Before there is a solution each record counts by its own size.
            let scale = if solution.is_some() {
                noise_um2 + left
            } else {
                noise_um2 + system.target_squares / system.samples.max(1) as f64
            };
            sum.add_scaled(system, 1.0 / (scale * system.samples.max(1) as f64));
        }
        solution = Some(solve(&sum)?);
    }
    let solution = solution?;
    let error = systems
        .iter()
        .map(|system| (noise_um2 + mean_square(system, &solution)).ln())
        .sum();
    Some((solution, error))
}

impl Descent<'_> {
    /// Solves for the linear coefficients at these effects; for a nonlinear chain around the given coefficients.
    pub(super) fn project(&self, mut fitted: Fitted) -> Standing {
        let (systems, linear) = fitted.systems(self.records, false, self.levels, None, None);
        let n = fitted.coefficients.len();
        let solve = |sum: &Normal| within_bounds(sum, n, fitted.held(), 0.0, &[]);
        let solved = reweighed(&systems, self.noise_um, Some(&fitted.coefficients), REWEIGHED, solve);
        let mut error = f64::INFINITY;
        if let Some((solution, left)) = solved {
            (fitted.coefficients, error) = (solution, left);
        }
        let mut strokes = None;
        if !fitted.chain.linear() {
            let answered = self.answered(&fitted);
            (error, strokes) = (answered.0, Some(answered.1));
        }
        Standing {
            fitted,
            error,
            linear: Some(linear),
            strokes,
        }
    }

    /// The sum of logarithms at the rows of the search, and what the hysteresis answered.
    pub(super) fn answered(&self, fitted: &Fitted) -> (f64, Strokes) {
        let chain = &fitted.chain;
        let dynamic = chain.dynamic();
        let each = self.records.par_iter().zip(&fitted.own);
        let (errors, strokes): (Vec<f64>, Strokes) = each
            .filter(|(record, _)| record.fits)
            .map(|(record, own)| {
                let trace = record.trace(dynamic);
                let stroke = chain.stroke(&fitted.coefficients, trace, own);
                let modelled = chain.respond_from(&fitted.coefficients, trace, own, &stroke);
                let measured = &record.record().position_um;
                let rows = &record.few_rows;
                let level = if self.levels.free(record) {
                    rows.iter().map(|&k| measured[k] - modelled[k]).sum::<f64>() / rows.len().max(1) as f64
                } else {
                    0.0
                };
                let sum: f64 = rows.iter().map(|&k| (measured[k] - modelled[k] - level).powi(2)).sum();
                let noise_um2 = self.noise_um.powi(2).max(f64::MIN_POSITIVE);
                ((noise_um2 + sum / rows.len().max(1) as f64).ln(), stroke)
            })
            .unzip();
        (errors.iter().sum(), strokes)
    }

    /// From a point to the bottom of its valley, in a number of steps at the most.
    ///
    /// The coefficients' columns change little with the parameters of a linear effect, and each of them takes a run of its own: they are made
    /// anew only where a search is to settle closely and has come to where the kept ones lead. A nonlinear effect bends them wherever it goes.
    pub(super) fn descend(&self, start: Standing, most_steps: usize) -> Standing {
        let mut here = start;
        let mut damping = 1e-3;
        let bent = !here.fitted.chain.linear();
        let mut anew = bent || here.linear.is_none();
        for _ in 0..most_steps.min(MOST_STEPS) {
            let kept = here.linear.take().filter(|_| !anew);
            let (systems, linear) =
                here.fitted
                    .systems(self.records, true, self.levels, kept.as_ref(), here.strokes.as_ref());
            let lower = self.step(&here, &systems, &mut damping);
            here.linear = Some(linear);
            let settled = lower
                .as_ref()
                .is_none_or(|lower| here.error - lower.error < self.settled);
            if let Some(lower) = lower {
                here = Standing {
                    linear: here.linear,
                    ..lower
                };
            }
            if settled && (anew || !self.closely) {
                break;
            }
            anew = bent || settled;
        }
        here
    }

    /// Where a step down leads, if the step brings as much as counts; one that does not go down is tried again, shorter.
    fn step(&self, here: &Standing, systems: &[Normal], damping: &mut f64) -> Option<Standing> {
        let n = here.fitted.coefficients.len();
        let mut stay = here.fitted.coefficients.clone();
        stay.resize(n + here.fitted.parameters(), 0.0);
        let flat = here.fitted.flat();
        let solution = |damping: f64| {
            let solve = |sum: &Normal| within_bounds(sum, n, here.fitted.held(), damping, &flat);
            reweighed(systems, self.noise_um, Some(&stay), 2, solve)
        };
        let promised = solution(1e-9).map_or(0.0, |(_, error)| here.error - error);
        if here.error.is_finite() && promised < self.settled {
            return None;
        }
        for _ in 0..5 {
            let (solution, _) = solution(*damping)?;
            let fitted = here.fitted.moved_by(&solution);
            let (error, strokes) = self.answered(&fitted);
            if error < here.error {
                *damping = (*damping * 0.1).max(1e-9);
                return Some(Standing {
                    fitted,
                    error,
                    linear: None,
                    strokes: Some(strokes),
                });
            }
            *damping *= 10.0;
        }
        None
    }
}
