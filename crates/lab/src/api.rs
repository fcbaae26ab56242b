//! Every address that is answered.

use crate::error::Refusal;
use crate::export::{self, Download};
use crate::guard::{self, Guard};
use crate::session::Session;
use crate::signature::Signature;
use crate::uploads::{self, FILE_LIMIT, Reading, Upload};
use crate::{App, assets, explain, jobs, riddle, series, state, work};
use axum::body::{Body, Bytes};
use axum::extract::{DefaultBodyLimit, Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use http_body_util::BodyExt;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::AsyncWriteExt;
use tower::Layer;

/// Largest body of a request that is no file.
const BODY_LIMIT: usize = 64 << 10;

/// How long a page waits for news before it asks again.
const PATIENCE: Duration = Duration::from_secs(20);

type Shared = State<Arc<App>>;
type Answer = Result<Response, Refusal>;
type Parameters = Query<HashMap<String, String>>;

/// All routes behind the guard.
pub(crate) fn router(
    app: Arc<App>,
    guard: Guard,
) -> axum::routing::IntoMakeService<
    impl tower::Service<axum::extract::Request, Response = Response, Error = std::convert::Infallible, Future = impl Send>
    + Clone
    + Send,
> {
    let routes = Router::new()
        .route("/", get(assets::index))
        .route("/app/{*name}", get(assets::asset))
        .route("/api/session", get(session))
        .route("/api/upload", post(upload).layer(DefaultBodyLimit::disable()))
        .route("/api/reading", post(reading))
        .route("/api/forget", post(forget))
        .route("/api/do", post(perform))
        .route("/api/raw", get(raw))
        .route("/api/compare", get(compare))
        .route("/api/words", get(words))
        .route("/api/spectrum", get(spectrum))
        .route("/api/series", get(plotted))
        .route("/api/region", get(region))
        .route("/api/diagnosis", get(diagnosis))
        .route("/api/effects", get(effects))
        .route("/api/effect", get(effect))
        .route("/api/export/{what}", get(download))
        .fallback(|| async { Refusal::absent("there is nothing at this address") })
        .method_not_allowed_fallback(|| async {
            Refusal::new(StatusCode::METHOD_NOT_ALLOWED, "this address is not asked in this way")
        })
        .layer(DefaultBodyLimit::max(BODY_LIMIT))
        .with_state(app);
    // The guard takes the token off the path, so it stands before the routes are chosen.
    let guarded = axum::middleware::from_fn_with_state(guard, guard::check).layer(routes);
    axum::ServiceExt::<axum::extract::Request>::into_make_service(guarded)
}

/// Runs what takes long where it holds up nobody.
async fn aside<T: Send + 'static>(work: impl FnOnce() -> Result<T, Refusal> + Send + 'static) -> Result<T, Refusal> {
    tokio::task::spawn_blocking(work).await.unwrap_or_else(|_| {
        Err(Refusal::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            "a fault of the program; nothing was changed",
        ))
    })
}

fn number<T: std::str::FromStr>(parameters: &HashMap<String, String>, name: &str) -> Result<T, Refusal> {
    let text = parameters
        .get(name)
        .ok_or_else(|| Refusal::bad(format!("`{name}` is missing")))?;
    text.parse().map_err(|_| {
        Refusal::bad(format!(
            "{name} = `{}` is no number of its kind",
            text.chars().take(40).collect::<String>()
        ))
    })
}

fn body<T: for<'a> Deserialize<'a>>(bytes: &Bytes) -> Result<T, Refusal> {
    serde_json::from_slice(bytes).map_err(|error| Refusal::bad(format!("the request cannot be read: {error}")))
}

/// The state, as soon as it is newer than what the page has seen.
async fn session(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let mut ticks = app.ticks();
    if let Ok(seen) = number::<u64>(&parameters, "seen") {
        // No news within the patience is an answer, too.
        let _ = tokio::time::timeout(PATIENCE, ticks.wait_for(|tick| *tick != seen)).await;
    }
    let tick = *ticks.borrow_and_update();
    Ok(Json(aside(move || Ok(state::state(&app, tick))).await?).into_response())
}

/// Takes one file, or the recordings in one zip archive.
async fn upload(State(app): Shared, Query(parameters): Parameters, mut content: Body) -> Answer {
    let name = uploads::safe_name(parameters.get("name").map_or("", String::as_str))?;
    let folder = app.session().uploads.folder.clone();
    let beside = tempfile::NamedTempFile::new_in(&folder).map_err(|error| Refusal::disk(&folder, &error))?;
    let mut file = tokio::fs::File::from_std(beside.reopen().map_err(|error| Refusal::disk(&folder, &error))?);
    let mut bytes = 0_u64;
    while let Some(frame) = content.frame().await {
        let frame = frame.map_err(|error| Refusal::bad(format!("{name}: the transfer broke off: {error}")))?;
        if let Ok(data) = frame.into_data() {
            bytes += data.len() as u64;
            if bytes > FILE_LIMIT {
                return Err(Refusal::new(
                    StatusCode::PAYLOAD_TOO_LARGE,
                    format!("{name}: files of more than {} MB are not taken", FILE_LIMIT >> 20),
                ));
            }
            file.write_all(&data)
                .await
                .map_err(|error| Refusal::disk(&folder, &error))?;
        }
    }
    file.flush().await.map_err(|error| Refusal::disk(&folder, &error))?;
    drop(file);
    if bytes == 0 {
        return Err(Refusal::unusable(format!("{name}: the file is empty")));
    }
    let own = Arc::clone(&app);
    let errors = aside(move || {
        let reading = own.session().book.reading.clone();
        let names = if name.to_ascii_lowercase().ends_with(".zip") {
            let archive = beside.reopen().map_err(|error| Refusal::disk(&folder, &error))?;
            uploads::unzip(archive, &folder)?
        } else {
            beside
                .persist(folder.join(&name))
                .map_err(|error| Refusal::disk(&folder, &error))?;
            vec![name]
        };
        let read: Vec<Upload> = names
            .iter()
            .map(|name| uploads::read_one(&folder, name, &reading))
            .collect();
        let errors: Vec<String> = read
            .iter()
            .filter_map(|upload| upload.read.as_ref().err().cloned())
            .collect();
        {
            let mut session = own.session();
            session.uploads.take(read)?;
            session.book.files_taken = false;
            session.save()?;
        }
        own.changed();
        Ok(errors)
    })
    .await?;
    let status = if errors.is_empty() {
        StatusCode::OK
    } else {
        StatusCode::UNPROCESSABLE_ENTITY
    };
    let said = json!({ "error": (!errors.is_empty()).then(|| errors.join("\n")) });
    Ok((status, Json(said)).into_response())
}

/// Reads all files anew with other options.
async fn reading(State(app): Shared, content: Bytes) -> Answer {
    let reading: Reading = body(&content)?;
    reading.options(hysteron_data::Role::Identify)?;
    aside(move || {
        let (folder, names) = {
            let mut session = app.session();
            session.book.reading = reading.clone();
            session.book.files_taken = false;
            session.save()?;
            (
                session.uploads.folder.clone(),
                session
                    .uploads
                    .files
                    .iter()
                    .map(|file| file.name.clone())
                    .collect::<Vec<_>>(),
            )
        };
        let read = names
            .iter()
            .map(|name| uploads::read_one(&folder, name, &reading))
            .collect();
        app.session().uploads.renew(read);
        app.changed();
        Ok(Json(json!({})).into_response())
    })
    .await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Forget {
    name: String,
}

/// Takes a file away.
async fn forget(State(app): Shared, content: Bytes) -> Answer {
    let Forget { name } = body(&content)?;
    let mut session = app.session();
    let there = session.uploads.files.len();
    session.uploads.files.retain(|file| file.name != name);
    if session.uploads.files.len() == there {
        return Err(Refusal::absent("there is no such file"));
    }
    let path = session.uploads.folder.join(&name);
    std::fs::remove_file(&path).map_err(|error| Refusal::disk(&path, &error))?;
    drop(session);
    app.changed();
    Ok(Json(json!({})).into_response())
}

/// What a person can do.
#[derive(Deserialize)]
#[serde(tag = "what", rename_all = "kebab-case", deny_unknown_fields)]
enum Deed {
    TakeFiles,
    Start { name: String },
    Fit { model: String, plays: usize },
    Add { effect: String },
    Diagnose,
    Report,
    Table { ends: work::Ends },
    Answer { effects: Vec<String> },
    Reveal,
    Stop,
    Undo,
    Redo,
    GoTo { step: usize },
}

#[derive(Deserialize)]
struct Request {
    /// The revision that the page shows.
    revision: u64,
    #[serde(rename = "do")]
    deed: Deed,
}

async fn perform(State(app): Shared, content: Bytes) -> Answer {
    let Request { revision, deed } = body(&content)?;
    if app.session().book.revision != revision && !matches!(deed, Deed::Stop) {
        return Err(Refusal::conflict(
            "the session was changed in another tab; look at what it is now and try again",
        ));
    }
    match deed {
        Deed::TakeFiles => work::take_files(&app)?,
        Deed::Start { name } => work::take_start(&app, &name)?,
        Deed::Fit { model, plays } => work::fit(&app, &model, plays)?,
        Deed::Add { effect } => work::add(&app, &effect)?,
        Deed::Diagnose => work::diagnose(&app)?,
        Deed::Report => work::report(&app)?,
        Deed::Table { ends } => work::table(&app, &ends)?,
        Deed::Answer { effects } => {
            riddle::answer(&app, &effects)?;
            app.changed();
        }
        Deed::Reveal => {
            riddle::reveal(&app)?;
            app.changed();
        }
        Deed::Stop => jobs::stop(&app)?,
        Deed::Undo | Deed::Redo | Deed::GoTo { .. } => {
            walk(&mut app.session(), &deed)?;
            app.changed();
        }
    }
    Ok(Json(json!({})).into_response())
}

/// Moves along the tree of steps.
fn walk(session: &mut Session, deed: &Deed) -> Result<(), Refusal> {
    let current = session.book.current;
    let step = |number: Option<usize>| number.and_then(|number| session.book.steps.get(number));
    let next = match deed {
        Deed::Undo => step(current)
            .and_then(|step| step.parent)
            .ok_or_else(|| Refusal::conflict("there is nothing to undo"))?,
        Deed::Redo => step(current)
            .and_then(|step| step.redo)
            .ok_or_else(|| Refusal::conflict("there is nothing to redo"))?,
        Deed::GoTo { step } => {
            session.step(*step)?;
            *step
        }
        _ => return Ok(()),
    };
    // Redo leads back to where one came from.
    let mut child = next;
    while let Some(parent) = session.book.steps[child].parent {
        session.book.steps[parent].redo = Some(child);
        child = parent;
    }
    session.book.current = Some(next);
    session.save()
}

/// A record as it was brought or taken, as few points.
async fn raw(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let index: usize = number(&parameters, "record")?;
    let width: usize = number(&parameters, "width")?;
    let uploaded = parameters.get("of").is_some_and(|of| of == "files");
    aside(move || {
        let session = app.session();
        let absent = || Refusal::absent("there is no such record");
        let records: Vec<&hysteron_data::Record> = if uploaded {
            session.uploads.files.iter().filter_map(|file| file.read.as_ref().ok()).flat_map(|read| &read.0).collect()
        } else {
            session.dataset.iter().flat_map(|dataset| &dataset.records).collect()
        };
        let record = records.get(index).ok_or_else(absent)?;
        let (first, len) = window(&parameters, record.start_s, record.period_s, record.len());
        let time = |k: usize| record.start_s + k as f64 * record.period_s;
        let points = series::columns(first, len, width, time, &[&|k| record.voltage_v[k], &|k| record.position_um[k]]);
        Ok(Json(json!({ "points": points, "loop": series::path(&record.voltage_v[first..first + len], &record.position_um[first..first + len]) })).into_response())
    })
    .await
}

/// The samples between `from` and `to` seconds, with a neighbour on either side; all without them.
fn window(parameters: &HashMap<String, String>, start_s: f64, period_s: f64, len: usize) -> (usize, usize) {
    let at = |name: &str| number::<f64>(parameters, name).ok().filter(|t| t.is_finite());
    let index = |t: f64| ((t - start_s) / period_s).clamp(0.0, len as f64);
    let first = at("from")
        .map_or(0, |t| (index(t).floor() as usize).saturating_sub(1))
        .min(len.saturating_sub(2));
    let end = at("to").map_or(len, |t| (index(t).ceil() as usize + 2).min(len));
    (first, end.saturating_sub(first).max(2).min(len - first))
}

/// The comparison of a step: the same text as `hysteron compare --json`.
async fn compare(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step")?;
    aside(move || {
        let comparison = work::comparison(&app, step)?;
        let text = serde_json::to_string_pretty(&*comparison).map_err(Refusal::unusable)? + "\n";
        Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response())
    })
    .await
}

/// The comparison in sentences, the model's parameters, and the commands.
async fn words(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let number = number(&parameters, "step")?;
    aside(move || {
        let comparison = work::comparison(&app, number)?;
        let session = app.session();
        let model = session.model(number)?;
        let step = session.step(number)?;
        let (data, file) = (work::data_word(&session), &step.model);
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
            "no_table": work::no_table(&model),
            "report_command": format!("hysteron report {data} {file} -o report.html"),
        }))
        .into_response())
    })
    .await
}

async fn spectrum(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step")?;
    aside(move || Ok(Json(&work::comparison(&app, step)?.spectrum).into_response())).await
}

/// Measured, modelled and error of one record, as few points, with its loop.
async fn plotted(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let (step, index, width) = (
        number(&parameters, "step")?,
        number::<usize>(&parameters, "record")?,
        number(&parameters, "width")?,
    );
    aside(move || {
        let comparison = work::comparison(&app, step)?;
        let record = comparison
            .records
            .get(index)
            .ok_or_else(|| Refusal::absent(format!("there is no record {index}")))?;
        let s = &record.series;
        let period_s = s.time_s.get(1).zip(s.time_s.first()).map_or(1.0, |(b, a)| b - a);
        let (first, len) = window(
            &parameters,
            s.time_s.first().copied().unwrap_or(0.0),
            period_s,
            s.time_s.len(),
        );
        let points = series::columns(
            first,
            len,
            width,
            |k| s.time_s[k],
            &[&|k| s.measured[k], &|k| s.modelled[k], &|k| {
                s.measured[k] - s.modelled[k]
            }],
        );
        let all = first..first + len;
        let at = |x: &f64| s.time_s.partition_point(|t| t < x).min(s.time_s.len() - 1);
        let places: Vec<usize> = points.x.iter().map(at).collect();
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

/// What the error in a stretch is, and what could make it.
async fn region(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let (step, index) = (number(&parameters, "step")?, number::<usize>(&parameters, "record")?);
    aside(move || {
        let comparison = work::comparison(&app, step)?;
        let record = comparison
            .records
            .get(index)
            .ok_or_else(|| Refusal::absent(format!("there is no record {index}")))?;
        let time = &record.series.time_s;
        let period_s = time.get(1).zip(time.first()).map_or(1.0, |(b, a)| b - a);
        let (first, len) = window(&parameters, time.first().copied().unwrap_or(0.0), period_s, time.len());
        let region = hysteron_diagnose::region(record, first..first + len, comparison.noise_rms_um)
            .ok_or_else(|| Refusal::unusable("fewer than eight samples; select more"))?;
        Ok(Json(region).into_response())
    })
    .await
}

/// A step's diagnosis: the same text as `hysteron diagnose --json`, and its words.
async fn diagnosis(State(app): Shared, Query(parameters): Parameters) -> Answer {
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
    let read: hysteron_diagnose::diagnosis::Diagnosis =
        serde_json::from_str(&text).map_err(|error| Refusal::disk(&file, &error))?;
    let read_names: Vec<String> = read.ranking.iter().map(|effect| effect.effect.clone()).collect();
    let signatures: Vec<Signature> = tokio::fs::read_to_string(&shown)
        .await
        .ok()
        .and_then(|text| serde_json::from_str(&text).ok())
        .unwrap_or_default();
    let bounds: Vec<_> = {
        let (dataset, model) = {
            let session = app.session();
            (session.data()?, session.model(step)?)
        };
        aside(move || {
            Ok(read_names
                .iter()
                .map(|name| explain::bounds(&dataset, &model, name))
                .collect())
        })
        .await?
    };
    Ok(Json(json!({
        "numbers": numbers,
        "bounds": bounds,
        "signatures": signatures,
        "verdict": hysteron_report::verdict_sentence(&read),
        "lines": hysteron_report::diagnosis_lines(&read),
    }))
    .into_response())
}

async fn effects() -> Json<Value> {
    Json(explain::catalogue())
}

async fn effect(State(app): Shared, Query(parameters): Parameters) -> Answer {
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

async fn download(State(app): Shared, Path(what): Path<String>, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step");
    let (name, kind, bytes): Download = aside(move || match what.as_str() {
        "model" => export::model(&app, step?),
        "report" => export::report(&app, step?),
        "table" => export::table(&app, step?),
        "next" => export::next_record(&app, step?),
        "session" => export::session(&app),
        _ => Err(Refusal::absent("known are model, report, table, next, session")),
    })
    .await?;
    let headers = [
        (header::CONTENT_TYPE, kind.to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
    ];
    Ok((headers, bytes).into_response())
}
