//! Faults at the converters, in the stage and in the clock: each is noticed in time, the output falls without a step and stays down.
//!
//! 14 kinds, 75 seeded runs each. All are of the application that is on the chip; most of them run it here, a sample in the emulator, where it gives the same
//! bits (`processor_in_loop.rs`).
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

use hysteron_board::{Bench, Machine, Request, drive, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::monitor::{FOLLOWING_SAMPLES, Fault, LATE_TICKS, RAIL_SAMPLES, STUCK_SAMPLES, WATCHDOG_SAMPLES};
use hysteron_firmware::table;
use hysteron_firmware::wire::{Frame, Hello, Input, Mode, Order};
use hysteron_plant::{Stage, StageConfig, preset};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::path::Path;
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

    /// Samples within which it must be latched, and the faults that may stand for it.
    fn allowed(self) -> (u32, &'static [Fault]) {
        let following = FOLLOWING_SAMPLES as u32;
        match self {
            // While the command stands at a turn of a 20 Hz reference, it takes a while until it has moved.
            Self::SensorFrozen => (10 * u32::from(STUCK_SAMPLES), &[Fault::SensorStuck]),
            Self::SensorAtLowEnd | Self::SensorAtHighEnd => {
                (u32::from(RAIL_SAMPLES), &[Fault::SensorJump, Fault::SensorRange])
            }
            // Code 0x8000 is 0 um: no end of the range, and a jump only from where the stage is far enough.
            Self::SensorDisconnected => (
                10 * u32::from(STUCK_SAMPLES),
                &[Fault::SensorJump, Fault::SensorStuck, Fault::Disagreement],
            ),
            Self::SensorJumps | Self::SensorSpikes | Self::SensorBitFlips => (1, &[Fault::SensorJump]),
            // The integral runs away and meets whichever limit comes first.
            Self::SensorInverted => (following, RUNAWAY),
            // Where it is less than a jump, the integral follows the sensor until it disagrees with the inverse.
            Self::SensorOffset => (following, &[Fault::SensorJump, Fault::Disagreement]),
            // The stage falls back: faster than a command could move it, or until the integral disagrees.
            Self::AmplifierDead | Self::AmplifierAtHalf => (following, RUNAWAY),
            // A period of 20 Hz until the command has the bit.
            Self::DacBitStuck => (following, RUNAWAY),
            Self::LoopGainTooHigh => (following, RUNAWAY),
            Self::OverrunsInARow => (u32::from(LATE_TICKS) + 1, &[Fault::Overrun]),
            // The frame after the one that does not come back; the watchdog's periods lie between them.
            Self::Hang => (2, &[Fault::Watchdog]),
        }
    }
}

/// What a loop that has lost its stage ends in.
const RUNAWAY: &[Fault] = &[
    Fault::SensorJump,
    Fault::SensorRange,
    Fault::SensorStuck,
    Fault::Saturated,
    Fault::Following,
    Fault::Oscillation,
    Fault::Disagreement,
];

/// Ticks from a fault to the new start: the longest latency above, the ramp, and rest.
const CLEAR_AFTER: u32 = 4000;

/// The stage, with a fault from a tick on, taken away before the host clears it and starts anew.
struct Broken {
    stage: Stage,
    kind: Kind,
    at: u32,
    frozen: u16,
    volts: f64,
    rng: Pcg64,
    frames: Vec<Frame>,
}

impl Broken {
    fn new(kind: Kind, config: &StageConfig, seed: u64) -> Self {
        let mut rng = Pcg64::seed_from_u64(seed);
        let at = rng.random_range(800..2000);
        Self {
            stage: Stage::new(config, seed).unwrap(),
            kind,
            at,
            frozen: 0,
            volts: 0.0,
            rng,
            frames: Vec::new(),
        }
    }

    fn broken(&self, number: u32) -> bool {
        (self.at..self.at + CLEAR_AFTER - 100).contains(&number)
    }

    /// The code that the sensor gives instead.
    fn code(&mut self, number: u32, code: u16) -> u16 {
        let since = number - self.at;
        let small = self.rng.random_range(0..4);
        match self.kind {
            Kind::SensorFrozen => self.frozen,
            Kind::SensorAtLowEnd => small,
            Kind::SensorAtHighEnd => u16::MAX - small,
            Kind::SensorDisconnected => 0x8000,
            // 2 um, more than the stage can move in a sample; once, for ever.
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
            n if n == self.at + CLEAR_AFTER => Order::Clear,
            // A start without a clear must do nothing; one after it must.
            n if n == self.at + CLEAR_AFTER - 50 || n == self.at + CLEAR_AFTER + 50 => Order::Start,
            n if self.kind == Kind::OverrunsInARow && (self.at..self.at + 10).contains(&n) => Order::Stall(1),
            n if self.kind == Kind::Hang && n == self.at => Order::Hang,
            _ => Order::None,
        };
        Input { adc, order }
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
    let (within, faults) = kind.allowed();
    let fault = latched.fault().unwrap();
    if latched.number < at || latched.number >= at + within || !faults.contains(&fault) {
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
        at + CLEAR_AFTER
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
    let last = frames[(at + CLEAR_AFTER + 1000) as usize];
    if kind != Kind::Hang && (last.mode() != Mode::Running || last.fault().is_some()) {
        return Err(format!("does not recover on command: {last:?}"));
    }
    Ok(latched.number - at)
}

fn on_host(kind: Kind, seed: u64) -> Result<u32, String> {
    let config = if seed.is_multiple_of(2) {
        preset::paper_rate()
    } else {
        preset::paper_delay()
    };
    let hz = [20.0, 50.0, 100.0, 200.0][(seed / 2 % 4) as usize];
    let setup = request(hz).setup(&hello()).unwrap();
    let mut bench = Broken::new(kind, &config, seed);
    let mut controller = Controller::new(table::parameters().unwrap(), &setup);
    drive_here(&mut controller, bench.at + CLEAR_AFTER + 1200, &mut bench);
    judge(kind, bench.at, &bench.frames)
        .map_err(|reason| format!("{kind:?}, seed {seed}, {hz} Hz, at {}: {reason}", bench.at))
}

/// 14 kinds, 75 seeds each.
#[test]
fn prop_every_fault_ends_safe() {
    let mut wrong = Vec::new();
    for kind in Kind::ON_HOST {
        let mut slowest = 0;
        for seed in 0..RUNS_A_KIND {
            match on_host(kind, seed) {
                Ok(samples) => slowest = slowest.max(samples),
                Err(reason) => wrong.push(reason),
            }
        }
        println!("{kind:?}: latched within {slowest} samples of {}", kind.allowed().0);
    }
    println!("{} runs", RUNS_A_KIND * Kind::ON_HOST.len() as u64);
    assert!(wrong.is_empty(), "{}: {wrong:#?}", wrong.len());
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

/// A sample of them in the emulator, and the one that only a chip can have: an interrupt that does not come back.
#[test]
fn val_faults_in_the_emulator() {
    let machine = Machine::Mps2An386;
    let image = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/target/images/mps2-an386");
    let emulator = std::process::Command::new("qemu-system-arm").arg("--version").output();
    if !image.is_file() || emulator.is_err() {
        assert!(
            std::env::var_os("HYSTERON_EMULATOR").is_none(),
            "no image or no emulator"
        );
        eprintln!("skipped: no image or no qemu-system-arm; run `cargo xtask test`");
        return;
    }
    for (seed, kind) in [Kind::SensorFrozen, Kind::SensorSpikes, Kind::OverrunsInARow, Kind::Hang]
        .into_iter()
        .enumerate()
    {
        let mut bench = Broken::new(kind, &preset::paper_rate(), seed as u64);
        let patience = Duration::from_secs(300);
        let request = Request {
            seconds: 0.15,
            ..request(100.0)
        };
        drive(machine, &image, &request, &mut bench, patience, &mut |_| {}).unwrap_or_else(|e| panic!("{kind:?}: {e}"));
        let samples = judge(kind, bench.at, &bench.frames).unwrap_or_else(|reason| panic!("{kind:?}: {reason}"));
        println!("{kind:?}: latched within {samples} samples; the watchdog bites after {WATCHDOG_SAMPLES} periods");
    }
}
