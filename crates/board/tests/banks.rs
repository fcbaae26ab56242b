//! Two tables in one image, changed by the host: at the safe level only, answered in the tick, and nothing of the other is left.
//!
//! Skipped in part, and said so, where there is no QEMU or no image, as `processor_in_loop.rs`.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

mod common;
mod scripted;

use common::image;
use hysteron_board::host::{PLAYS, complete, hello, parameters};
use hysteron_board::{Machine, Recording, Request, Rig, Session, Shape, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::{Complete, Law, Paper};
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::tuning::Change;
use hysteron_firmware::wire::{ACCEPTED, Frame, Hello, Input, Mode, Order, REFUSED, Setup};
use hysteron_plant::{Stage, StageConfig, preset};
use hysteron_table::{Inverse, Table};
use proptest::prelude::*;
use scripted::{Scripted, answers};
use std::sync::LazyLock;
use std::time::Duration;

/// The paper's law and the complete one, each for two stages.
const PAPER: [&str; 2] = [
    include_str!("../../../firmware/tables/paper-rate-mrpi.toml"),
    include_str!("../../../firmware/tables/paper-delay-mrpi.toml"),
];
const COMPLETE: [&str; 2] = [
    include_str!("../../../firmware/tables/tracking-8k.toml"),
    include_str!("../../../firmware/tables/tracking-739.toml"),
];
const PATIENCE: Duration = Duration::from_secs(240);

/// The images of [`COMPLETE`].
const IMAGES: [(Machine, &str); 2] = [(Machine::Mps2An386, "banks"), (Machine::Mps2An500, "banks-m7")];

fn tables(texts: [&str; 2]) -> [Table; 2] {
    texts.map(|text| Table::parse(text).unwrap())
}

type Bank = Parameters<Paper<Inverse<PLAYS>>>;
static BANKS: LazyLock<[Bank; 2]> = LazyLock::new(|| tables(PAPER).map(|table| parameters(&table).unwrap()));
static COMPLETE_BANKS: LazyLock<[Parameters<Complete>; 2]> =
    LazyLock::new(|| tables(COMPLETE).map(|table| complete(&table).unwrap()));

/// What an image says of two tables.
fn hellos(texts: [&str; 2]) -> [Hello; 2] {
    let tables = tables(texts);
    [0, 1].map(|bank| Hello {
        bank: bank as u8,
        banks: 2,
        ..hello(&tables[bank], texts[bank])
    })
}

fn request(frequency_hz: f64, range_um: [f64; 2], feedback: bool) -> Request {
    Request {
        shape: Shape::Sine,
        frequency_hz,
        range_um: Some(range_um),
        seconds: 0.05,
        feedforward: true,
        feedback,
    }
}

/// For [`PAPER`].
fn setup(ticks: u32) -> Setup {
    let setup = request(500.0, [0.2, 2.2], true).setup(&hellos(PAPER)[0]).unwrap();
    Setup {
        ticks,
        clocked: false,
        ..setup
    }
}

const START: Order = Order::Start;
const STOP: Order = Order::Stop;

/// Runs here, with the tables of [`PAPER`].
fn run(config: &StageConfig, setup: &Setup, script: &[(usize, Order)], changes: &[(usize, Change)]) -> Scripted {
    run_with(&BANKS, config, setup, script, changes)
}

fn run_with<L: Law>(
    banks: &'static [Parameters<L>; 2],
    config: &StageConfig,
    setup: &Setup,
    script: &[(usize, Order)],
    changes: &[(usize, Change)],
) -> Scripted {
    // The rig's own orders are not used.
    let rig = Rig::new(Stage::new(config, 5).unwrap(), 1e4);
    let mut bench = Scripted::new(rig, setup.ticks, script, changes);
    let mut controller = Controller::new(banks[0], setup).with_banks(banks);
    drive_here(&mut controller, setup.ticks, &mut bench);
    bench
}

/// Bank 0 and a stop, bank 1 and a stop, on both cores the frames of this host; on either stage the table that was identified on it
/// follows better, in open loop.
#[test]
fn val_the_right_table_follows_better() {
    const HALF: usize = 6000;
    let script = [(0, START), (4000, STOP), (HALF, START), (HALF + 4000, STOP)];
    let changes = [(HALF - 10, Change::Bank(1))];
    let setup = Setup {
        ticks: 2 * HALF as u32,
        clocked: false,
        ..request(100.0, [3.0, 13.0], false).setup(&hellos(COMPLETE)[0]).unwrap()
    };
    let mut runs = Vec::new();
    for (own, config) in [preset::tracking_8k(), preset::tracking_739()].iter().enumerate() {
        let bench = run_with(&COMPLETE_BANKS, config, &setup, &script, &changes);
        let frames = &bench.rig.recording.frames;
        assert_eq!(answers(frames), [(HALF as u32 - 9, ACCEPTED)]);
        let of_bank = |bank: usize| {
            let frames = &frames[bank * HALF..(bank + 1) * HALF];
            let running = frames.iter().filter(|frame| frame.mode() == Mode::Running);
            assert!(running.clone().all(|frame| usize::from(frame.bank()) == bank));
            assert!(running.count() > 3000, "{own} {bank}");
            let recording = Recording {
                frames: frames.to_vec(),
                position_um: bench.rig.recording.position_um[bank * HALF..(bank + 1) * HALF].to_vec(),
                ..Recording::default()
            };
            recording.rms_um()
        };
        let (right_um, wrong_um) = (of_bank(own), of_bank(1 - own));
        println!("stage {own}: its own table {right_um:.4} um rms, the other's {wrong_um:.4} um");
        assert!(right_um < wrong_um, "{own}: {right_um} {wrong_um}");
        runs.push(bench);
    }
    for (machine, name) in IMAGES {
        let Some(image) = image(&format!("tables/{name}")) else {
            return;
        };
        let mut session = Session::start(machine, &image, PATIENCE).unwrap();
        assert_eq!(
            session.banks(),
            hellos(COMPLETE),
            "the image has other tables: build it anew"
        );
        for here in &runs {
            let (board, _) = session.replay(&setup, &here.inputs).unwrap();
            assert_eq!(board.len(), here.rig.recording.frames.len());
            for (board, here) in board.iter().zip(&here.rig.recording.frames) {
                assert_eq!(board.to_bytes(), here.to_bytes(), "{board:?} {here:?}");
            }
        }
    }
}

/// By the sample clock, as `hysteron board run --bank 1` does it: in time, the tick of the change as well, and recorded from the start on.
#[test]
fn val_a_run_begins_with_the_bank_that_is_asked_for() {
    let config = preset::tracking_739();
    let request = request(100.0, [3.0, 13.0], true);
    for (machine, name) in IMAGES {
        let Some(image) = image(&format!("tables/{name}")) else {
            return;
        };
        let run = |changes: &[Change]| {
            let stage = Stage::new(&config, 5).unwrap();
            hysteron_board::run(machine, &image, stage, (&request, changes), PATIENCE, &mut |_| {})
        };
        let (outcome, recording) = run(&[Change::Bank(1)]).unwrap();
        assert_eq!(outcome.hello, hellos(COMPLETE)[1]);
        assert_eq!((outcome.summary.overruns, outcome.summary.lost), (0, 0));
        assert!(recording.frames.iter().all(|frame| frame.bank() == 1));
        // The order's byte, and the order to apply it, are not of the recording.
        assert_eq!(recording.frames[0].number, 2);
        assert_eq!(recording.frames[0].mode(), Mode::Rising);
        let mut rig = Rig::new(Stage::new(&config, 5).unwrap(), request.seconds).after(&[Change::Bank(1)]);
        let mut controller = Controller::new(COMPLETE_BANKS[0], &outcome.setup).with_banks(&*COMPLETE_BANKS);
        drive_here(&mut controller, outcome.setup.ticks, &mut rig);
        assert_eq!(rig.recording, recording);
        let error = run(&[Change::Bank(2)]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "bank 2: the image has 2 (0 to 1); build one with more tables: cargo xtask firmware build A.toml B.toml"
        );
    }
}

/// After a change everything is as if the image had no other table: gains that were changed before are the table's again.
#[test]
fn val_nothing_of_the_other_table_is_left() {
    let script = [(0, START), (3000, STOP), (6000, START)];
    let gains = Change::Gains {
        proportional_v_per_um: 0.1,
        integral_v_per_um_s: 100.0,
    };
    for bank in [0, 1] {
        let changes = [(2000, gains), (5990, Change::Bank(bank))];
        let bench = run(&preset::paper_rate(), &setup(9000), &script, &changes);
        let frames = &bench.rig.recording.frames;
        assert_eq!(answers(frames), [(2008, ACCEPTED), (5991, ACCEPTED)]);
        let mut alone = Controller::new(BANKS[usize::from(bank)], &setup(3000));
        for (frame, input) in frames[6000..].iter().zip(&bench.inputs[6000..]) {
            let wanted = alone.step(*input, false);
            let got = Frame {
                number: frame.number - 6000,
                flags: frame.flags & 0x1fff,
                ..*frame
            };
            assert_eq!(got.to_bytes(), wanted.to_bytes(), "{got:?} {wanted:?}");
            assert_eq!(frame.bank(), bank);
        }
    }
}

/// Refused while the output is anywhere but at its safe level, where there is no such bank, and where the reference leaves its range;
/// with one table always.
#[test]
fn refuse_banks_that_cannot_be() {
    let script = [(0, START), (3000, STOP)];
    let wide = Change::Trajectory {
        shape: Shape::Sine,
        phase_step: 1 << 25,
        low_um: 0.1,
        high_um: 2.3,
    };
    let changes = [
        (10, Change::Bank(1)),
        (2000, Change::Bank(1)),
        (3010, Change::Bank(1)),
        (6000, Change::Bank(2)),
        (6010, Change::Bank(255)),
        (6020, wide),
        (6040, Change::Bank(1)),
    ];
    let bench = run(&preset::paper_rate(), &setup(7000), &script, &changes);
    let frames = &bench.rig.recording.frames;
    let modes = [11, 2001, 3011].map(|tick: usize| frames[tick].mode());
    assert_eq!(modes, [Mode::Rising, Mode::Running, Mode::Falling]);
    let mut wanted = [11, 2001, 3011, 6001, 6011].map(|tick| (tick, REFUSED)).to_vec();
    wanted.extend([(6033, ACCEPTED), (6041, ACCEPTED)]);
    assert_eq!(answers(frames), wanted);
    // A bank of a narrower range.
    let narrow = Bank {
        range_um: [0.1, 2.1],
        ..BANKS[1]
    };
    let narrow: &'static [Bank] = Box::leak(Box::new([BANKS[0], narrow]));
    for (banks, high_um, answer) in [(narrow, 2.2, REFUSED), (narrow, 2.1, ACCEPTED), (&[], 2.2, REFUSED)] {
        let setup = Setup { high_um, ..setup(2) };
        let mut controller = Controller::new(BANKS[0], &setup).with_banks(banks);
        let given = Change::Bank(1).orders().map(|order| {
            let adc = 32_768;
            controller.step(Input { adc, order }, false)
        });
        assert_eq!(given.last().unwrap().flags & (ACCEPTED | REFUSED), answer, "{high_um}");
    }
}

/// Orders of any kind at any time, on either stage.
fn script() -> impl Strategy<Value = (bool, Vec<(usize, Asked)>)> {
    let asked = prop_oneof![
        4 => Just(Asked::Order(START)),
        3 => Just(Asked::Order(STOP)),
        1 => Just(Asked::Order(Order::Clear)),
        6 => (0_u8..4).prop_map(Asked::Bank),
        1 => (0.0_f32..2.0).prop_map(Asked::Gain),
    ];
    (any::<bool>(), prop::collection::vec((1_usize..2500, asked), 1..24))
}

#[derive(Debug, Clone, Copy)]
enum Asked {
    Order(Order),
    Bank(u8),
    /// Of about the first table's gain.
    Gain(f32),
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever is asked whenever: the bank changes where it was acknowledged and nowhere else, at the safe level; the command stays
    /// within its limits and moves no faster than the slew.
    #[test]
    fn prop_banks_change_at_the_safe_level_alone((delay, asked) in script()) {
        let (mut script, mut changes, mut tick) = (Vec::new(), Vec::new(), 0);
        for (wait, asked) in asked {
            tick += wait;
            match asked {
                Asked::Order(order) => script.push((tick, order)),
                Asked::Bank(bank) => changes.push((tick, Change::Bank(bank))),
                Asked::Gain(share) => changes.push((tick, Change::Gains {
                    proportional_v_per_um: 0.0,
                    integral_v_per_um_s: share * 7500.0,
                })),
            }
            // A change takes up to nine ticks.
            tick += 9;
        }
        let config = if delay { preset::paper_delay() } else { preset::paper_rate() };
        let bench = run(&config, &setup(tick as u32 + 200), &script, &changes);
        let frames = &bench.rig.recording.frames;
        let [table, _] = tables(PAPER);
        let most_v = (table.slew_v_per_s / table.sample_rate_hz) as f32;
        let ramp_v = (table.ramp_v_per_s / table.sample_rate_hz) as f32;
        let mut bank = 0;
        for (k, frame) in frames.iter().enumerate() {
            let before = k.checked_sub(1).map_or((Mode::Off, 0.0), |k| (frames[k].mode(), frames[k].command_v));
            let applied = changes.iter().find_map(|(tick, change)| match change {
                Change::Bank(wanted) if tick + 1 == k => Some(*wanted),
                _ => None,
            });
            if let Some(wanted) = applied {
                let takes = before.0 == Mode::Off && wanted < 2;
                prop_assert_eq!(frame.flags & (ACCEPTED | REFUSED), if takes { ACCEPTED } else { REFUSED });
                if takes {
                    bank = wanted;
                }
            }
            prop_assert_eq!(frame.bank(), bank);
            // Rounded where the command is larger than its change.
            // A fault latches in the tick whose command the law has made.
            let most_v = if before.0 == Mode::Running { most_v } else { ramp_v };
            prop_assert!((frame.command_v - before.1).abs() <= most_v * 1.0001);
            prop_assert!((0.0..=table.output_max_v as f32).contains(&frame.command_v));
        }
    }
}
