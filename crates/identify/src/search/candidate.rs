//! One more effect in the chain, and the way from its starts to the bottom of its valley.

use super::effort::Effort;
use super::fitted::{Descent, Fitted, Levels, Standing};
use super::look::Basis;
use super::plan::{Plan, Refused};
use super::records::Prepared;
use super::trial::{Trial, judge, logarithms};
use super::{Search, Shape, chosen_states, has, start_in};
use crate::effects::{Effect, EffectId, Mark};
use crate::family::range;
use crate::start_state::InitialState;
use rayon::prelude::*;
use std::sync::Arc;

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

impl Search<'_> {
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
        mut plan: Plan,
        basis: &Basis,
        line_hz: Option<f64>,
        (effort, rival): (Effort, Option<f64>),
    ) -> Result<Trial, Refused> {
        let among_many = effort == Effort::Quick;
        let (effort, look) = effort.for_effect(effect.as_ref());
        plan.begin_at_line(line_hz);
        let Plan { point, link, starts } = plan;
        // What is left beside a rival, where it is so many times what that leaves.
        let limit = |times: f64| rival.map(|rival| rival + self.taking_part() * times.powi(2).ln());
        let behind = |error: f64, times: f64| limit(times).is_some_and(|limit| error > limit);
        let starts = self.looked_at((&point, link, starts), (basis, look), limit(BEGUN_HOPELESS));
        let mut begun = self.begun(&self.records, (&point, link, &starts), look);
        begun.retain(|at| !behind(at.error, BEGUN_HOPELESS));
        if rival.is_some() && begun.is_empty() {
            return Ok(self.standing.taking_nothing(point));
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
        let mut states = None;
        if effect.outlasts_records() {
            (best, states) = self.in_other_states(effect, (&point, link, &starts), best, (basis.error, effort));
        }
        if among_many && best.error > basis.error - LEAST_FALL {
            return Ok(self.standing.taking_nothing(best.fitted));
        }
        best = self.to_the_end(states.as_deref().unwrap_or(&self.records), best, effort);
        if effect.outlasts_records() {
            (best, states) = self.states_followed(best, states, effort);
        }
        Ok(self.concluded(effect.as_ref(), best, states.as_deref().unwrap_or(&self.records)))
    }

    /// What outlasts records is taken for the state of the plays where it is missing; with it that is another. States and chain follow each
    /// other.
    fn states_followed<'s>(
        &'s self,
        mut best: Standing,
        mut states: Option<Vec<Prepared<'s>>>,
        effort: Effort,
    ) -> (Standing, Option<Vec<Prepared<'s>>>) {
        for _ in 0..effort.turns() {
            let records = states.get_or_insert_with(|| self.records.clone());
            let chosen = chosen_states(records, &best.fitted, |_, record| record.fits);
            if !start_in(records, &chosen) {
                break;
            }
            let (error, strokes) = self.descent_on(records, effort).answered(&best.fitted);
            let at = Standing {
                fitted: best.fitted,
                error,
                linear: None,
                strokes: Some(strokes),
            };
            best = self.to_the_end(records, at, effort);
        }
        (best, states)
    }

    /// The bottom of a valley judged, the records without part in the fit in the states that the chain gives them there.
    fn concluded(&self, effect: &dyn Effect, best: Standing, records: &[Prepared<'_>]) -> Trial {
        let mut point = best.fitted;
        point.ridge = self.standing.fitted.ridge;
        let mut trial = judge(records, point, &self.standing.weights, self.noise_um, false);
        let before = trial.left_um2.clone();
        let worse = |i: usize| before[i] > WORSE * self.standing.left_um2[i];
        let states = trial.start_held_out(records, |i| effect.outlasts_records() || worse(i));
        trial.states = (states != self.own_states()).then_some(states);
        trial
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
        let straight = Search::new(self.thinned, &self.model(), &Shape::Straight, self.noise_um).ok()?;
        let trial = straight.candidate(effect).ok()?;
        let name = effect.name();
        let link = trial.fitted.chain.links.iter().find(|link| link.is(&name))?;
        Some((
            link.values.clone(),
            trial.states.unwrap_or_else(|| straight.own_states()),
        ))
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
}
