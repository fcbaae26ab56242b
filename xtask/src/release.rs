//! `cargo xtask msrv`, `package` and `dist`: the oldest Rust, the crates for a registry, and an archive of the program.

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

/// The crates that others can build on, each after those that it needs: the core, the records, the fit, and what the wheel is made of.
const CRATES: [&str; 14] = [
    "core",
    "data",
    "effects",
    "acquisition",
    "excitation",
    "plant",
    "identify",
    "table",
    "diagnose",
    "challenge",
    "control",
    "report",
    "capi",
    "python",
];

/// Packs the crates as a registry takes them, and checks that each says what it is.
///
/// What is packed is not built again: until the first of them is in a registry, cargo finds the others by their folders only.
pub(crate) fn package() -> Result<(), String> {
    let metadata = output("cargo", &["metadata", "--format-version", "1", "--no-deps", "--locked"])?;
    let metadata: serde_json::Value = serde_json::from_str(&metadata).map_err(|error| format!("cargo: {error}"))?;
    let mut command = vec![
        "package",
        "--no-verify",
        "--exclude-lockfile",
        "--allow-dirty",
        "--quiet",
    ];
    let names = CRATES.map(|name| format!("hysteron-{name}"));
    for name in &names {
        let packages = metadata["packages"].as_array().into_iter().flatten();
        let about = packages.into_iter().find(|package| package["name"] == name.as_str());
        let about = about.ok_or_else(|| format!("{name}: no such crate"))?;
        for field in [
            "description",
            "license",
            "readme",
            "keywords",
            "categories",
            "rust_version",
        ] {
            if about[field].as_str().is_none_or(str::is_empty) && about[field].as_array().is_none_or(Vec::is_empty) {
                return Err(format!("{name}: its manifest says no {field}"));
            }
        }
        command.extend(["--package", name]);
    }
    cargo(&command)?;
    println!(
        "{} crates packed in {}",
        names.len(),
        targets().join("package").display()
    );
    Ok(())
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
