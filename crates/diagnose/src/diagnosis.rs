//! What a diagnosis says, in numbers and names.

use hysteron_acquisition::NoiseFloor;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// How an effect is told from the shape of the loops.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// Survives a hysteresis of free shape.
    Physical,
    /// Seen only against the fixed family of plays; a richer shape explains it as well.
    Shape,
}

/// A fitted parameter of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectParameter {
    /// Name in the field's terms.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit; empty for a pure number.
    pub unit: String,
}

/// One candidate, fitted in its place jointly with the rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RankedEffect {
    /// Name.
    pub effect: String,
    /// Error with it, percent of peak to peak, on the records it was fitted to.
    pub identify_percent: f64,
    /// The same on the validation records.
    pub validate_percent: f64,
    /// Sum over records of the logarithm of the squared error's fall, each record predicted from the others.
    pub statistic: f64,
    /// What the statistic must exceed.
    pub threshold: f64,
    /// Gain in predictive log-likelihood, nats, with as many samples as are independent.
    pub log_likelihood_gain: f64,
    /// Independent samples behind it.
    pub effective_samples: f64,
    /// What it takes away of the squared error, 0 to 1.
    pub share: f64,
    /// Whether it is significant and large enough to matter.
    pub significant: bool,
    /// Physical or shape.
    pub level: Level,
    /// Its parameters.
    pub parameters: Vec<EffectParameter>,
}

/// Errors of the given model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Before {
    /// Percent of peak to peak on identification records.
    pub identify_percent: Option<f64>,
    /// Percent of peak to peak on validation records.
    pub validate_percent: Option<f64>,
}

impl Before {
    /// Whether either error is above a limit in percent.
    pub(crate) fn exceeds(&self, limit_percent: f64) -> bool {
        let above = |percent: Option<f64>| percent.is_some_and(|percent| percent > limit_percent);
        above(self.identify_percent) || above(self.validate_percent)
    }
}

/// The record that would tell most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextRecord {
    /// What to play, in words.
    pub excitation: String,
    /// What it separates.
    pub separates: Vec<String>,
    /// Expected difference, in units of what is left unexplained.
    pub expected_sigma: f64,
    /// Where it was written.
    pub file: Option<String>,
    /// Its sample period, seconds.
    pub sample_period_s: f64,
    /// The voltage, one value a sample.
    #[serde(skip)]
    pub voltage_v: Vec<f64>,
}

impl NextRecord {
    /// The record to play as a native CSV without a position.
    pub fn csv(&self) -> String {
        let mut text = "time_s,voltage_v\n".to_owned();
        for (k, v) in self.voltage_v.iter().enumerate() {
            // Writing to a String does not fail.
            let _ = writeln!(text, "{:.6},{v:.5}", k as f64 * self.sample_period_s);
        }
        text
    }
}

/// What the remaining structure is locked to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lock {
    /// `time`, `position`, `speed`, `position and speed`, `temperature`, `other axis`, `cycle count`, `record order`, `record`,
    /// `sample clock`.
    pub to: String,
    /// Share of the squared error that goes with it, 0 to 1. Shares overlap: time and temperature may be the same thing.
    pub share: f64,
    /// What else is known: the frequency of a line, the rms of a jitter, the distance of what returns.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<EffectParameter>,
}

impl Lock {
    pub(crate) fn new(to: &str, share: f64) -> Self {
        Self {
            to: to.to_owned(),
            share,
            parameters: Vec::new(),
        }
    }
}

/// Where the given model fails.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct WhereItFails {
    /// Share of the squared error that a linear filter of the drive takes, lags and a mode, fitted to the other records each time.
    pub linear_in_drive: f64,
    /// Records whose drive repeats at least twice.
    pub periodic_records: usize,
    /// Of these, the share that is the same in every period; `None` without such a record.
    pub repeats_with_drive: Option<f64>,
    /// Of these, the share that is the same in every period and not linear in the drive.
    pub nonlinear_in_drive: Option<f64>,
    /// What the error goes with, the largest share first, single records behind what says more.
    pub locked_to: Vec<Lock>,
}

/// What nothing in the catalogue explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unexplained {
    /// What is left, percent of peak to peak, over all records that move.
    pub percent: f64,
    /// Of this, what the sensor noise explains.
    pub noise_percent: f64,
    /// What it is locked to, as [`WhereItFails::locked_to`].
    pub locked_to: Vec<Lock>,
}

impl Diagnosis {
    /// The delay that was found where one is named, seconds.
    pub fn delay_s(&self) -> Option<f64> {
        let named = || self.also_possible.iter().chain(&self.further).chain([&self.verdict]);
        if !named().any(|name| name == "delay") {
            return None;
        }
        let entry = self.ranking.iter().find(|entry| entry.effect == "delay")?;
        entry.parameters.iter().find(|p| p.name == "delay").map(|p| p.value)
    }
}

/// The answer of `diagnose`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Name of an effect, or `none`, `unknown`, `hysteresis-shape`.
    pub verdict: String,
    /// Effects that these records cannot tell from the verdict.
    pub also_possible: Vec<String>,
    /// Further effects that are missing beside the verdict.
    pub further: Vec<String>,
    /// Whether the family of plays is too poor for this stage's loops.
    pub shape_too_poor: bool,
    /// Whether the records determine a hysteresis of free shape; otherwise the model's own family stood in for it, and every
    /// significant effect is possible.
    pub shape_determined: bool,
    /// Why these records cannot answer, where they cannot.
    pub cannot_answer: Vec<String>,
    /// Noise floor, micrometres rms.
    pub noise_rms_um: f64,
    /// What the noise floor of these records is worth and rests on.
    #[serde(default)]
    pub noise: Option<NoiseFloor>,
    /// Delay of the controller's own, as the recordings say, that the model lacks: taken off before the search, so that the stage
    /// is not blamed for it. A delay that is named comes on top.
    #[serde(default)]
    pub known_delay_s: Option<f64>,
    /// Errors of the given model.
    pub before: Before,
    /// Where it fails.
    #[serde(default)]
    pub where_it_fails: WhereItFails,
    /// Error of a hysteresis of free shape, nothing else added, percent of peak to peak.
    pub free_shape: Before,
    /// The candidates, best first.
    pub ranking: Vec<RankedEffect>,
    /// The record to take next.
    pub next_record: Option<NextRecord>,
    /// What remains.
    pub unexplained: Unexplained,
}
