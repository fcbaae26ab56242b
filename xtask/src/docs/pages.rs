//! The pages: README, ARCHITECTURE and the rest of the root, and the chapters of the book.

use super::BOOK;
use std::fs;
use std::path::{Path, PathBuf};

/// Pages outside of the book that are checked with it.
const ROOT: [&str; 5] = [
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "CHANGELOG.md",
];

/// A page of Markdown.
pub(super) struct Page {
    /// From the root of the repository.
    pub path: PathBuf,
    pub text: String,
}

/// A fenced block.
pub(super) struct Fence<'a> {
    /// Its line, from 1.
    pub line: usize,
    /// Behind the backticks: `console`, `console,slow`, `toml`.
    pub info: &'a str,
    /// The lines between the fences.
    pub lines: Vec<&'a str>,
}

impl Page {
    /// The fenced blocks.
    pub(super) fn fences(&self) -> Vec<Fence<'_>> {
        let mut fences: Vec<Fence<'_>> = Vec::new();
        let mut open = false;
        for (number, line) in self.text.lines().enumerate() {
            match line.trim_start().strip_prefix("```") {
                Some(info) if !open => {
                    open = true;
                    fences.push(Fence {
                        line: number + 1,
                        info: info.trim(),
                        lines: Vec::new(),
                    });
                }
                Some(_) => open = false,
                None if open => {
                    if let Some(fence) = fences.last_mut() {
                        fence.lines.push(line);
                    }
                }
                None => {}
            }
        }
        fences
    }

    /// The text without fenced blocks.
    pub(super) fn prose(&self) -> String {
        let mut open = false;
        let mut prose = String::new();
        for line in self.text.lines() {
            if line.trim_start().starts_with("```") {
                open = !open;
            } else if !open {
                prose.push_str(line);
            }
            prose.push('\n');
        }
        prose
    }
}

/// All pages, the book's in the order of their paths.
pub(super) fn all() -> Result<Vec<Page>, String> {
    let mut paths: Vec<PathBuf> = ROOT.iter().map(PathBuf::from).collect();
    let mut book = Vec::new();
    collect(Path::new(BOOK), &mut book)?;
    book.sort();
    paths.extend(book);
    paths
        .into_iter()
        .map(|path| {
            let text = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
            Ok(Page { path, text })
        })
        .collect()
}

fn collect(folder: &Path, found: &mut Vec<PathBuf>) -> Result<(), String> {
    let entries = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for entry in entries {
        let path = entry.map_err(|error| error.to_string())?.path();
        if path.is_dir() {
            collect(&path, found)?;
        } else if path.extension().is_some_and(|ending| ending == "md") {
            found.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
pub(super) fn page(path: &str, text: &str) -> Page {
    Page {
        path: PathBuf::from(path),
        text: text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::page;

    #[test]
    fn val_fences_and_prose_are_told_apart() {
        let page = page("x.md", "a\n```console,slow\n$ b\nc\n```\nd\n```toml\ne = 1\n```\n");
        let fences = page.fences();
        assert_eq!(fences.len(), 2);
        assert_eq!((fences[0].line, fences[0].info), (2, "console,slow"));
        assert_eq!(fences[0].lines, ["$ b", "c"]);
        assert_eq!(page.prose().split_whitespace().collect::<Vec<_>>(), ["a", "d"]);
    }
}
