//! Scales of a channel: from the numbers that the converter gave to the quantity.

use super::properties::{Properties, Value};

/// Input of a scale that takes the raw numbers.
const RAW: f64 = u32::MAX as f64;

/// The most scales of a channel and coefficients of a scale.
const MOST: f64 = 64.0;

/// One scale: a polynomial in its input.
#[derive(Debug, Clone, PartialEq)]
struct Scale {
    /// The scale that its input comes from, or the raw numbers.
    input: Option<usize>,
    /// Coefficients, the constant first.
    coefficients: Vec<f64>,
}

/// The scales of a channel, in order; the last one's output is the value.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Scales(Vec<Scale>);

impl Scales {
    /// Those of a channel, or else of its group, or else of the file; or what cannot be read about them.
    pub(super) fn of(above: [&Properties; 3]) -> Result<Scales, String> {
        let scaled = |properties: &&&Properties| {
            properties
                .number("NI_Number_Of_Scales")
                .is_some_and(|count| count > 0.0)
        };
        let Some(properties) = above.iter().find(scaled) else {
            return Ok(Scales::default());
        };
        if properties.text("NI_Scaling_Status") == Some("scaled") {
            return Ok(Scales::default());
        }
        let count = properties.number("NI_Number_Of_Scales").unwrap_or(0.0);
        if count > MOST {
            return Err(format!("{count} scales"));
        }
        (0..count as usize)
            .map(|index| scale(properties, index))
            .collect::<Result<_, _>>()
            .map(Scales)
    }

    /// The value of a raw number.
    pub(super) fn apply(&self, raw: f64) -> f64 {
        let Some(last) = self.0.len().checked_sub(1) else {
            return raw;
        };
        self.output(last, raw)
    }

    fn output(&self, index: usize, raw: f64) -> f64 {
        let scale = &self.0[index];
        let input = scale.input.map_or(raw, |input| self.output(input, raw));
        scale
            .coefficients
            .iter()
            .rev()
            .fold(0.0, |sum, coefficient| sum * input + coefficient)
    }
}

fn scale(properties: &Properties, index: usize) -> Result<Scale, String> {
    let of = |what: &str| format!("NI_Scale[{index}]_{what}");
    let kind = match properties.get(&of("Scale_Type")) {
        Some(Value::Text(kind)) => kind.as_str(),
        _ => return Err(format!("scale {index} of a DAQmx task")),
    };
    let number = |what: &str| {
        properties
            .number(&of(what))
            .ok_or_else(|| format!("scale {index} lacks {what}"))
    };
    let coefficients = match kind {
        "Linear" => vec![number("Linear_Y_Intercept")?, number("Linear_Slope")?],
        "Polynomial" => {
            // where the size is not given it is the four of LabVIEW's own
            let count = properties.number(&of("Polynomial_Coefficients_Size")).unwrap_or(4.0);
            if !(0.0..=MOST).contains(&count) {
                return Err(format!("scale {index} with {count} coefficients"));
            }
            (0..count as usize)
                .map(|power| number(&format!("Polynomial_Coefficients[{power}]")))
                .collect::<Result<_, _>>()?
        }
        "AdvancedAPI" => vec![0.0, 1.0],
        other => return Err(format!("scale {index} of type {other}")),
    };
    let input = match properties.number(&of(&format!("{kind}_Input_Source"))) {
        None => None,
        Some(input) if input == RAW => None,
        Some(input) if input >= 0.0 && input < index as f64 => Some(input as usize),
        Some(input) => return Err(format!("scale {index} takes its input from scale {input}")),
    };
    Ok(Scale { input, coefficients })
}
