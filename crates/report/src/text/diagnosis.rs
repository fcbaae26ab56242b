//! A diagnosis in words and tables.

use crate::{diagnosis_lines, failing_lines, verdict_sentence};
use hysteron_diagnose::diagnosis::Diagnosis;
use std::fmt::Write;

/// A diagnosis in words and tables.
pub fn diagnosis_text(d: &Diagnosis) -> String {
    let mut text = String::new();
    is_anything_missing(&mut text, d);
    text.push('\n');
    for line in failing_lines(d) {
        text.push_str(&line);
        text.push('\n');
    }
    // Writing to a String does not fail.
    let _ = writeln!(text, "\nverdict: {}\n{}", d.verdict, verdict_sentence(d));
    for line in diagnosis_lines(d) {
        let _ = writeln!(text, "  - {line}");
    }
    match d.next_record.as_ref().map(|next| &next.file) {
        Some(Some(file)) => {
            let _ = writeln!(text, "    written to {file}");
        }
        Some(None) => text.push_str("    `-o next.csv` writes it\n"),
        None => {}
    }
    ranking(&mut text, d);
    let left = &d.unexplained;
    let _ = writeln!(
        text,
        "\nleft unexplained: {:.3} % of peak to peak, of which noise {:.3} %",
        left.percent, left.noise_percent
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

fn is_anything_missing(text: &mut String, d: &Diagnosis) {
    let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3} %"));
    if let Some(noise) = &d.noise {
        let _ = writeln!(text, "noise floor {noise}");
    }
    let _ = writeln!(
        text,
        "{:<38} {:>10} {:>10}",
        "error, % of peak to peak", "identify", "validate"
    );
    for (name, error) in [("the model", d.before), (instead(d), d.free_shape)] {
        let (identify, validate) = (percent(error.identify_percent), percent(error.validate_percent));
        let _ = writeln!(text, "{name:<38} {identify:>10} {validate:>10}");
    }
}

fn ranking(text: &mut String, diagnosis: &Diagnosis) {
    let _ = writeln!(
        text,
        "\n  {:<20} {:<9} {:>10} {:>10} {:>10} {:>9} {:>7}",
        "candidate", "level", "identify %", "validate %", "statistic", "threshold", "share"
    );
    for effect in &diagnosis.ranking {
        let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |percent| format!("{percent:.3}"));
        let (identify, validate) = (
            percent(effect.errors.identify_percent),
            percent(effect.errors.validate_percent),
        );
        let level = effect.level.name();
        let _ = writeln!(
            text,
            "{} {:<20} {level:<9} {identify:>10} {validate:>10} {:>10.2} {:>9.2} {:>6.0}%",
            if effect.significant { '*' } else { ' ' },
            effect.effect,
            effect.statistic,
            effect.threshold,
            100.0 * effect.share
        );
        if effect.significant && !effect.parameters.is_empty() {
            let parameters: Vec<String> = effect
                .parameters
                .iter()
                .map(|p| format!("{} {:.4e} {}", p.name, p.value, p.unit))
                .collect();
            let _ = writeln!(text, "      {}", parameters.join(", "));
        }
    }
    text.push_str("  (* significant and large enough to matter; share: what it takes of the squared error)\n");
}
