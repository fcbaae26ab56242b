//! Changes of the code that flies, one at a time, and whether a test notices.

use crate::{run, targets};
use std::path::Path;

/// Packages and their files; each package's own tests have to notice.
const NETS: [(&str, &[&str]); 2] = [
    (
        "hysteron-core",
        &[
            "crates/core/src/tracking_law.rs",
            "crates/core/src/law_numbers.rs",
            "crates/core/src/control_law.rs",
            "crates/core/src/limiter.rs",
            "crates/core/src/pi_controller.rs",
            "crates/core/src/trust.rs",
        ],
    ),
    (
        "hysteron-firmware",
        &["firmware/app/src/monitor.rs", "firmware/app/src/controller.rs"],
    ),
];
/// Seconds that the tests of a mutant may take: a loop without end is noticed, too.
const PATIENCE_S: &str = "60";
const VERSION: &str = "27.1.0";

/// Runs them all; `words` are further words for cargo-mutants, `--shard 0/8` for an eighth of them.
pub(crate) fn mutants(words: &[String]) -> Result<(), String> {
    let place = targets().join("tools");
    let program = place.join("bin/cargo-mutants");
    if !program.is_file() {
        let root = place.to_string_lossy().into_owned();
        run(
            "cargo",
            &[
                "install",
                "cargo-mutants",
                "--locked",
                "--version",
                VERSION,
                "--root",
                &root,
            ],
        )?;
    }
    let mut missed = Vec::new();
    for (package, files) in NETS {
        let out = targets().join("mutants").join(package).to_string_lossy().into_owned();
        std::fs::create_dir_all(Path::new(&out)).map_err(|error| format!("{out}: {error}"))?;
        let mut arguments = vec![
            "mutants",
            "--package",
            package,
            "--timeout",
            PATIENCE_S,
            "--output",
            &out,
        ];
        for file in files {
            arguments.extend(["--file", file]);
        }
        arguments.extend(words.iter().map(String::as_str));
        // Survivors are exit code 2: all packages are looked at first.
        if let Err(reason) = run(&program.to_string_lossy(), &arguments) {
            missed.push(reason);
        }
    }
    if missed.is_empty() {
        Ok(())
    } else {
        Err(missed.join("\n"))
    }
}
