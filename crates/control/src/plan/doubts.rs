//! What can silently spoil a campaign: the sensor's zero and sign, rests that were too short, channels that are not sampled at once.

use super::matching::{Returned, Taken, each};
use super::{Plan, ZERO_MATTERS};
use crate::message::{Message, Setting};
use hysteron_acquisition::{Finding, Following, Kind, NoiseFloor, inspect};
use hysteron_data::Dataset;
use hysteron_identify::family::peak_to_peak;

/// Standard errors from which on a position at rest moves, or is another one: of eight parts noise alone reaches them once in five thousand
/// times, and a campaign has thirty records.
const CLEAR: f64 = 8.0;
/// Parts of a rest whose means are compared.
const PARTS: usize = 8;

/// The position over the rest at a record's beginning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// Mean, micrometres.
    pub position_um: f64,
    /// How fast it moves, micrometres a second.
    pub speed_um_per_s: f64,
    /// Standard errors of both.
    pub errors: [f64; 2],
}

impl Rest {
    /// A line through the means of its parts, whose scatter has slow noise and hum in it.
    fn of(rest_um: &[f64], period_s: f64) -> Option<Self> {
        let n = rest_um.len() / PARTS;
        if n == 0 {
            return None;
        }
        let means: Vec<f64> = rest_um
            .chunks_exact(n)
            .take(PARTS)
            .map(|part| part.iter().sum::<f64>() / n as f64)
            .collect();
        let middle = 0.5 * (PARTS - 1) as f64;
        let position_um = means.iter().sum::<f64>() / PARTS as f64;
        let xx: f64 = (0..PARTS).map(|k| (k as f64 - middle).powi(2)).sum();
        let slope = (0..).zip(&means).map(|(k, y)| (f64::from(k) - middle) * y).sum::<f64>() / xx;
        let left = |(k, y): (i32, &f64)| (y - position_um - slope * (f64::from(k) - middle)).powi(2);
        let variance = (0..).zip(&means).map(left).sum::<f64>() / (PARTS - 2) as f64;
        let part_s = n as f64 * period_s;
        Some(Self {
            position_um,
            speed_um_per_s: slope / part_s,
            errors: [(variance / PARTS as f64).sqrt(), (variance / xx).sqrt() / part_s],
        })
    }
}

/// A doubt about a record.
#[derive(Debug, Clone, PartialEq)]
pub enum Doubt {
    /// It began while the stage still moved.
    NotAtRest {
        /// The record.
        name: String,
        /// Micrometres a second.
        speed_um_per_s: f64,
        /// What that is over the record, percent of its peak to peak.
        percent: f64,
        /// Rest that the plan has before it, seconds.
        planned_s: f64,
    },
    /// Its position at rest is not that of the other records.
    AnotherZero {
        /// The record.
        name: String,
        /// Difference, micrometres.
        off_um: f64,
        /// The same, percent of its peak to peak.
        percent: f64,
    },
}

impl Doubt {
    /// Whether a rest was surely too short: the position tells. Another zero may be the sensor's.
    pub fn is_a_short_rest(&self) -> bool {
        match self {
            Self::NotAtRest { .. } => true,
            Self::AnotherZero { .. } => false,
        }
    }

    /// What it is and what to do.
    pub fn message(&self) -> Message {
        match self {
            Self::NotAtRest {
                name,
                speed_um_per_s,
                percent,
                planned_s,
            } => Message::from(format!(
                "{name} does not begin at rest: the position moves by {speed_um_per_s:.4} um/s, {percent:.2} % of its peak to peak over the \
                 record; rest {planned_s} s or more at the rest voltage before it, as the plan has it, and record it again; "
            ))
            .naming(Setting::ShortRests)
            .and(" takes it all the same"),
            Self::AnotherZero { name, off_um, percent } => Message::from(format!(
                "{name} begins {off_um:.4} um ({percent:.2} % of its peak to peak) off the other records at rest: the rest before it was too \
                 short, or the sensor's zero has drifted; these records cannot tell which. Rest longer, or let the sensor warm up"
            )),
        }
    }
}

/// What the records say of the rig and of their rests.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubts {
    /// The position at rest, the middle of all records, micrometres: the sensor's zero and what the stage remembers, together.
    pub zero_um: Option<f64>,
    /// Records that did not begin as the others.
    pub doubts: Vec<Doubt>,
    /// Noise of the sensor.
    pub noise: NoiseFloor,
    /// How much later the position turns than the voltage.
    pub following: Option<Following>,
    /// A sign that no controller can be made with.
    pub signs: Vec<Finding>,
    /// Where the lab has erred beside that.
    pub mistakes: Vec<Finding>,
}

/// Looks for all of it.
///
/// # Cost
/// That of [`inspect`].
pub fn doubts(plan: &Plan, returned: &Returned) -> Doubts {
    let rests: Vec<(&Taken, Rest, f64)> = returned
        .taken
        .iter()
        .filter_map(|taken| {
            let planned = each(plan).find(|(pass, number, _)| (*pass, *number) == taken.at)?.2;
            Some((
                taken,
                Rest::of(&taken.rest_um, taken.record.period_s)?,
                planned.rest_before_s,
            ))
        })
        .collect();
    let mut zeros: Vec<f64> = rests.iter().map(|(_, rest, _)| rest.position_um).collect();
    zeros.sort_by(f64::total_cmp);
    let zero_um = zeros.get(zeros.len() / 2).copied();
    let report = inspect(&Dataset {
        records: returned.taken.iter().map(|taken| taken.record.clone()).collect(),
        ..Dataset::default()
    });
    let sign = |finding: &Finding| matches!(finding.kind, Kind::NegativeGain | Kind::SignByRecord);
    let (signs, others): (Vec<Finding>, Vec<Finding>) = report.findings.into_iter().partition(sign);
    Doubts {
        zero_um,
        doubts: rests
            .iter()
            .flat_map(|(taken, rest, planned_s)| of_rest(taken, rest, *planned_s, zero_um.unwrap_or(0.0)))
            .collect(),
        noise: report.noise,
        following: report.following,
        signs,
        mistakes: others.into_iter().filter(|finding| finding.kind.is_mistake()).collect(),
    }
}

/// What is doubtful of a record's beginning; what it moved since the rest, from bias to bias, counts as its peak to peak.
fn of_rest(taken: &Taken, rest: &Rest, planned_s: f64, zero_um: f64) -> Vec<Doubt> {
    let name = taken.record.file.trim_end_matches(".csv").to_owned();
    let mut moved = taken.record.position_um.clone();
    moved.push(rest.position_um);
    let stroke_um = peak_to_peak(&moved).max(f64::MIN_POSITIVE);
    let mut found = Vec::new();
    // What creeps since a rest of this length slows down with the time since then.
    let over_record_um = rest.speed_um_per_s * planned_s * (1.0 + taken.record.duration_s() / planned_s.max(1e-3)).ln();
    if rest.speed_um_per_s.abs() > CLEAR * rest.errors[1] && over_record_um.abs() > ZERO_MATTERS * stroke_um {
        found.push(Doubt::NotAtRest {
            name: name.clone(),
            speed_um_per_s: rest.speed_um_per_s,
            percent: 100.0 * over_record_um.abs() / stroke_um,
            planned_s,
        });
    }
    let off_um = rest.position_um - zero_um;
    if found.is_empty() && off_um.abs() > CLEAR * rest.errors[0] && off_um.abs() > ZERO_MATTERS * stroke_um {
        found.push(Doubt::AnotherZero {
            name,
            off_um,
            percent: 100.0 * off_um.abs() / stroke_um,
        });
    }
    found
}
