//! The evidence behind a verdict: numbers only.

use crate::diagnosis::{Before, EffectParameter, Level, RankedEffect, Reason, WhereItFails};
use crate::rules::{RuleId, Thresholds};
use hysteron_acquisition::Kind;
use hysteron_identify::EffectName;
use hysteron_identify::search::{Search, Trial};
use serde::{Deserialize, Serialize};

/// Coarseness that a hysteresis of free shape leaves where nothing is missing, share of the stroke (0.02 to 0.08 % on Preisach
/// densities, 0.1 % behind rates): a fall below it proves nothing.
const COARSENESS: f64 = 1e-3;

/// What speaks against a candidate, whatever it explains.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Against {
    /// Its numbers are not physical, or the records contradict it.
    Physics,
    /// One sine is all that was played, and does not tell it.
    OneSine,
    /// Voltage and position were not taken at one time, which hides it.
    Skew,
}

/// What a candidate does to the errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Which effect.
    pub effect: EffectName,
    /// Sum over parts of the logarithm of the squared error's fall, each foretold from the others.
    pub statistic: f64,
    /// Gain in predictive log-likelihood, nats.
    pub likelihood: f64,
    /// Independent samples behind it.
    pub independent: f64,
    /// What it takes of the excess squared error, 0 to 1.
    pub share: f64,
    /// The error that it takes, percent of peak to peak: the least of held-out and fitted.
    pub taken_percent: f64,
    /// What it does to the modelled position, percent of peak to peak; `None` where nobody asked.
    pub does_percent: Option<f64>,
    /// Errors with it.
    pub errors: Before,
    /// What speaks against it.
    pub against: Option<Against>,
    /// Whether a parameter stands on its physical bound.
    pub on_bound: bool,
    /// Its parameters.
    pub parameters: Vec<EffectParameter>,
}

/// One round of candidates on a chain as it stood.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// All that were tried, best first.
    pub candidates: Vec<Candidate>,
    /// The one that the chain went on with.
    pub taken: Option<EffectName>,
    /// Whether the given model has it in its hysteresis.
    pub of_family: bool,
}

/// A bend of the voltage or of the position, beside plays of the model's kind that are as many as the free shape's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bend {
    /// Its numbers against these plays without it; the share is that of what they lack of the free shape.
    pub candidate: Candidate,
    /// Error that is left with it, percent.
    pub left_percent: f64,
    /// Fall of the logarithms of the held-out squared errors from the free shape's to those with it: above 0 it foretells better.
    pub over_free: f64,
}

/// What plays of the model's kind lack of the free shape, and what bends make of it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Bends {
    /// Error of the model's own plays above the free shape's, both with what was found, percent; `None` where the model has that shape.
    pub lacks_percent: Option<f64>,
    /// The same of as many plays as the free shape has.
    pub fine_lacks_percent: f64,
    /// Error that the free shape leaves, percent.
    pub free_percent: f64,
    /// Each bend beside those, the one that takes most first.
    pub each: Vec<Bend>,
    /// The bend of the position beside that of the voltage.
    pub both: Option<Bend>,
    /// The bend of the position behind the free shape, against that shape under either ridge.
    pub not_congruent: Option<Candidate>,
}

/// What is seen without a hysteresis model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// A dead band after every reversal.
    pub dead_band: Option<RankedEffect>,
    /// A ring after a step.
    pub ring: Option<RankedEffect>,
}

/// All numbers of a diagnosis.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Why the records cannot answer at all.
    pub reasons: Vec<Reason>,
    /// Errors of the given model.
    pub before: Before,
    /// Errors of the free shape before anything is added.
    pub base: Before,
    /// Whether all that was fitted are sines of one amplitude.
    pub one_amplitude: bool,
    /// Whether the records determine the free shape; otherwise straight plays stand in for it.
    pub shape_determined: bool,
    /// Excess squared error of that over noise and coarseness, relative to the strokes.
    pub base_excess: f64,
    /// The same with everything that was found.
    pub left_excess: f64,
    /// Error that is left with everything that was found, percent.
    pub left_percent: f64,
    /// Of that, noise.
    pub noise_percent: f64,
    /// Whether what is left goes on from sample to sample, or comes in outliers.
    pub more_than_noise: bool,
    /// The rounds.
    pub rounds: Vec<Round>,
    /// The shape.
    pub shape: Bends,
    /// What needs no model.
    pub seen: Seen,
    /// What was found of converters, clocks and cables.
    pub rig: Vec<Kind>,
    /// Where the given model fails.
    pub fails: WhereItFails,
    /// Where the free shape fails before anything is added.
    pub free_fails: WhereItFails,
}

impl Evidence {
    /// The share of the excess that everything found explains together; 1 where there is none.
    pub(crate) fn explained(&self) -> f64 {
        if self.base_excess > 0.0 {
            1.0 - self.left_excess / self.base_excess
        } else {
            1.0
        }
    }
}

/// Compares trials of one search.
#[derive(Debug, Clone)]
pub(crate) struct Scale {
    floor_um2: f64,
    stroke_um: Vec<f64>,
}

impl Scale {
    pub(crate) fn of(search: &Search<'_>) -> Self {
        let stroke_um = search.strokes_um();
        let largest_um = stroke_um.iter().copied().fold(0.0, f64::max);
        Self {
            floor_um2: search.noise_um().powi(2) + (COARSENESS * largest_um).powi(2),
            stroke_um,
        }
    }

    /// The noise of the records that move, percent of peak to peak.
    pub(crate) fn noise_percent(&self, noise_um: f64) -> f64 {
        let strokes: Vec<f64> = self.stroke_um.iter().copied().filter(|stroke| *stroke > 0.0).collect();
        let noise = |stroke: &f64| (100.0 * noise_um / stroke).powi(2);
        (strokes.iter().map(noise).sum::<f64>() / strokes.len().max(1) as f64).sqrt()
    }

    /// Fall of the logarithms of the parts' held-out squared errors, from one trial to another.
    pub(crate) fn fall(&self, from: &Trial, to: &Trial) -> f64 {
        let pairs = from.parts.iter().zip(&to.parts);
        pairs
            .map(|(a, b)| ((self.floor_um2 + a.held_out_um2) / (self.floor_um2 + b.held_out_um2)).ln())
            .sum()
    }

    fn likelihood(&self, from: &Trial, to: &Trial) -> f64 {
        let pairs = from.parts.iter().zip(&to.parts);
        pairs
            .map(|(a, b)| {
                let fall = ((self.floor_um2 + a.held_out_um2) / (self.floor_um2 + b.held_out_um2)).ln();
                0.5 * b.independent * fall
            })
            .sum()
    }

    /// Mean over the parts that move of the squared error above the floor, relative to the stroke.
    pub(crate) fn excess(&self, trial: &Trial) -> f64 {
        let mut sum = 0.0;
        let mut count = 0.0_f64;
        for part in &trial.parts {
            let stroke = self.stroke_um[part.record];
            if stroke > 0.0 {
                sum += (part.held_out_um2 - self.floor_um2).max(0.0) / stroke.powi(2);
                count += 1.0;
            }
        }
        sum / count.max(1.0)
    }

    /// A candidate's numbers against the chain without it.
    pub(crate) fn candidate(
        &self,
        search: &Search<'_>,
        effect: &EffectName,
        (without, with): (&Trial, &Trial),
        against: Option<Against>,
    ) -> Candidate {
        let (was, is) = (self.excess(without), self.excess(with));
        let pooled = |trial: &Trial| search.pooled_percent(trial).powi(2);
        let fallen_percent = (pooled(without) - pooled(with)).max(0.0).sqrt();
        let held_out_percent = 100.0 * (was - is).max(0.0).sqrt();
        let parameters = search.parameters_of(with, effect).into_iter().map(|p| EffectParameter {
            name: p.name,
            value: p.value,
            unit: p.unit,
        });
        Candidate {
            effect: effect.clone(),
            statistic: self.fall(without, with),
            likelihood: self.likelihood(without, with),
            independent: with.parts.iter().map(|part| part.independent).sum(),
            share: if was > 0.0 { 1.0 - is / was } else { 0.0 },
            taken_percent: fallen_percent.min(held_out_percent),
            does_percent: None,
            errors: errors(search, with),
            against,
            on_bound: !with.on_bound(effect).is_empty(),
            parameters: parameters.collect(),
        }
    }
}

/// Errors of a trial.
pub(crate) fn errors(search: &Search<'_>, trial: &Trial) -> Before {
    Before {
        identify_percent: search.percent(trial, true),
        validate_percent: search.percent(trial, false),
    }
}

impl Candidate {
    /// Whether it is significant, large enough to matter, and physical.
    pub fn significant(&self, first: bool, thresholds: &Thresholds) -> bool {
        let share = if first { RuleId::FirstShare } else { RuleId::NextShare };
        self.statistic > thresholds.of(RuleId::Statistic)
            && self.likelihood > thresholds.of(RuleId::Likelihood)
            && self.share > thresholds.of(share)
            && self.taken_percent > thresholds.of(RuleId::TakenPercent)
            && self
                .does_percent
                .is_none_or(|does| self.taken_percent < thresholds.of(RuleId::TakenOverDone) * does)
            && self.against.is_none()
    }

    /// As an entry of the ranking.
    pub(crate) fn entry(&self, level: Level, significant: bool, thresholds: &Thresholds) -> RankedEffect {
        RankedEffect {
            effect: self.effect.clone(),
            errors: self.errors,
            statistic: self.statistic,
            threshold: thresholds.of(RuleId::Statistic),
            log_likelihood_gain: self.likelihood,
            effective_samples: self.independent,
            share: self.share,
            significant,
            level,
            on_bound: self.on_bound,
            parameters: self.parameters.clone(),
        }
    }
}
