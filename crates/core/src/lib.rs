//! Play operators, hysteresis models and controllers: the code of the 50 kHz step.
//!
//! One algorithm a file. Configuration (immutable, validated when built) and state (`Default`-like, resettable) are
//! separate types. A step is total: it returns a finite number for every input.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod envelope;
pub mod play;
pub mod real;
