//! One more effect in the chain: where its search begins, and the way to the bottom of its valley.

use super::fitted::{Descent, Fitted, Known, Levels, Look, Standing, reweighed};
use super::records::Prepared;
use super::system::within_bounds;
use super::trial::{Trial, judge, logarithms};
use super::{Search, Shape, bounds, chosen_states, has, start_in};
use crate::chain::{Chain, Link, Own, Stroke};
use crate::effects::{Bounds, Effect, EffectId, EffectName, Facts, Mark};
use crate::family::range;
use crate::normal::Normal;
use crate::start_state::InitialState;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// How much of a search for one candidate is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Effort {
    /// Among many: one that takes nothing is left early.
    Quick,
    /// Among many, in a valley that is long and bent.
    Patient,
    /// For its own sake: it is wanted whatever it takes.
    Thorough,
}

impl Effort {
    /// Starts that are followed towards the bottom of their valleys.
    fn followed(self) -> usize {
        match self {
            Self::Quick => 2,
            Self::Patient | Self::Thorough => 4,
        }
    }

    /// Steps of those, and of the best of them.
    fn steps(self) -> (usize, usize) {
        match self {
            Self::Quick => (1, 6),
            Self::Patient => (2, 12),
            Self::Thorough => (3, usize::MAX),
        }
    }

    /// Fall of the sum of logarithms below which a search has settled: the error of one record by a two-hundredth, or a
    /// hundredth of that.
    fn settled(self) -> f64 {
        match self {
            Self::Quick | Self::Patient => 1e-2,
            Self::Thorough => 1e-4,
        }
    }

    /// Times that the states of the records and the chain follow each other.
    fn turns(self) -> usize {
        match self {
            Self::Quick | Self::Patient => 2,
            Self::Thorough => 4,
        }
    }

    /// Rounds in which records choose the numbers of their own again.
    fn rounds(self) -> usize {
        match self {
            Self::Quick | Self::Patient => 2,
            Self::Thorough => 5,
        }
    }
}

/// Times that the space about the best start is halved in a quick look.
const HALVED: usize = 3;

/// Starts that are looked at of a wider form of an effect, or behind one: every answer of a mode with a bent spring or friction is an
/// integration.
const LOOKED_AT: usize = 12;

/// A candidate whose first steps take less than this of the sum of logarithms is not followed further: the squared error of one record
/// by a tenth.
const LEAST_FALL: f64 = 0.1;

/// A record without part in the fit is looked at from its start anew where a candidate leaves so many times the square that the chain
/// without it leaves.
const WORSE: f64 = 1.1;

/// Records that are left with so many times their noise may have ended in another valley than the effect's.
const MUCH: f64 = 10.0;

/// A wider form of an effect is tried where that leaves less than this share of the error.
const MAY_BE_WIDER: f64 = 0.6;

/// Least error that is looked into for a wider form, percent of peak to peak.
const MATTERS_PERCENT: f64 = 0.3;

/// A wider form is followed no further where a start, and then its first steps, leave so many times what the narrower effect leaves, or
/// where the wider form hides that, what another effect of its mark leaves: it would have to take much of that.
const BEGUN_HOPELESS: f64 = 6.0;
const HOPELESS: f64 = 3.0;

/// What is left is more than noise above so many times that.
const STRUCTURE: f64 = 2.0;

/// Why an effect cannot be tried.
#[derive(Debug, Clone, PartialEq)]
pub enum Refused {
    /// The chain has it, and cannot have it once more.
    There,
    /// These records or this hysteresis cannot have it; in words.
    Cannot(String),
}

/// The chain as it stands, ready for a quick look at many starts: what is left of each fitted record, and what the
/// hysteresis could take of a change.
pub(super) struct Basis {
    records: Vec<OfRecord>,
    /// The sum of logarithms at the bottom of the valley that the standing chain is in.
    error: f64,
}

/// A chain with one more effect, and where the search for its parameters begins.
struct Plan {
    point: Fitted,
    /// The effect's link in the chain.
    link: usize,
    starts: Vec<Vec<f64>>,
}

impl Plan {
    /// Holds parameters of the effect, by name, at a value.
    fn hold(&mut self, held: &[(&str, f64)]) {
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
                let tangent = fitted.tangent(record, index, Look::Few, false, Known::default());
                let trace = record.trace(fitted.chain.dynamic());
                let own = &fitted.own[index];
                let stroke = fitted.chain.stroke(&fitted.coefficients, trace, own);
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

    /// Fits one more effect in the standing chain, everything anew with it, whatever it takes.
    ///
    /// # Errors
    /// The chain has it, or the records cannot have it.
    /// # Cost
    /// A pass over the records a start, some thirty more.
    pub fn candidate(&self, effect: &Arc<dyn Effect>) -> Result<Trial, Refused> {
        self.candidate_held(effect, &[])
    }

    /// As [`Self::candidate`], with some of its parameters, by name, held at a value.
    ///
    /// # Errors
    /// As [`Self::candidate`].
    pub fn candidate_held(&self, effect: &Arc<dyn Effect>, held: &[(&str, f64)]) -> Result<Trial, Refused> {
        let basis = self.basis();
        // A wider form begins where the narrower effect ends.
        let narrower = effect.widens().map(EffectId::effect);
        let narrower = narrower.filter(|narrower| has(&self.standing.fitted.chain, narrower.as_ref()).is_none());
        let narrower = narrower.and_then(|narrower| self.candidate(&narrower).ok());
        let narrower = narrower.filter(|trial| !effect.hides_the_narrower() || self.may_be_wider(trial));
        let under = |ridge: f64| {
            let mut plan = self.plan(effect, narrower.as_ref())?;
            plan.hold(held);
            plan.point.ridge = ridge;
            self.candidate_on(effect, plan, &basis, None, (Effort::Thorough, None))
        };
        let trial = under(self.standing.ridge())?;
        // The stiff plays of a chain that lacks an effect hide the valley of one that they can imitate.
        if trial.ridge() < self.standing.ridge() {
            let looser = under(trial.ridge())?;
            if self.foretold(&looser) < self.foretold(&trial) {
                return Ok(looser);
            }
        }
        Ok(trial)
    }

    /// Several candidates, on all cores, in their order; one that adds lines of the mains begins at `line_hz`. `progress` gets the
    /// share done.
    pub fn candidates(
        &self,
        effects: &[Arc<dyn Effect>],
        line_hz: Option<f64>,
        progress: &(dyn Fn(f64, &str) + Sync),
    ) -> Vec<Result<Trial, Refused>> {
        let basis = self.basis();
        let done = std::sync::atomic::AtomicUsize::new(0);
        let tried = |effect: &Arc<dyn Effect>, narrower: Option<&Trial>, rival: Option<f64>| {
            let before = done.load(std::sync::atomic::Ordering::Relaxed);
            progress(before as f64 / effects.len() as f64, effect.description().name);
            let trial = self
                .plan(effect, narrower)
                .and_then(|plan| self.candidate_on(effect, plan, &basis, line_hz, (Effort::Quick, rival)));
            done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            trial
        };
        let first = effects.par_iter().with_max_len(1);
        let first: Vec<Option<Result<Trial, Refused>>> = first
            .map(|effect| effect.widens().is_none().then(|| tried(effect, None, None)))
            .collect();
        let of = |name: EffectId| {
            let place = effects.iter().position(|effect| effect.name() == name)?;
            first[place].as_ref()?.as_ref().ok()
        };
        // What the best of those leaves that take much and are told by the same mark.
        let rival = |mark: Option<Mark>| {
            let alike = effects.iter().zip(&first).filter(|(other, _)| other.mark() == mark);
            let much =
                alike.filter_map(|(_, trial)| trial.as_ref()?.as_ref().ok().filter(|trial| self.may_be_wider(trial)));
            much.map(|trial| self.left_by(trial)).min_by(f64::total_cmp)
        };
        let all = effects.par_iter().with_max_len(1).zip(&first);
        all.map(|(effect, trial)| match (trial, effect.widens()) {
            (Some(trial), _) => trial.clone(),
            (None, Some(name)) if has(&self.standing.fitted.chain, name.effect().as_ref()).is_some() => {
                if !self.leaves_structure(&self.standing) {
                    return Err(Refused::Cannot("little is left beside the narrower effect".to_owned()));
                }
                tried(effect, None, Some(basis.error))
            }
            (None, name) => match name.and_then(of).filter(|trial| self.may_be_wider(trial)) {
                Some(narrower) => tried(effect, Some(narrower), Some(self.left_by(narrower))),
                None => {
                    let rival = rival(effect.mark()).filter(|_| effect.hides_the_narrower());
                    let little = || Refused::Cannot("the effect that it is a wider form of takes little".to_owned());
                    tried(effect, None, Some(rival.ok_or_else(little)?))
                }
            },
        })
        .collect()
    }

    /// Whether a trial takes enough, and leaves enough, for a wider form of its effect.
    fn may_be_wider(&self, trial: &Trial) -> bool {
        self.held_out_percent(trial) < MAY_BE_WIDER * self.held_out_percent(&self.standing)
            && self.leaves_structure(trial)
    }

    /// Whether a trial leaves clearly more than noise, and more than matters.
    fn leaves_structure(&self, trial: &Trial) -> bool {
        if self.held_out_percent(trial) < MATTERS_PERCENT {
            return false;
        }
        let left = trial.left_um2.iter().zip(&self.records);
        let moving: Vec<f64> = left
            .filter(|(_, record)| record.moves())
            .map(|(left, _)| *left)
            .collect();
        let mean = moving.iter().sum::<f64>() / moving.len().max(1) as f64;
        mean > (STRUCTURE * self.noise_um).powi(2)
    }

    fn candidate_on(
        &self,
        effect: &Arc<dyn Effect>,
        plan: Plan,
        basis: &Basis,
        line_hz: Option<f64>,
        (effort, rival): (Effort, Option<f64>),
    ) -> Result<Trial, Refused> {
        let Plan {
            point,
            link,
            mut starts,
        } = plan;
        let among_many = effort == Effort::Quick;
        // The states of the records hide what outlasts them: a short way down ends where they still do.
        let effort = if effect.outlasts_records() {
            Effort::Thorough
        } else if among_many && effect.widens().is_some() {
            Effort::Patient
        } else {
            effort
        };
        // The valleys of a user's equation are not known beforehand.
        let look = if effect.file().is_some() {
            Effort::Thorough
        } else {
            effort
        };
        if let Some(line_hz) = line_hz.filter(|_| effect.adds_line_spectrum()) {
            starts.truncate(1);
            starts
                .iter_mut()
                .filter_map(|start| start.first_mut())
                .for_each(|f| *f = line_hz);
        }
        let costly = self
            .standing
            .fitted
            .chain
            .links
            .iter()
            .any(|link| link.effect.widens().is_some());
        if (costly || rival.is_some()) && starts.len() > LOOKED_AT {
            let every = starts.len().div_ceil(LOOKED_AT);
            starts = starts.into_iter().step_by(every).collect();
        }
        if !effect.has_own_numbers() && starts.len() > look.followed() {
            starts = self.quick_look(&point, link, starts, basis, look);
        }
        let behind =
            |error: f64, times: f64| rival.is_some_and(|rival| error > rival + self.taking_part() * times.powi(2).ln());
        if rival.is_some() {
            // To begin a start takes some ten answers; what it leaves by the tangents of the chain without it takes one.
            let left = |values: &Vec<f64>| basis.left(self, &with_values(&point, link, values), link, &point, WHOLE);
            let hopeful = starts
                .into_par_iter()
                .filter(|values| !behind(left(values), BEGUN_HOPELESS));
            starts = hopeful.collect();
        }
        let mut begun = self.begun(&self.records, (&point, link, &starts), look);
        if rival.is_some() {
            begun.retain(|at| !behind(at.error, BEGUN_HOPELESS));
            if begun.is_empty() {
                return Ok(self.standing.taking_nothing(point));
            }
        }
        let nowhere = || Refused::Cannot("there is nowhere to begin".to_owned());
        let mut best = self
            .followed(&self.records, begun, link, basis.error, look)
            .ok_or_else(nowhere)?;
        if !among_many && best.error > basis.error {
            // Every start ends in a valley above the chain without the effect: from where it does nothing it goes down.
            let nothing = [point.bounds[link].iter().map(|b| b.neutral).collect()];
            let begun = self.begun(&self.records, (&point, link, &nothing), look);
            let from_nothing = self.followed(&self.records, begun, link, basis.error, look);
            best = from_nothing.filter(|at| at.error < best.error).unwrap_or(best);
        }
        if behind(best.error, HOPELESS) {
            return Ok(self.standing.taking_nothing(best.fitted));
        }
        let mut other_states = None;
        if effect.outlasts_records() {
            (best, other_states) = self.in_other_states(effect, (&point, link, &starts), best, (basis.error, effort));
        }
        if among_many && best.error > basis.error - LEAST_FALL {
            return Ok(self.standing.taking_nothing(best.fitted));
        }
        best = self.to_the_end(other_states.as_deref().unwrap_or(&self.records), best, effort);
        if effect.outlasts_records() {
            // What outlasts records is taken for the state of the plays where it is missing: with it that is another.
            for _ in 0..effort.turns() {
                let records = other_states.get_or_insert_with(|| self.records.clone());
                let chosen = chosen_states(records, &best.fitted, |_, record| record.fits);
                if !start_in(records, &chosen) {
                    break;
                }
                let (error, strokes) = self.descent_on(records, effort).answered(&best.fitted);
                best = self.to_the_end(
                    records,
                    Standing {
                        fitted: best.fitted,
                        error,
                        linear: None,
                        strokes: Some(strokes),
                    },
                    effort,
                );
            }
        }
        let records = other_states.as_deref().unwrap_or(&self.records);
        let mut point = best.fitted;
        point.ridge = self.standing.fitted.ridge;
        let mut trial = judge(records, point, &self.standing.weights, self.noise_um, false);
        let before = trial.left_um2.clone();
        let worse = |i: usize| before[i] > WORSE * self.standing.left_um2[i];
        let states = trial.start_held_out(records, |i| effect.outlasts_records() || worse(i));
        trial.states = (states != self.states()).then_some(states);
        Ok(trial)
    }

    /// What outlasts records, from rest and from where straight plays see it: the best, and its states where they are others.
    fn in_other_states(
        &self,
        effect: &Arc<dyn Effect>,
        (point, link, starts): (&Fitted, usize, &[Vec<f64>]),
        mut best: Standing,
        (without, effort): (f64, Effort),
    ) -> (Standing, Option<Vec<Prepared<'_>>>) {
        let mut states = None;
        let followed = |records: &[Prepared<'_>], starts: &[Vec<f64>]| {
            let begun = self.begun(records, (point, link, starts), effort);
            self.followed(records, begun, link, without, effort)
        };
        if let Some(from_rest) = self.begun_at_rest()
            && let Some(other) = followed(&from_rest, starts)
            && other.error < best.error
        {
            (best, states) = (other, Some(from_rest));
        }
        if self.leaves_much(best.error)
            && let Some((values, of_straight)) = self.beside_straight_plays(effect)
        {
            let mut records = self.records.clone();
            start_in(&mut records, &of_straight);
            if let Some(other) = followed(&records, &[values])
                && other.error < best.error
            {
                (best, states) = (other, Some(records));
            }
        }
        (best, states)
    }

    /// The sum of logarithms of what a trial leaves of the records that are fitted.
    fn left_by(&self, trial: &Trial) -> f64 {
        let floor_um2 = vec![self.noise_um.powi(2); self.records.len()];
        logarithms(&self.records, &floor_um2, |i| trial.left_um2[i])
    }

    /// Records that are fitted.
    fn taking_part(&self) -> f64 {
        self.records.iter().filter(|record| record.fits).count() as f64
    }

    /// Whether a sum of logarithms is that of records which are left, in the mean, with many times their noise.
    fn leaves_much(&self, error: f64) -> bool {
        error > self.taking_part() * (MUCH * self.noise_um).powi(2).max(f64::MIN_POSITIVE).ln()
    }

    /// The parameters of an effect, and the states of the records, beside plays that are too stiff to take its part.
    fn beside_straight_plays(&self, effect: &Arc<dyn Effect>) -> Option<(Vec<f64>, Vec<InitialState>)> {
        if !self.standing.family().is_free() {
            return None;
        }
        let straight = Search::new(self.dataset, &self.model(), &Shape::Straight, self.noise_um).ok()?;
        let trial = straight.candidate(effect).ok()?;
        let name = effect.name();
        let link = trial.fitted.chain.links.iter().find(|link| link.is(&name))?;
        Some((link.values.clone(), trial.states.unwrap_or_else(|| straight.states())))
    }

    fn descent_on<'s>(&self, records: &'s [Prepared<'s>], effort: Effort) -> Descent<'s> {
        Descent {
            records,
            noise_um: self.noise_um,
            settled: effort.settled(),
            closely: effort == Effort::Thorough,
            levels: Levels::OfTheState,
        }
    }

    /// Some starts, each with the coefficients that belong to it.
    fn begun(
        &self,
        records: &[Prepared<'_>],
        (point, link, starts): (&Fitted, usize, &[Vec<f64>]),
        effort: Effort,
    ) -> Vec<Standing> {
        let descent = self.descent_on(records, effort);
        let own_numbers = point.chain.links[link].effect.has_own_numbers();
        let each = starts.iter().map(|values| {
            let mut at = point.clone();
            at.chain.links[link].values.clone_from(values);
            if own_numbers {
                at.settle(records);
            }
            descent.project(at)
        });
        each.collect()
    }

    /// The best of some starts, each followed some steps; `without` is the sum of logarithms of the chain as it stands.
    fn followed(
        &self,
        records: &[Prepared<'_>],
        begun: Vec<Standing>,
        link: usize,
        without: f64,
        effort: Effort,
    ) -> Option<Standing> {
        let descent = self.descent_on(records, effort);
        let each = begun.into_iter().map(|at| descent.descend(at, effort.steps().0));
        // One that imitates another effect on a bound comes after all that are what they are called and take something.
        let order = |at: &Standing| (at.fitted.refuted(link) || at.error > without - LEAST_FALL, at.error);
        each.min_by(|a, b| {
            let ((a_last, a), (b_last, b)) = (order(a), order(b));
            a_last.cmp(&b_last).then(a.total_cmp(&b))
        })
    }

    fn to_the_end(&self, records: &[Prepared<'_>], best: Standing, effort: Effort) -> Standing {
        let descent = self.descent_on(records, effort);
        let mut best = descent.descend(best, effort.steps().1);
        if best.fitted.chain.links.iter().any(|link| link.effect.has_own_numbers()) {
            for _ in 0..effort.rounds() {
                best.fitted.settle(records);
                let steps = if effort == Effort::Quick { 2 } else { usize::MAX };
                best = descent.descend(descent.project(best.fitted), steps);
            }
        }
        best
    }

    /// The records with those from rest that begin at the low end of their drive: what repeats now may not have come to its end.
    /// `None` where none would change.
    fn begun_at_rest(&self) -> Option<Vec<Prepared<'_>>> {
        let mut records = self.records.clone();
        let mut changed = false;
        for prepared in &mut records {
            let voltage_v = &prepared.record().voltage_v;
            let (low, high) = range(voltage_v.iter().copied());
            if prepared.initial() != InitialState::REST && voltage_v[0] - low <= 1e-3 * (high - low) {
                prepared.start_in(InitialState::REST);
                changed = true;
            }
        }
        changed.then_some(records)
    }

    /// The standing chain under another trial's ridge, where that is its own: what a candidate gains by its ridge alone
    /// must not count for it.
    pub fn under_ridge_of(&self, trial: &Trial) -> Option<Trial> {
        let ridge = trial.fitted.ridge;
        (ridge != self.standing.fitted.ridge).then(|| {
            let point = Fitted {
                ridge,
                ..self.standing.fitted.clone()
            };
            judge(&self.records, point, &self.standing.weights, self.noise_um, true)
        })
    }

    /// The chain with the effect in it, which link that is, and where its search begins: for a wider form of an effect that is not in the
    /// chain, from a trial of that.
    fn plan(&self, effect: &Arc<dyn Effect>, narrower: Option<&Trial>) -> Result<Plan, Refused> {
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
