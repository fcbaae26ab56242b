//! The control application, generic over a small [`Board`]: trajectory, one call of the core a tick, the wire to the host.
//!
//! The same source runs on the chip and, in tests, on the host.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod ad5683r;
pub mod chips;
pub mod controller;
pub mod kept;
pub mod law;
pub mod monitor;
pub mod parameters;
pub mod small_stage;
pub mod table;
pub mod table_y;
pub mod telemetry;
pub mod trajectory;
pub mod tuning;
pub mod two_axes;
pub mod wire;

use controller::Controller;
use hysteron_core::codes::DacCode;
use law::Law;
use wire::{Frame, Input};

/// What the application needs of a board.
pub trait Board {
    /// The position's code of this tick, and an order of the host's if there is one.
    fn read(&mut self) -> Input;
    /// Whether the tick before ended after the edge of this one.
    fn late(&self) -> bool;
    /// Sets the output, and hands the tick's frame to the host.
    fn write(&mut self, code: DacCode, frame: &Frame);
}

/// The body of the converter's interrupt: convert, one call of the core, convert.
#[inline(always)]
pub fn tick<B: Board, L: Law>(board: &mut B, controller: &mut Controller<L>) {
    let input = board.read();
    let frame = controller.step(input, board.late());
    board.write(DacCode(frame.dac), &frame);
}
