//! `cargo xtask docs`: README and book checked against the program, and the book built.

mod blocks;
mod links;
mod pages;
mod picture;
mod reference;

use crate::{cargo, evidence, output, prose, run};
use blocks::{Reading, Speed};
use pages::Page;
use std::path::{Path, PathBuf};

/// The largest README, bytes: a stranger reads it in three minutes.
const README_BYTES: usize = 8192;
/// Where the book's sources lie.
pub(crate) const BOOK: &str = "docs";
/// Where the book is built.
const BUILT: &str = "target/book";

/// `cargo xtask docs [--write] [--fast] [--no-html] [--program FILE]`.
pub(crate) fn docs(words: &[String]) -> Result<(), String> {
    let (mut reading, mut speed, mut html, mut given) = (Reading::Compare, Speed::Slow, true, None);
    let mut words = words.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--write" => reading = Reading::Write,
            "--fast" => speed = Speed::Fast,
            "--no-html" => html = false,
            "--program" => given = Some(PathBuf::from(words.next().ok_or("docs: --program needs a file")?)),
            other => {
                return Err(format!(
                    "docs: `{other}` is none of --write, --fast, --no-html, --program FILE"
                ));
            }
        }
    }
    if given.is_none() {
        cargo(&["build", "--workspace", "--bin", "hysteron", "--locked"])?;
    }
    let program = given.map_or_else(built, Ok)?;
    check_with(&program, reading, speed)?;
    if html { build() } else { Ok(()) }
}

/// Checks the pages and runs every block with the program that the tests have built.
pub(crate) fn check() -> Result<(), String> {
    check_with(&built()?, Reading::Compare, Speed::Slow)
}

fn check_with(program: &Path, reading: Reading, speed: Speed) -> Result<(), String> {
    if reading == Reading::Write {
        reference::write(program)?;
    }
    let mut wrong = Vec::new();
    if speed == Speed::Slow {
        wrong.extend(picture::check(program, reading)?);
    }
    let pages = pages::all()?;
    wrong.extend(links::check(&pages));
    wrong.extend(reference::check(program, &pages)?);
    wrong.extend(lengths(&pages));
    wrong.extend(evidence::check()?);
    let mut counts = blocks::Counts::default();
    for page in &pages {
        wrong.extend(blocks::run(page, program, reading, speed, &mut counts)?);
    }
    println!(
        "{} pages, {} commands run as printed, {} blocks left to `cargo xtask docs`, {} that need hardware or minutes not run",
        pages.len(),
        counts.commands,
        counts.slow,
        counts.not_run
    );
    if wrong.is_empty() {
        return Ok(());
    }
    for one in &wrong {
        println!("{one}");
    }
    Err(format!(
        "{} defects in the docs; where the program's words have changed: cargo xtask docs --write",
        wrong.len()
    ))
}

/// README's size, and sentences that nobody follows.
fn lengths(pages: &[Page]) -> Vec<String> {
    let mut wrong = Vec::new();
    for page in pages {
        let name = page.path.display().to_string();
        if name == "README.md" && page.text.len() > README_BYTES {
            wrong.push(format!("{name}: {} bytes, at most {README_BYTES}", page.text.len()));
        }
        let gated = ["README.md", "ARCHITECTURE.md"].contains(&name.as_str()) || name.contains("tutorials/");
        if gated {
            let long = prose::sentences(&page.text).into_iter();
            wrong.extend(
                long.filter(|sentence| prose::words(sentence) > prose::LONGEST)
                    .map(|sentence| format!("{name}: {} words: {sentence}", prose::words(&sentence))),
            );
        }
    }
    wrong
}

/// The program of the development profile.
fn built() -> Result<PathBuf, String> {
    let program = crate::targets().join("debug/hysteron");
    let absolute = std::path::absolute(&program).map_err(|error| error.to_string())?;
    if absolute.exists() {
        Ok(absolute)
    } else {
        Err(format!(
            "{} is not there: cargo build --workspace --bin hysteron",
            program.display()
        ))
    }
}

/// Builds the book; mdbook is installed first where it is absent.
fn build() -> Result<(), String> {
    if output("mdbook", &["--version"]).is_err() {
        run("cargo", &["install", "--locked", "mdbook"])?;
    }
    run("mdbook", &["build", BOOK, "--dest-dir", &absolute(BUILT)?])?;
    println!("open {BUILT}/index.html");
    Ok(())
}

fn absolute(path: &str) -> Result<String, String> {
    let absolute = std::path::absolute(Path::new(path)).map_err(|error| error.to_string())?;
    Ok(absolute.display().to_string())
}
