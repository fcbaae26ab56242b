//! An image of a table, built from the firmware's sources.

use crate::{BoardError, Machine};
use std::fs::{self, File};
use std::path::Path;
use std::process::Command;

/// What the images are compiled for.
const CHIP: &str = "thumbv7em-none-eabihf";

/// Builds the application with a table in it, one for each axis, and puts the image where `image` says.
///
/// Builds in one folder of sources wait for each other. What the image says of its table ([`crate::Session::hello`]) tells whether it
/// is this one.
///
/// # Errors
/// A folder without the firmware's sources, a table that its build refuses, no toolchain for the chip.
///
/// # Cost
/// 5 s where the core is compiled already, 30 s where it is not.
pub fn build(
    firmware: &Path,
    machine: Machine,
    tables: (&Path, Option<&Path>),
    image: &Path,
) -> Result<(), BoardError> {
    if !firmware.join("mps2").is_dir() {
        return Err(BoardError::NoFirmware(firmware.to_owned()));
    }
    let table = tables.0.canonicalize()?;
    let beside = tables.1.map(Path::canonicalize).transpose()?;
    let target = firmware.join("target");
    fs::create_dir_all(&target)?;
    let lock = File::create(target.join("image-of-a-table.lock"))?;
    lock.lock()?;
    let (core, of_core) = match machine {
        Machine::Mps2An386 => ("cortex-m4", None),
        Machine::Mps2An500 => ("cortex-m7", Some("max-instruction")),
    };
    let features: Vec<&str> = of_core.into_iter().chain(beside.as_ref().map(|_| "two-axes")).collect();
    let built = Command::new("cargo")
        .args(["build", "--release", "--locked", "--package", "mps2", "--bin", "mps2"])
        .args(["--target", CHIP, "--config"])
        .arg(format!("target.{CHIP}.rustflags=[\"-Ctarget-cpu={core}\"]"))
        .args(["--features", &features.join(",")])
        .env("HYSTERON_TABLE", &table)
        .env("HYSTERON_CORE", core)
        .env_remove("HYSTERON_TABLE_Y")
        // Either would replace the linker's arguments or the place of the image.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env_remove("CARGO_TARGET_DIR")
        .envs(beside.map(|beside| ("HYSTERON_TABLE_Y", beside)))
        .current_dir(firmware)
        .output()
        .map_err(|source| BoardError::Start {
            program: "cargo",
            package: "rustup",
            source,
        })?;
    if !built.status.success() {
        let said = String::from_utf8_lossy(&built.stderr);
        let lines: Vec<&str> = said
            .lines()
            .filter(|line| !line.trim_start().starts_with("Compiling"))
            .collect();
        return Err(BoardError::Build(lines.join("\n")));
    }
    fs::copy(target.join(CHIP).join("release/mps2"), image)?;
    Ok(())
}
