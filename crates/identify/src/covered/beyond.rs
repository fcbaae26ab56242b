//! What leaves the records: which field, which value, what is covered, how to widen it.

use super::Covered;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What can leave the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Field {
    /// A limit of the command, volts.
    Voltage,
    /// A reference, micrometres.
    Position,
    /// The controller's rate, hertz.
    SampleRate,
}

impl Field {
    /// Name in messages.
    pub fn words(self) -> &'static str {
        match self {
            Self::Voltage => "voltage",
            Self::Position => "position",
            Self::SampleRate => "sample rate",
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Voltage => "V",
            Self::Position => "um",
            Self::SampleRate => "Hz",
        }
    }

    /// What to record, so that more is covered.
    pub fn widen(self) -> &'static str {
        match self {
            Self::Voltage => {
                "record up to that voltage and fit again, or give the amplifier's limits in [known] of dataset.toml"
            }
            Self::Position => "record over that range and fit again",
            Self::SampleRate => "record at that rate and fit again",
        }
    }
}

/// A value beyond the records.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beyond {
    /// What leaves.
    pub field: Field,
    /// The value asked for.
    pub value: f64,
    /// Lowest and highest that is covered.
    pub covered: [f64; 2],
}

impl fmt::Display for Beyond {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Four decimals are a tenth of a nanometre.
        let short = |value: f64| (value * 1e4).round() / 1e4;
        let (unit, [low, high]) = (self.field.unit(), self.covered);
        write!(
            f,
            "{} {} {unit}; the records cover {} to {} {unit}",
            self.field.words(),
            short(self.value),
            short(low),
            short(high)
        )
    }
}

/// How far past the end of what is covered a value may lie, as a share of its span: ends are read off rows, between which the
/// extremes lie.
const ROUNDING: f64 = 0.01;

/// Lowest and highest that each field may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Envelope {
    /// What leaves.
    pub field: Field,
    /// What is covered; none where it is not known, and everything leaves it.
    pub covered: [f64; 2],
}

impl Envelope {
    /// The first of these values that leaves.
    pub fn left_by(&self, values: &[f64]) -> Option<Beyond> {
        let [low, high] = self.covered;
        let slack = ROUNDING * (high - low);
        // A value that is no number is not within.
        let within = |value: &f64| (low - slack..=high + slack).contains(value);
        values.iter().find(|value| !within(value)).map(|&value| Beyond {
            field: self.field,
            value,
            covered: self.covered,
        })
    }
}

impl Covered {
    /// Commands that are covered: those of the records, and up to what the amplifier is known to give.
    pub fn command_v(&self) -> Option<Envelope> {
        let both = self.voltage_v.into_iter().chain(self.amplifier_v);
        let covered = both.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])?;
        Some(Envelope {
            field: Field::Voltage,
            covered,
        })
    }

    /// References that are covered.
    pub fn reference_um(&self) -> Option<Envelope> {
        self.position_um.map(|covered| Envelope {
            field: Field::Position,
            covered,
        })
    }

    /// Rates that are covered: slower ones than a record's are known as well.
    pub fn rate_hz(&self) -> Option<Envelope> {
        self.sample_rate_hz.map(|highest| Envelope {
            field: Field::SampleRate,
            covered: [0.0, highest],
        })
    }
}
