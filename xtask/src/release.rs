//! `cargo xtask msrv` and `cargo xtask dist`: the oldest Rust, and an archive of the program.

use crate::{cargo, output, run, targets};
use std::fs;
use std::path::Path;

/// Files that go beside the program.
const BESIDE: [&str; 4] = ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"];

/// Checks the workspace with the Rust that `rust-version` names.
pub(crate) fn msrv() -> Result<(), String> {
    let version = field("rust-version")?;
    run("rustup", &["toolchain", "install", "--profile", "minimal", &version])?;
    run(
        "rustup",
        &["run", &version, "cargo", "check", "--workspace", "--locked"],
    )
}

/// Builds the profile `dist`, packs it, and writes the archive's SHA-256 beside it.
pub(crate) fn dist() -> Result<(), String> {
    cargo(&["build", "--profile", "dist", "--package", "hysteron-cli", "--locked"])?;
    let name = format!("hysteron-{}-{}", field("version")?, host()?);
    let place = targets().join("dist-archive");
    let folder = place.join(&name);
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(failed)?;
    }
    fs::create_dir_all(&folder).map_err(failed)?;
    let program = format!("hysteron{}", std::env::consts::EXE_SUFFIX);
    fs::copy(targets().join("dist").join(&program), folder.join(&program)).map_err(failed)?;
    for file in BESIDE {
        fs::copy(file, folder.join(file)).map_err(failed)?;
    }
    let archive = format!("{name}.tar.gz");
    let inside = place.display().to_string();
    run(
        "tar",
        &[
            "--create",
            "--gzip",
            "--directory",
            &inside,
            "--file",
            &in_folder(&place, &archive),
            &name,
        ],
    )?;
    let sum = output("sha256sum", &[&in_folder(&place, &archive)])?;
    let sum = sum.split_whitespace().next().unwrap_or_default();
    fs::write(place.join(format!("{archive}.sha256")), format!("{sum}  {archive}\n")).map_err(failed)?;
    println!("{}", in_folder(&place, &archive));
    Ok(())
}

fn in_folder(folder: &Path, file: &str) -> String {
    folder.join(file).display().to_string()
}

/// A field of the workspace's manifest.
fn field(name: &str) -> Result<String, String> {
    let manifest = fs::read_to_string("Cargo.toml").map_err(|error| format!("Cargo.toml: {error}"))?;
    let line = manifest
        .lines()
        .find_map(|line| line.strip_prefix(name)?.trim().strip_prefix('='));
    let value = line.map(|value| value.trim().trim_matches('"').to_owned());
    value.ok_or_else(|| format!("Cargo.toml: no {name}"))
}

/// The machine that the program is built for.
fn host() -> Result<String, String> {
    let said = output("rustc", &["--version", "--verbose"])?;
    let host = said.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).ok_or_else(|| "rustc names no host".to_owned())
}
