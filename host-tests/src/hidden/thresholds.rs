//! Verdicts on stored evidence with every threshold of the rules' table moved.

use super::score::{Answer, Grade, Outcome, grade};
use crate::stored::Stored;
use hysteron_diagnose::rules::{RULES, Thresholds};
use hysteron_diagnose::verdict::decide;
use std::fmt::Write;

/// Factors that each threshold is moved by.
const FACTORS: [f64; 2] = [0.7, 1.3];

impl From<&Outcome> for Stored {
    fn from(outcome: &Outcome) -> Self {
        let accepted = outcome.truth.accepted_verdicts().into_iter();
        Self {
            seed: outcome.seed,
            accepted: accepted.map(str::to_owned).collect(),
            evidence: outcome.answer.evidence.clone(),
        }
    }
}

/// Counts of one setting of the thresholds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Verdict right.
    pub right: usize,
    /// Right name beside the verdict.
    pub in_set: usize,
    /// A wrong name.
    pub wrong: usize,
    /// Verdict or set other than with the table's thresholds.
    pub changed: usize,
}

/// The verdicts with these thresholds, beside those with the table's.
pub fn counts(cases: &[Stored], thresholds: &Thresholds) -> Counts {
    let mut counts = Counts::default();
    for case in cases {
        let usual = decide(&case.evidence, &Thresholds::DEFAULT);
        let moved = decide(&case.evidence, thresholds);
        counts.changed += usize::from((&moved.verdict, &moved.set) != (&usual.verdict, &usual.set));
        match grade(&case.accepted, &Answer::from(moved)) {
            Grade::Right => counts.right += 1,
            Grade::InSet => counts.in_set += 1,
            Grade::Wrong => counts.wrong += 1,
            Grade::Missed | Grade::TakenIn => {}
        }
    }
    counts
}

/// Every rule with its threshold and reason, and the verdicts that change where the threshold is moved by 30 %, as Markdown.
pub fn table(cases: &[Stored]) -> String {
    let usual = counts(cases, &Thresholds::DEFAULT);
    let mut text = format!(
        "{} cases with the table's thresholds: {} right, {} in the set, {} wrong.\n\n\
         | rule | threshold | reason | x 0.7: verdicts changed; right, wrong | x 1.3 |\n|---|---|---|---|---|\n",
        cases.len(),
        usual.right,
        usual.in_set,
        usual.wrong
    );
    for rule in RULES {
        let cells = FACTORS.map(|factor| cell(usual, counts(cases, &Thresholds::DEFAULT.moved(rule.id, factor))));
        let _ = writeln!(
            text,
            "| `{:?}` | {} | {} | {} |",
            rule.id,
            rule.threshold,
            rule.reason,
            cells.join(" | ")
        );
    }
    text
}

/// What a moved threshold changes.
fn cell(usual: Counts, moved: Counts) -> String {
    if moved.changed == 0 {
        return "0".to_owned();
    }
    let more = |now: usize, before: usize| now as i64 - before as i64;
    format!(
        "{}; {:+}, {:+}",
        moved.changed,
        more(moved.right, usual.right),
        more(moved.wrong, usual.wrong)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_diagnose::diagnosis::Before;
    use hysteron_diagnose::evidence::Evidence;
    use hysteron_diagnose::rules::RuleId;

    /// An error of 0.35 % that nothing explains: `unknown` above the threshold of 0.3 %, `none` below it.
    fn unexplained() -> Stored {
        let errors = Before {
            identify_percent: Some(0.35),
            validate_percent: Some(0.35),
        };
        Stored {
            seed: 1,
            accepted: vec!["unknown".to_owned()],
            evidence: Evidence {
                before: errors,
                base: errors,
                left_percent: 0.35,
                left_excess: 0.0035 * 0.0035,
                base_excess: 0.0035 * 0.0035,
                more_than_noise: true,
                shape_determined: true,
                ..Evidence::default()
            },
        }
    }

    #[test]
    fn val_a_moved_threshold_changes_the_verdict_that_hangs_on_it() {
        let cases = [unexplained()];
        let usual = counts(&cases, &Thresholds::DEFAULT);
        assert_eq!((usual.right, usual.changed), (1, 0));
        let moved = counts(&cases, &Thresholds::DEFAULT.moved(RuleId::MattersPercent, 1.3));
        assert_eq!((moved.right, moved.changed), (0, 1));
        let text = table(&cases);
        let row = |rule: &str| {
            text.lines()
                .find(|line| line.starts_with(&format!("| `{rule}` ")))
                .map(str::to_owned)
        };
        assert!(
            row("MattersPercent").is_some_and(|row| row.ends_with("| 0 | 1; -1, +0 |")),
            "{text}"
        );
        assert!(
            row("SetStatistic").is_some_and(|row| row.ends_with("| 0 | 0 |")),
            "{text}"
        );
        assert_eq!(text.lines().count(), RULES.len() + 4);
    }

    #[test]
    fn val_stored_evidence_is_read_back() {
        let line = serde_json::to_string(&unexplained()).unwrap_or_default();
        assert_eq!(serde_json::from_str::<Stored>(&line).ok(), Some(unexplained()));
    }
}
