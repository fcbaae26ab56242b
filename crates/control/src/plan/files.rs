//! `campaign.toml` and the files of commands.

use super::{FILE, FORMAT, Pass, Plan, Planned, check, sequence};
use crate::error::ControlError;
use crate::message::{Message, Setting};
use hysteron_table::short;
use std::fmt::Write;
use std::path::Path;

/// The plan's only key that is looked at before all others, so that a later form is named as such.
#[derive(serde::Deserialize)]
struct Version {
    format: Option<i64>,
}

fn refused(file: &Path, reason: impl Into<Message>) -> ControlError {
    ControlError::Plan {
        file: file.display().to_string(),
        reason: reason.into(),
    }
}

impl Plan {
    /// The text of `campaign.toml`.
    ///
    /// # Errors
    /// A seed beyond what TOML can hold.
    pub fn to_toml(&self) -> Result<String, ControlError> {
        let text = toml::to_string(self).map_err(|_| {
            let largest = format!(" {}: give at most {} to a plan", self.seed, i64::MAX);
            ControlError::Wish(Message::from(Setting::Seed).and(largest))
        })?;
        Ok(format!(
            "# The commands of a campaign and what they are for: do not change it, it is read beside what was recorded of them.\n{text}"
        ))
    }

    /// Reads a plan and its commands from its folder.
    ///
    /// # Errors
    /// No plan there; one of another version; what it does not say; a command that is not there or not the plan's any more.
    pub fn read(folder: &Path) -> Result<Self, ControlError> {
        let file = folder.join(FILE);
        let text = std::fs::read_to_string(&file).map_err(|error| {
            refused(
                &file,
                Message::from(format!("{error}; "))
                    .naming(Setting::Plan)
                    .and(" names the folder that ")
                    .naming(Setting::Planning)
                    .and(" wrote"),
            )
        })?;
        if let Ok(Version { format: Some(format) }) = toml::from_str::<Version>(&text)
            && format != FORMAT
        {
            return Err(refused(
                &file,
                format!("format {format} is not known, this version reads {FORMAT}; write the plan again"),
            ));
        }
        let mut plan: Self =
            toml::from_str(&text).map_err(|error| refused(&file, format!("{error}\nwrite the plan again")))?;
        plan.validate().map_err(|reason| refused(&file, reason))?;
        for record in plan.passes.iter_mut().flat_map(|pass| &mut pass.records) {
            record.voltage_v = command(&folder.join(&record.file), record)?;
        }
        Ok(plan)
    }

    fn validate(&self) -> Result<(), String> {
        // A NaN fails every comparison.
        if !(self.top_v > 0.0 && self.top_v <= 1e4) {
            return Err(format!("top_v = {}: allowed are 0 to 10000 V", self.top_v));
        }
        if !(self.rate_hz >= 1e2 && self.rate_hz <= 1e7) {
            return Err(format!("rate_hz = {}: allowed are 100 to 10 million Hz", self.rate_hz));
        }
        if self.passes.first().is_none_or(|pass| pass.records.is_empty()) {
            return Err("no [[pass.record]]; write the plan again".to_owned());
        }
        for pass in &self.passes {
            for record in &pass.records {
                validate(self, pass, record)?;
            }
        }
        Ok(())
    }
}

fn validate(plan: &Plan, pass: &Pass, record: &Planned) -> Result<(), String> {
    let wrong = |what: String| Err(format!("{}: {what}", record.name));
    if !(record.rate_hz > 0.0 && record.rate_hz <= plan.rate_hz) {
        return wrong(format!(
            "rate_hz = {}: allowed is the plan's, {} Hz, or less",
            short(record.rate_hz),
            short(plan.rate_hz)
        ));
    }
    if record.counts_from < record.lead() || record.counts_from >= record.samples {
        return wrong(format!(
            "counts_from = {}: allowed are {} to {}",
            record.counts_from,
            record.lead(),
            record.samples.saturating_sub(1)
        ));
    }
    let ends = sequence::samples_of(record, plan.rate_hz).checked_add(record.begins_at);
    if ends.is_none_or(|ends| ends > pass.samples) {
        return wrong(format!(
            "begins_at = {}: it ends beyond the {} samples of {}",
            record.begins_at, pass.samples, pass.sequence
        ));
    }
    Ok(())
}

/// The voltages of a command's file, which must be the plan's.
fn command(file: &Path, record: &Planned) -> Result<Vec<f64>, ControlError> {
    let text = std::fs::read_to_string(file).map_err(|error| refused(file, error.to_string()))?;
    let mut voltage_v = Vec::with_capacity(record.samples);
    for (line, row) in text.lines().enumerate().skip(1) {
        let cell = row.split(',').nth(1).unwrap_or_default();
        let value: f64 = cell.trim().parse().map_err(|_| {
            refused(
                file,
                format!(
                    "line {}: `{row}` is no row of time_s,voltage_v; write the plan again",
                    line + 1
                ),
            )
        })?;
        voltage_v.push(value);
    }
    if voltage_v.len() != record.samples || check(&voltage_v) != record.check {
        return Err(refused(
            file,
            format!(
                "this is not the command of {} that the plan has; write the plan again, or put the file back",
                record.name
            ),
        ));
    }
    Ok(voltage_v)
}

/// A command as a file: `time_s,voltage_v`.
pub fn csv(record: &Planned) -> String {
    rows(&record.voltage_v, record.period_s())
}

/// All commands of a pass one after the other as a file.
pub fn sequence_csv(plan: &Plan, pass: &Pass) -> String {
    rows(&sequence::voltages(plan, pass), 1.0 / plan.rate_hz)
}

fn rows(voltage_v: &[f64], period_s: f64) -> String {
    let mut text = String::with_capacity(24 * voltage_v.len() + 20);
    text.push_str("time_s,voltage_v\n");
    for (k, v) in voltage_v.iter().enumerate() {
        // Writing to a String does not fail.
        let _ = writeln!(text, "{:.7},{v:.6}", k as f64 * period_s);
    }
    text
}
