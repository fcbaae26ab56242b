//! Which model, and which way it runs.

use hysteron_data::Record;
use serde::{Deserialize, Serialize};

/// The hysteresis models of the core.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// Prandtl-Ishlinskii, eq. 5: linear input function.
    Pi,
    /// Modified Prandtl-Ishlinskii, eq. 6: cubic input function.
    Mpi,
    /// Rate-dependent weights, `w_i = k_i + l_i y'` (Ang, Khosla, Riviere 2007).
    Wrpi,
    /// Modified rate-dependent Prandtl-Ishlinskii, eq. 10: dynamic envelopes.
    Mrpi,
    /// A cubic of each play's output.
    PlayPolynomial,
}

impl Family {
    /// All of them, simplest first.
    pub const ALL: [Self; 5] = [Self::Pi, Self::Mpi, Self::Wrpi, Self::Mrpi, Self::PlayPolynomial];

    /// The name used on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pi => "pi",
            Self::Mpi => "mpi",
            Self::Wrpi => "wrpi",
            Self::Mrpi => "mrpi",
            Self::PlayPolynomial => "play-polynomial",
        }
    }

    /// Powers of the input in the input function g.
    pub(crate) fn input_powers(self) -> &'static [i32] {
        match self {
            Self::Pi => &[1],
            Self::Mpi | Self::Wrpi | Self::Mrpi => &[1, 3],
            Self::PlayPolynomial => &[1, 2, 3, 4, 5],
        }
    }

    /// Coefficients a play operator has.
    pub(crate) fn coefficients_a_play(self) -> usize {
        match self {
            Self::Pi | Self::Mpi | Self::Mrpi => 1,
            Self::Wrpi => 2,
            Self::PlayPolynomial => 3,
        }
    }
}

impl core::fmt::Display for Family {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

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

/// Smallest and largest value.
pub fn range(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values
        .into_iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
}

/// Peak to peak of a series; 0 for an empty one.
pub fn peak_to_peak(values: &[f64]) -> f64 {
    let (low, high) = range(values.iter().copied());
    if values.is_empty() { 0.0 } else { high - low }
}
