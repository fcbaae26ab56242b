//! The boards' images in a processor model, a process of its own beside the simulated stage and the host's law.

use crate::{output, python, run, targets};
use std::path::PathBuf;

/// What pip installs: the processor, under the GPL and for that reason apart from everything of ours, and a reader of linked images.
const NEEDED: [&str; 2] = ["unicorn==2.1.4", "pyelftools==0.33"];

/// The interpreter that has the model.
fn interpreter() -> Result<PathBuf, String> {
    let path = targets().join("unicorn/bin/python");
    std::path::absolute(path).map_err(|error| error.to_string())
}

/// Installs the model where it is absent.
pub(crate) fn install() -> Result<(), String> {
    python::install_python()?;
    let interpreter = interpreter()?.display().to_string();
    if output(&interpreter, &["-c", "import unicorn, elftools"]).is_ok() {
        return Ok(());
    }
    let folder = targets().join("unicorn").display().to_string();
    run("python3", &["-m", "venv", &folder])?;
    let mut arguments = vec!["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    arguments.extend(NEEDED);
    run(&interpreter, &arguments)
}

/// Runs the images that `firmware boards` has built through starts and faults, and prints the table.
pub(crate) fn starts() -> Result<(), String> {
    // Of the whole workspace, as `firmware compare` does.
    run("cargo", &["build", "--locked", "--workspace", "--example", "starts"])?;
    let example = targets().join("debug/examples/starts").display().to_string();
    let interpreter = interpreter()?.display().to_string();
    crate::run_in(".", &example, &[], &[("HYSTERON_UNICORN", Some(&interpreter))])
}
