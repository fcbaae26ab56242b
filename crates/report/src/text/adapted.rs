//! What a controller has learned of gain and zero while it ran, in words.

use super::tracked::reference_name;
use hysteron_control::adapted::{Adaptation, Adapted};
use std::fmt::Write;

/// How far gain and zero may go.
pub fn bounds_text(bounds: &Adaptation) -> String {
    format!(
        "gain within +-{:.2} %, zero within +-{:.4} um, time constant {:.1} s",
        100.0 * bounds.gain_bound,
        bounds.zero_bound_um,
        bounds.time_s
    )
}

/// The table of what was learned, a line for each run: its reference, its loop, and gain and zero at its end; nothing of a controller that does not learn.
pub fn adapted_text<'a>(
    bounds: Option<&Adaptation>,
    runs: impl Iterator<Item = (&'a str, &'a str, Adapted)>,
) -> String {
    let Some(bounds) = bounds else {
        return String::new();
    };
    let most_percent = 100.0 * bounds.gain_bound;
    let mut text = format!(
        "\nLEARNED WHILE IT RAN, at the end of each run from rest: {}\n\n{:<23} {:<6} {:>9} {:>9}\n",
        bounds_text(bounds),
        "reference",
        "loop",
        "gain, %",
        "zero, um"
    );
    for (reference, loop_kind, learned) in runs {
        let named = |what: &str, at_bound: bool| {
            if at_bound {
                format!("  {what} AT ITS BOUND")
            } else {
                String::new()
            }
        };
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<23} {loop_kind:<6} {:>+9.3} {:>+9.4}{}{}",
            reference_name(reference),
            learned.gain_percent,
            learned.zero_um,
            named("gain", learned.gain_percent.abs() >= most_percent),
            named("zero", learned.zero_um.abs() >= bounds.zero_bound_um)
        );
    }
    text
}
