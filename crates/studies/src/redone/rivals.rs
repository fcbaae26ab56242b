//! The models of Table 1 beside the paper's own.

use super::stages;
use crate::paper::{RIVALS_HZ, RivalRow, rivals};
use hysteron_tracking::TrackingError;
use std::fmt::Write;

/// Each model of Table 1, identified, in the paper's two loops, on the two stages.
#[derive(Debug)]
pub struct Rivals {
    tables: Vec<(&'static str, Vec<RivalRow>)>,
    seed: u64,
}

impl Rivals {
    /// Identifies and runs them.
    ///
    /// # Errors
    /// Those of [`rivals`].
    pub fn new(seed: u64) -> Result<Self, TrackingError> {
        let tables = stages()
            .into_iter()
            .map(|(name, stage)| Ok((name, rivals(&stage, seed)?)));
        Ok(Self {
            tables: tables.collect::<Result<_, TrackingError>>()?,
            seed,
        })
    }

    /// The tables in words.
    pub fn text(&self) -> String {
        text(&self.tables)
    }

    /// The same for programs.
    pub fn json(&self) -> serde_json::Value {
        let tables = self.tables.iter();
        let tables: serde_json::Map<String, serde_json::Value> = tables
            .map(|(name, rows)| ((*name).to_owned(), serde_json::json!(rows)))
            .collect();
        serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "seed": self.seed,
            "tracked_hz": RIVALS_HZ,
            "stages": tables,
        })
    }
}

fn text(tables: &[(&str, Vec<RivalRow>)]) -> String {
    let mut text = String::from(
        "Direct inverses with N = 10 plays, all identified from the same sines of 0 to 26 V (eqs 16 to 18), rms, % of peak to peak:\n\
         fit of the voltage; tracking error of the reading, open loop and with the paper's PI gains; in brackets the paper's figures\n",
    );
    for (name, rows) in tables {
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "\n{:<23} {:>11} {:>22}  {:>35}  {:>35}  a tick: MAC, compares, calls",
            name, "parameters", "fit 10, 100, 500 Hz", "open loop 10, 100, 500, 503 Hz", "PI 10, 100, 500, 503 Hz"
        );
        for row in rows {
            text.push_str(&line(row));
        }
    }
    text.push_str(
        "\nYang's damper has parameters that are functions of a sine's frequency; a controller does not know it, here they are constants.\n\
         Al Janaideh's envelopes of hyperbolic tangents (2008) are a cubic here. Every inverse is direct: the same form fitted to the\n\
         records with position and voltage exchanged.\n",
    );
    text
}

fn line(row: &RivalRow) -> String {
    let bracket = |value: Option<f64>| value.map_or_else(String::new, |value| format!("({value})"));
    let list = |values: &[f64]| values.iter().map(|v| format!("{v:>6.2}")).collect::<Vec<_>>().join(" ");
    let published = row
        .published_parameters
        .map_or_else(String::new, |count| format!("({count})"));
    let [open, closed] = row.published_500_hz.map(bracket);
    let cost = row.operations;
    format!(
        "{:<23} {:>5} {published:>5} {:>22}  {} {open:>7}  {} {closed:>7}  {:>6} {:>4} {:>3}\n",
        row.model,
        row.parameters,
        list(&row.fit_percent),
        list(&row.open_percent),
        list(&row.closed_percent),
        cost.multiply_adds,
        cost.compares,
        cost.calls
    )
}
