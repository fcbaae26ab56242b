//! What is said of recordings beside their plan.

use super::matching::SAME_VOLTAGE;
use crate::message::Message;
use core::fmt::{self, Display, Formatter};

/// Why a recording cannot be used.
#[derive(Debug, Clone, PartialEq)]
pub enum Wrong {
    /// No recording of a planned record.
    Missing {
        /// The record.
        name: String,
        /// Its command.
        file: String,
    },
    /// A recording of no planned record.
    Stranger {
        /// The recording.
        from: String,
        /// The nearest planned record, and the difference of the part that counts, rms, as a share of its range.
        nearest: Option<(String, f64)>,
    },
    /// A recording without the beginning or the end of its command.
    CutOff {
        /// The recording.
        from: String,
        /// The record.
        name: String,
        /// Samples that lack at the beginning and at the end.
        lacks: [usize; 2],
        /// Samples of the command.
        of: usize,
    },
    /// A voltage in another unit, turned over, or before the amplifier.
    Gain {
        /// The recording.
        from: String,
        /// The record.
        name: String,
        /// Factor over the command.
        gain: f64,
    },
    /// Another sample rate.
    Rate {
        /// The recording.
        from: String,
        /// The record.
        name: String,
        /// Sample period of the recording and of the command, seconds.
        period_s: [f64; 2],
    },
    /// A command that runs faster or slower in the recording.
    Clock {
        /// The recording.
        from: String,
        /// The record.
        name: String,
        /// How much longer it is, parts in a million.
        ppm: f64,
    },
    /// A position that is of no use.
    Position {
        /// The recording.
        from: String,
        /// The record.
        name: String,
        /// What is wrong with it and what to do.
        reason: Message,
    },
    /// A recording of all commands of a pass.
    Sequence {
        /// The pass.
        pass: usize,
        /// What is wrong with it.
        wrong: Box<Wrong>,
    },
}

impl Wrong {
    /// Whether it is about a recording of that planned record of a pass.
    pub(super) fn is_of(&self, of_pass: usize, planned: &str) -> bool {
        match self {
            Self::Sequence { pass, .. } => *pass == of_pass,
            Self::Missing { name, .. }
            | Self::CutOff { name, .. }
            | Self::Gain { name, .. }
            | Self::Rate { name, .. }
            | Self::Clock { name, .. }
            | Self::Position { name, .. } => name == planned,
            Self::Stranger { .. } => false,
        }
    }

    /// What is wrong and what to do.
    pub fn message(&self) -> Message {
        match self {
            Self::Position { from, name, reason } => reason.clone().behind(format!("{}: ", Of(from, name))),
            Self::Sequence { wrong, .. } => wrong.message(),
            Self::Missing { .. }
            | Self::Stranger { .. }
            | Self::CutOff { .. }
            | Self::Gain { .. }
            | Self::Rate { .. }
            | Self::Clock { .. } => self.to_string().into(),
        }
    }
}

/// `file (record)`, or the file alone where it has the record's name.
struct Of<'a>(&'a str, &'a str);

impl Display for Of<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)?;
        if self.0.starts_with(self.1) {
            return Ok(());
        }
        write!(f, " ({})", self.1)
    }
}

impl Display for Wrong {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { name, file } => {
                write!(f, "{name}: not there; play {file} of the plan and record the position")
            }
            Self::Stranger { from, nearest } => {
                write!(f, "{from}: its voltage is that of no planned record; ")?;
                match nearest {
                    Some((name, off)) => write!(
                        f,
                        "the nearest is {name}, {:.3} % of its range off, rms; allowed are {:.0} %",
                        100.0 * off,
                        100.0 * SAME_VOLTAGE
                    ),
                    None => f.write_str("it is shorter than half of any command"),
                }
            }
            Self::CutOff {
                from,
                name,
                lacks: [first, last],
                of,
            } => {
                write!(f, "{}: lacks ", Of(from, name))?;
                match (first, last) {
                    (0, last) => write!(f, "the last {last}")?,
                    (first, 0) => write!(f, "the first {first}")?,
                    (first, last) => write!(f, "the first {first} and the last {last}")?,
                }
                write!(f, " of {of} samples of the command; record all of it")
            }
            Self::Gain { from, name, gain } => write!(
                f,
                "{}: its voltage is {gain:.4} times the command's; volts are those at the actuator, after the amplifier",
                Of(from, name)
            ),
            Self::Rate {
                from,
                name,
                period_s: [recorded, played],
            } => write!(
                f,
                "{}: sampled every {recorded} s and played every {played} s; record it at the rate that it is played at",
                Of(from, name)
            ),
            Self::Clock { from, name, ppm } => write!(
                f,
                "{}: the command runs {:.0} ppm {} there than it was played; it was resampled, or two clocks differ: record by the clock \
                 that plays",
                Of(from, name),
                ppm.abs(),
                if *ppm > 0.0 { "slower" } else { "faster" }
            ),
            Self::Position { from, name, reason } => write!(f, "{}: {reason}", Of(from, name)),
            Self::Sequence { wrong, .. } => wrong.fmt(f),
        }
    }
}

/// What should be known of recordings that are used.
#[derive(Debug, Clone, PartialEq)]
pub enum Remark {
    /// A command that does not begin where its file does.
    Begins {
        /// The recording.
        from: String,
        /// The record.
        name: String,
        /// Where it begins, samples.
        samples: usize,
        /// The same, seconds.
        seconds: f64,
        /// Whether the recorded voltage is the command itself, not a measurement.
        exact: bool,
    },
    /// Records that were cut from one file.
    Cut {
        /// The recording.
        from: String,
        /// How many.
        records: usize,
        /// Where the sequence begins, samples; below zero where the recording began later.
        samples: isize,
        /// The same, seconds.
        seconds: f64,
        /// Whether the recorded voltage is the command itself, not a measurement.
        exact: bool,
    },
    /// Recordings of one command, of which the order tells which is which.
    InOrder {
        /// Recording and record.
        pairs: Vec<(String, String)>,
    },
    /// A command that was recorded more often than planned.
    Twice {
        /// The recording.
        from: String,
        /// The record.
        name: String,
    },
    /// A recording of no planned record, where none is missing.
    LeftOut(Wrong),
    /// The first command was not recorded again.
    NoDrift {
        /// The record.
        name: String,
        /// Its command.
        file: String,
    },
}

/// What a voltage that is a measurement leaves open where its command is looked for.
const LAG_IS_LOST: &str = "; the voltage is a measurement: a lag of the amplifier shifts it as a late start does, and is taken for one. Record \
                           the command itself, or from its first sample on";

impl Display for Remark {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Begins {
                from,
                name,
                samples,
                seconds,
                exact,
            } => {
                write!(
                    f,
                    "{}: begins {samples} samples ({seconds:.6} s) into the file",
                    Of(from, name)
                )?;
                f.write_str(if *exact { "" } else { LAG_IS_LOST })
            }
            Self::Cut {
                from,
                records,
                samples,
                seconds,
                exact,
            } => {
                let way = if *samples < 0 { "before" } else { "after" };
                write!(
                    f,
                    "{from}: {records} records cut from it; the sequence begins {} samples ({:.6} s) {way} the file",
                    samples.unsigned_abs(),
                    seconds.abs()
                )?;
                f.write_str(if *exact { "" } else { LAG_IS_LOST })
            }
            Self::InOrder { pairs } => {
                f.write_str("of one command, told apart by their order: ")?;
                for (index, (from, name)) in pairs.iter().enumerate() {
                    write!(f, "{}{from} is {name}", if index == 0 { "" } else { ", " })?;
                }
                Ok(())
            }
            Self::Twice { from, name } => write!(f, "{from}: {name} once more; left out"),
            Self::LeftOut(stranger) => write!(f, "{stranger}; left out"),
            Self::NoDrift { name, file } => write!(
                f,
                "drift cannot be told: {name} is not there; play {file} of the plan after the other records"
            ),
        }
    }
}
