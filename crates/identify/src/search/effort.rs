//! How much of a search for one candidate is done.

use crate::effects::Effect;

/// How much of a search for one candidate is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Effort {
    /// Among many: one that takes nothing is left early.
    Quick,
    /// Among many, in a valley that is long and bent.
    Patient,
    /// For its own sake: it is wanted whatever it takes.
    Thorough,
}

impl Effort {
    /// What the search for an effect takes of it, and what the look at its starts.
    pub(super) fn for_effect(self, effect: &dyn Effect) -> (Self, Self) {
        // The states of the records hide what outlasts them: a short way down ends where they still do.
        let search = if effect.outlasts_records() {
            Self::Thorough
        } else if self == Self::Quick && effect.widens().is_some() {
            Self::Patient
        } else {
            self
        };
        // The valleys of a user's equation are not known beforehand.
        let look = if effect.file().is_some() {
            Self::Thorough
        } else {
            search
        };
        (search, look)
    }

    /// Starts that are followed towards the bottom of their valleys.
    pub(super) fn followed(self) -> usize {
        match self {
            Self::Quick => 2,
            Self::Patient | Self::Thorough => 4,
        }
    }

    /// Steps of those, and of the best of them.
    pub(super) fn steps(self) -> (usize, usize) {
        match self {
            Self::Quick => (1, 6),
            Self::Patient => (2, 12),
            Self::Thorough => (3, usize::MAX),
        }
    }

    /// Fall of the sum of logarithms below which a search has settled: the error of one record by a two-hundredth, or a
    /// hundredth of that.
    pub(super) fn settled(self) -> f64 {
        match self {
            Self::Quick | Self::Patient => 1e-2,
            Self::Thorough => 1e-4,
        }
    }

    /// Times that the states of the records and the chain follow each other.
    pub(super) fn turns(self) -> usize {
        match self {
            Self::Quick | Self::Patient => 2,
            Self::Thorough => 4,
        }
    }

    /// Rounds in which records choose the numbers of their own again.
    pub(super) fn rounds(self) -> usize {
        match self {
            Self::Quick | Self::Patient => 2,
            Self::Thorough => 5,
        }
    }
}
