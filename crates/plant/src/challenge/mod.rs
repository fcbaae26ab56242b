//! Cases with a hidden effect: a random stage, a user's fifteen records of it, and the truth, for tests, for learning, for teaching.
//!
//! [`generate`] draws a stage (hysteresis family, stroke, sensor, laboratory) from a seed, hides the effects asked for in it at the strength asked for, and
//! plays the same kind of programme that a user would. Effects of the catalogue are those of [`crate::StageConfig`]; effects outside of it ([`Effect::is_outside`])
//! exist only here.

mod case;
mod contribution;
mod effect;
mod forms;
mod laboratory;
mod outside;
mod programme;
mod readout;
mod waves;

pub use case::{Case, CaseRecord, Hidden, Parameter, Spec, Start, Truth, Use, generate};
pub use effect::{Asked, CATALOGUE, Effect, OUTSIDE, Strength};
pub use laboratory::StageFamily;
