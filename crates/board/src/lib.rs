//! Processor in the loop: the firmware's image in QEMU against the simulated stage, a code each way a tick, in virtual time.
#![forbid(unsafe_code)]

mod ahead;
pub mod budget;
pub mod capture;
mod datagrams;
mod emulator;
pub mod flash;
pub mod host;
pub mod image;
mod learned;
pub mod live;
mod player;
pub mod rig;
pub mod scope;
pub mod served;
pub mod shapes;
pub mod slots;
pub mod telemetry;
pub mod two_axes;
pub mod upload;

pub use hysteron_firmware::law::Law;
pub use hysteron_firmware::learned::Learned;
pub use hysteron_firmware::monitor::Fault;
pub use hysteron_firmware::parameters::Parameters;
pub use hysteron_firmware::trajectory::{Shape, TABLE_POINTS};
pub use hysteron_firmware::tuning::Change;
pub use hysteron_firmware::wire::{Hello, Mode, Setup, Summary};
pub use player::{Played, Player};
pub use rig::{Bench, Recording, Remembering, Rig, drive_here};

use emulator::Emulator;
use hysteron_firmware::wire::{FRAME_BYTES, Frame, HELLO_BYTES, Input, MAGIC, SUMMARY_BYTES};
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
    /// A file that is no image of a board.
    #[error(
        "{}: no image of a board of this version; cargo xtask firmware release makes those of both boards",
        .0.display()
    )]
    NoBoardsImage(PathBuf),
    /// No program that writes flash.
    #[error("cannot start probe-rs: {source}; install it: cargo install probe-rs-tools --locked")]
    NoWriter {
        /// What the system said.
        source: std::io::Error,
    },
    /// A writer of flash that failed.
    #[error("probe-rs has not written the image ({ended}); its reason stands above")]
    NotWritten {
        /// How it ended.
        ended: std::process::ExitStatus,
    },
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
    /// A bank that the image has not.
    #[error(
        "bank {bank}: the image has {banks} (0 to {}); build one with more tables: cargo xtask firmware build A.toml B.toml",
        banks - 1
    )]
    NoBank {
        /// What was asked for.
        bank: u8,
        /// Tables of the image.
        banks: usize,
    },
    /// A change that the board did not take.
    #[error("the board refused, at tick {tick}, {what}; the loop was not started")]
    Refused {
        /// The tick that said so.
        tick: u32,
        /// The change.
        what: &'static str,
    },
    /// A change that the board says nothing of.
    #[error(
        "the board did not answer when it was asked for {what}; the loop was not started. Is it this version's firmware?"
    )]
    NoAnswer {
        /// The change.
        what: &'static str,
    },
    /// A line of a reference that is no position.
    #[error("line {line}: `{found}` is no position in micrometres; a reference is a file with one number a line")]
    Point {
        /// Its number, from 1.
        line: usize,
        /// What is there.
        found: String,
    },
    /// A reference of another length than the board's table.
    #[error("a reference has {TABLE_POINTS} points, one a line; here are {found}")]
    Points {
        /// Points that there are.
        found: usize,
    },
    /// A reference that stands still.
    #[error("all points of the reference are {um} um; give one that moves")]
    Flat {
        /// Where.
        um: f64,
    },
    /// The image computes something else than the same application here.
    #[error(
        "the image's frame {tick} is not the one that the same application computes here; the image has another table or is of \
         another version"
    )]
    Differs {
        /// Its number.
        tick: u32,
    },
    /// No sources to build an image from.
    #[error("{}: no sources of the firmware; run this in the repository's folder, or say where its firmware/ is", .0.display())]
    NoFirmware(PathBuf),
    /// An image that cannot be built.
    #[error("the image cannot be built (rustup target add thumbv7em-none-eabihf?):\n{0}")]
    Build(String),
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
    /// A source of telemetry that cannot be read.
    #[error(
        "{from}: {source}; give a file or device that is there, HOST:PORT of a server of the board's RTT channel 1, or udp://HOST:PORT of a board on a cable"
    )]
    Source {
        /// What was asked for.
        from: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// A second axis that there is not.
    #[error("the board has one axis; for a second one build an image of both (docs/boards/)")]
    OneAxis,
    /// A stage of one axis at an image of both.
    #[error("the image is of both axes; name the second one's stage as well, or take an image of one axis")]
    TwoAxes,
    /// A board that does not answer an upload.
    #[error(
        "{to}: no answer to {what}; is the board running, is this its RTT channel 1, and does its image have slots (one axis, this \
         version)? The table in use is still whole"
    )]
    NotHeard {
        /// What was asked for.
        to: String,
        /// What was sent.
        what: &'static str,
    },
    /// A table that a board refuses.
    #[error("{to} refuses the table and keeps the one that it has: {refused}")]
    TableRefused {
        /// The board.
        to: String,
        /// Why.
        refused: slots::Refused,
    },
    /// A source that takes no orders.
    #[error("{0}: a file takes no orders; give HOST:PORT of a server, or start the loop by the board's button")]
    NotAsked(String),
    /// A run that was ended.
    #[error("the run was ended after {0} ticks")]
    Ended(u32),
    /// A connection that is over.
    #[error("the connection to the board is over: {0}; connect again")]
    Over(String),
    /// A recording that is under way.
    #[error("a recording is under way or a change waits for its answer; wait for it or end it")]
    Taking,
    /// A board that has not described itself.
    #[error("the board has not described all of its tables yet, which it does every 0.2 s; ask again")]
    Undescribed,
    /// A source that says nothing.
    #[error(
        "{from}: nothing came for 5 s; is the board running, and is this its RTT channel 1 (the log is channel 0)?"
    )]
    Silent {
        /// What was asked for.
        from: String,
    },
    /// A stream without a board's samples.
    #[error("no sample in {bytes} bytes; this is not the telemetry (RTT channel 1) of this version's firmware")]
    NoSamples {
        /// Bytes of no packet.
        bytes: u64,
    },
    /// Samples of nobody knows what.
    #[error(
        "{samples} samples came and no description of the board, which it sends every 8192 samples; record for longer"
    )]
    NoAbout {
        /// Samples that came.
        samples: u64,
    },
    /// Another board or table than the stream began with.
    #[error("board or table changed within the stream; record each by itself")]
    OtherBoard,
    /// A description that passes its checksum and makes no sense.
    #[error("the board's {0} make no sense; build and flash its image anew")]
    Senseless(&'static str),
    /// More gaps than samples are worth.
    #[error(
        "of {} ticks {lost} are lost, in more than a thousand places; the connection is too slow or disturbed: a faster \
         probe, a shorter cable, no other traffic",
        samples + lost
    )]
    Shreds {
        /// Samples that came.
        samples: u64,
        /// Samples that did not.
        lost: u64,
    },
    /// A table that does not run.
    #[error(transparent)]
    Table(#[from] hysteron_table::TableError),
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
    /// What a period of the reference looks like.
    pub shape: Shape,
    /// Frequency of the reference, hertz.
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
    /// What the image said of the table that ran.
    pub hello: Hello,
    /// What it was asked for.
    pub setup: Setup,
    /// Timing, by the board's own timers.
    pub summary: Summary,
    /// Instructions in one of their counts.
    pub instructions_a_count: u64,
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
        let [low_um, high_um] = self.range_um.unwrap_or_else(|| whole_range_um(hello));
        within("frequency, hertz", self.frequency_hz, 1e-3, rate_hz / 10.0)?;
        within("lowest reference, micrometres", low_um, min, max)?;
        within("highest reference, micrometres", high_um, low_um, max)?;
        within("ticks", self.seconds * rate_hz, 2.0, MOST_TICKS)?;
        Ok(Setup {
            ticks: (self.seconds * rate_hz).round() as u32 + FALL_TICKS,
            shape: self.shape,
            phase_step: (self.frequency_hz / rate_hz * 4_294_967_296.0).round() as u32,
            low_um: low_um as f32,
            high_um: high_um as f32,
            feedforward: self.feedforward,
            feedback: self.feedback,
            clocked: true,
        })
    }
}

/// A table's range less [`INSET`] at either end, micrometres.
pub fn whole_range_um(hello: &Hello) -> [f64; 2] {
    let (min, max) = (f64::from(hello.input_min_um), f64::from(hello.input_max_um));
    let inset = INSET * (max - min);
    [min + inset, max - inset]
}

fn within(name: &'static str, value: f64, min: f64, max: f64) -> Result<(), BoardError> {
    // A NaN fails both comparisons.
    if value >= min && value <= max {
        return Ok(());
    }
    Err(BoardError::Setup { name, value, min, max })
}

fn same_rate(stage_hz: f64, table: &Hello) -> Result<(), BoardError> {
    let table_hz = f64::from(table.sample_rate_hz);
    match (stage_hz / table_hz - 1.0).abs() <= 1e-6 {
        true => Ok(()),
        false => Err(BoardError::OtherRate { stage_hz, table_hz }),
    }
}

/// Instructions in a count of the board's timers, 40 ns, at so many nanoseconds an instruction, as a power of two.
const fn instructions_a_count(shift: u8) -> u64 {
    40 >> shift
}

/// An instruction is 8 ns of virtual time: 2500 in the 20 us of a tick.
const SHIFT: u8 = 3;

/// An image in QEMU, for any number of runs.
pub struct Session {
    emulator: Emulator,
    /// Of every bank; at least one.
    banks: Vec<Hello>,
}

/// What an image says first of its tables, or of those of one axis.
fn banks(emulator: &mut Emulator) -> Result<Vec<Hello>, BoardError> {
    let mut banks: Vec<Hello> = Vec::new();
    loop {
        let mut said = [0; HELLO_BYTES];
        let (version, rest) = said.split_at_mut(MAGIC.len());
        // Another version's hello may be shorter: waiting for the rest of it would take all of the patience.
        let read = emulator.from_board.read_exact(version);
        read.map_err(|source| broken(emulator, 0, source))?;
        if version != MAGIC {
            return Err(BoardError::OtherVersion);
        }
        let read = emulator.from_board.read_exact(rest);
        read.map_err(|source| broken(emulator, 0, source))?;
        let hello = Hello::from_bytes(&said).ok_or(BoardError::OtherVersion)?;
        let first = banks.first().unwrap_or(&hello);
        if usize::from(hello.bank) != banks.len() || hello.banks != first.banks || hello.bank >= hello.banks {
            return Err(BoardError::OtherVersion);
        }
        banks.push(hello);
        if banks.len() == usize::from(hello.banks) {
            return Ok(banks);
        }
    }
}

impl Session {
    /// Starts an image; the emulator is ended `patience` later, or when this is dropped.
    ///
    /// # Errors
    /// No image or no emulator, an image that says nothing or not what this version understands.
    pub fn start(machine: Machine, image: &Path, patience: Duration) -> Result<Self, BoardError> {
        if !image.is_file() {
            return Err(BoardError::NoImage(image.to_owned()));
        }
        let mut emulator = Emulator::start(machine, image, SHIFT, patience)?;
        let banks = banks(&mut emulator)?;
        match banks[0].axes {
            1 => Ok(Self { emulator, banks }),
            _ => Err(BoardError::TwoAxes),
        }
    }

    /// What the image said of the table that it begins with, bank 0.
    pub fn hello(&self) -> &Hello {
        &self.banks[0]
    }

    /// What it said of each of its tables, from bank 0 on.
    pub fn banks(&self) -> &[Hello] {
        &self.banks
    }

    /// Runs it against a bench. Each tick the image gets a code and an order and answers with a frame; virtual time stands still
    /// during the exchange.
    ///
    /// # Errors
    /// A bench of another rate than the table's, an exchange that breaks off.
    pub fn run(
        &mut self,
        setup: &Setup,
        bench: &mut dyn Bench,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Summary, BoardError> {
        same_rate(bench.sample_rate_hz(), self.hello())?;
        let mut ticks = 0;
        exchange(&mut self.emulator, setup, bench, &mut ticks, progress).map_err(|failed| match failed {
            Broken::Wire(source) => broken(&self.emulator, ticks, source),
            Broken::Said(error) => error,
        })
    }

    /// Runs it on inputs that are known, which it gets ahead of their ticks: the frames that it answers with, and the summary.
    ///
    /// Where the inputs are what a bench answered to the same frames, tick by tick, this computes what the run against that bench
    /// computes. Nobody waits for the other; a setup that is not `clocked` does not wait for the sample clock either, and its summary
    /// has no times.
    ///
    /// # Errors
    /// An exchange that breaks off.
    pub fn replay(&mut self, setup: &Setup, inputs: &[Input]) -> Result<(Vec<Frame>, Summary), BoardError> {
        let setup = Setup {
            ticks: u32::try_from(inputs.len()).unwrap_or(u32::MAX),
            ..*setup
        };
        self.exchange_all(&setup, inputs)
    }

    /// Runs an image that has its stage within (`firmware/mps2`'s `guest`) on a setup that is not `clocked`: the frames of its ticks.
    ///
    /// # Errors
    /// An exchange that breaks off.
    pub fn watch(&mut self, setup: &Setup) -> Result<Vec<Frame>, BoardError> {
        Ok(self.exchange_all(setup, &[])?.0)
    }

    /// Sends setup and inputs, and takes the frames of all ticks, neither waiting for the other.
    fn exchange_all(&mut self, setup: &Setup, inputs: &[Input]) -> Result<(Vec<Frame>, Summary), BoardError> {
        let mut bytes = setup.to_bytes().to_vec();
        bytes.extend(inputs.iter().flat_map(Input::to_bytes));
        let length = setup.ticks as usize * FRAME_BYTES;
        let exchanged = self.emulator.swap(&bytes, length + SUMMARY_BYTES);
        let answers = exchanged.map_err(|source| broken(&self.emulator, setup.ticks, source))?;
        Ok(frames_and_summary(&answers))
    }
}

/// The frames of a run in a row, and the summary behind them.
fn frames_and_summary(answers: &[u8]) -> (Vec<Frame>, Summary) {
    let (frames, summary) = answers.split_at(answers.len() - SUMMARY_BYTES);
    let mut last = [0; SUMMARY_BYTES];
    last.copy_from_slice(summary);
    let frames = frames.chunks_exact(FRAME_BYTES).map(|chunk| {
        let mut frame = [0; FRAME_BYTES];
        frame.copy_from_slice(chunk);
        Frame::from_bytes(&frame)
    });
    (frames.collect(), Summary::from_bytes(&last))
}

fn broken(emulator: &Emulator, tick: u32, source: std::io::Error) -> BoardError {
    let said = emulator.said();
    BoardError::Exchange { tick, source, said }
}

/// Runs an image in QEMU against a bench, until the ticks of the request and [`FALL_TICKS`] are over.
///
/// # Errors
/// As [`Session::start`], [`Request::setup`] and [`Session::run`].
pub fn drive(
    machine: Machine,
    image: &Path,
    request: &Request,
    bench: &mut dyn Bench,
    patience: Duration,
    progress: &mut dyn FnMut(f64),
) -> Result<Outcome, BoardError> {
    let mut session = Session::start(machine, image, patience)?;
    let setup = request.setup(session.hello())?;
    let summary = session.run(&setup, bench, progress)?;
    let hello = *session.hello();
    Ok(Outcome {
        hello,
        setup,
        summary,
        instructions_a_count: instructions_a_count(SHIFT),
    })
}

/// As [`drive`], against a simulated stage: changes at the safe level, start, the request, stop, and what was recorded from the start on.
///
/// The request is one of the table of the last [`Change::Bank`], or of bank 0.
///
/// # Errors
/// As [`drive`]; a bank that the image has not, a change that it refuses.
pub fn run(
    machine: Machine,
    image: &Path,
    stage: Stage,
    (request, changes): (&Request, &[Change]),
    patience: Duration,
    progress: &mut dyn FnMut(f64),
) -> Result<(Outcome, Recording), BoardError> {
    let mut session = Session::start(machine, image, patience)?;
    let bank = changes.iter().rev().find_map(|change| match change {
        Change::Bank(bank) => Some(*bank),
        _ => None,
    });
    let (bank, banks) = (bank.unwrap_or(0), session.banks().len());
    let Some(&hello) = session.banks().get(usize::from(bank)) else {
        return Err(BoardError::NoBank { bank, banks });
    };
    let mut rig = Rig::new(stage, request.seconds).after(changes);
    let setup = request.setup(&hello)?;
    let setup = Setup {
        ticks: setup.ticks + rig.changing_ticks(),
        ..setup
    };
    let summary = session.run(&setup, &mut rig, progress)?;
    if let Some((tick, what)) = rig.refused() {
        return Err(BoardError::Refused { tick, what });
    }
    let outcome = Outcome {
        hello,
        setup,
        summary,
        instructions_a_count: instructions_a_count(SHIFT),
    };
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
    setup: &Setup,
    bench: &mut dyn Bench,
    ticks: &mut u32,
    progress: &mut dyn FnMut(f64),
) -> Result<Summary, Broken> {
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
        if bench.over() {
            return Err(BoardError::Ended(*ticks).into());
        }
        if wanted % 1024 == 0 {
            progress(f64::from(wanted) / f64::from(setup.ticks));
        }
    }
    let mut summary = [0; SUMMARY_BYTES];
    emulator.from_board.read_exact(&mut summary)?;
    Ok(Summary::from_bytes(&summary))
}
