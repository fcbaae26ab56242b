//! What was learned, in words.

use super::percent;
use crate::{lock_in_words, reason_in_words};
use hysteron_diagnose::{Attempt, Learned, Stop};
use hysteron_identify::{Change, EffectId, EffectName, Family};
use std::fmt::Write;

/// The attempts in their order, why it stopped, and the record to take next. `family` is the one that it began with.
pub fn learned_text(family: Family, learned: &Learned) -> String {
    let mut text = format!("{family} fitted\n");
    for attempt in &learned.attempts {
        text.push_str(&told(attempt));
    }
    let _ = writeln!(text, "stopped: {}", why(learned));
    if learned.stop != Stop::NothingMissing
        && let Some(next) = &learned.diagnosis.next_record
    {
        let _ = writeln!(text, "record to take next: {}", next.excitation);
    }
    text
}

/// One attempt in a line.
fn told(attempt: &Attempt) -> String {
    let (before, after) = (percent(attempt.before_percent), percent(attempt.after_percent));
    let what = match (attempt.change, attempt.kept) {
        (Change::Removed, _) => "taken out again; superfluous since the last step",
        (_, true) if attempt.uncertain => "kept, as it helps on the records not fitted to; its cause is uncertain",
        (_, true) => "added; the records not fitted to confirm it",
        (_, false) if !fell(attempt) => "left out; the records not fitted to do not confirm it",
        (_, false) if attempt.effect == EffectId::HysteresisShape => {
            "left out; between the recorded loops it departs from the model's own plays by more than they show"
        }
        (_, false) => "left out; the error over all records does not fall",
    };
    let mut line = format!("{}: {what}, {before} -> {after} %\n", attempt.effect);
    if !attempt.also_possible.is_empty() {
        let _ = writeln!(
            line,
            "  these records cannot tell it from: {}",
            list(&attempt.also_possible)
        );
    }
    line
}

/// Whether the error on the records not fitted to fell.
fn fell(attempt: &Attempt) -> bool {
    let pair = attempt.before_percent.zip(attempt.after_percent);
    pair.is_some_and(|(before, after)| after < before)
}

fn why(learned: &Learned) -> String {
    match &learned.stop {
        Stop::NothingMissing => {
            "nothing more is missing; the rest is sensor noise and the known coarseness of the model".to_owned()
        }
        Stop::CannotTell { reasons } => {
            let words: Vec<&str> = reasons.iter().map(|reason| reason_in_words(*reason)).collect();
            format!("these records cannot answer: {}", words.join("; "))
        }
        Stop::Unknown { unexplained } => {
            let before = learned.diagnosis.before;
            let left = before.validate_percent.or(before.identify_percent).unwrap_or(f64::NAN);
            let mut text = format!(
                "nothing more can be told; of the {left:.3} % of peak to peak that are left, noise explains {} %, and no \
                 effect of the catalogue the rest with certainty",
                percent(Some(unexplained.noise_percent))
            );
            if let Some(lock) = unexplained.locked_to.first().filter(|lock| lock.share > 0.1) {
                let _ = write!(
                    text,
                    "; {:.0} % of it goes with {}",
                    100.0 * lock.share,
                    lock_in_words(lock)
                );
            }
            text
        }
        Stop::EnoughSteps => "six steps are enough; what is left is better looked at by a person".to_owned(),
    }
}

/// Names with commas between them.
fn list(names: &[EffectName]) -> String {
    let names: Vec<&str> = names.iter().map(EffectName::as_str).collect();
    names.join(", ")
}
