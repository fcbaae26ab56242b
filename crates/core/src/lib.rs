//! Play operators, hysteresis models and controllers: the code of the 50 kHz step.
//!
//! One algorithm a file. Configuration (immutable, validated when built) and state (resettable) are separate types.
//! A step is total: it returns a finite number for every input, NaN included.
//!
//! - operators: [`play`] (eqs 1-4, 7, 8), [`envelope`] (9), [`thresholds`] (16), [`bank`]
//! - models: [`pi_model`] (5), [`mpi`] (6, 12), [`wrpi`], [`mrpi`] (10, 13), [`play_polynomial`]; see [`model`] for inverses; by
//!   [`corners`] of the input, for many plays: [`corner_mrpi`], [`corner_polynomial`]; of Duhem's kind, with its inverse: [`fading`]; either for a law: [`either_inverse`]
//! - control: [`pi_controller`] (14), [`limiter`], [`control_law`] (15), [`codes`]; the complete inverse with feedback in
//!   [`tracking_law`], made of [`preview`], [`biquad`] and the compensators beside their effects in [`effects`]; other axis, mains,
//!   heat and sensor around it in [`surroundings`]; gain and zero learned while it runs in [`adaptation`]; all of its numbers, from which host and chip build it, in [`law_numbers`]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod adaptation;
pub mod bank;
pub mod biquad;
pub mod codes;
pub mod control_law;
pub mod corner_mrpi;
pub mod corner_polynomial;
pub mod corners;
pub mod effects;
pub mod either_inverse;
pub mod envelope;
pub mod error;
pub mod fading;
pub mod law_numbers;
pub mod limiter;
pub mod model;
pub mod mpi;
pub mod mrpi;
pub mod pi_controller;
pub mod pi_model;
pub mod play;
pub mod play_polynomial;
pub mod plays_sum;
pub mod preview;
pub mod quick_mrpi;
pub mod real;
pub mod surroundings;
pub mod thresholds;
pub mod tracking_law;
pub mod trust;
pub mod wrpi;
