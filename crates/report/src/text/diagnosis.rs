//! A diagnosis in words and tables.

use super::amounts::{Amount, plain};
use super::percent;
use crate::diagnosis_words::{effect_name, next_line, remarks};
use crate::lock_words::left_line;
use crate::{failing_lines, verdict_sentence};
use hysteron_diagnose::diagnosis::{Before, Diagnosis, RankedEffect, Verdict};
use hysteron_identify::{EffectId, EffectName};
use std::fmt::Write;

/// A diagnosis in a few lines: the verdict, the figures that carry it, what limits it, and the record to take next.
pub fn diagnosis_text(d: &Diagnosis) -> String {
    let mut text = format!("verdict: {}\n{}\n\n", d.verdict, verdict_sentence(d));
    figures(&mut text, d);
    let mut lines = remarks(d);
    if d.verdict == Verdict::Unknown {
        lines.extend(left_line(d));
    }
    lines.extend(next_line(d));
    if !lines.is_empty() {
        text.push('\n');
    }
    // Writing to a String does not fail.
    for line in lines {
        let _ = writeln!(text, "  - {line}");
    }
    match d.next_record.as_ref().map(|next| &next.file) {
        Some(Some(file)) => {
            let _ = writeln!(text, "    written to {file}");
        }
        Some(None) => text.push_str("    `-o next.csv` writes it\n"),
        None => {}
    }
    text
}

/// What a diagnosis rests on: where the model fails, every candidate, and the error that none explains.
pub fn diagnosis_details(d: &Diagnosis) -> String {
    let mut text = String::new();
    for line in failing_lines(d) {
        text.push_str(&line);
        text.push('\n');
    }
    ranking(&mut text, d);
    text.extend(left_line(d).map(|line| format!("\n{line}\n")));
    let left = &d.unexplained;
    let _ = writeln!(
        text,
        "left unexplained: {} % of peak to peak, of which noise {} %",
        percent(Some(left.percent)),
        percent(Some(left.noise_percent))
    );
    text
}

fn instead(d: &Diagnosis) -> &'static str {
    if d.shape_determined {
        "a hysteresis of free shape instead"
    } else {
        "its plays, fitted anew"
    }
}

/// The errors of the model, of the same with the verdict's effect, and of the noise alone.
fn figures(text: &mut String, d: &Diagnosis) {
    let named = named(d).and_then(|effect| d.ranking.iter().find(|entry| entry.effect == *effect));
    let second = named.map_or_else(
        || (instead(d).to_owned(), d.free_shape),
        |entry| {
            let hysteresis = if d.shape_determined {
                "a hysteresis of free shape"
            } else {
                "its plays, fitted anew"
            };
            let name = effect_name(entry.effect.as_str(), false);
            (format!("{hysteresis}, and {name}"), entry.errors)
        },
    );
    let rows: [(String, Before); 2] = [("the model".to_owned(), d.before), second];
    let _ = writeln!(
        text,
        "{:<46} {:>10} {:>13}",
        "error, % of peak to peak", "fitted to", "not fitted to"
    );
    for (name, error) in rows {
        let (identify, validate) = (percent(error.identify_percent), percent(error.validate_percent));
        let _ = writeln!(text, "{name:<46} {identify:>10} {validate:>13}");
    }
    if let Some(noise) = &d.noise {
        let _ = writeln!(
            text,
            "{:<46} {:>24}  {noise}",
            "noise floor",
            percent(Some(d.unexplained.noise_percent))
        );
    }
}

/// The effect that the verdict names, where a candidate of the ranking stands for it.
fn named(d: &Diagnosis) -> Option<&EffectName> {
    let blocked = d.cannot_answer.iter().any(|reason| reason.blocks());
    let effect = d.verdict.effect().filter(|_| !blocked)?;
    (*effect != EffectId::HysteresisShape).then_some(effect)
}

/// How a candidate stands to the verdict.
fn mark(d: &Diagnosis, effect: &RankedEffect) -> char {
    if d.verdict.effect() == Some(&effect.effect) {
        '>'
    } else if d.also_possible.contains(&effect.effect) {
        '~'
    } else if d.further.contains(&effect.effect) {
        '+'
    } else if effect.significant {
        '*'
    } else {
        ' '
    }
}

fn ranking(text: &mut String, diagnosis: &Diagnosis) {
    let _ = writeln!(
        text,
        "\n  {:<20} {:<9} {:>10} {:>10} {:>10} {:>9} {:>7}",
        "candidate", "level", "identify %", "validate %", "statistic", "threshold", "share"
    );
    for effect in &diagnosis.ranking {
        let (identify, validate) = (
            percent(effect.errors.identify_percent),
            percent(effect.errors.validate_percent),
        );
        let level = effect.level.name();
        let share = 100.0 * effect.share;
        let share = if share > -0.5 {
            format!("{:.0} %", share.max(0.0))
        } else {
            // It makes the error larger: by how much says nothing.
            "none".to_owned()
        };
        let _ = writeln!(
            text,
            "{} {:<20} {level:<9} {identify:>10} {validate:>10} {:>10.2} {:>9.2} {share:>7}",
            mark(diagnosis, effect),
            effect.effect,
            effect.statistic,
            effect.threshold,
        );
        if effect.significant && !effect.parameters.is_empty() {
            let parameters: Vec<Amount<'_>> = effect.parameters.iter().map(Amount::from).collect();
            let parameters = plain(&parameters);
            let _ = writeln!(text, "      {}", parameters.join(", "));
        }
    }
    text.push_str(
        "  (> the verdict, ~ not told from it, + missing besides, * significant but not chosen; share: of the squared error)\n",
    );
}
