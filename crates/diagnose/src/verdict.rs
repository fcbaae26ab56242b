//! From evidence to a verdict, by the rules' table.

use crate::diagnosis::{Level, RankedEffect, Verdict};
use crate::evidence::{Against, Bend, Candidate, Evidence, Round};
use crate::odds::Odds;
use crate::rules::{RuleId, Thresholds};
use hysteron_identify::effects::{Mark, find};
use hysteron_identify::{EffectId, EffectName};

/// What the rules make of the evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct Decision {
    /// The main thing.
    pub verdict: Verdict,
    /// What cannot be told from it, likeliest first; beside `unknown` what could be it.
    pub set: Vec<EffectName>,
    /// What is missing beside it.
    pub further: Vec<EffectName>,
    /// What the verdict takes of the excess squared error.
    pub share: Option<f64>,
    /// Whether the model's own plays lack the shape.
    pub shape_too_poor: bool,
}

/// Decides.
pub fn decide(evidence: &Evidence, thresholds: &Thresholds) -> Decision {
    decide_by(evidence, &Odds::of(evidence), thresholds)
}

/// As [`decide`], by these probabilities.
pub fn decide_by(evidence: &Evidence, odds: &Odds, thresholds: &Thresholds) -> Decision {
    let shape_too_poor = evidence
        .shape
        .lacks_percent
        .is_some_and(|percent| percent > thresholds.of(RuleId::ShapeLacksPercent));
    let mut decision = Decision {
        verdict: Verdict::Unknown,
        set: Vec::new(),
        further: Vec::new(),
        share: None,
        shape_too_poor,
    };
    if !evidence.reasons.is_empty() {
        return decision;
    }
    let found: Vec<&Round> = evidence
        .rounds
        .iter()
        .filter(|r| r.taken.is_some() && !r.of_family)
        .collect();
    let mut named: Vec<EffectName> = found.iter().filter_map(|round| round.taken.clone()).collect();
    // Seen as such, whatever else remains.
    let seen = [&evidence.seen.dead_band, &evidence.seen.ring];
    for entry in seen.into_iter().flatten() {
        if !named.contains(&entry.effect) {
            named.push(entry.effect.clone());
        }
    }
    let bent = bent(evidence, thresholds);
    if named.is_empty()
        && evidence.before.exceeds(thresholds.of(RuleId::MattersPercent))
        && let Some((first, further)) = bent.split_first()
    {
        let of_first = |bend: &&Bend| bend.candidate.effect == *first;
        let found = evidence.shape.each.iter().find(of_first);
        decision.share = found.map(|bend| bend.candidate.share.min(1.0));
        decision.verdict = Verdict::Effect(first.clone());
        decision.further = further.to_vec();
        decision.set = alike_by_loops(evidence, first, thresholds);
        return decision;
    }
    if !named.is_empty() {
        return of_found(evidence, (named, &found), (bent, odds), decision, thresholds);
    }
    let matters = thresholds.of(RuleId::MattersPercent);
    let unexplained = evidence.left_percent > matters
        && (evidence.left_percent > 2.0 * evidence.noise_percent || evidence.more_than_noise);
    if evidence.before.exceeds(matters) && unexplained {
        match odds.each.first() {
            Some(first) if first.probability > thresholds.of(RuleId::CertainProbability) => {
                decision.verdict = Verdict::Effect(first.effect.clone());
            }
            _ => decision.set = odds.set(thresholds.of(RuleId::SetProbability)),
        }
    } else if evidence.before.exceeds(matters) && shape_too_poor {
        decision.verdict = Verdict::Effect(EffectId::HysteresisShape.into());
        decision.set = bends(evidence, thresholds);
    } else {
        decision.verdict = Verdict::Nothing;
    }
    decision
}

/// The decision where something was found or seen: the first of it, if it explains enough.
fn of_found(
    evidence: &Evidence,
    (mut named, found): (Vec<EffectName>, &[&Round]),
    (bent, odds): (Vec<EffectName>, &Odds),
    mut decision: Decision,
    thresholds: &Thresholds,
) -> Decision {
    let first = named[0].clone();
    let round = found.first().filter(|round| round.taken.as_ref() == Some(&first));
    let candidate = round.and_then(|round| round.candidates.iter().find(|c| c.effect == first));
    let by_witness = candidate.is_none();
    let explains = explains_enough(evidence, thresholds)
        || candidate
            .zip(round)
            .is_some_and(|(c, round)| is_a_part(c, round, thresholds));
    let mimicked = candidate
        .zip(round)
        .map_or_else(Vec::new, |(c, round)| better_in_one_sine(c, round));
    let stands = by_witness
        || explains && mimicked.is_empty() && !worse_held_out(evidence, found)
        || odds.probability(&first) > thresholds.of(RuleId::CertainProbability);
    let mut rivals = round.map_or_else(Vec::new, |round| rivals(evidence, &first, round, thresholds));
    rivals.extend(mimicked);
    let alone =
        by_witness || stands && rivals.is_empty() && odds.probability(&first) > thresholds.of(RuleId::NameProbability);
    if !alone {
        decision.set = odds.set(thresholds.of(RuleId::SetProbability));
        for rival in rivals {
            if !decision.set.contains(&rival) {
                decision.set.push(rival);
            }
        }
    }
    if stands {
        decision.share = candidate.map(|c| c.share);
        decision.set.retain(|name| *name != first);
        decision.further = named.split_off(1);
        let beside = bent.into_iter().filter(|name| *name != first);
        let beside: Vec<EffectName> = beside.filter(|name| !decision.further.contains(name)).collect();
        decision.further.extend(beside);
        decision.verdict = Verdict::Effect(first);
    }
    decision
}

/// The candidates that come close to the one that was taken, or go with the rate as that does in sines of one amplitude: loops inside of
/// others tell those apart, and such sines close none.
fn rivals(evidence: &Evidence, first: &EffectName, round: &Round, thresholds: &Thresholds) -> Vec<EffectName> {
    let with_the_rate = |name: &EffectName| {
        name.id()
            .is_some_and(|id| find(id).mark().is_some_and(Mark::hidden_by_skew))
    };
    let turned = evidence.one_amplitude && with_the_rate(first);
    let alike = |c: &&Candidate| turned && with_the_rate(&c.effect) && c.statistic > thresholds.of(RuleId::Statistic);
    let mut rivals = close(round, coarse(evidence, thresholds), thresholds);
    for candidate in round.candidates.iter().filter(alike) {
        if !rivals.contains(&candidate.effect) {
            rivals.push(candidate.effect.clone());
        }
    }
    rivals.retain(|name| name != first);
    rivals
}

/// Whether what was found takes most of the excess, and so much that no larger thing than itself can be left.
fn explains_enough(evidence: &Evidence, thresholds: &Thresholds) -> bool {
    let much = evidence.left_percent > thresholds.of(RuleId::MuchLeftPercent);
    let least = if much {
        RuleId::LargeExplainedShare
    } else {
        RuleId::ExplainedShare
    };
    evidence.explained() > thresholds.of(least)
}

/// Whether all that was found leaves more of the records not fitted to than the model that the user began with: such a chain says nothing
/// of them.
fn worse_held_out(evidence: &Evidence, found: &[&Round]) -> bool {
    let last = found.last().and_then(|round| {
        let taken = |candidate: &&Candidate| round.taken.as_ref() == Some(&candidate.effect);
        round.candidates.iter().find(taken)
    });
    let own = last.and_then(|candidate| candidate.errors.validate_percent);
    own.zip(evidence.before.validate_percent)
        .is_some_and(|(own, before)| own > before)
}

/// Effects that explain more than a candidate, but that one sine does not tell: the candidate may be what one of them looks like there.
fn better_in_one_sine(candidate: &Candidate, round: &Round) -> Vec<EffectName> {
    let better = |c: &&Candidate| c.against == Some(Against::OneSine) && c.statistic > candidate.statistic;
    let mut better: Vec<&Candidate> = round.candidates.iter().filter(better).collect();
    better.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    better.iter().map(|c| c.effect.clone()).collect()
}

/// Whether a candidate has twice the evidence of a first effect, and takes a main part.
fn large(candidate: &Candidate, thresholds: &Thresholds) -> bool {
    candidate.statistic > thresholds.of(RuleId::PartStatistic) && candidate.share > thresholds.of(RuleId::PartShare)
}

/// Whether a candidate is certain enough to be named beside an unexplained rest.
fn is_a_part(candidate: &Candidate, round: &Round, thresholds: &Thresholds) -> bool {
    let rivals = round
        .candidates
        .iter()
        .filter(|c| c.effect != candidate.effect && c.against.is_none());
    let next = rivals.map(|c| c.statistic).fold(0.0, f64::max);
    large(candidate, thresholds) && candidate.statistic > thresholds.of(RuleId::PartLead) * next
}

/// Whether so much is left, or the loops are so poorly known, that the best candidate's lead may be that of a mimic.
fn coarse(evidence: &Evidence, thresholds: &Thresholds) -> bool {
    !evidence.shape_determined || evidence.left_percent > thresholds.of(RuleId::MuchLeftPercent)
}

/// The candidates of a round that cannot be told from its best one, that one first.
pub(crate) fn close(round: &Round, coarse: bool, thresholds: &Thresholds) -> Vec<EffectName> {
    let significant = |c: &&Candidate| c.significant(true, thresholds);
    let Some(best) = round.candidates.iter().find(significant) else {
        return Vec::new();
    };
    let comes_close = |c: &&Candidate| {
        coarse && c.statistic > thresholds.of(RuleId::CoarseSetStatistic) * best.statistic
            || (best.statistic - c.statistic).abs() < thresholds.of(RuleId::Undecided)
            || c.statistic > thresholds.of(RuleId::SetStatistic) * best.statistic
                && c.likelihood > thresholds.of(RuleId::SetLikelihood) * best.likelihood
    };
    let all = round.candidates.iter().filter(significant).filter(comes_close);
    all.map(|c| c.effect.clone()).collect()
}

/// Bends that explain what the model's plays lack about as well as the free shape does: they may be what it is.
fn bends(evidence: &Evidence, thresholds: &Thresholds) -> Vec<EffectName> {
    let as_good = |bend: &&Bend| bend.candidate.share > thresholds.of(RuleId::EquivalentShare);
    let each = evidence.shape.each.iter().filter(as_good);
    let alone: Vec<EffectName> = each.map(|bend| bend.candidate.effect.clone()).collect();
    if alone.is_empty() && evidence.shape.both.iter().any(|both| as_good(&both)) {
        return vec![EffectId::Asymmetry.into(), EffectId::SensorNonlinearity.into()];
    }
    alone
}

/// Bends that are more than another shape of the loops, the one that takes most first. A bend of two numbers that foretells as the
/// free shape does, with three numbers a play, is what is there; minor loops that are not congruent show a bent position by themselves.
fn bent(evidence: &Evidence, thresholds: &Thresholds) -> Vec<EffectName> {
    let shape = &evidence.shape;
    let of = |effect: EffectId| shape.each.iter().find(|bend| bend.candidate.effect == effect);
    let (voltage, position) = (of(EffectId::Asymmetry), of(EffectId::SensorNonlinearity));
    let better =
        |a: &Bend, b: Option<&Bend>| b.is_none_or(|b| a.over_free - b.over_free > thresholds.of(RuleId::Statistic));
    let beats_free = |bend: &Bend| bend.over_free > thresholds.of(RuleId::Undecided);
    let lacks = shape.fine_lacks_percent;
    // Beside a larger thing that nobody knows the name of, a bend may be that thing's own shape.
    let explains = |bend: &Bend| {
        let all = lacks.powi(2) + shape.free_percent.powi(2);
        bend.candidate.share > thresholds.of(RuleId::EquivalentShare)
            && 1.0 - bend.left_percent.powi(2) / all > thresholds.of(RuleId::ExplainedShare)
    };
    let both = shape.both.as_ref().is_some_and(|both| {
        lacks > thresholds.of(RuleId::BendLacksPercent)
            && explains(both)
            && beats_free(both)
            && better(both, voltage)
            && better(both, position)
    });
    let of_voltage = voltage.filter(|bend| {
        let as_free = bend.left_percent < thresholds.of(RuleId::AsFree) * shape.free_percent;
        both || lacks > thresholds.of(RuleId::BendLacksPercent) && explains(bend) && better(bend, position) && as_free
    });
    let of_position = position.filter(|bend| {
        both || lacks > thresholds.of(RuleId::PositionLacksPercent)
            && explains(bend)
            && better(bend, voltage)
            && beats_free(bend)
    });
    let mut found: Vec<&Bend> = [of_voltage, of_position].into_iter().flatten().collect();
    found.sort_by(|a, b| b.candidate.share.total_cmp(&a.candidate.share));
    if found.is_empty() && not_congruent(evidence, thresholds) {
        return vec![EffectId::SensorNonlinearity.into()];
    }
    found.iter().map(|bend| bend.candidate.effect.clone()).collect()
}

/// What a bend cannot be told from by loops alone: another shape of them, and the other bend where it explains as much. Minor loops that
/// are not congruent are a second witness of a bent position against another shape; a bent voltage has none.
fn alike_by_loops(evidence: &Evidence, bend: &EffectName, thresholds: &Thresholds) -> Vec<EffectName> {
    let witnessed = *bend == EffectId::SensorNonlinearity && not_congruent(evidence, thresholds);
    let mut alike: Vec<EffectName> = Vec::new();
    if !witnessed {
        alike.push(EffectId::HysteresisShape.into());
    }
    alike.extend(bends(evidence, thresholds).into_iter().filter(|other| other != bend));
    alike
}

/// Whether a bend of the position takes what the model's plays lack, and foretells besides what no hysteresis with congruent minor loops
/// does, whatever their shape.
fn not_congruent(evidence: &Evidence, thresholds: &Thresholds) -> bool {
    let takes_all = evidence.shape.each.iter().any(|bend| {
        bend.candidate.effect == EffectId::SensorNonlinearity
            && bend.candidate.share > thresholds.of(RuleId::EquivalentShare)
    });
    takes_all
        && evidence.shape.not_congruent.as_ref().is_some_and(|bend| {
            bend.statistic > thresholds.of(RuleId::NotCongruent)
                && bend.taken_percent > thresholds.of(RuleId::NotCongruentPercent)
                && bend.errors.pooled().unwrap_or(f64::INFINITY) < thresholds.of(RuleId::CongruentLeftPercent)
        })
}

/// The ranking that people see: the first round, with what was found first, then the bends.
pub(crate) fn ranking(evidence: &Evidence, thresholds: &Thresholds) -> Vec<RankedEffect> {
    let mut entries: Vec<RankedEffect> = Vec::new();
    let seen = [&evidence.seen.dead_band, &evidence.seen.ring];
    for (number, round) in evidence.rounds.iter().enumerate() {
        if round.of_family {
            continue;
        }
        let first = number == 0 || evidence.rounds[..number].iter().all(|r| r.of_family);
        let shown = round
            .candidates
            .iter()
            .filter(|c| first || round.taken.as_ref() == Some(&c.effect));
        for candidate in shown {
            if !entries.iter().any(|entry| entry.effect == candidate.effect) {
                let significant = candidate.significant(first, thresholds);
                entries.push(candidate.entry(Level::Physical, significant, thresholds));
            }
        }
    }
    for entry in seen.into_iter().flatten() {
        entries.retain(|other| other.effect != entry.effect);
        entries.insert(0, entry.clone());
    }
    let taken = |entry: &RankedEffect| {
        let place = evidence
            .rounds
            .iter()
            .position(|r| r.taken.as_ref() == Some(&entry.effect));
        place.unwrap_or(usize::MAX)
    };
    entries.sort_by_key(taken);
    let bent = bent(evidence, thresholds);
    for bend in evidence.shape.each.iter().map(|bend| &bend.candidate) {
        if !entries
            .iter()
            .any(|entry| entry.effect == bend.effect && entry.significant)
        {
            entries.retain(|entry| entry.effect != bend.effect);
            let level = if bent.contains(&bend.effect) {
                Level::Physical
            } else {
                Level::Shape
            };
            entries.push(bend.entry(level, bent.contains(&bend.effect), thresholds));
        }
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::{Before, Reason};
    use crate::evidence::{Against, Bends, Seen};
    use crate::odds::Likely;

    fn candidate(effect: EffectId, statistic: f64, share: f64) -> Candidate {
        Candidate {
            effect: effect.into(),
            statistic,
            likelihood: 10.0 * statistic,
            independent: 1000.0,
            share,
            taken_percent: 1.0,
            does_percent: None,
            errors: Before::default(),
            against: None,
            on_bound: false,
            parameters: Vec::new(),
        }
    }

    fn bend(effect: EffectId, share: f64, over_free: f64) -> Bend {
        Bend {
            candidate: candidate(effect, 1.0, share),
            left_percent: 0.05,
            over_free,
        }
    }

    /// A delay that explains nearly everything, a lag behind it.
    fn evidence() -> Evidence {
        Evidence {
            before: Before {
                identify_percent: Some(2.0),
                validate_percent: Some(2.0),
            },
            shape_determined: true,
            base_excess: 4e-4,
            left_excess: 0.0,
            left_percent: 0.1,
            noise_percent: 0.08,
            rounds: vec![
                Round {
                    candidates: vec![
                        candidate(EffectId::Delay, 20.0, 0.98),
                        candidate(EffectId::FirstOrderLag, 15.0, 0.9),
                    ],
                    taken: Some(EffectId::Delay.into()),
                    of_family: false,
                },
                Round {
                    candidates: vec![candidate(EffectId::Creep, 1.0, 0.1)],
                    taken: None,
                    of_family: false,
                },
            ],
            ..Evidence::default()
        }
    }

    /// Probabilities of 0.65 for the first candidate of the first round, and of 0.25 for the second.
    fn decided(evidence: &Evidence) -> Decision {
        let first = evidence.rounds.iter().find(|round| !round.of_family);
        let candidates = first.map_or(&[][..], |round| &round.candidates);
        let each = candidates.iter().zip([0.65, 0.25]);
        let odds = Odds {
            each: each
                .map(|(c, probability)| likely(c.effect.clone(), probability))
                .collect(),
            none: 0.1,
        };
        decide_by(evidence, &odds, &Thresholds::DEFAULT)
    }

    fn likely(effect: EffectName, probability: f64) -> Likely {
        Likely { effect, probability }
    }

    fn verdict(evidence: &Evidence) -> Verdict {
        decided(evidence).verdict
    }

    fn named(effect: EffectId) -> Verdict {
        Verdict::Effect(effect.into())
    }

    #[test]
    fn val_an_effect_that_explains_the_excess_is_named() {
        assert_eq!(verdict(&evidence()), named(EffectId::Delay));
        let reasons = vec![Reason::AllNoise];
        assert_eq!(verdict(&Evidence { reasons, ..evidence() }), Verdict::Unknown);
    }

    /// A name that leaves more of the records not fitted to than the start model does is none, but stays among what could be it.
    #[test]
    fn bva_the_records_not_fitted_to_on_both_sides() {
        let of = |validate_percent: Option<f64>| {
            let mut evidence = evidence();
            evidence.rounds[0].candidates[0].errors.validate_percent = validate_percent;
            decided(&evidence)
        };
        assert_eq!(of(Some(1.9)).verdict, named(EffectId::Delay));
        assert_eq!(of(None).verdict, named(EffectId::Delay));
        let worse = of(Some(2.1));
        assert_eq!(worse.verdict, Verdict::Unknown);
        assert!(worse.set.contains(&EffectId::Delay.into()), "{worse:?}");
    }

    /// Each threshold of what is enough, a tenth below it and a tenth above it. The rival is close, so that no part is named.
    #[test]
    fn bva_most_of_the_excess_on_both_sides() {
        let of = |left_percent: f64, explained: f64| {
            let mut evidence = Evidence {
                left_percent,
                left_excess: (1.0 - explained) * 4e-4,
                ..evidence()
            };
            evidence.rounds[0].candidates[1].statistic = 19.0;
            verdict(&evidence)
        };
        assert_eq!(of(0.5, 0.66), named(EffectId::Delay));
        assert_eq!(of(0.5, 0.54), Verdict::Unknown);
        assert_eq!(of(1.3, 0.88), named(EffectId::Delay));
        assert_eq!(of(1.3, 0.72), Verdict::Unknown);
        assert_eq!(of(1.1, 0.72), named(EffectId::Delay));
    }

    #[test]
    fn bva_a_part_is_named_beside_a_rest_on_both_sides() {
        let of = |statistic: f64, share: f64, rival: f64| {
            let mut evidence = Evidence {
                left_percent: 2.0,
                left_excess: 2e-4,
                ..evidence()
            };
            evidence.rounds[0].candidates = vec![
                candidate(EffectId::Delay, statistic, share),
                candidate(EffectId::Creep, rival, 0.2),
            ];
            verdict(&evidence)
        };
        assert_eq!(of(4.4, 0.5, 1.0), named(EffectId::Delay));
        assert_eq!(of(3.6, 0.5, 1.0), Verdict::Unknown);
        assert_eq!(of(8.0, 0.275, 1.0), named(EffectId::Delay));
        assert_eq!(of(8.0, 0.225, 1.0), Verdict::Unknown);
        assert_eq!(of(8.0, 0.5, 6.3), named(EffectId::Delay));
        assert_eq!(of(8.0, 0.5, 7.7), Verdict::Unknown);
    }

    /// A name that the rules find stands alone from one half on; from 0.95 on a candidate does whatever the rules say; a set holds
    /// 85 % of what the candidates have.
    #[test]
    fn bva_probabilities_on_both_sides() {
        let delay = EffectName::from(EffectId::Delay);
        let lag = EffectName::from(EffectId::FirstOrderLag);
        let creep = EffectName::from(EffectId::Creep);
        let of = |evidence: &Evidence, [a, b, c]: [f64; 3]| {
            let each = vec![
                likely(delay.clone(), a),
                likely(lag.clone(), b),
                likely(creep.clone(), c),
            ];
            let odds = Odds {
                each,
                none: 1.0 - a - b - c,
            };
            let decision = decide_by(evidence, &odds, &Thresholds::DEFAULT);
            (decision.verdict, decision.set)
        };
        let found = evidence();
        assert_eq!(of(&found, [0.61, 0.2, 0.1]), (named(EffectId::Delay), vec![]));
        assert_eq!(
            of(&found, [0.59, 0.2, 0.1]),
            (named(EffectId::Delay), vec![lag.clone()])
        );
        // 0.73 and 0.71 of 0.9: 80 % are 0.72.
        assert_eq!(of(&found, [0.43, 0.3, 0.17]).1, vec![lag.clone()]);
        assert_eq!(of(&found, [0.41, 0.3, 0.19]).1, vec![lag.clone(), creep.clone()]);
        // A rival by its statistic stays one, however unlikely it is.
        let mut close = evidence();
        close.rounds[0].candidates[1].statistic = 19.9;
        assert_eq!(
            of(&close, [0.97, 0.01, 0.01]),
            (named(EffectId::Delay), vec![lag.clone()])
        );
        let mut left = Evidence {
            left_percent: 2.0,
            left_excess: 3e-4,
            ..evidence()
        };
        left.rounds[0].candidates[1].statistic = 19.5;
        assert_eq!(of(&left, [0.86, 0.1, 0.01]).0, named(EffectId::Delay));
        assert_eq!(
            of(&left, [0.84, 0.1, 0.02]),
            (Verdict::Unknown, vec![delay.clone(), lag.clone()])
        );
        left.rounds[0].taken = None;
        left.rounds.truncate(1);
        assert_eq!(of(&left, [0.86, 0.1, 0.01]), (named(EffectId::Delay), vec![]));
        assert_eq!(of(&left, [0.5, 0.3, 0.1]), (Verdict::Unknown, vec![delay, lag]));
    }

    #[test]
    fn bva_a_rival_stands_in_the_set_on_both_sides() {
        let set_of = |statistic: f64, likelihood: f64| {
            let mut evidence = evidence();
            evidence.rounds[0].candidates[1].statistic = statistic;
            evidence.rounds[0].candidates[1].likelihood = likelihood;
            decided(&evidence).set
        };
        let lag: Vec<EffectName> = vec![EffectId::FirstOrderLag.into()];
        assert_eq!(set_of(19.0, 190.0), lag);
        assert_eq!(set_of(17.5, 190.0), lag);
        assert!(set_of(16.5, 190.0).is_empty());
        assert_eq!(set_of(18.5, 170.0), lag);
        assert!(set_of(18.5, 150.0).is_empty());
        assert_eq!(set_of(19.8, 100.0), lag);
    }

    #[test]
    fn bva_significance_on_both_sides_of_each_threshold() {
        let strong = candidate(EffectId::Creep, 3.0, 0.5);
        let with = |change: fn(&mut Candidate)| {
            let mut changed = strong.clone();
            change(&mut changed);
            changed.significant(true, &Thresholds::DEFAULT)
        };
        assert!(with(|c| c.statistic = 2.1) && !with(|c| c.statistic = 1.9));
        assert!(with(|c| c.likelihood = 11.0) && !with(|c| c.likelihood = 9.0));
        assert!(with(|c| c.share = 0.11) && !with(|c| c.share = 0.09));
        assert!(with(|c| c.taken_percent = 0.11) && !with(|c| c.taken_percent = 0.09));
        assert!(with(|c| c.does_percent = Some(0.55)) && !with(|c| c.does_percent = Some(0.45)));
        assert!(!with(|c| c.against = Some(Against::Physics)) && !with(|c| c.against = Some(Against::OneSine)));
        assert!(!with(|c| c.against = Some(Against::Skew)));
        let next = |share: f64| candidate(EffectId::Creep, 3.0, share).significant(false, &Thresholds::DEFAULT);
        assert!(next(0.33) && !next(0.27));
    }

    #[test]
    fn bva_nothing_shape_and_unknown_on_both_sides() {
        let of = |before: f64, left: f64, lacks: f64| {
            let mut evidence = evidence();
            evidence.rounds = vec![Round::default()];
            evidence.before.identify_percent = Some(before);
            evidence.before.validate_percent = None;
            evidence.left_percent = left;
            evidence.shape = Bends {
                lacks_percent: Some(lacks),
                each: vec![
                    bend(EffectId::Asymmetry, 0.93, -5.0),
                    bend(EffectId::SensorNonlinearity, 0.87, -5.0),
                ],
                ..Bends::default()
            };
            decided(&evidence)
        };
        assert_eq!(of(0.27, 0.1, 0.0).verdict, Verdict::Nothing);
        assert_eq!(of(0.33, 0.1, 0.0).verdict, Verdict::Nothing);
        assert_eq!(of(2.0, 0.33, 0.0).verdict, Verdict::Unknown);
        assert_eq!(of(2.0, 0.27, 0.0).verdict, Verdict::Nothing);
        let shape = of(2.0, 0.1, 0.55);
        assert_eq!(shape.verdict, named(EffectId::HysteresisShape));
        assert_eq!(shape.set, vec![EffectName::from(EffectId::Asymmetry)]);
        assert_eq!(of(2.0, 0.1, 0.45).verdict, Verdict::Nothing);
    }

    /// Nothing but bends, and what minor loops say of a bent position.
    fn bent_by(lacks: f64, each: [Bend; 2], congruent: Option<f64>) -> Evidence {
        let errors = Before {
            identify_percent: Some(0.1),
            validate_percent: Some(0.1),
        };
        let mut evidence = evidence();
        evidence.rounds = vec![Round::default()];
        evidence.shape = Bends {
            lacks_percent: Some(2.0),
            fine_lacks_percent: lacks,
            free_percent: 0.1,
            each: each.into(),
            both: None,
            not_congruent: congruent.map(|statistic| Candidate {
                errors,
                ..candidate(EffectId::SensorNonlinearity, statistic, 0.5)
            }),
        };
        evidence
    }

    /// A bend of two numbers that foretells as the free shape does is more than a shape; each threshold on both sides.
    #[test]
    fn bva_bends_are_named_on_both_sides() {
        let of = |lacks, each, congruent| verdict(&bent_by(lacks, each, congruent));
        let voltage = |left_percent: f64, over_free: f64| Bend {
            left_percent,
            ..bend(EffectId::Asymmetry, 0.99, over_free)
        };
        let position = |share: f64, over_free: f64| bend(EffectId::SensorNonlinearity, share, over_free);
        let shape = named(EffectId::HysteresisShape);
        let asymmetry = named(EffectId::Asymmetry);
        let sensor = named(EffectId::SensorNonlinearity);
        let straight = |lacks, left, rival| of(lacks, [voltage(left, -1.0), position(0.95, rival)], None);
        assert_eq!(straight(1.0, 0.12, -9.0), asymmetry);
        assert_eq!(straight(1.0, 0.13, -9.0), shape);
        assert_eq!(straight(1.0, 0.12, -3.1), asymmetry);
        assert_eq!(straight(1.0, 0.12, -2.9), shape);
        assert_eq!(straight(0.27, 0.12, -9.0), asymmetry);
        assert_eq!(straight(0.23, 0.12, -9.0), shape);
        let shared = |share| {
            let of_voltage = Bend {
                left_percent: 0.12,
                ..bend(EffectId::Asymmetry, share, -1.0)
            };
            of(1.0, [of_voltage, position(0.95, -9.0)], None)
        };
        assert_eq!([shared(0.92), shared(0.88)], [asymmetry.clone(), shape.clone()]);
        // Of 0.2 % that the plays lack and 0.1 % that the free shape leaves, three fifths must be taken.
        let beside = |left_percent: f64| {
            let of_position = Bend {
                left_percent,
                ..position(0.95, 0.3)
            };
            of(0.2, [voltage(1.0, -9.0), of_position], None)
        };
        assert_eq!([beside(0.13), beside(0.15)], [sensor.clone(), shape.clone()]);
        let bent = |lacks, share, over| of(lacks, [voltage(1.0, -9.0), position(share, over)], None);
        assert_eq!(bent(1.0, 0.92, 0.3), sensor);
        assert_eq!(bent(1.0, 0.88, 0.3), shape);
        assert_eq!(bent(1.0, 0.92, 0.2), shape);
        assert_eq!(bent(0.11, 0.92, 0.3), sensor);
        assert_eq!(bent(0.09, 0.92, 0.3), shape);
        let minor = |share, statistic| of(1.0, [voltage(1.0, -9.0), position(share, -5.0)], Some(statistic));
        assert_eq!(minor(0.92, 1.3), sensor);
        assert_eq!(minor(0.92, 1.1), shape);
        assert_eq!(minor(0.88, 1.3), shape);
        let takes = |taken_percent: f64| {
            let mut evidence = bent_by(1.0, [voltage(1.0, -9.0), position(0.92, -5.0)], Some(1.3));
            if let Some(bend) = &mut evidence.shape.not_congruent {
                bend.taken_percent = taken_percent;
            }
            verdict(&evidence)
        };
        assert_eq!([takes(0.011), takes(0.009)], [sensor.clone(), shape.clone()]);
        // A bend of the voltage that foretells as the free shape does leaves no question to the minor loops.
        let told = [voltage(0.12, 1.0), position(0.96, -42.0)];
        assert_eq!(of(1.0, told, Some(1.3)), asymmetry);
    }

    /// A bend stands alone only where minor loops are its second witness.
    #[test]
    fn bva_a_bend_is_named_alone_with_a_second_witness_on_both_sides() {
        let of = |each, congruent| {
            let decision = decide(&bent_by(1.0, each, congruent), &Thresholds::DEFAULT);
            (decision.verdict, decision.set)
        };
        let shape: EffectName = EffectId::HysteresisShape.into();
        let position = || bend(EffectId::SensorNonlinearity, 0.95, 0.3);
        let poor = || bend(EffectId::Asymmetry, 0.5, -9.0);
        let sensor = named(EffectId::SensorNonlinearity);
        assert_eq!(of([poor(), position()], Some(1.3)), (sensor.clone(), vec![]));
        assert_eq!(
            of([poor(), position()], Some(1.1)),
            (sensor.clone(), vec![shape.clone()])
        );
        assert_eq!(of([poor(), position()], None), (sensor, vec![shape.clone()]));
        let equal = || bend(EffectId::Asymmetry, 0.91, -9.0);
        let asymmetry = vec![EffectId::Asymmetry.into()];
        assert_eq!(
            of([equal(), position()], Some(1.3)),
            (named(EffectId::SensorNonlinearity), asymmetry)
        );
        let voltage = bend(EffectId::Asymmetry, 0.99, 0.5);
        let as_good = bend(EffectId::SensorNonlinearity, 0.91, -9.0);
        let both = vec![shape, EffectId::SensorNonlinearity.into()];
        assert_eq!(of([voltage, as_good], None), (named(EffectId::Asymmetry), both));
    }

    /// One sine does not tell a slew limit: what it explains better than a creep does is no creep.
    #[test]
    fn bva_one_sine_names_nothing_behind_a_better_rival_on_both_sides() {
        let of = |statistic: f64, against: Option<Against>| {
            let mut evidence = evidence();
            let rival = candidate(EffectId::SlewLimit, statistic, 0.9);
            evidence.rounds[0].candidates =
                vec![candidate(EffectId::Creep, 10.0, 0.98), Candidate { against, ..rival }];
            evidence.rounds[0].taken = Some(EffectId::Creep.into());
            let decision = decided(&evidence);
            (decision.verdict, decision.set)
        };
        let both: Vec<EffectName> = vec![EffectId::Creep.into(), EffectId::SlewLimit.into()];
        assert_eq!(of(9.9, Some(Against::OneSine)), (named(EffectId::Creep), vec![]));
        assert_eq!(of(10.1, Some(Against::OneSine)), (Verdict::Unknown, both));
        assert_eq!(of(10.1, Some(Against::Physics)), (named(EffectId::Creep), vec![]));
    }

    #[test]
    fn bva_sines_of_one_amplitude_leave_a_set_on_both_sides() {
        let set_of = |one_amplitude: bool, statistic: f64| {
            let mut evidence = Evidence {
                one_amplitude,
                ..evidence()
            };
            evidence.rounds[0].candidates[1].statistic = statistic;
            decided(&evidence).set
        };
        let lag = vec![EffectName::from(EffectId::FirstOrderLag)];
        assert_eq!([set_of(true, 2.1), set_of(true, 1.9)], [lag, vec![]]);
        assert!(set_of(false, 2.1).is_empty());
    }

    #[test]
    fn bva_a_coarse_chain_has_a_wider_set_on_both_sides() {
        let set_of = |determined: bool, left_percent: f64, statistic: f64| {
            let mut evidence = evidence();
            (evidence.shape_determined, evidence.left_percent) = (determined, left_percent);
            evidence.rounds[0].candidates[1].statistic = statistic;
            evidence.rounds[0].candidates[1].likelihood = 15.0;
            decided(&evidence).set.len()
        };
        assert_eq!([set_of(true, 1.1, 13.0), set_of(true, 1.3, 13.0)], [0, 1]);
        assert_eq!([set_of(false, 0.1, 13.0), set_of(false, 0.1, 11.0)], [1, 0]);
    }

    /// What the model's family has already is no missing effect, and what follows it is judged as a first one.
    #[test]
    fn val_what_the_family_has_is_not_missing() {
        let mut evidence = evidence();
        evidence.rounds[0].of_family = true;
        assert_ne!(verdict(&evidence), named(EffectId::Delay));
    }

    #[test]
    fn val_a_dead_band_is_named_whatever_else_remains() {
        let mut evidence = evidence();
        evidence.rounds.clear();
        evidence.left_percent = 3.0;
        let dead_band = candidate(EffectId::Backlash, 1.0, 0.9).entry(Level::Physical, true, &Thresholds::DEFAULT);
        evidence.seen = Seen {
            dead_band: Some(dead_band),
            ..Seen::default()
        };
        assert_eq!(verdict(&evidence), named(EffectId::Backlash));
    }
}
