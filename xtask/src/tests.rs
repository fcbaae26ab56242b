//! All tests of the workspace: built once, then as many of their programs and checks at a time as there are cores.
//!
//! `cargo test` runs one program after another, and a program with one long test leaves the other cores idle.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::Mutex;

/// The programs that take minutes start first: none of them shall be left alone at the end.
const LONGEST: [&str; 5] = ["rehearse", "workbench", "control", "hidden_effects", "real_data"];

/// What runs beside other work on a core of its own.
pub(crate) enum Work {
    /// A program that says how many tests passed.
    Tests(Box<Tests>),
    /// A check that counts no tests, and its name.
    Check(&'static str, fn() -> Result<(), String>),
}

/// A program of tests.
pub(crate) struct Tests {
    name: String,
    command: Command,
    read: fn(&mut Counts, &str),
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

/// Runs all of it in its order, a piece on every core, and closes on the sum of the counts.
pub(crate) fn run(work: impl IntoIterator<Item = Work>) -> Result<(), String> {
    let work = Mutex::new(work.into_iter().collect::<VecDeque<_>>());
    let counts = Mutex::new(Counts::default());
    let next = || work.lock().ok()?.pop_front();
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(one) = next() {
                    one.done(&counts);
                }
            });
        }
    });
    let counts = counts.into_inner().map_err(|error| error.to_string())?;
    counts.close()
}

impl Work {
    /// Tests that cargo builds and runs by these words.
    pub(crate) fn of_cargo(words: &[&str]) -> Self {
        let mut command = Command::new("cargo");
        command.args(words);
        Self::tests(format!("cargo {}", words.join(" ")), command, Counts::take_cargo)
    }

    /// Tests that pytest runs.
    pub(crate) fn of_pytest(command: Command) -> Self {
        Self::tests("pytest".to_owned(), command, Counts::take_pytest)
    }

    /// A test program, in the folder that cargo would run it in.
    fn of_program(path: &Path, folder: &Path) -> Self {
        let mut command = Command::new(path);
        command.current_dir(folder);
        Self::tests(path.display().to_string(), command, Counts::take_cargo)
    }

    fn tests(name: String, command: Command, read: fn(&mut Counts, &str)) -> Self {
        Self::Tests(Box::new(Tests { name, command, read }))
    }

    fn done(self, counts: &Mutex<Counts>) {
        match self {
            Self::Tests(tests) => tests.run(counts),
            Self::Check(name, check) => {
                let checked = check();
                if let (Err(reason), Ok(mut counts)) = (checked, counts.lock()) {
                    println!("\n{name}: {reason}");
                    counts.broken.push(name.to_owned());
                }
            }
        }
    }
}

impl Tests {
    /// Runs it, shows what it said when it ends, and counts it.
    fn run(mut self, counts: &Mutex<Counts>) {
        // Browser, emulator and Python were installed before: a test that does not find them fails.
        if let Ok(interpreter) = crate::fmpy_interpreter() {
            self.command.env("HYSTERON_PYTHON", interpreter);
        }
        self.command
            .env("HYSTERON_BROWSER", "required")
            .env("HYSTERON_EMULATOR", "required");
        let ended = self.command.output();
        let Ok(mut counts) = counts.lock() else {
            return;
        };
        println!("\n> {}", self.name);
        match ended {
            Ok(output) => counts.take(&self.name, &output, self.read),
            Err(error) => {
                println!("cannot start it: {error}");
                counts.broken.push(self.name);
            }
        }
    }
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

    /// Shows what a program said, and counts it.
    fn take(&mut self, name: &str, output: &Output, read: fn(&mut Self, &str)) {
        let said = String::from_utf8_lossy(&output.stdout);
        print!("{said}{}", String::from_utf8_lossy(&output.stderr));
        read(self, &said);
        if !output.status.success() {
            println!("{name}: {}", output.status);
            self.broken.push(name.to_owned());
        }
    }

    /// Counts the closing line of every program of cargo's: `test result: ok. 5 passed; 0 failed; 1 ignored; ...`.
    fn take_cargo(&mut self, said: &str) {
        for result in said.lines().filter_map(|line| line.strip_prefix("test result: ")) {
            let count = |what: &str| -> u64 {
                let before = result.split(what).next().unwrap_or_default();
                let number = before.split_whitespace().next_back();
                number.and_then(|word| word.parse().ok()).unwrap_or(0)
            };
            self.passed += count(" passed");
            self.failed += count(" failed");
            self.ignored += count(" ignored");
        }
    }

    /// Counts the closing line of pytest: `2 failed, 58 passed, 1 skipped in 20.31s`.
    fn take_pytest(&mut self, said: &str) {
        let line = said.trim_end().lines().next_back().unwrap_or_default();
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
}

/// Builds the test programs of the workspace, those first that take longest.
pub(crate) fn programs() -> Result<Vec<Work>, String> {
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
            let place = LONGEST.iter().position(|longest| *longest == name);
            programs.push((place.unwrap_or(LONGEST.len()), Work::of_program(path.as_ref(), folder)));
        }
    }
    programs.sort_by_key(|(place, _)| *place);
    Ok(programs.into_iter().map(|(_, tests)| tests).collect())
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
