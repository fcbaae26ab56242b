//! The control application, generic over a small [`Board`]: trajectory, one call of the core a tick, the wire to the host.
//!
//! The same source runs on the chip and, in tests, on the host.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod axes;
pub mod button;
pub mod chips;
pub mod controller;
pub mod kept;
pub mod law;
pub mod learned;
pub mod monitor;
#[cfg(feature = "network")]
pub mod network;
pub mod parameters;
pub mod small_stage;
pub mod start;
pub mod stored;
pub mod table;
pub mod table_y;
pub mod telemetry;
pub mod trajectory;
pub mod tuning;
pub mod two_axes;
pub mod upload;
pub mod watch;
pub mod wire;

use axes::Axes;
use hysteron_core::codes::DacCode;
use monitor::Fault;
use wire::{Frame, Input};

/// What the application needs of a board with the converters of `N` axes.
pub trait Board<const N: usize> {
    /// The positions' codes of this tick, and with the first an order of the host's if there is one.
    fn read(&mut self) -> [Input; N];
    /// Whether the tick before ended after the edge of this one.
    fn late(&self) -> bool;
    /// Whether the supply is what the chip and the converters need.
    fn supplied(&self) -> bool;
    /// Sets the outputs, and hands the tick's frames to the host.
    fn write(&mut self, codes: [DacCode; N], frames: &[Frame; N]);
}

/// The body of the converter's interrupt: convert, one call of the core, convert.
#[inline(always)]
pub fn tick<const N: usize, B: Board<N>, A: Axes<N>>(board: &mut B, axes: &mut A) {
    let inputs = board.read();
    if !board.supplied() {
        axes.trip(Fault::Supply);
    }
    let frames = axes.step(inputs, board.late());
    board.write(frames.map(|frame| DacCode(frame.dac)), &frames);
}
