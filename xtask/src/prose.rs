//! `cargo xtask prose`: how a text reads, as a guide and not as a gate.

use std::path::{Path, PathBuf};

/// Words that often stand in place of a noun.
const VAGUE: [&str; 3] = ["what", "it", "that"];
/// Longest sentence, words, of README, ARCHITECTURE and tutorials.
pub(crate) const LONGEST: usize = 40;
/// A length that most sentences stay below, words.
const LONG: usize = 30;

/// Prints the rates of the docs, or of the files named.
pub(crate) fn prose(files: &[String]) -> Result<(), String> {
    let paths: Vec<PathBuf> = if files.is_empty() {
        let mut paths = vec![PathBuf::from("README.md"), PathBuf::from("ARCHITECTURE.md")];
        markdown(Path::new(crate::docs::BOOK), &mut paths)?;
        paths.sort();
        paths
    } else {
        files.iter().map(PathBuf::from).collect()
    };
    println!(
        "{:<44} {:>6} {:>6} {:>6} {:>6} {:>5} {:>5}",
        "", "words", "what", "it", "that", "> 30", "> 40"
    );
    println!("{:<44} {:>6} {:>20} {:>11}", "", "", "in 1000 words", "sentences");
    for path in paths {
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let rates = Rates::of(&text);
        let [what, it, that] = rates.vague_in_1000;
        println!(
            "{:<44} {:>6} {what:>6.1} {it:>6.1} {that:>6.1} {:>5} {:>5}",
            path.display(),
            rates.words,
            rates.above_30,
            rates.above_40
        );
    }
    Ok(())
}

fn markdown(folder: &Path, found: &mut Vec<PathBuf>) -> Result<(), String> {
    let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for entry in entries {
        let path = entry.map_err(|error| error.to_string())?.path();
        if path.is_dir() {
            markdown(&path, found)?;
        } else if path.extension().is_some_and(|ending| ending == "md") {
            found.push(path);
        }
    }
    Ok(())
}

struct Rates {
    words: usize,
    vague_in_1000: [f64; 3],
    above_30: usize,
    above_40: usize,
}

impl Rates {
    fn of(text: &str) -> Self {
        let sentences = sentences(text);
        let spoken: Vec<String> = sentences
            .iter()
            .flat_map(|sentence| sentence.split_whitespace())
            .map(|word| word.trim_matches(|c: char| !c.is_alphanumeric()).to_lowercase())
            .filter(|word| !word.is_empty())
            .collect();
        let share =
            |vague: &str| 1e3 * spoken.iter().filter(|word| *word == vague).count() as f64 / spoken.len().max(1) as f64;
        let above = |limit: usize| sentences.iter().filter(|sentence| words(sentence) > limit).count();
        Self {
            words: spoken.len(),
            vague_in_1000: VAGUE.map(share),
            above_30: above(LONG),
            above_40: above(LONGEST),
        }
    }
}

/// Words of a sentence: those with a letter, so that numbers and signs do not count.
pub(crate) fn words(sentence: &str) -> usize {
    let spoken = sentence.split_whitespace();
    spoken.filter(|word| word.chars().any(char::is_alphabetic)).count()
}

/// The sentences of Markdown: fenced blocks, tables, headings and comments left out; each item of a list ends one.
pub(crate) fn sentences(text: &str) -> Vec<String> {
    let mut fenced = false;
    let mut paragraphs = vec![String::new()];
    for line in text.lines() {
        let line = line.trim();
        if line.starts_with("```") {
            fenced = !fenced;
            continue;
        }
        let apart = line.is_empty() || line.starts_with(['#', '|', '<', '!']);
        let item = line.starts_with("- ") || line.split_once(". ").is_some_and(|(n, _)| n.parse::<u32>().is_ok());
        if fenced || apart || item {
            paragraphs.push(String::new());
        }
        if !fenced
            && !apart
            && let Some(paragraph) = paragraphs.last_mut()
        {
            paragraph.push_str(line.trim_start_matches("- "));
            paragraph.push(' ');
        }
    }
    paragraphs.iter().flat_map(|paragraph| split(paragraph)).collect()
}

/// Splits at a full stop, a question or exclamation mark before a space and no small letter.
fn split(paragraph: &str) -> Vec<String> {
    let mut sentences = Vec::new();
    let mut begin = 0;
    for (at, _) in paragraph.match_indices(['.', '?', '!', ':']) {
        let behind = &paragraph[at + 1..];
        let starts = behind.trim_start().chars().next();
        let ends = behind.starts_with(' ') && starts.is_none_or(|c| !c.is_lowercase());
        if ends {
            sentences.push(paragraph[begin..=at].trim().to_owned());
            begin = at + 1;
        }
    }
    sentences.push(paragraph[begin..].trim().to_owned());
    sentences.retain(|sentence| words(sentence) > 0);
    sentences
}

#[cfg(test)]
mod tests {
    use super::{Rates, sentences, words};

    #[test]
    fn val_sentences_are_counted_without_code_and_tables() {
        let text = "# A heading\n\nOne sentence\nover two lines. And e.g. a second one.\n\n```sh\nnot. this. One\n```\n\
            | a table. | B |\n- an item\n- another\n1. a step\n";
        let found = sentences(text);
        assert_eq!(
            found,
            [
                "One sentence over two lines.",
                "And e.g. a second one.",
                "an item",
                "another",
                "1. a step"
            ]
        );
        assert_eq!(words("1.5 um, 12 V - and `x`"), 4);
    }

    #[test]
    fn val_rates_are_in_1000_words() {
        let rates = Rates::of("It is what it is, and that is all. Nine and ten.");
        assert_eq!(rates.words, 12);
        assert_eq!(rates.vague_in_1000.map(|rate| rate.round()), [83.0, 167.0, 83.0]);
        let long = "word ".repeat(41);
        assert_eq!((Rates::of(&long).above_30, Rates::of(&long).above_40), (1, 1));
    }
}
