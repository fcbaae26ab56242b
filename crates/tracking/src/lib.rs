//! Control laws on the simulated stage: references tracked, learned and disturbed, campaigns, scans of two axes, rehearsals.
//!
//! [`complete`] runs a designed law, [`run`] the paper's; [`bench`] compares them. The control law is the code that runs on the chip;
//! here in `f64`, so that a figure of a run is one of the method and not of rounding (the chip's `f32` adds some 1e-6 of the stroke,
//! below a step of the converters).
#![forbid(unsafe_code)]

pub mod bench;
pub mod campaign;
pub mod complete;
pub mod ends;
pub mod error;
pub mod experiment;
pub mod learning;
pub mod rehearsal;
pub mod robustness;
pub mod run;
pub mod scans;

pub use error::TrackingError;
