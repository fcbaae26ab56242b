//! What is seen without a hysteresis model: dead bands, rings after steps, lines of the mains, rests; and what an error goes with.

pub(crate) mod dead_band;
mod filters;
pub(crate) mod hum;
mod lines;
pub(crate) mod locks;
#[cfg(test)]
mod made;
pub(crate) mod rails;
mod regression;
pub(crate) mod ringing;
mod sample_clock;
pub(crate) mod structure;
pub(crate) mod traces;
pub(crate) mod where_it_fails;
