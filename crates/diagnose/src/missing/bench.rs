//! The workbench: records, a hysteresis base, and how well it fits with trial effects.

use crate::missing::chain::{self, Base, Effect, Shape};
use crate::missing::regression::Gram;
use crate::missing::traces::{Trace, Traces};
use crate::missing::user;
use hysteron_data::Role;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A fitted trial.
#[derive(Debug, Clone)]
pub(crate) struct Trial {
    pub effects: Vec<Effect>,
    /// Ridge on the base, chosen with these effects.
    pub ridge: f64,
    pub coefficients: DVector<f64>,
    /// Measured minus modelled at the rows of each record, fitted to the identification records.
    pub residuals: Vec<DVector<f64>>,
    /// Mean squared error of each record when it takes no part in the fit, at most four times that when it does: what only
    /// one record shows (the highest rate, the longest hold) cannot be foretold from the others, with or without an effect.
    pub held_out: Vec<f64>,
    /// Rows that count as independent, each record.
    pub effective: Vec<f64>,
    pub identify_percent: f64,
    pub validate_percent: f64,
}

/// Records, base and weights.
#[derive(Clone)]
pub(crate) struct Bench<'a> {
    pub traces: &'a Traces,
    pub base: Base,
    pub noise_um: f64,
    /// Weight of each record's mean squared error.
    pub weights: Vec<f64>,
    /// Modelled position of each record on its grid.
    pub reference_um: Vec<Vec<f64>>,
    /// Identification records on their grids with fewer rows, for searches.
    pub coarse: Vec<(usize, Trace)>,
    /// Ridge on the base for all trials, where none of their own is wanted.
    ridge: Option<f64>,
}

/// A stop gives way by less than this share of what pushes against it; otherwise it is a bend.
pub(crate) const MOST_COMPLIANT: f64 = 0.5;

/// Rows of a record that a search looks at.
pub(crate) const SEARCH_ROWS: usize = 300;

/// Ridges on the shape-free base, chosen by leaving out one record at a time.
const RIDGES: [f64; 5] = [1e-9, 1e-8, 1e-7, 1e-6, 1e-5];

impl<'a> Bench<'a> {
    /// The base alone: ridge and weights chosen, nothing else in it but `given` effects.
    pub(crate) fn new(traces: &'a Traces, base: Base, given: &[Effect], noise_um: f64) -> (Self, Trial) {
        let coarse = traces
            .each
            .iter()
            .enumerate()
            .filter(|(_, t)| t.role == Role::Identify)
            .map(|(i, t)| {
                let t = t.on_grid();
                let stride = t.rows.len().div_ceil(SEARCH_ROWS).max(1);
                let rows = t.rows.iter().copied().step_by(stride).collect();
                (i, Trace { rows, ..t.clone() })
            })
            .collect();
        let mut bench = Self {
            traces,
            base,
            noise_um,
            weights: vec![1.0; traces.each.len()],
            reference_um: Vec::new(),
            coarse,
            ridge: None,
        };
        bench.weights = bench.weights_of(|_| (0.01 * traces.stroke_um).powi(2));
        let mut trial = bench.fit(given, None);
        for _ in 0..2 {
            bench.weights = bench.weights_of(|i| mean_square(&trial.residuals[i]));
            trial = bench.fit(given, None);
        }
        bench.base.ridge = trial.ridge;
        bench.take_reference(&trial);
        (bench, trial)
    }

    fn weights_of(&self, structure: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..self.traces.each.len())
            .map(|i| 1.0 / (self.noise_um.powi(2) + structure(i)))
            .collect()
    }

    /// This bench with a trial's hysteresis output as what creep, heat and stops act on.
    pub(crate) fn referring_to(&self, trial: &Trial) -> Self {
        let mut bench = self.clone();
        bench.take_reference(trial);
        bench
    }

    /// This bench with one ridge for all trials.
    pub(crate) fn with_ridge(&self, ridge: f64) -> Self {
        Self {
            ridge: Some(ridge),
            ..self.clone()
        }
    }

    /// Takes a trial's hysteresis output as what creep, heat and stops act on.
    pub(crate) fn take_reference(&mut self, trial: &Trial) {
        let columns = self.base.columns();
        self.reference_um = self
            .traces
            .each
            .par_iter()
            .map(|t| {
                chain::simulate(
                    &self.base,
                    &trial.effects,
                    t.on_grid(),
                    None,
                    &trial.coefficients,
                    columns,
                )
            })
            .collect();
    }

    pub(crate) fn reference(&self, i: usize) -> Option<&[f64]> {
        self.reference_um.get(i).map(Vec::as_slice)
    }

    /// The ridge under which the identification records forecast each other best; `without` pools all of them but one,
    /// `mean_square` is the error of one under coefficients.
    fn choose_ridge(
        &self,
        without: impl Fn(usize) -> Gram + Sync,
        mean_square: impl Fn(usize, &DVector<f64>) -> f64 + Sync,
    ) -> f64 {
        if !matches!(self.base.shape, Shape::Free | Shape::Plane) {
            return self.base.ridge;
        }
        if let Some(ridge) = self.ridge {
            return ridge;
        }
        let errors: Vec<[f64; RIDGES.len()]> = self
            .identify()
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|out| {
                let others = without(out);
                RIDGES.map(|ridge| {
                    let x = others.solve(self.base.columns(), ridge, &[]);
                    // The logarithm: where an effect is missing, the records that it spoils must not choose for the others.
                    (self.noise_um.powi(2) + mean_square(out, &x)).ln()
                })
            })
            .collect();
        let error = |k: usize| errors.iter().map(|each| each[k]).sum::<f64>();
        let best = (0..RIDGES.len())
            .min_by(|&a, &b| error(a).total_cmp(&error(b)))
            .unwrap_or(2);
        RIDGES[best]
    }

    pub(crate) fn pooled(&self, grams: &[(usize, Gram)], n: usize) -> Gram {
        let mut sum = Gram::zeros(n);
        for (record, gram) in grams {
            sum.add(gram, self.weights[*record] / gram.rows.max(1) as f64);
        }
        sum
    }

    pub(crate) fn grams_of_identify(&self, effects: &[Effect]) -> Vec<(usize, Gram)> {
        self.coarse
            .par_iter()
            .map(|(i, t)| {
                let matrix = chain::matrix(&self.base, effects, t, self.reference(*i));
                (*i, Gram::new(&matrix, &target(t, effects, self.reference(*i))))
            })
            .collect()
    }

    /// Weighted squared error on the identification records, for searches; each record of the base alone counts about 1.
    pub(crate) fn objective(&self, effects: &[Effect]) -> f64 {
        let grams = self.grams_of_identify(effects);
        let n = chain::width(&self.base, effects);
        let pooled = self.pooled(&grams, n);
        let x = solve_signed(&pooled, &self.base, effects);
        // The logarithm: a record explained to a tenth counts as much as another one explained to a tenth.
        grams
            .iter()
            .map(|(_, gram)| {
                let mean = gram.squared_error(&x) / gram.rows.max(1) as f64;
                (self.noise_um.powi(2) + mean).ln()
            })
            .enumerate()
            .map(|(k, v)| v * self.coarse[k].1.rows.len() as f64 / SEARCH_ROWS as f64)
            .sum::<f64>()
    }

    /// Fits a trial exactly: all rows, ridge of its own, weights from its own residuals, each record once left out.
    pub(crate) fn fit(&self, effects: &[Effect], reweigh: Option<usize>) -> Trial {
        let n = chain::width(&self.base, effects);
        let systems: Vec<(DMatrix<f64>, DVector<f64>, Gram)> = self
            .traces
            .each
            .par_iter()
            .enumerate()
            .map(|(i, t)| {
                let t = t.on_grid();
                let matrix = chain::matrix(&self.base, effects, t, self.reference(i));
                let target = target(t, effects, self.reference(i));
                let gram = Gram::new(&matrix, &target);
                (matrix, target, gram)
            })
            .collect();
        let identify: Vec<usize> = self.identify().collect();
        let pool = |weights: &[f64], without: Option<usize>| {
            let mut sum = Gram::zeros(n);
            for &i in identify.iter().filter(|&&i| Some(i) != without) {
                let gram = &systems[i].2;
                sum.add(gram, weights[i] / gram.rows.max(1) as f64);
            }
            sum
        };
        let mean = |i: usize, x: &DVector<f64>| systems[i].2.squared_error(x) / systems[i].2.rows.max(1) as f64;
        let mut weights = self.weights.clone();
        let mut base = self.base.clone();
        base.ridge = self.choose_ridge(|i| pool(&weights, Some(i)), mean);
        let mut coefficients = solve_signed(&pool(&weights, None), &base, effects);
        for _ in 0..reweigh.unwrap_or(0) {
            for (i, weight) in weights.iter_mut().enumerate() {
                *weight = 1.0 / (self.noise_um.powi(2) + mean(i, &coefficients));
            }
            coefficients = solve_signed(&pool(&weights, None), &base, effects);
        }
        let residuals: Vec<DVector<f64>> = systems.iter().map(|(a, y, _)| y - a * &coefficients).collect();
        let held_out: Vec<f64> = (0..systems.len())
            .into_par_iter()
            .map(|i| {
                if identify.contains(&i) && identify.len() > 1 {
                    let without = solve_signed(&pool(&weights, Some(i)), &base, effects);
                    mean(i, &without).min(4.0 * mean(i, &coefficients))
                } else {
                    mean(i, &coefficients)
                }
            })
            .collect();
        let effective = residuals.iter().map(effective_samples).collect();
        let percent = |role: Role| {
            let squares: Vec<f64> = (0..residuals.len())
                .filter(|&i| self.traces.each[i].role == role && self.traces.each[i].stroke_um > 0.0)
                .map(|i| 1e4 * mean_square(&residuals[i]) / self.traces.each[i].stroke_um.powi(2))
                .collect();
            (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
        };
        Trial {
            effects: effects.to_vec(),
            ridge: base.ridge,
            identify_percent: percent(Role::Identify),
            validate_percent: percent(Role::Validate),
            coefficients,
            residuals,
            held_out,
            effective,
        }
    }

    /// As [`Self::fit`]; what acts on the position is fitted again on the position that comes out, until that stands still.
    pub(crate) fn fit_to_the_end(&self, effects: &[Effect]) -> Trial {
        let stop = effects.iter().find_map(|e| match *e {
            Effect::EndStop { low_um, high_um } => Some([low_um, high_um]),
            _ => None,
        });
        let trial = match stop {
            Some(within_um) => self.moving_freely(effects, within_um).fit(effects, Some(2)),
            None => self.fit(effects, Some(2)),
        };
        if !effects.iter().any(Effect::acts_on_position) {
            return trial;
        }
        let mut trial = trial;
        for _ in 0..2 {
            trial = self.referring_to(&trial).fit(effects, Some(2));
        }
        trial
    }

    /// This bench with what the hysteresis does where no stop holds it: fitted to the rows within a range of position.
    fn moving_freely(&self, effects: &[Effect], within_um: [f64; 2]) -> Self {
        let free: Vec<Effect> = effects
            .iter()
            .filter(|e| !matches!(e, Effect::EndStop { .. }))
            .cloned()
            .collect();
        let x = self.fit_within(&self.parts_of_identify(&free), &free, within_um);
        let mut bench = self.clone();
        bench.reference_um = self
            .traces
            .each
            .par_iter()
            .enumerate()
            .map(|(i, t)| {
                chain::simulate(
                    &self.base,
                    &free,
                    t.on_grid(),
                    self.reference(i),
                    &x,
                    self.base.columns(),
                )
            })
            .collect();
        bench
    }

    /// Rows of the identification records, for [`Self::fit_within`].
    fn parts_of_identify(&self, effects: &[Effect]) -> Vec<(usize, DMatrix<f64>, DVector<f64>)> {
        self.coarse
            .iter()
            .map(|(i, t)| {
                (
                    *i,
                    chain::matrix(&self.base, effects, t, self.reference(*i)),
                    target(t, effects, self.reference(*i)),
                )
            })
            .collect()
    }

    /// Coefficients from the rows whose position lies within a range.
    fn fit_within(
        &self,
        parts: &[(usize, DMatrix<f64>, DVector<f64>)],
        effects: &[Effect],
        within_um: [f64; 2],
    ) -> DVector<f64> {
        let grams: Vec<(usize, Gram)> = parts
            .iter()
            .map(|(i, matrix, y)| {
                let rows: Vec<usize> = (0..y.len())
                    .filter(|&k| (within_um[0]..within_um[1]).contains(&y[k]))
                    .collect();
                (*i, Gram::new(&matrix.select_rows(&rows), &y.select_rows(&rows)))
            })
            .collect();
        let pooled = self.pooled(&grams, chain::width(&self.base, effects));
        solve_signed(&pooled, &self.base, effects)
    }

    /// The hard stop that explains most, of those given as ranges of position.
    pub(crate) fn best_stop(&self, given: &[Effect], ranges_um: impl Iterator<Item = [f64; 2]>) -> Option<[f64; 2]> {
        let parts = self.parts_of_identify(given);
        let error = |range: [f64; 2]| -> f64 {
            let x = self.fit_within(&parts, given, range);
            // What the hysteresis does beyond the stop, and what the stage does.
            let (mut pushes, mut gives) = (0.0, 0.0);
            let held: Vec<(DVector<f64>, DVector<f64>)> = parts
                .iter()
                .map(|(_, matrix, y)| {
                    let free = matrix * &x;
                    let stopped = free.map(|y| y.clamp(range[0], range[1]));
                    let (beyond, left) = (free - &stopped, y - stopped);
                    pushes += beyond.norm_squared();
                    gives += beyond.dot(&left);
                    (beyond, left)
                })
                .collect();
            let compliance = (gives / pushes.max(f64::MIN_POSITIVE)).clamp(0.0, MOST_COMPLIANT);
            held.iter()
                .map(|(beyond, left)| (self.noise_um.powi(2) + mean_square(&(left - beyond * compliance))).ln())
                .sum()
        };
        ranges_um
            .map(|range| (error(range), range))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|best| best.1)
    }

    /// The coefficients of one effect's own columns.
    pub(crate) fn coefficients_of(&self, trial: &Trial, effect: &Effect) -> Vec<f64> {
        let before: Vec<Effect> = trial.effects.iter().take_while(|e| *e != effect).cloned().collect();
        let from = chain::width(&self.base, &before);
        let count = chain::width(&self.base, std::slice::from_ref(effect)) - self.base.columns();
        trial.coefficients.iter().skip(from).take(count).copied().collect()
    }

    /// Parameters of some of a trial's effects.
    pub(crate) fn parameters(&self, trial: &Trial, effects: &[&Effect]) -> Vec<crate::diagnosis::EffectParameter> {
        effects
            .iter()
            .flat_map(|e| crate::missing::judge::parameters(e, &self.coefficients_of(trial, e)))
            .collect()
    }

    /// Takes the weights from a trial's residuals.
    pub(crate) fn weigh_by(&mut self, trial: &Trial) {
        self.weights = self.weights_of(|i| mean_square(&trial.residuals[i]));
    }

    /// Measured minus modelled at the recorded samples, run-in included.
    pub(crate) fn full_residuals(&self, trial: &Trial) -> Vec<Vec<f64>> {
        let referring = self.referring_to(trial);
        let columns = chain::width(&self.base, &trial.effects);
        referring
            .traces
            .each
            .par_iter()
            .enumerate()
            .map(|(i, t)| {
                let reference = referring.reference(i);
                let on_grid = t.on_grid();
                let mut y = chain::simulate(
                    &self.base,
                    &trial.effects,
                    on_grid,
                    reference,
                    &trial.coefficients,
                    columns,
                );
                user::add_beyond(&trial.effects, on_grid, reference, &mut y);
                t.position_um.iter().zip(t.recorded(&y)).map(|(m, y)| m - y).collect()
            })
            .collect()
    }

    pub(crate) fn identify(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.traces.each.len()).filter(|&i| self.traces.each[i].role == Role::Identify)
    }
}

/// What the columns have to give: the position, less what effects of the user's own make of it beyond them.
pub(crate) fn target(trace: &Trace, effects: &[Effect], reference_um: Option<&[f64]>) -> DVector<f64> {
    let at_rows = |series: &[f64]| DVector::from_iterator(trace.rows.len(), trace.rows.iter().map(|&k| series[k]));
    match user::beyond(effects, trace, reference_um) {
        Some(beyond) => at_rows(&trace.position_um) - at_rows(&beyond),
        None => at_rows(&trace.position_um),
    }
}

pub(crate) fn mean_square(values: &DVector<f64>) -> f64 {
    values.norm_squared() / values.len().max(1) as f64
}

/// Least squares with physical signs: an active set in which coefficients enter one at a time and leave where the way to the
/// new solution takes them to zero, to enter again where that helps (Lawson, Hanson 1974, chapter 23).
pub(crate) fn solve_signed(gram: &Gram, base: &Base, effects: &[Effect]) -> DVector<f64> {
    let signed = chain::not_negative(base, effects);
    let mut keep: Vec<bool> = signed.iter().map(|s| !s).collect();
    let solve = |keep: &[bool]| gram.solve(base.columns(), base.ridge, keep);
    let mut x = solve(&keep);
    // Each step lowers the squared error; where rounding makes one go round, what entered last is as good.
    for _ in 0..3 * signed.len() {
        let Some(entering) = gram.steepest(&x, |j| signed[j] && !keep[j]) else {
            break;
        };
        keep[entering] = true;
        loop {
            let wanted = solve(&keep);
            let turning = (0..signed.len()).filter(|&k| signed[k] && keep[k] && wanted[k] <= 0.0);
            // As far as the first of them stays positive.
            let Some((share, out)) = turning
                .map(|k| (x[k] / (x[k] - wanted[k]).max(f64::MIN_POSITIVE), k))
                .min_by(|a, b| a.0.total_cmp(&b.0))
            else {
                x = wanted;
                break;
            };
            x.zip_apply(&wanted, |x, wanted| *x += share * (wanted - *x));
            x[out] = 0.0;
            keep[out] = false;
        }
    }
    x
}

/// `n / (1 + 2 sum rho)`, the sum up to where the autocorrelation first falls below a twentieth.
fn effective_samples(residual: &DVector<f64>) -> f64 {
    let n = residual.len();
    if n < 8 {
        return n as f64;
    }
    let mean = residual.mean();
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// The conditions of a least-squares solution with signs (Lawson, Hanson 1974, chapter 23): nothing negative, and the gradient
    /// zero where a coefficient is positive and not uphill where it is zero. Columns as alike as those of creep's elements.
    #[test]
    fn val_signed_solutions_are_optimal() {
        let base = Base {
            shape: Shape::Pi,
            thresholds: Vec::new(),
            ridge: 0.0,
        };
        let effects = [Effect::Creep { taus_s: vec![1.0; 7] }];
        let n = chain::width(&base, &effects);
        let mut rng = rand_pcg::Pcg64::seed_from_u64(1);
        let mut zeros = 0;
        for _ in 0..200 {
            let mut columns = DMatrix::from_fn(60, n, |_, _| rng.random_range(-1.0..1.0));
            for j in base.columns() + 1..n {
                let before = columns.column(j - 1).into_owned();
                columns.column_mut(j).scale_mut(0.3);
                columns.column_mut(j).axpy(1.0, &before, 1.0);
            }
            let target = DVector::from_fn(60, |_, _| rng.random_range(-1.0..1.0));
            let x = solve_signed(&Gram::new(&columns, &target), &base, &effects);
            let gradient = columns.tr_mul(&(&target - &columns * &x));
            for j in 0..n {
                let signed = j >= base.columns();
                assert!(!signed || x[j] >= 0.0, "{x}");
                zeros += usize::from(signed && x[j] == 0.0);
                let uphill = if signed && x[j] == 0.0 {
                    0.0_f64.max(gradient[j])
                } else {
                    gradient[j].abs()
                };
                assert!(uphill < 1e-6, "{j}: {x} {gradient}");
            }
        }
        assert!(zeros > 300, "{zeros}");
    }
}
