//! The hysteresis that the effects stand around.

use serde::{Deserialize, Serialize};

/// The largest number of play operators.
pub const MAX_PLAYS: usize = 64;

/// Plays of the free shape: enough to bring a Preisach density down to a few hundredths of a percent.
pub const FREE_PLAYS: usize = 18;

/// Fading elements of Duhem's family: their lengths are an octave apart, the longest 0.7 of the range.
pub const FADING_ELEMENTS: usize = 4;

/// Longest part of a path, in half ranges, on which what a fading element follows counts as a straight line.
pub const FADING_STEP: f64 = 0.05;

/// The hysteresis models that are fitted: those of the core, and Duhem's.
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
    /// Powers of the voltage through elements that fade along its path: Coleman, Hodgdon, IEEE Trans. Magn. 22 (1986) 1055. Small loops
    /// drift as they are repeated, which no play does.
    Duhem,
}

impl Family {
    /// All of them, simplest first.
    pub const ALL: [Self; 6] = [
        Self::Pi,
        Self::Mpi,
        Self::Wrpi,
        Self::Mrpi,
        Self::PlayPolynomial,
        Self::Duhem,
    ];

    /// The name used on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pi => "pi",
            Self::Mpi => "mpi",
            Self::Wrpi => "wrpi",
            Self::Mrpi => "mrpi",
            Self::PlayPolynomial => "play-polynomial",
            Self::Duhem => "duhem",
        }
    }

    /// What it is made of: plays, or fading elements.
    pub fn elements(self) -> &'static str {
        match self {
            Self::Duhem => "fading elements",
            _ => "plays",
        }
    }

    /// What tells one of its elements from another: a play's threshold, or the length of the path along which one fades.
    pub fn of_an_element(self) -> &'static str {
        match self {
            Self::Duhem => "length",
            _ => "threshold",
        }
    }

    /// Powers of the input in the input function g.
    pub fn input_powers(self) -> &'static [i32] {
        match self {
            Self::Pi => &[1],
            Self::Mpi | Self::Wrpi | Self::Mrpi => &[1, 3],
            Self::PlayPolynomial | Self::Duhem => &[1, 2, 3, 4, 5],
        }
    }

    /// Whether it is a free shape: functions about the middle of the range, held to a smooth shape as strongly as what is left out tells,
    /// straight lines beyond.
    pub fn is_free(self) -> bool {
        matches!(self, Self::PlayPolynomial | Self::Duhem)
    }

    /// Coefficients a play operator, or a fading element, has.
    pub fn coefficients_a_play(self) -> usize {
        match self {
            Self::Pi | Self::Mpi | Self::Mrpi => 1,
            Self::Wrpi => 2,
            Self::PlayPolynomial | Self::Duhem => 3,
        }
    }
}

impl core::fmt::Display for Family {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}
