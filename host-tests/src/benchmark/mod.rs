//! Public benchmarks of nonlinear identification, made from their published equations: data, and a linear model beside the tool.

pub mod linear;
pub mod systems;

pub use systems::{Benchmark, System};
