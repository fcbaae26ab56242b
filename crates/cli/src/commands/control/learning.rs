//! References that were learned run by run, in words and files.

use crate::error::CliError;
use crate::output;
use hysteron_control::learning::LearnedReference;
use hysteron_control::reference::SHAPES;
use hysteron_trials::board_points;
use std::fmt::Write;
use std::path::Path;

/// Writes what was learned as the board takes it, one file a reference.
pub(super) fn keep(folder: &Path, learned: &[LearnedReference], range_um: [f64; 2]) -> Result<(), CliError> {
    for (name, shape) in SHAPES {
        let Some(learned) = learned.iter().find(|learned| learned.name == name) else {
            continue;
        };
        let mut text = String::from("position_um\n");
        for um in board_points(shape, range_um, learned) {
            // Writing to a String does not fail.
            let _ = writeln!(text, "{um:.6}");
        }
        output::write_file(&folder.join(format!("{name}.csv")), &text)?;
    }
    Ok(())
}

/// The table of what was learned; nothing without any.
pub(super) fn text(learned: &[LearnedReference], by: &str) -> String {
    let Some(longest) = learned.iter().map(|reference| reference.iterations.len()).max() else {
        return String::new();
    };
    let runs = || learned.iter().flat_map(|reference| &reference.iterations);
    let position = if runs().all(|run| run.true_percent.is_some()) {
        "true position"
    } else {
        "sensor's reading"
    };
    let mut text = format!(
        "\nLEARNED run by run{by}, complete feedforward, open loop: error of the {position} after each correction, %; * is kept, by the\n\
         measured error\n\n     "
    );
    for reference in learned {
        // Writing to a String does not fail.
        let _ = write!(text, " {:>10}", reference.name.split('-').next().unwrap_or_default());
    }
    text.push('\n');
    for number in 0..longest {
        let _ = write!(text, "{number:>5}");
        for reference in learned {
            let _ = match reference.iterations.get(number) {
                Some(run) => {
                    let kept = if number == reference.kept { "*" } else { " " };
                    write!(text, " {:>9.4}{kept}", run.percent())
                }
                None => write!(text, " {:>10}", ""),
            };
        }
        text.push('\n');
    }
    for reference in learned {
        let _ = writeln!(text, "{}: {}", reference.name, reference.stopped);
    }
    text
}
