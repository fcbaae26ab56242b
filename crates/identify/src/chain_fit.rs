//! Fits all parameters of a chain at once: the linear coefficients in closed form for every trial (variable projection,
//! Golub and Pereyra 1973), those of the effects by damped Gauss-Newton steps within physical bounds.

use crate::chain::{Chain, Stroke};
use crate::chain_trace::Trace;
use crate::effects::Bounds;
use crate::initial;
use crate::model::Simulation;
use crate::normal::Normal;
use crate::start_state::InitialState;
use crate::uncertainty::inflated_variance;
use hysteron_data::Record;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A fitted chain.
#[derive(Clone)]
pub(crate) struct Fitted {
    pub chain: Chain,
    pub coefficients: Vec<f64>,
    /// Weighted squared error.
    pub error: f64,
}

/// What stays the same during a search.
pub(crate) struct Problem<'a> {
    pub traces: &'a [Trace<'a>],
    /// Bounds of each link's parameters, in the order of the chain.
    pub bounds: &'a [Vec<Bounds>],
    /// Ridge on the scaled linear columns.
    pub ridge: f64,
    /// Every so many recorded samples one row.
    pub stride: usize,
}

/// Steps of the search; a Gauss-Newton search that has not settled by then follows a flat valley.
const MOST_STEPS: usize = 25;

/// Relative fall of the error below which a search has settled.
const SETTLED: f64 = 1e-5;

/// Step of numerical derivatives, in units of a parameter's scale: between rounding and bends.
const DIFFERENCE: f64 = 1e-3;

impl Problem<'_> {
    /// Normal equations of all records around a point; the right side is what the coefficients themselves have to give.
    fn system(&self, fitted: &Fitted, derivatives: bool) -> Normal {
        let normals: Vec<Normal> = self
            .traces
            .par_iter()
            .map(|t| self.of_trace(fitted, t, derivatives))
            .collect();
        let mut sum = Normal::new(fitted.coefficients.len() + if derivatives { self.parameters() } else { 0 });
        for (normal, trace) in normals.iter().zip(self.traces) {
            sum.add_scaled(normal, trace.weight);
        }
        sum
    }

    /// Number of parameters of all effects, fitted or not.
    pub(crate) fn parameters(&self) -> usize {
        self.bounds.iter().map(Vec::len).sum()
    }

    pub(crate) fn of_trace(&self, fitted: &Fitted, trace: &Trace<'_>, derivatives: bool) -> Normal {
        let stroke = fitted.chain.stroke(&fitted.coefficients, trace);
        let tangent = fitted.chain.tangent(&fitted.coefficients, trace, &stroke);
        let mut by_parameter = Vec::new();
        if derivatives {
            for (i, bounds) in self.bounds.iter().enumerate() {
                for (j, b) in bounds.iter().enumerate() {
                    by_parameter.push(
                        b.fitted
                            .then(|| derivative(fitted, trace, &stroke, (i, j), b, &tangent.output)),
                    );
                }
            }
        }
        let linear = tangent.columns.len();
        let mut normal = Normal::new(linear + by_parameter.len());
        let mut row = vec![0.0; linear + by_parameter.len()];
        let measured = &trace.record.position_um;
        for k in (trace.fit_from..measured.len()).filter(|k| k % self.stride == 0) {
            let mut own = 0.0;
            for ((cell, column), &c) in row.iter_mut().zip(&tangent.columns).zip(&fitted.coefficients) {
                *cell = column[k];
                own += c * column[k];
            }
            for (cell, column) in row[linear..].iter_mut().zip(&by_parameter) {
                *cell = column.as_ref().map_or(0.0, |column| column[k]);
            }
            normal.add_row(&row, measured[k] - tangent.output[k] + own);
        }
        normal
    }

    /// Solves for the linear coefficients at these effects; for a nonlinear chain around the given coefficients.
    pub(crate) fn project(&self, mut fitted: Fitted) -> Fitted {
        let system = self.system(&fitted, false);
        fitted.coefficients = system.solve(self.ridge);
        fitted.error = if fitted.chain.linear() {
            system.squared_error(&fitted.coefficients)
        } else {
            self.error(&fitted)
        };
        fitted
    }

    /// Weighted squared error at the rows of the search.
    fn error(&self, fitted: &Fitted) -> f64 {
        let errors: Vec<f64> = self
            .traces
            .par_iter()
            .map(|trace| {
                let modelled = fitted.chain.respond(&fitted.coefficients, trace);
                let rows = (trace.fit_from..modelled.len()).filter(|k| k % self.stride == 0);
                trace.weight
                    * rows
                        .map(|k| (trace.record.position_um[k] - modelled[k]).powi(2))
                        .sum::<f64>()
            })
            .collect();
        errors.iter().sum()
    }

    /// Searches from a point to the bottom of its valley.
    pub(crate) fn descend(&self, start: Fitted, most_steps: usize) -> Fitted {
        let mut here = start;
        let mut damping = 1e-3;
        for _ in 0..most_steps.min(MOST_STEPS) {
            let system = self.system(&here, true);
            let mut fell = 0.0;
            if self.promised(&here, &system) < SETTLED {
                break;
            }
            // A step that does not go down is tried again, shorter.
            for _ in 0..6 {
                let Some(trial) = self.step(&here, &system, damping) else {
                    return here;
                };
                let trial = self.judge(trial);
                if trial.error < here.error {
                    fell = (here.error - trial.error) / here.error;
                    here = trial;
                    damping = (damping * 0.1).max(1e-9);
                    break;
                }
                damping *= 10.0;
            }
            if fell < SETTLED {
                break;
            }
        }
        here
    }

    /// The share of the error that an undamped step would take away if everything were linear.
    fn promised(&self, here: &Fitted, system: &Normal) -> f64 {
        if !here.error.is_finite() {
            return 1.0;
        }
        match self.solution(here, system, 1e-9) {
            Some(solution) => 1.0 - system.squared_error(&solution) / here.error,
            None => 0.0,
        }
    }

    /// The error at a trial: coefficients solved anew, or for a nonlinear chain as the step gave them.
    fn judge(&self, mut trial: Fitted) -> Fitted {
        if trial.chain.linear() {
            self.project(trial)
        } else {
            trial.error = self.error(&trial);
            trial
        }
    }

    /// One damped step within the bounds.
    fn step(&self, here: &Fitted, system: &Normal, damping: f64) -> Option<Fitted> {
        let linear = here.coefficients.len();
        let solution = self.solution(here, system, damping)?;
        let mut trial = here.clone();
        trial.coefficients = solution[..linear].to_vec();
        let mut changes = solution[linear..].iter();
        for (link, bounds) in trial.chain.links.iter_mut().zip(self.bounds) {
            for ((value, b), change) in link.values.iter_mut().zip(bounds).zip(&mut changes) {
                if b.fitted {
                    *value = (*value + change).clamp(b.min, b.max);
                }
            }
        }
        Some(trial)
    }

    /// Linear coefficients and changes of parameters that solve the damped normal equations within the bounds.
    fn solution(&self, here: &Fitted, system: &Normal, damping: f64) -> Option<Vec<f64>> {
        let linear = here.coefficients.len();
        let flat: Vec<(Bounds, f64)> = self
            .bounds
            .iter()
            .zip(&here.chain.links)
            .flat_map(|(bounds, link)| bounds.iter().copied().zip(link.values.iter().copied()))
            .collect();
        let mut fixed: Vec<Option<f64>> = flat.iter().map(|(b, _)| (!b.fitted).then_some(0.0)).collect();
        // Parameters that would leave their bounds are put on them, and the others solved again.
        for _ in 0..=flat.len() {
            let solution = solve(system, linear, self.ridge, damping, &fixed)?;
            let mut inside = true;
            for (j, (b, value)) in flat.iter().enumerate() {
                let to = value + solution[linear + j];
                if fixed[j].is_none() && !(b.min..=b.max).contains(&to) {
                    fixed[j] = Some(to.clamp(b.min, b.max) - value);
                    inside = false;
                }
            }
            if inside {
                return Some(solution);
            }
        }
        None
    }

    /// Standard errors of coefficients and parameters: sandwich covariance as for the hysteresis alone (see
    /// [`crate::uncertainty`]), with the effects' derivative columns.
    pub(crate) fn standard_errors(&self, fitted: &Fitted) -> (Vec<Option<f64>>, Vec<Vec<Option<f64>>>) {
        let parts: Vec<(Normal, f64)> = self
            .traces
            .par_iter()
            .map(|trace| {
                let modelled = fitted.chain.respond(&fitted.coefficients, trace);
                let measured = &trace.record.position_um;
                let residual: Vec<f64> = measured
                    .iter()
                    .zip(&modelled)
                    .skip(trace.fit_from)
                    .map(|(y, m)| y - m)
                    .collect();
                // Rows of a stride share the residual's correlation time.
                let variance = inflated_variance(&residual) / self.stride as f64;
                (self.of_trace(fitted, trace, true), variance)
            })
            .collect();
        let mut sum = Normal::new(fitted.coefficients.len() + self.parameters());
        for ((normal, _), trace) in parts.iter().zip(self.traces) {
            sum.add_scaled(normal, trace.weight);
        }
        let spectrum = sum.spectrum();
        let undetermined = spectrum.undetermined();
        let inverse = spectrum.inverse(self.ridge);
        let mut middle = DMatrix::zeros(inverse.nrows(), inverse.ncols());
        for ((normal, variance), trace) in parts.iter().zip(self.traces) {
            middle += normal.matrix() * (trace.weight * trace.weight * variance);
        }
        let covariance = &inverse * middle * &inverse;
        let error = |i: usize| {
            let known = !undetermined.iter().any(|group| group.contains(&i));
            known
                .then(|| covariance[(i, i)].max(0.0).sqrt())
                .filter(|e| e.is_finite())
        };
        let linear = fitted.coefficients.len();
        let mut next = linear;
        let mut of_links = Vec::new();
        for (bounds, link) in self.bounds.iter().zip(&fitted.chain.links) {
            let mut of_link = Vec::new();
            for (b, &value) in bounds.iter().zip(&link.values) {
                // On a bound there is no valley to measure.
                let free = b.fitted && value > b.min && value < b.max;
                of_link.push(error(next).filter(|&e| free && e > 0.0));
                next += 1;
            }
            of_links.push(of_link);
        }
        ((0..linear).map(error).collect(), of_links)
    }
}

/// Change of the output with one parameter, by a difference that stays within the bounds.
fn derivative(
    fitted: &Fitted,
    trace: &Trace<'_>,
    stroke: &Stroke,
    (link, j): (usize, usize),
    b: &Bounds,
    here: &[f64],
) -> Vec<f64> {
    let value = fitted.chain.links[link].values[j];
    let forward = DIFFERENCE * b.scale;
    let step = if value + forward <= b.max { forward } else { -forward };
    let mut shifted = fitted.chain.clone();
    shifted.links[link].values[j] = value + step;
    let there = shifted.respond_again(link, &fitted.coefficients, trace, stroke);
    there.iter().zip(here).map(|(a, b)| (a - b) / step).collect()
}

/// Damped normal equations in scaled columns; `fixed` parameters move by what they are given.
fn solve(system: &Normal, linear: usize, ridge: f64, damping: f64, fixed: &[Option<f64>]) -> Option<Vec<f64>> {
    let matrix = system.matrix();
    let n = matrix.nrows();
    let mut rhs = DVector::from_column_slice(system.right_side());
    let mut free: Vec<usize> = (0..linear).collect();
    for (j, fixed) in fixed.iter().enumerate() {
        let column = linear + j;
        match fixed {
            Some(change) => rhs.axpy(-change, &matrix.column(column), 1.0),
            // A parameter without any effect here stays.
            None if matrix[(column, column)] > 0.0 => free.push(column),
            None => {}
        }
    }
    let m = free.len();
    let scale: Vec<f64> = free
        .iter()
        .map(|&i| matrix[(i, i)].sqrt())
        .map(|s| if s > 0.0 { s } else { 1.0 })
        .collect();
    let mut scaled = DMatrix::from_fn(m, m, |a, b| matrix[(free[a], free[b])] / (scale[a] * scale[b]));
    for (a, &i) in free.iter().enumerate() {
        scaled[(a, a)] += if i < linear { ridge.max(1e-13) } else { damping };
    }
    let solution = scaled
        .cholesky()?
        .solve(&DVector::from_fn(m, |a, _| rhs[free[a]] / scale[a]));
    let mut full = vec![0.0; n];
    for (a, &i) in free.iter().enumerate() {
        full[i] = solution[a] / scale[a];
    }
    for (j, change) in fixed.iter().enumerate() {
        full[linear + j] = change.unwrap_or(full[linear + j]);
    }
    full.iter().all(|x| x.is_finite()).then_some(full)
}

/// Prepares a record: state before it guessed from the record, then chosen under the chain.
pub(crate) fn prepare<'a>(chain: &Chain, coefficients: &[f64], record: &'a Record, guess: InitialState) -> Trace<'a> {
    let fine = chain.dynamic();
    let trace = Trace::new(record, guess, fine);
    let from = |initial| settled(chain, coefficients, trace.starting_at(initial, fine));
    let chosen = initial::choose_by(guess, &record.position_um, |initial| {
        chain.respond(coefficients, &from(initial))
    });
    from(chosen)
}

fn settled<'a>(chain: &Chain, coefficients: &[f64], mut trace: Trace<'a>) -> Trace<'a> {
    chain.settle(coefficients, &mut trace);
    trace
}

/// Runs a chain freely over a record from a state that is known.
pub(crate) fn simulate_from(chain: &Chain, coefficients: &[f64], record: &Record, initial: InitialState) -> Vec<f64> {
    let trace = Trace::new(record, initial, chain.dynamic());
    chain.respond(coefficients, &settled(chain, coefficients, trace))
}

/// Runs a chain freely over a record.
pub(crate) fn simulate(chain: &Chain, coefficients: &[f64], record: &Record) -> Simulation {
    let trace = prepare(
        chain,
        coefficients,
        record,
        initial::guess(&record.voltage_v, &record.position_um),
    );
    Simulation {
        output: chain.respond(coefficients, &trace),
        initial: trace.initial,
    }
}
