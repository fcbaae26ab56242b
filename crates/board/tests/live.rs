//! A simulated board over one connection: watched, changed, recorded, given another table, and lost.
#![expect(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a test that cannot run its subject fails, one that is skipped says so"
)]

mod common;

use hysteron_board::capture::{Start, Wish, capture};
use hysteron_board::live::{Ask, Live};
use hysteron_board::scope::{Channel, Window};
use hysteron_board::served::{NAME, Served};
use hysteron_board::slots::{packed, upload};
use hysteron_board::telemetry::About;
use hysteron_board::{BoardError, Machine, Mode, Request, Shape};
use hysteron_plant::{Stage, preset};
use hysteron_table::Table;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::time::Duration;

/// Longest wait for what comes in milliseconds on an idle machine.
const PATIENCE: Duration = Duration::from_secs(60);

fn text(name: &str) -> String {
    let path = format!("{}/../../firmware/tables/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).unwrap()
}

fn stage(name: &str) -> Stage {
    Stage::new(&preset::named(name).unwrap(), 1).unwrap()
}

fn board() -> Served {
    Served::start(&text("tracking-8k"), stage("8k")).unwrap()
}

fn connected(board: &Served) -> Live {
    let live = Live::open(board.address()).unwrap();
    let known = live.wait(PATIENCE, |status| !status.tables.is_empty() && !status.axes.is_empty());
    assert_eq!((known.name.as_str(), known.tables.len()), (NAME, 1));
    assert_eq!((known.rate_hz, known.axes[0].mode), (Some(50_000.0), Mode::Off));
    live
}

fn sine(hz: f64, seconds: f64) -> [Option<Wish>; 1] {
    let request = Request {
        shape: Shape::Sine,
        frequency_hz: hz,
        range_um: None,
        seconds,
        feedforward: true,
        feedback: true,
    };
    [Some(Wish {
        bank: 0,
        request,
        upload: None,
    })]
}

#[test]
fn val_a_reference_is_played_recorded_and_seen() {
    let board = board();
    let live = connected(&board);
    live.record(0.2, &sine(100.0, 0.2)).unwrap();
    assert!(matches!(live.record(0.2, &[]), Err(BoardError::Taking)));
    assert!(matches!(live.ask(Ask::Play(&sine(50.0, 1.0))), Err(BoardError::Taking)));
    live.wait(PATIENCE, |status| status.recording.is_none());
    let captures = live.recorded().unwrap().unwrap();
    let [capture] = captures.as_slice() else {
        panic!("{} axes", captures.len())
    };
    assert_eq!(
        (capture.counts.lost, capture.counts.restarts, capture.pieces.len()),
        (0, 0, 1)
    );
    let recording = &capture.pieces[0].recording;
    assert!(recording.frames.len() >= 10_000, "{}", recording.frames.len());
    let table = capture.about.hello;
    let span_um = f64::from(table.input_max_um - table.input_min_um);
    assert!(
        recording.rms_um() < 2e-3 * span_um,
        "{} of {span_um} um",
        recording.rms_um()
    );
    // At the end it was asked to stop.
    live.wait(PATIENCE, |status| status.axes[0].mode == Mode::Off);

    // The same in the scope, which a trigger holds still.
    live.ask(Ask::Start).unwrap();
    live.wait(PATIENCE, |status| status.axes[0].mode == Mode::Running);
    let middle_um = f64::from(table.input_min_um + table.input_max_um) / 2.0;
    let window = Window {
        ticks: 1000,
        trigger: Some((Channel::Reference, middle_um)),
    };
    let come = live.status().axes[0].samples + 3000;
    live.wait(PATIENCE, |status| status.axes[0].samples > come);
    let scope = live.scope(0, &window).unwrap();
    assert!(scope.triggered && scope.running.iter().all(|running| *running));
    assert!(scope.reference_um[99] < middle_um && scope.reference_um[100] >= middle_um);
    let figures = scope.figures().unwrap();
    assert_eq!(figures.ticks, 1000);
    assert!(
        figures.rms_um < 2e-3 * span_um && figures.most_um >= figures.rms_um,
        "{figures:?}"
    );
    assert!((figures.span_um / (0.96 * span_um) - 1.0).abs() < 0.01, "{figures:?}");
    assert!(live.scope(1, &window).is_none(), "a second axis of a board with one");
}

/// By UDP the same: described, asked and answered over the connection, and every sample in a datagram.
#[test]
fn val_samples_by_udp_are_all_there() {
    let board = board();
    let live = Live::open(&format!("udp://{}", board.address())).unwrap();
    let known = live.wait(PATIENCE, |status| !status.tables.is_empty() && !status.axes.is_empty());
    assert_eq!((known.name.as_str(), known.rate_hz), (NAME, Some(50_000.0)));
    live.record(0.5, &sine(100.0, 0.5)).unwrap();
    live.wait(PATIENCE, |status| status.recording.is_none());
    let captures = live.recorded().unwrap().unwrap();
    let counts = captures[0].counts;
    assert_eq!((counts.lost, counts.restarts, counts.foreign_bytes), (0, 0, 0));
    assert!(counts.samples >= 25_000 && captures[0].pieces.len() == 1, "{counts:?}");
    live.wait(PATIENCE, |status| status.axes[0].mode == Mode::Off);
}

/// A board that nothing of comes by UDP is no silent one: the reason says how to go on.
#[test]
fn error_no_datagram_comes() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let to = format!("udp://{}", server.local_addr().unwrap());
    let board = std::thread::spawn(move || {
        let (mut connection, _) = server.accept().unwrap();
        // It describes itself, and goes on doing so.
        while connection.write_all(&About::of(NAME).to_packet()).is_ok() {
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    let recorded = capture(&to, 1.0, Start::Nobody, &mut |_| {});
    board.join().unwrap();
    let said = recorded.unwrap_err().to_string();
    assert!(
        said.contains("without udp:// samples come over the connection"),
        "{said}"
    );
}

#[test]
fn val_every_change_has_its_answer() {
    let board = board();
    let live = connected(&board);
    live.ask(Ask::Gains(0, [0.0, 100.0])).unwrap();
    live.ask(Ask::Play(&sine(20.0, 1.0))).unwrap();
    let status = live.wait(PATIENCE, |status| status.answers.len() == 3);
    let names: Vec<&str> = status.answers.iter().map(|answered| answered.what).collect();
    assert_eq!(names, ["other gains", "another reference", "other parts"]);
    assert!(
        status
            .answers
            .iter()
            .all(|answered| answered.accepted && answered.tick.is_some())
    );
    // While the loop runs, it keeps its reference; the parts that were to follow are not asked for.
    live.ask(Ask::Start).unwrap();
    live.wait(PATIENCE, |status| status.axes[0].mode == Mode::Running);
    live.ask(Ask::Play(&sine(30.0, 1.0))).unwrap();
    let status = live.wait(PATIENCE, |status| {
        status.answers.len() == 4 && status.waits_for.is_none()
    });
    let last = status.answers.last().unwrap();
    assert_eq!((last.what, last.accepted), ("another reference", false));
    live.ask(Ask::Stop).unwrap();
    live.wait(PATIENCE, |status| status.axes[0].mode == Mode::Off);
    // What its tables do not allow is not asked for at all.
    let mut far = sine(20.0, 1.0);
    far[0].as_mut().unwrap().request.range_um = Some([-5.0, 1.0]);
    assert!(matches!(live.ask(Ask::Play(&far)), Err(BoardError::Setup { .. })));
    assert!(matches!(
        live.ask(Ask::Play(&[None, sine(20.0, 1.0)[0]])),
        Err(BoardError::OneAxis)
    ));
}

#[test]
fn val_another_table_runs_after_a_restart() {
    let board = board();
    let first = connected(&board).status().tables[0][0].hash;
    let other = text("tracking-8k").replace("\nsafe_v = ", "\n# another file\nsafe_v = ");
    let table = Table::parse(&other).unwrap();
    let verdict = upload(board.address(), &packed(&table, &other).unwrap(), true, &mut |_| {}).unwrap();
    assert_eq!((verdict.taken, verdict.runs), (Ok((0, 0)), Some(true)));
    let now = connected(&board).status().tables[0][0].hash;
    assert!(now != first && now == hysteron_table::hash(&other));
    // A table of another family has no room there; the one that runs stays.
    let paper = text("paper-rate-mpi");
    let verdict = upload(
        board.address(),
        &packed(&Table::parse(&paper).unwrap(), &paper).unwrap(),
        true,
        &mut |_| {},
    );
    assert!(verdict.unwrap().taken.is_err());
    assert_eq!(connected(&board).status().tables[0][0].hash, now);
}

#[test]
fn val_the_end_of_a_connection_stops_the_loop() {
    let board = board();
    let live = connected(&board);
    live.ask(Ask::Start).unwrap();
    live.wait(PATIENCE, |status| status.axes[0].mode == Mode::Running);
    drop(live);
    // Whoever comes next finds it at its safe level, or on the way there.
    let live = Live::open(board.address()).unwrap();
    let status = live.wait(PATIENCE, |status| {
        status.axes.first().is_some_and(|axis| axis.mode == Mode::Off)
    });
    assert_eq!(status.axes[0].mode, Mode::Off);
    drop(board);
    let status = live.wait(PATIENCE, |_| false);
    assert!(status.ended.is_some());
    assert!(matches!(live.ask(Ask::Start), Err(BoardError::Over(_))));
}

/// The emulator's board behind the same bytes: what the image computes, without slots.
#[test]
fn val_an_image_in_the_emulator_is_a_board() {
    let Some(image) = common::image("tables/tracking-8k") else {
        return;
    };
    let board = Served::emulated(Machine::Mps2An386, &image, stage("8k")).unwrap();
    let live = Live::open(board.address()).unwrap();
    live.wait(PATIENCE, |status| !status.tables.is_empty());
    live.record(0.05, &sine(100.0, 0.05)).unwrap();
    let status = live.wait(PATIENCE, |status| status.recording.is_none());
    assert_eq!(status.name, "mps2-an386");
    let captures = live.recorded().unwrap().unwrap();
    let recording = &captures[0].pieces[0].recording;
    assert!(recording.frames.len() >= 2500 && captures[0].counts.lost == 0);
    assert!(recording.rms_um() < 0.02, "{} um", recording.rms_um());
    drop(live);
    let table = text("tracking-8k");
    let sent = upload(
        board.address(),
        &packed(&Table::parse(&table).unwrap(), &table).unwrap(),
        true,
        &mut |_| {},
    );
    assert!(matches!(sent, Err(BoardError::NotHeard { .. })), "{sent:?}");
}

/// What is lost on the way is counted, and shown as what it is.
#[test]
fn val_lost_ticks_are_counted_and_none() {
    let board = board();
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let between = server.local_addr().unwrap().to_string();
    let to = board.address().to_owned();
    std::thread::spawn(move || {
        let (mut host, _) = server.accept().unwrap();
        let mut board = std::net::TcpStream::connect(to).unwrap();
        let mut buffer = [0; 4096];
        let mut at = 0;
        while let Ok(length @ 1..) = board.read(&mut buffer) {
            // A kilobyte of every megabyte is lost.
            let from = at;
            at += length;
            if from >> 20 == at >> 20 && host.write_all(&buffer[..length]).is_err() {
                return;
            }
        }
    });
    let live = Live::open(&between).unwrap();
    let status = live.wait(PATIENCE, |status| status.axes.first().is_some_and(|axis| axis.lost > 0));
    let axis = status.axes[0];
    assert!(axis.lost < axis.samples / 20, "{axis:?}");
    let window = Window {
        ticks: 131_072,
        trigger: None,
    };
    let scope = live.scope(0, &window).unwrap();
    let holes = scope.position_um.iter().filter(|um| um.is_nan()).count() as u64;
    assert_eq!(scope.position_um.len(), 131_072);
    let (held, since) = (131_072 - holes, live.status().axes[0]);
    assert!(
        held <= since.samples && holes + held + since.lost >= since.samples.min(131_072),
        "{holes} {since:?}"
    );
    assert_eq!(scope.figures(), None);
}

#[test]
fn refuse_what_is_no_board() {
    let stage = stage("8k");
    let paper = text("paper-rate-mpi");
    assert!(matches!(
        Served::start(&paper, stage.clone()),
        Err(BoardError::Table(_))
    ));
    assert!(matches!(Served::start("x", stage), Err(BoardError::Table(_))));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("captured");
    std::fs::write(&file, [0; 100]).unwrap();
    assert!(matches!(
        Live::open(&file.display().to_string()),
        Err(BoardError::NotAsked(_))
    ));
    assert!(matches!(Live::open("127.0.0.1:1"), Err(BoardError::Source { .. })));
}
