//! Nothing leaves the records that were taken, unless `--beyond-records` says so: then the file remembers it.

use super::Controller;
use crate::error::ControlError;
use hysteron_identify::Covered;
use hysteron_identify::covered::{Beyond, Envelope, Field};

/// Values that are asked for, and the option that asks.
pub struct Asked<'a> {
    field: Field,
    values: Vec<f64>,
    option: &'a str,
}

impl<'a> Asked<'a> {
    /// Limits of the command, volts.
    pub fn voltage(values: &[f64], option: &'a str) -> Self {
        Self::new(Field::Voltage, values, option)
    }

    /// References, micrometres.
    pub fn position(values: &[f64], option: &'a str) -> Self {
        Self::new(Field::Position, values, option)
    }

    /// The rate, hertz.
    pub fn rate(value: f64, option: &'a str) -> Self {
        Self::new(Field::SampleRate, &[value], option)
    }

    fn new(field: Field, values: &[f64], option: &'a str) -> Self {
        Self {
            field,
            values: values.to_vec(),
            option,
        }
    }

    fn envelope(&self, covered: &Covered) -> Option<Envelope> {
        match self.field {
            Field::Voltage => covered.command_v(),
            Field::Position => covered.reference_um(),
            Field::SampleRate => covered.rate_hz(),
        }
    }
}

/// Refuses what leaves the records; where that is granted, it is kept in them. A field of which the records say nothing is not checked.
///
/// # Errors
/// [`ControlError::Wish`] for what leaves the records without being granted.
pub fn granted(covered: &mut Covered, asked: &[Asked<'_>], beyond_records: bool) -> Result<(), ControlError> {
    for asked in asked {
        let envelope = asked.envelope(covered);
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
