//! The firmware's image in QEMU against the same application run here: the same codes, bit for bit.
//!
//! Skipped, and said so, where there is no QEMU or no image; `cargo xtask test` installs the one and builds the other and then
//! sets `HYSTERON_NEED_EMULATOR`, with which nothing is skipped.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

use hysteron_board::{BoardError, Machine, Recording, Request};
use hysteron_core::codes::AdcCode;
use hysteron_firmware::controller::Controller;
use hysteron_firmware::table;
use hysteron_firmware::wire::{Frame, Hello, LIMITED, Setup};
use hysteron_plant::{Stage, StageConfig, preset};
use std::path::{Path, PathBuf};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(240);

fn image(machine: Machine) -> Option<PathBuf> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/target/images");
    let image = Path::new(folder).join(machine.name());
    let emulator = std::process::Command::new("qemu-system-arm").arg("--version").output();
    if image.is_file() && emulator.is_ok() {
        return Some(image);
    }
    let missing = format!("no image {} or no qemu-system-arm", image.display());
    assert!(std::env::var_os("HYSTERON_EMULATOR").is_none(), "{missing}");
    eprintln!("skipped: {missing}; run `cargo xtask test`");
    None
}

fn sine(frequency_hz: f64, feedforward: bool, feedback: bool, seconds: f64) -> Request {
    Request {
        frequency_hz,
        range_um: Some([0.2, 2.2]),
        seconds,
        feedforward,
        feedback,
        stall: [0, 0],
    }
}

fn in_emulator(machine: Machine, image: &Path, config: &StageConfig, request: &Request) -> Recording {
    let mut stage = Stage::new(config, 7).unwrap();
    hysteron_board::run(machine, image, &mut stage, request, PATIENCE, &mut |_| {}).unwrap()
}

/// The same application and stage in one process.
fn on_host(config: &StageConfig, setup: &Setup) -> Vec<Frame> {
    let mut stage = Stage::new(config, 7).unwrap();
    let mut controller = Controller::new(table::parameters().unwrap(), setup);
    (0..setup.ticks)
        .map(|_| {
            let code = u16::try_from(stage.sample().position_code).unwrap();
            let frame = controller.step(AdcCode(code));
            stage.step_code(u32::from(frame.dac));
            frame
        })
        .collect()
}

fn rms_um(recording: &Recording) -> f64 {
    let half = recording.frames.len() / 2;
    let pairs = recording.frames.iter().zip(&recording.position_um).skip(half);
    let sum: f64 = pairs
        .map(|(frame, y)| (f64::from(frame.reference_um) - y).powi(2))
        .sum();
    (sum / half as f64).sqrt()
}

/// On either core 120 000 ticks: open loop, PI alone and both, on both stages of the paper. Frames are compared by their bits.
#[test]
fn val_emulator_and_host_give_the_same_bits() {
    for machine in Machine::ALL {
        let Some(image) = image(machine) else { return };
        for config in [preset::paper_rate(), preset::paper_delay()] {
            for (hz, feedforward, feedback) in [
                (100.0, true, false),
                (10.0, false, true),
                (500.0, true, true),
                (50.0, true, true),
            ] {
                let recording = in_emulator(machine, &image, &config, &sine(hz, feedforward, feedback, 0.3));
                assert_eq!(
                    recording.hello.hash,
                    table::HASH,
                    "the image has another table: build both anew"
                );
                let host = on_host(&config, &recording.setup);
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
                on_time(&recording);
            }
        }
    }
}

/// No overrun, no lost edge, constant latency.
fn on_time(recording: &Recording) {
    let timing = recording.summary;
    assert_eq!((timing.overruns, timing.lost), (0, 0));
    // Waking from wfi or not, one timer count either way.
    assert!(timing.latency_max - timing.latency_min <= 1, "{timing:?}");
    // 500 counts are the period; a tick of more than a third of it would be another algorithm.
    assert!(timing.tick_max > 0 && timing.tick_max < 500 / 3, "{timing:?}");
}

/// A second of 50 kHz without an overrun; then ticks held up on purpose, every one of them counted, and the edges lost with them.
#[test]
fn val_overruns_are_counted_exactly() {
    for machine in Machine::ALL {
        let Some(image) = image(machine) else { return };
        let run = |request: &Request| in_emulator(machine, &image, &preset::paper_delay(), request);
        let long = run(&sine(100.0, true, true, 1.0));
        assert_eq!(long.frames.len(), 50_000);
        on_time(&long);
        for (stall, overruns, lost) in [([100, 1], 50, 0), ([1000, 3], 5, 10), ([1, 1], 5000, 0)] {
            let timing = run(&Request {
                stall,
                ..sine(100.0, true, true, 0.1)
            })
            .summary;
            // What is held up at the very end loses edges that no later tick could see.
            let unseen = if lost > 0 { stall[1] - 1 } else { 0 };
            assert_eq!((timing.overruns, timing.lost), (overruns, lost - unseen), "{stall:?}");
        }
    }
}

/// Feedforward with feedback follows better than either alone, in the emulator as in the paper's figure 15 at 100 Hz.
#[test]
fn val_the_loop_follows() {
    let Some(image) = image(Machine::Mps2An386) else { return };
    let run = |feedforward, feedback| {
        let request = sine(100.0, feedforward, feedback, 0.1);
        let recording = in_emulator(Machine::Mps2An386, &image, &preset::paper_rate(), &request);
        let half = recording.frames.len() / 2;
        let limited = recording.frames[half..].iter().any(|frame| frame.flags & LIMITED != 0);
        assert!(!feedback || !limited, "{feedforward}");
        rms_um(&recording)
    };
    let (inverse, pi, both) = (run(true, false), run(false, true), run(true, true));
    assert!(both < inverse && both < pi, "{inverse} {pi} {both}");
}

#[test]
fn refuse_requests_and_images() {
    let hello = Hello {
        hash: [0; 32],
        sample_rate_hz: 5e4,
        input_min_um: 0.0,
        input_max_um: 2.5,
    };
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
    let mut stage = Stage::new(&preset::paper_rate(), 1).unwrap();
    let request = sine(100.0, true, true, 0.1);
    let patience = Duration::from_secs(2);
    let error: BoardError =
        hysteron_board::run(Machine::Mps2An386, image, &mut stage, &request, patience, &mut |_| {}).unwrap_err();
    error.to_string()
}

/// A file that is no image: QEMU runs nothing or ends, and the wait with it.
#[test]
fn refuse_a_file_that_is_no_image() {
    if image(Machine::Mps2An386).is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("image");
    std::fs::write(&file, "no image").unwrap();
    let error = failure(&file);
    assert!(error.contains("ended or stood still at tick 0"), "{error}");
}
