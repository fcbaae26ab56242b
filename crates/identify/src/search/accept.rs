//! From a model to the links of a search's chain, and from a judged chain back to a model.

use super::{Search, Trial};
use crate::basis::Basis;
use crate::chain::Link;
use crate::effects::{EffectName, Named, OfFamily};
use crate::family::Family;
use crate::model::{FittedEffect, FittedRecord, Model, Parameter};
use crate::normal::Normal;
use crate::uncertainty::inflated_variance;
use nalgebra::DMatrix;
use std::sync::Arc;

/// The effects of a model as links, and alpha and beta of its family where that stays its own.
pub(super) fn links(model: &Model, of_family: bool) -> Vec<Link> {
    let mut links = model.links();
    if let Some(envelope) = model.envelope.filter(|_| of_family && model.family == Family::Mrpi) {
        links.push(Link {
            effect: Arc::new(OfFamily),
            values: vec![envelope.alpha_s, envelope.beta_s],
        });
    }
    links
}

impl Trial {
    /// Names of an effect's parameters that stand on a physical bound that a user could have wanted to pass.
    pub fn on_bound(&self, effect: &EffectName) -> Vec<&'static str> {
        let links = &self.fitted.chain.links;
        let places = (0..links.len()).filter(|&at| links[at].is(effect));
        places.flat_map(|at| self.fitted.on_bound(at)).collect()
    }

    /// A candidate that takes nothing of what this leaves; its parameters are those at which it was left.
    pub(super) fn taking_nothing(&self, fitted: super::fitted::Fitted) -> Self {
        Self {
            fitted,
            systems: Vec::new(),
            ..self.clone()
        }
    }

    pub(super) fn unjudged(fitted: super::fitted::Fitted, weights: Vec<f64>) -> Self {
        Self {
            fitted,
            weights,
            systems: Vec::new(),
            states: None,
            parts: Vec::new(),
            left_um2: Vec::new(),
        }
    }
}

impl super::fitted::Fitted {
    /// Names of a link's parameters that stand on a bound.
    fn on_bound(&self, link: usize) -> impl Iterator<Item = &'static str> {
        let at = &self.chain.links[link];
        let described = at.effect.description().parameters.iter();
        let values = described.zip(&at.values).zip(&self.bounds[link]);
        values
            .filter(|((_, value), b)| b.fitted && stands_on(**value, b))
            .map(|((named, _), _)| named.name)
    }

    /// Whether a parameter of a link stands on a bound that speaks against its effect.
    pub(super) fn refuted(&self, link: usize) -> bool {
        let effect = &self.chain.links[link].effect;
        self.on_bound(link).any(|parameter| effect.refuted_on_bound(parameter))
    }
}

/// Zero is where most effects do nothing: that is no bound a user could have wanted to pass.
fn stands_on(value: f64, b: &crate::effects::Bounds) -> bool {
    (value <= b.min || value >= b.max) && value != b.neutral && value != 0.0
}

/// Standard errors of the coefficients in the core's own powers, and of each link's parameters.
struct Errors {
    coefficients: Vec<Option<f64>>,
    links: Vec<Vec<Option<f64>>>,
    undetermined: Vec<Vec<usize>>,
}

impl Search<'_> {
    /// Values of one of a trial's effects' parameters with names and units; empty where its chain does not have it.
    pub fn parameters_of(&self, trial: &Trial, effect: &EffectName) -> Vec<Parameter> {
        let link = trial.fitted.chain.links.iter().find(|link| link.is(effect));
        let heat_is_known = self.facts.temperature_c.is_some();
        link.map_or_else(Vec::new, |link| {
            let none = vec![None; link.values.len()];
            fitted_effect(link, &none, heat_is_known).parameters
        })
    }

    /// The standing chain as a model, with the history of the one that the search began with.
    pub fn model(&self) -> Model {
        let fitted = &self.standing.fitted;
        let errors = self.errors();
        let chain = &fitted.chain;
        let basis = chain.basis();
        let mut new = self.origin.clone();
        new.family = chain.design.family;
        new.thresholds.clone_from(&chain.design.thresholds);
        new.coefficients = basis.to_powers(&new.thresholds, &fitted.coefficients);
        new.standard_errors = errors.coefficients;
        let links = || chain.links.iter().zip(&errors.links);
        let heat_is_known = self.facts.temperature_c.is_some();
        new.effects = links()
            .filter(|(link, _)| !link.is_of_family())
            .map(|(link, errors)| fitted_effect(link, errors, heat_is_known))
            .collect();
        let family = links().find(|(link, _)| link.is_of_family());
        new.envelope = family.and_then(|(link, _)| link.effect.envelope(&link.values));
        new.envelope_errors = family.and_then(|(_, errors)| Some([(*errors.first()?)?, (*errors.get(1)?)?]));
        [new.input_min, new.input_max] = chain.range_v;
        new.fitted_on.dataset.clone_from(&self.dataset().name);
        new.fitted_on.ridge = fitted.ridge;
        new.fitted_on.records = self.fitted_records();
        new.notices = self.notices(&errors.undetermined, &new);
        new
    }

    fn fitted_records(&self) -> Vec<FittedRecord> {
        let recorded = self.dataset().records.iter().zip(self.states());
        let each = self
            .records
            .iter()
            .zip(&self.standing.weights)
            .zip(recorded)
            .enumerate();
        let fits = each.filter(|(_, ((prepared, _), _))| prepared.fits);
        fits.map(|(i, ((prepared, weight), (record, state)))| FittedRecord {
            file: record.file.clone(),
            samples: record.len(),
            sample_rate_hz: 1.0 / record.period_s,
            initial_state: state.to_string(),
            fitted_from: prepared.settled * self.thinned.every(i),
            weight: weight / record.len().max(1) as f64,
        })
        .collect()
    }

    /// Sandwich covariance (White 1980), each record's residual variance inflated by its integrated autocorrelation time.
    fn errors(&self) -> Errors {
        let standing = &self.standing;
        let fitted = &standing.fitted;
        let linear = fitted.coefficients.len();
        let n = linear + fitted.bounds.iter().map(Vec::len).sum::<usize>();
        let rows: Vec<f64> = self.records.iter().map(|r| r.rows.len().max(1) as f64).collect();
        let mut sum = Normal::new(n);
        for (i, system) in &standing.systems {
            sum.add_scaled(system, standing.weights[*i] / rows[*i]);
        }
        let undetermined = sum.spectrum().undetermined();
        let held = fitted.held();
        let inverse = held.onto(&sum).spectrum().inverse(held.ridge());
        let variances: Vec<f64> = (0..self.records.len()).map(|i| self.variance(i)).collect();
        let mut middle = DMatrix::zeros(n, n);
        for (i, system) in &standing.systems {
            let weight = standing.weights[*i] / rows[*i];
            middle += system.matrix() * (weight * weight * variances[*i]);
        }
        let covariance = &inverse * middle * &inverse;
        let powers = to_powers(fitted.chain.basis(), &fitted.chain.design.thresholds, linear);
        let of_powers = &powers * covariance.view((0, 0), (linear, linear)) * powers.transpose();
        let known = |i: usize| !undetermined.iter().any(|group| group.contains(&i));
        let root = |variance: f64| Some(variance.max(0.0).sqrt()).filter(|e| e.is_finite());
        let mut next = linear;
        let mut links = Vec::new();
        for (bounds, link) in fitted.bounds.iter().zip(&fitted.chain.links) {
            let mut of_link = Vec::new();
            for (b, &value) in bounds.iter().zip(&link.values) {
                // On a bound there is no valley to measure.
                let free = b.fitted && value > b.min && value < b.max && known(next);
                of_link.push(root(covariance[(next, next)]).filter(|&e| free && e > 0.0));
                next += 1;
            }
            links.push(of_link);
        }
        Errors {
            coefficients: (0..linear)
                .map(|i| known(i).then(|| root(of_powers[(i, i)])).flatten())
                .collect(),
            links,
            undetermined,
        }
    }

    /// Variance of a record's residual at the rows, times its integrated autocorrelation time in rows.
    fn variance(&self, i: usize) -> f64 {
        let record = &self.records[i];
        if !record.fits {
            return 0.0;
        }
        let modelled = self.standing.fitted.modelled(record, i);
        let measured = &record.record().position_um;
        let residual: Vec<f64> = record.rows.iter().map(|&k| measured[k] - modelled[k]).collect();
        inflated_variance(&residual)
    }

    /// What the user should know of the fit, in sentences.
    fn notices(&self, undetermined: &[Vec<usize>], model: &Model) -> Vec<String> {
        let chain = &self.standing.fitted.chain;
        let mut notices = Vec::new();
        for (link, bounds) in chain.links.iter().zip(&self.standing.fitted.bounds) {
            let description = link.effect.description();
            for ((named, &value), b) in description.parameters.iter().zip(&link.values).zip(bounds) {
                if b.fitted && stands_on(value, b) {
                    notices.push(format!(
                        "{}: {} = {value:.6} {} stands on its physical bound ({} to {}); something else may be missing",
                        description.name, named.name, named.unit, b.min, b.max
                    ));
                }
            }
        }
        let linear = self.standing.fitted.coefficients.len();
        let hysteresis = undetermined
            .iter()
            .filter(|group| group.iter().all(|&i| i < linear))
            .count();
        if hysteresis > 0 {
            let decides = if chain.design.family.is_free() {
                "a smooth shape".to_owned()
            } else {
                format!("a ridge of {:.0e}", self.standing.fitted.ridge)
            };
            notices.push(format!(
                "the records leave {hysteresis} of {linear} directions of the hysteresis undetermined; {decides} decides there"
            ));
        }
        let names: Vec<String> = model
            .effects
            .iter()
            .flat_map(|effect| {
                effect
                    .parameters
                    .iter()
                    .map(move |p| format!("{}: {}", effect.name, p.name))
            })
            .collect();
        // A number that does nothing where the effect stands (the second mode's, without its share) is no combination.
        for group in undetermined.iter().filter(|group| group.len() > 1) {
            let members: Vec<&str> = group
                .iter()
                .filter(|&&i| i >= linear)
                .filter_map(|&i| names.get(i - linear).map(String::as_str))
                .collect();
            if !members.is_empty() {
                notices.push(format!(
                    "the data determine only a combination with {}; alone it means nothing",
                    members.join(", ")
                ));
            }
        }
        notices
    }
}

/// The matrix that turns coefficients of a basis into those of the core's own powers.
fn to_powers(basis: Basis, thresholds: &[f64], n: usize) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(n, n);
    for j in 0..n {
        let mut unit = vec![0.0; n];
        unit[j] = 1.0;
        let column = basis.to_powers(thresholds, &unit);
        matrix.column_mut(j).copy_from_slice(&column);
    }
    matrix
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
