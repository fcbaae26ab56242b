//! An effect in words.

use super::amounts::{Amount, plain};
use crate::{equation, significant};
use hysteron_identify::effects::{Description, Place};
use hysteron_identify::illustration::Illustration;
use std::fmt::Write;

/// The places of the chain in their order.
pub const CHAIN: [Place; 7] = [
    Place::Delay,
    Place::Amplifier,
    Place::Hysteresis,
    Place::Creep,
    Place::Structure,
    Place::Coupling,
    Place::Sensor,
];

/// The chain in words, the effect's own place in brackets.
fn chain(place: Place) -> String {
    let mut text = "voltage".to_owned();
    for here in CHAIN {
        let name = here.name();
        let _ = if here == place {
            write!(text, " → [{name}]")
        } else {
            write!(text, " → {name}")
        };
    }
    text + " → reading"
}

/// What the pictures show, in a sentence.
pub fn caption(shown: &Illustration) -> String {
    format!(
        "{}, on a stage of 10 µm at 100 V: with and without the effect differ by {} % of the stroke.",
        capital(&shown.excitation),
        significant(shown.differs_percent)
    )
}

/// The first letter as a capital.
fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(chars).collect())
}

/// The titled paragraphs of an explanation.
pub fn paragraphs(d: &Description) -> [(&'static str, String); 7] {
    [
        ("Equation", equation(d.equation)),
        ("Source, usual size", d.source.to_owned()),
        ("Place in the chain", chain(d.place)),
        ("How it shows", d.shows.to_owned()),
        ("Mistaken for", d.mistaken_for.to_owned()),
        ("Told apart by", d.separated_by.to_owned()),
        ("Compensated by", d.compensated_by.to_owned()),
    ]
}

/// An effect in words: what it is, how it shows, what it is mistaken for, and an example where it can be `shown`.
pub fn explanation_text(d: &Description, shown: &Result<Illustration, String>) -> String {
    let mut text = format!("{}: {}\n", d.name, d.summary);
    for (title, paragraph) in paragraphs(d) {
        let _ = write!(text, "\n{title}\n{}", wrapped(&paragraph));
    }
    text.push_str("\nParameters\n");
    for p in d.parameters {
        let unit = if p.unit.is_empty() { "-" } else { p.unit };
        let _ = writeln!(text, "  {:<14} {unit:<8} {}", p.name, p.what);
    }
    if d.parameters.is_empty() {
        text.push_str("  none of its own: it changes the hysteresis' plays\n");
    }
    match shown {
        Ok(shown) => {
            let _ = write!(
                text,
                "\nAn example (pictures: -o page.html)\n{}",
                wrapped(&caption(shown))
            );
            let names: Vec<String> = d.parameters.iter().map(|p| format!("{:<14}", p.name)).collect();
            let amounts: Vec<Amount<'_>> = d
                .parameters
                .iter()
                .zip(&names)
                .zip(&shown.values)
                .map(|((p, name), &value)| Amount {
                    name,
                    value,
                    standard_error: None,
                    unit: p.unit,
                })
                .collect();
            for line in plain(&amounts) {
                let _ = writeln!(text, "  {line}");
            }
        }
        Err(reason) => {
            let _ = write!(text, "\nNo example\n{}", wrapped(reason));
        }
    }
    text
}

/// A paragraph indented by two and wrapped at 100 columns.
pub fn wrapped(paragraph: &str) -> String {
    const COLUMNS: usize = 98;
    let mut text = String::new();
    let mut line = String::new();
    for word in paragraph.split_whitespace() {
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > COLUMNS {
            let _ = writeln!(text, "  {line}");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    let _ = writeln!(text, "  {line}");
    text
}
