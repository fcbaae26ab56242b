//! Two axes: their image in QEMU, the simulated stage with both, and the same here.

use crate::emulator::Emulator;
use crate::rig::adc;
use crate::{
    BoardError, Machine, Outcome, Recording, Request, banks, broken, frames_and_summary, instructions_a_count,
    same_rate,
};
use hysteron_firmware::law::Law;
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::two_axes::TwoAxes;
use hysteron_firmware::wire::{FRAME_BYTES, Frame, Hello, Input, Order, SUMMARY_BYTES, Setup, Summary};
use hysteron_plant::{CrossCoupling, Stage, StageConfig, StageError};
use std::io::{Read, Write};
use std::path::Path;
use std::time::Duration;

/// A stage of two axes: each is moved by a share of the other's motion.
#[derive(Debug, Clone)]
pub struct TwoAxisRig {
    stages: [Stage; 2],
    /// What each axis and the board did.
    pub recordings: [Recording; 2],
    /// Where each axis was at each tick, micrometres; a real one does not say.
    pub true_um: [Vec<f64>; 2],
    stop_at: u32,
}

impl TwoAxisRig {
    /// As [`coupled`]. Starts at the first tick, stops after so many seconds.
    ///
    /// # Errors
    /// As [`coupled`].
    pub fn new(axes: [&StageConfig; 2], shares: [f64; 2], seed: u64, seconds: f64) -> Result<Self, StageError> {
        Ok(Self {
            stages: coupled(axes, shares, seed)?,
            recordings: [Recording::default(), Recording::default()],
            true_um: [Vec::new(), Vec::new()],
            stop_at: (seconds / axes[0].sample_period_s).round() as u32,
        })
    }
}

/// Two stages that know nothing of each other become one: `shares[0]` of the second's motion reaches the first, `shares[1]` the other way.
///
/// # Errors
/// Stages that cannot be built, or shares beyond what couples.
pub fn coupled([x, y]: [&StageConfig; 2], shares: [f64; 2], seed: u64) -> Result<[Stage; 2], StageError> {
    let beside = |config: &StageConfig, other: &StageConfig, ratio| StageConfig {
        cross_coupling: Some(CrossCoupling {
            ratio,
            lag_s: other.amplifier.lag_s,
            hysteresis: other.hysteresis.clone(),
            mode: other.modes.first().copied(),
        }),
        ..config.clone()
    };
    Ok([
        Stage::new(&beside(x, y, shares[0]), seed)?,
        Stage::new(&beside(y, x, shares[1]), seed.wrapping_add(1))?,
    ])
}

/// The other side of both axes' converters.
pub trait TwoAxisBench {
    /// The codes of a tick; the first one's order is for both.
    fn inputs(&mut self, number: u32) -> [Input; 2];
    /// Takes the codes that answer them.
    fn outputs(&mut self, frames: &[Frame; 2]);
}

impl TwoAxisBench for TwoAxisRig {
    fn inputs(&mut self, number: u32) -> [Input; 2] {
        let order = match number {
            0 => Order::Start,
            n if n == self.stop_at => Order::Stop,
            _ => Order::None,
        };
        let mut inputs = [Input::default(); 2];
        for (stage, true_um) in self.stages.iter().zip(&mut self.true_um) {
            true_um.push(stage.sample().true_position_um);
        }
        for ((stage, recording), input) in self.stages.iter().zip(&mut self.recordings).zip(&mut inputs) {
            let adc = adc(stage);
            recording.adc.push(adc);
            recording.position_um.push(stage.sample().position_um);
            *input = Input { adc, order };
        }
        inputs
    }

    fn outputs(&mut self, frames: &[Frame; 2]) {
        let mut voltages_v = [0.0; 2];
        for ((stage, frame), voltage_v) in self.stages.iter().zip(frames).zip(&mut voltages_v) {
            *voltage_v = stage.v_from_code(u32::from(frame.dac));
        }
        let [x_v, y_v] = voltages_v;
        self.stages[0].step_two_axes(x_v, y_v);
        self.stages[1].step_two_axes(y_v, x_v);
        for ((recording, frame), voltage_v) in self.recordings.iter_mut().zip(frames).zip(voltages_v) {
            recording.voltage_v.push(voltage_v);
            recording.frames.push(*frame);
        }
    }
}

/// Both axes of the application against the stage, in this process.
pub fn drive_both_here<X: Law, Y: Law>(axes: &mut TwoAxes<X, Y>, ticks: u32, bench: &mut dyn TwoAxisBench) {
    for number in 0..ticks {
        let inputs = bench.inputs(number);
        bench.outputs(&axes.step(inputs, false));
    }
}

/// An instruction is 4 ns of virtual time, 5000 in the 20 us of a tick: two complete laws with every effect, monitors and references take
/// more than the 2500 that the image of one axis has.
const SHIFT: u8 = 2;

/// An image of two axes in QEMU, for any number of runs.
pub struct TwoAxisSession {
    emulator: Emulator,
    banks: [Vec<Hello>; 2],
}

impl TwoAxisSession {
    /// As [`crate::Session::start`].
    ///
    /// # Errors
    /// No image or no emulator, an image that says nothing or not what this version understands.
    pub fn start(machine: Machine, image: &Path, patience: Duration) -> Result<Self, BoardError> {
        if !image.is_file() {
            return Err(BoardError::NoImage(image.to_owned()));
        }
        let mut emulator = Emulator::start(machine, image, SHIFT, patience)?;
        let of_x = banks(&mut emulator)?;
        if of_x[0].axes == 1 {
            return Err(BoardError::OneAxis);
        }
        let banks = [of_x, banks(&mut emulator)?];
        Ok(Self { emulator, banks })
    }

    /// What the image said of each axis' tables, from bank 0 on.
    pub fn banks(&self) -> &[Vec<Hello>; 2] {
        &self.banks
    }

    /// Runs both axes against the stage, a pair of codes each way a tick: by the sample clock where the first setup is `clocked`, and the
    /// times that it then takes.
    ///
    /// # Errors
    /// An exchange that breaks off, or a frame that is missing.
    pub fn run(
        &mut self,
        setups: &[Setup; 2],
        bench: &mut dyn TwoAxisBench,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Summary, BoardError> {
        let emulator = &mut self.emulator;
        let sent = setups.map(|setup| setup.to_bytes());
        let begun = emulator.to_board.write_all(sent.as_flattened());
        begun.map_err(|source| broken(emulator, 0, source))?;
        let mut answers = [[0; FRAME_BYTES]; 2];
        for wanted in 0..setups[0].ticks {
            let asked = bench.inputs(wanted).map(|input| input.to_bytes());
            let exchanged = emulator
                .to_board
                .write_all(asked.as_flattened())
                .and_then(|()| emulator.from_board.read_exact(answers.as_flattened_mut()));
            exchanged.map_err(|source| broken(emulator, wanted, source))?;
            let frames = answers.map(|bytes| Frame::from_bytes(&bytes));
            if let Some(frame) = frames.iter().find(|frame| frame.number != wanted) {
                let got = frame.number;
                return Err(BoardError::LostFrame { got, wanted });
            }
            bench.outputs(&frames);
            if wanted % 1024 == 0 {
                progress(f64::from(wanted) / f64::from(setups[0].ticks));
            }
        }
        let mut summary = [0; SUMMARY_BYTES];
        let read = emulator.from_board.read_exact(&mut summary);
        read.map_err(|source| broken(emulator, setups[0].ticks, source))?;
        Ok(Summary::from_bytes(&summary))
    }

    /// Runs both axes on pairs of inputs that are known, which they get ahead of their ticks; the setups are not `clocked`: the pairs of
    /// frames that they answer with, in a row.
    ///
    /// # Errors
    /// An exchange that breaks off.
    pub(crate) fn replay(&mut self, setups: &[Setup; 2], inputs: &[Input]) -> Result<Vec<Frame>, BoardError> {
        let mut bytes = setups.map(|setup| setup.to_bytes()).concat();
        bytes.extend(inputs.iter().flat_map(Input::to_bytes));
        let exchanged = self.emulator.swap(&bytes, inputs.len() * FRAME_BYTES + SUMMARY_BYTES);
        let answers = exchanged.map_err(|source| broken(&self.emulator, setups[0].ticks, source))?;
        Ok(frames_and_summary(&answers).0)
    }
}

/// As [`crate::run`], of both axes: start, the request of the first axis and beside it a sine of the second over its table's range, stop.
/// Without a frequency the second stands still. What they did is in the rig's recordings, from the start on.
///
/// # Errors
/// As [`TwoAxisSession::start`], [`Request::setup`] and [`TwoAxisSession::run`]; stages of another rate than the tables'.
pub fn run_both(
    machine: Machine,
    image: &Path,
    rig: &mut TwoAxisRig,
    (request, beside_hz): (&Request, Option<f64>),
    patience: Duration,
    progress: &mut dyn FnMut(f64),
) -> Result<[Outcome; 2], BoardError> {
    let mut session = TwoAxisSession::start(machine, image, patience)?;
    let hellos = session.banks().each_ref().map(|banks| banks[0]);
    for (stage, hello) in rig.stages.iter().zip(&hellos) {
        same_rate(1.0 / stage.config().sample_period_s, hello)?;
    }
    let beside = Request {
        shape: Shape::Sine,
        frequency_hz: beside_hz.unwrap_or(request.frequency_hz),
        range_um: None,
        ..*request
    };
    let [x, y] = [request.setup(&hellos[0])?, beside.setup(&hellos[1])?];
    // A phase that does not go on is a reference that stands still.
    let phase_step = beside_hz.map_or(0, |_| y.phase_step);
    let setups = [x, Setup { phase_step, ..y }];
    let summary = session.run(&setups, rig, progress)?;
    Ok([0, 1].map(|axis| Outcome {
        hello: hellos[axis],
        setup: setups[axis],
        summary,
        instructions_a_count: instructions_a_count(SHIFT),
    }))
}
