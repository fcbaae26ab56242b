//! `board record` as a user meets it: a server here sends what a board's would.

#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]

use assert_cmd::Command;
use hysteron_board::budget::BOARDS;
use hysteron_data::read_dataset;
use hysteron_firmware::monitor::Fault;
use hysteron_firmware::table;
use hysteron_firmware::telemetry::{About, Orders, Sample};
use hysteron_firmware::wire::{Frame, Mode, Order, flags};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Output;

fn about(board: &str) -> Vec<u8> {
    About::of(board).to_packet().to_vec()
}

/// A slow triangle and its answer, one packet a number.
fn packets(numbers: impl IntoIterator<Item = u32>, fault: Option<Fault>) -> Vec<u8> {
    let packet = |number: u32| {
        let code = 30_000 + (number % 4000) as u16;
        let frame = Frame {
            number,
            reference_um: 1.0 + number as f32 * 1e-5,
            command_v: 1.0,
            dac: code,
            flags: flags(false, Mode::Running, fault),
        };
        Sample { frame, adc: code + 7 }.to_packet()
    };
    numbers.into_iter().flat_map(packet).collect()
}

/// Runs the command at a server that sends a stream and closes.
fn record(stream: &[u8], folder: &Path, more: &[&str]) -> Output {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let from = server.local_addr().unwrap().to_string();
    let stream = stream.to_vec();
    let sender = std::thread::spawn(move || {
        let (mut connection, _) = server.accept().unwrap();
        // Pieces that end anywhere. Whoever has enough closes before the end.
        let _ = stream.chunks(1009).try_for_each(|chunk| connection.write_all(chunk));
    });
    let folder = folder.display().to_string();
    let args = [&["board", "record", "--from", &from, "-o", &folder], more].concat();
    let output = Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap();
    sender.join().unwrap();
    output
}

fn answered(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn refused(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let text = String::from_utf8_lossy(&output.stderr).replace(['│', '×'], " ");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A good stream becomes one record, cut at the length that was asked for.
#[test]
fn val_a_recording_without_loss() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recorded");
    let stream = [about("nucleo-h743zi"), packets(5..20_005, None)].concat();
    let output = record(&stream, &place, &["--seconds", "0.02"]);
    let said = answered(&output);
    let dataset = read_dataset(&place).unwrap();
    let [record_1] = &dataset.records[..] else {
        panic!("{} records", dataset.records.len())
    };
    let samples = record_1.voltage_v.len();
    // At least what was asked for; at most one read more.
    assert!((1000..4000).contains(&samples), "{samples}");
    assert!(
        said.starts_with(&format!("nucleo-h743zi: {samples} samples in")),
        "{said}"
    );
    assert!(said.contains("0 lost (0.000 %), 1 record without a gap"), "{said}");
    assert!((record_1.period_s - 20e-6).abs() < 1e-12);
    assert_eq!((record_1.position_um.len(), record_1.start_s), (samples, 0.0));
    let hash: String = table::HASH.iter().map(|byte| format!("{byte:02x}")).collect();
    assert!(
        dataset.description.ends_with(&format!("table {hash}")),
        "{}",
        dataset.description
    );
    let known_s = dataset.known.delay_s.unwrap();
    assert!((known_s - BOARDS[0].known_delay_s()).abs() < 1e-12, "{known_s}");
    let v = |code: f64| f64::from(table::DAC_MIN_V) + f64::from(table::DAC_TOP_V - table::DAC_MIN_V) * code / 65_535.0;
    assert!((record_1.voltage_v[0] - v(30_005.0)).abs() < 1e-4);
    // Refused before anything is asked of anybody.
    let place_text = place.display().to_string();
    let args = ["board", "record", "--from", "127.0.0.1:1", "-o", &place_text];
    let again = Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap();
    assert!(refused(&again).contains("already"), "{again:?}");
    answered(&record(&stream, &place, &["--seconds", "0.02", "--overwrite"]));
}

/// Gaps part the recording, garbage is passed over, and both are counted.
#[test]
fn val_a_recording_with_losses() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recorded");
    let stream = [
        // It came in the middle of a packet.
        packets([9], None)[11..].to_vec(),
        packets(10..600, None),
        about("nucleo-g474re"),
        packets(600..1000, None),
        b"Info : rtt: something else \xa5".to_vec(),
        packets(1500..2000, Some(Fault::SensorStuck)),
        packets([2001], None),
        packets(2010..2500, None)[..489 * 22 + 5].to_vec(),
    ]
    .concat();
    let output = record(&stream, &place, &["--json"]);
    let answer: serde_json::Value = serde_json::from_str(&answered(&output)).unwrap();
    let is = |field: &str, wanted: u64| assert_eq!(answer[field], wanted, "{field} of {answer}");
    is("samples", 990 + 500 + 1 + 489);
    // 1000 to 1499, 2000, 2002 to 2009.
    is("lost", 500 + 1 + 8);
    is("pieces", 3);
    is("alone", 1);
    is("foreign_bytes", 11 + 28 + 5);
    is("restarts", 0);
    is("fault", Fault::SensorStuck as u64);
    assert_eq!(answer["board"], "nucleo-g474re");
    assert_eq!(answer["tables_sha256"].as_array().map(Vec::len), Some(1));
    let dataset = read_dataset(&place).unwrap();
    let shapes: Vec<(&str, usize)> = dataset
        .records
        .iter()
        .map(|record| (record.file.as_str(), record.position_um.len()))
        .collect();
    assert_eq!(
        shapes,
        [("run-001.csv", 990), ("run-002.csv", 500), ("run-003.csv", 489)]
    );
    // 1490 ticks after the first.
    assert!((dataset.records[1].start_s - 1490.0 * 20e-6).abs() < 1e-9);
    // The text of the same stream says so, too; a captured file is as good as a server.
    let file = folder.path().join("captured");
    std::fs::write(&file, &stream).unwrap();
    let (file, place) = (file.display().to_string(), place.display().to_string());
    let args = ["board", "record", "--from", &file, "-o", &place, "--overwrite"];
    let said = answered(&Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap());
    for wanted in [
        "1980 samples in 0.050 s, 509 lost (20.450 %), 3 records without a gap",
        "1 samples between two gaps left out",
        "44 bytes that belong to no packet",
        "the stream ended before 10 s",
        "fault at tick 1500: SensorStuck",
        "known delay 21.3 us, computed",
    ] {
        assert!(said.contains(wanted), "{said}");
    }
}

/// With --run the board is asked to start once it has described itself, and to stop at the end.
#[test]
fn val_a_run_that_the_host_starts_and_stops() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recorded").display().to_string();
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let from = server.local_addr().unwrap().to_string();
    let board = std::thread::spawn(move || {
        let (mut connection, _) = server.accept().unwrap();
        connection.write_all(&about("nucleo-h743zi")).unwrap();
        let mut orders = Orders::default();
        let mut asked = |connection: &mut TcpStream| loop {
            let mut byte = [0];
            connection.read_exact(&mut byte).unwrap();
            if let Some(order) = orders.push(byte[0]) {
                return order;
            }
        };
        let first = asked(&mut connection);
        // What was asked for, and no more: then it waits.
        connection.write_all(&packets(0..500, None)).unwrap();
        (first, asked(&mut connection))
    });
    let args = [
        "board",
        "record",
        "--from",
        &from,
        "--run",
        "--seconds",
        "0.01",
        "-o",
        &place,
    ];
    let said = answered(&Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap());
    assert!(said.contains("500 samples in 0.010 s, 0 lost"), "{said}");
    assert_eq!(board.join().unwrap(), (Order::Start, Order::Stop));
}

/// Another board than those of the firmware has no known delay.
#[test]
fn val_a_board_of_ones_own() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recorded");
    let stream = [about("mine"), packets(0..100, None)].concat();
    assert!(answered(&record(&stream, &place, &[])).contains("no known delay of this board: measure it"));
    assert_eq!(read_dataset(&place).unwrap().known.delay_s, None);
}

#[test]
fn refuse_what_is_no_recording() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recorded");
    let other = [about("nucleo-h743zi"), packets(0..9, None), about("nucleo-g474re")].concat();
    for (said, wanted) in [
        (refused(&record(b"", &place, &[])), "no sample in 0 bytes"),
        (
            refused(&record(b"INFO  table 12\n", &place, &[])),
            "no sample in 15 bytes; this is not the telemetry",
        ),
        (
            refused(&record(&packets(0..9, None), &place, &[])),
            "9 samples came and no description",
        ),
        (
            refused(&record(&other, &place, &[])),
            "board or table changed within the stream",
        ),
    ] {
        assert!(said.contains(wanted), "`{said}` should say `{wanted}`");
    }
    let place_text = place.display().to_string();
    // A port that was free a moment ago.
    let closed = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .to_string();
    for (from, seconds, wanted) in [
        (
            closed.as_str(),
            "1",
            "give a file or device that is there, or HOST:PORT",
        ),
        ("no-such-file", "1", "no-such-file: "),
        ("/dev/null", "-1", "seconds = -1 must lie in 0.001 to 600"),
    ] {
        let args = [
            "board",
            "record",
            "--from",
            from,
            "--seconds",
            seconds,
            "-o",
            &place_text,
        ];
        let said = refused(&Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap());
        assert!(said.contains(wanted), "`{said}` should say `{wanted}`");
    }
    assert!(!place.exists(), "nothing is written");
}
