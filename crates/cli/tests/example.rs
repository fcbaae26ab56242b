//! `example` as a user meets it: every example is made, read, and taken further by the commands that it prints.
#![expect(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]

use assert_cmd::Command;
use hysteron_data::{Role, read_dataset};
use std::fs;
use std::path::Path;

fn hysteron(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("hysteron").unwrap();
    command.current_dir(folder);
    // Commands are printed for a program on the path, not for `cargo run`.
    command.env_remove("CARGO_MANIFEST_DIR");
    command
}

fn json(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let output = hysteron(folder).args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The names that the list has.
fn names(folder: &Path) -> Vec<String> {
    let list = json(folder, &["example", "--json"]);
    let names = list.as_array().unwrap().iter();
    names.map(|one| one["name"].as_str().unwrap().to_owned()).collect()
}

/// Splits a printed command into words, quotes as a shell takes them.
fn words(command: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut quoted = false;
    for letter in command.chars() {
        match letter {
            '\'' => quoted = !quoted,
            ' ' if !quoted => words.push(String::new()),
            letter => words.last_mut().unwrap().push(letter),
        }
    }
    words
}

#[test]
fn val_every_example_is_a_dataset_to_fit_and_to_judge_by() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path();
    let names = names(place);
    assert_eq!(names.len(), 9, "{names:?}");
    for name in names {
        let made = json(place, &["example", &name, "-o", &name, "--json"]);
        assert!(!made["truth"].as_str().unwrap().is_empty());
        let files = made["files"].as_array().unwrap();
        for file in files {
            assert!(
                place.join(&name).join(file.as_str().unwrap()).exists(),
                "{name}: {file}"
            );
        }
        if name == "scope" {
            continue;
        }
        let dataset = read_dataset(&place.join(&name)).unwrap();
        assert_eq!(
            (dataset.name.as_str(), dataset.records.len()),
            (name.as_str(), files.len())
        );
        assert!(dataset.with_role(Role::Identify).count() >= 4, "{name}");
        assert!(dataset.with_role(Role::Validate).count() >= 3, "{name}");
        let samples: usize = dataset.records.iter().map(hysteron_data::Record::len).sum();
        assert!((20_000..200_000).contains(&samples), "{name}: {samples} samples");
    }
}

/// What `next:` prints runs as it stands, on a dataset of ours and on files of an instrument.
#[test]
fn val_the_next_commands_run_as_printed() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["paper-stage", "scope"] {
        let made = json(folder.path(), &["example", name, "--json"]);
        let next = made["next"].as_array().unwrap();
        assert_eq!(next.len(), 2);
        for command in next {
            let words = words(command.as_str().unwrap());
            assert_eq!(words[0], "hysteron");
            hysteron(folder.path()).args(&words[1..]).assert().success();
        }
    }
    let imported = read_dataset(&folder.path().join("stage")).unwrap();
    let most = |of: fn(&hysteron_data::Record) -> &Vec<f64>| {
        let all = imported.records.iter().flat_map(|record| of(record).iter().copied());
        all.fold(0.0_f64, f64::max)
    };
    // 26 V and 2.6 um, to 1 % of gain of the preset and to half a step of 12 bits, 5 mV.
    assert!((most(|record| &record.voltage_v) - 26.0).abs() < 0.005);
    assert!((most(|record| &record.position_um) - 2.6).abs() < 0.05);
    let page = fs::read_to_string(folder.path().join("page.html")).unwrap();
    assert!(page.contains("paper-stage"));
}

#[test]
fn val_an_example_is_the_same_every_time() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["hidden-delay", "scope"] {
        for place in ["a", "b"] {
            let place = format!("{name}-{place}");
            json(folder.path(), &["example", name, "-o", &place, "--json"]);
        }
        let mut compared = 0;
        for file in fs::read_dir(folder.path().join(format!("{name}-a"))).unwrap() {
            let file = file.unwrap();
            let again = folder.path().join(format!("{name}-b")).join(file.file_name());
            assert_eq!(
                fs::read(file.path()).unwrap(),
                fs::read(again).unwrap(),
                "{:?}",
                file.path()
            );
            compared += 1;
        }
        assert!(compared >= 3);
    }
}

#[test]
fn refuse_example() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str]| {
        let output = hysteron(folder.path()).arg("example").args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty());
        String::from_utf8(output.stderr).unwrap()
    };
    let said = refused(&["hidden-something"]);
    assert!(
        said.contains("hidden-something") && said.contains("hidden-creep"),
        "{said}"
    );
    assert!(refused(&["-o", "x"]).contains("NAME"));
    for name in ["hidden-delay", "scope"] {
        json(folder.path(), &["example", name, "-o", name, "--json"]);
        // What is there is not replaced unless that is asked for.
        assert!(refused(&[name, "-o", name]).contains("overwrit"), "{name}");
        json(folder.path(), &["example", name, "-o", name, "--overwrite", "--json"]);
    }
    assert!(!folder.path().join("x").exists());
}
