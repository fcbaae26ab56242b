//! A quick look at many starts: what each could take of what the chain leaves, by the tangents of the chain without the effect.

use super::Search;
use super::effort::Effort;
use super::fitted::{Fitted, Known, Levels, Look, reweighed};
use super::system::within_bounds;
use crate::chain::{Chain, Stroke};
use crate::effects::Bounds;
use crate::normal::Normal;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Starts that are looked at of a wider form of an effect, or behind one: every answer of a mode with a bent spring or friction is an
/// integration.
const LOOKED_AT: usize = 12;

/// Times that the space about the best start is halved in a quick look.
const HALVED: usize = 3;

/// The chain as it stands, ready for a quick look at many starts: what is left of each fitted record, and what the
/// hysteresis could take of a change.
pub(super) struct Basis {
    records: Vec<OfRecord>,
    /// The sum of logarithms at the bottom of the valley that the standing chain is in.
    pub error: f64,
}

struct OfRecord {
    index: usize,
    stroke: Stroke,
    modelled: Vec<f64>,
    columns: DMatrix<f64>,
    residual: DVector<f64>,
    system: Normal,
}

impl Search<'_> {
    /// The standing chain made ready for [`Search::candidate`].
    pub(super) fn basis(&self) -> Basis {
        let fitted = &self.standing.fitted;
        let taking_part = (0..self.records.len()).filter(|&i| self.records[i].fits);
        let records: Vec<OfRecord> = taking_part
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|index| {
                let record = &self.records[index];
                let trace = record.trace(fitted.chain.dynamic());
                let own = &fitted.own[index];
                let stroke = fitted.chain.stroke(&fitted.coefficients, trace, own);
                let known = Known {
                    linear: None,
                    stroke: Some(&stroke),
                };
                let tangent = fitted.tangent(record, index, Look::Few, false, known);
                OfRecord {
                    index,
                    modelled: fitted.chain.respond_from(&fitted.coefficients, trace, own, &stroke),
                    stroke,
                    system: Normal::of_columns(&tangent.columns, &tangent.residual),
                    columns: tangent.columns,
                    residual: tangent.residual,
                }
            })
            .collect();
        Basis {
            records,
            error: self.descent(Levels::OfTheState).project(fitted.clone()).error,
        }
    }

    /// The starts of a plan that are begun at; beside a rival none that leaves more than `limit` by these tangents.
    pub(super) fn looked_at(
        &self,
        (point, link, mut starts): (&Fitted, usize, Vec<Vec<f64>>),
        (basis, effort): (&Basis, Effort),
        limit: Option<f64>,
    ) -> Vec<Vec<f64>> {
        let mut links = self.standing.fitted.chain.links.iter();
        let costly = limit.is_some() || links.any(|link| link.effect.widens().is_some());
        if costly && starts.len() > LOOKED_AT {
            let every = starts.len().div_ceil(LOOKED_AT);
            starts = starts.into_iter().step_by(every).collect();
        }
        if !point.chain.links[link].effect.has_own_numbers() && starts.len() > effort.followed() {
            starts = self.quick_look(point, link, starts, basis, effort);
        }
        let Some(limit) = limit else {
            return starts;
        };
        // To begin at a start takes some ten answers; this takes one.
        let left = |values: &Vec<f64>| basis.left(self, &with_values(point, link, values), link, point, WHOLE);
        starts.into_par_iter().filter(|values| left(values) <= limit).collect()
    }

    /// The starts whose change of the modelled position leaves least, with what the hysteresis could take of it; the space about
    /// the best one is halved some times, since a light mode's valley is narrower than the steps between starts.
    fn quick_look(
        &self,
        point: &Fitted,
        link: usize,
        starts: Vec<Vec<f64>>,
        basis: &Basis,
        effort: Effort,
    ) -> Vec<Vec<f64>> {
        let left = |values: &Vec<f64>| basis.left(self, &with_values(point, link, values), link, point, SOME);
        let scored: Vec<f64> = starts.par_iter().map(left).collect();
        let mut order: Vec<usize> = (0..starts.len()).collect();
        order.sort_by(|&a, &b| scored[a].total_cmp(&scored[b]));
        let best = order[0];
        let mut nearest = starts[best].clone();
        let mut least = scored[best];
        let mut beside: Vec<Vec<f64>> = [best.checked_sub(1), Some(best + 1)]
            .into_iter()
            .flatten()
            .filter_map(|k| starts.get(k).cloned())
            .collect();
        for _ in 0..HALVED {
            beside.iter_mut().for_each(|other| *other = between(&nearest, other));
            let tried: Vec<f64> = beside.par_iter().map(left).collect();
            for (values, left) in beside.iter().zip(tried) {
                if left < least {
                    (nearest, least) = (values.clone(), left);
                }
            }
        }
        let mut chosen = vec![nearest];
        // The others come from valleys of their own, not from the slopes of one.
        let bottom = |&&k: &&usize| {
            let beside = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
            k != best && beside.filter_map(|j| scored.get(j)).all(|other| *other >= scored[k])
        };
        let others = order.iter().filter(bottom);
        chosen.extend(others.take(effort.followed() - 1).map(|&k| starts[k].clone()));
        chosen
    }
}

/// Half way between two starts: by equal factors where both have one sign.
fn between(a: &[f64], b: &[f64]) -> Vec<f64> {
    let half = |(a, b): (&f64, &f64)| {
        if a * b > 0.0 {
            a.signum() * (a * b).sqrt()
        } else {
            0.5 * (a + b)
        }
    };
    a.iter().zip(b).map(half).collect()
}

impl Basis {
    /// The sum of logarithms that so many times a change of the chain leaves, with what the hysteresis could take of it.
    fn left(&self, search: &Search<'_>, chain: &Chain, link: usize, point: &Fitted, times: Bounds) -> f64 {
        let dynamic = chain.dynamic();
        let of_standing = search.standing.fitted.chain.dynamic();
        let systems: Vec<Normal> = self
            .records
            .iter()
            .map(|record| {
                let trace = search.records[record.index].trace(dynamic);
                let numbers = &point.own[record.index];
                let modelled = if dynamic == of_standing || trace.every == 1 {
                    chain.respond_again(link, &point.coefficients, trace, numbers, &record.stroke)
                } else {
                    chain.respond(&point.coefficients, trace, numbers)
                };
                let rows = &search.records[record.index].few_rows;
                let change = DVector::from_iterator(rows.len(), rows.iter().map(|&k| modelled[k] - record.modelled[k]));
                let across = record.columns.tr_mul(&change);
                record
                    .system
                    .bordered(&across, change.norm_squared(), change.dot(&record.residual))
            })
            .collect();
        let n = point.coefficients.len();
        let factor = [(times, 0.0)];
        let solve = |sum: &Normal| within_bounds(sum, n, point.held(), 0.0, &factor);
        let stay = vec![0.0; n + 1];
        reweighed(&systems, search.noise_um, Some(&stay), 2, solve).map_or(f64::INFINITY, |(_, error)| error)
    }
}

/// A start's change counts up to three times, or as it is.
const SOME: Bounds = Bounds::new(0.0, 3.0, 1.0, 0.0);
const WHOLE: Bounds = Bounds::new(1.0, 1.0, 1.0, 1.0);

/// The chain with such values of a link.
fn with_values(point: &Fitted, link: usize, values: &[f64]) -> Chain {
    let mut chain = point.chain.clone();
    chain.links[link].values.copy_from_slice(values);
    chain
}
