//! What a controller has learned of gain, zero and lag while it ran, in words.

use super::tracked::reference_name;
use hysteron_control::adapted::{Adaptation, Adapted};
use std::fmt::Write;

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

/// The table of what was learned, a line for each run: its reference, its loop, and gain, zero and lag at its end; nothing of a controller that does not learn.
pub fn adapted_text<'a>(
    bounds: Option<&Adaptation>,
    runs: impl Iterator<Item = (&'a str, &'a str, Adapted)>,
) -> String {
    let Some(bounds) = bounds else {
        return String::new();
    };
    let most_percent = 100.0 * bounds.gain_bound;
    let mut text = format!(
        "\nLEARNED WHILE IT RAN, at the end of each run from rest: {}\n\n{:<23} {:<6} {:>9} {:>9} {:>9}\n",
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
            named("gain", learned.gain_percent.abs() >= most_percent),
            named("zero", learned.zero_um.abs() >= bounds.zero_bound_um),
            // Behind two roundings.
            named(
                "lag",
                bounds.lag_bound_s > 0.0 && learned.lag_us.abs() >= 1e6 * bounds.lag_bound_s * (1.0 - 1e-9)
            )
        );
    }
    text
}
