//! A diagnosis in plain sentences.

use crate::lock_words::left_line;
use crate::number::significant;
use hysteron_diagnose::diagnosis::{Diagnosis, Level, NextRecord, RankedEffect, Reason, Verdict};
use hysteron_diagnose::{Finding, Kind};
use hysteron_identify::{EffectId, EffectName};

/// The verdict in one sentence.
pub fn verdict_sentence(diagnosis: &Diagnosis) -> String {
    let blocking: Vec<&Reason> = diagnosis
        .cannot_answer
        .iter()
        .filter(|reason| reason.blocks())
        .collect();
    if !blocking.is_empty() {
        return "These records cannot say which effect is missing.".to_owned();
    }
    let share = diagnosis
        .share
        .filter(|share| (0.0..=1.0).contains(share))
        .map_or(String::new(), |share| {
            format!(
                " It takes {:.0}\u{a0}% of the squared error above noise and coarseness.",
                100.0 * share
            )
        });
    match &diagnosis.verdict {
        Verdict::Nothing => {
            "Nothing is missing: the rest is sensor noise and the known coarseness of the model.".to_owned()
        }
        Verdict::Unknown if diagnosis.also_possible.is_empty() => {
            "Structure remains that no effect of the catalogue explains.".to_owned()
        }
        Verdict::Unknown => format!(
            "Structure remains. It could be {}: none of them is certain enough to be named.",
            list(&diagnosis.also_possible, "or")
        ),
        Verdict::Effect(name) if *name == EffectId::HysteresisShape => {
            let alike = if diagnosis.also_possible.is_empty() {
                String::new()
            } else {
                format!(
                    " The loops alone do not tell it from {}: a sensor of another kind would.",
                    list(&diagnosis.also_possible, "or")
                )
            };
            format!("The family of plays is too poor for the shape of these loops.{alike}")
        }
        Verdict::Effect(name) if diagnosis.also_possible.is_empty() => {
            format!("{} is missing.{share}", effect_name(name.as_str(), true))
        }
        Verdict::Effect(name) => format!(
            "{} is missing, or {}: these records cannot tell them apart.{share}",
            effect_name(name.as_str(), true),
            list(&diagnosis.also_possible, "or")
        ),
    }
}

/// Everything a diagnosis says besides its verdict and its figures, a sentence each.
pub fn diagnosis_lines(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines = remarks(diagnosis);
    lines.extend(left_line(diagnosis));
    lines.extend(next_line(diagnosis));
    lines
}

/// What limits a verdict or stands beside it, a sentence each.
pub(crate) fn remarks(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines: Vec<String> = diagnosis
        .cannot_answer
        .iter()
        .map(|reason| sentence(reason_in_words(*reason)))
        .collect();
    lines.extend(odds_in_words(diagnosis).map(|odds| odds.sentence()));
    if !diagnosis.further.is_empty() {
        lines.push(format!(
            "With it in the model, there is still {}.",
            list(&diagnosis.further, "and")
        ));
    }
    let seen = |r: &&RankedEffect| r.effect == EffectId::Backlash && r.level == Level::Physical && r.significant;
    if let Some(lost) = diagnosis.ranking.iter().find(seen)
        && lost.parameters.iter().any(|p| p.name == "dead_band")
    {
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
    lines.extend(drift_line(diagnosis));
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
    // Clipped readings are a reason already.
    let said = |finding: &&Finding| finding.kind == Kind::Clipped && diagnosis.cannot_answer.contains(&Reason::Clipped);
    let findings = diagnosis.acquisition.iter().filter(|finding| !said(finding));
    lines.extend(findings.map(|finding| format!("The recording: {finding}.")));
    lines
}

/// Probabilities below this are not said.
const LEAST_SAID: f64 = 0.05;

/// What probabilities rest on.
const ODDS: &str = "Probabilities, from stages whose hidden effect was known";

/// How likely each candidate is, in words.
#[derive(Debug, Clone, PartialEq)]
pub struct OddsWords {
    /// What the probabilities rest on.
    pub title: &'static str,
    /// Each alternative, its probability as printed, and the probability.
    pub each: Vec<(String, String, f64)>,
}

impl OddsWords {
    /// All of it in a sentence.
    pub fn sentence(&self) -> String {
        let each = self.each.iter().map(|(name, printed, _)| format!("{name} {printed}"));
        format!("{}: {}.", self.title, each.collect::<Vec<_>>().join(", "))
    }
}

/// How likely each candidate is and that it is none of them, from 5 % on; none where the verdict is nothing or no diagnosis.
pub fn odds_in_words(diagnosis: &Diagnosis) -> Option<OddsWords> {
    let named = diagnosis
        .verdict
        .effect()
        .filter(|name| **name != EffectId::HysteresisShape);
    if diagnosis.odds.each.is_empty() || named.is_none() && diagnosis.verdict != Verdict::Unknown {
        return None;
    }
    let candidates = diagnosis.odds.each.iter();
    let candidates = candidates.map(|likely| (effect_name(likely.effect.as_str(), false), likely.probability));
    let none = ("none of the catalogue".to_owned(), diagnosis.odds.none);
    let said = candidates
        .chain([none])
        .filter(|(_, probability)| *probability > LEAST_SAID);
    Some(OddsWords {
        title: ODDS,
        each: said
            .map(|(name, probability)| (name, format!("{:.0}\u{a0}%", 100.0 * probability), probability))
            .collect(),
    })
}

/// The record to take next and what it would tell; where a set remains and no record would part it, this.
pub(crate) fn next_line(diagnosis: &Diagnosis) -> Option<String> {
    let Some(next) = &diagnosis.next_record else {
        let named = diagnosis.verdict.effect().into_iter();
        let open: Vec<EffectName> = named.chain(&diagnosis.also_possible).cloned().collect();
        return (open.len() > 1).then(|| {
            format!(
                "No record that this rig can make would separate {}: its rate, range and slew are those of the records.",
                list(&open, "from")
            )
        });
    };
    Some(after_record(next))
}

/// What a record would tell.
fn after_record(next: &NextRecord) -> String {
    let names: Vec<EffectName> = next.expected.iter().map(|likely| likely.effect.clone()).collect();
    let percent = |probability: f64| (100.0 * probability).round().clamp(1.0, 99.0);
    let each = next.expected.iter().map(|likely| percent(likely.probability));
    let (least, most) = each.fold((99.0_f64, 1.0_f64), |(least, most), p| (least.min(p), most.max(p)));
    let right = if least < most {
        format!("{least:.0} to {most:.0}")
    } else {
        format!("{most:.0}")
    };
    let what = if names.len() > 1 {
        format!("the right one of {}", list(&names, "and"))
    } else {
        format!("{}, if that is missing,", list(&names, "and"))
    };
    let excitation = &next.excitation;
    format!("Record to take next: {excitation}; after it {what} would have {right}\u{a0}%.")
}

/// A drift without a temperature, in words.
fn drift_line(diagnosis: &Diagnosis) -> Option<String> {
    let named = |name: &EffectName| *name == EffectId::ThermalDrift;
    let drift = diagnosis.ranking.iter().find(|r| named(&r.effect) && r.significant)?;
    let counts = diagnosis.verdict.effect().is_some_and(named) || diagnosis.further.iter().any(named);
    let without_temperature = drift.parameters.iter().any(|p| p.name == "reference" && p.value == 0.0);
    let rate = drift
        .parameters
        .iter()
        .find(|p| p.name == "shift")
        .filter(|_| counts && without_temperature)?;
    Some(format!(
        "The position drifts by {}\u{a0}um/h, one rate for all records. No temperature was recorded, so heat is not told from what a \
         stage or its amplifier does after it is switched on: record the temperature, and a long rest at 0\u{a0}V.",
        significant(rate.value)
    ))
}

/// Why records cannot answer, in words.
pub fn reason_in_words(reason: Reason) -> &'static str {
    match reason {
        Reason::NothingMoves => "the voltage stands still in every record",
        Reason::AllNoise => "the stroke is less than 30 times the noise: a medium effect drowns in it",
        Reason::Clipped => {
            "the position stands on its largest or smallest value in over 5 % of the samples while the voltage moves: \
             what lies beyond is not known"
        }
        Reason::OneSine => {
            "only one sine was played: of what widens or bends the loops nothing is told; drift, creep, hum and coupling are"
        }
        Reason::PositionLeads => {
            "the position leads the voltage, so the columns were not taken at one time: of delay, lag and rate dependence nothing is told"
        }
        Reason::NothingHeldOut => "no part of the records is left to judge by that was not fitted",
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
fn list(names: &[EffectName], before_last: &str) -> String {
    let names: Vec<String> = names.iter().map(|name| effect_name(name.as_str(), false)).collect();
    match names.split_last() {
        None => String::new(),
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} {before_last} {last}", others.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_diagnose::odds::Likely;

    #[test]
    fn golden_a_record_says_what_it_would_tell() {
        let of = |each: &[(EffectId, f64)]| {
            let likely = |&(effect, probability): &(EffectId, f64)| Likely {
                effect: effect.into(),
                probability,
            };
            after_record(&NextRecord {
                excitation: "steps".to_owned(),
                expected: each.iter().map(likely).collect(),
                file: None,
                sample_period_s: 1e-3,
                voltage_v: Vec::new(),
                voltage2_v: None,
            })
        };
        assert_eq!(
            of(&[(EffectId::Delay, 0.914), (EffectId::Creep, 0.999)]),
            "Record to take next: steps; after it the right one of delay and creep would have 91 to 99\u{a0}%."
        );
        assert_eq!(
            of(&[(EffectId::Creep, 0.8)]),
            "Record to take next: steps; after it creep, if that is missing, would have 80\u{a0}%."
        );
    }

    #[test]
    fn golden_names_and_lists_read_as_words() {
        assert_eq!(effect_name("first-order-lag", true), "First-order lag");
        assert_eq!(effect_name("slew-limit", false), "slew limit");
        let names = |n: &[&str]| {
            n.iter()
                .map(|s| hysteron_identify::EffectName::of(s))
                .collect::<Vec<_>>()
        };
        assert_eq!(list(&names(&[]), "or"), "");
        assert_eq!(list(&names(&["delay"]), "or"), "delay");
        assert_eq!(
            list(&names(&["delay", "slew-limit", "creep"]), "or"),
            "delay, slew limit or creep"
        );
    }
}
