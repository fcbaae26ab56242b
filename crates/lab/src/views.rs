//! What is looked at: records, a step's comparison and diagnosis, effects.

use crate::api::{Answer, Parameters, Shared, aside, number, optional};
use crate::book::Stands;
use crate::error::Refusal;
use crate::place::Place;
use crate::session::Session;
use crate::uploads::Found;
use crate::{controller, explain, series, work};
use axum::Json;
use axum::extract::{Query, State};
use axum::http::header;
use axum::response::IntoResponse;
use hysteron_data::Record;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_diagnose::{Comparison, RecordComparison};
use hysteron_identify::EffectName;
use hysteron_identify::residual::{Correlation, correlations};
use serde_json::{Value, json};
use std::collections::HashMap;

/// A record as it was brought or taken, as few points.
pub(crate) async fn raw(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let index: usize = number(&parameters, "record")?;
    let width: usize = number(&parameters, "width")?;
    let uploaded = parameters.get("of").is_some_and(|of| of == "files");
    aside(move || {
        let mut session = app.session();
        let absent = || Refusal::absent("there is no such record");
        let record = records(&mut session, uploaded).nth(index).ok_or_else(absent)?;
        let (first, len) = window(&parameters, record.start_s, record.period_s, record.len());
        let time = |k: usize| record.start_s + k as f64 * record.period_s;
        let points = series::columns(first, len, width, time, &[&|k| record.voltage_v[k], &|k| record.position_um[k]]);
        Ok(Json(json!({ "points": points, "loop": series::path(&record.voltage_v[first..first + len], &record.position_um[first..first + len]) })).into_response())
    })
    .await
}

/// The samples between `from` and `to` seconds, with a neighbour on either side; all without them.
pub(crate) fn window(parameters: &HashMap<String, String>, start_s: f64, period_s: f64, len: usize) -> (usize, usize) {
    let at = |name: &str| number::<f64>(parameters, name).ok().filter(|t| t.is_finite());
    let index = |t: f64| ((t - start_s) / period_s).clamp(0.0, len as f64);
    let first = at("from")
        .map_or(0, |t| (index(t).floor() as usize).saturating_sub(1))
        .min(len.saturating_sub(2));
    let end = at("to").map_or(len, |t| (index(t).ceil() as usize + 2).min(len));
    (first, end.saturating_sub(first).max(2).min(len - first))
}

/// A record of a comparison, and the samples of it that are asked about: the first and how many.
pub(crate) fn stretch<'a>(
    comparison: &'a Comparison,
    index: usize,
    parameters: &HashMap<String, String>,
) -> Result<(&'a RecordComparison, usize, usize), Refusal> {
    let record = comparison
        .records
        .get(index)
        .ok_or_else(|| Refusal::absent(format!("there is no record {index}")))?;
    let s = &record.series;
    let (first, len) = window(parameters, s.start_s, s.period_s, s.measured.len());
    Ok((record, first, len))
}

/// The comparison of a step: the same text as `hysteron compare --json`.
pub(crate) async fn compare(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step")?;
    aside(move || {
        let comparison = work::comparison(&app, step)?;
        let text = serde_json::to_string_pretty(&*comparison).map_err(Refusal::unusable)? + "\n";
        Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response())
    })
    .await
}

/// The comparison in sentences, the model's parameters, and the commands.
pub(crate) async fn words(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let number = number(&parameters, "step")?;
    aside(move || {
        let comparison = work::comparison(&app, number)?;
        let session = app.session();
        let model = session.model(number)?;
        let step = session.step(number)?;
        let (data, file) = (session.data_word(step.generation), &step.model);
        let row = |name: String, p: &hysteron_identify::Parameter| json!({"name": name, "value": p.value, "unit": p.unit, "standard_error": p.standard_error});
        let parameters = model.parameters();
        let own = parameters.iter().map(|p| row(p.name.clone(), p));
        let effects = model.effects.iter().flat_map(|e| e.parameters.iter().map(move |p| row(format!("{}: {}", e.name, p.name), p)));
        Ok(Json(json!({
            "headline": hysteron_report::headline(&comparison),
            "notices": model.notices,
            "parameters": effects.chain(own).collect::<Vec<_>>(),
            "effects": model.effects.iter().map(|e| &e.name).collect::<Vec<_>>(),
            "compare_command": format!("hysteron compare {data} {file} -o page.html"),
            "diagnose_command": format!("hysteron diagnose {data} {file} -o next.csv"),
            "report_command": format!("hysteron report {data} {file} -o report.html"),
        }))
        .into_response())
    })
    .await
}

/// Spectra of a step's error, pooled over its records, or of one of them.
pub(crate) async fn spectrum(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step")?;
    let record = optional(&parameters, "record")?;
    aside(move || {
        let comparison = work::comparison(&app, step)?;
        Ok(match record {
            None => Json(&comparison.spectrum).into_response(),
            Some(record) => Json(hysteron_diagnose::of_record(&comparison, record)).into_response(),
        })
    })
    .await
}

/// Columns of a record's small picture.
const SMALL: usize = 60;

/// All records in small pictures: of a step what was measured and what is left, of the data or of the files the voltage and the position.
pub(crate) async fn small(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let drawn = |len: usize, first: &dyn Fn(usize) -> f64, second: &dyn Fn(usize) -> f64| {
        json!(series::columns(0, len, SMALL, |_| 0.0, &[first, second]).y)
    };
    let step = optional(&parameters, "step")?;
    let uploaded = parameters.get("of").is_some_and(|of| of == "files");
    aside(move || {
        let all: Vec<Value> = if let Some(step) = step {
            let comparison = work::comparison(&app, step)?;
            let each = comparison.records.iter().map(|record| {
                let s = &record.series;
                drawn(s.measured.len(), &|k| s.measured[k], &|k| s.measured[k] - s.modelled[k])
            });
            each.collect()
        } else {
            let mut session = app.session();
            records(&mut session, uploaded)
                .map(|record| drawn(record.len(), &|k| record.voltage_v[k], &|k| record.position_um[k]))
                .collect()
        };
        Ok(Json(all).into_response())
    })
    .await
}

/// What the records of the data can tell and cannot, before any model.
pub(crate) async fn told(State(app): Shared) -> Answer {
    aside(move || {
        let dataset = app.session().data()?;
        let told = hysteron_diagnose::told(&dataset);
        let effects = told
            .effects
            .iter()
            .map(|(id, refused)| json!({"name": id.name(), "refused": refused}));
        Ok(Json(json!({
            "reasons": told.reasons.iter().map(|reason| hysteron_report::reason_in_words(*reason)).collect::<Vec<_>>(),
            "effects": effects.collect::<Vec<_>>(),
        }))
        .into_response())
    })
    .await
}

/// The records of the data, or of the files that were brought, in the order that the page numbers them.
fn records(session: &mut Session, uploaded: bool) -> impl Iterator<Item = &Record> {
    if uploaded {
        session.read_again(|stands| stands != Stands::Taken);
    }
    let files = session.uploads.files.iter().filter(move |_| uploaded);
    let brought = files
        .filter_map(|file| file.read.as_ref().ok())
        .flat_map(Found::records);
    let data = session.dataset.iter().filter(move |_| !uploaded);
    brought.chain(data.flat_map(|dataset| &dataset.records))
}

/// Measured, modelled and error of one record, as few points, with its loop.
pub(crate) async fn plotted(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let (step, index, width) = (
        number(&parameters, "step")?,
        number::<usize>(&parameters, "record")?,
        number(&parameters, "width")?,
    );
    aside(move || {
        let comparison = work::comparison(&app, step)?;
        let (record, first, len) = stretch(&comparison, index, &parameters)?;
        let s = &record.series;
        let points = series::columns(
            first,
            len,
            width,
            |k| s.at_s(k),
            &[&|k| s.measured[k], &|k| s.modelled[k], &|k| {
                s.measured[k] - s.modelled[k]
            }],
        );
        let all = first..first + len;
        let at = |x: &f64| ((x - s.start_s) / s.period_s).round() as usize;
        let places: Vec<usize> = points.x.iter().map(|x| at(x).min(s.measured.len() - 1)).collect();
        let pick = |values: &[f64]| places.iter().map(|&k| values[k]).collect::<Vec<f64>>();
        Ok(Json(json!({
            "points": points,
            "at": {"input": pick(&s.input), "measured": pick(&s.measured), "modelled": pick(&s.modelled)},
            "measured_loop": series::path(&s.input[all.clone()], &s.measured[all.clone()]),
            "modelled_loop": series::path(&s.input[all.clone()], &s.modelled[all]),
        }))
        .into_response())
    })
    .await
}

/// A step's controller in pictures, and what holds for its design where nobody wishes otherwise.
pub(crate) async fn controller(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let place = Place::asked(&parameters)?;
    aside(move || Ok(Json(controller::view(&app, place)?).into_response())).await
}

/// What the stage of a step answers to small signals.
pub(crate) async fn response(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step")?;
    aside(move || Ok(Json(controller::response(&app, step)?).into_response())).await
}

/// Correlations of a record's error with itself and with the drive.
pub(crate) async fn correlation(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let (step, index) = (number(&parameters, "step")?, number::<usize>(&parameters, "record")?);
    aside(move || {
        let comparison = work::comparison(&app, step)?;
        let (record, ..) = stretch(&comparison, index, &parameters)?;
        let s = &record.series;
        let error: Vec<f64> = s.measured.iter().zip(&s.modelled).map(|(y, m)| y - m).collect();
        let Some(found) = correlations(&error, &s.input) else {
            return Ok(Json(Value::Null).into_response());
        };
        let period_s = s.period_s;
        let shown = |one: &Correlation| {
            json!({
                "lag_s": one.lag.iter().map(|lag| *lag as f64 * period_s).collect::<Vec<_>>(),
                "value": one.value,
                "band": one.band,
                "largest": one.largest().map(|(lag, times)| json!({"lag_s": lag as f64 * period_s, "times": times})),
            })
        };
        Ok(Json(json!({
            "own": shown(&found.own),
            "with_drive": shown(&found.with_drive),
            "memory_s": found.memory() as f64 * period_s,
            "longest": found.memory() == found.own.lag.len(),
        }))
        .into_response())
    })
    .await
}

/// What the error in a stretch is, and what could make it.
pub(crate) async fn region(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let (step, index) = (number(&parameters, "step")?, number::<usize>(&parameters, "record")?);
    aside(move || {
        let comparison = work::comparison(&app, step)?;
        let (record, first, len) = stretch(&comparison, index, &parameters)?;
        let region = hysteron_diagnose::region(record, first..first + len, comparison.noise_rms_um)
            .ok_or_else(|| Refusal::unusable("fewer than eight samples; select more"))?;
        Ok(Json(region).into_response())
    })
    .await
}

/// A step's diagnosis: the same text as `hysteron diagnose --json`, and its words.
pub(crate) async fn diagnosis(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step")?;
    let (file, shown) = {
        let session = app.session();
        session.step(step)?;
        (session.diagnosis_file(step), session.signatures_file(step))
    };
    let text = tokio::fs::read_to_string(&file)
        .await
        .map_err(|_| Refusal::absent("this step is not diagnosed yet"))?;
    if parameters.contains_key("plain") {
        return Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response());
    }
    let numbers: Value = serde_json::from_str(&text).map_err(|error| Refusal::disk(&file, &error))?;
    let read: Diagnosis = serde_json::from_str(&text).map_err(|error| Refusal::disk(&file, &error))?;
    let read_names: Vec<String> = read.ranking.iter().map(|effect| effect.effect.to_string()).collect();
    let signatures: Vec<hysteron_diagnose::Signature> = tokio::fs::read_to_string(&shown)
        .await
        .ok()
        .and_then(|text| serde_json::from_str(&text).ok())
        .unwrap_or_default();
    let bounds: Vec<_> = {
        let (dataset, model) = {
            let mut session = app.session();
            (session.data_of(step)?, session.model(step)?)
        };
        aside(move || {
            Ok(read_names
                .iter()
                .map(|name| explain::bounds(&dataset, &model, name))
                .collect())
        })
        .await?
    };
    let odds = hysteron_report::odds_in_words(&read);
    // The page draws what this sentence says.
    let sentence = odds.as_ref().map(hysteron_report::OddsWords::sentence);
    let odds = odds.map(|odds| {
        let each = odds.each.iter();
        let each = each.map(|(name, said, share)| json!({"name": name, "said": said, "share": share}));
        json!({"title": odds.title, "each": each.collect::<Vec<_>>()})
    });
    Ok(Json(json!({
        "numbers": numbers,
        "named": named(&read),
        "bounds": bounds,
        "signatures": signatures,
        "verdict": hysteron_report::verdict_sentence(&read),
        "fails": hysteron_report::failing_lines(&read),
        "lines": hysteron_report::diagnosis_lines(&read).into_iter().filter(|line| Some(line) != sentence.as_ref()).collect::<Vec<_>>(),
        "odds": odds,
    }))
    .into_response())
}

/// The effect that a diagnosis names and that can be added, where it could answer at all.
fn named(diagnosis: &Diagnosis) -> Option<&EffectName> {
    let answers = !diagnosis.cannot_answer.iter().any(|reason| reason.blocks());
    diagnosis.verdict.effect().filter(|name| answers && name.id().is_some())
}

pub(crate) async fn effects() -> Json<Value> {
    Json(explain::catalogue())
}

pub(crate) async fn effect(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step")?;
    let frequency_hz = match parameters.contains_key("frequency") {
        true => Some(number(&parameters, "frequency")?),
        false => None,
    };
    let values: Vec<f64> = parameters
        .get("values")
        .into_iter()
        .flat_map(|text| text.split(','))
        .map(|text| text.parse().unwrap_or(f64::NAN))
        .collect();
    let name = parameters.get("name").cloned().unwrap_or_default();
    aside(move || {
        let model = app.session().model(step)?;
        Ok(Json(explain::picture(&model, &name, frequency_hz, &values)?).into_response())
    })
    .await
}
