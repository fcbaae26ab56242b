//! Which model, and which way it runs.

use hysteron_data::Record;
use serde::{Deserialize, Serialize};

pub use hysteron_effects::family::{FADING_ELEMENTS, FADING_STEP, FREE_PLAYS, Family, MAX_PLAYS};
pub use hysteron_effects::series::{peak_to_peak, range};

/// Which way a model runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Voltage to position.
    Forward,
    /// Position to voltage: the direct inverse, eqs 12 and 13.
    Inverse,
}

impl Direction {
    /// The name used on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Forward => "forward",
            Self::Inverse => "inverse",
        }
    }

    /// Unit of the model's input.
    pub fn input_unit(self) -> &'static str {
        match self {
            Self::Forward => "V",
            Self::Inverse => "um",
        }
    }

    /// Unit of the model's output.
    pub fn output_unit(self) -> &'static str {
        match self {
            Self::Forward => "um",
            Self::Inverse => "V",
        }
    }

    /// The column of a record that drives the model.
    pub fn input(self, record: &Record) -> &[f64] {
        match self {
            Self::Forward => &record.voltage_v,
            Self::Inverse => &record.position_um,
        }
    }

    /// The column of a record that the model has to give.
    pub fn output(self, record: &Record) -> &[f64] {
        match self {
            Self::Forward => &record.position_um,
            Self::Inverse => &record.voltage_v,
        }
    }
}
