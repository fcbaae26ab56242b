//! Levels that are held: quiet records, steps, staircases.

use super::{Excitation, check_period, check_voltage, sample_count};
use crate::error::{ParameterError, within};

/// Levels, each held for the same time, joined by straight lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Steps {
    /// The levels in turn, volts. One level alone is a quiet record.
    pub levels_v: Vec<f64>,
    /// Time that each level is held, seconds.
    pub hold_s: f64,
    /// Time of the line to the next level, seconds (0 for a jump).
    pub transition_s: f64,
}

impl Steps {
    /// A staircase from 0 V up to `high_v` and down again, `up` steps each way.
    pub fn staircase(high_v: f64, up: u32, hold_s: f64, transition_s: f64) -> Self {
        let level = |step: u32| high_v * f64::from(step) / f64::from(up.max(1));
        Self {
            levels_v: (0..=up).chain((0..up).rev()).map(level).collect(),
            hold_s,
            transition_s,
        }
    }
}

impl Excitation for Steps {
    fn samples(&self, sample_period_s: f64) -> Result<Vec<f64>, ParameterError> {
        check_period(sample_period_s)?;
        within(
            "steps.hold_s",
            self.hold_s,
            sample_period_s,
            1e6,
            "hold each level for at least one sample",
        )?;
        within("steps.transition_s", self.transition_s, 0.0, 1e6, "give 0 for a jump")?;
        if self.levels_v.is_empty() {
            return Err(ParameterError::Length {
                name: "steps.levels_v".to_owned(),
                found: 0,
                wanted: "1 or more".to_owned(),
                advice: "give the levels in turn",
            });
        }
        for (i, &level_v) in self.levels_v.iter().enumerate() {
            check_voltage(&format!("steps.levels_v[{i}]"), level_v)?;
        }
        let hold = sample_count(self.hold_s, sample_period_s)?;
        let line = (self.transition_s / sample_period_s).round() as usize;
        sample_count(
            (self.hold_s + self.transition_s) * self.levels_v.len() as f64,
            sample_period_s,
        )?;
        let mut samples: Vec<f64> = Vec::new();
        for &level_v in &self.levels_v {
            if let Some(&from_v) = samples.last() {
                samples.extend((1..line).map(|n| from_v + (level_v - from_v) * n as f64 / line as f64));
            }
            samples.extend(std::iter::repeat_n(level_v, hold));
        }
        Ok(samples)
    }

    fn description(&self) -> String {
        format!(
            "{} level{} of {} s, transitions of {} s",
            self.levels_v.len(),
            if self.levels_v.len() == 1 { "" } else { "s" },
            self.hold_s,
            self.transition_s
        )
    }
}
