//! `board record` as a user meets it: a server here sends what a board's would.

#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]

mod small_board;

use assert_cmd::Command;
use hysteron_board::budget::BOARDS;
use hysteron_data::read_dataset;
use hysteron_firmware::monitor::Fault;
use hysteron_firmware::table;
use hysteron_firmware::telemetry::{About, Requested, Requests, Sample};
use hysteron_firmware::wire::{Frame, Mode, Order, flags};
use small_board::SmallBoard;
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
        Sample {
            frame,
            adc: code + 7,
            axis: 0,
        }
        .to_packet()
    };
    numbers.into_iter().flat_map(packet).collect()
}

/// Runs the command at a server that sends a stream and closes; one that is asked to run hears everything first.
fn record(stream: &[u8], folder: &Path, more: &[&str]) -> Output {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let from = server.local_addr().unwrap().to_string();
    let (stream, asked) = (stream.to_vec(), more.contains(&"--run"));
    let sender = std::thread::spawn(move || {
        let (mut connection, _) = server.accept().unwrap();
        // Pieces that end anywhere. Whoever has enough closes before the end.
        let _ = stream.chunks(1009).try_for_each(|chunk| connection.write_all(chunk));
        if asked {
            let _ = std::io::copy(&mut connection, &mut std::io::sink());
        }
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
        "known delay 22.2 us, computed",
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
        let mut orders = Requests::default();
        let mut asked = |connection: &mut TcpStream| loop {
            let mut byte = [0];
            connection.read_exact(&mut byte).unwrap();
            if let Some(Requested::Order(order)) = orders.push(byte[0]) {
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

fn recorded_from_board(folder: &Path, started: bool, more: &[&str]) -> (Output, Vec<Order>, Vec<f32>) {
    let mut board = SmallBoard::new();
    let from = board.address();
    if started {
        board.tick(Order::Start);
    }
    let board = std::thread::spawn(move || {
        board.serve(999);
        board
    });
    let folder = folder.display().to_string();
    let args = [&["board", "record", "--from", &from, "--run", "-o", &folder], more].concat();
    let output = Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap();
    let SmallBoard { asked, played, .. } = board.join().unwrap();
    (output, asked, played)
}

/// A reference and parts that the host asks for: the board answers each change, then starts, and the recording begins there.
#[test]
fn val_a_board_plays_what_the_host_asks_for() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("triangle");
    let (low, high) = (table::INPUT_MAX_UM * 0.25, table::INPUT_MAX_UM * 0.75);
    let [low_um, high_um] = [low, high].map(|um| um.to_string());
    let wanted = [
        "--shape",
        "triangle",
        "--hz",
        "250",
        "--low",
        &low_um,
        "--high",
        &high_um,
        "--no-feedback",
        "--seconds",
        "0.02",
    ];
    let (output, asked, played) = recorded_from_board(&place, false, &wanted);
    assert!(answered(&output).contains("0 lost"));
    // 13 bytes of the reference, 2 of the parts, each with its end; then the start and, 0.02 s later, the stop.
    assert_eq!(asked.len(), 14 + 3 + 2);
    assert_eq!(asked[17..], [Order::Start, Order::Stop]);
    let record = &read_dataset(&place).unwrap().records[0];
    // On the ramp, and then what the board played, from its first sample on.
    let reference = record.reference_um.as_ref().unwrap();
    assert_eq!(record.position_um.len(), reference.len());
    let turned = |wanted: f32| played.iter().any(|um| (um - wanted).abs() < 0.01 * (high - low));
    assert!(turned(low) && turned(high), "{low} {high}");
    assert!(played.iter().all(|um| (low..=high).contains(um)));
    // 250 Hz at 50 kHz: the same again after 200 samples.
    assert!((played[300] - played[500]).abs() < 1e-4 * (high - low));
    assert!(played[300] != played[400]);
    // Points of one's own go up in chunks of eight.
    let points = folder.path().join("points.csv");
    let text: String = (0..256)
        .map(|i| format!("{}\n", low + (high - low) * (i % 128) as f32 / 127.0))
        .collect();
    std::fs::write(&points, text).unwrap();
    let place = folder.path().join("points");
    let points = points.display().to_string();
    let wanted = ["--trajectory", &points, "--hz", "250", "--seconds", "0.02"];
    let (output, asked, _) = recorded_from_board(&place, false, &wanted);
    answered(&output);
    assert_eq!(asked.len(), 32 * 18 + 14 + 3 + 2);
}

/// What the board's table does not allow is said before anything is asked; what the board refuses or does not answer, after.
#[test]
fn refuse_what_the_board_does_not_play() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recorded");
    for (wanted, said) in [
        (&["--bank", "7"][..], "bank 7: the image has 1"),
        (&["--hz", "9000"], "frequency, hertz = 9000 must lie in 0.001 to 5000"),
        (
            &["--low", "-1e3", "--high", "5"],
            "lowest reference, micrometres = -1000",
        ),
    ] {
        let (output, asked, _) = recorded_from_board(&place, false, wanted);
        let refusal = refused(&output);
        assert!(refusal.contains(said), "`{refusal}` should say `{said}`");
        assert_eq!(asked, [Order::Stop], "it is told to stop in any case");
    }
    // A board that runs already, after the 14 orders of a reference, and one that knows no changes.
    let (output, ..) = recorded_from_board(&place, true, &["--hz", "20"]);
    let busy = refused(&output);
    assert!(
        busy.contains("the board refused, at tick 14, another reference"),
        "{busy}"
    );
    let stream = [about("nucleo-h743zi"), packets(0..300_000, None)].concat();
    let silent = refused(&record(&stream, &place, &["--run", "--hz", "20"]));
    assert!(
        silent.contains("the board did not answer when it was asked for another reference"),
        "{silent}"
    );
    let place_text = place.display().to_string();
    let args = [
        "board",
        "record",
        "--from",
        "localhost:1",
        "-o",
        &place_text,
        "--hz",
        "20",
    ];
    let unasked = refused(&Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap());
    assert!(unasked.contains("give --run as well"), "{unasked}");
    assert!(!place.exists(), "nothing is written");
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
        (closed.as_str(), "1", "give a file or device that is there, HOST:PORT"),
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

/// Gain 0.03125, zero -0.5 um and lag 0.75 samples, 15 us, of a law that learns, a bit a frame.
#[test]
fn val_a_recording_says_what_was_learned() {
    let words = [0x3d00_0000_u32, 0xbf00_0000, 0x3f40_0000, 1];
    let frame = |number: u32| Frame {
        number,
        reference_um: 1.0,
        command_v: 1.0,
        dac: 30_000,
        flags: flags(false, Mode::Running, None)
            | ((words[(number / 32 % 4) as usize] >> (number % 32)) as u16 & 1) << 3,
    };
    let sample = |number| Sample {
        frame: frame(number),
        adc: 30_000,
        axis: 0,
    };
    let stream: Vec<u8> = (0..2000).flat_map(|number| sample(number).to_packet()).collect();
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recorded");
    let stream = [about("nucleo-h743zi"), stream].concat();
    let said = answered(&record(&stream, &place, &["--seconds", "0.02"]));
    assert!(
        said.contains("learned by the end: gain +3.125 %, zero -0.5000 um, lag +15.00 us\n"),
        "{said}"
    );
    let more = ["--seconds", "0.02", "--overwrite", "--json"];
    let said: serde_json::Value = serde_json::from_str(&answered(&record(&stream, &place, &more))).unwrap();
    assert_eq!(said["adapted"]["zero_um"], -0.5);
}
