//! The rig, before any physics: what converters, clocks, cables and files do to a recording.
//!
//! [`inspect()`] says all of it, [`mistakes`] where a lab has erred, [`noise_floor`] the sensor's noise alone, [`clipped_at`] where
//! readings are clipped. No figure rests on a model of the stage.
#![forbid(unsafe_code)]

mod alike;
mod clocks;
mod codes;
mod comb;
mod drive;
mod ends;
mod inspect;
pub mod noise;
mod octaves;
mod plain;
pub mod report;
mod resolution;
mod rests;
mod tones;
mod turns;

pub use ends::clipped_at;
pub use inspect::{inspect, mistakes};
pub use noise::{Basis, NoiseFloor, NoiseSource, noise_floor};
pub use report::{Channel, Figure, Finding, Following, Kind, Quantity, Report, Resolution, Unit};

/// Largest minus smallest; 0 of an empty series.
pub(crate) fn span(values: &[f64]) -> f64 {
    let (low, high) = range(values);
    if high > low { high - low } else { 0.0 }
}

/// Smallest and largest.
pub(crate) fn range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| {
            (low.min(v), high.max(v))
        })
}

/// The middle value; 0 of an empty series.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
