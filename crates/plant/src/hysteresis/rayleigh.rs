//! Gain that grows with the amplitude: the Rayleigh law.

use super::memory::{Branches, Memory};
use crate::error::{StageError, within};

/// Rayleigh's law as an addition to the stack's displacement.
///
/// A uniform Preisach density: on a branch from the turning point v0 the output changes by `(v - v0)^2 / (4 v_ref)`. A cycle of peak-to-peak D thus has
/// a gain that rises linearly with D, and a loop whose opening does, too.
///
/// # Reference
/// Damjanovic, Rep. Prog. Phys. 61 (1998) 1267, section 3.3: Rayleigh law in ferroelectrics.
#[derive(Debug, Clone, PartialEq)]
pub struct AmplitudeGain {
    /// Addition to the gain at a cycle of 0 V to `reference_v`, relative to the stroke over `reference_v` (0.1 means 10 % more gain there).
    pub gain_at_full_cycle: f64,
}

impl AmplitudeGain {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "amplitude_gain.gain_at_full_cycle",
            self.gain_at_full_cycle,
            0.0,
            2.0,
            "piezo ceramics show 0.2 to 0.6",
        )
    }
}

struct Uniform;

impl Branches for Uniform {
    type Point = f64;

    fn point(&self, input_v: f64) -> f64 {
        input_v
    }

    fn between(&self, low_v: &f64, high_v: &f64) -> f64 {
        let cycle_v = high_v - low_v;
        0.25 * cycle_v * cycle_v
    }

    fn virgin(&self, input_v: &f64) -> f64 {
        0.5 * input_v * input_v.abs()
    }
}

/// The law in motion; displacement zero after a full reference cycle.
#[derive(Debug, Clone)]
pub(crate) struct AmplitudeGainState {
    um_per_v2: f64,
    rest: f64,
    memory: Memory<f64>,
}

impl AmplitudeGainState {
    pub(crate) fn new(config: &AmplitudeGain, stroke_um: f64, reference_v: f64, conditioned: bool) -> Self {
        let mut memory = Memory::default();
        if conditioned {
            memory.advance(&Uniform, reference_v);
        }
        let rest = memory.advance(&Uniform, 0.0);
        // A full cycle moves by reference_v^2 / 4: scaled to the share of the stroke.
        let um_per_v2 = 4.0 * stroke_um * config.gain_at_full_cycle / (reference_v * reference_v);
        Self {
            um_per_v2,
            rest,
            memory,
        }
    }

    #[inline]
    pub(crate) fn advance(&mut self, voltage_v: f64) -> f64 {
        self.um_per_v2 * (self.memory.advance(&Uniform, voltage_v) - self.rest)
    }
}
