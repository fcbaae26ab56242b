//! Nothing leaves the records that were taken, unless `--beyond-records` says so: then the file remembers it.

use super::Controller;
use crate::error::ControlError;
use crate::reference::SHAPES;
use hysteron_identify::Covered;
use hysteron_identify::covered::{Beyond, Envelope};

/// Values that are asked for, and the option that asks.
pub struct Asked<'a> {
    /// What of the records it is held to.
    envelope: fn(&Covered) -> Option<Envelope>,
    values: Vec<f64>,
    option: &'a str,
}

impl<'a> Asked<'a> {
    /// Limits of the command, volts.
    pub fn voltage(values: &[f64], option: &'a str) -> Self {
        Self::new(Covered::command_v, values, option)
    }

    /// References, micrometres.
    pub fn position(values: &[f64], option: &'a str) -> Self {
        Self::new(Covered::reference_um, values, option)
    }

    /// The rate, hertz.
    pub fn rate(value: f64, option: &'a str) -> Self {
        Self::new(Covered::rate_hz, &[value], option)
    }

    fn new(envelope: fn(&Covered) -> Option<Envelope>, values: &[f64], option: &'a str) -> Self {
        Self {
            envelope,
            values: values.to_vec(),
            option,
        }
    }
}

/// Refuses what leaves the records; where that is granted, it is kept in them. A field of which the records say nothing is not checked.
///
/// # Errors
/// [`ControlError::Wish`] for what leaves the records without being granted.
pub fn granted(covered: &mut Covered, asked: &[Asked<'_>], beyond_records: bool) -> Result<(), ControlError> {
    for asked in asked {
        let envelope = (asked.envelope)(covered);
        let Some(beyond) = envelope.and_then(|envelope| envelope.left_by(&asked.values)) else {
            continue;
        };
        if !beyond_records {
            return Err(ControlError::Wish(format!(
                "{beyond}; stay within with {}, or {}; --beyond-records leaves them all the same, and the file says so",
                asked.option,
                beyond.field.widen()
            )));
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
    let asked = [Asked::position(&range_um, "--range LOW,HIGH")];
    granted(&mut covered, &asked, beyond_records)?;
    Ok(covered.beyond)
}

/// The references of [`SHAPES`] whose frequency leaves the records of a controller, by name: nothing is known of them.
pub fn frequencies(controller: &Controller, [low_um, high_um]: [f64; 2]) -> Vec<(&'static str, Beyond)> {
    let Some(envelope) = controller.model.covered.frequency_hz(high_um - low_um) else {
        return Vec::new();
    };
    let left = SHAPES.iter().filter_map(|(name, shape)| {
        let beyond = envelope.left_by(&[shape.frequency_hz()])?;
        Some((*name, beyond))
    });
    left.collect()
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

/// Refuses references of [`SHAPES`] that leave the records of a controller in position or frequency, where a stage is there that can be
/// hurt; where that is granted, what leaves them.
///
/// # Errors
/// [`ControlError::Wish`] for references that leave the records without being granted.
pub fn real(controller: &Controller, range_um: [f64; 2], beyond_records: bool) -> Result<Vec<Beyond>, ControlError> {
    let left = simulated(controller, range_um, beyond_records)?;
    match left.first() {
        Some(first) if !beyond_records => Err(ControlError::Wish(format!(
            "{}; --beyond-records plays such references all the same, and the answer says so",
            unknown(first)
        ))),
        _ => Ok(left),
    }
}
