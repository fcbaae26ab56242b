//! The chapters that the program writes itself: every command with its help, every effect of the catalogue.

use super::pages::Page;
use crate::output;
use std::fmt::Write;
use std::path::Path;

const COMMANDS: &str = "docs/reference/commands.md";
const EFFECTS: &str = "docs/reference/effects.md";

/// Writes the chapters anew.
pub(super) fn write(program: &Path) -> Result<(), String> {
    for (path, text) in [(COMMANDS, commands(program)?), (EFFECTS, effects(program)?)] {
        std::fs::write(path, text).map_err(|error| format!("{path}: {error}"))?;
    }
    Ok(())
}

/// Chapters that the program would write otherwise.
pub(super) fn check(program: &Path, pages: &[Page]) -> Result<Vec<String>, String> {
    let mut wrong = Vec::new();
    for (path, text) in [(COMMANDS, commands(program)?), (EFFECTS, effects(program)?)] {
        let same = pages
            .iter()
            .any(|page| page.path == Path::new(path) && page.text == text);
        if !same {
            wrong.push(format!("{path}: the program's words have changed"));
        }
    }
    Ok(wrong)
}

fn say(program: &Path, words: &[&str]) -> Result<String, String> {
    output(&program.display().to_string(), words)
}

/// The names below `Commands:` of a help text.
fn named(help: &str) -> Vec<String> {
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    lines
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .map(str::to_owned)
        .collect()
}

fn commands(program: &Path) -> Result<String, String> {
    let mut text = "# Commands\n\nEvery command with its `--help`, as the program prints it.\n".to_owned();
    for name in named(&say(program, &["--help"])?) {
        let help = say(program, &[&name, "--help"])?;
        chapter(&mut text, "##", &name, &help);
        for below in named(&help) {
            let help = say(program, &[&name, &below, "--help"])?;
            chapter(&mut text, "###", &format!("{name} {below}"), &help);
        }
    }
    Ok(text)
}

fn chapter(text: &mut String, level: &str, name: &str, help: &str) {
    let lines: Vec<&str> = help.lines().map(str::trim_end).collect();
    // Writing to a String does not fail.
    let _ = write!(
        text,
        "\n{level} {name}\n\n```text\n{}\n```\n",
        lines.join("\n").trim_end()
    );
}

fn effects(program: &Path) -> Result<String, String> {
    let mut text = "# Effects\n\nThe catalogue in the order of the chain, as `hysteron explain EFFECT` prints it. \
        `hysteron explain EFFECT -o page.html` adds pictures.\n"
        .to_owned();
    let list = say(program, &["explain", "--json"])?;
    let list: serde_json::Value = serde_json::from_str(&list).map_err(|error| format!("explain --json: {error}"))?;
    let all = list.as_array().ok_or("explain --json: no list")?;
    for effect in all {
        let name = effect["effect"]
            .as_str()
            .ok_or("explain --json: an effect without a name")?;
        let said = say(program, &["explain", name])?;
        chapter(&mut text, "##", name, &said);
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::named;

    #[test]
    fn val_commands_are_found_in_a_help_text() {
        let help = "about\n\nCommands:\n  fit   Fit a model\n        over two lines\n  help  Print\n\nOptions:\n  -h\n";
        assert_eq!(named(help), ["fit"]);
    }
}
