//! Runs whose answers are worked out beforehand, so that nobody waits for the other: some microseconds a tick instead of 200.

use crate::{Bench, BoardError, Session, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Law;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::wire::{Frame, Input, Setup};

impl Session {
    /// Runs the image against a bench, as [`Session::run`] without the sample clock: the same application runs here first, on the
    /// image's own `parameters`, and the image is given what the bench answered to that.
    ///
    /// What the bench has recorded is what it would have recorded in an exchange tick by tick, because every frame of the image is
    /// compared with the one that the bench was given; a single bit that differs is an error.
    ///
    /// # Errors
    /// An exchange that breaks off, or a frame that differs.
    ///
    /// # Cost
    /// Of a plain table some 3 us a tick, of a complete law some 10, and what the bench takes.
    pub fn run_ahead<L: Law>(
        &mut self,
        setup: &Setup,
        parameters: Parameters<L>,
        bench: &mut dyn Bench,
    ) -> Result<(), BoardError> {
        let setup = Setup {
            clocked: false,
            ..*setup
        };
        let mut watched = Watched {
            bench,
            inputs: Vec::with_capacity(setup.ticks as usize),
            frames: Vec::with_capacity(setup.ticks as usize),
        };
        drive_here(&mut Controller::new(parameters, &setup), setup.ticks, &mut watched);
        let Watched { inputs, frames, .. } = watched;
        let (answers, _) = self.replay(&setup, &inputs)?;
        let differs = frames
            .iter()
            .zip(&answers)
            .find(|(here, board)| here.to_bytes() != board.to_bytes());
        match differs {
            Some((here, _)) => Err(BoardError::Differs { tick: here.number }),
            None => Ok(()),
        }
    }
}

/// Remembers what a bench gave and was given.
struct Watched<'a> {
    bench: &'a mut dyn Bench,
    inputs: Vec<Input>,
    frames: Vec<Frame>,
}

impl Bench for Watched<'_> {
    fn sample_rate_hz(&self) -> f64 {
        self.bench.sample_rate_hz()
    }

    fn input(&mut self, number: u32) -> Input {
        let input = self.bench.input(number);
        self.inputs.push(input);
        input
    }

    fn output(&mut self, frame: &Frame) {
        self.bench.output(frame);
        self.frames.push(*frame);
    }
}
