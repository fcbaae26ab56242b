//! The chain with one more effect in it, and where the search for its parameters begins.

use super::fitted::Fitted;
use super::trial::Trial;
use super::{Search, bounds, has};
use crate::chain::{Chain, Link, Own};
use crate::effects::{Bounds, Effect, EffectId, EffectName, Facts};
use std::sync::Arc;

/// Why an effect cannot be tried.
#[derive(Debug, Clone, PartialEq)]
pub enum Refused {
    /// The chain has it, and cannot have it once more.
    There,
    /// These records or this hysteresis cannot have it; in words.
    Cannot(String),
}

/// A chain with one more effect, and where the search for its parameters begins.
pub(super) struct Plan {
    pub point: Fitted,
    /// The effect's link in the chain.
    pub link: usize,
    pub starts: Vec<Vec<f64>>,
}

impl Plan {
    /// Holds parameters of the effect, by name, at a value.
    pub(super) fn hold(&mut self, held: &[(&str, f64)]) {
        let described = self.point.chain.links[self.link].effect.description().parameters;
        for &(name, value) in held {
            let Some(j) = described.iter().position(|parameter| parameter.name == name) else {
                continue;
            };
            self.point.bounds[self.link][j] = Bounds::fixed(value);
            self.starts.iter_mut().for_each(|start| start[j] = value);
        }
        self.starts.dedup();
    }

    /// Begins at a line of the mains, where the effect adds such lines.
    pub(super) fn begin_at_line(&mut self, line_hz: Option<f64>) {
        let effect = &self.point.chain.links[self.link].effect;
        if let Some(line_hz) = line_hz.filter(|_| effect.adds_line_spectrum()) {
            self.starts.truncate(1);
            let first = self.starts.iter_mut().filter_map(|start| start.first_mut());
            first.for_each(|frequency_hz| *frequency_hz = line_hz);
        }
    }
}

impl Search<'_> {
    /// The chain with the effect in it, which link that is, and where its search begins: for a wider form of an effect that is not in the
    /// chain, from a trial of that.
    pub(super) fn plan(&self, effect: &Arc<dyn Effect>, narrower: Option<&Trial>) -> Result<Plan, Refused> {
        let standing = &narrower.unwrap_or(&self.standing).fitted;
        let facts = Facts {
            family: standing.chain.design.family,
            ..self.facts
        };
        let own = effect.bounds(&facts).map_err(Refused::Cannot)?;
        if own.is_empty() {
            return Err(Refused::Cannot(
                "it is a change of the hysteresis, no link of the chain".to_owned(),
            ));
        }
        let already = has(&standing.chain, effect.as_ref());
        let mut links = standing.chain.links.clone();
        if let Some(other) = effect.widens().and_then(|name| wider_form(&standing.chain, name))
            && already.is_none()
        {
            return Err(Refused::Cannot(format!("the chain has its mode as {other} already")));
        }
        let replaced = effect
            .widens()
            .and_then(|name| has(&standing.chain, name.effect().as_ref()))
            .map(|place| (place, links.remove(place).values));
        if already.is_none() {
            links.push(Link {
                effect: Arc::clone(effect),
                values: own.iter().map(|b| b.neutral).collect(),
            });
        }
        let chain = Chain::new(standing.chain.design.clone(), links, standing.chain.range_v);
        let mut bounds = bounds(&chain, &facts);
        let link = has(&chain, effect.as_ref()).unwrap_or(0);
        let starts = if already.is_some() {
            let again = effect.once_more(&chain.links[link].values, &bounds[link]);
            let starts = again.ok_or(Refused::There)?;
            if let Some(first) = starts.first() {
                effect.free(first, &mut bounds[link]);
            }
            starts
        } else if let Some((_, narrower)) = &replaced {
            effect.widened(narrower, &facts, &bounds[link])
        } else {
            effect.starts(&facts, &bounds[link])
        };
        let own = standing.own.iter().map(|own| {
            let mut own = own.clone();
            if let Some((place, _)) = replaced {
                own.remove(place);
            }
            with_place(&own, already.is_none().then_some(link))
        });
        let own = own.collect();
        let point = Fitted {
            bounds,
            coefficients: standing.coefficients.clone(),
            own,
            expected: standing.expected.clone(),
            ridge: standing.ridge,
            chain,
        };
        Ok(Plan { point, link, starts })
    }
}

/// The wider form of an effect that a chain has.
fn wider_form(chain: &Chain, narrower: EffectId) -> Option<EffectName> {
    let mut effects = chain.links.iter().map(|link| &link.effect);
    effects
        .find(|effect| effect.widens() == Some(narrower))
        .map(|effect| effect.name())
}

/// A record's own numbers with an empty list for a new link.
fn with_place(own: &Own, link: Option<usize>) -> Own {
    let mut own = own.clone();
    if let Some(link) = link {
        own.insert(link.min(own.len()), Vec::new());
    }
    own
}
