//! Runs of the core's control law on the simulated stage, and the paper's experiments made of them.
//!
//! Data flows one way: a [`hysteron_identify::Model`] becomes a table of the core, [`run::track`] lets the core's
//! `ControlLaw` drive a `hysteron_plant::Stage` sample by sample, [`figures`] and [`response`] judge the run. The control
//! law is the code that runs on the chip; here in `f64`, so that a figure of a run is one of the method and not of
//! rounding (the chip's `f32` adds some 1e-6 of the stroke, below a step of the converters).
#![forbid(unsafe_code)]

pub mod bench;
pub mod campaign;
pub mod complete;
pub mod design;
pub mod drive;
pub mod error;
pub mod expected;
pub mod experiment;
pub mod figures;
pub mod formulas;
pub mod learning;
pub mod on_model;
pub mod paper;
pub mod process;
pub mod reference;
pub mod rehearsal;
pub mod response;
pub mod robustness;
pub mod run;
pub mod scans;
pub mod usable;

pub use error::TrackingError;
