//! The text of an effect file; see `docs/effect-files.md`.

use serde::{Deserialize, Serialize};

/// The text of an effect file, field by field; `model.toml` keeps it as it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectFile {
    /// Name: lower-case letters, digits and hyphens; none of the catalogue's.
    pub name: String,
    /// Where it stands in the chain: `delay`, `amplifier`, `creep`, `structure`, `coupling` or `sensor`.
    pub place: String,
    /// What it is, one sentence.
    pub summary: String,
    /// What comes out, in the unit of the input: volts before the hysteresis, micrometres behind it.
    pub output: String,
    /// Where the equation comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// How it shows in records.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shows: Option<String>,
    /// What it is mistaken for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mistaken_for: Option<String>,
    /// Which record separates it from those.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub separated_by: Option<String>,
    /// How it is compensated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensated_by: Option<String>,
    /// Parameters.
    #[serde(rename = "parameter", default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<FileParameter>,
    /// States.
    #[serde(rename = "state", default, skip_serializing_if = "Vec::is_empty")]
    pub states: Vec<FileState>,
}

/// A parameter of an effect file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileParameter {
    /// Name in the expressions.
    pub name: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// What it is.
    pub what: String,
    /// Smallest physical value.
    pub min: f64,
    /// Largest physical value.
    pub max: f64,
    /// Where the effect does nothing; 0, or the bound next to it, where not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub neutral: Option<f64>,
    /// Where searches start; spread over the bounds where not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub starts: Option<Vec<f64>>,
}

/// A state of an effect file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileState {
    /// Name in the expressions.
    pub name: String,
    /// Its value after a long rest at the record's first input `u`.
    pub at_rest: String,
    /// Its rate of change, per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<String>,
    /// Its new value at each sample, from the old one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
}
