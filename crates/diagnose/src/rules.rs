//! The rules that turn evidence into a verdict: each with its threshold, its reason, and what set it.
//!
//! A threshold is found here by its [`RuleId`] and nowhere else, so that all of them can be moved together.

use serde::{Deserialize, Serialize};

/// A rule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RuleId {
    /// Least fall of the logarithms of the parts' squared errors, each foretold from the others.
    Statistic,
    /// Least gain in predictive log-likelihood, nats.
    Likelihood,
    /// Least share of the squared error that a first effect takes.
    FirstShare,
    /// Least share that an effect takes of what another one leaves.
    NextShare,
    /// Least error that an effect takes, percent of peak to peak.
    TakenPercent,
    /// Most that an effect takes, as a multiple of what it does to the modelled position.
    TakenOverDone,
    /// Error below which nothing is looked into, percent of peak to peak.
    MattersPercent,
    /// Least share of the excess error that the named effects must explain together.
    ExplainedShare,
    /// The same where much is left.
    LargeExplainedShare,
    /// Error that is much, percent of peak to peak.
    MuchLeftPercent,
    /// An effect that takes less than the main part is named with the rest unexplained from this statistic on.
    PartStatistic,
    /// ... and this share.
    PartShare,
    /// ... and so many times the statistic of the next effect.
    PartLead,
    /// Least probability of a name that stands alone.
    NameProbability,
    /// Probability from which a name stands alone whatever else is left.
    CertainProbability,
    /// Candidates stand in a set until they hold this share of the probability of all.
    SetProbability,
    /// A name does not stand alone beside a candidate with this share of its statistic.
    SetStatistic,
    /// ... and this share of its likelihood.
    SetLikelihood,
    /// The same alone where much is left, or the records do not determine the loops.
    CoarseSetStatistic,
    /// Candidates that are closer than this in the statistic are ranked by likelihood.
    Undecided,
    /// The model's own plays lack the shape from this error above the free shape's on, percent.
    ShapeLacksPercent,
    /// Share of what straight plays lack that a bend must take to stand beside the shape.
    EquivalentShare,
    /// Fine plays must lack so much of the free shape for a bend of the voltage, percent.
    BendLacksPercent,
    /// The same for a bend of the position, percent.
    PositionLacksPercent,
    /// With a bend of the voltage at most so many times the free shape's error is left.
    AsFree,
    /// Statistic of a bend of the position beside the free shape from which minor loops are not congruent.
    NotCongruent,
    /// Least that the bend then takes of what the free shape leaves, percent of peak to peak.
    NotCongruentPercent,
    /// Most that may then be left, percent.
    CongruentLeftPercent,
    /// A free shape that foretells worse than straight plays by this fall of logarithms is not determined.
    Undetermined,
    /// The stroke must be so many times the noise.
    StrokeOverNoise,
    /// Share of samples that stand on an extreme from which records are clipped.
    ClippedShare,
}

/// A rule with its threshold and where it comes from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rule {
    /// Which.
    pub id: RuleId,
    /// Its threshold.
    pub threshold: f64,
    /// Why there is one.
    pub reason: &'static str,
}

const fn rule(id: RuleId, threshold: f64, reason: &'static str) -> Rule {
    Rule { id, threshold, reason }
}

/// All rules.
pub const RULES: [Rule; 31] = [
    rule(RuleId::Statistic, 2.0, "two parts whose squared error falls to a third"),
    rule(
        RuleId::Likelihood,
        10.0,
        "odds of 1 to 20 000 against chance, among some 40 starts tried",
    ),
    rule(RuleId::FirstShare, 0.1, "a first effect may be one of several"),
    rule(
        RuleId::NextShare,
        0.3,
        "what comes on top of another must be a good part of what is left",
    ),
    rule(
        RuleId::TakenPercent,
        0.1,
        "an effect of 0.3 % leaves 0.1 after its best mimic has absorbed what it can",
    ),
    rule(
        RuleId::TakenOverDone,
        2.0,
        "an effect takes no more than it does; beyond that it is the refit of all else that takes it",
    ),
    rule(
        RuleId::MattersPercent,
        0.3,
        "the weakest effects that are looked for add 0.3 %",
    ),
    rule(RuleId::ExplainedShare, 0.6, "less leaves the main thing unnamed"),
    rule(
        RuleId::LargeExplainedShare,
        0.8,
        "an error above a medium effect hides another one as large",
    ),
    rule(RuleId::MuchLeftPercent, 1.2, "a medium effect adds 1 to 2 %"),
    rule(
        RuleId::PartStatistic,
        4.0,
        "a name beside an unexplained rest needs twice the evidence",
    ),
    rule(RuleId::PartShare, 0.25, "a part smaller than a quarter is no main part"),
    rule(RuleId::PartLead, 1.15, "where much is unexplained a mimic comes close"),
    rule(
        RuleId::NameProbability,
        0.6,
        "names that are less likely are right about as often as wrong",
    ),
    rule(
        RuleId::CertainProbability,
        0.85,
        "of 600 cases six more names are right at 0.8 and two more wrong; at 0.9 one less is right",
    ),
    rule(
        RuleId::SetProbability,
        0.8,
        "sets of nineteen twentieths hold what is there in 95 instead of 90 of 100, with 4.4 instead of 2.8 members",
    ),
    rule(RuleId::SetStatistic, 0.85, "rivals as good as this are not told apart"),
    rule(
        RuleId::SetLikelihood,
        0.8,
        "rivals as likely as this are not told apart",
    ),
    rule(
        RuleId::CoarseSetStatistic,
        0.6,
        "a rate dependence of another law leaves 0.63 of the statistic of the delay that imitates it",
    ),
    rule(RuleId::Undecided, 0.25, "one part's squared error by a factor of 1.3"),
    rule(
        RuleId::ShapeLacksPercent,
        0.5,
        "ten plays leave 0.24 to 0.97 % on stages in which nothing is missing",
    ),
    rule(
        RuleId::EquivalentShare,
        0.9,
        "a bend that takes nine tenths explains the loops as well as the shape",
    ),
    rule(
        RuleId::BendLacksPercent,
        0.25,
        "plays that lack less without a bend have none of the voltage",
    ),
    rule(
        RuleId::PositionLacksPercent,
        0.1,
        "more than the coarseness of as many plays",
    ),
    rule(
        RuleId::AsFree,
        1.25,
        "stages in which nothing is hidden stay 1.4 times above the free shape",
    ),
    rule(
        RuleId::NotCongruent,
        1.2,
        "of 21 stages with nothing hidden none reaches 1.1, of others one 1.5; of 20 sensors that bend by 1 % and more 14 lie above 1.25",
    ),
    rule(
        RuleId::NotCongruentPercent,
        0.01,
        "the one with nothing hidden above 1.2 takes 0.003 %, sensors that bend take 0.013 % and more",
    ),
    rule(
        RuleId::CongruentLeftPercent,
        0.2,
        "stages outside the play class keep 0.65 % and more: their minor loops are not congruent for another reason",
    ),
    rule(RuleId::Undetermined, 2.0, "the same evidence that an effect needs"),
    rule(
        RuleId::StrokeOverNoise,
        30.0,
        "below it the noise hides a medium effect in every single sample",
    ),
    rule(
        RuleId::ClippedShare,
        0.05,
        "a sine stands on its extremes for a hundredth of its samples",
    ),
];

/// Errors below this share of peak to peak, percent, are not looked into.
pub(crate) const MATTERS_PERCENT: f64 = Thresholds::DEFAULT.of(RuleId::MattersPercent);

/// The thresholds, movable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds([f64; RULES.len()]);

impl Thresholds {
    /// Those of the table.
    pub const DEFAULT: Self = {
        let mut all = [0.0; RULES.len()];
        let mut i = 0;
        while i < RULES.len() {
            all[RULES[i].id as usize] = RULES[i].threshold;
            i += 1;
        }
        Self(all)
    };

    /// The threshold of a rule.
    pub const fn of(&self, id: RuleId) -> f64 {
        self.0[id as usize]
    }

    /// With one of them at a value.
    #[must_use]
    pub fn with(mut self, id: RuleId, threshold: f64) -> Self {
        self.0[id as usize] = threshold;
        self
    }

    /// With one of them times a factor.
    #[must_use]
    pub fn moved(self, id: RuleId, factor: f64) -> Self {
        self.with(id, factor * self.of(id))
    }
}

impl Default for Thresholds {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_each_rule_stands_once_in_the_table() {
        for (i, rule) in RULES.iter().enumerate() {
            assert_eq!(rule.id as usize, i, "{rule:?}");
            assert!(rule.threshold > 0.0 && !rule.reason.is_empty());
        }
    }
}
