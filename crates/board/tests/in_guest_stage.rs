//! One small stage, compiled into the guest and into a process of the host: the exchange of codes between them changes no bit.
//!
//! Skipped, and said so, where there is no QEMU or no image, as `processor_in_loop.rs`.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

mod common;

use common::image;
use hysteron_board::{Bench, Machine, Request, Session, Shape, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::small_stage::SmallStage;
use hysteron_firmware::table;
use hysteron_firmware::wire::{Frame, Input, Mode, Setup};
use std::time::Duration;

const TICKS: u32 = 100_000;
/// As in the image.
const SEED: u32 = 7;

/// The stage in this process.
struct InProcess {
    stage: SmallStage,
    frames: Vec<Frame>,
}

impl InProcess {
    fn new() -> Self {
        Self {
            stage: SmallStage::new(&table::parameters().unwrap(), SEED),
            frames: Vec::new(),
        }
    }
}

impl Bench for InProcess {
    fn sample_rate_hz(&self) -> f64 {
        f64::from(table::SAMPLE_RATE_HZ)
    }

    fn input(&mut self, number: u32) -> Input {
        self.stage.input(number, TICKS)
    }

    fn output(&mut self, frame: &Frame) {
        self.stage.output(frame.dac);
        self.frames.push(*frame);
    }
}

fn setup() -> Setup {
    let request = Request {
        shape: Shape::ComplexHarmonic,
        frequency_hz: 97.0,
        range_um: None,
        seconds: 1.0,
        feedforward: true,
        feedback: true,
    };
    Setup {
        ticks: TICKS,
        ..request.setup(&table::hello()).unwrap()
    }
}

/// Application and stage in this process; on both cores the stage in the guest; on both cores the stage in this process, a code each way
/// a tick: five times the same 100 000 codes.
#[test]
fn val_the_exchange_changes_no_bit() {
    let setup = setup();
    let mut here = InProcess::new();
    drive_here(
        &mut Controller::new(table::parameters().unwrap(), &setup),
        TICKS,
        &mut here,
    );
    let here = here.frames;
    assert_eq!(here.len(), TICKS as usize);
    assert!(here.iter().all(|frame| frame.fault().is_none()));
    let running = here.iter().filter(|frame| frame.mode() == Mode::Running);
    assert!(running.count() > 97_000);
    assert_eq!(here[here.len() - 1].mode(), Mode::Off);
    // A run that does not move would agree, too.
    let codes = here.iter().map(|frame| frame.dac);
    assert!(codes.clone().max().unwrap() - codes.min().unwrap() > 1000);
    let threads = [(Machine::Mps2An386, "in-guest"), (Machine::Mps2An500, "in-guest-m7")].map(|(machine, name)| {
        let here = here.clone();
        std::thread::spawn(move || {
            let Some(image) = image(&format!("tables/{name}")) else {
                return;
            };
            let mut session = Session::start(machine, &image, Duration::from_secs(240)).unwrap();
            assert_eq!(
                session.hello(),
                &table::hello(),
                "the image has another table: build it anew"
            );
            let alone = Setup {
                clocked: false,
                ..setup
            };
            same(&session.watch(&alone).unwrap(), &here);
            let mut bench = InProcess::new();
            session.run(&setup, &mut bench, &mut |_| {}).unwrap();
            same(&bench.frames, &here);
        })
    });
    for thread in threads {
        thread.join().unwrap();
    }
}

fn same(board: &[Frame], here: &[Frame]) {
    assert_eq!(board.len(), here.len());
    for (board, here) in board.iter().zip(here) {
        assert_eq!(board.to_bytes(), here.to_bytes(), "{board:?} {here:?}");
    }
}
