//! A table's law as C99: one source and one header, no allocation, the bits of the core's `f32`.
//!
//! The texts beside this file are the law block by block, in the order of operations of the core's. Lines between `//{ part` and
//! `//} part` are there where the law has the part. The numbers are those that the core's own constructors make of the table.

mod constants;

use crate::check::refuse;
use crate::{CORNERS_ABOVE, Family, Table, TableError, hash};
use constants::Constants;
use hysteron_core::surroundings::{CompleteLaw, HARMONICS};
use hysteron_core::tracking_law::{CREEP_FAST, CREEP_SLOW, TAPS};
use std::fmt::Write;

/// A law as C.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CCode {
    /// `NAME.h`.
    pub header: String,
    /// `NAME.c`.
    pub source: String,
}

/// What the texts have only for some laws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Paper,
    Complete,
    Corners,
    Plays,
    Cubics,
    Linears,
    Dot,
    Mpi,
    Wrpi,
    Mrpi,
    Polynomial,
    Enveloped,
    WithChange,
    Sections,
    Integral,
    Feedback,
    Trust,
    Ahead,
    Coupling,
    Cross,
    Hum,
    Heat,
    Sensor,
    Lag,
    SensorLag,
    Adaptation,
    /// No feedback.
    Open,
}

impl Part {
    /// Its name in the texts.
    fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Complete => "complete",
            Self::Corners => "corners",
            Self::Plays => "plays",
            Self::Cubics => "cubics",
            Self::Linears => "linears",
            Self::Dot => "dot",
            Self::Mpi => "mpi",
            Self::Wrpi => "wrpi",
            Self::Mrpi => "mrpi",
            Self::Polynomial => "polynomial",
            Self::Enveloped => "enveloped",
            Self::WithChange => "with_change",
            Self::Sections => "sections",
            Self::Integral => "integral",
            Self::Feedback => "feedback",
            Self::Trust => "trust",
            Self::Ahead => "ahead",
            Self::Coupling => "coupling",
            Self::Cross => "cross",
            Self::Hum => "hum",
            Self::Heat => "heat",
            Self::Sensor => "sensor",
            Self::Lag => "lag",
            Self::SensorLag => "sensor_lag",
            Self::Adaptation => "adaptation",
            Self::Open => "open",
        }
    }
}

/// Most characters of a name: C99 compilers keep 31 of an external one, and the longest suffix is `_set_feedback`.
const LONGEST_NAME: usize = 18;

impl Table {
    /// The table's law as C. `text` is the table's file, whose hash the header names; every name begins with `name`.
    ///
    /// # Errors
    /// As [`Table::check`]; a name that is not a letter and up to 17 letters, digits or underscores.
    ///
    /// # Example
    /// ```
    /// # use hysteron_table::Table;
    /// let text = include_str!("../../../../firmware/tables/paper-rate-mrpi.toml");
    /// let code = Table::parse(text).unwrap().c_code(text, "stage").unwrap();
    /// assert!(code.header.contains("float stage_step(stage_state *state, const stage_input *now);"));
    /// ```
    pub fn c_code(&self, text: &str, name: &str) -> Result<CCode, TableError> {
        self.check()?;
        let starts = name.starts_with(|c: char| c.is_ascii_alphabetic());
        let word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !starts || !word || name.len() > LONGEST_NAME {
            let reason = format!(
                "must be a letter and up to {} letters, digits or underscores: names in C begin with it",
                LONGEST_NAME - 1
            );
            return Err(refuse("name", name, reason));
        }
        let law = self.law_numbers()?.map(|numbers| numbers.law::<f32>()).transpose()?;
        let parts = law.as_ref().map_or_else(|| self.paper_parts(), complete_parts);
        let fill = Fill {
            parts,
            words: self.words(text, name, law.as_ref()),
        };
        let mut numbers = Constants::default();
        numbers.of_table(self)?;
        match &law {
            Some(law) => numbers.of_law(law),
            None => numbers.of_paper(self)?,
        }
        let mut source = format!(
            "/* {name}: see {name}.h. */\n#include \"{name}.h\"\n\n#include <float.h>\n#include <math.h>\n\n{}\n",
            numbers.text()
        );
        source += &fill.fill(include_str!("common.c"));
        if fill.parts.contains(&Part::Corners) {
            source += &fill.fill(include_str!("corners.c"));
        } else {
            source += &fill.fill(include_str!("plays.c"));
        }
        source += &fill.fill(match law {
            Some(_) => include_str!("complete.c"),
            None => include_str!("paper.c"),
        });
        source += &fill.fill(include_str!("codes.c"));
        Ok(CCode {
            header: fill.fill(include_str!("law.h")),
            source,
        })
    }

    /// Whether the paper's law remembers corners, as on the chip.
    fn by_corners(&self) -> bool {
        let linear = matches!(self.family, Family::Pi | Family::Mpi | Family::Mrpi);
        linear && self.thresholds_um.len() >= CORNERS_ABOVE
    }

    fn paper_parts(&self) -> Vec<Part> {
        let mut parts = vec![Part::Paper, Part::Integral];
        if self.by_corners() {
            parts.extend([Part::Corners, Part::Linears, Part::Enveloped, Part::WithChange]);
            return parts;
        }
        parts.push(Part::Plays);
        parts.extend(match self.family {
            Family::Pi | Family::Mpi => [Part::Dot, Part::Mpi].as_slice(),
            Family::Wrpi => &[Part::Dot, Part::Wrpi, Part::WithChange],
            Family::Mrpi => &[Part::Mrpi, Part::Enveloped, Part::WithChange],
            Family::PlayPolynomial => &[Part::Polynomial],
        });
        parts
    }

    /// What stands for `@word@` in the texts.
    fn words(&self, text: &str, name: &str, law: Option<&CompleteLaw<f32>>) -> Vec<(&'static str, String)> {
        let mut digest = String::new();
        for byte in hash(text) {
            // Writing to a String does not fail.
            let _ = write!(digest, "{byte:02x}");
        }
        let number = |value: f64| constants::number(value as f32);
        let heat = law.is_some_and(|law| law.surroundings.heat.is_some());
        let temperature = if heat { " at the temperature of `now`" } else { "" };
        let share = match law {
            Some(_) => "; the complete law has it whole or not at all",
            None => "",
        };
        let lines = self.covered_lines();
        let covered = lines.iter().map(|line| format!("\n * Records: {line}.")).collect();
        vec![
            ("name", name.to_owned()),
            ("NAME", name.to_ascii_uppercase()),
            ("family", self.family.name().to_owned()),
            ("plays", self.thresholds_um.len().to_string()),
            ("hash", digest),
            ("rate", number(self.sample_rate_hz)),
            ("lowest", number(self.input_min_um)),
            ("highest", number(self.input_max_um)),
            ("ahead", law.map_or(0, CompleteLaw::ahead).to_string()),
            ("safe", number(self.safe_v)),
            ("ramp", number(self.ramp_v_per_s)),
            ("feedback_up_to", number(self.feedback_up_to_hz)),
            ("taps", TAPS.to_string()),
            ("fast", CREEP_FAST.to_string()),
            ("slow", CREEP_SLOW.to_string()),
            ("harmonics", HARMONICS.to_string()),
            ("at_temperature", temperature.to_owned()),
            ("share", share.to_owned()),
            ("covered", covered),
        ]
    }
}

fn complete_parts(law: &CompleteLaw<f32>) -> Vec<Part> {
    let around = &law.surroundings;
    let fixed = [Part::Complete, Part::Corners, Part::Cubics, Part::Sections];
    let some = [
        (Part::Integral, law.tracking.feedback.is_some()),
        (Part::Feedback, law.tracking.feedback.is_some()),
        (
            Part::Trust,
            law.tracking.feedback.is_some_and(|feedback| feedback.trust.is_some()),
        ),
        (Part::Ahead, law.ahead() > 0),
        (Part::Coupling, around.coupling.is_some()),
        (Part::Cross, around.cross.is_some()),
        (Part::Hum, around.hum.is_some()),
        (Part::Heat, around.heat.is_some()),
        (Part::Sensor, around.sensor.is_some()),
        (Part::SensorLag, around.sensor_lag.is_some()),
        (Part::Adaptation, around.adaptation.is_some()),
        (Part::Open, law.tracking.feedback.is_none()),
        (Part::Lag, around.sensor_lag.is_some() || around.heat.is_some()),
    ];
    let there = some.into_iter().filter_map(|(part, there)| there.then_some(part));
    fixed.into_iter().chain(there).collect()
}

/// What makes a text of the files beside this one.
struct Fill {
    parts: Vec<Part>,
    words: Vec<(&'static str, String)>,
}

impl Fill {
    fn fill(&self, text: &str) -> String {
        let has = |name: &str| self.parts.iter().any(|part| part.name() == name);
        // Parts that are open and absent: their lines are left out.
        let mut absent = 0_usize;
        let mut filled = String::new();
        for line in text.lines() {
            if let Some(part) = line.strip_prefix("//{ ") {
                absent += usize::from(!has(part));
            } else if let Some(part) = line.strip_prefix("//} ") {
                absent -= usize::from(!has(part));
            } else if absent == 0 {
                filled.push_str(line);
                filled.push('\n');
            }
        }
        for (word, value) in &self.words {
            filled = filled.replace(&format!("@{word}@"), value);
        }
        filled
    }
}
