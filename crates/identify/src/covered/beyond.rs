//! What leaves the records: which field, which value, what is covered, how to widen it.

use super::{Covered, SMALL};
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
    /// The frequency of a reference, hertz.
    Frequency,
}

impl Field {
    /// Name in messages.
    pub fn words(self) -> &'static str {
        match self {
            Self::Voltage => "voltage",
            Self::Position => "position",
            Self::SampleRate => "sample rate",
            Self::Frequency => "reference frequency",
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Voltage => "V",
            Self::Position => "um",
            Self::SampleRate | Self::Frequency => "Hz",
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
            Self::Frequency => "record a sine over half the range at that frequency and fit again",
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

    /// Frequencies of references of so many micrometres peak to peak that are covered: those at which the stage has swung as far, and for
    /// a stroke below a fifth of the range those that small signals tell as well.
    pub fn frequency_hz(&self, stroke_um: f64) -> Option<Envelope> {
        let swing_hz = self.swing_hz?;
        let is_small = self
            .position_um
            .is_some_and(|[low, high]| stroke_um <= SMALL * (high - low));
        let small_hz = self
            .small_signal
            .as_ref()
            .filter(|_| is_small)
            .map(|band| band.up_to_hz);
        Some(Envelope {
            field: Field::Frequency,
            covered: [0.0, small_hz.unwrap_or(0.0).max(swing_hz)],
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covered::SmallSignalBand;

    /// Records that swing to 100 Hz, with small signals to 2 kHz: a fifth of the range is small. One percent is rounding.
    #[test]
    fn bva_frequencies_that_are_covered() {
        let covered = Covered {
            position_um: Some([1.0, 11.0]),
            swing_hz: Some(100.0),
            small_signal: Some(SmallSignalBand {
                up_to_hz: 2000.0,
                record: "frf.csv".to_owned(),
            }),
            ..Covered::default()
        };
        let left = |stroke_um: f64, hz: f64| covered.frequency_hz(stroke_um).unwrap().left_by(&[hz]).is_some();
        for (stroke_um, hz, beyond) in [
            (5.0, 100.9, false),
            (5.0, 101.1, true),
            (2.1, 500.0, true),
            (1.9, 500.0, false),
            (1.9, 2019.0, false),
            (1.9, 2021.0, true),
        ] {
            assert_eq!(left(stroke_um, hz), beyond, "{stroke_um} um at {hz} Hz");
        }
        let said = covered
            .frequency_hz(5.0)
            .unwrap()
            .left_by(&[500.0])
            .unwrap()
            .to_string();
        assert_eq!(said, "reference frequency 500 Hz; the records cover 0 to 100 Hz");
        assert_eq!(Covered::default().frequency_hz(5.0), None);
    }
}
