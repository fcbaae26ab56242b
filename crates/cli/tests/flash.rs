//! `board flash` with a writer of flash that is a script: the right chip, and what is said where something is wrong.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]
#![cfg(unix)]

use assert_cmd::cargo::CommandCargoExt;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

/// A file that begins and says what an image of a board does.
fn image(folder: &Path, says: &str) -> String {
    let path = folder.join("image.elf");
    let bytes = [b"\x7fELF noise ", says.as_bytes(), b"\0 more noise"].concat();
    std::fs::write(&path, bytes).unwrap();
    path.display().to_string()
}

/// The command, with this script for probe-rs, or without one.
fn flashed(folder: &Path, image: &str, script: Option<&str>, more: &[&str]) -> Output {
    let programs = folder.join("programs");
    std::fs::create_dir_all(&programs).unwrap();
    if let Some(script) = script {
        let writer = programs.join("probe-rs");
        std::fs::write(&writer, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&writer, PermissionsExt::from_mode(0o755)).unwrap();
    }
    let mut command = Command::cargo_bin("hysteron").unwrap();
    command.args([&["board", "flash", image], more].concat());
    // The script needs nothing but the shell, which has a path of its own.
    command.env("PATH", &programs).output().unwrap()
}

fn words(stderr: &[u8]) -> String {
    let text = String::from_utf8_lossy(stderr).replace('│', " ");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Each board's image is written to its chip and started, by the probe that was named.
#[test]
fn val_an_image_goes_to_its_chip() {
    for (board, chip) in [("nucleo-h743zi", "STM32H743ZITx"), ("nucleo-g474re", "STM32G474RETx")] {
        let folder = tempfile::tempdir().unwrap();
        let image = image(folder.path(), &format!("hysteron image for {board}"));
        let log = folder.path().join("log").display().to_string();
        let output = flashed(
            folder.path(),
            &image,
            Some(&format!("echo \"$@\" >> {log}")),
            &["--probe", "0483:374e", "--json"],
        );
        assert!(output.status.success(), "{output:?}");
        let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(
            (answer["board"].as_str(), answer["image"].as_str()),
            (Some(board), Some(image.as_str()))
        );
        assert_eq!(
            std::fs::read_to_string(log).unwrap(),
            format!("download --chip {chip} {image} --probe 0483:374e\nreset --chip {chip} --probe 0483:374e\n")
        );
    }
}

/// No image of a board, no writer, and a writer that fails: what is wrong and what to do, and exit code 2.
#[test]
fn error_what_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    for says in ["nothing", "hysteron image for mps2-an386", "hysteron image for another"] {
        let image = image(folder.path(), says);
        let output = flashed(folder.path(), &image, Some("exit 0"), &[]);
        assert_eq!(output.status.code(), Some(2));
        let said = words(&output.stderr);
        assert!(said.contains("no image of a board of this version"), "{said}");
    }
    let image = image(folder.path(), "hysteron image for nucleo-g474re");
    let output = flashed(folder.path(), &image, Some("echo no probe was found >&2; exit 1"), &[]);
    assert_eq!(output.status.code(), Some(2));
    let said = words(&output.stderr);
    assert!(
        said.contains("no probe was found") && said.contains("probe-rs has not written the image (exit status: 1)")
    );
    let empty = tempfile::tempdir().unwrap();
    let output = flashed(empty.path(), &image, None, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(words(&output.stderr).contains("cargo install probe-rs-tools --locked"));
    let absent = folder.path().join("absent.elf").display().to_string();
    assert_eq!(
        flashed(folder.path(), &absent, Some("exit 0"), &[]).status.code(),
        Some(2)
    );
}
