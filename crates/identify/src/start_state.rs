//! The state of the play operators before a record.

use crate::family::range;

/// The state of the play operators before the first sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InitialState {
    /// The drive is periodic from the first sample and so is the response: one period is run beforehand.
    Periodic {
        /// Samples a period.
        samples: usize,
    },
    /// `w_i = v(0) - fraction * r_i`: 0 after coming down from above (and for the virgin start at 0 V of eq. 3), 1 after
    /// coming up from below, 0.5 when demagnetised.
    Remanent {
        /// From 0 to 1.
        fraction: f64,
    },
}

impl InitialState {
    /// At rest after coming down from above, and the virgin start at 0 V.
    pub const REST: Self = Self::Remanent { fraction: 0.0 };

    /// Output of a play of this threshold before the first sample of `input`.
    ///
    /// Periodic records run one period from here, which leaves of it only the plays wider than the record's own span. What
    /// these hold must not depend on where in its period a record happens to begin: they are taken as at rest at zero,
    /// demagnetised where the drive swings to both sides, else having come down to it.
    pub(crate) fn before(self, input: &[f64]) -> impl Fn(f64) -> f64 {
        let first = input.first().copied().unwrap_or(0.0);
        let (at, fraction) = match self {
            Self::Remanent { fraction } => (first, fraction),
            Self::Periodic { samples } => {
                let (low, high) = range(input[..samples.min(input.len())].iter().copied());
                // Conditioning cycles to a side less than half as far leave what coming down to zero leaves.
                (0.0, if -low > 0.5 * high && low < 0.0 { 0.5 } else { 0.0 })
            }
        };
        move |threshold| at - fraction * threshold
    }
}

impl core::fmt::Display for InitialState {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Periodic { samples } => write!(f, "periodic, {samples} samples"),
            Self::Remanent { fraction } if *fraction == 0.0 => f.write_str("at rest from above"),
            Self::Remanent { fraction } => write!(f, "remanent {fraction:.3}"),
        }
    }
}
