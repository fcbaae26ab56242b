//! What a law has learned of gain, zero and lag while it ran.

use hysteron_core::surroundings::{DesignedLaw, DesignedState};
use serde::Serialize;

pub use hysteron_table::Adaptation;

/// Gain, zero and lag at the end of a run; the bounds are the controller's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Adapted {
    /// Change of the gain, percent.
    pub gain_percent: f64,
    /// Change of the zero, micrometres.
    pub zero_um: f64,
    /// Change of the lag, microseconds.
    pub lag_us: f64,
}

impl Adapted {
    /// Of a run with samples of `period_s` that ended in a state; none of a law that does not learn.
    pub fn of(law: &DesignedLaw<f64>, state: &DesignedState<f64>, period_s: f64) -> Option<Self> {
        law.surroundings.adaptation.map(|_| Self {
            gain_percent: 100.0 * state.adaptation().gain(),
            zero_um: state.adaptation().zero(),
            lag_us: 1e6 * state.adaptation().lag() * period_s,
        })
    }
}
