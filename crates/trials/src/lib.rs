//! Trials of a controller on the code that runs on the chip: the firmware in QEMU at a simulated stage, or a real board at a real one.
//!
//! [`chip`] builds the images and runs them, [`on_chip`] and [`on_board`] track the references, [`campaign`] takes the records that a
//! board plays, [`recording`] makes datasets of what the firmware did, [`rehearsal`] goes the whole way on a stage with something hidden in it. Options come as numbers, progress goes to a
//! function of the caller's.
#![forbid(unsafe_code)]

mod adapted;
pub mod campaign;
pub mod chip;
mod error;
mod learning;
pub mod on_board;
pub mod on_chip;
mod programme;
pub mod recording;
pub mod rehearsal;
mod scans;
mod small_signals;

pub use error::TrialError;
pub use learning::board_points;
