//! An effect in the current model's own loops, its parameters moved by hand.

use crate::error::Refusal;
use crate::series;
use hysteron_data::{Dataset, Record};
use hysteron_identify::effects::{self, Bounds, Effect, Facts, Scene};
use hysteron_identify::family::range;
use hysteron_identify::{EffectId, EffectName, FittedEffect, Model, Parameter, illustration};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Every effect in words.
pub(crate) fn catalogue() -> Value {
    let words = |effect: std::sync::Arc<dyn Effect>| {
        let words = effect.description();
        json!({
            "name": words.name, "place": words.place.name(), "summary": words.summary, "equation": hysteron_report::equation(words.equation),
            "source": words.source, "shows": words.shows, "mistaken_for": words.mistaken_for,
            "separated_by": words.separated_by, "compensated_by": words.compensated_by,
            "parameters": words.parameters.iter().map(|p| json!({"name": p.name, "unit": p.unit, "what": p.what})).collect::<Vec<_>>(),
        })
    };
    Value::Array(effects::catalogue().into_iter().map(words).collect())
}

/// What is physical for the parameters of an effect on a dataset: smallest and largest of each by its name; none where the
/// records cannot have the effect.
pub(crate) fn bounds(dataset: &Dataset, model: &Model, name: &str) -> BTreeMap<&'static str, [f64; 2]> {
    let facts = hysteron_identify::facts(dataset, model.family);
    let Ok(effect) = name.parse().map(EffectId::effect) else {
        return BTreeMap::new();
    };
    let bounds = effect.bounds(&facts).unwrap_or_default();
    let names = effect.description().parameters.iter().map(|named| named.name);
    names.zip(bounds.iter().map(|b| [b.min, b.max])).collect()
}

/// What the two readings should differ by at first, percent of peak to peak: the lower end of what is called strong.
const TELLING_PERCENT: f64 = 3.0;
/// Points of a picture over time.
const POINTS: usize = 600;

/// The scene that shows an effect, in the model's range, and at another frequency where it has one.
fn record(model: &Model, scene: Scene, frequency_hz: Option<f64>) -> Result<(Record, Option<f64>), Refusal> {
    let mut record = illustration::scene_record(scene, [model.input_min, model.input_max])
        .ok_or_else(|| Refusal::absent("there is no record that shows it"))?;
    let own = match scene {
        Scene::FastSine => Some(503.0),
        Scene::SlowSine | Scene::Ladder => Some(11.0),
        Scene::Edge | Scene::Hold | Scene::OtherAxis => None,
    };
    let Some(own) = own else { return Ok((record, None)) };
    let asked = frequency_hz.unwrap_or(own);
    if !(asked.is_finite() && (1e-3..=1e5).contains(&asked)) {
        return Err(Refusal::bad(format!(
            "frequency {asked} Hz: allowed are 0.001 to 100000 Hz"
        )));
    }
    record.period_s *= own / asked;
    Ok((record, Some(asked)))
}

/// What is played, for people.
fn played(scene: Scene) -> &'static str {
    match scene {
        Scene::FastSine | Scene::SlowSine => "A sine over the model's range",
        Scene::Ladder => "Sines about the middle, 2, 5, 10, 25, 50 and 100 % of the model's range, twice each",
        Scene::Edge => "A step of half the model's range within 0.1 ms",
        Scene::Hold => {
            "A step up by 80 % of the model's range, after a minute down to 20 %, while the room warms by 1 °C"
        }
        Scene::OtherAxis => "This axis at rest, the other one a sine of 7 Hz over the same range",
    }
}

/// An effect in a model, with its parameters at given values.
struct Placed<'a> {
    without: &'a Model,
    effect: &'a dyn Effect,
    record: &'a Record,
}

impl Placed<'_> {
    fn output(&self, values: &[f64]) -> Vec<f64> {
        let words = self.effect.description();
        let parameters = words.parameters.iter().zip(values).map(|(named, &value)| Parameter {
            name: named.name.to_owned(),
            unit: named.unit.to_owned(),
            value,
            standard_error: None,
        });
        let mut with = self.without.clone();
        with.effects.push(FittedEffect {
            name: self.effect.name(),
            parameters: parameters.collect(),
            definition: self.effect.file().cloned(),
        });
        with.effects
            .sort_by_key(|fitted| fitted.effect().map(|effect| effect.description().place));
        with.simulate_rested(self.record).output
    }

    /// A start of the search at which the effect acts, the last one first. Where it acts at none, as where its strength is
    /// solved for, the first parameter moves that makes it act.
    fn acting(&self, starts: Vec<Vec<f64>>, bounds: &[Bounds], stroke: f64) -> Vec<f64> {
        let still = starts.last().cloned();
        let still = still.unwrap_or_else(|| bounds.iter().map(|b| b.neutral).collect());
        let moved = bounds.iter().enumerate().filter(|(_, b)| b.fitted && b.max > b.neutral);
        let moved = moved.map(|(i, b)| {
            let mut values = still.clone();
            values[i] = b.max;
            values
        });
        // A millionth of the stroke is below every noise.
        let acts = |values: &Vec<f64>| self.differs(values, &self.record.position_um) > 1e-6 * stroke;
        let found = starts.into_iter().rev().chain(moved).find(acts);
        found.unwrap_or(still)
    }

    /// The values, on the way from neutral through a start of the search or through the range of the first parameter, at
    /// which the two readings differ by what is telling; or as near to it as there are.
    fn telling(&self, start: &[f64], bounds: &[Bounds], without: &[f64], stroke: f64) -> Vec<f64> {
        let at = |doubling: i32| -> Vec<f64> {
            let moved = start.iter().zip(bounds);
            moved
                .map(|(value, b)| (b.neutral + 2f64.powi(doubling) * (value - b.neutral)).clamp(b.min, b.max))
                .collect()
        };
        // Where neutral is no more than a place to begin, as for a limit, the range is gone through instead.
        let first = bounds.iter().position(|b| b.fitted && b.min > 0.0);
        let through = |step: i32| {
            let mut values = start.to_vec();
            if let Some(i) = first {
                values[i] = bounds[i].min * (bounds[i].max / bounds[i].min).powf(f64::from(step) / 24.0);
            }
            values
        };
        let target = TELLING_PERCENT / 100.0 * stroke;
        let far = |values: &[f64]| (self.differs(values, without).max(1e-9 * target) / target).ln().abs();
        let ways = (-12..=10).map(at).chain((0..=24).map(through));
        ways.map(|values| (far(&values), values))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or_else(|| start.to_vec(), |found| found.1)
    }

    /// Rms distance of the two readings about its mean, micrometres.
    fn differs(&self, values: &[f64], without: &[f64]) -> f64 {
        let changed = self.output(values);
        let n = changed.len() as f64;
        let differences = || changed.iter().zip(without).map(|(a, b)| a - b);
        let mean = differences().sum::<f64>() / n;
        (differences().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt()
    }
}

/// The model's answer to the scene without the effect and with it, at the parameters given; those not given stand at the
/// model's own, or at telling values.
pub(crate) fn picture(model: &Model, name: &str, frequency_hz: Option<f64>, given: &[f64]) -> Result<Value, Refusal> {
    let name = &EffectName::of(name);
    let effect = match model.effects.iter().find(|fitted| fitted.name == *name) {
        Some(fitted) => fitted.effect(),
        None => name.id().map(EffectId::effect),
    }
    .ok_or_else(|| Refusal::absent(format!("`{name}` is no effect")))?;
    let words = effect.description();
    let (mut record, frequency_hz) = record(model, words.scene, frequency_hz)?;
    let mut without = model.clone();
    without.effects.retain(|fitted| fitted.name != *name);
    record.position_um = without.simulate_rested(&record).output;
    let facts = facts(&without, &record);
    let bounds = effect.bounds(&facts).map_err(Refusal::unusable)?;
    if bounds.is_empty() {
        return Err(Refusal::unusable(
            "this one changes the family of plays itself; it has no parameter to drag. Add it to see what it does",
        ));
    }
    let placed = Placed {
        without: &without,
        effect: &*effect,
        record: &record,
    };
    let values: Vec<f64> = if given.iter().filter(|v| v.is_finite()).count() == bounds.len() {
        given.iter().zip(&bounds).map(|(v, b)| v.clamp(b.min, b.max)).collect()
    } else if let Some(own) = model.effects.iter().find(|fitted| fitted.name == *name) {
        own.parameters.iter().map(|p| p.value).collect()
    } else {
        let stroke = facts.position_um[1] - facts.position_um[0];
        let start = placed.acting(effect.starts(&facts, &bounds), &bounds, stroke);
        placed.telling(&start, &bounds, &record.position_um, stroke)
    };
    let changed = placed.output(&values);
    let rows = words.parameters.iter().zip(&bounds).zip(&values);
    let parameters: Vec<Value> = rows
        .map(|((named, b), value)| {
            json!({"name": named.name, "unit": named.unit, "what": named.what, "min": b.min, "max": b.max, "neutral": b.neutral, "value": value})
        })
        .collect();
    let over_time = matches!(words.scene, Scene::Edge | Scene::Hold | Scene::OtherAxis);
    let n = record.len();
    let time = |k: usize| k as f64 * record.period_s;
    let points = series::columns(0, n, POINTS, time, &[&|k| record.position_um[k], &|k| changed[k]]);
    // The last third of a sine has forgotten how it began.
    let settled = if words.scene == Scene::Ladder {
        0..n
    } else {
        2 * n / 3..n
    };
    Ok(json!({
        "parameters": parameters,
        "played": played(words.scene),
        "frequency_hz": frequency_hz,
        "points": over_time.then_some(points),
        "loops": (!over_time).then(|| [
            series::path(&record.voltage_v[settled.clone()], &record.position_um[settled.clone()]),
            series::path(&record.voltage_v[settled.clone()], &changed[settled]),
        ]),
    }))
}

fn facts(model: &Model, record: &Record) -> Facts {
    // A record at rest on this axis says nothing of the stroke; a slow way over the range does.
    let mut slow = record.clone();
    slow.period_s = 1.0;
    slow.voltage_v = (0..record.len())
        .map(|k| model.input_min + (model.input_max - model.input_min) * k as f64 / record.len() as f64)
        .collect();
    let (low, high) = range(model.simulate(&slow).output);
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
        temperature_c: record.temperature_c.as_deref().map(|t| {
            let (low, high) = range(t.iter().copied());
            [low, t.iter().sum::<f64>() / t.len().max(1) as f64, high]
        }),
        voltage2_v: record.voltage2_v.as_deref().map(|v| range(v.iter().copied()).into()),
        rests: true,
        family: model.family,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_data::Role;
    use hysteron_identify::{Family, FitOptions, fit};

    /// A model of a stage of 10 um at 100 V with an opening.
    fn model() -> Model {
        let samples = 4000;
        let voltage_v: Vec<f64> = (0..samples)
            .map(|k| 50.0 - 50.0 * (std::f64::consts::TAU * f64::from(k) / 1000.0).cos())
            .collect();
        let position_um = (0..samples)
            .map(|k| 5.0 - 5.0 * (std::f64::consts::TAU * f64::from(k) / 1000.0 - 0.15).cos())
            .collect();
        let record = Record::new("a.csv", Role::Identify, 1e-4, voltage_v, position_um);
        let dataset = Dataset {
            records: vec![record],
            ..Dataset::default()
        };
        fit(&dataset, &FitOptions::new(Family::Pi), &|_| ()).unwrap().model
    }

    /// Each effect with parameters begins where one sees it, and neither hides the loop nor is hidden by it.
    #[test]
    fn val_every_effect_begins_where_it_shows() {
        let model = model();
        for id in EffectId::ALL {
            let name = id.name();
            let picture = match picture(&model, name, None, &[]) {
                Ok(picture) => picture,
                Err(refusal) => {
                    assert!(refusal.message.len() > 20, "{name}: {}", refusal.message);
                    continue;
                }
            };
            let [without, with] = if picture["loops"].is_null() {
                [&picture["points"]["y"][0], &picture["points"]["y"][1]]
            } else {
                [&picture["loops"][0]["y"], &picture["loops"][1]["y"]]
            };
            assert_ne!(without, with, "{name}");
            let values: Vec<f64> = picture["parameters"]
                .as_array()
                .unwrap()
                .iter()
                .map(|p| p["value"].as_f64().unwrap())
                .collect();
            let effect = id.effect();
            let (mut record, _) = record(&model, effect.description().scene, None).unwrap();
            record.position_um = model.simulate_rested(&record).output;
            let placed = Placed {
                without: &model,
                effect: &*effect,
                record: &record,
            };
            let percent = 10.0 * placed.differs(&values, &record.position_um);
            assert!(
                (0.5..=15.0).contains(&percent),
                "{name}: {percent} % of the stroke at {values:?}"
            );
        }
    }
}
