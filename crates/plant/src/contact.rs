//! Lost motion and end stops: what happens where parts touch.

use crate::error::{StageError, ordered, within};

/// Lost motion between the structure and the platform: a play of `width_um`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Backlash {
    /// Full width of the dead band, micrometres.
    pub width_um: f64,
}

/// Hard stops of the platform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EndStop {
    /// Lower stop, micrometres.
    pub min_um: f64,
    /// Upper stop, micrometres.
    pub max_um: f64,
}

impl Backlash {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "backlash.width_um",
            self.width_um,
            0.0,
            1e4,
            "lost motion is 0.005 to 0.2 um",
        )
    }
}

impl EndStop {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "end_stop.min_um",
            self.min_um,
            -1e9,
            0.0,
            "the stage rests at 0 um, which must be free",
        )?;
        within(
            "end_stop.max_um",
            self.max_um,
            0.0,
            1e9,
            "the stage rests at 0 um, which must be free",
        )?;
        ordered("end_stop.min_um", self.min_um, "end_stop.max_um", self.max_um)
    }
}

/// The dead band in motion, resting in its middle.
#[derive(Debug, Clone)]
pub(crate) struct BacklashState {
    half_um: f64,
    output_um: f64,
}

impl BacklashState {
    pub(crate) fn new(config: &Backlash) -> Self {
        Self {
            half_um: 0.5 * config.width_um,
            output_um: 0.0,
        }
    }

    #[inline]
    pub(crate) fn advance(&mut self, input_um: f64) -> f64 {
        self.output_um = self.output_um.min(input_um + self.half_um).max(input_um - self.half_um);
        self.output_um
    }
}
