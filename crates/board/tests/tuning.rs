//! Gains, reference and parts changed while the image runs: acknowledged, in force from that tick on, or refused as a whole.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

mod common;
mod scripted;

use common::image;
use hysteron_board::{Machine, Request, Rig, Session, Shape, drive_here};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::monitor::Fault;
use hysteron_firmware::table;
use hysteron_firmware::trajectory::{CHUNK_POINTS, TABLE_POINTS};
use hysteron_firmware::tuning::Change;
use hysteron_firmware::wire::{ACCEPTED, Frame, Hello, Mode, Order, REFUSED, Setup};
use hysteron_plant::{Stage, preset};
use scripted::{Scripted, answers};
use std::time::Duration;

/// A run here with changes at ticks, and, where there is an emulator, the same frames from it.
fn run(ticks: u32, script: &[(usize, Order)], changes: &[(usize, Change)]) -> Vec<Frame> {
    let hello = Hello {
        hash: table::HASH,
        sample_rate_hz: table::SAMPLE_RATE_HZ,
        input_min_um: table::INPUT_MIN_UM,
        input_max_um: table::INPUT_MAX_UM,
        bank: 0,
        banks: 1,
        axes: 1,
        complete: false,
    };
    let request = Request {
        shape: Shape::Sine,
        frequency_hz: 100.0,
        range_um: None,
        seconds: f64::from(ticks) / 50e3,
        feedforward: true,
        feedback: true,
    };
    let setup = Setup {
        ticks,
        clocked: false,
        ..request.setup(&hello).unwrap()
    };
    let rig = Rig::new(Stage::new(&preset::paper_rate(), 3).unwrap(), request.seconds);
    let mut bench = Scripted::new(rig, ticks, script, changes);
    let mut controller = Controller::new(table::parameters().unwrap(), &setup);
    drive_here(&mut controller, ticks, &mut bench);
    let frames = bench.rig.recording.frames;
    let machine = Machine::Mps2An386;
    if let Some(image) = image(machine.name()) {
        let mut session = Session::start(machine, &image, Duration::from_secs(300)).unwrap();
        let (board, _) = session.replay(&setup, &bench.inputs).unwrap();
        for (board, here) in board.iter().zip(&frames) {
            assert_eq!(board.to_bytes(), here.to_bytes(), "{board:?} {here:?}");
        }
    }
    frames
}

const fn gains(proportional_v_per_um: f32, integral_v_per_um_s: f32) -> Change {
    Change::Gains {
        proportional_v_per_um,
        integral_v_per_um_s,
    }
}

/// Doubled gains act from the acknowledged tick on; gains that no loop has are refused and change nothing.
#[test]
fn val_gains_at_run_time() {
    let start = [(0, Order::Start)];
    let plain = run(4000, &start, &[]);
    let same = run(4000, &start, &[(2000, gains(-1.0, 1.0)), (2100, gains(0.0, f32::NAN))]);
    assert_eq!(answers(&same), [(2008, REFUSED), (2108, REFUSED)]);
    let commands = |frames: &[Frame]| frames.iter().map(|frame| frame.command_v.to_bits()).collect::<Vec<_>>();
    assert_eq!(commands(&plain), commands(&same));
    let doubled = run(4000, &start, &[(2000, gains(0.0, 2.0 * table::INTEGRAL_V_PER_UM_S))]);
    assert_eq!(answers(&doubled), [(2008, ACCEPTED)]);
    assert_eq!(commands(&plain)[..2008], commands(&doubled)[..2008]);
    assert!(commands(&plain)[2008..] != commands(&doubled)[2008..]);
    // Far too high: the monitor sees what comes of it.
    let wild = run(
        20_000,
        &start,
        &[(2000, gains(0.0, 100.0 * table::INTEGRAL_V_PER_UM_S))],
    );
    let fault = wild.iter().find_map(Frame::fault);
    let runaway = [
        Fault::Oscillation,
        Fault::SensorJump,
        Fault::Saturated,
        Fault::Disagreement,
    ];
    assert!(fault.is_some_and(|fault| runaway.contains(&fault)), "{fault:?}");
    assert_eq!(wild.last().unwrap().command_v, table::SAFE_V);
}

/// Another reference is refused while the loop runs, and taken at the safe level.
#[test]
fn val_references_at_run_time() {
    let triangle = Change::Trajectory {
        shape: Shape::Triangle,
        // 200 Hz at 50 kHz.
        phase_step: 17_179_869,
        low_um: 0.5,
        high_um: 1.5,
    };
    let outside = Change::Trajectory {
        shape: Shape::Sine,
        phase_step: 17_179_869,
        low_um: 0.5,
        high_um: 9.0,
    };
    let parts = Change::Parts {
        feedforward: true,
        feedback: false,
    };
    let table = Change::Trajectory {
        shape: Shape::Table,
        // 100 Hz at 50 kHz, to a part in 10^9.
        phase_step: 8_589_935,
        low_um: 0.5,
        high_um: 1.5,
    };
    let steps = Change::Trajectory {
        shape: Shape::Steps,
        phase_step: 8_589_935,
        low_um: 0.5,
        high_um: 1.5,
    };
    let chunk = |chunk: usize| Change::Chunk {
        chunk: chunk as u8,
        shares: std::array::from_fn(|i| share((CHUNK_POINTS * chunk + i) as f64).round() as u16),
    };
    let chunks = TABLE_POINTS / CHUNK_POINTS;
    let script = [
        (0, Order::Start),
        (2000, Order::Stop),
        (5000, Order::Start),
        (9000, Order::Stop),
        (13_000, Order::Start),
        (16_000, Order::Stop),
        (19_000, Order::Start),
    ];
    let mut changes = vec![(1000, triangle), (4000, outside), (4100, triangle), (4200, parts)];
    // While it runs, and one chunk too many.
    changes.extend([(6000, chunk(0)), (11_000, chunk(chunks))]);
    changes.extend((0..chunks).map(|k| (11_100 + 18 * k, chunk(k))));
    changes.extend([(12_000, table), (18_000, steps)]);
    let frames = run(22_000, &script, &changes);
    let mut wanted = vec![(1013, REFUSED), (4013, REFUSED), (4113, ACCEPTED), (4202, ACCEPTED)];
    wanted.extend([(6017, REFUSED), (11_017, REFUSED)]);
    wanted.extend((0..chunks as u32).map(|k| (11_117 + 18 * k, ACCEPTED)));
    wanted.extend([(12_013, ACCEPTED), (18_013, ACCEPTED)]);
    assert_eq!(answers(&frames), wanted);
    let running = |from: usize, to: usize| -> Vec<f32> {
        let running = frames[from..to].iter().filter(|frame| frame.mode() == Mode::Running);
        running.map(|frame| frame.reference_um).collect()
    };
    let references = running(5500, 9000);
    assert!(references.len() > 3000, "{}", references.len());
    let (low, high) = references
        .iter()
        .fold((f32::MAX, f32::MIN), |(low, high), &r| (low.min(r), high.max(r)));
    // A tick of 200 Hz moves a triangle of 1 um by 8 nm.
    assert!((low - 0.5).abs() < 0.009 && (high - 1.5).abs() < 0.009, "{low} {high}");
    // The table from its first point on, which the ramp has reached: straight lines between points that are rounded to a code.
    let references = running(13_000, 16_000);
    assert!(references.len() > 1900, "{}", references.len());
    for (k, &found) in references[1..].iter().enumerate() {
        let place = TABLE_POINTS as f64 * (k as f64 * 8_589_935.0 / 2_f64.powi(32)).fract();
        let exact = share(place.floor()) + (share(place.floor() + 1.0) - share(place.floor())) * place.fract();
        let exact_um = 0.5 + exact / 65_535.0;
        assert!(
            (f64::from(found) - exact_um).abs() < 0.5 / 65_535.0 + 1e-6,
            "{k}: {found} {exact_um}"
        );
    }
    // Every level is held; between them the stage is not made to ring, which the monitor would see.
    let references = running(19_000, 22_000);
    let held = references.windows(2).filter(|pair| pair[0] == pair[1]);
    let mut levels: Vec<f32> = held.map(|pair| pair[0]).collect();
    assert!(levels.len() > references.len() / 3, "{}", levels.len());
    levels.sort_by(f32::total_cmp);
    levels.dedup();
    assert_eq!(levels, [0.5, 0.75, 1.0, 1.25, 1.5]);
    assert!(frames.iter().all(|frame| frame.fault().is_none()));
}

/// A table's points: parabolas up and down, one period.
fn share(i: f64) -> f64 {
    let half = TABLE_POINTS as f64 / 2.0;
    65_535.0 * (1.0 - (i / half - 1.0).abs()).powi(2)
}
