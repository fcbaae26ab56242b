//! Noise floor, comparison of model and measurement, where the model fails: numbers only; words and pictures are made
//! in the report and on the command line.
#![forbid(unsafe_code)]

pub mod comparison;

pub use comparison::{
    Bin, Breakdown, Comparison, ErrorMap, NoiseFloor, NoiseSource, Pooled, RecordComparison, Series, Spectrum,
};
