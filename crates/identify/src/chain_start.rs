//! Where the search for an effect's parameters begins: the best few of its starts.

use crate::chain::Stroke;
use crate::chain_fit::{Fitted, Problem};
use crate::chain_trace::Trace;
use crate::normal::Normal;
use rayon::prelude::*;

/// Starts that are compared with all coefficients fitted anew and a step down their valley; of a longer list the best of a
/// quick look.
const COMPARED: usize = 12;

/// Starts that are followed some steps towards the bottom of their valley; the best goes all the way.
const FOLLOWED: usize = 4;

/// Those steps.
const FIRST_STEPS: usize = 4;

/// A quick look at every start, a closer one at the best of them, then the best few towards the bottom of their valleys.
pub(crate) fn best_of_starts(
    problem: &Problem<'_>,
    start: &Fitted,
    link: Option<usize>,
    starts: &[Vec<f64>],
    progress: &(dyn Fn(f64) + Sync),
) -> Fitted {
    let mut starts = starts.to_vec();
    if let Some(link) = link
        && starts.len() > COMPARED
    {
        starts = quick_look(problem, start, link, starts, &|share| progress(0.05 + 0.3 * share));
    }
    let count = starts.len().max(1);
    let mut looked: Vec<Fitted> = starts
        .iter()
        .enumerate()
        .map(|(i, values)| {
            let mut at = start.clone();
            if let Some(link) = link {
                at.chain.links[link].values.clone_from(values);
            }
            let at = problem.descend(problem.project(at), 1);
            progress(0.35 + 0.2 * (i + 1) as f64 / count as f64);
            at
        })
        .collect();
    looked.sort_by(|a, b| a.error.total_cmp(&b.error));
    looked.truncate(FOLLOWED);
    let mut followed: Vec<Fitted> = looked.into_iter().map(|at| problem.descend(at, FIRST_STEPS)).collect();
    followed.sort_by(|a, b| a.error.total_cmp(&b.error));
    followed.into_iter().next().unwrap_or_else(|| start.clone())
}

/// A record without the effect: what its response is, and what else may move while the starts are looked at.
struct Before {
    stroke: Stroke,
    modelled: Vec<f64>,
    basis: Vec<Vec<f64>>,
}

/// The starts whose change of the modelled position explains most of what the model leaves, up to a factor and a gain; for
/// an effect of the user's own, of which nothing is known, with all linear coefficients fitted anew.
fn quick_look(
    problem: &Problem<'_>,
    start: &Fitted,
    link: usize,
    starts: Vec<Vec<f64>>,
    progress: &(dyn Fn(f64) + Sync),
) -> Vec<Vec<f64>> {
    let own = start.chain.links[link].effect.file().is_some();
    let without = || {
        let mut chain = start.chain.clone();
        chain.links.remove(link);
        chain
    };
    let before: Vec<Before> = problem
        .traces
        .par_iter()
        .map(|trace| {
            let stroke = start.chain.stroke(&start.coefficients, trace);
            if own {
                let without = without();
                let alone = without.stroke(&start.coefficients, trace);
                let tangent = without.tangent(&start.coefficients, trace, &alone);
                return Before {
                    stroke,
                    modelled: tangent.output,
                    basis: tangent.columns,
                };
            }
            let modelled = start.chain.respond_from(&start.coefficients, trace, &stroke);
            Before {
                stroke,
                basis: vec![vec![1.0; modelled.len()], modelled.clone()],
                modelled,
            }
        })
        .collect();
    let count = starts.len() as f64;
    let columns = before.first().map_or(0, |b| b.basis.len()) + 1;
    let mut scored: Vec<(f64, Vec<f64>)> = Vec::with_capacity(starts.len());
    for (i, values) in starts.into_iter().enumerate() {
        let mut chain = start.chain.clone();
        chain.links[link].values.clone_from(&values);
        let systems: Vec<Normal> = problem
            .traces
            .par_iter()
            .zip(&before)
            .map(|(trace, before)| {
                let with = chain.respond_again(link, &start.coefficients, trace, &before.stroke);
                of_trace(problem, trace, before, &with)
            })
            .collect();
        let mut sum = Normal::new(columns);
        for (system, trace) in systems.iter().zip(problem.traces) {
            sum.add_scaled(system, trace.weight);
        }
        scored.push((sum.squared_error(&sum.solve(1e-12)), values));
        progress((i + 1) as f64 / count);
    }
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    scored.truncate(COMPARED);
    scored.into_iter().map(|(_, values)| values).collect()
}

/// What is left, over what may move and the effect's change of the modelled position.
fn of_trace(problem: &Problem<'_>, trace: &Trace<'_>, before: &Before, with: &[f64]) -> Normal {
    let moving = before.basis.len();
    let mut system = Normal::new(moving + 1);
    let mut row = vec![0.0; moving + 1];
    let measured = &trace.record.position_um;
    for k in (trace.fit_from..measured.len()).filter(|k| k % problem.stride == 0) {
        for (cell, column) in row.iter_mut().zip(&before.basis) {
            *cell = column[k];
        }
        row[moving] = with[k] - before.modelled[k];
        system.add_row(&row, measured[k] - before.modelled[k]);
    }
    system
}
