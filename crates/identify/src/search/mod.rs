//! The one search behind `fit` of a free shape, `add`, `diagnose` and `learn`: a chain of effects around a hysteresis, fitted,
//! extended by a candidate, judged on what took no part in the fit, and made a [`Model`].
//!
//! The chain that a candidate is judged with is the chain that the user gets.

mod accept;
mod candidate;
mod effort;
mod expected;
mod fitted;
mod look;
mod plan;
mod records;
mod system;
mod thinned;
mod trial;

pub use plan::Refused;
pub use thinned::Thinned;
pub use trial::{Part, Trial};

use crate::any_state;
use crate::chain::{Chain, Link};
use crate::chain_facts::facts;
use crate::chain_trace::Trace;
use crate::columns::Design;
use crate::effects::{Bounds, Effect, Facts, Family};
use crate::error::IdentifyError;
use crate::family::{FADING_ELEMENTS, FREE_PLAYS};
use crate::initial;
use crate::model::Model;
use crate::placement::{fading_lengths, free_thresholds};
use crate::start_state::InitialState;
use fitted::{Descent, Fitted, Levels, Standing};
use hysteron_data::{Dataset, Record, Role};
use rayon::prelude::*;
use records::Prepared;
use std::sync::Arc;

/// How strongly a free shape is held before that is chosen, and the ridge of the families that are linear in their plays.
const FIRST_HOLD: f64 = 1e3;
const FIRST_RIDGE: f64 = 1e-7;

/// Times that the states of the records and the chain follow each other.
const MOST_TURNS: usize = 4;

/// Mean fall of the logarithms of what is left of a part, foretold from the others, from which fading elements go before plays.
const FADES: f64 = 0.1;

/// Fading elements that leave more at first, in the same measure, will not come below plays.
const WITHIN_REACH: f64 = 1.0;

/// Times that states and coefficients of fading elements follow each other, and the fall, in the same measure, below which they stop.
const MOST_FOLLOWED: usize = 24;
const LITTLE: f64 = 0.02;

/// The hysteresis that a search fits its effects around.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// The model's own family and thresholds.
    Own,
    /// The free shape: [`FREE_PLAYS`] plays where the records exercise them, each through a cubic.
    Free,
    /// Fading elements of Duhem's family instead of plays.
    Fading,
    /// As many plays in the same places with a weight each, behind an input function that is linear.
    Straight,
}

/// Records, and the chain as it stands on them.
pub struct Search<'a> {
    thinned: &'a Thinned<'a>,
    /// The model that the search began with: its history, and how it was fitted.
    origin: Model,
    records: Vec<Prepared<'a>>,
    noise_um: f64,
    facts: Facts,
    /// The chain as it stands.
    standing: Trial,
    /// The other free shape on the same records, until an effect tells which of the two goes first.
    other: Option<Box<Self>>,
}

impl<'a> Search<'a> {
    /// A model's chain on records, everything fitted anew: around its own hysteresis or another shape of it.
    ///
    /// # Errors
    /// No record that moves.
    /// # Cost
    /// Some six passes over the records.
    pub fn new(thinned: &'a Thinned<'a>, model: &Model, shape: &Shape, noise_um: f64) -> Result<Self, IdentifyError> {
        let (chain, facts) = chain_in(thinned.full(), model, shape)?;
        let records = records::prepare(thinned, &chain.design);
        if records.iter().all(|record| !record.moves() || !record.fits) {
            return Err(IdentifyError::NothingToFit);
        }
        let largest_um = records.iter().map(|r| r.stroke_um).fold(0.0, f64::max);
        let weights = vec![1.0 / (noise_um.powi(2) + (0.01 * largest_um).powi(2)); records.len()];
        let point = start(chain, &facts, &records);
        let mut search = Self {
            thinned,
            origin: model.clone(),
            noise_um,
            facts,
            standing: Trial::unjudged(point, weights),
            records,
            other: None,
        };
        if search.some_levels_are_open() {
            search.standing.fitted = search.settled_point(Levels::Free);
            search.choose_states();
        }
        search.settle();
        if search.choose_states() {
            search.settle();
        }
        if *shape == Shape::Own && search.standing.family() == Family::Duhem {
            search.follow_states();
        }
        search.start_held_out();
        Ok(search)
    }

    /// As [`Self::new`], around the free shape that foretells the parts of the records from each other better: plays, each through a
    /// cubic, or fading elements.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn free(thinned: &'a Thinned<'a>, model: &Model, noise_um: f64) -> Result<Self, IdentifyError> {
        let of = |shape: Shape| move || Self::new(thinned, model, &shape, noise_um);
        match rayon::join(of(Shape::Free), of(Shape::Fading)) {
            (Ok(plays), Ok(mut fading)) => {
                if fading.foretold(&fading.standing) < plays.foretold(&plays.standing) + plays.reach() {
                    fading.follow_states();
                    fading.start_held_out();
                }
                let fades = plays.fades(&fading.standing, &plays.standing);
                let (mut first, second) = if fades { (fading, plays) } else { (plays, fading) };
                first.other = Some(Box::new(second));
                Ok(first)
            }
            (Ok(plays), Err(_)) => Ok(plays),
            (Err(_), fading) => fading,
        }
    }

    /// Whether a trial of fading elements goes before one of plays: it foretells the parts of the records clearly better, each in its own
    /// measure, and no worse in the sum, where the largest count.
    fn fades(&self, fading: &Trial, plays: &Trial) -> bool {
        let margin = FADES * fading.parts.len().max(1) as f64;
        self.foretold(fading) < self.foretold(plays) - margin
            && self.held_out_percent(fading) < self.held_out_percent(plays)
    }

    /// Whether the trial of another free shape goes before one of this.
    fn yields(&self, own: &Trial, others: &Trial) -> bool {
        match own.family() {
            Family::Duhem => !self.fades(own, others),
            _ => self.fades(others, own),
        }
    }

    /// Turns to the other free shape, where that goes first with one of these effects in the chain: `tried` are they on this one. Whether
    /// it turned.
    pub fn turn(&mut self, tried: &[(&Arc<dyn Effect>, &Trial)], line_hz: Option<f64>) -> bool {
        let Some(mut other) = self.other.take() else {
            return false;
        };
        let (first, others) = tried.split_at(tried.len().min(1));
        let mut theirs = other.trials(first, line_hz);
        let own = self.best(tried.iter().map(|&(_, trial)| trial));
        if self.foretold(other.best(&theirs)) > self.foretold(own) + self.reach() {
            return false;
        }
        theirs.extend(other.trials(others, line_hz));
        let turns = self.yields(own, other.best(&theirs));
        if turns {
            std::mem::swap(self, &mut other);
        }
        turns
    }

    /// Trials of effects on this shape, as far as they can be tried.
    fn trials(&self, tried: &[(&Arc<dyn Effect>, &Trial)], line_hz: Option<f64>) -> Vec<Trial> {
        let effects: Vec<Arc<dyn Effect>> = tried.iter().map(|(effect, _)| Arc::clone(*effect)).collect();
        let trials = self.candidates(&effects, line_hz, &|_, _| ());
        trials.into_iter().flatten().collect()
    }

    /// Which of the standing chain and some trials foretells the parts best.
    fn best<'t>(&'t self, trials: impl IntoIterator<Item = &'t Trial>) -> &'t Trial {
        let least = |a: &&Trial, b: &&Trial| self.foretold(a).total_cmp(&self.foretold(b));
        let all = trials.into_iter().chain([&self.standing]);
        all.min_by(least).unwrap_or(&self.standing)
    }

    /// What foretells the parts worse by more than this will not come below.
    fn reach(&self) -> f64 {
        WITHIN_REACH * self.standing.parts.len().max(1) as f64
    }

    /// One more effect, on the free shape that goes first with it; as [`Self::candidate_held`].
    ///
    /// # Errors
    /// As [`Self::candidate_held`].
    pub fn candidate_on_either(
        mut self,
        effect: &Arc<dyn Effect>,
        held: &[(&str, f64)],
    ) -> Result<(Trial, Self), Refused> {
        let other = self.other.take();
        let trial = self.candidate_held(effect, held)?;
        if let Some(other) = other
            && let Ok(theirs) = other.candidate_held(effect, held)
            && self.yields(&trial, &theirs)
        {
            return Ok((theirs, *other));
        }
        Ok((trial, self))
    }

    /// What fading elements hold from before a record never ends: states and coefficients follow each other until that brings little.
    fn follow_states(&mut self) {
        let parts = self.standing.parts.len().max(1) as f64;
        for _ in 0..MOST_FOLLOWED {
            let before = self.foretold(&self.standing);
            if !self.choose_states() {
                break;
            }
            self.settle();
            if before - self.foretold(&self.standing) < LITTLE * parts {
                break;
            }
        }
    }

    /// The chain as it stands, judged.
    pub fn standing(&self) -> &Trial {
        &self.standing
    }

    /// Noise of the readings that the search reckons with, micrometres rms.
    pub fn noise_um(&self) -> f64 {
        self.noise_um
    }

    /// What the effects may know of the records.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// Peak to peak of each record's position, micrometres; 0 where its drive stands still.
    pub fn strokes_um(&self) -> Vec<f64> {
        self.records.iter().map(|record| record.stroke_um).collect()
    }

    /// The state in which each record, as it was recorded, finds the plays.
    pub fn states(&self) -> Vec<InitialState> {
        let each = self.own_states().into_iter().enumerate();
        each.map(|(i, state)| self.thinned.state_before_full(i, state))
            .collect()
    }

    fn own_states(&self) -> Vec<InitialState> {
        self.records.iter().map(Prepared::initial).collect()
    }

    /// Whether each record takes part in the fit.
    pub fn fits(&self) -> Vec<bool> {
        self.records.iter().map(|record| record.fits).collect()
    }

    /// The records that are searched, as they were recorded.
    pub fn dataset(&self) -> &'a Dataset {
        self.thinned.full()
    }

    /// The records that are searched.
    pub fn thinned(&self) -> &'a Thinned<'a> {
        self.thinned
    }

    /// A trial's answer to a record that was not made, from rest at its first voltage, micrometres; its positions do not matter.
    pub fn foretell(&self, trial: &Trial, record: &Record) -> Vec<f64> {
        let Fitted {
            chain, coefficients, ..
        } = &trial.fitted;
        chain.respond_to_drive(coefficients, record, InitialState::REST)
    }

    /// The chain of a trial run freely over every record as it was recorded, micrometres.
    pub fn modelled(&self, trial: &Trial) -> Vec<Vec<f64>> {
        let fitted = &trial.fitted;
        let each = self.records.par_iter().zip(&self.dataset().records).enumerate();
        each.map(|(i, (record, full))| {
            if self.thinned.every(i) == 1 {
                return fitted.modelled(record, i);
            }
            let state = self.thinned.state_before_full(i, record.initial());
            let trace = Trace::new(full, state, fitted.chain.dynamic());
            fitted.chain.respond(&fitted.coefficients, &trace, &fitted.own[i])
        })
        .collect()
    }

    /// Goes on from a trial of this search.
    pub fn stand_on(&mut self, mut trial: Trial) {
        start_in(&mut self.records, &trial.states.take().unwrap_or_default());
        self.other = None;
        self.standing = trial;
        let open = self.some_levels_are_open();
        for turn in 0..MOST_TURNS {
            let free = open && turn == 0;
            if free {
                self.standing.fitted = self.settled_point(Levels::Free);
            }
            if !self.choose_states() && !free {
                break;
            }
            self.settle();
        }
        self.start_held_out();
    }

    fn descent(&self, levels: Levels) -> Descent<'_> {
        Descent {
            records: &self.records,
            noise_um: self.noise_um,
            settled: 1e-2,
            closely: false,
            levels,
        }
    }

    /// Whether plays hold something over some fitted records that only others show: a level taken for granted there bends all plays.
    fn some_levels_are_open(&self) -> bool {
        let fitted = || self.records.iter().filter(|record| record.fits && record.moves());
        fitted().any(|record| record.holds_a_level) && fitted().any(|record| !record.holds_a_level)
    }

    /// The standing chain's coefficients and parameters at the bottom of their valley, on few rows.
    fn settled_point(&self, levels: Levels) -> Fitted {
        let descent = self.descent(levels);
        let mut here = Standing {
            fitted: self.standing.fitted.clone(),
            error: f64::INFINITY,
            linear: None,
            strokes: None,
        };
        let own_numbers = here.fitted.chain.links.iter().any(|link| link.effect.has_own_numbers());
        for _ in 0..if own_numbers { 3 } else { 1 } {
            here.fitted.settle(&self.records);
            here = descent.project(here.fitted);
            if !here.fitted.chain.links.is_empty() || here.fitted.chain.design.family == Family::Mrpi {
                here = descent.descend(here, 8);
            }
        }
        here.fitted
    }

    /// The standing chain at the bottom of its valley, judged there.
    fn settle(&mut self) {
        let point = self.settled_point(Levels::OfTheState);
        self.standing = self.judged(point);
    }

    fn judged(&self, point: Fitted) -> Trial {
        trial::judge(&self.records, point, &self.standing.weights, self.noise_um, false)
    }

    /// Chooses the state in which each record finds the plays under the standing chain; whether any changed.
    fn choose_states(&mut self) -> bool {
        let chosen = chosen_states(&self.records, &self.standing.fitted, |_, _| true);
        start_in(&mut self.records, &chosen)
    }

    /// Puts the records without part in the fit into the states that the standing chain gives them.
    fn start_held_out(&mut self) {
        let states = self.standing.start_held_out(&self.records, |_| true);
        start_in(&mut self.records, &states);
    }
}

/// The state in which each record that is asked for finds the plays under a chain; the others stay in theirs.
fn chosen_states(
    records: &[Prepared<'_>],
    fitted: &Fitted,
    asked: impl Fn(usize, &Prepared<'_>) -> bool + Sync,
) -> Vec<InitialState> {
    let dynamic = fitted.chain.dynamic();
    let chosen = |(i, prepared): (usize, &Prepared<'_>)| {
        if !asked(i, prepared) {
            return prepared.initial();
        }
        let record = prepared.record();
        let guess = initial::guess(&record.voltage_v, &record.position_um);
        any_state::choose(&fitted.chain, &fitted.coefficients, prepared.trace(dynamic), guess)
    };
    records.par_iter().enumerate().map(chosen).collect()
}

/// Puts records into states; whether any changed.
fn start_in(records: &mut [Prepared<'_>], states: &[InitialState]) -> bool {
    let mut changed = false;
    for (record, &state) in records.iter_mut().zip(states) {
        if state != record.initial() {
            record.start_in(state);
            changed = true;
        }
    }
    changed
}

/// The chain to begin with, and what its effects may know.
fn chain_in(dataset: &Dataset, model: &Model, shape: &Shape) -> Result<(Chain, Facts), IdentifyError> {
    let family = match shape {
        Shape::Own => model.family,
        Shape::Free => Family::PlayPolynomial,
        Shape::Fading => Family::Duhem,
        Shape::Straight => Family::Pi,
    };
    let mut facts = facts(dataset, family);
    let fitted: Vec<&[f64]> = {
        let identify = dataset.with_role(Role::Identify).map(|r| r.voltage_v.as_slice());
        let own: Vec<&[f64]> = identify.collect();
        if own.is_empty() {
            dataset.records.iter().map(|r| r.voltage_v.as_slice()).collect()
        } else {
            own
        }
    };
    facts.family = family;
    let thresholds = match shape {
        Shape::Own => model.thresholds.clone(),
        Shape::Free | Shape::Straight => free_thresholds(FREE_PLAYS, &fitted),
        Shape::Fading => fading_lengths(FADING_ELEMENTS, &fitted),
    };
    if thresholds.is_empty() {
        return Err(IdentifyError::NoExcitation { input: "voltage" });
    }
    let of_family = *shape == Shape::Own;
    let design = Design::still(family, thresholds);
    let links = accept::links(model, of_family);
    Ok((Chain::new(design, links, facts.voltage_v), facts))
}

/// A chain with a straight line for a hysteresis.
fn start(chain: Chain, facts: &Facts, records: &[Prepared<'_>]) -> Fitted {
    let mut coefficients = vec![0.0; chain.design.columns()];
    let [low, high] = facts.position_um;
    coefficients[0] = 0.5 * (low + high);
    // Half the stroke over half the range; the plays take their part of it when they are fitted.
    let slope = 0.5 * (high - low);
    coefficients[1] = if chain.design.family.is_free() {
        slope
    } else {
        2.0 * slope / (facts.voltage_v[1] - facts.voltage_v[0]).max(f64::MIN_POSITIVE)
    };
    let bounds = bounds(&chain, facts);
    let expected = expected::expected(&chain, high - low);
    Fitted {
        bounds,
        coefficients,
        own: vec![vec![Vec::new(); chain.links.len()]; records.len()],
        ridge: if expected.is_some() { FIRST_HOLD } else { FIRST_RIDGE },
        expected,
        chain,
    }
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

/// Whether a chain has a link of this effect.
fn has(chain: &Chain, effect: &dyn Effect) -> Option<usize> {
    let name = effect.name();
    chain.links.iter().position(|link| link.is(&name))
}
