//! Two axes on the board: the same codes as here, and each keeps its place while the other moves.
//!
//! Skipped, and said so, where there is no QEMU or no image, as `processor_in_loop.rs`.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

mod common;

use common::image;
use hysteron_board::host::{complete, hello};
use hysteron_board::two_axes::{TwoAxisBench, TwoAxisRig, TwoAxisSession, drive_both_here};
use hysteron_board::{Machine, Recording, Request, Shape};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Complete;
use hysteron_firmware::monitor::{Fault, WATCHDOG_SAMPLES};
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::tuning::Change;
use hysteron_firmware::two_axes::TwoAxes;
use hysteron_firmware::wire::{ACCEPTED, Frame, Input, Mode, Order, REFUSED, Setup};
use hysteron_plant::preset;
use hysteron_table::Table;
use std::time::Duration;

const TABLES: [&str; 2] = [
    include_str!("../../../firmware/tables/tracking-x.toml"),
    include_str!("../../../firmware/tables/tracking-y.toml"),
];
/// The stage's, as the tables have them.
const SHARES: [f64; 2] = [0.01, -0.006];

fn tables() -> [Table; 2] {
    TABLES.map(|text| Table::parse(text).unwrap())
}

fn rig(seconds: f64) -> TwoAxisRig {
    coupled(SHARES, seconds)
}

/// The stage where other shares couple.
fn coupled(shares: [f64; 2], seconds: f64) -> TwoAxisRig {
    let axes = [preset::tracking_8k(), preset::tracking_739()];
    TwoAxisRig::new([&axes[0], &axes[1]], shares, 7, seconds).unwrap()
}

/// A raster: X a triangle, Y a slow sine; or others.
fn setups(references: [(Shape, f64); 2], feedback: bool, seconds: f64) -> [Setup; 2] {
    let tables = tables();
    [0, 1].map(|axis| {
        let (shape, frequency_hz) = references[axis];
        let request = Request {
            shape,
            frequency_hz,
            range_um: Some([3.0, 13.0]),
            seconds,
            feedforward: true,
            feedback,
        };
        request.setup(&hello(&tables[axis], TABLES[axis])).unwrap()
    })
}

fn axes(tables: &[Table; 2], setups: &[Setup; 2]) -> TwoAxes<Complete, Complete> {
    let [x, y] = [0, 1].map(|axis| Controller::new(complete(&tables[axis]).unwrap(), &setups[axis]));
    TwoAxes::new(x, y)
}

/// Both cores, tick by tick against the stage with both axes: a raster and two sines, by the bits of every frame.
#[test]
fn val_two_axes_give_the_same_bits() {
    for (machine, name) in [
        (Machine::Mps2An386, "tracking-xy"),
        (Machine::Mps2An500, "tracking-xy-m7"),
    ] {
        let Some(image) = image(&format!("tables/{name}")) else {
            return;
        };
        let mut session = TwoAxisSession::start(machine, &image, Duration::from_secs(120)).unwrap();
        let tables = tables();
        let wanted = [0, 1].map(|axis| vec![hello(&tables[axis], TABLES[axis]).of_both(true)]);
        assert_eq!(session.banks(), &wanted, "the image has other tables: build it anew");
        for (references, feedback) in [
            ([(Shape::Triangle, 100.0), (Shape::Sine, 10.0)], true),
            ([(Shape::Sine, 503.0), (Shape::ComplexHarmonic, 97.0)], false),
        ] {
            let setups = setups(references, feedback, 0.05);
            let (mut there, mut here) = (rig(0.05), rig(0.05));
            let timing = session.run(&setups, &mut there, &mut |_| {}).unwrap();
            // By the sample clock: no tick late, none missing, and a tick of more than four fifths of a period is another algorithm.
            assert_eq!((timing.overruns, timing.lost), (0, 0), "{timing:?}");
            assert!(timing.latency_max - timing.latency_min <= 1, "{timing:?}");
            assert!(timing.tick_max > 0 && timing.tick_max < 400, "{timing:?}");
            println!("{name}: {timing:?}");
            drive_both_here(&mut axes(&tables, &setups), setups[0].ticks, &mut here);
            let [x, y] = [0, 1].map(|axis| complete(&tables[axis]).unwrap());
            let mut ahead = rig(0.05);
            session.run_ahead(&setups, (x, y), &mut ahead).unwrap();
            assert_eq!(ahead.recordings, here.recordings);
            for (board, host) in there.recordings.iter().zip(&here.recordings) {
                assert_eq!(board.frames.len(), setups[0].ticks as usize);
                for (board, host) in board.frames.iter().zip(&host.frames) {
                    assert_eq!(board.to_bytes(), host.to_bytes(), "{board:?} {host:?}");
                }
                let codes = board.frames.iter().map(|frame| frame.dac);
                assert!(codes.clone().max().unwrap() - codes.min().unwrap() > 10_000);
            }
        }
    }
}

/// What both axes of the stage did in an open-loop run of 0.2 s.
fn moved(tables: &[Table; 2]) -> [Recording; 2] {
    let setups = setups([(Shape::Sine, 31.0), (Shape::Sine, 97.0)], false, 0.2);
    let mut rig = rig(0.2);
    drive_both_here(&mut axes(tables, &setups), setups[0].ticks, &mut rig);
    rig.recordings
}

/// The tables without a word of the other axis.
fn alone() -> [Table; 2] {
    tables().map(|mut table| {
        table.controller.as_mut().unwrap().cross_um_per_um = None;
        table
    })
}

/// What of the other axis' motion is left in an axis: in open loop, where nothing else would take it away, less than a fifth of what it is
/// without the decoupling.
#[test]
fn val_axes_are_decoupled() {
    let errors = |tables: &[Table; 2]| moved(tables).map(|recording| recording.rms_um());
    let (with, without) = (errors(&tables()), errors(&alone()));
    for ((with, without), share) in with.into_iter().zip(without).zip(SHARES) {
        // A sine of 10 um from 3 to 13: its rms about 0 is 8.7 um.
        assert!(without > 0.8 * 8.7 * share.abs(), "{share}: {without} um without");
        assert!(with < 0.2 * without, "{share}: {with} um with, {without} um without");
    }
}

/// The same where all that was identified is how the other axis' voltage reaches this one: its command comes late by the preview, 0.1
/// to 0.2 of what couples at these rates, and a gain alone knows nothing of its loops.
#[test]
fn val_axes_are_decoupled_by_the_others_command() {
    let without = moved(&alone());
    // Micrometres a volt of each axis, by what it did.
    let span = |values: &[f64]| values.iter().fold(0.0, |most: f64, v| most.max(*v));
    let gains = without
        .each_ref()
        .map(|axis| span(&axis.position_um) / span(&axis.voltage_v));
    let mut coupled = alone();
    for (axis, table) in coupled.iter_mut().enumerate() {
        let gain = SHARES[axis] * gains[1 - axis];
        table.controller.as_mut().unwrap().coupling = Some([gain, 0.0, 0.0, 0.0]);
    }
    let with = moved(&coupled);
    for (with, without) in with.iter().zip(&without) {
        let (with, without) = (with.rms_um(), without.rms_um());
        assert!(with < 0.4 * without, "{with} um with, {without} um without");
    }
}

/// A fault of one axis brings both down, each to its own safe level, with the same fault latched.
#[test]
fn val_a_fault_of_one_axis_is_one_of_both() {
    let setups = setups([(Shape::Sine, 100.0), (Shape::Sine, 100.0)], true, 0.2);
    let mut axes = axes(&tables(), &setups);
    let mut rig = rig(0.2);
    drive_both_here(&mut axes, 3000, &mut rig);
    let last = rig
        .recordings
        .each_ref()
        .map(|recording| *recording.adc.last().unwrap());
    // The sensor of Y breaks off at once.
    let broken = |order| {
        [
            Input { adc: last[0], order },
            Input {
                adc: u16::MAX,
                order: Order::None,
            },
        ]
    };
    // Three readings at the end of the range, and the tick that brings it to the other axis.
    for _ in 0..3 {
        axes.step(broken(Order::None), false);
    }
    let frames = axes.step(broken(Order::None), false);
    for frame in frames {
        assert_eq!((frame.mode(), frame.fault()), (Mode::Falling, Some(Fault::SensorRange)));
    }
    let mut frames = frames;
    for _ in 0..1300 {
        frames = axes.step(broken(Order::None), false);
    }
    assert!(
        frames
            .iter()
            .all(|frame| frame.mode() == Mode::Off && frame.command_v == 0.0)
    );
    let again = axes.step(broken(Order::Start), false);
    assert!(again.iter().all(|frame| frame.mode() == Mode::Off), "a latched fault");
}

/// References of X and Y, of which one is fast, or both are.
const PAIRS: [[(Shape, f64); 2]; 5] = [
    [(Shape::Triangle, 100.0), (Shape::Sine, 10.0)],
    [(Shape::Sine, 10.0), (Shape::Triangle, 100.0)],
    [(Shape::Sine, 37.0), (Shape::Sine, 500.0)],
    [(Shape::Steps, 50.0), (Shape::Sine, 3.0)],
    [(Shape::Sine, 3.0), (Shape::Steps, 50.0)],
];

/// The first fault of either axis on a stage where the shares couple, in a run of 0.2 s and the way down after it.
fn fault_of(shares: [f64; 2], references: [(Shape, f64); 2], feedback: bool) -> Option<(u32, Fault)> {
    let setups = setups(references, feedback, 0.2);
    let mut rig = coupled(shares, 0.2);
    drive_both_here(&mut axes(&tables(), &setups), setups[0].ticks, &mut rig);
    let [x, y] = &rig.recordings;
    let frames = x.frames.iter().chain(&y.frames);
    let faults = frames.filter_map(|frame| Some((frame.number, frame.fault()?)));
    faults.min_by_key(|(number, _)| *number)
}

/// Whatever a stage couples beyond the tables, up to 8 % of the other's motion, is no fault of a sensor: on the way up, in motion in either
/// loop, on the way down. A quarter of it is another stage, of whichever axis.
#[test]
fn bva_what_couples_is_no_fault_of_the_sensor() {
    for references in PAIRS {
        for feedback in [false, true] {
            for beyond in [[0.08, -0.08], [-0.08, 0.08], [0.08, 0.08], [0.0, 0.0]] {
                let shares = [SHARES[0] + beyond[0], SHARES[1] + beyond[1]];
                let found = fault_of(shares, references, feedback);
                assert_eq!(found, None, "{beyond:?} {references:?} {feedback}");
            }
            for beyond in [[0.25, 0.0], [-0.25, 0.0], [0.0, 0.25], [0.0, -0.25]] {
                let shares = [SHARES[0] + beyond[0], SHARES[1] + beyond[1]];
                let found = fault_of(shares, references, feedback).map(|(_, fault)| fault);
                let other = Some(Fault::Disagreement);
                assert_eq!(found, other, "{beyond:?} {references:?} {feedback}");
            }
        }
    }
}

/// The stage, and what X's sensor says from a tick on, by its reading and the one at that tick, micrometres.
struct Wrong {
    rig: TwoAxisRig,
    at: u32,
    then_um: f64,
    sensor: fn(f64, f64, f64) -> f64,
}

/// Codes of a micrometre; code 0 is -25 um.
const CODES_A_UM: f64 = 65_536.0 / 50.0;

impl TwoAxisBench for Wrong {
    fn inputs(&mut self, number: u32) -> [Input; 2] {
        let [x, y] = self.rig.inputs(number);
        let um = f64::from(x.adc) / CODES_A_UM - 25.0;
        if number < self.at {
            self.then_um = um;
            return [x, y];
        }
        let seconds = f64::from(number - self.at) / 50e3;
        let adc = ((self.sensor)(um, self.then_um, seconds) + 25.0) * CODES_A_UM;
        let adc = adc.round().clamp(0.0, 65_535.0) as u16;
        [Input { adc, ..x }, y]
    }

    fn outputs(&mut self, frames: &[Frame; 2]) {
        self.rig.outputs(frames);
    }
}

/// What another axis may couple hides no wrong sensor for long: a row is a kind, the samples until it is a fault, by X's bound of 0.56 um
/// and a tenth of where Y is, and which faults say so.
#[test]
fn val_a_wrong_sensor_beside_a_moving_axis() {
    use Fault::{Disagreement, SensorJump, SensorStuck};
    type Sensor = fn(f64, f64, f64) -> f64;
    let kinds: [(&str, Sensor, u32, &[Fault]); 9] = [
        // 0.56 and 1.3 um at 2 um a millisecond are 47 samples.
        ("frozen", |_, then, _| then, 60, &[Disagreement, SensorStuck]),
        ("reversed", |um, _, _| -um, 4, &[SensorJump]),
        // From 13 um back to where it was, a quarter of a period.
        ("reversed in place", |um, then, _| 2.0 * then - um, 150, &[Disagreement]),
        ("halved", |um, _, _| 0.5 * um, 4, &[SensorJump]),
        ("+1 um", |um, _, _| um + 1.0, 4, &[SensorJump]),
        ("-1 um", |um, _, _| um - 1.0, 4, &[SensorJump]),
        ("+8 um", |um, _, _| um + 8.0, 4, &[SensorJump]),
        // 0.75 um as beside no other axis, 0.3 um where Y is at its lowest, and until it is there, 5000 samples.
        ("drift up", |um, _, s| um + 5.0 * s, 15_500, &[Disagreement]),
        ("drift down", |um, _, s| um - 5.0 * s, 15_500, &[Disagreement]),
    ];
    for (name, sensor, deadline, faults) in kinds {
        for feedback in [false, true] {
            for at in [2000, 2137] {
                let setups = setups(PAIRS[0], feedback, 1.0);
                let mut wrong = Wrong {
                    rig: rig(1.0),
                    at,
                    then_um: 0.0,
                    sensor,
                };
                drive_both_here(&mut axes(&tables(), &setups), at + deadline + 1300, &mut wrong);
                let found = wrong.rig.recordings.each_ref().map(|recording| {
                    let mut frames = recording.frames.iter();
                    let first = frames.find_map(|frame| Some((frame.number, frame.fault()?)));
                    (first, recording.frames.last().unwrap().mode())
                });
                println!("{name}, {feedback}, {at}: {found:?}");
                let [(Some((number, fault)), mode), (Some(_), mode_y)] = found else {
                    panic!("{name}: {found:?}");
                };
                assert!(
                    faults.contains(&fault) && number >= at && number - at < deadline,
                    "{name}: {found:?}"
                );
                assert_eq!([mode, mode_y], [Mode::Off; 2], "{name}");
                // As beside no other axis: 5 % of the reference's range, and what the shares couple of 13 um.
                let moved = &wrong.rig.true_um[0][at as usize..];
                let highest_um = moved.iter().fold(0.0, |most: f64, um| most.max(*um));
                assert!(highest_um < 13.0 + 0.5 + 0.13, "{name}: {highest_um} um");
            }
        }
    }
}

/// The stage, and an interrupt that does not come back from a tick.
struct Hanging {
    rig: TwoAxisRig,
    at: u32,
}

impl TwoAxisBench for Hanging {
    fn inputs(&mut self, number: u32) -> [Input; 2] {
        let [x, y] = self.rig.inputs(number);
        let order = if number == self.at { Order::Hang } else { x.order };
        [Input { order, ..x }, y]
    }

    fn outputs(&mut self, frames: &[Frame; 2]) {
        self.rig.outputs(frames);
    }
}

/// The watchdog takes both axes over: each falls within its slew, with the fault latched.
#[test]
fn val_the_watchdog_takes_both_over() {
    let Some(image) = image("tables/tracking-xy") else {
        return;
    };
    let setups = setups([(Shape::Sine, 100.0), (Shape::Sine, 31.0)], true, 0.1);
    let mut bench = Hanging {
        rig: rig(0.1),
        at: 3000,
    };
    let mut session = TwoAxisSession::start(Machine::Mps2An386, &image, Duration::from_secs(120)).unwrap();
    session.run(&setups, &mut bench, &mut |_| {}).unwrap();
    for (axis, table) in bench.rig.recordings.iter().zip(tables()) {
        assert!(axis.frames[3000].fault().is_none());
        // The hung tick has sent its frames; the next are the watchdog's.
        assert_eq!(
            axis.frames[3001].fault(),
            Some(Fault::Watchdog),
            "{WATCHDOG_SAMPLES} samples later"
        );
        let most_v = table.slew_v_per_s / table.sample_rate_hz;
        for pair in axis.voltage_v[3000..].windows(2) {
            assert!(
                (pair[1] - pair[0]).abs() <= 1.001 * most_v + 0.004,
                "{pair:?}, {most_v}"
            );
        }
        let last = axis.frames.last().unwrap();
        assert_eq!((last.mode(), last.fault()), (Mode::Off, Some(Fault::Watchdog)));
    }
}

/// Changes go to the axis that they are for: a bank to both, a reference to one, which the other's frames say nothing of.
#[test]
fn val_changes_reach_the_axis_they_are_for() {
    let tables = tables();
    let setups = setups([(Shape::Sine, 100.0), (Shape::Sine, 31.0)], true, 0.1);
    let banks = || -> &'static [Parameters<Complete>] {
        let both = tables.each_ref().map(|table| complete(table).unwrap());
        Box::leak(Box::new(both))
    };
    let [x, y] = setups.map(|setup| {
        let banks = banks();
        Controller::new(banks[0], &setup).with_banks(banks)
    });
    let mut axes = TwoAxes::new(x, y);
    let mut obey = |to: u8, change: Change| {
        let orders = std::iter::once(Order::To(to)).chain(change.orders());
        let frames = orders.map(|order| axes.step([Input { adc: 30_000, order }; 2], false));
        frames.last().unwrap()
    };
    let answers = |frames: &[Frame; 2]| frames.map(|frame| frame.flags & (ACCEPTED | REFUSED));
    let frames = obey(0, Change::Bank(1));
    assert_eq!(answers(&frames), [ACCEPTED; 2]);
    assert_eq!(frames.map(|frame| frame.bank()), [1; 2]);
    let reference = |low_um: f32| Change::Trajectory {
        shape: Shape::Triangle,
        phase_step: 1 << 20,
        low_um,
        high_um: 12.0,
    };
    // At rest a frame has the reference's first value.
    for (to, low_um, wanted, answered) in [
        (2, 4.0, [3.0, 4.0], [0, ACCEPTED]),
        (1, 5.0, [5.0, 4.0], [ACCEPTED, 0]),
        (2, -50.0, [5.0, 4.0], [0, REFUSED]),
        (0, 6.0, [6.0, 6.0], [ACCEPTED; 2]),
    ] {
        let frames = obey(to, reference(low_um));
        assert_eq!(answers(&frames), answered, "{to} {low_um}");
        let references = frames.map(|frame| frame.reference_um);
        for (um, wanted) in references.into_iter().zip(wanted) {
            assert!((um - wanted).abs() < 1e-4_f32, "{to} {low_um}: {references:?}");
        }
    }
}
