//! Faults at the converters, in the stage and in the clock: each is noticed in time, the output falls without a step and stays down.
//!
//! 14 kinds, 75 seeded runs each, here and in the emulator: the image gets the codes and orders of the run here ahead of its ticks,
//! which do not wait for the sample clock, and has to answer with the same frames, of which each makes the next code. Late ticks by the
//! clock itself are among those of `processor_in_loop.rs`. A fifteenth kind, an interrupt that does not come back, is one
//! that only a chip can have.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

mod common;

use common::image;
use hysteron_board::{Bench, Machine, Request, Session, drive, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::monitor::{Fault, WATCHDOG_SAMPLES};
use hysteron_firmware::table;
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::wire::{Frame, Hello, Input, Mode, Order, Setup};
use hysteron_plant::{Stage, StageConfig, preset};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::time::Duration;

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    SensorFrozen,
    SensorAtLowEnd,
    SensorAtHighEnd,
    SensorDisconnected,
    SensorJumps,
    SensorSpikes,
    SensorBitFlips,
    SensorInverted,
    SensorOffset,
    AmplifierDead,
    AmplifierAtHalf,
    DacBitStuck,
    LoopGainTooHigh,
    OverrunsInARow,
    Hang,
}

impl Kind {
    const ON_HOST: [Self; 14] = [
        Self::SensorFrozen,
        Self::SensorAtLowEnd,
        Self::SensorAtHighEnd,
        Self::SensorDisconnected,
        Self::SensorJumps,
        Self::SensorSpikes,
        Self::SensorBitFlips,
        Self::SensorInverted,
        Self::SensorOffset,
        Self::AmplifierDead,
        Self::AmplifierAtHalf,
        Self::DacBitStuck,
        Self::LoopGainTooHigh,
        Self::OverrunsInARow,
    ];

    /// Whether the stage, not its sensor, does something else.
    fn is_of_the_stage(self) -> bool {
        matches!(
            self,
            Self::AmplifierDead | Self::AmplifierAtHalf | Self::DacBitStuck | Self::LoopGainTooHigh
        )
    }

    /// Ticks from the fault to the clear: the latency, the ramp, and rest.
    fn clear_after(self) -> u32 {
        self.allowed().0 + RAMP + 200
    }

    /// Samples within which it must be latched, and the fault that it must be.
    fn allowed(self) -> (u32, Fault) {
        match self {
            // 50 samples of one code, in which a reference of 20 Hz has moved: longer about its turns.
            Self::SensorFrozen => (500, Fault::SensorStuck),
            // Three samples within 8 codes of an end.
            Self::SensorAtLowEnd | Self::SensorAtHighEnd => (3, Fault::SensorRange),
            // Code 0x9000 is 3.1 um: no end of the range, and elsewhere than the stage can be. Three readings are held over.
            Self::SensorDisconnected | Self::SensorJumps | Self::SensorBitFlips => (4, Fault::SensorJump),
            // One bad reading in 400: the eighth is too many.
            Self::SensorSpikes => (2801, Fault::SensorJump),
            Self::SensorInverted => (4, Fault::SensorJump),
            // An offset that trembles.
            Self::SensorOffset => (6, Fault::SensorJump),
            // The stage falls back faster than a command would move it.
            Self::AmplifierDead | Self::AmplifierAtHalf => (200, Fault::SensorJump),
            // A period of 20 Hz until the command has the bit.
            Self::DacBitStuck => (2500, Fault::SensorJump),
            Self::LoopGainTooHigh => (20, Fault::SensorJump),
            // Three in a row; the tick after each is the one that knows.
            Self::OverrunsInARow => (4, Fault::Overrun),
            // The frame after the one that does not come back; the watchdog's periods lie between them.
            Self::Hang => (2, Fault::Watchdog),
        }
    }
}

/// The ramp down takes 20 ms at most.
const RAMP: u32 = 1000;

/// Ticks from the clear to the end, in which the loop rises again: 26 V on the ramp take 130.
const AFTER: u32 = 350;

/// The stage, with a fault from a tick on, taken away before the host clears it and starts anew.
struct Broken {
    stage: Stage,
    kind: Kind,
    at: u32,
    frozen: u16,
    volts: f64,
    rng: Pcg64,
    inputs: Vec<Input>,
    frames: Vec<Frame>,
}

impl Broken {
    fn new(kind: Kind, config: &StageConfig, seed: u64) -> Self {
        let mut rng = Pcg64::seed_from_u64(seed);
        let at = rng.random_range(600..1200);
        Self {
            stage: Stage::new(config, seed).unwrap(),
            kind,
            at,
            frozen: 0,
            volts: 0.0,
            rng,
            inputs: Vec::new(),
            frames: Vec::new(),
        }
    }

    fn broken(&self, number: u32) -> bool {
        (self.at..self.at + self.kind.clear_after() - 100).contains(&number)
    }

    /// The code that the sensor gives instead.
    fn code(&mut self, number: u32, code: u16) -> u16 {
        let since = number - self.at;
        let small = self.rng.random_range(0..4);
        match self.kind {
            Kind::SensorFrozen => self.frozen,
            Kind::SensorAtLowEnd => small,
            Kind::SensorAtHighEnd => u16::MAX - small,
            Kind::SensorDisconnected => 0x9000,
            // 2 um, more than the stage can move in some samples; once, for ever.
            Kind::SensorJumps => code.saturating_add(JUMP_CODES),
            Kind::SensorSpikes if since.is_multiple_of(400) => code.saturating_add(2 * JUMP_CODES),
            Kind::SensorBitFlips => code ^ (1 << 13),
            Kind::SensorInverted => u16::MAX - code,
            Kind::SensorOffset => code.saturating_sub(JUMP_CODES / 2 + 16 * small),
            _ => code,
        }
    }
}

/// 2 um in steps of 50 um / 65536.
const JUMP_CODES: u16 = 2621;

impl Bench for Broken {
    fn sample_rate_hz(&self) -> f64 {
        1.0 / self.stage.config().sample_period_s
    }

    fn input(&mut self, number: u32) -> Input {
        let code = u16::try_from(self.stage.sample().position_code).unwrap();
        if number < self.at {
            self.frozen = code;
        }
        let adc = if self.broken(number) {
            self.code(number, code)
        } else {
            code
        };
        let order = match number {
            0 => Order::Start,
            n if n == self.at + self.kind.clear_after() => Order::Clear,
            // A start without a clear must do nothing; one after it must.
            n if n == self.at + self.kind.clear_after() - 50 || n == self.at + self.kind.clear_after() + 50 => {
                Order::Start
            }
            n if self.kind == Kind::OverrunsInARow && (self.at..self.at + 10).contains(&n) => Order::Stall(1),
            n if self.kind == Kind::Hang && n == self.at => Order::Hang,
            _ => Order::None,
        };
        let input = Input { adc, order };
        self.inputs.push(input);
        input
    }

    fn output(&mut self, frame: &Frame) {
        let config = self.stage.config();
        let gain = config.amplifier.gain;
        let dac = config.dac.unwrap();
        let broken = self.broken(frame.number);
        let code = match self.kind {
            Kind::DacBitStuck if broken => frame.dac & !(1 << 11),
            _ => frame.dac,
        };
        let wanted_v = dac.v_from_code(u32::from(code)) * gain;
        self.volts = match self.kind {
            Kind::AmplifierDead if broken => 0.0,
            Kind::AmplifierAtHalf if broken => 0.3 * wanted_v,
            Kind::LoopGainTooHigh if broken => 4.0 * wanted_v,
            _ => wanted_v,
        };
        self.stage.step(self.volts);
        self.frames.push(*frame);
    }
}

fn request(hz: f64) -> Request {
    Request {
        shape: Shape::Sine,
        frequency_hz: hz,
        range_um: None,
        seconds: 0.4,
        feedforward: true,
        feedback: true,
    }
}

fn hello() -> Hello {
    Hello {
        hash: table::HASH,
        sample_rate_hz: table::SAMPLE_RATE_HZ,
        input_min_um: table::INPUT_MIN_UM,
        input_max_um: table::INPUT_MAX_UM,
        bank: 0,
        banks: 1,
        axes: 1,
        complete: false,
    }
}

/// What holds of every run; the tick at which the fault was latched.
fn judge(kind: Kind, at: u32, frames: &[Frame]) -> Result<u32, String> {
    let slew_v = table::SLEW_V_PER_S / table::SAMPLE_RATE_HZ;
    let ramp_v = table::RAMP_V_PER_S / table::SAMPLE_RATE_HZ;
    // A code more, by rounding at either end.
    let code_v = (table::DAC_TOP_V - table::DAC_MIN_V) / 65_535.0;
    let volts = |frame: &Frame| table::DAC_MIN_V + f32::from(frame.dac) * code_v;
    for pair in frames.windows(2) {
        let most = if pair[1].fault().is_some() && pair[0].fault().is_some() {
            ramp_v
        } else {
            slew_v
        };
        let change = (volts(&pair[1]) - volts(&pair[0])).abs();
        if change > most + 1.5 * code_v {
            return Err(format!("a step of {change} V at {:?}", pair[1]));
        }
        if volts(&pair[1]) < table::OUTPUT_MIN_V - code_v || volts(&pair[1]) > table::OUTPUT_MAX_V + code_v {
            return Err(format!("beyond the limits: {:?}", pair[1]));
        }
    }
    let latched = frames
        .iter()
        .find(|frame| frame.fault().is_some())
        .ok_or("not noticed")?;
    let (within, expected) = kind.allowed();
    let fault = latched.fault().unwrap();
    if latched.number < at || latched.number >= at + within || fault != expected {
        return Err(format!(
            "{fault:?} after {} samples",
            i64::from(latched.number) - i64::from(at)
        ));
    }
    // Down at the end of the ramp, and down it stays: a start without a clear does nothing.
    let down = latched.number + ((table::OUTPUT_MAX_V - table::OUTPUT_MIN_V) / ramp_v) as u32 + 2;
    let until = if kind == Kind::Hang {
        frames.len() as u32
    } else {
        at + kind.clear_after()
    };
    for frame in frames
        .iter()
        .filter(|frame| frame.number >= down && frame.number < until)
    {
        if frame.command_v != table::SAFE_V || frame.fault() != Some(fault) {
            return Err(format!("came up without a command: {frame:?}"));
        }
    }
    // After a clear and a start the loop runs again, if its cause is gone.
    let last = frames[(at + kind.clear_after() + AFTER - 1) as usize];
    if kind != Kind::Hang && (last.mode() != Mode::Running || last.fault().is_some()) {
        return Err(format!("does not recover on command: {last:?}"));
    }
    Ok(latched.number - at)
}

/// The first tick from one on at which the reference is in its upper half: at the lower end an amplifier that is dead does nothing.
fn upper_half(setup: &Setup, config: &StageConfig, from: u32) -> u32 {
    let mut rig = hysteron_board::Rig::new(Stage::new(config, 0).unwrap(), 1.0);
    let mut controller = Controller::new(table::parameters().unwrap(), setup);
    drive_here(&mut controller, from + 2600, &mut rig);
    let middle_um = 0.5 * (setup.low_um + setup.high_um);
    let frames = rig.recording.frames.iter().skip(from as usize);
    frames
        .filter(|frame| frame.reference_um > middle_um)
        .map(|frame| frame.number)
        .next()
        .unwrap()
}

/// A run here; then, on the same codes and orders, in the emulator. The samples until the fault was latched.
fn run(kind: Kind, seed: u64, session: Option<&mut Session>) -> Result<u32, String> {
    let config = if (seed / 8).is_multiple_of(2) {
        preset::paper_rate()
    } else {
        preset::paper_delay()
    };
    let hz = [20.0, 50.0, 100.0, 200.0][(seed / 2 % 4) as usize];
    let setup = request(hz).setup(&hello()).unwrap();
    let mut bench = Broken::new(kind, &config, seed);
    if kind.is_of_the_stage() {
        bench.at = upper_half(&setup, &config, bench.at);
    }
    let mut controller = Controller::new(table::parameters().unwrap(), &setup);
    drive_here(&mut controller, bench.at + kind.clear_after() + AFTER, &mut bench);
    let named = |reason: String| format!("{kind:?}, seed {seed}, {hz} Hz, at {}: {reason}", bench.at);
    let samples = judge(kind, bench.at, &bench.frames).map_err(named)?;
    let Some(session) = session else { return Ok(samples) };
    let setup = Setup {
        clocked: false,
        ..setup
    };
    let (frames, _) = session
        .replay(&setup, &bench.inputs)
        .map_err(|error| named(error.to_string()))?;
    let differing = frames
        .iter()
        .zip(&bench.frames)
        .find(|(board, here)| board.to_bytes() != here.to_bytes());
    if let Some((board, here)) = differing {
        return Err(named(format!("the emulator gave {board:?} instead of {here:?}")));
    }
    judge(kind, bench.at, &frames).map_err(|reason| named(format!("in the emulator {reason}")))
}

/// 14 kinds, 75 seeds each, even ones in the emulator's Cortex-M4F and odd ones in its M7; without an emulator here alone.
#[test]
fn prop_every_fault_ends_safe() {
    let threads = Machine::ALL.map(|machine| std::thread::spawn(move || on(machine)));
    let found = threads.map(|thread| thread.join().unwrap());
    for (k, kind) in Kind::ON_HOST.into_iter().enumerate() {
        let slowest = found.iter().map(|(slowest, _)| slowest[k]).max().unwrap();
        println!("{kind:?}: latched within {slowest} samples of {}", kind.allowed().0);
    }
    println!("{} runs", RUNS_A_KIND * Kind::ON_HOST.len() as u64);
    let wrong: Vec<&String> = found.iter().flat_map(|(_, wrong)| wrong).collect();
    assert!(wrong.is_empty(), "{}: {wrong:#?}", wrong.len());
}

/// A machine's share: how long each kind took at most, and what went wrong.
fn on(machine: Machine) -> ([u32; 14], Vec<String>) {
    let mut session =
        image(machine.name()).map(|image| Session::start(machine, &image, Duration::from_secs(1800)).unwrap());
    let (mut slowest, mut wrong) = ([0; 14], Vec::new());
    for (slowest, kind) in slowest.iter_mut().zip(Kind::ON_HOST) {
        let first = u64::from(machine == Machine::Mps2An500);
        for seed in (first..RUNS_A_KIND).step_by(2) {
            match run(kind, seed, session.as_mut()) {
                Ok(samples) => *slowest = samples.max(*slowest),
                Err(reason) => wrong.push(reason),
            }
        }
    }
    (slowest, wrong)
}

const RUNS_A_KIND: u64 = 75;

/// Nothing is wrong: nothing is latched, on either stage, by any reference of the paper.
#[test]
fn prop_nothing_is_latched_without_a_fault() {
    for seed in 0..3 {
        for hz in [10.0, 50.0, 100.0, 200.0, 300.0, 400.0, 500.0] {
            for config in [preset::paper_rate(), preset::paper_delay()] {
                for (feedforward, feedback) in [(true, true), (true, false), (false, true)] {
                    let request = Request {
                        feedforward,
                        feedback,
                        ..request(hz)
                    };
                    let setup = request.setup(&hello()).unwrap();
                    let mut rig = hysteron_board::Rig::new(Stage::new(&config, seed).unwrap(), 0.2);
                    let mut controller = Controller::new(table::parameters().unwrap(), &setup);
                    drive_here(&mut controller, 11_000, &mut rig);
                    let fault = rig.recording.frames.iter().find(|frame| frame.fault().is_some());
                    assert_eq!(fault, None, "{hz} Hz, {feedforward} {feedback}, seed {seed}");
                }
            }
        }
    }
}

/// The one that only a chip can have: an interrupt that does not come back, on both cores, tick by tick.
#[test]
fn val_the_watchdog_takes_over() {
    for machine in Machine::ALL {
        let Some(image) = image(machine.name()) else { return };
        let mut bench = Broken::new(Kind::Hang, &preset::paper_rate(), 1);
        let patience = Duration::from_secs(300);
        let request = Request {
            seconds: 0.1,
            ..request(100.0)
        };
        drive(machine, &image, &request, &mut bench, patience, &mut |_| {}).unwrap();
        let samples = judge(Kind::Hang, bench.at, &bench.frames).unwrap_or_else(|reason| panic!("{reason}"));
        println!("latched within {samples} samples; the watchdog bites after {WATCHDOG_SAMPLES} periods");
    }
}
