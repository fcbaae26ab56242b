//! An effect in the current model's own loops, its parameters moved by hand.

use crate::error::Refusal;
use hysteron_data::{Record, Role};
use hysteron_identify::effects::{self, Effect, Facts};
use hysteron_identify::{FittedEffect, Model, Parameter};
use serde_json::{Value, json};

/// Samples of the picture's record: two periods.
const SAMPLES: usize = 1200;

/// Every effect in words.
pub(crate) fn catalogue() -> Value {
    let words = |effect: std::sync::Arc<dyn Effect>| {
        let words = effect.description();
        json!({
            "name": words.name, "place": words.place.name(), "summary": words.summary, "equation": words.equation,
            "source": words.source, "shows": words.shows, "mistaken_for": words.mistaken_for,
            "separated_by": words.separated_by, "compensated_by": words.compensated_by,
            "parameters": words.parameters.iter().map(|p| json!({"name": p.name, "unit": p.unit, "what": p.what})).collect::<Vec<_>>(),
        })
    };
    Value::Array(effects::catalogue().into_iter().map(words).collect())
}

/// A triangle over the model's range, for the picture.
fn triangle(model: &Model, frequency_hz: f64) -> Record {
    let (low, high) = (model.input_min, model.input_max);
    let period = SAMPLES / 2;
    let voltage_v: Vec<f64> = (0..SAMPLES)
        .map(|k| low + (high - low) * (1.0 - (2.0 * (k % period) as f64 / period as f64 - 1.0).abs()))
        .collect();
    Record {
        file: "triangle.csv".to_owned(),
        role: Role::Identify,
        excitation: "triangle".to_owned(),
        start_s: 0.0,
        period_s: 1.0 / (frequency_hz * period as f64),
        position_um: vec![0.0; voltage_v.len()],
        voltage_v,
        reference_um: None,
        temperature_c: None,
        voltage2_v: None,
    }
}

/// The model's loop without the effect and with it, at the parameters given; those not given stand at a telling value.
pub(crate) fn picture(model: &Model, name: &str, frequency_hz: f64, given: &[f64]) -> Result<Value, Refusal> {
    let fitted = model.effects.iter().find(|fitted| fitted.name == name);
    let effect = match fitted {
        Some(fitted) => fitted.effect(),
        None => effects::find(name),
    }
    .ok_or_else(|| Refusal::absent(format!("`{name}` is no effect")))?;
    if !(frequency_hz.is_finite() && (1e-3..=1e5).contains(&frequency_hz)) {
        return Err(Refusal::bad(format!(
            "frequency {frequency_hz} Hz: allowed are 0.001 to 100000 Hz"
        )));
    }
    let mut record = triangle(model, frequency_hz);
    let mut without = model.clone();
    without.effects.retain(|fitted| fitted.name != name);
    record.position_um = without.simulate(&record).output;
    let facts = facts(model, &record);
    let bounds = effect.bounds(&facts).map_err(Refusal::unusable)?;
    if bounds.is_empty() {
        return Err(Refusal::unusable(
            "this one changes the family of plays itself; it has no parameter to drag. Add it to see what it does",
        ));
    }
    let starts = effect.starts(&facts, &bounds);
    let telling = starts
        .iter()
        .rev()
        .find(|start| start.iter().zip(&bounds).any(|(v, b)| *v != b.neutral))
        .or(starts.first());
    let values: Vec<f64> = bounds
        .iter()
        .enumerate()
        .map(|(i, b)| {
            let own = fitted.and_then(|f| f.parameters.get(i)).map(|p| p.value);
            let start = telling.and_then(|start| start.get(i)).copied();
            let value = given
                .get(i)
                .copied()
                .filter(|v| v.is_finite())
                .or(own)
                .or(start)
                .unwrap_or(b.neutral);
            value.clamp(b.min, b.max)
        })
        .collect();
    let mut with = without.clone();
    with.effects.push(FittedEffect {
        name: name.to_owned(),
        parameters: effect
            .description()
            .parameters
            .iter()
            .zip(&values)
            .map(|(named, &value)| Parameter {
                name: named.name.to_owned(),
                unit: named.unit.to_owned(),
                value,
                standard_error: None,
            })
            .collect(),
        definition: effect.file().cloned(),
    });
    with.effects
        .sort_by_key(|fitted| fitted.effect().map(|effect| effect.description().place));
    let changed = with.simulate(&record).output;
    let last = SAMPLES / 2..SAMPLES;
    let parameters: Vec<Value> = effect
        .description()
        .parameters
        .iter()
        .zip(&bounds)
        .zip(&values)
        .map(|((named, b), value)| {
            json!({"name": named.name, "unit": named.unit, "what": named.what, "min": b.min, "max": b.max, "neutral": b.neutral, "value": value})
        })
        .collect();
    Ok(json!({
        "parameters": parameters,
        "voltage_v": record.voltage_v[last.clone()],
        "without": record.position_um[last.clone()],
        "with": changed[last],
    }))
}

fn facts(model: &Model, record: &Record) -> Facts {
    let low = record.position_um.iter().copied().fold(f64::INFINITY, f64::min);
    let high = record.position_um.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let step = record
        .voltage_v
        .windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .fold(0.0, f64::max);
    Facts {
        voltage_v: [model.input_min, model.input_max],
        position_um: [low, high],
        finest_period_s: record.period_s,
        finest_grid_s: record.period_s,
        longest_s: record.duration_s(),
        peak_rate_v_per_s: step / record.period_s,
        temperature_c: None,
        voltage2_v: None,
        family: model.family,
    }
}
