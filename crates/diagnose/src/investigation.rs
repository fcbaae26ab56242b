//! Rounds of candidates on one chain: each effect of the catalogue tried in its place, the best taken into the chain, and again.

use crate::diagnosis::{Before, RankedEffect, Reason};
use crate::evidence::{Against, Candidate, Round, Scale, errors};
use crate::rules::{RuleId, Thresholds};
use crate::witness::traces::{self, Traces};
use crate::witness::{hum, rails, ringing};
use hysteron_data::Dataset;
use hysteron_identify::effects::{Effect, Mark, UserEffect, catalogue};
use hysteron_identify::family::range;
use hysteron_identify::search::{Search, Shape, Thinned, Trial};
use hysteron_identify::{EffectId, EffectName, Family, IdentifyError, Model, one_loop};
use std::sync::Arc;

/// Fewer moving records than this may not determine a free shape; then straight plays are tried beside it.
const FEW_RECORDS: usize = 6;

/// The best candidates of a round that tell whether the other free shape goes first.
const ASKED_OF_THE_OTHER: usize = 3;

/// A search with what was found in it so far.
pub(crate) struct Investigation<'a> {
    pub search: Search<'a>,
    pub scale: Scale,
    pub thresholds: Thresholds,
    pub rounds: Vec<Round>,
    /// Whether the records determine the free shape; otherwise straight plays stand in for it.
    pub shape_determined: bool,
    /// Errors before anything was added.
    pub base: Before,
    pub base_excess: f64,
    /// Trials of the first round's candidates, for what is asked of them later.
    pub first_trials: Vec<(EffectName, Trial)>,
    /// The chain that they were tried on.
    pub base_trial: Option<Trial>,
    dataset: &'a Dataset,
    family: Family,
    effects: Vec<Arc<dyn Effect>>,
    one_sine: bool,
    /// Whether the position leads the voltage.
    skewed: bool,
    one_loop: bool,
    traces: Traces,
    /// Lowest and highest recorded position.
    position_um: [f64; 2],
    /// What was left of every record before anything was taken.
    at_first: Vec<Vec<f64>>,
}

/// A candidate of a round.
pub(crate) struct Best {
    pub effect: Arc<dyn Effect>,
    pub trial: Trial,
    pub significant: bool,
    pub candidate: Candidate,
}

impl<'a> Investigation<'a> {
    pub(crate) fn new(
        thinned: &'a Thinned<'a>,
        model: &Model,
        own: &[UserEffect],
        noise_um: f64,
        reasons: &[Reason],
    ) -> Result<Self, IdentifyError> {
        let free = |noise_um: f64| Search::free(thinned, model, noise_um);
        let mut search = searched(&free, noise_um)?;
        let strokes = search.strokes_um();
        let mut shape_determined = true;
        let moving = strokes
            .iter()
            .zip(search.fits())
            .filter(|(s, fits)| **s > 0.0 && *fits)
            .count();
        let thresholds = Thresholds::DEFAULT;
        if moving < FEW_RECORDS
            && let Ok(straight) = Search::new(thinned, model, &Shape::Straight, search.noise_um())
        {
            let better = Scale::of(&search).fall(search.standing(), straight.standing());
            if better > thresholds.of(RuleId::Undetermined) {
                (search, shape_determined) = (straight, false);
            }
        }
        Ok(Self::of(search, model, own, shape_determined, reasons))
    }

    /// As [`Self::new`], around the model's own plays, where they are no worse than the free shape.
    pub(crate) fn around_own(
        thinned: &'a Thinned<'a>,
        model: &Model,
        own: &[UserEffect],
        noise_um: f64,
        reasons: &[Reason],
    ) -> Result<Self, IdentifyError> {
        let search = searched(&|noise_um| Search::new(thinned, model, &Shape::Own, noise_um), noise_um)?;
        Ok(Self::of(search, model, own, true, reasons))
    }

    fn of(search: Search<'a>, model: &Model, own: &[UserEffect], shape_determined: bool, reasons: &[Reason]) -> Self {
        let scale = Scale::of(&search);
        let base = errors(&search, search.standing());
        let base_excess = scale.excess(search.standing());
        let mut effects: Vec<Arc<dyn Effect>> = catalogue()
            .into_iter()
            .filter(|effect| !effect.of_the_shape())
            .collect();
        effects.extend(own.iter().map(|own| own.effect()));
        let traces = Traces::new(search.dataset(), &search.states(), search.noise_um());
        Self {
            scale,
            thresholds: Thresholds::DEFAULT,
            rounds: Vec::new(),
            shape_determined,
            base,
            base_excess,
            first_trials: Vec::new(),
            base_trial: None,
            dataset: search.dataset(),
            family: model.family,
            effects,
            one_sine: reasons.contains(&Reason::OneSine),
            skewed: reasons.contains(&Reason::PositionLeads),
            one_loop: one_loop(search.dataset()),
            position_um: range(search.dataset().records.iter().flat_map(|r| &r.position_um).copied()).into(),
            traces,
            at_first: Vec::new(),
            search,
        }
    }

    /// Leaves only these effects among the candidates.
    pub(crate) fn ask_only(&mut self, names: &[EffectName]) {
        self.effects.retain(|effect| names.contains(&effect.name()));
    }

    /// Whether one sine is all that was played.
    pub(crate) fn one_sine(&self) -> bool {
        self.one_sine
    }

    /// Whether no record shows a loop inside of another.
    pub(crate) fn one_loop(&self) -> bool {
        self.one_loop
    }

    pub(crate) fn traces(&self) -> &Traces {
        &self.traces
    }

    /// Measured minus modelled of every record as the chain stands, at the full rate, run-in included.
    pub(crate) fn residuals(&self) -> Vec<Vec<f64>> {
        let modelled = self.search.modelled(self.search.standing());
        let records = self.dataset.records.iter().zip(modelled).zip(&self.traces.each);
        records
            .map(|((record, modelled), trace)| {
                let own: Vec<f64> = record.position_um.iter().zip(&modelled).map(|(y, m)| y - m).collect();
                own[..trace.from].iter().chain(&own).copied().collect()
            })
            .collect()
    }

    /// [`Self::residuals`] before anything was taken that the model did not have in its hysteresis.
    pub(crate) fn residuals_at_first(&self) -> &[Vec<f64>] {
        &self.at_first
    }

    /// The ring after a step of the drive, in [`Self::residuals`].
    pub(crate) fn ring(&self, residuals: &[Vec<f64>]) -> Option<RankedEffect> {
        let left = errors(&self.search, self.search.standing());
        ringing::find(&self.traces, residuals, self.search.noise_um(), &left)
    }

    /// Whether nothing was taken yet that the model did not have in its hysteresis.
    pub(crate) fn nothing_taken(&self) -> bool {
        self.rounds.iter().all(|round| round.taken.is_none() || round.of_family)
    }

    /// Tries every candidate on the chain as it stands: those that are significant first, then by the statistic. Where the best ones say
    /// that the other free shape goes first, they all are tried on that.
    pub(crate) fn round(&mut self, progress: &(dyn Fn(f64, &str) + Sync)) -> Vec<Best> {
        let (judged, line) = self.tried(progress);
        if !self.nothing_taken() {
            return judged;
        }
        let best = judged.iter().take(ASKED_OF_THE_OTHER);
        let best: Vec<(&Arc<dyn Effect>, &Trial)> = best.map(|best| (&best.effect, &best.trial)).collect();
        if !self.search.turn(&best, line) {
            return judged;
        }
        self.rounds.pop();
        self.scale = Scale::of(&self.search);
        self.base = errors(&self.search, self.search.standing());
        self.base_excess = self.scale.excess(self.search.standing());
        self.traces = Traces::new(self.dataset, &self.search.states(), self.search.noise_um());
        self.tried(progress).0
    }

    /// Every candidate on the chain as it stands, and the frequency of the mains that it was tried with.
    fn tried(&mut self, progress: &(dyn Fn(f64, &str) + Sync)) -> (Vec<Best>, Option<f64>) {
        let first = self.nothing_taken();
        let residuals = self.residuals();
        let line = self.mains_line(&residuals);
        if first {
            self.at_first = residuals;
        }
        let tried: Vec<Arc<dyn Effect>> = self
            .effects
            .iter()
            .filter(|effect| !effect.adds_line_spectrum() || line.is_some())
            .filter(|_| first || self.may_hold_more())
            .cloned()
            .collect();
        let mut trials: Vec<(Arc<dyn Effect>, Trial)> = Vec::new();
        let results = self.search.candidates(&tried, line, progress);
        for (effect, result) in tried.into_iter().zip(results) {
            if let Ok(trial) = result {
                trials.push((effect, trial));
            }
        }
        self.leave_one_form(&mut trials);
        let mut judged = self.judged(trials);
        judged.sort_by(|a, b| self.order(first, &a.candidate, &b.candidate));
        self.by_likelihood(first, &mut judged);
        self.simplest_first(first, &mut judged);
        if first {
            let kept = judged.iter().map(|best| (best.effect.name(), best.trial.clone()));
            self.first_trials = kept.collect();
            self.base_trial = Some(self.search.standing().clone());
        }
        self.rounds.push(Round {
            candidates: judged.iter().map(|best| best.candidate.clone()).collect(),
            taken: None,
            of_family: false,
        });
        (judged, line)
    }

    /// Whether what is left above the noise can hold an effect that counts. Behind a mode with a bent spring every candidate is a
    /// simulation of it; behind the others the noise, which may be an upper bound, is not taken off.
    fn may_hold_more(&self) -> bool {
        let least = self.thresholds.of(RuleId::TakenPercent);
        let left = self.search.pooled_percent(self.search.standing());
        let mut taken = self.rounds.iter().filter_map(|round| round.taken.as_ref()?.id());
        let noise = if taken.any(|id| id.effect().widens().is_some()) {
            self.scale.noise_percent(self.search.noise_um())
        } else {
            0.0
        };
        left > least.hypot(noise)
    }

    /// Takes the best of the last round into the chain.
    pub(crate) fn take(&mut self, best: Best) {
        let of_family =
            matches!(self.family, Family::Mrpi | Family::Wrpi) && best.effect.name() == EffectId::RateDependence;
        if let Some(round) = self.rounds.last_mut() {
            round.taken = Some(best.effect.name());
            round.of_family = of_family;
        }
        self.search.stand_on(best.trial);
    }

    /// Frequency of the mains where most records that could show its lines do.
    fn mains_line(&self, residuals: &[Vec<f64>]) -> Option<f64> {
        let hum = hum::find(&self.traces, residuals, self.search.noise_um())?;
        (hum.of > 0 && 2 * hum.seen_in > hum.of).then_some(hum.frequency_hz)
    }

    /// Of an effect and its wider forms leaves either the effect, or those forms that take a good part of what it leaves. A form that hides
    /// the narrower effect has to take that of what the best effect of its mark leaves: with more numbers it imitates each of them.
    fn leave_one_form(&self, trials: &mut Vec<(Arc<dyn Effect>, Trial)>) {
        let standing = self.search.standing();
        let goes_before = |(effect, wider): &(Arc<dyn Effect>, Trial), narrower: EffectId| {
            let alike = |other: &Arc<dyn Effect>| {
                let of_its_mark =
                    effect.hides_the_narrower() && other.widens().is_none() && other.mark() == effect.mark();
                other.name() == narrower || of_its_mark
            };
            let tried = trials.iter().filter(|(other, _)| alike(other)).map(|(_, trial)| trial);
            let fall = |trial: &&Trial| self.scale.fall(standing, trial);
            let best = tried.max_by(|a, b| fall(a).total_cmp(&fall(b))).unwrap_or(standing);
            let against = self.against(effect.as_ref(), wider);
            let on_top = self
                .scale
                .candidate(&self.search, &effect.name(), (best, wider), against);
            on_top.significant(false, &self.thresholds)
        };
        let wider: Vec<(EffectName, EffectId)> = trials
            .iter()
            .filter_map(|trial| {
                let narrower = trial.0.widens()?;
                goes_before(trial, narrower).then(|| (trial.0.name(), narrower))
            })
            .collect();
        trials.retain(|(effect, _)| match effect.widens() {
            Some(_) => wider.iter().any(|(name, _)| *name == effect.name()),
            None => !wider.iter().any(|(_, narrower)| effect.name() == *narrower),
        });
    }

    /// Each trial against the chain without it, under the same ridge where that helps the chain.
    fn judged(&self, trials: Vec<(Arc<dyn Effect>, Trial)>) -> Vec<Best> {
        let standing = self.search.standing();
        let first = self.nothing_taken();
        let mut others: Vec<Trial> = Vec::new();
        let mut judged = Vec::new();
        for (effect, trial) in trials {
            let mut without = standing;
            // Only what counts is worth another fit of the chain.
            let counts = self.scale.fall(standing, &trial) > self.thresholds.of(RuleId::Statistic);
            if counts && trial.ridge() != standing.ridge() {
                if !others.iter().any(|other| other.ridge() == trial.ridge()) {
                    others.extend(self.search.under_ridge_of(&trial));
                }
                let same = others.iter().find(|other| other.ridge() == trial.ridge());
                without = same
                    .filter(|same| self.scale.fall(standing, same) > 0.0)
                    .unwrap_or(standing);
            }
            let name = effect.name();
            let against = self.against(effect.as_ref(), &trial);
            let mut candidate = self.scale.candidate(&self.search, &name, (without, &trial), against);
            if candidate.significant(first, &self.thresholds) {
                candidate.does_percent = self.search.does_percent(&trial, &name);
            }
            judged.push(Best {
                significant: candidate.significant(first, &self.thresholds),
                effect,
                trial,
                candidate,
            });
        }
        judged
    }

    /// Significant ones first, then by the statistic.
    fn order(&self, first: bool, a: &Candidate, b: &Candidate) -> std::cmp::Ordering {
        let key = |c: &Candidate| (c.significant(first, &self.thresholds), c.statistic);
        let ((a_counts, a), (b_counts, b)) = (key(a), key(b));
        b_counts.cmp(&a_counts).then(b.total_cmp(&a))
    }

    /// Rivals that the statistic does not tell apart stand in the order of their likelihood: it counts how white a residual is.
    fn by_likelihood(&self, first: bool, judged: &mut [Best]) {
        let Some(best) = judged.first().map(|best| best.candidate.statistic) else {
            return;
        };
        let least = best - self.thresholds.of(RuleId::Undecided);
        let close = judged.partition_point(|other| {
            other.candidate.significant(first, &self.thresholds) && other.candidate.statistic > least
        });
        judged[..close].sort_by(|a, b| b.candidate.likelihood.total_cmp(&a.candidate.likelihood));
    }

    /// A rival with fewer numbers that is likelier, and leaves less of every kind of record, goes before the best: what several numbers
    /// imitate is what one of them does alone.
    fn simplest_first(&self, first: bool, judged: &mut [Best]) {
        let Some(best) = judged.first().map(|best| best.candidate.clone()) else {
            return;
        };
        let less = |own: Option<f64>, of_best: Option<f64>| own.zip(of_best).is_none_or(|(own, best)| own < best);
        let simpler = judged.iter().skip(1).position(|Best { candidate, .. }| {
            candidate.significant(first, &self.thresholds)
                && candidate.parameters.len() < best.parameters.len()
                && candidate.likelihood > best.likelihood
                && less(candidate.errors.identify_percent, best.errors.identify_percent)
                && less(candidate.errors.validate_percent, best.errors.validate_percent)
        });
        if let Some(simpler) = simpler {
            judged[..=simpler + 1].rotate_right(1);
        }
    }

    /// What physics, or what these records are, says against it.
    fn against(&self, effect: &dyn Effect, trial: &Trial) -> Option<Against> {
        let mark = effect.mark();
        if self.one_sine && !mark.is_some_and(Mark::shows_in_one_sine) {
            return Some(Against::OneSine);
        }
        if self.skewed && mark.is_some_and(Mark::hidden_by_skew) {
            return Some(Against::Skew);
        }
        let name = effect.name();
        let on_bound = trial.on_bound(&name);
        let parameters = self.search.parameters_of(trial, &name);
        let values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
        let beyond_rails = |rails_v| rails::moves_beyond(&self.dataset.records, rails_v);
        // A position that follows the temperature moves the zero at the records' starts as well; creep does not.
        let starts_still = |um_per_k| !traces::moves_the_zero(&self.traces, um_per_k);
        let refuted = on_bound.iter().any(|parameter| effect.refuted_on_bound(parameter))
            || effect.rails_v(&values).is_some_and(beyond_rails)
            || !values.is_empty()
                && effect
                    .zero_um_per_k(&values, self.position_um)
                    .is_some_and(starts_still);
        refuted.then_some(Against::Physics)
    }
}

/// A search whose noise is no more than what the best-known record leaves: a floor above it counts something else as noise.
fn searched<'a>(
    search: &dyn Fn(f64) -> Result<Search<'a>, IdentifyError>,
    noise_um: f64,
) -> Result<Search<'a>, IdentifyError> {
    let found = search(noise_um)?;
    let least_um = least_left_um(found.standing(), &found.strokes_um());
    if least_um < noise_um {
        return search(least_um);
    }
    Ok(found)
}

/// The least error of a record that moves, micrometres rms.
fn least_left_um(standing: &Trial, strokes_um: &[f64]) -> f64 {
    let moving = standing
        .left_um2
        .iter()
        .zip(strokes_um)
        .filter(|(_, stroke)| **stroke > 0.0);
    moving.map(|(left, _)| left.sqrt()).fold(f64::INFINITY, f64::min)
}
