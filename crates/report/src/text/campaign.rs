//! The records of a campaign in words.

use hysteron_control::plan::came_back::CameBack;
use hysteron_data::Record;
use std::fmt::Write;

/// The records, and how long they are together.
pub fn records_text(records: &[Record]) -> String {
    let mut text = String::new();
    let mut total_s = 0.0;
    for record in records {
        total_s += record.duration_s();
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:<32} {:>8} samples  {:>7.3} s  {}",
            record.file,
            record.len(),
            record.duration_s(),
            record.excitation
        );
    }
    let _ = writeln!(text, "\n{total_s:.1} s of records");
    text
}

/// How well what is identified from records explains their commands.
pub fn misfit_text(misfit_percent: f64) -> String {
    format!("identified from them: the inverse misses the commands by {misfit_percent:.3} % of their range\n")
}

/// What came back of a plan: its records, the rig, and what was identified.
pub fn came_back_text(came: &CameBack) -> String {
    records_text(&came.dataset.records) + &came.rig + &misfit_text(came.misfit_percent)
}
