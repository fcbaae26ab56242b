//! The firmware's image in QEMU against the same application run here: the same codes, bit for bit.
//!
//! Skipped, and said so, where there is no QEMU or no image; `cargo xtask test` installs the one and builds the other and then
//! sets `HYSTERON_EMULATOR=required`, with which nothing is skipped.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

mod common;

use common::image;
use hysteron_board::{Bench, BoardError, Machine, Outcome, Recording, Request, Rig, drive, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::table;
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::wire::{Frame, Hello, Input, LIMITED, Mode, Order, Setup};
use hysteron_plant::{Stage, StageConfig, preset};
use std::path::Path;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(240);

fn sine(frequency_hz: f64, feedforward: bool, feedback: bool, seconds: f64) -> Request {
    Request {
        shape: Shape::Sine,
        frequency_hz,
        range_um: Some([0.2, 2.2]),
        seconds,
        feedforward,
        feedback,
    }
}

fn in_emulator(machine: Machine, image: &Path, config: &StageConfig, request: &Request) -> (Outcome, Recording) {
    let stage = Stage::new(config, 7).unwrap();
    hysteron_board::run(machine, image, stage, (request, &[]), PATIENCE, &mut |_| {}).unwrap()
}

/// The same application and stage in one process.
fn on_host(config: &StageConfig, request: &Request, setup: &Setup) -> Recording {
    let mut rig = Rig::new(Stage::new(config, 7).unwrap(), request.seconds);
    let mut controller = Controller::new(table::parameters().unwrap(), setup);
    drive_here(&mut controller, setup.ticks, &mut rig);
    rig.recording
}

/// On either core 60 000 ticks: open loop, PI alone and both, on the stages of the paper. Frames are compared by their bits.
#[test]
fn val_emulator_and_host_give_the_same_bits() {
    for machine in Machine::ALL {
        let Some(image) = image(machine.name()) else { return };
        for (config, hz, feedforward, feedback) in [
            (preset::paper_rate(), 100.0, true, false),
            (preset::paper_delay(), 10.0, false, true),
            (preset::paper_rate(), 500.0, true, true),
            (preset::paper_delay(), 50.0, true, true),
        ] {
            let request = sine(hz, feedforward, feedback, 0.3);
            let (outcome, recording) = in_emulator(machine, &image, &config, &request);
            assert_eq!(
                outcome.hello.hash,
                table::HASH,
                "the image has another table: build both anew"
            );
            let host = on_host(&config, &request, &outcome.setup).frames;
            assert_eq!(recording.frames.len(), host.len());
            for (board, host) in recording.frames.iter().zip(&host) {
                assert_eq!(
                    board.to_bytes(),
                    host.to_bytes(),
                    "{hz} Hz, {feedforward} {feedback}: {board:?} {host:?}"
                );
            }
            // A run that does not move would agree, too.
            let codes = recording.frames.iter().map(|frame| frame.dac);
            assert!(codes.clone().max().unwrap() - codes.min().unwrap() > 1000, "{hz}");
            on_time(&outcome);
        }
    }
}

/// No overrun, no lost edge, constant latency.
fn on_time(outcome: &Outcome) {
    let timing = outcome.summary;
    assert_eq!((timing.overruns, timing.lost), (0, 0));
    // Waking from wfi or not, one timer count either way.
    assert!(timing.latency_max - timing.latency_min <= 1, "{timing:?}");
    // 500 counts are the period; a tick of more than a third of it would be another algorithm.
    assert!(timing.tick_max > 0 && timing.tick_max < 500 / 3, "{timing:?}");
}

/// The stage, with orders of the test's own.
struct Ordered<F> {
    rig: Rig,
    order: F,
}

impl<F: FnMut(u32) -> Order> Bench for Ordered<F> {
    fn sample_rate_hz(&self) -> f64 {
        self.rig.sample_rate_hz()
    }

    fn input(&mut self, number: u32) -> Input {
        let order = (self.order)(number);
        Input {
            order,
            ..self.rig.input(number)
        }
    }

    fn output(&mut self, frame: &Frame) {
        self.rig.output(frame);
    }
}

/// A second of 50 kHz without an overrun; then ticks held up on purpose, every one of them counted, and the edges lost with them.
#[test]
fn val_overruns_are_counted_exactly() {
    for machine in Machine::ALL {
        let Some(image) = image(machine.name()) else { return };
        let run = |seconds: f64, order: &dyn Fn(u32) -> Order| {
            let rig = Rig::new(Stage::new(&preset::paper_delay(), 7).unwrap(), seconds);
            let request = sine(100.0, true, true, seconds);
            let mut bench = Ordered { rig, order };
            let outcome = drive(machine, &image, &request, &mut bench, PATIENCE, &mut |_| {}).unwrap();
            (outcome, bench.rig.recording)
        };
        let (outcome, long) = run(1.0, &|number| if number == 0 { Order::Start } else { Order::None });
        assert!(long.frames.len() >= 50_000);
        on_time(&outcome);
        for (every, edges, overruns, lost) in [(100, 1, 50, 0), (1000, 3, 5, 10), (1, 1, 4999, 0)] {
            let stall = |number: u32| match number {
                0 => Order::Start,
                n if n < 5000 && n % every == every - 1 => Order::Stall(edges),
                _ => Order::None,
            };
            let timing = run(0.1, &stall).0.summary;
            assert_eq!((timing.overruns, timing.lost), (overruns, lost), "{every} {edges}");
        }
    }
}

/// The command starts and ends at the safe level, on ramps.
#[test]
fn val_rises_and_falls_on_ramps() {
    let setup = sine(100.0, true, true, 0.1).setup(&hello()).unwrap();
    let frames = on_host(&preset::paper_rate(), &sine(100.0, true, true, 0.1), &setup).frames;
    let modes = frames.windows(2).filter(|pair| pair[0].mode() != pair[1].mode());
    let order: Vec<Mode> = modes.map(|pair| pair[1].mode()).collect();
    assert_eq!(order, [Mode::Running, Mode::Falling, Mode::Off]);
    assert_eq!(frames[0].mode(), Mode::Rising);
    let ramp_v = table::RAMP_V_PER_S / table::SAMPLE_RATE_HZ;
    for pair in frames.windows(2).filter(|pair| pair[1].mode() != Mode::Running) {
        // Rounded where the command is larger than its change.
        assert!(
            (pair[1].command_v - pair[0].command_v).abs() <= ramp_v * 1.0001,
            "{pair:?}"
        );
    }
    assert_eq!(frames.last().unwrap().command_v, table::SAFE_V);
}

/// Feedforward with feedback follows better than either alone, in the emulator as in the paper's figure 15 at 100 Hz.
#[test]
fn val_the_loop_follows() {
    let Some(image) = image(Machine::Mps2An386.name()) else {
        return;
    };
    let run = |feedforward, feedback| {
        let request = sine(100.0, feedforward, feedback, 0.1);
        let (_, recording) = in_emulator(Machine::Mps2An386, &image, &preset::paper_rate(), &request);
        let mut running = recording.frames.iter().filter(|frame| frame.mode() == Mode::Running);
        let limited = running.any(|frame| frame.flags & LIMITED != 0);
        assert!(!feedback || !limited, "{feedforward}");
        recording.rms_um()
    };
    let (inverse, pi, both) = (run(true, false), run(false, true), run(true, true));
    assert!(both < inverse && both < pi, "{inverse} {pi} {both}");
}

fn hello() -> Hello {
    Hello {
        hash: [0; 32],
        sample_rate_hz: 5e4,
        input_min_um: 0.0,
        input_max_um: 2.5,
        bank: 0,
        banks: 1,
        axes: 1,
        complete: false,
    }
}

#[test]
fn refuse_requests_and_images() {
    let hello = hello();
    let refused = |request: Request| request.setup(&hello).unwrap_err().to_string();
    let good = sine(100.0, true, true, 0.1);
    assert_eq!(
        refused(Request {
            frequency_hz: 6000.0,
            ..good
        }),
        "frequency, hertz = 6000 must lie in 0.001 to 5000"
    );
    assert_eq!(
        refused(Request {
            range_um: Some([f64::NAN, 2.2]),
            ..good
        }),
        "lowest reference, micrometres = NaN must lie in 0 to 2.5"
    );
    assert_eq!(
        refused(Request { seconds: 1e9, ..good }),
        "ticks = 50000000000000 must lie in 2 to 30000000"
    );
    let error = failure(Path::new("no/such/image"));
    assert_eq!(error, "no image no/such/image; build it: cargo xtask firmware build");
}

fn failure(image: &Path) -> String {
    let stage = Stage::new(&preset::paper_rate(), 1).unwrap();
    let request = sine(100.0, true, true, 0.1);
    let patience = Duration::from_secs(2);
    let error: BoardError =
        hysteron_board::run(Machine::Mps2An386, image, stage, (&request, &[]), patience, &mut |_| {}).unwrap_err();
    error.to_string()
}

/// A file that is no image: QEMU runs nothing or ends, and the wait with it.
#[test]
fn refuse_a_file_that_is_no_image() {
    if image(Machine::Mps2An386.name()).is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("image");
    std::fs::write(&file, "no image").unwrap();
    let error = failure(&file);
    assert!(error.contains("ended or stood still at tick 0"), "{error}");
}
