//! The weights of the probabilities: fitted to cases whose hidden effect is known, judged on those that were left out.

use crate::stored::Stored;
use hysteron_diagnose::odds::{Alternative, Odds, TERMS, Term, alternatives, shares};
use hysteron_diagnose::rules::{RuleId, Thresholds};
use hysteron_diagnose::verdict::decide_by;
use hysteron_identify::{EffectId, EffectName};
use nalgebra::{DMatrix, DVector};
use std::fmt::Write;

/// Folds of the cross-validation; no divisor of the ten programmes, so that each fold has some of all.
const FOLDS: usize = 9;

/// Ridge on the weight of a term that is divided by its standard deviation: a weight of one costs five nats.
const RIDGE: f64 = 10.0;

/// A probability below this counts as this.
const LEAST: f64 = 1e-12;

/// Most steps of Newton's method.
const STEPS: usize = 60;

/// Values of the thresholds between which the table's rows lie.
const NAMES: [f64; 4] = [0.4, 0.5, 0.6, 0.7];
const CERTAIN: [f64; 5] = [0.75, 0.8, 0.85, 0.9, 0.95];
const SETS: [f64; 5] = [0.7, 0.8, 0.85, 0.9, 0.95];

/// One case: what may be missing, and which of it is.
pub struct Case {
    all: Vec<Alternative>,
    right: Vec<bool>,
}

impl Case {
    /// None where the records could not answer, or where what is hidden is a bend of the loops that is no candidate.
    pub fn new(stored: &Stored) -> Option<Self> {
        let all = alternatives(&stored.evidence);
        let is = |alternative: &Alternative| {
            let name = alternative.effect.as_ref();
            name.is_some_and(|name| stored.accepted.iter().any(|accepted| accepted == name.as_str()))
        };
        let mut right: Vec<bool> = all.iter().map(is).collect();
        if !right.contains(&true) {
            *right.last_mut()? = true;
        }
        Some(Self { all, right })
    }

    /// What the right ones have.
    fn right(&self, each: &[f64]) -> f64 {
        let right = each.iter().zip(&self.right).filter(|(_, right)| **right);
        right.map(|(p, _)| p).sum::<f64>().max(LEAST)
    }

    fn likelihood(&self, weights: &[f64; TERMS]) -> f64 {
        self.right(&shares(&self.all, weights)).ln()
    }

    /// The gradient of the likelihood, and the curvature of what all of them share.
    fn step(&self, weights: &[f64; TERMS], gradient: &mut DVector<f64>, curvature: &mut DMatrix<f64>) {
        let each = shares(&self.all, weights);
        let right = self.right(&each);
        let mut mean = DVector::zeros(TERMS);
        for (alternative, p) in self.all.iter().zip(&each) {
            mean.axpy(*p, &DVector::from_row_slice(&alternative.values), 1.0);
        }
        for ((alternative, p), is_right) in self.all.iter().zip(&each).zip(&self.right) {
            let values = DVector::from_row_slice(&alternative.values);
            if *is_right {
                gradient.axpy(p / right, &(&values - &mean), 1.0);
            }
            let apart = values - &mean;
            curvature.ger(*p, &apart, &apart, 1.0);
        }
    }
}

/// The weights under which these cases are likeliest.
pub fn fit(cases: &[&Case]) -> [f64; TERMS] {
    let ridge = ridge(cases);
    let mut weights = [0.0; TERMS];
    for _ in 0..STEPS {
        let mut gradient = DVector::zeros(TERMS);
        let mut curvature = DMatrix::from_diagonal(&ridge);
        for case in cases {
            case.step(&weights, &mut gradient, &mut curvature);
        }
        for (k, weight) in weights.iter().enumerate() {
            gradient[k] -= ridge[k] * weight;
        }
        let Some(step) = curvature.cholesky().map(|factor| factor.solve(&gradient)) else {
            break;
        };
        // Where the curvature is larger than it was at the start of the step, the step is too long.
        let now = penalised(cases, &weights, &ridge);
        let mut length = 1.0;
        let along = |length: f64| std::array::from_fn(|k| weights[k] + length * step[k]);
        while length > 1e-3 && penalised(cases, &along(length), &ridge) < now {
            length /= 2.0;
        }
        weights = along(length);
        if length * step.amax() < 1e-6 {
            break;
        }
    }
    weights
}

/// The logarithm of the likelihood less what the ridge costs.
fn penalised(cases: &[&Case], weights: &[f64; TERMS], ridge: &DVector<f64>) -> f64 {
    let likelihood: f64 = cases.iter().map(|case| case.likelihood(weights)).sum();
    likelihood
        - weights
            .iter()
            .zip(ridge.iter())
            .map(|(w, r)| 0.5 * r * w * w)
            .sum::<f64>()
}

/// The ridge of each weight: in units of its term's standard deviation.
fn ridge(cases: &[&Case]) -> DVector<f64> {
    let rows = || cases.iter().flat_map(|case| &case.all);
    let count = rows().count().max(1) as f64;
    DVector::from_fn(TERMS, |k, _| {
        let mean = rows().map(|row| row.values[k]).sum::<f64>() / count;
        let variance = rows().map(|row| (row.values[k] - mean).powi(2)).sum::<f64>() / count;
        RIDGE * variance.max(1e-4)
    })
}

/// The probabilities of each case by weights that it had no part in.
fn left_out(cases: &[Case]) -> Vec<Odds> {
    let mut each = vec![Odds::default(); cases.len()];
    for fold in 0..FOLDS {
        let others = (0..cases.len()).filter(|k| k % FOLDS != fold);
        let weights = fit(&others.map(|k| &cases[k]).collect::<Vec<_>>());
        for k in (fold..cases.len()).step_by(FOLDS) {
            each[k] = Odds::under(cases[k].all.clone(), &weights);
        }
    }
    each
}

/// Counts of the verdicts under one setting of the thresholds.
#[derive(Default)]
struct Counts {
    alone: usize,
    wrong: usize,
    of_three: usize,
    sets: usize,
    held: usize,
    members: usize,
}

/// The verdicts of the rules with these probabilities.
fn counts(stored: &[&Stored], odds: &[Odds], thresholds: &Thresholds) -> Counts {
    let mut counts = Counts::default();
    for (stored, odds) in stored.iter().zip(odds) {
        let decision = decide_by(&stored.evidence, odds, thresholds);
        let right = |name: &EffectName| stored.accepted.iter().any(|accepted| accepted == name.as_str());
        let named = decision
            .verdict
            .effect()
            .filter(|name| **name != EffectId::HysteresisShape);
        let set: Vec<&EffectName> = named.into_iter().chain(&decision.set).collect();
        let holds = set.iter().any(|name| right(name));
        if named.is_some() && set.len() == 1 {
            counts.alone += usize::from(holds);
            counts.wrong += usize::from(!holds);
        } else if !set.is_empty() && is_hidden(stored) {
            counts.sets += 1;
            counts.held += usize::from(holds);
            counts.members += set.len();
        }
        counts.of_three += usize::from(holds && set.len() <= 3 && is_hidden(stored));
    }
    counts
}

/// Whether an effect of the catalogue is hidden that loops alone can tell from their shape.
fn is_hidden(stored: &Stored) -> bool {
    !stored.accepted.iter().any(|word| word == "unknown" || word == "none")
}

/// What names and sets are worth at several thresholds, on cases left out, as Markdown.
pub fn tables(stored: &[Stored]) -> String {
    let (stored, cases): (Vec<&Stored>, Vec<Case>) =
        stored.iter().filter_map(|one| Some((one, Case::new(one)?))).unzip();
    let odds = left_out(&cases);
    let nats = cases.iter().zip(&odds).map(|(case, odds)| {
        let right = case.all.iter().zip(&case.right).filter(|(_, right)| **right);
        let of = |alternative: &Alternative| {
            alternative
                .effect
                .as_ref()
                .map_or(odds.none, |name| odds.probability(name))
        };
        -right
            .map(|(alternative, _)| of(alternative))
            .sum::<f64>()
            .max(LEAST)
            .ln()
    });
    let nats = nats.sum::<f64>() / cases.len().max(1) as f64;
    let hidden = stored.iter().filter(|stored| is_hidden(stored)).count();
    let mut text = format!(
        "{} cases, {hidden} with an effect of the catalogue; {FOLDS} folds; {nats:.3} nats a case.\n\n\
         | `NameProbability` | `CertainProbability` | `SetProbability` | named alone, right | wrong | right, alone or in a set of three | \
         sets that hold it | mean size |\n|---|---|---|---|---|---|---|---|\n",
        cases.len()
    );
    let usual = Thresholds::DEFAULT;
    let names = NAMES.map(|value| usual.with(RuleId::NameProbability, value));
    let certain = CERTAIN.map(|value| usual.with(RuleId::CertainProbability, value));
    let sets = SETS.map(|value| usual.with(RuleId::SetProbability, value));
    for thresholds in names.iter().chain(&certain).chain(&sets) {
        let counts = counts(&stored, &odds, thresholds);
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} of {} | {:.2} |",
            thresholds.of(RuleId::NameProbability),
            thresholds.of(RuleId::CertainProbability),
            thresholds.of(RuleId::SetProbability),
            counts.alone,
            counts.wrong,
            counts.of_three,
            counts.held,
            counts.sets,
            counts.members as f64 / counts.sets.max(1) as f64
        );
    }
    text
}

/// The weights, as Markdown.
pub fn weights(weights: &[f64; TERMS]) -> String {
    let mut text = "| term | weight |\n|---|---|\n".to_owned();
    let terms = Term::ALL.iter().map(|term| format!("{term:?}"));
    let names = terms.chain(EffectId::ALL.iter().map(ToString::to_string));
    for (name, weight) in names.zip(weights) {
        let _ = writeln!(text, "| `{name}` | {weight:.2} |");
    }
    text
}

/// The file of the weights.
pub fn source(weights: &[f64; TERMS], cases: usize) -> String {
    let mut text = format!(
        "//! The weights of the terms, fitted to {cases} cases by `cargo xtask calibrate odds --write`.\n\n\
         use super::TERMS;\n\n\
         /// The weight of each [`Term`](super::Term), in their order.\n\
         pub const WEIGHTS: [f64; TERMS] = [\n"
    );
    for weight in weights {
        let _ = writeln!(text, "    {weight:.3},");
    }
    text.push_str("];\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// Choices among three, drawn with the probabilities that known weights give: the fit finds these weights again, and a term that
    /// says nothing gets none.
    #[test]
    fn val_the_weights_of_drawn_choices_are_found_again() {
        let truth = [2.0, -1.5, 0.0];
        let mut rng = Pcg64::seed_from_u64(7);
        let cases: Vec<Case> = (0..4000)
            .map(|_| {
                let all: Vec<Alternative> = (0..3)
                    .map(|_| {
                        let mut values = [0.0; TERMS];
                        values[..3].fill_with(|| rng.random_range(-1.0..1.0));
                        Alternative { effect: None, values }
                    })
                    .collect();
                let mut weights = [0.0; TERMS];
                weights[..3].copy_from_slice(&truth);
                let each = shares(&all, &weights);
                let drawn: f64 = rng.random_range(0.0..1.0);
                let chosen = usize::from(drawn > each[0]) + usize::from(drawn > each[0] + each[1]);
                Case {
                    all,
                    right: (0..3).map(|i| i == chosen).collect(),
                }
            })
            .collect();
        let found = fit(&cases.iter().collect::<Vec<_>>());
        for (found, truth) in found.iter().zip(truth) {
            assert!((found - truth).abs() < 0.12, "{found} {truth}");
        }
        assert!(found[3..].iter().all(|weight| weight.abs() < 1e-9));
    }
}
