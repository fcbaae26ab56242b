//! What `campaign`, `design` and `track` refuse, as a user meets it: the reason, what to do, exit code 2.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

use assert_cmd::Command;

/// Runs the binary; it must end with 2 and say all of the words.
fn refused(args: &[&str], words: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .args(args)
        .output()
        .unwrap();
    // The box that errors are drawn in breaks lines: compare without white space and its bars.
    let plain = |text: &str| {
        text.chars()
            .filter(|c| !c.is_whitespace() && *c != '│')
            .collect::<String>()
    };
    let said = plain(&String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
    for word in words {
        assert!(said.contains(&plain(word)), "{args:?} does not say `{word}`: {said}");
    }
}

#[test]
fn refuse_stages_and_ranges_that_are_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("records");
    refused(
        &["campaign", "--stage", "8 kHz", "-o", path.to_str().unwrap()],
        &["there is no stage `8 kHz`", "paper-rate, paper-delay, 8k, 2.5k, 739"],
    );
    assert!(!path.exists());
    let text = folder.path().join("controller.toml");
    std::fs::write(&text, "format = 1\n").unwrap();
    let text = text.to_str().unwrap();
    refused(&["track", text, "--stage", "8k"], &["missing field", "hysteron design"]);
    refused(&["track", "no-such-file.toml", "--stage", "8k"], &["no-such-file.toml"]);
}

#[test]
fn refuse_to_design_without_records_of_a_campaign() {
    let folder = tempfile::tempdir().unwrap();
    refused(
        &["design", "model.toml"],
        &[
            "from the records of a campaign, not from a model file",
            "give the folder",
        ],
    );
    let one = folder.path().join("one.csv");
    std::fs::write(&one, "time_s,voltage_v,position_um\n0,0,0\n0.1,1,0.3\n0.2,2,0.5\n").unwrap();
    refused(
        &["design", one.to_str().unwrap()],
        &[
            "the dataset has no small multisine",
            "`hysteron campaign` records what is needed",
        ],
    );
}
