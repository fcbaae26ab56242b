//! Physical effects of a stage as blocks of the chain, one file each: voltage, delay, amplifier, hysteresis, creep,
//! structure, coupling and heat, sensor.
//!
//! Each block is a configuration (validated when built) and a state; [`Block::step`] is total. Linear blocks are
//! discretised exactly for an input that runs in straight lines between the samples (first-order hold).

pub mod backlash;
pub mod coupling;
pub mod creep;
pub mod delay;
pub mod hum;
pub mod hum_canceller;
pub mod lag;
pub mod resonance;
pub mod restoring;
pub mod saturation;
pub mod sensor;
pub mod slew;
pub mod thermal;

use crate::real::Real;

/// A block of the chain: one input, one output a sample.
pub trait Block<T: Real> {
    /// What the block remembers.
    type State;

    /// The state of a block whose input has always been `input`. An input that is not finite counts as 0.
    fn rest_at(&self, input: T) -> Self::State;

    /// One sample. Returns a finite number for every input, NaN included: an input that is not finite holds the last one.
    fn step(&self, state: &mut Self::State, input: T) -> T;
}

/// No volt or micrometre is larger; with gains up to [`LARGEST_GAIN`] all products stay within `f32`.
const LARGEST_INPUT: f64 = 1e30;

/// Largest gain or coefficient a block accepts.
pub(crate) const LARGEST_GAIN: f64 = 1e6;

/// The input, or `last` where it is not finite or beyond what the arithmetic holds.
#[inline(always)]
pub(crate) fn admit<T: Real>(input: T, last: T) -> T {
    // A NaN fails the comparison.
    if input.magnitude() <= T::from_f64(LARGEST_INPUT) {
        input
    } else {
        last
    }
}
