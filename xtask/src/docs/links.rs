//! Links: every file and heading that a page points to is there; every chapter is in the book's contents.

use super::BOOK;
use super::pages::Page;
use std::path::{Component, Path, PathBuf};

/// What is wrong with the links of all pages.
pub(super) fn check(pages: &[Page]) -> Vec<String> {
    let mut wrong = Vec::new();
    for page in pages {
        for link in links(&page.prose()) {
            if let Some(reason) = broken(page, &link, pages) {
                wrong.push(format!("{}: link to `{link}`: {reason}", page.path.display()));
            }
        }
    }
    let contents = Path::new(BOOK).join("SUMMARY.md");
    let listed: Vec<PathBuf> = pages
        .iter()
        .filter(|page| page.path == contents)
        .flat_map(|page| links(&page.prose()))
        .map(|link| normal(&Path::new(BOOK).join(link)))
        .collect();
    let chapters = pages.iter().map(|page| &page.path);
    wrong.extend(
        chapters
            .filter(|path| path.starts_with(BOOK) && **path != contents && !listed.contains(path))
            .map(|path| format!("{}: not in {}", path.display(), contents.display())),
    );
    wrong
}

/// Why a link leads nowhere; other hosts are not asked.
fn broken(page: &Page, link: &str, pages: &[Page]) -> Option<String> {
    if link.starts_with("https://") || link.starts_with("http://") {
        return None;
    }
    let (file, heading) = link.split_once('#').unwrap_or((link, ""));
    let folder = page.path.parent().unwrap_or(Path::new(""));
    let target = if file.is_empty() {
        page.path.clone()
    } else {
        normal(&folder.join(file))
    };
    if !target.exists() && !pages.iter().any(|other| other.path == target) {
        return Some(format!("no file {}", target.display()));
    }
    if page.path.starts_with(BOOK) && !target.starts_with(BOOK) {
        return Some("outside of the book, which is read without the repository".to_owned());
    }
    if heading.is_empty() {
        return None;
    }
    let there = pages.iter().find(|other| other.path == target)?;
    let found = headings(&there.prose()).iter().any(|other| other == heading);
    (!found).then(|| format!("no heading `{heading}` in {}", target.display()))
}

/// Targets of `[text](target)` and `![text](target)`.
fn links(prose: &str) -> Vec<String> {
    let mut links = Vec::new();
    let mut rest = prose;
    while let Some(at) = rest.find("](") {
        rest = &rest[at + 2..];
        if let Some(end) = rest.find(')') {
            links.push(rest[..end].to_owned());
            rest = &rest[end..];
        }
    }
    links
}

/// The anchors of a page's headings, as mdBook and GitHub make them.
fn headings(prose: &str) -> Vec<String> {
    let titles = prose.lines().filter(|line| line.starts_with('#'));
    titles
        .map(|line| {
            let title = line.trim_start_matches('#').trim().to_lowercase();
            let kept = title.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            kept.map(|c| if c == ' ' { '-' } else { c }).collect()
        })
        .collect()
}

/// A path without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                normal.pop();
            }
            Component::CurDir => {}
            part => normal.push(part),
        }
    }
    normal
}

#[cfg(test)]
mod tests {
    use super::check;
    use crate::docs::pages::page;

    #[test]
    fn val_broken_links_are_found() {
        let contents = page("docs/SUMMARY.md", "[a](a.md)\n");
        let good = page(
            "docs/a.md",
            "# One more: effect\n[here](#one-more-effect) [there](https://example.org)\n",
        );
        assert_eq!(check(&[contents, good]), Vec::<String>::new());

        let contents = page("docs/SUMMARY.md", "[a](a.md)\n");
        let bad = page("docs/a.md", "[x](nowhere.md) [y](#no-heading) [z](../Cargo.toml)\n");
        let forgotten = page("docs/b.md", "");
        let wrong = check(&[contents, bad, forgotten]).join("\n");
        for reason in [
            "no file docs/nowhere.md",
            "no heading `no-heading`",
            "docs/b.md: not in docs/SUMMARY.md",
        ] {
            assert!(wrong.contains(reason), "{reason}: {wrong}");
        }
    }
}
