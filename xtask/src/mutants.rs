//! Changes of the code that flies, one at a time, and whether a test notices.

use crate::{output, run, run_in, targets};
use serde_json::Value;
use std::path::Path;

/// A package whose own tests have to notice.
struct Net {
    /// The workspace that it is a member of, from the root on.
    workspace: &'static str,
    package: &'static str,
    /// From the workspace on.
    files: &'static [&'static str],
}

/// The control law as it runs on the chip, and what of the firmware watches it.
const NETS: [Net; 2] = [
    Net {
        workspace: ".",
        package: "hysteron-core",
        files: &[
            "crates/core/src/tracking_law.rs",
            "crates/core/src/law_numbers.rs",
            "crates/core/src/control_law.rs",
            "crates/core/src/limiter.rs",
            "crates/core/src/pi_controller.rs",
            "crates/core/src/trust.rs",
            "crates/core/src/surroundings.rs",
            "crates/core/src/preview.rs",
            "crates/core/src/adaptation.rs",
        ],
    },
    Net {
        workspace: "firmware",
        package: "hysteron-firmware",
        files: &["app/src/monitor.rs", "app/src/controller.rs"],
    },
];
/// Seconds that the tests of a mutant may take: a loop without end is noticed, too.
const PATIENCE_S: &str = "60";
const VERSION: &str = "27.1.0";

/// Runs them all on what is committed; `words` are further words for cargo-mutants, `--shard 0/8` for an eighth of them.
pub(crate) fn mutants(words: &[String]) -> Result<(), String> {
    let program = installed()?;
    let place = std::path::absolute(targets().join("mutants")).map_err(|error| error.to_string())?;
    let source = place.join("source");
    // Its own: cargo takes packages of a clone for those of the original, and what was built of a mutant for them.
    let built = place.join("target").to_string_lossy().into_owned();
    if source.exists() {
        std::fs::remove_dir_all(&source).map_err(|error| format!("{}: {error}", source.display()))?;
    }
    // The firmware's packages are built from crates outside its workspace, which cargo-mutants does not copy: it changes a clone in place.
    run("git", &["clone", "--quiet", "--local", ".", &source.to_string_lossy()])?;
    let mut wrong = Vec::new();
    for net in &NETS {
        let out = place.join(net.package);
        std::fs::create_dir_all(&out).map_err(|error| format!("{}: {error}", out.display()))?;
        let (folder, out) = (source.join(net.workspace), out.to_string_lossy().into_owned());
        let folder = folder.to_string_lossy();
        let mut arguments = vec!["mutants", "--in-place", "--dir", &folder, "--package", net.package];
        arguments.extend(["--timeout", PATIENCE_S, "--output", &out]);
        for file in net.files {
            arguments.extend(["--file", file]);
        }
        arguments.extend(words.iter().map(String::as_str));
        // Survivors are an exit code as errors are: the figures tell, once all packages have been looked at.
        let ended = run_in(".", &program, &arguments, &[("CARGO_TARGET_DIR", Some(&built))]);
        match figures(Path::new(&out)) {
            Ok(figures) => println!("{}: {figures}", net.package),
            Err(reason) => wrong.push(reason),
        }
        wrong.extend(ended.err());
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(wrong.join("\n"))
    }
}

/// Where cargo-mutants is, installed where it is not yet.
fn installed() -> Result<String, String> {
    let place = targets().join("tools");
    let program = place.join("bin/cargo-mutants");
    let root = place.to_string_lossy().into_owned();
    let program = program.to_string_lossy().into_owned();
    let is_there = output(&program, &["mutants", "--version"]).is_ok_and(|said| said.contains(VERSION));
    if !is_there {
        let install = ["install", "cargo-mutants", "--locked", "--version", VERSION];
        run("cargo", &[&install[..], &["--root", &root]].concat())?;
    }
    Ok(program)
}

/// What became of a package's mutants. None at all is an error: then nothing was looked at.
fn figures(out: &Path) -> Result<String, String> {
    let file = out.join("mutants.out/outcomes.json");
    let refused = |reason: String| format!("{}: {reason}", file.display());
    let text = std::fs::read_to_string(&file).map_err(|error| refused(error.to_string()))?;
    let outcomes: Value = serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
    let count = |name: &str| outcomes[name].as_u64().unwrap_or(0);
    let (missed, late) = (count("missed"), count("timeout"));
    let viable = missed + late + count("caught");
    if viable == 0 {
        return Err(refused(
            "no mutant was tested; are files and packages where they were?".to_owned(),
        ));
    }
    let percent = 100.0 * missed as f64 / viable as f64;
    Ok(format!(
        "{viable} viable mutants, {missed} survived, {percent:.1} %; {late} of the others were stopped after {PATIENCE_S} s"
    ))
}
