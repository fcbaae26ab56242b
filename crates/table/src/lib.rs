//! The parameter table that is compiled into the firmware: its file, its checks, its constants.
//!
//! `hysteron export` writes it, the firmware's build script reads it. What a file can get wrong is checked here; what numbers can, by
//! the rules of `hysteron-slot`, which the board runs as well.
#![forbid(unsafe_code)]

mod banks;
mod c;
mod check;
mod constants;
mod controller;
mod covered;
pub mod gains;
mod numbers;
mod supervision;

pub use banks::{MOST_BANKS, constants_of_banks};
pub use c::CCode;
pub use controller::{Adaptation, Controller, Feedback, Hum, Trust};
pub use covered::Covered;
pub use hysteron_slot::{CORNERS_ABOVE, Family, Inverse, LEAST_TRUST, MOST_PLAYS, Numbers, Refusal, Sweep, short};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// First line of meaning in a table file; another value is another layout.
pub const FORMAT: &str = "hysteron-table 1";

/// A compensator for one axis: a direct inverse (eq. 13), the PI gains (eq. 14) or a complete law around it, limits and converters.
///
/// # Units
/// In the names. Converter limits are given where they act: volts at the actuator, micrometres at the platform.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// [`FORMAT`].
    pub format: String,
    /// The family of the inverse.
    pub family: Family,
    /// Rate of the control loop, hertz.
    pub sample_rate_hz: f64,
    /// Lowest reference.
    pub input_min_um: f64,
    /// Highest reference.
    pub input_max_um: f64,
    /// Lowest command that the amplifier may be given.
    pub output_min_v: f64,
    /// Highest command that the amplifier may be given.
    pub output_max_v: f64,
    /// Where the command starts, ends, and goes when something is wrong.
    pub safe_v: f64,
    /// Fastest change of the command.
    pub slew_v_per_s: f64,
    /// Change of the command on its way from and to the safe level.
    pub ramp_v_per_s: f64,
    /// K_p of eq. 14.
    pub proportional_v_per_um: f64,
    /// K_i of eq. 14.
    pub integral_v_per_um_s: f64,
    /// Feedback is whole up to this frequency of the reference and none from twice it.
    pub feedback_up_to_hz: f64,
    /// Actuator voltage of DAC code 0.
    pub dac_min_v: f64,
    /// Actuator voltage of DAC code 65535.
    pub dac_top_v: f64,
    /// Position of ADC code 0.
    pub adc_min_um: f64,
    /// Position of ADC code 65535.
    pub adc_top_um: f64,
    /// Alpha of eq. 9; MRPI only.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub alpha_s: f64,
    /// Beta of eq. 9; MRPI only.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub beta_s: f64,
    /// Output at input 0 and plays at 0.
    pub offset_v: f64,
    /// Coefficient of the input.
    pub linear_v_per_um: f64,
    /// Coefficient of the input's square; play-polynomial only.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub quadratic_v_per_um2: f64,
    /// Coefficient of the input's cube; all but PI.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub cubic_v_per_um3: f64,
    /// Coefficient of the input's fourth power; play-polynomial only.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub quartic_v_per_um4: f64,
    /// Coefficient of the input's fifth power; play-polynomial only.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub quintic_v_per_um5: f64,
    /// Thresholds of the plays, ascending.
    pub thresholds_um: Vec<f64>,
    /// Weights of the plays.
    pub weights_v_per_um: Vec<f64>,
    /// Weights of the plays times the rate; WRPI only.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rate_weights_v_s_per_um2: Vec<f64>,
    /// Weights of the plays' squares; play-polynomial only.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub weights_quadratic_v_per_um2: Vec<f64>,
    /// Weights of the plays' cubes; play-polynomial only.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub weights_cubic_v_per_um3: Vec<f64>,
    /// The complete law around the inverse; without it the table is an inverse with PI.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controller: Option<Controller>,
    /// What the records behind it cover.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covered: Option<Covered>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the form that serde calls")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Why a table is refused.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum TableError {
    /// Not TOML, or a field is missing, unknown or of another type.
    #[error("{0}")]
    Syntax(String),
    /// A field whose value cannot be used.
    #[error("{field} = {value}: {reason}")]
    Field {
        /// The field, with the element's number from 1.
        field: String,
        /// Its value.
        value: String,
        /// What is allowed, and what to do.
        reason: String,
    },
    /// The core refuses the values in `f32`.
    #[error("the core refuses the table in f32: {0}")]
    Core(#[from] hysteron_core::error::ParamError),
}

impl From<Refusal<'static>> for TableError {
    fn from(refused: Refusal<'static>) -> Self {
        match refused.core_error().filter(|_| refused.field.is_empty()) {
            Some(error) => Self::Core(error),
            None => Self::Field {
                field: refused.field().to_string(),
                value: refused.value().to_string(),
                reason: refused.reason().to_string(),
            },
        }
    }
}

impl Table {
    /// A table of zeros, to be filled in.
    pub fn empty(family: Family) -> Self {
        Self {
            format: String::new(),
            family,
            sample_rate_hz: 0.0,
            input_min_um: 0.0,
            input_max_um: 0.0,
            output_min_v: 0.0,
            output_max_v: 0.0,
            safe_v: 0.0,
            slew_v_per_s: 0.0,
            ramp_v_per_s: 0.0,
            proportional_v_per_um: 0.0,
            integral_v_per_um_s: 0.0,
            feedback_up_to_hz: 0.0,
            dac_min_v: 0.0,
            dac_top_v: 0.0,
            adc_min_um: 0.0,
            adc_top_um: 0.0,
            alpha_s: 0.0,
            beta_s: 0.0,
            offset_v: 0.0,
            linear_v_per_um: 0.0,
            quadratic_v_per_um2: 0.0,
            cubic_v_per_um3: 0.0,
            quartic_v_per_um4: 0.0,
            quintic_v_per_um5: 0.0,
            thresholds_um: Vec::new(),
            weights_v_per_um: Vec::new(),
            rate_weights_v_s_per_um2: Vec::new(),
            weights_quadratic_v_per_um2: Vec::new(),
            weights_cubic_v_per_um3: Vec::new(),
            controller: None,
            covered: None,
        }
    }

    /// Reads and checks a table.
    ///
    /// # Errors
    /// As [`Table::check`]; text that is no such table.
    pub fn parse(text: &str) -> Result<Self, TableError> {
        let table: Self = toml::from_str(text).map_err(|error| TableError::Syntax(error.to_string()))?;
        table.check()?;
        Ok(table)
    }

    /// Whether a text is that of a table, good or not.
    pub fn is_one(text: &str) -> bool {
        toml::from_str::<toml::Table>(text)
            .is_ok_and(|table| table.get("format").and_then(toml::Value::as_str) == Some(FORMAT))
    }

    /// The table as a file.
    ///
    /// # Errors
    /// As [`Table::check`].
    pub fn to_toml(&self) -> Result<String, TableError> {
        self.check()?;
        toml::to_string(self).map_err(|error| TableError::Syntax(error.to_string()))
    }
}

/// The hash that stands in the image and in every recording: SHA-256 of the file's bytes.
pub fn hash(text: &str) -> [u8; 32] {
    Sha256::digest(text.as_bytes()).into()
}
