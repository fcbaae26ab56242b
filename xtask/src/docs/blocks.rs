//! Command blocks: run in a folder of their page, their output compared with what is printed below them, or written there.
//!
//! A block is fenced as `console`; its commands begin with `$ `. A line `...` in the output stands for any lines. `console,slow`
//! is left to `cargo xtask docs`. Commands that need hardware or many minutes are fenced as `sh` and not run. All blocks of a page
//! share one folder.

use super::pages::{Fence, Page};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What is done with the output.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Reading {
    Compare,
    /// The page is brought up to date.
    Write,
}

/// Which blocks are run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Speed {
    Fast,
    /// Those marked as slow as well.
    Slow,
}

#[derive(Default)]
pub(super) struct Counts {
    pub commands: usize,
    pub slow: usize,
    pub not_run: usize,
}

/// Lines that stand for any others.
const ELISION: &str = "...";
/// How a command starts the program in a clone that has installed nothing.
const BY_CARGO: &str = "cargo run --release -- ";

/// A command with the output below it.
struct Step<'a> {
    command: &'a str,
    printed: Vec<&'a str>,
}

/// Runs the blocks of a page; what differs.
pub(super) fn run(
    page: &Page,
    program: &Path,
    reading: Reading,
    speed: Speed,
    counts: &mut Counts,
) -> Result<Vec<String>, String> {
    let mut wrong = Vec::new();
    let folder = folder(page)?;
    let mut text = String::new();
    let mut copied = 0;
    let lines: Vec<&str> = page.text.lines().collect();
    for fence in page.fences() {
        if !to_run(&fence, page, speed, counts, &mut wrong) {
            continue;
        }
        let mut written = Vec::new();
        for step in steps(&fence) {
            counts.commands += 1;
            println!("> {}:{}: {}", page.path.display(), fence.line, step.command);
            let said = execute(step.command, program, &folder)?;
            match reading {
                Reading::Compare => wrong.extend(
                    differs(&step.printed, &said)
                        .map(|what| format!("{}:{}: $ {}\n{what}", page.path.display(), fence.line, step.command)),
                ),
                Reading::Write => {
                    written.push(format!("$ {}", step.command));
                    written.extend(elided(&step.printed, &said, most_lines(page)));
                }
            }
        }
        if reading == Reading::Write {
            push(&mut text, &lines[copied..fence.line]);
            let written: Vec<&str> = written.iter().map(String::as_str).collect();
            push(&mut text, &written);
            copied = fence.line + fence.lines.len();
        }
    }
    push(&mut text, &lines[copied..]);
    if reading == Reading::Write && text != page.text {
        std::fs::write(&page.path, text).map_err(|error| format!("{}: {error}", page.path.display()))?;
    }
    Ok(wrong)
}

fn push(text: &mut String, lines: &[&str]) {
    for line in lines {
        text.push_str(line);
        text.push('\n');
    }
}

/// Whether a block is run now.
fn to_run(fence: &Fence<'_>, page: &Page, speed: Speed, counts: &mut Counts, wrong: &mut Vec<String>) -> bool {
    match fence.info {
        "console" => true,
        "console,slow" => {
            counts.slow += usize::from(speed == Speed::Fast);
            speed == Speed::Slow
        }
        "sh" => {
            counts.not_run += 1;
            false
        }
        "" => {
            let place = format!("{}:{}", page.path.display(), fence.line);
            wrong.push(format!(
                "{place}: a block without a kind: console, sh, text, toml, csv, rust"
            ));
            false
        }
        _ => false,
    }
}

/// An empty folder for the blocks of a page.
fn folder(page: &Page) -> Result<PathBuf, String> {
    let name = page.path.display().to_string().replace(['/', '.'], "-");
    let folder = crate::targets().join("docs").join(name);
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(failed)?;
    }
    std::fs::create_dir_all(&folder).map_err(failed)?;
    Ok(folder)
}

fn steps<'a>(fence: &Fence<'a>) -> Vec<Step<'a>> {
    let mut steps: Vec<Step<'a>> = Vec::new();
    for line in &fence.lines {
        match (line.strip_prefix("$ "), steps.last_mut()) {
            (Some(command), _) => steps.push(Step {
                command,
                printed: Vec::new(),
            }),
            (None, Some(step)) => step.printed.push(line),
            (None, None) => {}
        }
    }
    steps
}

/// Standard output of a command; a failure that is not part of the command is one of the page.
fn execute(command: &str, program: &Path, folder: &Path) -> Result<Vec<String>, String> {
    let beside = program.parent().unwrap_or(Path::new("."));
    let path = std::env::var("PATH").unwrap_or_default();
    let mut shell = Command::new("sh");
    shell
        .env("PATH", format!("{}:{path}", beside.display()))
        .current_dir(folder);
    // Under `cargo run` the program prints commands for it.
    match command.strip_prefix(BY_CARGO) {
        Some(rest) => shell
            .args(["-c", &format!("hysteron {rest}")])
            .env("CARGO_MANIFEST_DIR", "."),
        None => shell.args(["-c", command]).env_remove("CARGO_MANIFEST_DIR"),
    };
    let output = shell.output().map_err(|error| format!("sh: {error}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(format!("$ {command}: {}\n{said}", output.status));
    }
    let said = String::from_utf8_lossy(&output.stdout);
    let mut lines: Vec<String> = said.lines().map(|line| line.trim_end().to_owned()).collect();
    while lines.last().is_some_and(String::is_empty) {
        lines.pop();
    }
    Ok(lines)
}

/// How the printed output differs from the real one.
fn differs(printed: &[&str], said: &[String]) -> Option<String> {
    let parts: Vec<&[&str]> = printed.split(|line| *line == ELISION).collect();
    let mut at = 0;
    for (number, part) in parts.iter().enumerate() {
        let (first, last) = (number == 0, number + 1 == parts.len());
        let here = match (first, last) {
            (true, true) if part.len() != said.len() => None,
            (true, _) => Some(0),
            (false, true) => said.len().checked_sub(part.len()).filter(|&start| start >= at),
            (false, false) => (at..=said.len()).find(|&start| matches(part, &said[start..])),
        };
        match here {
            Some(start) if matches(part, &said[start..]) => at = start + part.len(),
            _ => {
                return Some(format!(
                    "  printed in the page:\n{}\n  said by the program:\n{}",
                    indented(printed.iter().copied()),
                    indented(said.iter().map(String::as_str))
                ));
            }
        }
    }
    None
}

fn matches(part: &[&str], said: &[String]) -> bool {
    said.len() >= part.len() && part.iter().zip(said).all(|(printed, said)| printed.trim_end() == said)
}

fn indented<'a>(lines: impl Iterator<Item = &'a str>) -> String {
    lines.map(|line| format!("    {line}")).collect::<Vec<_>>().join("\n")
}

/// The real output, with as many lines before the first `...` and behind the last as the page had. A `...` alone stands for output that
/// was never written: it gets the first lines.
fn elided(printed: &[&str], said: &[String], most: usize) -> Vec<String> {
    let first = printed.iter().position(|line| *line == ELISION);
    let last = printed.iter().rposition(|line| *line == ELISION);
    let (Some(before), Some(last)) = (first, last) else {
        return said.to_vec();
    };
    let (before, behind) = match printed.len() {
        1 => (most, 0),
        all => (before, all - last - 1),
    };
    if before + behind >= said.len() {
        return said.to_vec();
    }
    let mut lines = said[..before].to_vec();
    lines.push(ELISION.to_owned());
    lines.extend_from_slice(&said[said.len() - behind..]);
    lines
}

/// Lines of an output that a page shows where it does not say how many.
fn most_lines(page: &Page) -> usize {
    if page.path == Path::new("README.md") { 6 } else { 18 }
}

#[cfg(test)]
mod tests {
    use super::{differs, elided};

    fn said(text: &str) -> Vec<String> {
        text.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn val_output_is_compared_to_the_line() {
        let same = |printed: &[&str], text: &str| differs(printed, &said(text)).is_none();
        assert!(same(&["a", "b"], "a b"));
        assert!(!same(&["a", "b"], "a b c"));
        assert!(!same(&["a", "b"], "a"));
        assert!(!same(&["a", "x"], "a b"));
        // Lines that are left out.
        assert!(same(&["a", "..."], "a b c"));
        assert!(same(&["a", "...", "c"], "a b b c"));
        assert!(same(&["...", "b", "...", "d"], "a b c d"));
        assert!(!same(&["a", "...", "c"], "a b"));
        assert!(!same(&["a", "...", "x", "...", "c"], "a b c"));
        // Two parts do not share a line.
        assert!(!same(&["a", "b", "...", "b", "c"], "a b c"));
    }

    #[test]
    fn val_output_is_written_as_the_page_left_it_out() {
        let written = |printed: &[&str], text: &str| elided(printed, &said(text), 3);
        assert_eq!(written(&["x"], "a b"), ["a", "b"]);
        assert_eq!(written(&["x", "...", "y"], "a b c d"), ["a", "...", "d"]);
        assert_eq!(written(&["x", "..."], "a b c d"), ["a", "..."]);
        assert_eq!(written(&["x", "...", "y"], "a b"), ["a", "b"]);
        // Never written before.
        assert_eq!(written(&["..."], "a b c d"), ["a", "b", "c", "..."]);
        assert_eq!(written(&["..."], "a b"), ["a", "b"]);
    }
}
