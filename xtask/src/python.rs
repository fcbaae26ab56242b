//! The Python package: built with the workspace, laid out under `target/python`, and tested there by pytest.

use crate::tests::{self, Work};
use crate::{cargo, install_packages, output, run, targets};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Where the package is.
const PACKAGE: &str = "crates/python";

/// What the tests need. Pictures and tables are tested with the libraries that draw and hold them.
const NEEDED: [&str; 8] = [
    "numpy",
    "pytest",
    "matplotlib",
    "pandas",
    "pyarrow",
    "tqdm",
    "nbclient",
    "ipykernel",
];

/// What fleets on a cluster need.
const CLUSTERS: [&str; 2] = ["ray", "distributed"];

/// What builds a wheel.
const BUILDER: &str = "maturin>=1.9,<2";

/// Builds and tests the package alone.
pub(crate) fn python(words: &[String]) -> Result<(), String> {
    let fleet = match words {
        [] => false,
        [word] if word == "--fleet" => true,
        [word] if word == "--wheel" => return wheel(),
        other => return Err(format!("python: {other:?} is not known; there are --fleet and --wheel")),
    };
    install_python()?;
    cargo(&["build", "--workspace", "--locked"])?;
    tests::run([test(fleet)?])
}

/// Installs the interpreter, which also plays a stage in another program, and its environments where they are absent.
pub(crate) fn install_python() -> Result<(), String> {
    // Debian packs the interpreter and its environments apart.
    if output("python3", &["-c", "import venv, ensurepip"]).is_ok() {
        return Ok(());
    }
    install_packages(&["python3", "python3-venv"])
}

/// Builds the package's module beside the tests of the workspace, with what is compiled for them; its tests.
pub(crate) fn beside_tests() -> Result<Work, String> {
    // The same targets give the same features to every dependency: nothing is compiled anew but the module.
    cargo(&["build", "--workspace", "--lib", "--tests", "--locked"])?;
    test(false)
}

/// pytest on the module and the program that were built.
fn test(fleet: bool) -> Result<Work, String> {
    let python = environment(fleet)?;
    let package = lay_out()?;
    let mut pytest = Command::new(python);
    pytest
        .args(["-m", "pytest", "--quiet", "--no-header", "-rs", "--color=no"])
        .args(["-m", if fleet { "cluster" } else { "not cluster" }])
        .env("HYSTERON_PROGRAM", absolute(&targets().join("debug/hysteron"))?)
        .env("HYSTERON_CAPI", absolute(&library("hysteron_capi"))?)
        .env("PYTHONPATH", package)
        .current_dir(PACKAGE);
    Ok(Work::of_pytest(pytest))
}

/// The interpreter of an environment with what the tests need; what is there already is not fetched again.
pub(crate) fn environment(fleet: bool) -> Result<PathBuf, String> {
    let folder = targets().join("python");
    let python = absolute(&folder.join("bin/python"))?;
    if !python.exists() {
        run("python3", &["-m", "venv", &folder.display().to_string()])?;
    }
    let mut arguments = vec!["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    arguments.extend(NEEDED);
    if fleet {
        arguments.extend(CLUSTERS);
    }
    run(&python.display().to_string(), &arguments)?;
    Ok(python)
}

/// Builds the wheel as users get it, installs it into an empty environment, and runs the README's session there.
///
/// A release build of what the package is made of: minutes, so that the tests of every change run what [`lay_out`] lays out.
fn wheel() -> Result<(), String> {
    install_python()?;
    let builder = environment(false)?.display().to_string();
    run(
        &builder,
        &[
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            BUILDER,
        ],
    )?;
    let folder = absolute(&targets().join("wheel"))?;
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    // The environment of the last time, and its wheel.
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(failed)?;
    }
    let folder_text = folder.display().to_string();
    let manifest = format!("{PACKAGE}/Cargo.toml");
    run(
        &builder,
        &[
            "-m",
            "maturin",
            "build",
            "--locked",
            "-m",
            &manifest,
            "-o",
            &folder_text,
        ],
    )?;
    let built = std::fs::read_dir(&folder).map_err(failed)?.next();
    let built = built.ok_or("maturin built no wheel")?.map_err(failed)?.path();
    let empty = folder.join("empty");
    run("python3", &["-m", "venv", &empty.display().to_string()])?;
    let python = empty.join("bin/python").display().to_string();
    let with_pictures = format!("{}[plot]", built.display());
    run(
        &python,
        &[
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            &with_pictures,
        ],
    )?;
    let session = format!("{PACKAGE}/tests/first_session.py");
    run(&python, &[&session, "README.md", "LICENSE-MIT", "LICENSE-APACHE"])
}

/// The package as a wheel has it: its Python files, and the module beside them.
fn lay_out() -> Result<PathBuf, String> {
    let package = absolute(&targets().join("python/package"))?;
    let folder = package.join("hysteron");
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    std::fs::create_dir_all(&folder).map_err(failed)?;
    for entry in std::fs::read_dir(Path::new(PACKAGE).join("python/hysteron")).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if let (Some(name), true) = (path.file_name(), path.is_file()) {
            std::fs::copy(&path, folder.join(name)).map_err(failed)?;
        }
    }
    std::fs::copy(library("_hysteron"), folder.join("_hysteron.abi3.so")).map_err(failed)?;
    Ok(package)
}

/// A library that cargo built for other languages.
fn library(name: &str) -> PathBuf {
    let (prefix, suffix) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    targets().join("debug").join(format!("{prefix}{name}{suffix}"))
}

fn absolute(path: &Path) -> Result<PathBuf, String> {
    std::path::absolute(path).map_err(|error| format!("{}: {error}", path.display()))
}
