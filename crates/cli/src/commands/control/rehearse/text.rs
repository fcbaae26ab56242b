//! What a rehearsal says, as a table.

use crate::output;
use hysteron_report::beyond_text;
use hysteron_trials::rehearsal::Rehearsed;
use std::collections::BTreeMap;
use std::fmt::Write;

pub(super) fn text(rehearsed: &Rehearsed) -> String {
    const KEYS: [&str; 4] = ["10", "100", "500", "hold"];
    let mut text = format!(
        "a stage drawn from seed {}, one effect hidden; error of the model on records it was not fitted to, of the true position\n\
         against the reference, %\n\n{:<44} {:<6} {:>8}",
        rehearsed.seed, "model", "loop", "model"
    );
    for key in KEYS {
        // Writing to a String does not fail.
        let _ = write!(text, " {key:>8}");
    }
    text.push('\n');
    let mut line =
        |name: &str, kind: &str, model: Option<f64>, errors: Option<&BTreeMap<String, f64>>, refused: &str| {
            let model = model.map_or_else(|| "-".to_owned(), |percent| format!("{percent:.3}"));
            let _ = write!(text, "{name:<44} {kind:<6} {model:>8}");
            match errors {
                Some(errors) => KEYS.iter().for_each(|key| {
                    let _ = write!(text, " {:>8.3}", errors.get(*key).copied().unwrap_or(f64::NAN));
                }),
                None => text.push_str(&format!(" no controller:\n    {refused}")),
            }
            text.push('\n');
        };
    for rung in &rehearsed.rungs {
        let name = if rung.effects.is_empty() {
            "hysteresis".to_owned()
        } else {
            format!("+ {}", output::list(&rung.effects))
        };
        let name = if rung.trained { format!("{name}, trained") } else { name };
        let refused = rung.refused.as_deref().unwrap_or("");
        line(
            &name,
            rung.loop_kind,
            rung.model_percent,
            rung.tracking_percent.as_ref(),
            refused,
        );
    }
    const WITHOUT: &str = "the same, this compensator left out";
    const BARE: &str = "(trained, nothing hidden in the stage)";
    let no_inverse = "the hysteresis has no inverse";
    let without = rehearsed.without_compensator_percent.as_ref();
    line(WITHOUT, "open", None, without, no_inverse);
    if let Some(closed) = &rehearsed.without_compensator_closed_percent {
        line(WITHOUT, "closed", None, Some(closed), "");
    }
    let bare = rehearsed.without_effect_percent.as_ref();
    line(BARE, "open", None, bare, no_inverse);
    if let Some(emulator) = rehearsed.emulator {
        if let Some(errors) = &rehearsed.host_percent {
            line("(trained, by the host in f64)", "open", None, Some(errors), "");
        }
        let _ = writeln!(
            text,
            "\nrecorded and tracked by the firmware in {emulator}, an image for each controller: {} ticks by the sample clock, {} of\n\
             them late or lost; the others worked out ahead, every frame compared with the host's, bit by bit",
            rehearsed.clocked_ticks, rehearsed.late_ticks
        );
    }
    if !rehearsed.beyond.is_empty() {
        text.push('\n');
        text.push_str(&beyond_text(&rehearsed.beyond));
    }
    let _ = writeln!(
        text,
        "\nhidden was: {} ({}); {}",
        rehearsed.effect,
        rehearsed.truth,
        if rehearsed.named { "named" } else { "NOT NAMED" }
    );
    text
}
