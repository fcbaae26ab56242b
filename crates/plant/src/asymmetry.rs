//! Asymmetry: a bend of the displacement that both branches share.

use crate::error::{StageError, within};

/// Adds `stroke [c2 (x^2 - x) + c3 (x^3 - x)]`, x the voltage over the reference voltage, so that the ends of the stroke stay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asymmetry {
    /// c2, a fraction of the stroke.
    pub quadratic: f64,
    /// c3, a fraction of the stroke.
    pub cubic: f64,
}

impl Asymmetry {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "asymmetry.quadratic",
            self.quadratic,
            -0.5,
            0.5,
            "stacks show 0.01 to 0.2",
        )?;
        within("asymmetry.cubic", self.cubic, -0.5, 0.5, "stacks show 0.01 to 0.2")
    }

    #[inline]
    pub(crate) fn of(&self, x: f64) -> f64 {
        x * (self.quadratic * (x - 1.0) + self.cubic * (x * x - 1.0))
    }
}
