//! What the records of a model cover, and who leaves it: the envelope that travels with a model, a controller, a table.

mod beyond;
mod small_signal;
mod swing;

pub use beyond::{Beyond, Envelope, Field};
pub use small_signal::SmallSignalBand;
pub(crate) use small_signal::{Line, highest_run, mean_gain};
pub(crate) use swing::swing_hz;

use crate::family::range;
use hysteron_data::{Dataset, Record, Role};
use serde::{Deserialize, Serialize};

/// A drive is small where 70 % of it stays within this share of the range: its loops are slender, and its response is that of the
/// structure.
pub(crate) const SMALL: f64 = 0.2;

/// What records cover. A field that is absent is not known: nothing may be asked of it.
///
/// # Units
/// In the names; pairs are lowest and highest.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Covered {
    /// Commands in the records that the model was fitted to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voltage_v: Option<[f64; 2]>,
    /// What the amplifier gives, as the dataset says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplifier_v: Option<[f64; 2]>,
    /// The DAC's lowest code and full scale at the actuator, as the dataset says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dac_v: Option<[f64; 2]>,
    /// The ADC's lowest code and full scale, as the dataset says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adc_um: Option<[f64; 2]>,
    /// Positions in these records.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_um: Option<[f64; 2]>,
    /// Fastest change of the command from row to row.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slew_v_per_s: Option<f64>,
    /// Highest frequency at which positions swing over a third of their range; 0 where they never do, there and back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub swing_hz: Option<f64>,
    /// Temperatures, where they were recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<[f64; 2]>,
    /// Highest rate of a record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_rate_hz: Option<f64>,
    /// Up to where the user vouches that the stage has no mode but those of the model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rigid_to_hz: Option<f64>,
    /// Up to where small signals tell that the stage does what the model says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub small_signal: Option<SmallSignalBand>,
    /// What was asked for beyond the records, and granted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beyond: Vec<Beyond>,
}

impl Covered {
    /// What records with role `identify` cover; nothing of small signals.
    pub fn by(dataset: &Dataset) -> Self {
        let records: Vec<&Record> = dataset.with_role(Role::Identify).collect();
        let of = |column: fn(&Record) -> Option<&[f64]>| -> Option<[f64; 2]> {
            let values = records.iter().filter_map(|record| column(record)).flatten().copied();
            let (low, high) = range(values);
            (low <= high).then_some([low, high])
        };
        let slews = records.iter().flat_map(|record| {
            let steps = record.voltage_v.windows(2);
            steps.map(|step| (step[1] - step[0]).abs() / record.period_s)
        });
        let known = &dataset.known;
        let position_um = of(|record| Some(&record.position_um));
        let positions = records.iter().map(|record| (record.period_s, &record.position_um[..]));
        Self {
            voltage_v: of(|record| Some(&record.voltage_v)),
            amplifier_v: known
                .voltage_min_v
                .zip(known.voltage_max_v)
                .map(|(low, high)| [low, high]),
            dac_v: known.dac_v,
            adc_um: known.adc_um,
            position_um,
            slew_v_per_s: slews.max_by(f64::total_cmp),
            swing_hz: position_um.map(|range_um| swing_hz(positions, range_um)),
            temperature_c: of(|record| record.temperature_c.as_deref()),
            sample_rate_hz: records.iter().map(|record| record.rate_hz()).max_by(f64::total_cmp),
            ..Self::default()
        }
    }

    /// Up to where the stage is told, by small signals or by the user's word, hertz; none where neither says anything.
    pub fn told_to_hz(&self) -> Option<f64> {
        let recorded = self.small_signal.as_ref().map(|band| band.up_to_hz);
        recorded.into_iter().chain(self.rigid_to_hz).max_by(f64::total_cmp)
    }

    /// Who tells the stage up to there: the record's file, else the user by `--rigid`.
    pub fn told_by(&self) -> Option<ToldBy<'_>> {
        match (&self.small_signal, self.rigid_to_hz) {
            (Some(band), rigid_hz) if rigid_hz.is_none_or(|hz| hz <= band.up_to_hz) => {
                Some(ToldBy::Record(&band.record))
            }
            (_, Some(_)) => Some(ToldBy::User),
            _ => None,
        }
    }
}

/// Who tells a stage up to a frequency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToldBy<'a> {
    /// A record of small signals.
    Record(&'a str),
    /// The user's word.
    User,
}
