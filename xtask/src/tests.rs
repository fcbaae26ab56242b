//! All tests of the workspace: built once, then as many of their programs at a time as there are cores.
//!
//! `cargo test` runs one program after another, and a program with one long test leaves the other cores idle.

use crate::python;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Mutex;

/// The programs that take minutes start first: none of them shall be left alone at the end.
const LONGEST: [&str; 4] = ["rehearse", "workbench", "control", "hidden_effects"];

/// A built test program, and the folder that cargo would run it in.
struct Program {
    name: String,
    path: PathBuf,
    folder: PathBuf,
}

/// What test programs said of themselves.
#[derive(Default)]
pub(crate) struct Counts {
    passed: u64,
    failed: u64,
    ignored: u64,
    /// Programs that ended otherwise than by all their tests passing.
    broken: Vec<String>,
}

/// Builds and runs all tests, the examples of the documentation too, and closes on the sum of their counts.
pub(crate) fn tests() -> Result<(), String> {
    let programs = Mutex::new(programs()?.into_iter());
    let counts = Mutex::new(Counts::default());
    let next = || programs.lock().ok()?.next();
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(program) = next() {
                    let mut command = Command::new(&program.path);
                    command.current_dir(&program.folder);
                    run(command, &program.path.display().to_string(), &counts);
                }
            });
        }
    });
    let mut examples = Command::new("cargo");
    examples.args(["test", "--workspace", "--locked", "--no-fail-fast", "--doc"]);
    run(examples, "cargo test --doc", &counts);

    let mut counts = counts.into_inner().map_err(|error| error.to_string())?;
    if let Err(reason) = python::beside_tests(&mut counts) {
        counts.broken.push(reason);
    }
    counts.close()
}

impl Counts {
    /// Prints the sum, and fails where a test did.
    pub(crate) fn close(&self) -> Result<(), String> {
        println!(
            "\n{} passed, {} failed, {} skipped",
            self.passed, self.failed, self.ignored
        );
        if !self.broken.is_empty() || self.failed > 0 {
            return Err(format!("tests failed: {}", self.broken.join(", ")));
        }
        if self.passed == 0 {
            Err("no test ran".to_owned())
        } else {
            Ok(())
        }
    }

    /// Counts a closing line of pytest: `2 failed, 58 passed, 1 skipped in 20.31s`.
    fn take_pytest(&mut self, line: &str) {
        let mut before = "0";
        for word in line.split_whitespace() {
            let count: u64 = before.parse().unwrap_or(0);
            match word.trim_end_matches(',') {
                "passed" => self.passed += count,
                "failed" | "error" | "errors" => self.failed += count,
                "skipped" => self.ignored += count,
                _ => {}
            }
            before = word;
        }
    }

    /// Runs pytest, and counts what its last line says.
    pub(crate) fn pytest(&mut self, mut command: Command) {
        println!("\n> pytest");
        let output = match command.output() {
            Ok(output) => output,
            Err(error) => {
                println!("cannot start it: {error}");
                self.broken.push("pytest".to_owned());
                return;
            }
        };
        let said = String::from_utf8_lossy(&output.stdout);
        // Its closing line is counted here; printed as it is, it would stand beside the sum of all tests.
        let (before, last) = said.trim_end().rsplit_once('\n').unwrap_or(("", said.trim_end()));
        println!("{before}{}\npytest: {last}", String::from_utf8_lossy(&output.stderr));
        self.take_pytest(last);
        if !output.status.success() {
            self.broken.push(format!("pytest ({})", output.status));
        }
    }
}

/// Builds the test programs.
fn programs() -> Result<Vec<Program>, String> {
    let arguments = [
        "test",
        "--workspace",
        "--locked",
        "--no-run",
        "--message-format=json-render-diagnostics",
    ];
    println!("> cargo {}", arguments.join(" "));
    let built = Command::new("cargo")
        .args(arguments)
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| format!("cannot start cargo: {error}"))?;
    if !built.status.success() {
        return Err(format!("the tests do not build ({})", built.status));
    }
    let mut programs = Vec::new();
    for line in String::from_utf8_lossy(&built.stdout).lines() {
        let message: serde_json::Value = serde_json::from_str(line).map_err(|error| format!("cargo: {error}"))?;
        // Programs that tests start are built with them, and are no tests.
        if message["profile"]["test"] != true {
            continue;
        }
        let name = message["target"]["name"].as_str().unwrap_or_default();
        let manifest = message["manifest_path"].as_str().map(PathBuf::from);
        let folder = manifest.as_deref().and_then(std::path::Path::parent);
        if let (Some(path), Some(folder)) = (message["executable"].as_str(), folder) {
            programs.push(Program {
                name: name.to_owned(),
                path: path.into(),
                folder: folder.to_owned(),
            });
        }
    }
    let place = |program: &Program| LONGEST.iter().position(|name| *name == program.name);
    programs.sort_by_key(|program| place(program).unwrap_or(LONGEST.len()));
    Ok(programs)
}

/// Runs a test program, shows what it said when it ends, and counts it.
fn run(mut command: Command, name: &str, counts: &Mutex<Counts>) {
    // Browser, emulator and Python were installed before: a test that does not find them fails.
    if let Ok(interpreter) = crate::fmpy_interpreter() {
        command.env("HYSTERON_PYTHON", interpreter);
    }
    command
        .env("HYSTERON_BROWSER", "required")
        .env("HYSTERON_EMULATOR", "required");
    let ended = command.output();
    let Ok(mut counts) = counts.lock() else {
        return;
    };
    println!("\n> {name}");
    let output = match ended {
        Ok(output) => output,
        Err(error) => {
            println!("cannot start it: {error}");
            counts.broken.push(name.to_owned());
            return;
        }
    };
    let said = String::from_utf8_lossy(&output.stdout);
    print!("{said}{}", String::from_utf8_lossy(&output.stderr));
    for result in said.lines().filter_map(|line| line.strip_prefix("test result: ")) {
        let count = |what: &str| -> u64 {
            let before = result.split(what).next().unwrap_or_default();
            let number = before.split_whitespace().next_back();
            number.and_then(|word| word.parse().ok()).unwrap_or(0)
        };
        counts.passed += count(" passed");
        counts.failed += count(" failed");
        counts.ignored += count(" ignored");
    }
    if !output.status.success() {
        println!("{name}: {}", output.status);
        counts.broken.push(name.to_owned());
    }
}

#[cfg(test)]
mod unit {
    use super::Counts;

    #[test]
    fn val_the_closing_line_of_pytest_is_counted() {
        let mut counts = Counts::default();
        counts.take_pytest("2 failed, 58 passed, 1 skipped, 6 deselected, 3 errors in 20.31s");
        assert_eq!((counts.passed, counts.failed, counts.ignored), (58, 5, 1));
        counts.take_pytest("no tests ran in 0.01s");
        assert_eq!((counts.passed, counts.failed, counts.ignored), (58, 5, 1));
    }
}
