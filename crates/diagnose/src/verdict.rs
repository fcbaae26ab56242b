//! From evidence to a verdict, by the rules' table.

use crate::diagnosis::{Level, RankedEffect, Verdict};
use crate::evidence::{Candidate, Evidence, Round};
use crate::rules::{RuleId, Thresholds};
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
    if let Some(first) = named.first().cloned() {
        let round = found.first().filter(|round| round.taken.as_ref() == Some(&first));
        let candidate = round.and_then(|round| round.candidates.iter().find(|c| c.effect == first));
        let by_witness = candidate.is_none();
        let stands = by_witness
            || explains_enough(evidence, thresholds)
            || evidence.seen.drifts_alike && first == EffectId::ThermalDrift
            || candidate
                .zip(round)
                .is_some_and(|(c, round)| is_a_part(c, round, thresholds));
        decision.set = round.map_or_else(Vec::new, |round| set(round, thresholds));
        if stands {
            decision.share = candidate.map(|c| c.share);
            decision.set.retain(|name| *name != first);
            decision.further = named.split_off(1);
            decision.verdict = Verdict::Effect(first);
        }
        return decision;
    }
    if let Some(round) = evidence.rounds.iter().rev().find(|r| r.taken.is_none()) {
        decision.set = set(round, thresholds);
    }
    let matters = thresholds.of(RuleId::MattersPercent);
    let unexplained = evidence.left_percent > matters
        && (evidence.left_percent > 2.0 * evidence.noise_percent || evidence.more_than_noise);
    decision.verdict = if !evidence.before.exceeds(matters) {
        Verdict::Nothing
    } else if unexplained {
        Verdict::Unknown
    } else if shape_too_poor {
        decision.set = bends(evidence, thresholds);
        Verdict::Effect(EffectId::HysteresisShape.into())
    } else {
        Verdict::Nothing
    };
    if decision.verdict == Verdict::Nothing {
        decision.set.clear();
    }
    decision
}

/// Whether what was found takes most of the excess, and so much that no larger thing than itself can be left.
fn explains_enough(evidence: &Evidence, thresholds: &Thresholds) -> bool {
    let share = if evidence.base_excess > 0.0 {
        1.0 - evidence.left_excess / evidence.base_excess
    } else {
        1.0
    };
    let much = evidence.left_percent > thresholds.of(RuleId::MuchLeftPercent);
    let least = if much {
        RuleId::LargeExplainedShare
    } else {
        RuleId::ExplainedShare
    };
    share > thresholds.of(least)
}

/// Whether a candidate is certain enough to be named beside an unexplained rest.
fn is_a_part(candidate: &Candidate, round: &Round, thresholds: &Thresholds) -> bool {
    let rivals = round
        .candidates
        .iter()
        .filter(|c| c.effect != candidate.effect && !c.implausible);
    let next = rivals.map(|c| c.statistic).fold(0.0, f64::max);
    candidate.statistic > thresholds.of(RuleId::PartStatistic)
        && candidate.share > thresholds.of(RuleId::PartShare)
        && candidate.statistic > thresholds.of(RuleId::PartLead) * next
}

/// The candidates of a round that cannot be told from its best one, that one first.
pub(crate) fn set(round: &Round, thresholds: &Thresholds) -> Vec<EffectName> {
    let significant = |c: &&Candidate| c.significant(true, thresholds);
    let Some(best) = round.candidates.iter().find(significant) else {
        return Vec::new();
    };
    let close = |c: &&Candidate| {
        (best.statistic - c.statistic).abs() < thresholds.of(RuleId::Undecided)
            || c.statistic > thresholds.of(RuleId::SetStatistic) * best.statistic
                && c.likelihood > thresholds.of(RuleId::SetLikelihood) * best.likelihood
    };
    let all = round.candidates.iter().filter(significant).filter(close);
    all.map(|c| c.effect.clone()).collect()
}

/// Bends that explain what straight plays lack as well as the free shape does.
fn bends(evidence: &Evidence, thresholds: &Thresholds) -> Vec<EffectName> {
    let as_good = |c: &&Candidate| c.share > thresholds.of(RuleId::EquivalentShare);
    evidence
        .shape
        .bends
        .iter()
        .filter(as_good)
        .map(|c| c.effect.clone())
        .collect()
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
    for bend in &evidence.shape.bends {
        if !entries
            .iter()
            .any(|entry| entry.effect == bend.effect && entry.significant)
        {
            entries.retain(|entry| entry.effect != bend.effect);
            entries.push(bend.entry(Level::Shape, false, thresholds));
        }
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::{Before, Reason};
    use crate::evidence::{Seen, ShapeEvidence};

    fn candidate(effect: EffectId, statistic: f64, share: f64) -> Candidate {
        Candidate {
            effect: effect.into(),
            statistic,
            likelihood: 10.0 * statistic,
            independent: 1000.0,
            share,
            taken_percent: 1.0,
            errors: Before::default(),
            implausible: false,
            on_bound: false,
            parameters: Vec::new(),
        }
    }

    /// A delay that explains nearly everything, a lag behind it.
    fn evidence() -> Evidence {
        Evidence {
            before: Before {
                identify_percent: Some(2.0),
                validate_percent: Some(2.0),
            },
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

    fn verdict(evidence: &Evidence) -> Verdict {
        decide(evidence, &Thresholds::DEFAULT).verdict
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

    #[test]
    fn bva_a_rival_stands_in_the_set_on_both_sides() {
        let set_of = |statistic: f64, likelihood: f64| {
            let mut evidence = evidence();
            evidence.rounds[0].candidates[1].statistic = statistic;
            evidence.rounds[0].candidates[1].likelihood = likelihood;
            decide(&evidence, &Thresholds::DEFAULT).set
        };
        let lag: Vec<EffectName> = vec![EffectId::FirstOrderLag.into()];
        assert_eq!(set_of(19.0, 190.0), lag);
        assert!(set_of(17.0, 190.0).is_empty());
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
        assert!(!with(|c| c.implausible = true));
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
            evidence.shape = ShapeEvidence {
                lacks_percent: Some(lacks),
                bends: vec![
                    candidate(EffectId::Asymmetry, 1.0, 0.93),
                    candidate(EffectId::SensorNonlinearity, 1.0, 0.87),
                ],
            };
            decide(&evidence, &Thresholds::DEFAULT)
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
