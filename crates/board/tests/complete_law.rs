//! The complete law on the board: the same codes as here, bit for bit, and from the safe level to the safe level without a step.
//!
//! Skipped, and said so, where there is no QEMU or no image, as `processor_in_loop.rs`.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

mod common;

use common::image;
use hysteron_board::host::{complete, hello};
use hysteron_board::{Machine, Recording, Remembering, Request, Rig, Session, Shape, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::wire::{Frame, Input, Mode, Setup};
use hysteron_plant::{Stage, StageConfig, preset};
use hysteron_table::{Adaptation, Table};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(120);
const TABLE_8K: &str = include_str!("../../../firmware/tables/tracking-8k.toml");
const TABLE_739: &str = include_str!("../../../firmware/tables/tracking-739.toml");

fn request(shape: Shape, frequency_hz: f64, feedback: bool, seconds: f64) -> Request {
    Request {
        shape,
        frequency_hz,
        range_um: Some([3.0, 13.0]),
        seconds,
        feedforward: true,
        feedback,
    }
}

/// The application with a table against a stage in this process: what it recorded, and what the stage gave it.
fn here(table: &Table, config: &StageConfig, request: &Request, setup: &Setup) -> (Recording, Vec<Input>) {
    let mut bench = Remembering::new(Rig::new(Stage::new(config, 7).unwrap(), request.seconds));
    let mut controller = Controller::new(complete(table).unwrap(), setup);
    drive_here(&mut controller, setup.ticks, &mut bench);
    (bench.rig.recording, bench.inputs)
}

/// Both cores, both loops: sines, the complex harmonic and the triangle, frame by frame by their bits.
#[test]
fn val_complete_law_gives_the_same_bits() {
    let references = [
        (Shape::Sine, 10.0),
        (Shape::Sine, 100.0),
        (Shape::Sine, 500.0),
        (Shape::ComplexHarmonic, 100.0),
        (Shape::Triangle, 100.0),
    ];
    let table = Table::parse(TABLE_8K).unwrap();
    for (machine, name) in [
        (Machine::Mps2An386, "tracking-8k"),
        (Machine::Mps2An500, "tracking-8k-m7"),
    ] {
        let Some(image) = image(&format!("tables/{name}")) else {
            return;
        };
        let mut session = Session::start(machine, &image, PATIENCE).unwrap();
        assert_eq!(
            session.hello(),
            &hello(&table, TABLE_8K),
            "the image has another table: build it anew"
        );
        for (shape, hz) in references {
            for feedback in [false, true] {
                let request = request(shape, hz, feedback, 0.06);
                let setup = request.setup(session.hello()).unwrap();
                let (host, inputs) = here(&table, &preset::tracking_8k(), &request, &setup);
                let unclocked = Setup {
                    clocked: false,
                    ..setup
                };
                let (board, _) = session.replay(&unclocked, &inputs).unwrap();
                assert_eq!(board.len(), host.frames.len());
                for (board, host) in board.iter().zip(&host.frames) {
                    assert_eq!(
                        board.to_bytes(),
                        host.to_bytes(),
                        "{shape:?} {hz} Hz: {board:?} {host:?}"
                    );
                }
                // A run that does not move would agree, too: 10 um are 30 000 codes.
                let codes = board.iter().map(|frame| frame.dac);
                assert!(codes.clone().max().unwrap() - codes.min().unwrap() > 10_000, "{hz}");
            }
        }
    }
}

/// Every tick in time by the sample clock, the one that starts the run as well.
#[test]
fn val_complete_law_is_in_time() {
    let Some(image) = image("tables/tracking-739") else {
        return;
    };
    let mut session = Session::start(Machine::Mps2An386, &image, PATIENCE).unwrap();
    let request = request(Shape::Sine, 503.0, true, 0.04);
    let setup = request.setup(session.hello()).unwrap();
    let mut rig = Rig::new(Stage::new(&preset::tracking_739(), 7).unwrap(), request.seconds);
    let timing = session.run(&setup, &mut rig, &mut |_| {}).unwrap();
    assert_eq!((timing.overruns, timing.lost), (0, 0));
    let host = here(
        &Table::parse(TABLE_739).unwrap(),
        &preset::tracking_739(),
        &request,
        &setup,
    )
    .0;
    let same = |(a, b): (&Frame, &Frame)| a.to_bytes() == b.to_bytes();
    assert!(rig.recording.frames.iter().zip(&host.frames).all(same));
}

/// From the safe level along a ramp, with the slew in between, and down again; the reference that is reported is the one that is due.
#[test]
fn val_complete_law_rises_and_falls_on_ramps() {
    for (text, config) in [(TABLE_8K, preset::tracking_8k()), (TABLE_739, preset::tracking_739())] {
        let table = Table::parse(text).unwrap();
        let request = request(Shape::Sine, 100.0, true, 0.1);
        let setup = request.setup(&hello(&table, text)).unwrap();
        let recording = here(&table, &config, &request, &setup).0;
        let frames = &recording.frames;
        let changes = frames.windows(2).filter(|pair| pair[0].mode() != pair[1].mode());
        let order: Vec<Mode> = changes.map(|pair| pair[1].mode()).collect();
        assert_eq!(order, [Mode::Running, Mode::Falling, Mode::Off]);
        assert!(frames.iter().all(|frame| frame.fault().is_none()));
        assert_eq!(frames.last().unwrap().command_v, 0.0);
        let a_sample = |v_per_s: f64| (v_per_s / table.sample_rate_hz) as f32;
        for pair in frames.windows(2) {
            let most_v = match (pair[0].mode(), pair[1].mode()) {
                // The law itself brings the platform down: it is not let go while it moves.
                (Mode::Running, Mode::Running | Mode::Falling) | (Mode::Falling, Mode::Falling) => {
                    a_sample(table.slew_v_per_s)
                }
                _ => a_sample(table.ramp_v_per_s),
            };
            // Rounded where the command is larger than its change.
            assert!(
                (pair[1].command_v - pair[0].command_v).abs() <= most_v * 1.0001,
                "{pair:?}"
            );
        }
        // Reference and position of one tick belong together: the preview is the law's affair. Of 10 um 0.1 % rms at most, sensor noise of
        // 1 nm within it.
        assert!(recording.rms_um() < 0.01, "{}", recording.rms_um());
    }
}

/// What a law learns travels in its frames. A stage that moves by 1 % less than another needs 1/0.99 - 1 = 1.01 % more of what it asks for,
/// whatever the model misses of both; a law that does not learn says so.
#[test]
fn val_frames_say_what_was_learned() {
    let mut table = Table::parse(TABLE_8K).unwrap();
    let request = request(Shape::Sine, 20.0, false, 1.0);
    let setup = request.setup(&hello(&table, TABLE_8K)).unwrap();
    let less = |share: f64| {
        let mut config = preset::tracking_8k();
        config.hysteresis.stroke_um *= 1.0 - share;
        config
    };
    assert_eq!(here(&table, &less(0.0), &request, &setup).0.learned(), None);
    // Ten time constants; no lag.
    table.controller.as_mut().unwrap().adaptation = Some(Adaptation {
        gain_bound: 0.05,
        zero_bound_um: 0.5,
        lag_bound_s: 0.0,
        lag_from_hz: 0.0,
        lag_up_to_um_per_s: 0.0,
        time_s: 0.1,
        dead_um: 1e-3,
        um_per_v: 0.1,
    });
    let [whole, less] = [0.0, 0.01].map(|share| here(&table, &less(share), &request, &setup).0.learned().unwrap());
    assert!((less.gain - whole.gain - 0.0101).abs() < 2e-4, "{whole:?} {less:?}");
    for learned in [whole, less] {
        assert!(learned.gain.abs() < 0.05 && learned.zero_um.abs() < 0.5, "{learned:?}");
        assert!(learned.zero_um != 0.0 && learned.lag_samples == 0.0, "{learned:?}");
    }
}
