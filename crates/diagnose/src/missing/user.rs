//! Effects of the user's own among the candidates: the same equations that `add` fits, their parameters searched here.
//!
//! What such an effect does to the position is no column with a coefficient of its own: its parameters say how large it is.

use crate::missing::bench::{Bench, Trial, solve_signed, target};
use crate::missing::chain::{self, Effect};
use crate::missing::is_given;
use crate::missing::regression::Gram;
use crate::missing::traces::Trace;
use hysteron_identify::FittedEffect;
use hysteron_identify::effects::{Effect as _, Signals, UserEffect};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Starts that are followed two steps down their valley.
const FOLLOWED: usize = 10;

/// Of those, how many go on to the bottom.
const FINISHED: usize = 3;

/// Steps to the bottom of a valley; the search has settled before, or runs along a flat one.
const STEPS: usize = 10;

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

/// What effects behind the hysteresis add to the position, one after another; `None` where there are none.
pub(crate) fn added_to_position(effects: &[Effect], trace: &Trace, reference_um: Option<&[f64]>) -> Option<Vec<f64>> {
    let reference = reference_um?;
    let mut position: Option<Vec<f64>> = None;
    for effect in effects {
        let Effect::User { effect, values } = effect else {
            continue;
        };
        if !effect.acts_on_position() {
            continue;
        }
        let middle_um = trace.scales.middle_um;
        let y = position.get_or_insert_with(|| reference.iter().map(|y| y + middle_um).collect());
        let stack_v: Vec<f64> = if effect.uses_stack_voltage() {
            let s = &trace.scales;
            let drive = chain::drive_at_stack(effects, trace);
            drive.iter().map(|x| s.middle_v + s.unit_v * x).collect()
        } else {
            Vec::new()
        };
        let other = other_axis_v(trace);
        effect.on_position(values, &signals(trace, &stack_v, other.as_deref()), y);
    }
    let mut added = position?;
    for (y, before) in added.iter_mut().zip(reference) {
        *y -= before + trace.scales.middle_um;
    }
    Some(added)
}

/// Adds that to a modelled position.
pub(crate) fn add_to_position(
    effects: &[Effect],
    trace: &Trace,
    reference_um: Option<&[f64]>,
    modelled_um: &mut [f64],
) {
    if let Some(added) = added_to_position(effects, trace, reference_um) {
        modelled_um.iter_mut().zip(added).for_each(|(y, a)| *y += a);
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
        progress(effect.name());
        let (search, effect) = (
            Search {
                given: &current.effects,
                effect: *effect,
            },
            *effect,
        );
        let found = search.best(bench, current);
        let mut trial = bench.fit_to_the_end(&search.with(&found));
        if effect.acts_on_position() {
            // The position that it acts on is known only now.
            let here = bench.referring_to(&trial);
            let shares = search.descend(&here, found, STEPS).1;
            trial = here.fit_to_the_end(&search.with(&shares));
        }
        (effect.name(), trial)
    };
    own.iter().filter(absent).map(try_one).collect()
}

/// The search for the parameters of one effect on a chain, all parameters as shares of the way between their bounds.
struct Search<'a> {
    given: &'a [Effect],
    effect: UserEffect,
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
    fn best(&self, bench: &Bench<'_>, current: &Trial) -> Vec<f64> {
        let starts: Vec<Vec<f64>> = self
            .effect
            .starts()
            .iter()
            .map(|values| self.effect.shares(values))
            .collect();
        let mut looked = self.quick_look(bench, current, starts);
        looked.truncate(FOLLOWED);
        let follow = |points: Vec<Vec<f64>>, steps: usize| {
            let mut followed: Vec<(f64, Vec<f64>)> = points
                .into_par_iter()
                .with_max_len(1)
                .map(|shares| self.descend(bench, shares, steps))
                .collect();
            followed.sort_by(|a, b| a.0.total_cmp(&b.0));
            followed.into_iter().map(|(_, shares)| shares).collect::<Vec<_>>()
        };
        let mut followed = follow(looked, 2);
        followed.truncate(FINISHED);
        follow(followed, STEPS).into_iter().next().unwrap_or_default()
    }

    /// Starts in the order of what their change of the modelled position takes of the squared error, up to a factor and
    /// everything that is linear fitted anew.
    fn quick_look(&self, bench: &Bench<'_>, current: &Trial, starts: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let x = &current.coefficients;
        let weighted = |of: &(dyn Fn(usize, &Trace) -> DVector<f64> + Sync)| -> DVector<f64> {
            let parts = bench.coarse.iter().map(|(i, t)| {
                let weight = (bench.weights[*i] / t.rows.len().max(1) as f64).sqrt();
                of(*i, t) * weight
            });
            DVector::from_vec(parts.flat_map(|part| part.data.as_vec().clone()).collect())
        };
        let plain: Vec<Response> = bench
            .coarse
            .iter()
            .map(|(i, t)| Response::new(bench, *i, t, self.given))
            .collect();
        let rows: usize = plain.iter().map(|r| r.target.len()).sum();
        let mut stacked = DMatrix::zeros(rows, x.len());
        let mut from = 0;
        for ((i, _), response) in bench.coarse.iter().zip(&plain) {
            let n = response.target.len();
            let weight = (bench.weights[*i] / n.max(1) as f64).sqrt();
            stacked.rows_mut(from, n).copy_from(&(&response.matrix * weight));
            from += n;
        }
        let basis = stacked.qr().q();
        let beyond = |v: DVector<f64>| {
            let own = &basis * basis.tr_mul(&v);
            v - own
        };
        let index = |i: usize| bench.coarse.iter().position(|(j, _)| *j == i).unwrap_or(0);
        let left = beyond(weighted(&|i, _| plain[index(i)].target.clone()));
        let mut scored: Vec<(f64, Vec<f64>)> = starts
            .into_par_iter()
            .map(|shares| {
                let effects = self.with(&shares);
                let change = beyond(weighted(&|i, t| {
                    plain[index(i)].beside(bench, i, t, &effects, x) - plain[index(i)].modelled(x)
                }));
                let squares = change.norm_squared();
                let taken = if squares > 0.0 {
                    change.dot(&left).powi(2) / squares
                } else {
                    0.0
                };
                (taken, shares)
            })
            .collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        scored.into_iter().map(|(_, shares)| shares).collect()
    }

    /// Gauss-Newton steps within the bounds, everything that is linear fitted anew at each (variable projection).
    fn descend(&self, bench: &Bench<'_>, start: Vec<f64>, steps: usize) -> (f64, Vec<f64>) {
        let mut here = (bench.objective(&self.with(&start)), start);
        for _ in 0..steps {
            let step = self.step(bench, &here.1);
            let mut length = 1.0;
            let lower = (0..5).find_map(|_| {
                let pairs = here.1.iter().zip(&step);
                let shares: Vec<f64> = pairs
                    .map(|(share, step)| (share + length * step).clamp(0.0, 1.0))
                    .collect();
                let value = bench.objective(&self.with(&shares));
                length *= 0.35;
                (value < here.0).then_some((value, shares))
            });
            // A ten-thousandth of one record's logarithm is far below what any verdict rests on.
            match lower {
                Some(lower) if here.0 - lower.0 > 1e-4 => here = lower,
                Some(lower) => return lower,
                None => break,
            }
        }
        here
    }

    /// The step to the bottom if everything were linear, parameters on their bounds kept there where it leads out.
    fn step(&self, bench: &Bench<'_>, shares: &[f64]) -> Vec<f64> {
        let (effects, count) = (self.with(shares), shares.len());
        let responses: Vec<Response> = bench
            .coarse
            .iter()
            .map(|(i, t)| Response::new(bench, *i, t, &effects))
            .collect();
        let n = chain::width(&bench.base, &effects);
        let grams = |with: &dyn Fn(usize) -> DMatrix<f64>, n: usize| {
            let each = bench.coarse.iter().zip(&responses).enumerate();
            let grams: Vec<(usize, Gram)> = each
                .map(|(k, ((i, _), r))| (*i, Gram::new(&with(k), &r.target)))
                .collect();
            bench.pooled(&grams, None, n)
        };
        let x = solve_signed(&grams(&|k| responses[k].matrix.clone(), n), &bench.base, &effects);
        let beside: Vec<(f64, Vec<Effect>)> = (0..count)
            .map(|j| {
                let mut moved = shares.to_vec();
                let apart = if moved[j] + APART > 1.0 { -APART } else { APART };
                moved[j] += apart;
                (apart, self.with(&moved))
            })
            .collect();
        let extended: Vec<DMatrix<f64>> = bench
            .coarse
            .iter()
            .zip(&responses)
            .map(|((i, t), response)| {
                let mut matrix = response.matrix.clone().resize_horizontally(n + count, 0.0);
                let modelled = response.modelled(&x);
                for (j, (apart, effects)) in beside.iter().enumerate() {
                    let change = response.beside(bench, *i, t, effects, &x) - &modelled;
                    matrix.set_column(n + j, &(change / *apart));
                }
                matrix
            })
            .collect();
        let system = grams(&|k| extended[k].clone(), n + count);
        let mut keep = vec![true; n + count];
        let mut step = vec![0.0; count];
        for _ in 0..=count {
            let solution = system.solve(bench.base.columns(), bench.base.ridge, &keep);
            step = solution.iter().skip(n).copied().collect();
            let leads_out = |j: usize| keep[n + j] && !(0.0..=1.0).contains(&(shares[j] + 1e-3 * step[j].signum()));
            let Some(out) = (0..count).find(|&j| step[j] != 0.0 && leads_out(j)) else {
                break;
            };
            keep[n + out] = false;
        }
        let most = step.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
        if most > LONGEST {
            step.iter_mut().for_each(|s| *s *= LONGEST / most);
        }
        step
    }
}

/// Columns and target of one record's rows.
struct Response {
    matrix: DMatrix<f64>,
    target: DVector<f64>,
    /// Position less target: what effects add.
    position: DVector<f64>,
}

impl Response {
    fn new(bench: &Bench<'_>, i: usize, trace: &Trace, effects: &[Effect]) -> Self {
        Self {
            matrix: chain::matrix(&bench.base, effects, trace, bench.reference(i)),
            target: target(trace, effects, bench.reference(i)),
            position: target(trace, &[], None),
        }
    }

    /// The modelled position.
    fn modelled(&self, x: &DVector<f64>) -> DVector<f64> {
        &self.matrix * x + &self.position - &self.target
    }

    /// The same at other parameters.
    fn beside(&self, bench: &Bench<'_>, i: usize, trace: &Trace, effects: &[Effect], x: &DVector<f64>) -> DVector<f64> {
        let behind = matches!(effects.last(), Some(Effect::User { effect, .. }) if effect.acts_on_position());
        let added = &self.position - target(trace, effects, bench.reference(i));
        if behind {
            &self.matrix * x + added
        } else {
            chain::matrix(&bench.base, effects, trace, bench.reference(i)) * x + added
        }
    }
}
