//! What a diagnosis says, in numbers and names.

use crate::odds::{Likely, Odds};
use hysteron_acquisition::{Finding, NoiseFloor};
use hysteron_identify::{EffectId, EffectName, Step};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
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

/// A parameter of an entry.
pub(crate) fn parameter(name: &str, value: f64, unit: &str) -> EffectParameter {
    EffectParameter {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
    }
}

/// What a diagnosis comes to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// What is left is noise and the known coarseness of the model.
    Nothing,
    /// Structure remains that no effect of the catalogue is named for.
    Unknown,
    /// This effect is missing; `hysteresis-shape` where nothing physical is.
    Effect(EffectName),
}

impl Verdict {
    /// The word in files: `none`, `unknown`, or the effect's name.
    pub fn as_str(&self) -> &str {
        match self {
            Self::Nothing => "none",
            Self::Unknown => "unknown",
            Self::Effect(name) => name.as_str(),
        }
    }

    /// The effect that is named.
    pub fn effect(&self) -> Option<&EffectName> {
        match self {
            Self::Effect(name) => Some(name),
            Self::Nothing | Self::Unknown => None,
        }
    }

    /// Whether this effect is named.
    pub fn is(&self, effect: EffectId) -> bool {
        matches!(self, Self::Effect(name) if *name == effect)
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.as_str())
    }
}

impl Serialize for Verdict {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for Verdict {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        Ok(match word.as_str() {
            "none" => Self::Nothing,
            "unknown" => Self::Unknown,
            name => Self::Effect(EffectName::of(name)),
        })
    }
}

/// Why records cannot answer, or not for an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// The voltage stands still in every record.
    NothingMoves,
    /// The stroke is no more than some tens of times the noise.
    AllNoise,
    /// The position stands on its largest or smallest value while the voltage moves.
    Clipped,
    /// One sine was played: at one frequency and amplitude many effects look alike.
    OneSine,
    /// The position leads the voltage: what turns the phase is hidden by how the columns were taken.
    PositionLeads,
    /// No record or part of one is left to hold out.
    NothingHeldOut,
}

/// One candidate, fitted in its place jointly with the rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RankedEffect {
    /// Name.
    pub effect: EffectName,
    /// Errors with it: those that the model has once it is added.
    #[serde(flatten)]
    pub errors: Before,
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
    /// Whether a parameter stands on a bound that physics sets, which an effect that is there does not need.
    #[serde(default)]
    pub on_bound: bool,
    /// Its parameters.
    pub parameters: Vec<EffectParameter>,
}

/// Errors of a model, pooled over the records that move.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Before {
    /// Percent of peak to peak on identification records.
    pub identify_percent: Option<f64>,
    /// Percent of peak to peak on validation records.
    pub validate_percent: Option<f64>,
}

impl Before {
    /// Of a step of a model's history.
    pub(crate) fn of(step: &Step) -> Self {
        Self {
            identify_percent: step.identify_percent,
            validate_percent: step.validate_percent,
        }
    }

    /// The error that counts: on records that were not fitted, else on those that were.
    pub fn counts(&self) -> Option<f64> {
        self.validate_percent.or(self.identify_percent)
    }

    /// Both, as root mean square.
    pub fn pooled(&self) -> Option<f64> {
        let each: Vec<f64> = [self.identify_percent, self.validate_percent]
            .into_iter()
            .flatten()
            .collect();
        let squares: f64 = each.iter().map(|p| p * p).sum();
        (!each.is_empty()).then(|| (squares / each.len() as f64).sqrt())
    }

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
    /// The explanations that it separates: each with the probability that it would have after the record, where it is the right one.
    pub expected: Vec<Likely>,
    /// Where it was written.
    pub file: Option<String>,
    /// Its sample period, seconds.
    pub sample_period_s: f64,
    /// The voltage, one value a sample.
    #[serde(skip)]
    pub voltage_v: Vec<f64>,
    /// The voltage of the other axis, where the rig has one.
    #[serde(skip)]
    pub voltage2_v: Option<Vec<f64>>,
}

impl NextRecord {
    /// The record to play as a native CSV without a position.
    pub fn csv(&self) -> String {
        let other = self.voltage2_v.as_deref();
        let mut text = format!("time_s,voltage_v{}\n", if other.is_some() { ",voltage2_v" } else { "" });
        for (k, v) in self.voltage_v.iter().enumerate() {
            // Writing to a String does not fail.
            let _ = write!(text, "{:.6},{v:.5}", k as f64 * self.sample_period_s);
            if let Some(v2) = other.and_then(|other| other.get(k)) {
                let _ = write!(text, ",{v2:.5}");
            }
            text.push('\n');
        }
        text
    }
}

/// What an error can go with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum LockTo {
    /// Time, whatever the drive does.
    #[serde(rename = "time")]
    Time,
    /// The position.
    #[serde(rename = "position")]
    Position,
    /// The speed.
    #[serde(rename = "speed")]
    Speed,
    /// Both together, beyond what goes with either.
    #[serde(rename = "position and speed")]
    PositionAndSpeed,
    /// The stage's temperature.
    #[serde(rename = "temperature")]
    Temperature,
    /// The other axis' voltage.
    #[serde(rename = "other axis")]
    OtherAxis,
    /// Cycles since a record's start.
    #[serde(rename = "cycle count")]
    CycleCount,
    /// The order of the records.
    #[serde(rename = "record order")]
    RecordOrder,
    /// Single records.
    #[serde(rename = "record")]
    Record,
    /// The sample clock.
    #[serde(rename = "sample clock")]
    SampleClock,
}

impl LockTo {
    /// The word in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Position => "position",
            Self::Speed => "speed",
            Self::PositionAndSpeed => "position and speed",
            Self::Temperature => "temperature",
            Self::OtherAxis => "other axis",
            Self::CycleCount => "cycle count",
            Self::RecordOrder => "record order",
            Self::Record => "record",
            Self::SampleClock => "sample clock",
        }
    }
}

/// What the remaining structure is locked to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lock {
    /// What it goes with.
    pub to: LockTo,
    /// Share of the squared error that goes with it, 0 to 1. Shares overlap: time and temperature may be the same thing.
    pub share: f64,
    /// What else is known: the frequency of a line, the rms of a jitter, the distance of what returns.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<EffectParameter>,
}

impl Lock {
    pub(crate) fn new(to: LockTo, share: f64) -> Self {
        Self {
            to,
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
        let named = || {
            self.also_possible
                .iter()
                .chain(&self.further)
                .chain(self.verdict.effect())
        };
        if !named().any(|name| *name == EffectId::Delay) {
            return None;
        }
        let entry = self.ranking.iter().find(|entry| entry.effect == EffectId::Delay)?;
        entry.parameters.iter().find(|p| p.name == "delay").map(|p| p.value)
    }
}

/// The answer of `diagnose`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// The main thing.
    pub verdict: Verdict,
    /// Effects that these records cannot tell from the verdict, likeliest first; beside `unknown` those that could be it.
    pub also_possible: Vec<EffectName>,
    /// How likely each candidate is what is missing, and none of them.
    #[serde(default)]
    pub odds: Odds,
    /// Further effects that are missing beside the verdict.
    pub further: Vec<EffectName>,
    /// What the verdict's effect takes of the squared error beyond noise and coarseness, 0 to 1; `None` where none is named.
    #[serde(default)]
    pub share: Option<f64>,
    /// Whether the family of plays is too poor for this stage's loops.
    pub shape_too_poor: bool,
    /// Whether the records determine a hysteresis of free shape; otherwise the model's own family stood in for it, and every
    /// significant effect is possible.
    pub shape_determined: bool,
    /// Why these records cannot answer, where they cannot.
    pub cannot_answer: Vec<Reason>,
    /// Noise floor, micrometres rms.
    pub noise_rms_um: f64,
    /// What the noise floor of these records is worth and rests on.
    #[serde(default)]
    pub noise: Option<NoiseFloor>,
    /// Delay of the controller's own, as the recordings say, that the model lacks: taken off before the search, so that the stage
    /// is not blamed for it. A delay that is named comes on top.
    #[serde(default)]
    pub known_delay_s: Option<f64>,
    /// What converters, clocks, cables and files have done to the records, whatever the model; it can look like an effect.
    #[serde(default)]
    pub acquisition: Vec<Finding>,
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
