//! Processor in the loop: the firmware's image in QEMU against the simulated stage, a code each way a tick, in virtual time.
#![forbid(unsafe_code)]

mod emulator;
pub mod rig;

pub use rig::{Bench, Recording, Rig, drive_here};

use emulator::Emulator;
use hysteron_firmware::wire::{FRAME_BYTES, Frame, HELLO_BYTES, Hello, SUMMARY_BYTES, Setup, Summary};
use hysteron_plant::{Stage, StageError};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// The image is not there.
    #[error(
        "no image {}; build it: cargo xtask firmware build",
        .0.display()
    )]
    NoImage(PathBuf),
    /// A program that cannot be started.
    #[error("cannot start {program}: {source}; install it (Debian: apt-get install {package})")]
    Start {
        /// The program.
        program: &'static str,
        /// Where Debian has it.
        package: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The exchange with the image broke off.
    #[error("the image ended or stood still at tick {tick}: {source}; the emulator said: {said}")]
    Exchange {
        /// Ticks that were exchanged.
        tick: u32,
        /// What the system said.
        source: std::io::Error,
        /// What QEMU said.
        said: String,
    },
    /// The image is no image of this version.
    #[error("the image does not speak this version's protocol; build it anew: cargo xtask firmware build")]
    OtherVersion,
    /// A frame is missing.
    #[error("frame {got} came where {wanted} was due")]
    LostFrame {
        /// Its number.
        got: u32,
        /// The number that was due.
        wanted: u32,
    },
    /// A setup that makes no sense.
    #[error("{name} = {value} must lie in {min} to {max}")]
    Setup {
        /// The value's name.
        name: &'static str,
        /// The value.
        value: f64,
        /// Least allowed.
        min: f64,
        /// Most allowed.
        max: f64,
    },
    /// The stage and the table do not run at one rate.
    #[error("the stage runs at {stage_hz} Hz, the table at {table_hz} Hz; export a table for this stage")]
    OtherRate {
        /// The stage's.
        stage_hz: f64,
        /// The table's.
        table_hz: f64,
    },
    /// The simulated stage.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// Files of the exchange.
    #[error("files of the exchange: {0}")]
    Files(#[from] std::io::Error),
}

/// QEMU's boards that there are images for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Machine {
    /// Cortex-M4F.
    Mps2An386,
    /// Cortex-M7.
    Mps2An500,
}

impl Machine {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Mps2An386, Self::Mps2An500];

    /// QEMU's name, and the image's.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mps2An386 => "mps2-an386",
            Self::Mps2An500 => "mps2-an500",
        }
    }
}

/// What a run is to do; checked against what the image says of its table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Frequency of the reference, a sine, hertz.
    pub frequency_hz: f64,
    /// Lowest and highest reference, micrometres; `None` for the table's range less [`INSET`] at either end.
    pub range_um: Option<[f64; 2]>,
    /// Length, seconds of virtual time.
    pub seconds: f64,
    /// Whether the inverse runs.
    pub feedforward: bool,
    /// Whether the PI controller runs.
    pub feedback: bool,
}

/// What a run of the emulator ends with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// What the image said of itself.
    pub hello: Hello,
    /// What it was asked for.
    pub setup: Setup,
    /// Timing, by the board's own timers.
    pub summary: Summary,
}

/// Ticks after a run in which the command falls to its safe level: 20 ms for the whole range, as `hysteron export` sets it, and 2 ms.
pub const FALL_TICKS: u32 = 1100;

/// Share of the table's range left free at either end: the amplifier ends at 0 V, and an inverse that leads has to go below where
/// its records went.
pub const INSET: f64 = 0.02;

/// Longest run: 10 minutes of 50 kHz, about half a gigabyte of frames and samples.
const MOST_TICKS: f64 = 3e7;

impl Request {
    /// The setup for an image.
    ///
    /// # Errors
    /// References outside the table's input range, a frequency above a tenth of the sample rate, no or too many ticks.
    pub fn setup(&self, hello: &Hello) -> Result<Setup, BoardError> {
        let rate_hz = f64::from(hello.sample_rate_hz);
        let (min, max) = (f64::from(hello.input_min_um), f64::from(hello.input_max_um));
        let inset = INSET * (max - min);
        let [low_um, high_um] = self.range_um.unwrap_or([min + inset, max - inset]);
        within("frequency, hertz", self.frequency_hz, 1e-3, rate_hz / 10.0)?;
        within("lowest reference, micrometres", low_um, min, max)?;
        within("highest reference, micrometres", high_um, low_um, max)?;
        within("ticks", self.seconds * rate_hz, 2.0, MOST_TICKS)?;
        Ok(Setup {
            ticks: (self.seconds * rate_hz).round() as u32 + FALL_TICKS,
            phase_step: (self.frequency_hz / rate_hz * 4_294_967_296.0).round() as u32,
            low_um: low_um as f32,
            high_um: high_um as f32,
            feedforward: self.feedforward,
            feedback: self.feedback,
        })
    }
}

fn within(name: &'static str, value: f64, min: f64, max: f64) -> Result<(), BoardError> {
    // A NaN fails both comparisons.
    if value >= min && value <= max {
        return Ok(());
    }
    Err(BoardError::Setup { name, value, min, max })
}

/// Runs an image in QEMU against a bench, until the ticks of the request and [`FALL_TICKS`] are over.
///
/// Each tick the image gets a code and an order and answers with a frame. Virtual time stands still during the exchange. The emulator
/// is ended `patience` after its start.
///
/// # Errors
/// No image or no emulator, a request that the image's table does not allow, an exchange that breaks off.
pub fn drive(
    machine: Machine,
    image: &Path,
    request: &Request,
    bench: &mut dyn Bench,
    patience: Duration,
    progress: &mut dyn FnMut(f64),
) -> Result<Outcome, BoardError> {
    if !image.is_file() {
        return Err(BoardError::NoImage(image.to_owned()));
    }
    let mut emulator = Emulator::start(machine, image, patience)?;
    let mut ticks = 0;
    exchange(&mut emulator, request, bench, &mut ticks, progress).map_err(|broken| match broken {
        Broken::Wire(source) => BoardError::Exchange {
            tick: ticks,
            source,
            said: emulator.said(),
        },
        Broken::Said(error) => error,
    })
}

/// As [`drive`], against a simulated stage: start, the request, stop, and what was recorded.
///
/// # Errors
/// As [`drive`].
pub fn run(
    machine: Machine,
    image: &Path,
    stage: Stage,
    request: &Request,
    patience: Duration,
    progress: &mut dyn FnMut(f64),
) -> Result<(Outcome, Recording), BoardError> {
    let mut rig = Rig::new(stage, request.seconds);
    let outcome = drive(machine, image, request, &mut rig, patience, progress)?;
    Ok((outcome, rig.recording))
}

enum Broken {
    Wire(std::io::Error),
    Said(BoardError),
}

impl From<std::io::Error> for Broken {
    fn from(error: std::io::Error) -> Self {
        Self::Wire(error)
    }
}

impl From<BoardError> for Broken {
    fn from(error: BoardError) -> Self {
        Self::Said(error)
    }
}

fn exchange(
    emulator: &mut Emulator,
    request: &Request,
    bench: &mut dyn Bench,
    ticks: &mut u32,
    progress: &mut dyn FnMut(f64),
) -> Result<Outcome, Broken> {
    let mut said = [0; HELLO_BYTES];
    emulator.from_board.read_exact(&mut said)?;
    let hello = Hello::from_bytes(&said).ok_or(BoardError::OtherVersion)?;
    let (stage_hz, table_hz) = (bench.sample_rate_hz(), f64::from(hello.sample_rate_hz));
    if (stage_hz / table_hz - 1.0).abs() > 1e-6 {
        return Err(BoardError::OtherRate { stage_hz, table_hz }.into());
    }
    let setup = request.setup(&hello)?;
    emulator.to_board.write_all(&setup.to_bytes())?;
    let mut frame = [0; FRAME_BYTES];
    for wanted in 0..setup.ticks {
        emulator.to_board.write_all(&bench.input(wanted).to_bytes())?;
        emulator.from_board.read_exact(&mut frame)?;
        let frame = Frame::from_bytes(&frame);
        if frame.number != wanted {
            let got = frame.number;
            return Err(BoardError::LostFrame { got, wanted }.into());
        }
        bench.output(&frame);
        *ticks = wanted + 1;
        if wanted % 1024 == 0 {
            progress(f64::from(wanted) / f64::from(setup.ticks));
        }
    }
    let mut summary = [0; SUMMARY_BYTES];
    emulator.from_board.read_exact(&mut summary)?;
    let summary = Summary::from_bytes(&summary);
    Ok(Outcome { hello, setup, summary })
}
