//! Runs whose answers are worked out beforehand, so that nobody waits for the other: some microseconds a tick instead of 200.

use crate::two_axes::{TwoAxisBench, TwoAxisSession, drive_both_here};
use crate::{Bench, BoardError, Session, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Law;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::two_axes::TwoAxes;
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
        let setup = unclocked(setup);
        let mut watched = Watched::new(bench, setup.ticks as usize);
        drive_here(&mut Controller::new(parameters, &setup), setup.ticks, &mut watched);
        let Watched { inputs, frames, .. } = watched;
        same(&frames, &self.replay(&setup, &inputs)?.0)
    }
}

impl TwoAxisSession {
    /// As [`Session::run_ahead`], for both axes.
    ///
    /// # Errors
    /// An exchange that breaks off, or a frame that differs.
    pub fn run_ahead<X: Law, Y: Law>(
        &mut self,
        setups: &[Setup; 2],
        (x, y): (Parameters<X>, Parameters<Y>),
        bench: &mut dyn TwoAxisBench,
    ) -> Result<(), BoardError> {
        let setups = setups.each_ref().map(unclocked);
        let mut axes = TwoAxes::new(Controller::new(x, &setups[0]), Controller::new(y, &setups[1]));
        let mut watched = Watched::new(bench, 2 * setups[0].ticks as usize);
        drive_both_here(&mut axes, setups[0].ticks, &mut watched);
        let Watched { inputs, frames, .. } = watched;
        same(&frames, &self.replay(&setups, &inputs)?)
    }
}

fn unclocked(setup: &Setup) -> Setup {
    Setup {
        clocked: false,
        ..*setup
    }
}

fn same(frames: &[Frame], answers: &[Frame]) -> Result<(), BoardError> {
    let mut pairs = frames.iter().zip(answers);
    match pairs.find(|(here, board)| here.to_bytes() != board.to_bytes()) {
        Some((here, _)) => Err(BoardError::Differs { tick: here.number }),
        None => Ok(()),
    }
}

/// Remembers what a bench gave and was given; of two axes in turn.
struct Watched<'a, B: ?Sized> {
    bench: &'a mut B,
    inputs: Vec<Input>,
    frames: Vec<Frame>,
}

impl<'a, B: ?Sized> Watched<'a, B> {
    fn new(bench: &'a mut B, answers: usize) -> Self {
        Self {
            bench,
            inputs: Vec::with_capacity(answers),
            frames: Vec::with_capacity(answers),
        }
    }
}

impl TwoAxisBench for Watched<'_, dyn TwoAxisBench + '_> {
    fn inputs(&mut self, number: u32) -> [Input; 2] {
        let inputs = self.bench.inputs(number);
        self.inputs.extend(inputs);
        inputs
    }

    fn outputs(&mut self, frames: &[Frame; 2]) {
        self.bench.outputs(frames);
        self.frames.extend(frames);
    }
}

impl Bench for Watched<'_, dyn Bench + '_> {
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
