//! A diagnosis in plain sentences.

use crate::lock_words::left_line;
use crate::number::significant;
use hysteron_diagnose::diagnosis::{Diagnosis, Level, RankedEffect};

/// The verdict in one sentence.
pub fn verdict_sentence(diagnosis: &Diagnosis) -> String {
    if !diagnosis.cannot_answer.is_empty() {
        return "These records cannot say which effect is missing.".to_owned();
    }
    match diagnosis.verdict.as_str() {
        "none" => "Nothing is missing: what is left is sensor noise and the known coarseness of the model.".to_owned(),
        "unknown" => "Structure remains that no effect of the catalogue explains.".to_owned(),
        "hysteresis-shape" => {
            "Nothing physical is missing; the family of plays is too poor for the shape of these loops.".to_owned()
        }
        name if diagnosis.also_possible.is_empty() => format!("{} is missing.", effect_name(name, true)),
        name => format!(
            "{} is missing, or {}: these records cannot tell them apart.",
            effect_name(name, true),
            list(&diagnosis.also_possible, "or")
        ),
    }
}

/// Everything a diagnosis says besides its verdict and its figures, a sentence each.
pub fn diagnosis_lines(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines: Vec<String> = diagnosis
        .cannot_answer
        .iter()
        .map(|reason| sentence(reason_in_words(reason)))
        .collect();
    if !diagnosis.further.is_empty() {
        lines.push(format!(
            "With it in the model, there is still {}.",
            list(&diagnosis.further, "and")
        ));
    }
    let seen = |r: &&RankedEffect| r.effect == "backlash" && r.level == Level::Physical && r.significant;
    if let Some(lost) = diagnosis.ranking.iter().find(seen) {
        let value = |name: &str| {
            lost.parameters
                .iter()
                .find(|p| p.name == name)
                .map_or(f64::NAN, |p| p.value)
        };
        lines.push(format!(
            "After {:.0} slow reversals, at either end, the position stands still over {}\u{a0}V and then sets off at once: \
             up to {}\u{a0}um are lost. The plays of a model take part of that in.",
            value("reversals_looked_at"),
            significant(value("dead_band")),
            significant(value("largest_width"))
        ));
    }
    let drift = diagnosis
        .ranking
        .iter()
        .find(|r| r.effect == "thermal-drift" && r.significant);
    let rate = drift.and_then(|drift| drift.parameters.iter().find(|p| p.name == "position_per_hour"));
    if let Some(rate) = rate {
        lines.push(format!(
            "The position drifts by {}\u{a0}um/h, one rate for all records. No temperature was recorded, so heat is not told from what a \
             stage or its amplifier does after it is switched on: record the temperature, and a long rest at 0\u{a0}V.",
            significant(rate.value)
        ));
    }
    if let Some(known_s) = diagnosis.known_delay_s {
        let us = |seconds: f64| 1e6 * seconds;
        let more = diagnosis.delay_s().map_or(String::new(), |more_s| {
            format!(" The {:.1}\u{a0}us of delay named here come on top.", us(more_s))
        });
        lines.push(format!(
            "The recordings say that {:.1}\u{a0}us of delay are the controller's own: they were taken off before the search, the \
             stage has no part in them.{more} The model has none of it yet: add the effect delay, it is fitted to the whole.",
            us(known_s)
        ));
    }
    if !diagnosis.shape_determined {
        lines.push(
            "These records leave the inside of the loops open, so the model's own plays stood in for a hysteresis of free \
             shape: minor loops (a decaying triangle, a noise) would tell more."
                .to_owned(),
        );
    }
    if diagnosis.shape_too_poor {
        lines.push(
            "The model's family of plays is too poor for these loops: a play-polynomial model may follow them."
                .to_owned(),
        );
    }
    lines.extend(left_line(diagnosis));
    if let Some(next) = &diagnosis.next_record {
        let mut line = format!("Record to take next: {}", next.excitation);
        if !next.separates.is_empty() {
            line.push_str(&format!(
                "; it would separate {} by {:.1} times what is left unexplained",
                list(&next.separates, "from"),
                next.expected_sigma
            ));
        }
        lines.push(line + ".");
    }
    lines
}

/// Why records cannot answer, in words.
pub fn reason_in_words(reason: &str) -> &str {
    match reason {
        "nothing-moves" => "the voltage stands still in every record",
        "no-validation" => "no record that moves has role validate: an effect could be judged only where it was fitted",
        "no-identification" => "no record that moves has role identify",
        "all-noise" => "the stroke is less than 30 times the noise: a medium effect drowns in it",
        "clipped" => {
            "the position stands on its largest or smallest value in over 5 % of the samples while the voltage moves"
        }
        "one-excitation" => "only one sine was played: at one frequency and amplitude all effects look alike",
        "too-short" => "the records that move last too short a time",
        other => other,
    }
}

/// An effect's name as a word of a sentence: `First-order lag`.
pub(crate) fn effect_name(name: &str, opening: bool) -> String {
    let words = match name.strip_prefix("first-order-") {
        Some(rest) => format!("first-order {rest}"),
        None => name.replace('-', " "),
    };
    if opening { capital(&words) } else { words }
}

fn capital(text: &str) -> String {
    let mut characters = text.chars();
    characters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(characters).collect())
}

fn sentence(text: &str) -> String {
    capital(text) + "."
}

/// `a`, `a or b`, `a, b or c`.
fn list(names: &[String], before_last: &str) -> String {
    let names: Vec<String> = names.iter().map(|name| effect_name(name, false)).collect();
    match names.split_last() {
        None => String::new(),
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} {before_last} {last}", others.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::{effect_name, list};

    #[test]
    fn golden_names_and_lists_read_as_words() {
        assert_eq!(effect_name("first-order-lag", true), "First-order lag");
        assert_eq!(effect_name("slew-limit", false), "slew limit");
        let names = |n: &[&str]| n.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
        assert_eq!(list(&names(&[]), "or"), "");
        assert_eq!(list(&names(&["delay"]), "or"), "delay");
        assert_eq!(
            list(&names(&["delay", "slew-limit", "creep"]), "or"),
            "delay, slew limit or creep"
        );
    }
}
