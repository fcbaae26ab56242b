//! The numbers that a probability rests on.

use crate::diagnosis::{LockTo, WhereItFails};
use crate::evidence::{Against, Bend, Candidate, Evidence};
use hysteron_acquisition::Kind;
use hysteron_identify::effects::{Mark, find};
use hysteron_identify::{EffectId, EffectName};

/// Errors below this, percent of peak to peak, are as good as none.
const LEAST_PERCENT: f64 = 0.01;

/// A lead in the statistic above which more does not count.
const CLEAR: f64 = 6.0;

/// How many numbers an alternative has: its terms, and one for each effect of the catalogue, which is one of its own.
pub const TERMS: usize = Term::ALL.len() + EffectId::COUNT;

/// A number of an alternative.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum Term {
    /// Logarithm of one plus the statistic.
    Statistic,
    /// By how much that is above the best other candidate's.
    Lead,
    /// The same of the statistics themselves, six at most, over six.
    Clear,
    /// Logarithm of the error that the best other candidate leaves over what it leaves.
    RestLead,
    /// Logarithm of one plus the gain in likelihood, nats.
    Likelihood,
    /// By how much that is above the best other candidate's.
    LikelihoodLead,
    /// Share of the squared error that it takes.
    Share,
    /// Whether it takes nothing.
    Nothing,
    /// Logarithm of the fall of the error on records that were fitted.
    FallFitted,
    /// The same on records that were not.
    FallHeldOut,
    /// Whether its numbers are not physical.
    Physics,
    /// Whether one sine was played, which does not tell it.
    OneSine,
    /// The same where its mark is the slew: one loop of any shape bends as a limited slew does.
    SlewOneSine,
    /// Whether the position leads the voltage, which hides it.
    Skew,
    /// Whether sines of one amplitude were played, and it goes with the rate.
    OneAmplitude,
    /// Whether a parameter stands on its bound.
    OnBound,
    /// The share of the excess that all rounds explain, where the first took it.
    Explains,
    /// What it takes, as a bend of straight plays, of the error that these lack of the free shape, times the share of that in the error.
    BendShare,
    /// How well it foretells beside the free shape, 0 to 1, times the same share.
    BendOverFree,
    /// Share of what the free shape leaves that goes with its [`Mark`].
    Goes,
    /// The same of what the given model leaves.
    GoesOfModel,
    /// Share of what the given model leaves that follows the order of the records, where its mark is the temperature.
    InOrder,
    /// The same where like records differ by a factor.
    GainInOrder,
    /// Share of what the free shape leaves that a linear filter takes, where its mark is the phase.
    Linear,
    /// Share of that which repeats with the drive, where its mark does.
    Repeats,
    /// Share of that which does not, where its mark does not.
    Wanders,
    /// Whether the position stops before the voltage does, where its mark is the ends.
    FlatTop,
    /// None of the candidates; the terms that follow are its own.
    None,
    /// Logarithm of the free shape's error over the noise.
    NoneOverNoise,
    /// Logarithm of the given model's error, percent.
    NoneBefore,
    /// Whether the records do not determine a free shape.
    NoneUndetermined,
    /// Share of the given model's error that another shape of the loops takes.
    NoneShape,
    /// Whether what is left is more than noise.
    NoneMoreThanNoise,
    /// Logarithm of one plus the best statistic.
    NoneStatistic,
    /// Share of what the free shape leaves that goes with the sample clock.
    NoneClock,
    /// The same with the count of cycles.
    NoneCycles,
    /// The same with single records.
    NoneRecord,
    /// Whether a tone was found of neither drive nor mains.
    NoneTone,
    /// Whether the position leads the voltage.
    NoneSkew,
}

impl Term {
    /// All, in their order.
    pub const ALL: [Self; 39] = [
        Self::Statistic,
        Self::Lead,
        Self::Clear,
        Self::RestLead,
        Self::Likelihood,
        Self::LikelihoodLead,
        Self::Share,
        Self::Nothing,
        Self::FallFitted,
        Self::FallHeldOut,
        Self::Physics,
        Self::OneSine,
        Self::SlewOneSine,
        Self::Skew,
        Self::OneAmplitude,
        Self::OnBound,
        Self::Explains,
        Self::BendShare,
        Self::BendOverFree,
        Self::Goes,
        Self::GoesOfModel,
        Self::InOrder,
        Self::GainInOrder,
        Self::Linear,
        Self::Repeats,
        Self::Wanders,
        Self::FlatTop,
        Self::None,
        Self::NoneOverNoise,
        Self::NoneBefore,
        Self::NoneUndetermined,
        Self::NoneShape,
        Self::NoneMoreThanNoise,
        Self::NoneStatistic,
        Self::NoneClock,
        Self::NoneCycles,
        Self::NoneRecord,
        Self::NoneTone,
        Self::NoneSkew,
    ];
}

/// Something that may be missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    /// The effect; `None` where it is none of the candidates.
    pub effect: Option<EffectName>,
    /// Its [`Term`]s.
    pub values: [f64; TERMS],
}

impl Alternative {
    fn new(effect: Option<EffectName>, terms: &[(Term, f64)]) -> Self {
        let mut values = [0.0; TERMS];
        for (term, value) in terms {
            values[*term as usize] = *value;
        }
        Self { effect, values }
    }
}

fn is(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

/// The candidates of the first round that the model's family does not have, and the alternative to all of them behind these.
pub fn alternatives(evidence: &Evidence) -> Vec<Alternative> {
    let Some(round) = evidence.rounds.iter().find(|round| !round.of_family) else {
        return Vec::new();
    };
    let each = round.candidates.iter().map(|candidate| {
        let others = || round.candidates.iter().filter(|c| c.effect != candidate.effect);
        let next = others().map(|c| c.statistic).fold(0.0, f64::max);
        let next_likelihood = others().map(|c| c.likelihood).fold(0.0, f64::max);
        let least = others().filter_map(|c| c.errors.pooled()).fold(f64::INFINITY, f64::min);
        let mut own = of_candidate(evidence, candidate, [next, next_likelihood, least]);
        if round.taken.as_ref() == Some(&candidate.effect) {
            own.values[Term::Explains as usize] = evidence.explained();
        }
        own
    });
    let mut all: Vec<Alternative> = each.collect();
    all.push(of_none(evidence, &round.candidates));
    all
}

fn of_candidate(evidence: &Evidence, candidate: &Candidate, [next, next_likelihood, least]: [f64; 3]) -> Alternative {
    let log = |value: f64| value.max(0.0).ln_1p();
    let fall = |from: Option<f64>, to: Option<f64>| {
        let above = |percent: f64| percent.max(evidence.noise_percent).max(LEAST_PERCENT);
        from.zip(to).map_or(0.0, |(from, to)| (above(from) / above(to)).ln())
    };
    let (base, own) = (&evidence.base, &candidate.errors);
    // A free shape that went astray where nothing was fitted leaves much to fall.
    let unseen = match (base.validate_percent, evidence.before.validate_percent) {
        (Some(free), Some(given)) => Some(free.min(given)),
        (free, _) => free,
    };
    let mut terms = vec![
        (Term::Statistic, log(candidate.statistic)),
        (Term::Lead, log(candidate.statistic) - log(next)),
        (
            Term::Clear,
            (candidate.statistic.max(0.0) - next).clamp(0.0, CLEAR) / CLEAR,
        ),
        (
            Term::RestLead,
            fall(Some(least).filter(|p| p.is_finite()), own.pooled()),
        ),
        (Term::Likelihood, log(candidate.likelihood)),
        (Term::LikelihoodLead, log(candidate.likelihood) - log(next_likelihood)),
        (Term::Share, candidate.share.clamp(0.0, 1.0)),
        (Term::Nothing, is(candidate.statistic < 0.1)),
        (Term::FallFitted, fall(base.identify_percent, own.identify_percent)),
        (Term::FallHeldOut, fall(unseen, own.validate_percent)),
        (Term::Physics, is(candidate.against == Some(Against::Physics))),
        (Term::OneSine, is(candidate.against == Some(Against::OneSine))),
        (Term::Skew, is(candidate.against == Some(Against::Skew))),
        (Term::OnBound, is(candidate.on_bound)),
    ];
    let of_this = |bend: &&Bend| bend.candidate.effect == candidate.effect;
    if let Some(bend) = evidence.shape.each.iter().find(of_this) {
        let lacks = lacks(evidence);
        terms.push((Term::BendShare, lacks * bend.candidate.share.clamp(0.0, 1.0)));
        terms.push((Term::BendOverFree, lacks / (1.0 + (-bend.over_free).exp())));
    }
    let id = candidate.effect.id();
    if let Some(mark) = id.and_then(|id| find(id).mark()) {
        let unheard = mark == Mark::Slew && candidate.against == Some(Against::OneSine);
        terms.push((Term::SlewOneSine, is(unheard)));
        terms.extend(of_mark(evidence, mark));
    }
    let mut own = Alternative::new(Some(candidate.effect.clone()), &terms);
    if let Some(id) = id {
        // A wider form stands where the narrower effect would.
        own.values[Term::ALL.len() + id.narrowest() as usize] = 1.0;
    }
    own
}

/// What the residuals say of effects with this mark.
fn of_mark(evidence: &Evidence, mark: Mark) -> Vec<(Term, f64)> {
    let (free, own) = (&evidence.free_fails, &evidence.fails);
    let with: &[LockTo] = match mark {
        Mark::Phase | Mark::Rate | Mark::Slew => &[LockTo::Speed],
        Mark::Position | Mark::Ends => &[LockTo::Position],
        Mark::Time | Mark::Mains => &[LockTo::Time],
        Mark::Temperature => &[LockTo::Temperature, LockTo::RecordOrder],
        Mark::OtherAxis => &[LockTo::OtherAxis],
    };
    let mut terms = vec![
        (Term::Goes, goes(free, with)),
        (Term::GoesOfModel, goes(own, with)),
        (Term::Linear, is(mark == Mark::Phase) * free.linear_in_drive),
        (
            Term::FlatTop,
            is(mark == Mark::Ends && evidence.rig.contains(&Kind::FlatTop)),
        ),
        (
            Term::OneAmplitude,
            is(evidence.one_amplitude && matches!(mark, Mark::Phase | Mark::Rate | Mark::Slew)),
        ),
    ];
    if mark == Mark::Temperature {
        let in_order = goes(own, &[LockTo::RecordOrder]);
        terms.push((Term::InOrder, in_order));
        terms.push((
            Term::GainInOrder,
            is(evidence.rig.contains(&Kind::GainByRecord)) * in_order,
        ));
    }
    if let Some(repeats) = free.repeats_with_drive {
        terms.push(if mark.shows_in_one_sine() {
            (Term::Wanders, 1.0 - repeats)
        } else {
            (Term::Repeats, repeats)
        });
    }
    terms
}

fn of_none(evidence: &Evidence, candidates: &[Candidate]) -> Alternative {
    let free = &evidence.free_fails;
    let of_error = |percent: Option<f64>| percent.unwrap_or(0.0).max(LEAST_PERCENT);
    let best = candidates.iter().map(|c| c.statistic).fold(0.0, f64::max);
    let noise_percent = evidence.noise_percent.max(LEAST_PERCENT);
    Alternative::new(
        None,
        &[
            (Term::None, 1.0),
            (
                Term::NoneOverNoise,
                (of_error(evidence.base.counts()) / noise_percent).ln(),
            ),
            (Term::NoneBefore, of_error(evidence.before.counts()).ln()),
            (Term::NoneUndetermined, is(!evidence.shape_determined)),
            (Term::NoneShape, lacks(evidence)),
            (Term::NoneMoreThanNoise, is(evidence.more_than_noise)),
            (Term::NoneStatistic, best.ln_1p()),
            (Term::NoneClock, goes(free, &[LockTo::SampleClock])),
            (Term::NoneCycles, goes(free, &[LockTo::CycleCount])),
            (Term::NoneRecord, goes(free, &[LockTo::Record])),
            (Term::NoneTone, is(evidence.rig.contains(&Kind::Tone))),
            (Term::NoneSkew, is(evidence.rig.contains(&Kind::PositionLeads))),
        ],
    )
}

/// Share of the given model's error that the free shape takes, beside the model's own plays; at most 1.5.
fn lacks(evidence: &Evidence) -> f64 {
    let before = evidence.before.counts().unwrap_or(0.0).max(LEAST_PERCENT);
    (evidence.shape.lacks_percent.unwrap_or(0.0) / before).min(1.5)
}

/// The largest share that goes with one of these.
fn goes(fails: &WhereItFails, with: &[LockTo]) -> f64 {
    let each = fails.locked_to.iter().filter(|lock| with.contains(&lock.to));
    each.map(|lock| lock.share).fold(0.0, f64::max)
}
