//! The hysteresis that the effects stand around.

use serde::{Deserialize, Serialize};

/// The largest number of play operators.
pub const MAX_PLAYS: usize = 64;

/// Plays of the free shape: enough to bring a Preisach density down to a few hundredths of a percent.
pub const FREE_PLAYS: usize = 18;

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
    pub fn input_powers(self) -> &'static [i32] {
        match self {
            Self::Pi => &[1],
            Self::Mpi | Self::Wrpi | Self::Mrpi => &[1, 3],
            Self::PlayPolynomial => &[1, 2, 3, 4, 5],
        }
    }

    /// Coefficients a play operator has.
    pub fn coefficients_a_play(self) -> usize {
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
