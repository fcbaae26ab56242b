//! Nothing leaves the records that were taken, unless that is granted: then the file remembers it.

use super::Controller;
use crate::error::ControlError;
use crate::message::{Message, Setting};
use crate::reference::{SHAPES, Shape};
use hysteron_identify::Covered;
use hysteron_identify::covered::{Beyond, Envelope};
use serde::Serialize;

/// Values that are asked for, and the setting that asks.
pub struct Asked {
    /// What of the records it is held to.
    envelope: fn(&Covered) -> Option<Envelope>,
    values: Vec<f64>,
    setting: Setting,
}

impl Asked {
    /// Limits of the command, volts.
    pub fn voltage(values: &[f64], setting: Setting) -> Self {
        Self::new(Covered::command_v, values, setting)
    }

    /// References, micrometres.
    pub fn position(values: &[f64], setting: Setting) -> Self {
        Self::new(Covered::reference_um, values, setting)
    }

    /// The rate, hertz.
    pub fn rate(value: f64, setting: Setting) -> Self {
        Self::new(Covered::rate_hz, &[value], setting)
    }

    fn new(envelope: fn(&Covered) -> Option<Envelope>, values: &[f64], setting: Setting) -> Self {
        Self {
            envelope,
            values: values.to_vec(),
            setting,
        }
    }
}

/// Refuses what leaves the records; where that is granted, it is kept in them. A field of which the records say nothing is not checked.
///
/// # Errors
/// [`ControlError::Wish`] for what leaves the records without being granted.
pub fn granted(covered: &mut Covered, asked: &[Asked], beyond_records: bool) -> Result<(), ControlError> {
    for asked in asked {
        let envelope = (asked.envelope)(covered);
        let Some(beyond) = envelope.and_then(|envelope| envelope.left_by(&asked.values)) else {
            continue;
        };
        if !beyond_records {
            let within = Message::from(format!("{beyond}; stay within with ")).naming(asked.setting);
            return Err(ControlError::Wish(
                within
                    .and(format!(", or {}; ", beyond.field.widen()))
                    .naming(Setting::BeyondRecords)
                    .and(" leaves them all the same, and the file says so"),
            ));
        }
        if !covered.beyond.contains(&beyond) {
            covered.beyond.push(beyond);
        }
    }
    Ok(())
}

/// Refuses references that leave the records of a controller; where that is granted, what leaves them.
///
/// # Errors
/// [`ControlError::Wish`] for references that leave the records without being granted.
pub fn references(
    controller: &Controller,
    range_um: [f64; 2],
    beyond_records: bool,
) -> Result<Vec<Beyond>, ControlError> {
    let mut covered = Covered {
        beyond: Vec::new(),
        ..controller.model.covered.clone()
    };
    let asked = [Asked::position(&range_um, Setting::Range)];
    granted(&mut covered, &asked, beyond_records)?;
    Ok(covered.beyond)
}

/// How far a reference of this frequency over a range leaves the records of a controller; none within, or where they do not say.
pub fn frequency(controller: &Controller, [low_um, high_um]: [f64; 2], frequency_hz: f64) -> Option<Beyond> {
    let envelope = controller.model.covered.frequency_hz(high_um - low_um)?;
    envelope.left_by(&[frequency_hz])
}

/// The references of [`SHAPES`] whose frequency leaves the records of a controller, by name: nothing is known of them.
pub fn frequencies(controller: &Controller, range_um: [f64; 2]) -> Vec<(&'static str, Beyond)> {
    let left = |(name, shape): (_, Shape)| Some((name, frequency(controller, range_um, shape.swings_hz())?));
    SHAPES.into_iter().filter_map(left).collect()
}

/// Refuses references that leave the positions of a controller's records; what leaves them where that is granted, and every frequency above
/// the records. Such a frequency is said and run all the same: for a stage that is simulated and cannot be hurt.
///
/// # Errors
/// As [`references`].
pub fn simulated(
    controller: &Controller,
    range_um: [f64; 2],
    beyond_records: bool,
) -> Result<Vec<Beyond>, ControlError> {
    let mut left = references(controller, range_um, beyond_records)?;
    left.extend(frequencies(controller, range_um).into_iter().map(|(_, beyond)| beyond));
    Ok(left)
}

/// What is beyond the records, in words, with what would widen them.
pub fn unknown(beyond: &Beyond) -> String {
    format!("{beyond}: nothing is known there; {}", beyond.field.widen())
}

/// A reference that a stage that can be hurt is not asked for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotPlayed {
    /// Its name, as tables and files give it.
    pub reference: &'static str,
    /// How far it leaves the records.
    #[serde(flatten)]
    pub beyond: Beyond,
}

/// What a stage that can be hurt is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Programme {
    /// Those of [`SHAPES`] that are played; at least one.
    pub played: Vec<(&'static str, Shape)>,
    /// The others.
    pub not_played: Vec<NotPlayed>,
    /// What of the played ones leaves the records, as was granted.
    pub granted: Vec<Beyond>,
}

/// The references of [`SHAPES`] for a stage that can be hurt: those whose frequency leaves the records of a controller are left out, unless
/// they are granted.
///
/// # Errors
/// [`ControlError::Wish`] for positions that leave the records without being granted, since every reference goes there, and where every
/// frequency leaves them.
pub fn real(controller: &Controller, range_um: [f64; 2], beyond_records: bool) -> Result<Programme, ControlError> {
    if beyond_records {
        return Ok(Programme {
            played: SHAPES.to_vec(),
            not_played: Vec::new(),
            granted: simulated(controller, range_um, true)?,
        });
    }
    references(controller, range_um, false)?;
    let left = frequencies(controller, range_um);
    let is_within = |name: &str| left.iter().all(|(beyond, _)| *beyond != name);
    let played: Vec<_> = SHAPES.into_iter().filter(|(name, _)| is_within(name)).collect();
    if let ([], Some((_, first))) = (played.as_slice(), left.first()) {
        let slow = format!("{}; no reference is slow enough to be played. ", unknown(first));
        return Err(ControlError::Wish(
            Message::from(slow)
                .naming(Setting::BeyondRecords)
                .and(" plays them all the same, and the answer says so"),
        ));
    }
    let not_played = left.into_iter();
    Ok(Programme {
        played,
        not_played: not_played
            .map(|(reference, beyond)| NotPlayed { reference, beyond })
            .collect(),
        granted: Vec::new(),
    })
}
