//! What a controller has learned of gain, zero and lag while it ran, in words.

use super::tracked::reference_name;
use hysteron_control::adapted::{Adaptation, Adapted};
use std::fmt::Write;

/// A bound as a board has it, in `f32`, may be short of the bound.
const SHORT_OF_ONE: f64 = 1.0 - 1e-6;

/// How far gain, zero and lag may go.
pub fn bounds_text(bounds: &Adaptation) -> String {
    let lag = if bounds.lag_bound_s > 0.0 {
        format!(
            "lag within +-{:.2} us from references of {:.0} Hz and more",
            1e6 * bounds.lag_bound_s,
            bounds.lag_from_hz
        )
    } else {
        "no lag".to_owned()
    };
    format!(
        "gain within +-{:.2} %, zero within +-{:.4} um, {lag}, time constant {:.1} s",
        100.0 * bounds.gain_bound,
        bounds.zero_bound_um,
        bounds.time_s
    )
}

/// How runs follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Runs {
    /// Each begins at rest, with nothing learned.
    Alone,
    /// Each goes on from what those before it have learned.
    InARow,
}

/// What was learned, in a line.
pub fn adapted_line(learned: &Adapted) -> String {
    format!(
        "learned by the end: gain {:+.3} %, zero {:+.4} um, lag {:+.2} us",
        learned.gain_percent, learned.zero_um, learned.lag_us
    )
}

/// The table of what was learned, a line for each run: its reference, its loop, and gain, zero and lag at its end; nothing of a controller that does not learn.
pub fn adapted_text<'a>(
    bounds: Option<&Adaptation>,
    follow: Runs,
    runs: impl Iterator<Item = (&'a str, &'a str, Adapted)>,
) -> String {
    let Some(bounds) = bounds else {
        return String::new();
    };
    let most_percent = 100.0 * bounds.gain_bound;
    let mut text = format!(
        "\nLEARNED WHILE IT RAN, at the end of each run{}: {}\n\n{:<23} {:<6} {:>9} {:>9} {:>9}\n",
        match follow {
            Runs::Alone => " from rest",
            Runs::InARow => ", going on from the one before",
        },
        bounds_text(bounds),
        "reference",
        "loop",
        "gain, %",
        "zero, um",
        "lag, us"
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
            "{:<23} {loop_kind:<6} {:>+9.3} {:>+9.4} {:>+9.2}{}{}{}",
            reference_name(reference),
            learned.gain_percent,
            learned.zero_um,
            learned.lag_us,
            named("gain", learned.gain_percent.abs() >= most_percent * SHORT_OF_ONE),
            named("zero", learned.zero_um.abs() >= bounds.zero_bound_um * SHORT_OF_ONE),
            named(
                "lag",
                bounds.lag_bound_s > 0.0 && learned.lag_us.abs() >= 1e6 * bounds.lag_bound_s * SHORT_OF_ONE
            )
        );
    }
    text
}
