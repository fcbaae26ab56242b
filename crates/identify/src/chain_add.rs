//! Adds an effect to a model: all parameters fitted anew, errors before and after on every record.

use crate::chain::{Chain, Link};
use crate::chain_facts::facts;
use crate::chain_fit::{Fitted, Problem, prepare};
use crate::chain_start::best_of_starts;
use crate::chain_trace::Trace;
use crate::columns::Design;
use crate::effects::{Bounds, Effect, EffectId, EffectName, Facts, Named, OfFamily, Shape, UserEffect};
use crate::error::IdentifyError;
use crate::family::{Direction, Family, range};
use crate::history::{self, record_errors};
use crate::initial;
use crate::model::{Change, FittedEffect, FittedRecord, Model, Parameter, Step, StepSubject};
use crate::normal::Normal;
use crate::objective::runs;
use crate::placement::{Placement, thresholds};
use crate::separable;
use crate::start_state::InitialState;
use hysteron_core::envelope::Envelope;
use hysteron_data::{Dataset, Record, Role};
use rayon::prelude::*;
use std::sync::Arc;

/// What adding an effect did.
#[derive(Debug, Clone, PartialEq)]
pub struct Added {
    /// The new model, with the step in its history.
    pub model: Model,
    /// Errors of the model it was added to.
    pub before: Step,
    /// Errors of the new model.
    pub after: Step,
}

/// Rows that a search looks at; the final solution takes all, up to [`FINAL_ROWS`].
const SEARCH_ROWS: usize = 6_000;

/// Rows of the final solution: a quarter of a million say as much of fifty parameters as any more.
const FINAL_ROWS: usize = 250_000;

/// Adds an effect of the catalogue to a model and fits all parameters anew to the records with role `identify`.
/// `progress` is called with the share done, 0 to 1.
///
/// Deterministic: starts from the effect's own list, follows the best of them.
///
/// # Errors
/// - An effect that the model has already, or that these records cannot show.
/// - A model of direction inverse, no record to identify.
///
/// # Cost
/// Some hundred simulations of every tenth sample or fewer; below a second for 60 000 samples and most effects.
pub fn add_effect(
    dataset: &Dataset,
    model: &Model,
    effect: EffectId,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    add(dataset, model, &effect.effect(), progress)
}

/// Adds an effect of the user's own, as [`add_effect`] does one of the catalogue; the new model keeps its definition.
///
/// # Errors
/// As [`add_effect`]; records without a column that its equations need.
pub fn add_own_effect(
    dataset: &Dataset,
    model: &Model,
    effect: UserEffect,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    add(dataset, model, &effect.effect(), progress)
}

/// Refuses a dataset that lacks a column which the equations of an effect file need.
///
/// # Errors
/// - `temperature` without a temperature in every record that is fitted.
/// - `v2` where the other axis stands still in all of them.
pub fn check_own_effect(effect: UserEffect, dataset: &Dataset) -> Result<(), IdentifyError> {
    let records = || dataset.with_role(Role::Identify);
    let moves = |record: &Record| {
        let axis = record.voltage2_v.as_deref();
        axis.is_some_and(|axis| axis.iter().any(|v| *v != axis[0]))
    };
    let with_temperature = records().all(|record| record.temperature_c.is_some());
    effect
        .needs(with_temperature, records().any(moves))
        .map_err(|reason| IdentifyError::EffectRefused {
            effect: effect.name(),
            reason,
        })
}

fn add(
    dataset: &Dataset,
    model: &Model,
    effect: &Arc<dyn Effect>,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    let name = effect.name();
    let refuse = |reason: String| IdentifyError::EffectRefused {
        effect: name.clone(),
        reason,
    };
    if model.direction == Direction::Inverse {
        return Err(refuse(
            "the model runs from position to voltage; fit one with --direction forward".to_owned(),
        ));
    }
    if dataset.with_role(Role::Identify).next().is_none() {
        return Err(IdentifyError::NothingToFit);
    }
    let facts = facts(dataset, model.family);
    let plan = plan(dataset, model, effect, &facts).map_err(refuse)?;
    Ok(carry_out(dataset, model, &plan, Change::Added, &name, progress))
}

/// Takes an effect out of a model again and fits all other parameters anew to the records with role `identify`.
///
/// # Errors
/// - An effect that is not in the model's chain; a change of the hysteresis family cannot be taken back.
/// - No record to identify.
pub fn remove_effect(
    dataset: &Dataset,
    model: &Model,
    name: &EffectName,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Added, IdentifyError> {
    if !model.effects.iter().any(|fitted| fitted.name == *name) {
        return Err(IdentifyError::EffectNotThere { effect: name.clone() });
    }
    if dataset.with_role(Role::Identify).next().is_none() {
        return Err(IdentifyError::NothingToFit);
    }
    let facts = facts(dataset, model.family);
    let mut chain = all_of(model, Vec::new());
    chain.links.retain(|link| !link.is(name));
    let plan = Plan {
        bounds: bounds(&chain, &facts),
        chain,
        starts: vec![Vec::new()],
        link: None,
    };
    Ok(carry_out(dataset, model, &plan, Change::Removed, name, progress))
}

/// Searches, and writes the step into the history.
fn carry_out(
    dataset: &Dataset,
    model: &Model,
    plan: &Plan,
    change: Change,
    name: &EffectName,
    progress: &(dyn Fn(f64) + Sync),
) -> Added {
    let before = history::present_step(dataset, model);
    progress(0.05);
    let mut new = search(dataset, model, plan, progress);
    let after = history::step(change, StepSubject::Effect(name.clone()), record_errors(dataset, &new));
    if new.history.is_empty() {
        new.history.push(before.clone());
    }
    new.history.push(after.clone());
    progress(1.0);
    Added {
        model: new,
        before,
        after,
    }
}

/// What is searched: the chain with the effect in it, and where to start.
struct Plan {
    chain: Chain,
    bounds: Vec<Vec<Bounds>>,
    /// Values of the new effect's link, each a start.
    starts: Vec<Vec<f64>>,
    /// The new effect's link; `None` where the effect is a change of the family.
    link: Option<usize>,
}

fn plan(dataset: &Dataset, model: &Model, effect: &Arc<dyn Effect>, facts: &Facts) -> Result<Plan, String> {
    let name = effect.name();
    let there = model.effects.iter().any(|fitted| fitted.name == name);
    let shape = Shape {
        family: model.family,
        thresholds: model.thresholds.clone(),
    };
    let place = |plays| {
        let inputs: Vec<&[f64]> = dataset
            .with_role(Role::Identify)
            .map(|record| record.voltage_v.as_slice())
            .collect();
        thresholds(Placement::Data, plays, &inputs)
    };
    let mut chain = all_of(model, Vec::new());
    let own = effect.bounds(facts)?;
    if own.is_empty() {
        let shape = effect
            .reshape(&shape, facts, &place)
            .ok_or_else(|| "the model's family of plays has it already".to_owned())?;
        chain.design.thresholds = shape.thresholds;
        chain = in_family(chain, shape.family, facts.span_v());
    } else if !there {
        let values = own.iter().map(|b| b.neutral).collect();
        let link = Link {
            effect: Arc::clone(effect),
            values,
        };
        chain = all_of(model, vec![link]);
    }
    let link = chain.links.iter().position(|link| link.is(&name));
    let family = chain.design.family;
    let facts = &Facts { family, ..*facts };
    let mut bounds = bounds(&chain, facts);
    let starts = match link {
        None => vec![Vec::new()],
        Some(i) if there => {
            let again = effect.once_more(&chain.links[i].values, &bounds[i]);
            let starts = again.ok_or_else(|| "the model has it already".to_owned())?;
            if let Some(first) = starts.first() {
                effect.free(first, &mut bounds[i]);
            }
            starts
        }
        Some(i) => effect.starts(facts, &bounds[i]),
    };
    Ok(Plan {
        chain,
        bounds,
        starts,
        link,
    })
}

/// The model's chain with further links, and what its family has of parameters that are not linear.
fn all_of(model: &Model, mut links: Vec<Link>) -> Chain {
    if let Some(envelope) = model.envelope.filter(|_| model.family == Family::Mrpi) {
        links.push(Link {
            effect: Arc::new(OfFamily),
            values: vec![envelope.alpha_s, envelope.beta_s],
        });
    }
    model.chain_with(links)
}

/// A chain with another family of plays; the rate dependence that was the family's own becomes an effect.
fn in_family(chain: Chain, family: Family, span_v: f64) -> Chain {
    let Chain {
        mut design, mut links, ..
    } = chain;
    design.family = family;
    if family != Family::Mrpi {
        for link in &mut links {
            if let Some(effect) = link.effect.outside_family() {
                link.effect = effect;
            }
        }
    }
    Chain::new(design, links, span_v)
}

/// Bounds of every link's parameters.
fn bounds(chain: &Chain, facts: &Facts) -> Vec<Vec<Bounds>> {
    let of_link = |link: &Link| {
        let mut of_link = link.effect.bounds(facts).unwrap_or_else(|_| {
            // Records that cannot show an effect of the model leave it as it is.
            link.values.iter().map(|&value| Bounds::fixed(value)).collect()
        });
        link.effect.free(&link.values, &mut of_link);
        of_link
    };
    chain.links.iter().map(of_link).collect()
}

/// The records to fit to, with the states that the given model finds.
fn traces<'a>(dataset: &'a Dataset, model: &Model, chain: &Chain) -> Vec<Trace<'a>> {
    let mut runs = runs(dataset, Direction::Forward, model.fitted_on.weighting);
    let still = Design {
        envelope: Envelope {
            alpha_s: 0.0,
            beta_s: 0.0,
        },
        ..chain.design.clone()
    };
    for run in &mut runs {
        initial::skip_unsettled(&still, run);
    }
    let old = model.chain_with(Vec::new());
    let records: Vec<_> = dataset.with_role(Role::Identify).zip(&runs).collect();
    records
        .par_iter()
        .map(|(record, run)| {
            let mut trace = prepare(&old, &model.coefficients, record, run.initial);
            if chain.dynamic() && !old.dynamic() {
                trace = Trace::new(record, trace.initial, true);
            }
            trace.own = vec![Vec::new(); chain.links.len()];
            (trace.weight, trace.fit_from) = (run.weight, run.fit_from);
            trace
        })
        .collect()
}

fn search(dataset: &Dataset, model: &Model, plan: &Plan, progress: &(dyn Fn(f64) + Sync)) -> Model {
    let mut traces = traces(dataset, model, &plan.chain);
    // A step out of an unknown state tells nothing about the plays, but all about what rings or lags after it.
    let settled: Vec<usize> = traces.iter().map(|trace| trace.fit_from).collect();
    let unsettled = plan.chain.dynamic() && settled.iter().any(|&from| from > 0);
    if unsettled {
        traces.iter_mut().for_each(|trace| trace.fit_from = 0);
    }
    let rows: usize = traces.iter().map(|trace| trace.record.len() - trace.fit_from).sum();
    let coarse = rows.div_ceil(SEARCH_ROWS).max(1);
    let start = Fitted {
        coefficients: start_coefficients(model, &plan.chain),
        chain: plan.chain.clone(),
        error: f64::INFINITY,
    };
    let reshaped = plan.chain.design.columns() != model.coefficients.len();
    let ridge = match plan.chain.design.family {
        // A free shape extrapolates badly without.
        Family::PlayPolynomial if reshaped => {
            settle(&start, &mut traces);
            let problem = problem(&traces, plan, model.fitted_on.ridge, coarse);
            let normals: Vec<Normal> = traces.iter().map(|t| problem.of_trace(&start, t, false)).collect();
            let weights: Vec<f64> = traces.iter().map(|t| t.weight).collect();
            separable::choose_ridge(&normals, &weights)
        }
        _ => model.fitted_on.ridge,
    };
    let own_numbers = plan
        .link
        .is_some_and(|link| plan.chain.links[link].effect.has_own_numbers());
    let look = |traces: &mut [Trace<'_>]| {
        let from = |traces: &mut [Trace<'_>], starts: &[Vec<f64>], start: &Fitted| {
            settle(start, traces);
            best_of_starts(
                &problem(traces, plan, ridge, coarse),
                start,
                plan.link,
                starts,
                progress,
            )
        };
        let Some(link) = plan.link.filter(|_| own_numbers) else {
            return from(traces, &plan.starts, &start);
        };
        // Phases belong to a frequency: each start has the records' own numbers as it would choose them.
        let each = plan.starts.iter().map(|values| {
            let mut at = start.clone();
            at.chain.links[link].values.clone_from(values);
            from(traces, std::slice::from_ref(values), &at)
        });
        let best = each
            .min_by(|a, b| a.error.total_cmp(&b.error))
            .unwrap_or_else(|| start.clone());
        settle(&best, traces);
        best
    };
    let mut best = look(&mut traces);
    if plan
        .link
        .is_some_and(|link| plan.chain.links[link].effect.outlasts_records())
    {
        // What repeats now may not have come to its end: records that begin at rest are tried from there as well.
        let mut from_rest: Vec<Trace<'_>> = traces.iter().map(|trace| at_rest(trace, &plan.chain)).collect();
        let other = look(&mut from_rest);
        if other.error < best.error {
            (best, traces) = (other, from_rest);
        }
    }
    for round in 0..4_u32 {
        settle(&best, &mut traces);
        best = problem(&traces, plan, ridge, coarse).descend(best, usize::MAX);
        // States before the records under the new model.
        let chosen: Vec<InitialState> = traces.par_iter().map(|trace| choose(&best, trace)).collect();
        let fine = best.chain.dynamic();
        let mut changed = false;
        for (trace, state) in traces.iter_mut().zip(chosen) {
            if state != trace.initial {
                *trace = trace.starting_at(state, fine);
                changed = true;
            }
        }
        progress(0.75 + 0.04 * f64::from(round));
        if !changed && best.chain.links.iter().all(|link| !link.effect.has_own_numbers()) {
            break;
        }
        best.error = f64::INFINITY;
    }
    settle(&best, &mut traces);
    let of_effects = unsettled.then(|| problem(&traces, plan, ridge, coarse).standard_errors(&best).1);
    best.error = f64::INFINITY;
    for (trace, from) in traces.iter_mut().zip(settled) {
        trace.fit_from = from;
    }
    let last = problem(&traces, plan, ridge, rows.div_ceil(FINAL_ROWS).max(1));
    // The plays from where they have settled; the effects as all samples have shown them.
    let best = last.descend(last.project(best), if unsettled { 0 } else { 3 });
    progress(0.95);
    let (of_coefficients, of_links) = last.standard_errors(&best);
    let errors = (of_coefficients, of_effects.unwrap_or(of_links));
    assemble(dataset, model, &last, &best, errors)
}

fn problem<'a>(traces: &'a [Trace<'a>], plan: &'a Plan, ridge: f64, stride: usize) -> Problem<'a> {
    Problem {
        traces,
        bounds: &plan.bounds,
        ridge,
        stride,
    }
}

fn settle(fitted: &Fitted, traces: &mut [Trace<'_>]) {
    traces
        .par_iter_mut()
        .for_each(|trace| fitted.chain.settle(&fitted.coefficients, trace));
}

/// A record whose drive begins at the low end of its range, from rest there; others as they are.
fn at_rest<'a>(trace: &Trace<'a>, chain: &Chain) -> Trace<'a> {
    let (low, high) = range(trace.record.voltage_v.iter().copied());
    if trace.record.voltage_v[0] - low <= 1e-3 * (high - low) {
        trace.starting_at(InitialState::Remanent { fraction: 0.0 }, chain.dynamic())
    } else {
        trace.clone()
    }
}

fn choose(fitted: &Fitted, trace: &Trace<'_>) -> InitialState {
    let fine = fitted.chain.dynamic();
    let record = trace.record;
    let guess = initial::guess(&record.voltage_v, &record.position_um);
    initial::choose_by(guess, &record.position_um, |initial| {
        let mut other = trace.starting_at(initial, fine);
        fitted.chain.settle(&fitted.coefficients, &mut other);
        fitted.chain.respond(&fitted.coefficients, &other)
    })
}

/// The model's own coefficients where the family stays, else those of a straight line.
fn start_coefficients(model: &Model, chain: &Chain) -> Vec<f64> {
    if chain.design.columns() == model.coefficients.len() {
        model.coefficients.clone()
    } else {
        let mut straight = vec![0.0; chain.design.columns()];
        straight[0] = model.coefficients[0];
        straight[1] = model.coefficients[1];
        straight
    }
}

/// Standard errors of the linear coefficients, and of each link's parameters.
type Errors = (Vec<Option<f64>>, Vec<Vec<Option<f64>>>);

fn assemble(
    dataset: &Dataset,
    model: &Model,
    problem: &Problem<'_>,
    best: &Fitted,
    (standard_errors, of_links): Errors,
) -> Model {
    let mut new = model.clone();
    new.family = best.chain.design.family;
    new.thresholds.clone_from(&best.chain.design.thresholds);
    new.coefficients.clone_from(&best.coefficients);
    new.standard_errors = standard_errors;
    let links = || best.chain.links.iter().zip(&of_links);
    let heat_is_known = problem.traces.iter().all(|trace| trace.record.temperature_c.is_some());
    new.effects = links()
        .filter(|(link, _)| !link.is_of_family())
        .map(|(link, errors)| fitted_effect(link, errors, heat_is_known))
        .collect();
    let of_family = links().find(|(link, _)| link.is_of_family());
    new.envelope = of_family.and_then(|(link, _)| link.effect.envelope(&link.values));
    new.envelope_errors = of_family.and_then(|(_, errors)| Some([(*errors.first()?)?, (*errors.get(1)?)?]));
    (new.input_min, new.input_max) = range(problem.traces.iter().flat_map(|t| t.record.voltage_v.iter().copied()));
    new.fitted_on.dataset.clone_from(&dataset.name);
    new.fitted_on.ridge = problem.ridge;
    new.fitted_on.records = problem
        .traces
        .iter()
        .map(|trace| FittedRecord {
            file: trace.record.file.clone(),
            samples: trace.record.len(),
            sample_rate_hz: 1.0 / trace.record.period_s,
            initial_state: trace.initial.to_string(),
            fitted_from: trace.fit_from,
            weight: trace.weight,
        })
        .collect();
    new.notices = notices(&best.chain, problem);
    new
}

fn fitted_effect(link: &Link, errors: &[Option<f64>], heat_is_known: bool) -> FittedEffect {
    let description = link.effect.description();
    let unit = |named: &Named| {
        if heat_is_known {
            named.unit
        } else {
            link.effect.unit_without_temperature(named)
        }
    };
    FittedEffect {
        name: link.effect.name(),
        parameters: description
            .parameters
            .iter()
            .zip(&link.values)
            .zip(errors)
            .map(|((named, &value), &standard_error)| Parameter {
                name: named.name.to_owned(),
                unit: unit(named).to_owned(),
                value,
                standard_error,
            })
            .collect(),
        definition: link.effect.file().cloned(),
    }
}

/// What the user should know of the fit, in sentences.
fn notices(chain: &Chain, problem: &Problem<'_>) -> Vec<String> {
    let mut notices = Vec::new();
    for (link, bounds) in chain.links.iter().zip(problem.bounds) {
        let description = link.effect.description();
        for ((named, &value), b) in description.parameters.iter().zip(&link.values).zip(bounds) {
            // Zero is where most effects do nothing: that is no bound a user could have wanted to pass.
            let at_bound = value <= b.min || value >= b.max;
            if b.fitted && at_bound && value != b.neutral && value != 0.0 {
                notices.push(format!(
                    "{}: {} = {value:.6} {} stands on its physical bound ({} to {}); something else may be missing",
                    description.name, named.name, named.unit, b.min, b.max
                ));
            }
        }
    }
    notices
}
