//! The control application, generic over a small [`Board`]: trajectory, one call of the core a tick, the wire to the host.
//!
//! The same source runs on the chip and, in tests, on the host.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod controller;
pub mod parameters;
pub mod table;
pub mod trajectory;
pub mod wire;

use controller::Controller;
use hysteron_core::bank::PlayState;
use hysteron_core::codes::{AdcCode, DacCode};
use hysteron_core::model::Hysteresis;
use wire::Frame;

/// What the application needs of a board.
pub trait Board {
    /// The position's code of this tick.
    fn read_adc(&mut self) -> AdcCode;
    /// Sets the output, and hands the tick's frame to the host.
    fn write_dac(&mut self, code: DacCode, frame: &Frame);
}

/// The body of the converter's interrupt: convert, one call of the core, convert.
#[inline(always)]
pub fn tick<B, I, const N: usize>(board: &mut B, controller: &mut Controller<I, N>)
where
    B: Board,
    I: Hysteresis<f32, State = PlayState<f32, N>>,
{
    let position = board.read_adc();
    let frame = controller.step(position);
    board.write_dac(DacCode(frame.dac), &frame);
}
