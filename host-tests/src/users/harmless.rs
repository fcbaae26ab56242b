//! Changes of a dataset that change nothing of the stage, and which verdicts they turn.

use super::case::Case;
use super::hidden::{Effect, Hidden, Outside};
use super::tool;
use crate::hidden::change;
use hysteron_data::{Dataset, Record};
use hysteron_identify::Family as Start;
use std::f64::consts::TAU;

/// A harmless change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Harmless {
    /// Volts as kilovolts, micrometres as nanometres.
    Units,
    /// The sensor's zero.
    Offset,
    /// The position falls where it rose.
    PositionSign,
    /// The voltage falls where it rose.
    VoltageSign,
    /// Every record begins a little later.
    TimeShift,
    /// The last record first.
    Order,
    /// Names that say nothing.
    Names,
    /// Every second sample.
    EverySecond,
    /// The longest record in two.
    Split,
    /// Half of a record's periods.
    FewerPeriods,
}

impl Harmless {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Units,
        Self::Offset,
        Self::PositionSign,
        Self::VoltageSign,
        Self::TimeShift,
        Self::Order,
        Self::Names,
        Self::EverySecond,
        Self::Split,
        Self::FewerPeriods,
    ];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Units => "units",
            Self::Offset => "offset of the position",
            Self::PositionSign => "sign of the position",
            Self::VoltageSign => "sign of the voltage",
            Self::TimeShift => "time shift",
            Self::Order => "order of the records",
            Self::Names => "names",
            Self::EverySecond => "every second sample",
            Self::Split => "one record in two",
            Self::FewerPeriods => "fewer of the same periods",
        }
    }

    /// The changed dataset; none where the change would change the stage, or the records do not allow it.
    pub fn apply(self, case: &Case) -> Option<Dataset> {
        let dataset = &case.dataset;
        match self {
            Self::Units => Some(change::scaled(dataset, 1e3, 1e-3)),
            Self::Offset => Some(change::offset(dataset, 0.37 * case.truth.stroke_um)),
            Self::PositionSign => Some(change::scaled(dataset, -1.0, 1.0)),
            Self::VoltageSign => Some(change::scaled(dataset, 1.0, -1.0)),
            Self::TimeShift => Some(each(dataset, |record| {
                record.start_s += 12.5;
                true
            })),
            Self::Order => ordered_at_will(case).then(|| change::reversed(dataset)),
            Self::Names => Some(change::renamed(dataset)),
            Self::EverySecond => every_second(dataset),
            Self::Split => split(dataset),
            Self::FewerPeriods => fewer_periods(dataset),
        }
    }
}

/// What grows from record to record or with time is another stage in another order.
fn ordered_at_will(case: &Case) -> bool {
    let in_time = [
        Hidden::Effect(Effect::ThermalDrift),
        Hidden::Effect(Effect::Creep),
        Hidden::Outside(Outside::Ageing),
        Hidden::Outside(Outside::Slip),
    ];
    !case.truth.parts.iter().any(|part| in_time.contains(&part.hidden))
}

/// What changed of a verdict: before, after.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Turned {
    /// By what.
    pub by: Harmless,
    /// The verdict before.
    pub before: String,
    /// The verdict after, or the tool's error.
    pub after: String,
}

/// The verdicts that harmless changes turn, and how many changes were tried.
///
/// # Errors
/// Where the tool cannot fit the case as it is.
pub fn turned(case: &Case) -> Result<(Vec<Turned>, usize), String> {
    let verdict = |dataset: &Dataset| {
        tool::start(dataset, Start::Mpi)
            .map(|model| tool::ask(dataset, &model).verdict)
            .map_err(|error| error.to_string())
    };
    let before = verdict(&case.dataset)?;
    let (mut turned, mut tried) = (Vec::new(), 0);
    for by in Harmless::ALL {
        let Some(changed) = by.apply(case) else { continue };
        tried += 1;
        let after = verdict(&changed).unwrap_or_else(|error| error);
        if after != before {
            turned.push(Turned {
                by,
                before: before.clone(),
                after,
            });
        }
    }
    Ok((turned, tried))
}

fn each(dataset: &Dataset, mut change: impl FnMut(&mut Record) -> bool) -> Dataset {
    let mut changed = dataset.clone();
    changed.records.retain_mut(|record| change(record));
    changed
}

fn columns(record: &mut Record) -> impl Iterator<Item = &mut Vec<f64>> {
    let Record {
        voltage_v,
        position_um,
        reference_um,
        temperature_c,
        voltage2_v,
        ..
    } = record;
    [
        Some(voltage_v),
        Some(position_um),
        reference_um.as_mut(),
        temperature_c.as_mut(),
        voltage2_v.as_mut(),
    ]
    .into_iter()
    .flatten()
}

/// Where the drive keeps forty samples a turn: else what is fast is lost with the samples.
fn every_second(dataset: &Dataset) -> Option<Dataset> {
    let slow = |record: &Record| fundamental(record).is_none_or(|period| period >= 80.0);
    dataset.records.iter().all(slow).then(|| {
        each(dataset, |record| {
            record.period_s *= 2.0;
            for column in columns(record) {
                let kept = column.iter().step_by(2).copied().collect();
                *column = kept;
            }
            true
        })
    })
}

fn split(dataset: &Dataset) -> Option<Dataset> {
    let longest = (0..dataset.records.len()).max_by_key(|&n| dataset.records[n].len())?;
    let mut changed = dataset.clone();
    let record = &mut changed.records[longest];
    let half = record.len() / 2;
    let mut second = record.clone();
    second.file = format!("second-{}", record.file);
    second.start_s += half as f64 * record.period_s;
    columns(record).for_each(|column| column.truncate(half));
    for column in columns(&mut second) {
        column.drain(..half);
    }
    changed.records.insert(longest + 1, second);
    Some(changed)
}

/// Half of the periods of every record that has four or more.
fn fewer_periods(dataset: &Dataset) -> Option<Dataset> {
    let mut any = false;
    let changed = each(dataset, |record| {
        let periods = fundamental(record).map_or(0.0, |period| record.len() as f64 / period);
        if periods >= 4.0 {
            any = true;
            let kept = (record.len() as f64 * (0.5 * periods).ceil() / periods) as usize;
            columns(record).for_each(|column| column.truncate(kept + 1));
        }
        true
    });
    any.then_some(changed)
}

/// Samples of a period, where the drive is a sine or a triangle about its middle: from its passes through the mean.
fn fundamental(record: &Record) -> Option<f64> {
    let v = &record.voltage_v;
    let mean = v.iter().sum::<f64>() / v.len() as f64;
    let up: Vec<usize> = (1..v.len()).filter(|&k| v[k - 1] < mean && v[k] >= mean).collect();
    let [first, .., last] = up.as_slice() else { return None };
    let period = (last - first) as f64 / (up.len() - 1) as f64;
    let regular = up
        .windows(2)
        .all(|w| ((w[1] - w[0]) as f64 - period).abs() <= 0.02 * period + 1.0);
    // A sine of this period holds nearly all of what moves.
    let (mut sine, mut cosine, mut all) = (0.0, 0.0, 0.0);
    let whole = ((v.len() as f64 / period).floor() * period) as usize;
    for (k, v) in v.iter().take(whole).enumerate() {
        let phase = TAU * k as f64 / period;
        sine += (v - mean) * phase.sin();
        cosine += (v - mean) * phase.cos();
        all += (v - mean).powi(2);
    }
    let share = 2.0 * (sine * sine + cosine * cosine) / (whole as f64 * all).max(f64::MIN_POSITIVE);
    (regular && share > 0.9).then_some(period)
}
