//! How likely each candidate of the first round is what is missing: a conditional logit over the candidates and the alternative that
//! nothing of the catalogue is.
//!
//! Each alternative has a score, the sum of its [`Term`]s times their [weights](WEIGHTS); its probability is the share of its
//! exponential (McFadden, "Conditional logit analysis of qualitative choice behavior", 1974, eq. 12). The weights are fitted to stages
//! whose hidden effect is known, by `cargo xtask calibrate odds`, and hold on others.

mod terms;
mod weights;

pub use terms::{Alternative, TERMS, Term, alternatives};
pub use weights::WEIGHTS;

use crate::evidence::Evidence;
use hysteron_identify::EffectName;
use serde::{Deserialize, Serialize};

/// One candidate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Likely {
    /// Which effect.
    pub effect: EffectName,
    /// That it is what is missing, 0 to 1.
    pub probability: f64,
}

/// The probabilities of one diagnosis. They add up to one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Odds {
    /// The candidates, likeliest first.
    pub each: Vec<Likely>,
    /// That it is none of them, 0 to 1.
    pub none: f64,
}

impl Default for Odds {
    fn default() -> Self {
        Self {
            each: Vec::new(),
            none: 1.0,
        }
    }
}

impl Odds {
    /// Of the candidates of the first round that the model's family does not have already; none without such a round.
    pub fn of(evidence: &Evidence) -> Self {
        Self::under(alternatives(evidence), &WEIGHTS)
    }

    /// Of these alternatives under these weights.
    pub fn under(alternatives: Vec<Alternative>, weights: &[f64; TERMS]) -> Self {
        let shares = shares(&alternatives, weights);
        let mut odds = Self::default();
        for (alternative, probability) in alternatives.into_iter().zip(shares) {
            match alternative.effect {
                Some(effect) => odds.each.push(Likely { effect, probability }),
                None => odds.none = probability,
            }
        }
        odds.each.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        odds
    }

    /// The probability of an effect; 0 where it was no candidate.
    pub fn probability(&self, effect: &EffectName) -> f64 {
        let own = self.each.iter().find(|likely| likely.effect == *effect);
        own.map_or(0.0, |likely| likely.probability)
    }

    /// The fewest candidates that hold this share of what all of them have together, likeliest first.
    pub fn set(&self, share: f64) -> Vec<EffectName> {
        let all: f64 = self.each.iter().map(|likely| likely.probability).sum();
        let mut held = 0.0;
        let open = |likely: &&Likely| {
            let open = held < share * all;
            held += likely.probability;
            open
        };
        self.each
            .iter()
            .take_while(open)
            .map(|likely| likely.effect.clone())
            .collect()
    }
}

/// The probability of each alternative.
pub fn shares(alternatives: &[Alternative], weights: &[f64; TERMS]) -> Vec<f64> {
    let score = |alternative: &Alternative| -> f64 { alternative.values.iter().zip(weights).map(|(v, w)| v * w).sum() };
    let scores: Vec<f64> = alternatives.iter().map(score).collect();
    let largest = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let each: Vec<f64> = scores.iter().map(|score| (score - largest).exp()).collect();
    let all: f64 = each.iter().sum();
    each.into_iter().map(|one| one / all).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::{Before, Lock, LockTo, WhereItFails};
    use crate::evidence::{Against, Candidate, Round};
    use hysteron_acquisition::Kind;
    use hysteron_identify::EffectId;

    fn candidate(effect: EffectId, statistic: f64, left_percent: f64) -> Candidate {
        Candidate {
            effect: effect.into(),
            statistic,
            likelihood: 100.0 * statistic,
            independent: 1000.0,
            share: 0.9,
            taken_percent: 1.0,
            does_percent: None,
            errors: Before {
                identify_percent: Some(left_percent),
                validate_percent: Some(left_percent),
            },
            against: None,
            on_bound: false,
            parameters: Vec::new(),
        }
    }

    fn evidence(candidates: Vec<Candidate>) -> Evidence {
        let errors = Before {
            identify_percent: Some(2.0),
            validate_percent: Some(2.0),
        };
        Evidence {
            before: errors,
            base: errors,
            noise_percent: 0.05,
            shape_determined: true,
            rounds: vec![Round {
                candidates,
                ..Round::default()
            }],
            ..Evidence::default()
        }
    }

    #[test]
    fn val_probabilities_add_up_to_one_and_follow_the_lead() {
        let delay = EffectId::Delay.into();
        let of = |delay: f64, lag: f64| {
            let candidates = vec![
                candidate(EffectId::Delay, delay, 4.0 / delay),
                candidate(EffectId::FirstOrderLag, lag, 4.0 / lag),
            ];
            Odds::of(&evidence(candidates))
        };
        let ahead = of(20.0, 12.0);
        let all: f64 = ahead.each.iter().map(|likely| likely.probability).sum();
        assert!((all + ahead.none - 1.0).abs() < 1e-12, "{ahead:?}");
        assert!(ahead.probability(&delay) > 0.5, "{ahead:?}");
        assert!(of(12.0, 20.0).probability(&delay) < 0.5);
        assert_eq!(Odds::of(&Evidence::default()), Odds::default());
    }

    /// An error that goes with the temperature speaks for a drift, beside a creep that takes as much.
    #[test]
    fn val_what_the_error_goes_with_speaks_for_its_effect() {
        let drift = EffectId::ThermalDrift.into();
        let of = |locked_to: Vec<Lock>| {
            let mut evidence = evidence(vec![
                candidate(EffectId::Creep, 9.0, 0.5),
                candidate(EffectId::ThermalDrift, 9.0, 0.5),
            ]);
            evidence.fails = WhereItFails {
                locked_to,
                ..WhereItFails::default()
            };
            Odds::of(&evidence).probability(&drift)
        };
        assert!(of(vec![Lock::new(LockTo::Temperature, 0.95)]) > 1.5 * of(Vec::new()));
    }

    /// Like records whose gain follows their order speak for a drift, though no temperature was recorded.
    #[test]
    fn val_a_gain_in_the_order_of_the_records_speaks_for_a_drift() {
        let of = |share: f64, rig: Vec<Kind>| {
            let mut evidence = evidence(vec![
                candidate(EffectId::Delay, 0.0, 2.0),
                candidate(EffectId::ThermalDrift, 0.0, 2.0),
            ]);
            evidence.fails.locked_to = vec![Lock::new(LockTo::RecordOrder, share)];
            evidence.rig = rig;
            Odds::of(&evidence).probability(&EffectId::ThermalDrift.into())
        };
        assert!(of(0.95, vec![Kind::GainByRecord]) > 0.5);
        assert!(of(0.95, Vec::new()) < 0.1 && of(0.05, vec![Kind::GainByRecord]) < 0.1);
    }

    /// One loop of any shape bends as a limited slew does: the lag comes before it.
    #[test]
    fn val_one_sine_does_not_speak_for_a_limited_slew() {
        let of = |against: Option<Against>| {
            let each = [(EffectId::SlewLimit, 9.0), (EffectId::FirstOrderLag, 8.0)];
            let each = each.map(|(effect, statistic)| Candidate {
                against,
                ..candidate(effect, statistic, 0.5)
            });
            let odds = Odds::of(&evidence(each.to_vec()));
            [EffectId::SlewLimit, EffectId::FirstOrderLag].map(|effect| odds.probability(&effect.into()))
        };
        let ([slew, lag], [own_slew, own_lag]) = (of(Some(Against::OneSine)), of(None));
        assert!(
            slew < 0.1 * lag && own_slew > own_lag,
            "{slew} {lag} {own_slew} {own_lag}"
        );
    }

    #[test]
    fn bva_a_set_holds_its_share_on_both_sides() {
        let each = [
            (EffectId::Creep, 0.5),
            (EffectId::Delay, 0.3),
            (EffectId::MainsHum, 0.1),
        ];
        let odds = Odds {
            each: each
                .map(|(effect, probability)| Likely {
                    effect: effect.into(),
                    probability,
                })
                .to_vec(),
            none: 0.1,
        };
        let sizes = [0.55, 0.56, 0.88, 0.89].map(|share| odds.set(share).len());
        assert_eq!(sizes, [1, 2, 2, 3]);
    }
}
