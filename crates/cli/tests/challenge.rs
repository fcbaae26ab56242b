//! `challenge` as a user meets it.
#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]

use assert_cmd::Command;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

fn hysteron(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(folder)
        .args(args)
        .output()
        .unwrap();
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8(text).unwrap().replace(['│', '×'], " ");
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    (output.status.code().unwrap(), text)
}

fn new(folder: &Path, name: &str, more: &[&str]) {
    let args = [&["challenge", "new", name, "--seed", "11", "--family", "mrpi"], more].concat();
    let (code, text) = hysteron(folder, &args);
    assert_eq!(code, 0, "{text}");
}

fn files(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

/// Of one stage, with one effect, another one, one outside of the catalogue or none: same files, same commands, same lists,
/// same size of the sealed file; no text has a name of what is hidden.
#[test]
fn val_the_folder_leaks_nothing() {
    let place = tempfile::tempdir().unwrap();
    let hidden = ["none", "delay", "slew-limit", "telegraph"];
    for effect in hidden {
        new(place.path(), &format!("riddle-{}", effect.len()), &["--effect", effect]);
    }
    let folder = |effect: &str| place.path().join(format!("riddle-{}", effect.len()));
    let first = files(&folder("none"));
    assert!(
        first.contains("sealed.txt") && first.contains("dataset.toml") && first.len() == 17,
        "{first:?}"
    );
    let of = |effect: &str, file: &str| fs::read_to_string(folder(effect).join(file)).unwrap();
    let without_position = |text: &str| -> Vec<String> {
        let header: Vec<&str> = text
            .lines()
            .find(|line| line.starts_with("time_s"))
            .unwrap()
            .split(',')
            .collect();
        let column = header.iter().position(|name| *name == "position_um").unwrap();
        let lines = text.lines().map(|line| {
            let cells = line.split(',').enumerate().filter(|(i, _)| *i != column);
            cells.map(|(_, cell)| cell).collect::<Vec<_>>().join(",")
        });
        lines.collect()
    };
    for effect in hidden {
        assert_eq!(files(&folder(effect)), first);
        assert_eq!(of(effect, "sealed.txt").len(), of("none", "sealed.txt").len());
        assert_eq!(of(effect, "dataset.toml"), of("none", "dataset.toml"));
        for file in &first {
            let text = of(effect, file);
            for name in hidden.iter().chain(&["weak", "medium", "strong", "mrpi"]) {
                assert!(!text.contains(name), "{effect}: {file} says {name}");
            }
            if file.ends_with(".csv") {
                assert_eq!(
                    without_position(&text),
                    without_position(&of("none", file)),
                    "{effect}: {file}"
                );
            }
        }
    }
}

#[test]
fn val_answer_then_reveal() {
    let place = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| hysteron(place.path(), args);
    new(place.path(), "riddle", &["--effect", "delay", "--strength", "strong"]);
    let (code, text) = run(&["challenge", "answer", "riddle", "delay", "first-order-lag"]);
    assert_eq!((code, text.as_str()), (0, "answer taken: delay, first-order-lag"));
    let (code, text) = run(&["challenge", "answer", "riddle", "creep"]);
    assert!(code == 2 && text.contains("the first answer counts"), "{text}");

    new(place.path(), "other", &["--effect", "none"]);
    let (code, text) = run(&["challenge", "reveal", "riddle", "other.key"]);
    assert!(code == 2 && text.contains("does not open"), "{text}");
    assert!(!place.path().join("riddle/truth.json").exists());

    let (code, text) = run(&["challenge", "reveal", "riddle", "riddle.key"]);
    assert_eq!(code, 0, "{text}");
    assert!(
        text.contains("hidden: delay, strong") && text.contains("right: delay is among the named"),
        "{text}"
    );

    let (code, text) = run(&["challenge", "reveal", "other", "other.key", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(
        code == 0 && json["answer"].is_null() && json["truth"]["hidden"] == serde_json::json!([]),
        "{text}"
    );
    let (code, text) = run(&["challenge", "answer", "other", "none"]);
    assert!(code == 2 && text.contains("has been shown"), "{text}");
}

#[test]
fn refuse_challenges_that_make_no_sense() {
    let place = tempfile::tempdir().unwrap();
    let refused = |args: &[&str], says: &str| {
        let (code, text) = hysteron(place.path(), args);
        assert!(code == 2 && text.contains(says), "{args:?}: {code} {text}");
    };
    refused(
        &["challenge", "new", "a", "--effect", "gremlins"],
        "allowed are asymmetry",
    );
    refused(
        &["challenge", "new", "a", "--effect", "creep", "--effect", "creep"],
        "two different ones",
    );
    refused(
        &["challenge", "new", "a", "--strength", "huge"],
        "allowed are weak, medium, strong",
    );
    refused(
        &["challenge", "new", "a", "--family", "granite"],
        "allowed are preisach",
    );
    refused(&["challenge", "new", "a", "--key", "a/key"], "outside of the folder");
    refused(&["challenge", "answer", "a", "delay"], "no challenge");
    refused(&["challenge", "reveal", "a", "a.key"], "no challenge");
    assert!(!place.path().join("a").exists());
}
