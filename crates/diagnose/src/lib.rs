//! Noise floor, comparison of model and measurement, where the model fails: numbers only; words and pictures are made
//! in the report and on the command line.
#![forbid(unsafe_code)]

mod breakdown;
pub mod compare;
pub mod comparison;
pub mod diagnosis;
mod error_map;
mod missing;
pub mod noise;
mod region;
mod spectrum;

pub use compare::compare;
pub use comparison::{
    Bin, Breakdown, Comparison, ErrorMap, NoiseFloor, NoiseSource, Pooled, RecordComparison, Series, Spectrum,
};
pub use missing::diagnose;
pub use region::{GoesWith, Region, region};
