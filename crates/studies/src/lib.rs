//! Studies on the simulated stage: the paper redone, its rivals, the race of its particle swarm.
//!
//! [`Redone`] puts every figure of the paper beside ours, [`Rivals`] the models of its Table 1; [`paper`] and [`formulas`] have the runs
//! behind them.
#![forbid(unsafe_code)]

pub mod formulas;
pub mod paper;
mod redone;

pub use redone::{Redone, Rivals};
