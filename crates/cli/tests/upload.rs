//! `board upload`: a table for the slots of a board that is a process, and what runs after its new start.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

mod small_board;

use assert_cmd::cargo::CommandCargoExt;
use hysteron_board::host;
use hysteron_firmware::wire::{Input, Order};
use hysteron_slot::model::Tear;
use hysteron_table::{Table, hash};
use serde_json::Value;
use small_board::{SmallBoard, controller};
use std::path::Path;
use std::process::{Command, Output};

const OTHER: &str = include_str!("../../../firmware/tables/paper-delay-mrpi.toml");
const COMPLETE: &str = include_str!("../../../firmware/tables/tracking-739.toml");

/// The command with a table, at a board that serves one connection.
fn uploaded(mut board: SmallBoard, text: &str, more: &[&str]) -> (Output, SmallBoard) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.toml");
    std::fs::write(&path, text).unwrap();
    let to = board.address();
    let board = std::thread::spawn(move || {
        board.serve(0);
        board
    });
    let path = path.display().to_string();
    let args = [&["board", "upload", &path, "--to", &to], more].concat();
    let output = Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap();
    (output, board.join().unwrap())
}

/// An error's words, without the lines and the frame that it is printed in.
fn words(stderr: &[u8]) -> String {
    let text = String::from_utf8_lossy(stderr).replace('│', " ");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn said(output: &Output) -> String {
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Sent, taken, started anew; then a recorded run of it has, tick by tick, the codes of the host's law with that table.
#[test]
fn val_the_board_runs_what_was_uploaded() {
    let (output, board) = uploaded(SmallBoard::new(), OTHER, &["--restart"]);
    let text = said(&output);
    let hex: String = hash(OTHER).iter().map(|byte| format!("{byte:02x}")).collect();
    for wanted in [
        "taken: 504 bytes in slot 0, as table 0\n",
        "started anew: the board runs with it\n",
        &format!("table {hex}\n"),
        "  slot 0: slot = erased: no table was written here\n  slot 1: slot = erased: no table was written here\n",
    ] {
        assert!(text.contains(wanted), "`{text}` should say `{wanted}`");
    }
    let (dataset, board) = recorded(board, "0.05");
    // The recording names the table's file.
    assert!(dataset.contains(&hex), "{dataset}");
    let table = host::parameters(&Table::parse(OTHER).unwrap()).unwrap();
    let asked = [Order::None; 3000].into_iter();
    let mut law = controller(table);
    let orders = board.asked.iter().copied().chain(asked);
    let started = board.asked.iter().position(|order| *order == Order::Start).unwrap();
    // Up to the stop every order is in its place: the board ticks for each, then on by itself.
    let mut different = 0;
    for (tick, ([adc, dac], order)) in board.codes.iter().zip(orders).enumerate() {
        let order = if tick > started { Order::None } else { order };
        different += usize::from(law.step(Input { adc: *adc, order }, false).dac != *dac);
        if tick >= started + 999 {
            break;
        }
    }
    assert!(board.codes.len() > started + 999, "{}", board.codes.len());
    assert_eq!(different, 0, "codes of the host's law");
    let moved = board.codes.iter().map(|[_, dac]| *dac);
    assert_ne!(moved.clone().min(), moved.max(), "it stood still");
}

/// A run that the host asks for, as a dataset's description.
fn recorded(mut board: SmallBoard, seconds: &str) -> (String, SmallBoard) {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recorded");
    let from = board.address();
    board.codes.clear();
    board.asked.clear();
    let board = std::thread::spawn(move || {
        board.serve(2600);
        board
    });
    let output = Command::cargo_bin("hysteron")
        .unwrap()
        .args(["board", "record", "--from", &from, "--run", "--seconds", seconds, "-o"])
        .arg(&place)
        .output()
        .unwrap();
    said(&output);
    (read(&place), board.join().unwrap())
}

fn read(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("dataset.toml")).unwrap()
}

/// Without --restart the table is in force from the next start on; the second goes to the other slot.
#[test]
fn val_json_says_what_became_of_it() {
    let (output, mut board) = uploaded(SmallBoard::new(), OTHER, &["--json"]);
    let answer: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!(answer["taken"], true);
    assert_eq!((&answer["slot"], &answer["sequence"]), (&0.into(), &0.into()));
    assert_eq!(answer["bytes"], 504);
    assert_eq!((&answer["refused"], &answer["runs"]), (&Value::Null, &Value::Null));
    board.start();
    let (output, _) = uploaded(board, OTHER, &["--json"]);
    let answer: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!((&answer["slot"], &answer["sequence"]), (&1.into(), &1.into()));
    assert_eq!(answer["slots"][0], "slot 0: table 0 runs");
}

/// What the board refuses, with the field, its value and what is allowed; exit code 2, and in JSON the same.
#[test]
fn refuse_what_does_not_fit_the_image() {
    let (output, board) = uploaded(SmallBoard::new(), COMPLETE, &["--json"]);
    assert_eq!(output.status.code(), Some(2));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["taken"], false);
    assert_eq!(answer["refused"]["field"], "length");
    let other = OTHER.replacen("ramp_v_per_s = ", "ramp_v_per_s = 1", 1);
    let (output, mut board) = uploaded(board, &other, &[]);
    assert_eq!(output.status.code(), Some(2));
    let text = words(&output.stderr);
    assert!(
        text.contains("refuses the table and keeps the one that it has: ramp_v_per_s = 1"),
        "{text}"
    );
    assert!(text.contains("as in the image's first table"), "{text}");
    board.start();
    let slots = board.stored.answers().map(|answer| answer.to_string());
    assert_eq!(slots[0], "slot 0: slot = erased: no table was written here");
}

/// The power fails while the board writes: what it then says is an error here, and the board has the old table.
#[test]
fn refuse_a_flash_that_fails() {
    let mut board = SmallBoard::new();
    board.stored.flash().cut(9, Tear::Mixed(5));
    let (output, mut board) = uploaded(board, OTHER, &["--restart"]);
    assert_eq!(output.status.code(), Some(2));
    let text = words(&output.stderr);
    assert!(text.contains("the flash did not take or give it"), "{text}");
    board.stored.flash().power_on();
    board.start();
    let (output, _) = uploaded(board, OTHER, &["--restart"]);
    assert!(said(&output).contains("started anew: the board runs with it"));
}

/// Nobody there, a file, a table that is none.
#[test]
fn refuse_what_is_no_board() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.toml");
    std::fs::write(&path, OTHER).unwrap();
    let ask = |table: &Path, to: &str| {
        let args = ["board", "upload", &table.display().to_string(), "--to", to];
        let output = Command::cargo_bin("hysteron").unwrap().args(args).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        words(&output.stderr)
    };
    let file = path.display().to_string();
    assert!(ask(&path, &file).contains("a file takes no orders"));
    assert!(ask(&path, "127.0.0.1:1").contains("127.0.0.1:1"));
    std::fs::write(&path, OTHER.replacen("alpha_s", "alfa_s", 1)).unwrap();
    assert!(ask(&path, "127.0.0.1:1").contains("unknown field `alfa_s`"));
}
