//! What the records behind a table cover: the envelope that travels with it.

use crate::check::refuse;
use crate::{Table, TableError, short};
use serde::{Deserialize, Serialize};

/// The `[covered]` part of a table; a field that is absent is not known.
///
/// # Units
/// In the names; pairs are lowest and highest.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Covered {
    /// Commands in the records.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voltage_v: Option<[f64; 2]>,
    /// Positions in the records.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_um: Option<[f64; 2]>,
    /// Fastest change of the command in the records.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slew_v_per_s: Option<f64>,
    /// Highest frequency at which positions swing over a third of their range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub swing_hz: Option<f64>,
    /// Temperatures in the records.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<[f64; 2]>,
    /// Highest rate of a record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_rate_hz: Option<f64>,
    /// Up to where the stage is told, and by what.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub told_to_hz: Option<f64>,
    /// The record of small signals, or the user's word.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub told_by: Option<String>,
    /// What was asked for beyond the records, and granted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beyond: Vec<String>,
}

impl Covered {
    /// A line for each field, for the comments of what is made of a table.
    pub(crate) fn lines(&self) -> Vec<String> {
        let pair = |name: &str, ends: Option<[f64; 2]>, unit: &str| {
            ends.map(|[low, high]| format!("{name} {} to {} {unit}", short(low), short(high)))
        };
        let one = |name: &str, value: Option<f64>, unit: &str| {
            value.map(|value| format!("{name} up to {} {unit}", short(value)))
        };
        let told_by = self.told_by.as_deref().unwrap_or("nothing");
        let mut lines: Vec<String> = [
            pair("voltage", self.voltage_v, "V"),
            pair("position", self.position_um, "um"),
            one("slew", self.slew_v_per_s, "V/s"),
            one("large references", self.swing_hz, "Hz"),
            pair("temperature", self.temperature_c, "degC"),
            one("sample rate", self.sample_rate_hz, "Hz"),
            self.told_to_hz
                .map(|hz| format!("small signals up to {} Hz, by {told_by}", short(hz))),
        ]
        .into_iter()
        .flatten()
        .collect();
        lines.extend(self.beyond.iter().map(|beyond| format!("beyond the records: {beyond}")));
        lines
    }

    /// Its numbers.
    pub(crate) fn numbers(&self) -> hysteron_slot::Covered {
        hysteron_slot::Covered {
            voltage_v: self.voltage_v,
            position_um: self.position_um,
            temperature_c: self.temperature_c,
            slew_v_per_s: self.slew_v_per_s,
            swing_hz: self.swing_hz,
            sample_rate_hz: self.sample_rate_hz,
            told_to_hz: self.told_to_hz,
        }
    }

    /// Refuses text that would end a comment.
    pub(crate) fn check_texts(&self) -> Result<(), TableError> {
        let texts = self.beyond.iter().chain(&self.told_by);
        for text in texts {
            if text.contains("*/") || text.chars().any(char::is_control) {
                return Err(refuse(
                    "covered",
                    text,
                    "must be one line of text without the end of a C comment",
                ));
            }
        }
        Ok(())
    }
}

impl Table {
    /// What the records behind it cover, a line each; empty where the table does not say.
    pub(crate) fn covered_lines(&self) -> Vec<String> {
        self.covered.as_ref().map(Covered::lines).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_lines_have_no_tails_of_binary_fractions() {
        let covered = Covered {
            position_um: Some([0.0, 1.1 * 1.1]),
            sample_rate_hz: Some(1.0 / 20.3e-6),
            ..Covered::default()
        };
        assert_eq!(
            covered.lines(),
            ["position 0 to 1.21 um", "sample rate up to 49261.1 Hz"]
        );
    }

    #[test]
    fn refuse_ends_that_do_not_ascend_and_text_that_ends_a_comment() {
        let refused = |covered: Covered| {
            let numbers = covered.numbers().check().map_err(TableError::from);
            numbers.and(covered.check_texts()).unwrap_err().to_string()
        };
        let said = refused(Covered {
            voltage_v: Some([3.0, 1.0]),
            ..Covered::default()
        });
        assert_eq!(
            said,
            "covered.voltage_v = [3, 1]: must be two finite numbers, the lower first"
        );
        let said = refused(Covered {
            slew_v_per_s: Some(f64::NAN),
            ..Covered::default()
        });
        assert_eq!(said, "covered.slew_v_per_s = NaN: must be finite and not negative");
        let said = refused(Covered {
            told_by: Some("frf.csv */ int main".to_owned()),
            ..Covered::default()
        });
        assert!(said.contains("without the end of a C comment"), "{said}");
        assert_eq!(Covered::default().check_texts(), Ok(()));
    }
}
