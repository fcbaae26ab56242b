//! `cargo xtask evidence`: the tables of the book's evidence, each measured by the command that stands above it.
//!
//! A page has a table between two comments; the first names the command:
//!
//! ```text
//! <!-- evidence: hysteron paper --rivals -->
//! ... command, date, code, machine and time, and the output ...
//! <!-- end of evidence -->
//! ```

use crate::docs::BOOK;
use crate::{cargo, output, targets};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Beginning of the comment before a table.
const BEFORE: &str = "<!-- evidence: ";
/// The comment after a table.
const AFTER: &str = "<!-- end of evidence -->";
/// Beginning of the line that says when a table was measured.
const MEASURED: &str = "Measured on ";

/// Beginnings of the lines that this tool and the test harness print around a command's own.
const OF_THE_TOOLS: [&str; 3] = ["> ", "running ", "test "];

/// A table's command, and the place of all between its two comments.
#[derive(Debug, PartialEq)]
struct Table {
    command: String,
    body: Range<usize>,
}

/// `cargo xtask evidence [WORD...]`: measures the tables whose commands contain all words anew; without words it lists them.
pub(crate) fn evidence(words: &[String]) -> Result<(), String> {
    let mut found = 0;
    for page in pages()? {
        let commands: Vec<String> = tables(&read(&page)?)?.into_iter().map(|table| table.command).collect();
        for command in commands {
            if words.is_empty() {
                println!("{}: {command}", page.display());
            } else if words.iter().all(|word| command.contains(word.as_str())) {
                found += 1;
                let measured = measured(&command)?;
                // Other tables of the page have moved since.
                let mut text = read(&page)?;
                let mut all = tables(&text)?.into_iter();
                let table = all.find(|table| table.command == command);
                let table = table.ok_or_else(|| format!("{}: {command} has gone", page.display()))?;
                text.replace_range(table.body, &measured);
                std::fs::write(&page, text).map_err(|error| format!("{}: {error}", page.display()))?;
            }
        }
    }
    if found == 0 && !words.is_empty() {
        return Err(format!("evidence: no table's command contains {}", words.join(" and ")));
    }
    Ok(())
}

/// Tables that were never measured, or whose comments do not match.
pub(crate) fn check() -> Result<Vec<String>, String> {
    let mut wrong = Vec::new();
    for page in pages()? {
        let text = read(&page)?;
        let unmeasured = tables(&text)?
            .into_iter()
            .filter(|table| !text[table.body.clone()].contains(MEASURED));
        wrong.extend(unmeasured.map(|table| format!("{}: not measured: {}", page.display(), table.command)));
    }
    Ok(wrong)
}

fn pages() -> Result<Vec<PathBuf>, String> {
    let folder = Path::new(BOOK).join("evidence");
    let files = std::fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut pages: Vec<PathBuf> = files.flatten().map(|file| file.path()).collect();
    pages.retain(|page| page.extension().is_some_and(|ending| ending == "md"));
    pages.sort();
    Ok(pages)
}

fn read(page: &Path) -> Result<String, String> {
    std::fs::read_to_string(page).map_err(|error| format!("{}: {error}", page.display()))
}

/// The tables of a page.
fn tables(text: &str) -> Result<Vec<Table>, String> {
    let mut found = Vec::new();
    let mut from = 0;
    while let Some(start) = text[from..].find(BEFORE) {
        let command_at = from + start + BEFORE.len();
        let close = text[command_at..].find(" -->").ok_or("a comment without its end")?;
        let command = text[command_at..command_at + close].to_owned();
        let body = command_at + close + " -->".len();
        let end = text[body..]
            .find(AFTER)
            .ok_or_else(|| format!("{command}: no `{AFTER}`"))?;
        if text[body..body + end].contains(BEFORE) {
            return Err(format!("{command}: no `{AFTER}` before the next table"));
        }
        found.push(Table {
            command,
            body: body..body + end,
        });
        from = body + end;
    }
    Ok(found)
}

/// Runs a command and says of its output when, on which code and machine, and how long it took.
fn measured(command: &str) -> Result<String, String> {
    let words: Vec<&str> = command.split_whitespace().collect();
    let (program, words) = match words.as_slice() {
        ["hysteron", rest @ ..] => {
            cargo(&["build", "--release", "--package", "hysteron-cli", "--locked"])?;
            (targets().join("release/hysteron").display().to_string(), rest)
        }
        [program, rest @ ..] => ((*program).to_owned(), rest),
        [] => return Err("evidence: a table without a command".to_owned()),
    };
    println!("> {command}");
    let code = code()?;
    let started = Instant::now();
    let said = output(&program, words)?;
    let seconds = started.elapsed().as_secs_f64();
    let date = output("date", &["-u", "+%Y-%m-%d"])?;
    Ok(body(command, &said, date.trim(), &code, &machine(), seconds))
}

/// All between the two comments.
fn body(command: &str, said: &str, date: &str, code: &str, machine: &str, seconds: f64) -> String {
    let lines: Vec<&str> = said
        .lines()
        .filter(|line| !OF_THE_TOOLS.iter().any(|start| line.starts_with(start)))
        .map(str::trim_end)
        .collect();
    let said = lines.join("\n");
    let said = said.trim_matches('\n');
    let shown = if lines.iter().any(|line| line.starts_with("|--")) {
        said.to_owned()
    } else {
        format!("```text\n{said}\n```")
    };
    format!("\n`{command}`. {MEASURED}{date}, {code}, {machine}, in {seconds:.0} s.\n\n{shown}\n\n")
}

/// The commit that was measured, and whether more than it.
fn code() -> Result<String, String> {
    let commit = output("git", &["rev-parse", "--short", "HEAD"])?;
    let changed = output(
        "git",
        &["status", "--porcelain", "--", "crates", "host-tests", "firmware"],
    )?;
    let more = if changed.trim().is_empty() { "" } else { " and changes" };
    Ok(format!("commit {}{more}", commit.trim()))
}

/// The processor, where the system names it.
fn machine() -> String {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let name = name.map_or(std::env::consts::ARCH, |(_, name)| name.trim());
    format!("{threads} threads of {name}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_tables_are_found_by_their_comments() {
        let text = format!("a\n{BEFORE}x --y -->\nold\n{AFTER}\nb\n{BEFORE}z -->{AFTER}");
        let found = tables(&text).unwrap();
        assert_eq!(
            (found[0].command.as_str(), &text[found[0].body.clone()]),
            ("x --y", "\nold\n")
        );
        assert_eq!((found[1].command.as_str(), &text[found[1].body.clone()]), ("z", ""));
    }

    #[test]
    fn refuse_comments_that_do_not_match() {
        assert!(tables(&format!("{BEFORE}x")).is_err());
        assert!(tables(&format!("{BEFORE}x -->\n")).is_err());
        assert!(tables(&format!("{BEFORE}x -->\n{BEFORE}y -->\n{AFTER}")).is_err());
    }

    #[test]
    fn val_tables_stay_tables_and_the_rest_is_as_printed() {
        let table = body(
            "c",
            "> cargo run\n\nrunning 1 test\n| a |\n|---|\n| 1 |\ntest val_one ... ok\n",
            "2026-01-02",
            "commit 1",
            "2 threads of x",
            3.4,
        );
        assert_eq!(
            table,
            "\n`c`. Measured on 2026-01-02, commit 1, 2 threads of x, in 3 s.\n\n| a |\n|---|\n| 1 |\n\n"
        );
        assert!(body("c", "a  b\n", "d", "e", "f", 1.0).contains("```text\na  b\n```"));
    }
}
