//! The board at the other end of a cable, or a simulated one: watched, asked, recorded into the data, given another table.

mod recorded;

use crate::api::{Answer, Parameters, Shared, aside, body, number};
use crate::controller::stage;
use crate::error::Refusal;
use crate::place::{Of, Place};
use crate::{App, jobs, series};
use axum::Json;
use axum::body::Bytes;
use axum::extract::{Query, State};
use axum::response::IntoResponse;
use hysteron_board::live::{Answered, Ask, Live, Status};
use hysteron_board::scope::{Channel, Scope, Window};
use hysteron_board::slots::{packed, upload};
use hysteron_board::telemetry::hex;
use hysteron_board::{BoardError, Mode};
use hysteron_data::Role;
use hysteron_diagnose::density;
use hysteron_table::Table;
use hysteron_trials::recording::Recorded;
pub(crate) use recorded::takes_known;
use recorded::{Recording, Run, Wanted, keep, take_in};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::{Arc, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A page that asks for news waits so long for them: ten pictures a second.
const NEWS: Duration = Duration::from_millis(100);
/// Without a page that asks the loop is stopped after so long.
const UNSEEN: Duration = Duration::from_secs(5);
/// Longest wait for the loop to come to rest.
const REST: Duration = Duration::from_secs(5);
/// New samples that are news: a tenth of a second at 50 kHz.
const NEW_SAMPLES: u64 = 5000;
/// The job that sends a table.
const SENDING: &str = "sending the table";

/// What is connected.
pub(crate) struct OnBench {
    live: Arc<Live>,
    /// The simulated stage, and what holds it.
    simulated: Option<(&'static str, Box<dyn Send + Sync>)>,
    /// When a page has looked last.
    seen: Instant,
    /// The recording that runs.
    asked: Option<Recording>,
    /// What was recorded last and is not among the data yet.
    came: Option<Recorded>,
    /// Every recording of this connection.
    runs: Vec<Run>,
    /// What went wrong on the board's side of a recording.
    fault: Option<String>,
}

/// What a page asks of the board.
#[derive(Debug, Deserialize)]
#[serde(tag = "what", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Deed {
    Connect {
        from: String,
    },
    /// The law of a table at a simulated stage.
    Simulate {
        stage: String,
        #[serde(default)]
        of: Of,
    },
    Leave,
    Start,
    Stop,
    Clear,
    Gains {
        axis: u8,
        proportional_v_per_um: f64,
        integral_v_per_um_s: f64,
    },
    Play {
        wish: Wanted,
    },
    Record {
        wish: Wanted,
    },
    /// What was recorded goes to the data.
    Keep {
        role: Role,
    },
    /// The table of a controller into the slot that is not in use; then the board starts anew.
    Upload {
        #[serde(default)]
        of: Of,
    },
}

impl App {
    fn bench(&self) -> MutexGuard<'_, Option<OnBench>> {
        self.bench.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a board is connected.
    pub(crate) fn has_board(&self) -> bool {
        self.bench().is_some()
    }

    fn live(&self) -> Result<Arc<Live>, Refusal> {
        let bench = self.bench();
        let on = bench
            .as_ref()
            .ok_or_else(|| Refusal::conflict("no board is connected"))?;
        Ok(Arc::clone(&on.live))
    }
}

/// Stops the loop where no page has looked for a while: whoever closes the page leaves the stage at rest.
pub(crate) async fn watch(app: Arc<App>) {
    loop {
        tokio::time::sleep(UNSEEN / 5).await;
        let gone = app.bench().take_if(|on| on.seen.elapsed() > UNSEEN);
        if gone.is_some() {
            // The end of a connection may wait for the other side: a thread of its own does.
            let told = Arc::clone(&app);
            tokio::task::spawn_blocking(move || {
                drop(gone);
                told.changed();
            });
        }
    }
}

/// What the board does, soon after there is something new, with the picture of its last ticks.
pub(crate) async fn look(State(app): Shared, Query(parameters): Parameters) -> Answer {
    aside(move || {
        let Ok(live) = app.live() else {
            return Ok(Json(absent(&app)).into_response());
        };
        // A page that draws wants to know soon; one that is elsewhere keeps the board going.
        let draws = parameters.contains_key("ticks");
        let had = number::<u64>(&parameters, "samples").unwrap_or(0);
        let at_once = parameters.contains_key("now");
        let status = live.wait(if draws { NEWS } else { 10 * NEWS }, |status| {
            let samples = status.axes.first().map_or(0, |axis| axis.samples);
            at_once || (draws && samples > had + NEW_SAMPLES)
        });
        let recorded = take_in(&app);
        let mut bench = app.bench();
        let Some(on) = bench.as_mut() else {
            return Ok(Json(absent(&app)).into_response());
        };
        on.seen = Instant::now();
        let mut said = said(on, &status);
        drop(bench);
        if recorded {
            app.changed();
        }
        if draws {
            said["scope"] = scope(&live, &parameters)?;
        }
        Ok(Json(said).into_response())
    })
    .await
}

/// No board is connected, or it is being sent a table.
fn absent(app: &App) -> Value {
    let job = app.job();
    let stages: Vec<&str> = app.stages.iter().map(|stage| stage.name).collect();
    json!({"connected": false, "sending": job.running && job.kind == SENDING, "stages": stages})
}

fn mode(mode: Mode) -> &'static str {
    match mode {
        Mode::Off => "at rest",
        Mode::Rising => "rising",
        Mode::Running => "running",
        Mode::Falling => "falling",
    }
}

fn said(on: &OnBench, status: &Status) -> Value {
    let axes = status.axes.iter().map(|axis| {
        json!({
            "mode": mode(axis.mode), "running": axis.mode == Mode::Running, "at_rest": axis.mode == Mode::Off,
            "fault": axis.fault.map(|fault| format!("{fault:?}")), "bank": axis.bank,
            "samples": axis.samples, "lost": axis.lost, "restarts": axis.restarts,
        })
    });
    let tables = status.tables.iter().map(|tables| {
        let one = tables.iter().map(|hello| {
            json!({"table": hex(&hello.hash), "input_um": [hello.input_min_um, hello.input_max_um], "bank": hello.bank})
        });
        one.collect::<Vec<_>>()
    });
    let answers = status.answers.iter().map(answer);
    json!({
        "connected": true,
        "from": on.live.from(),
        "stage": on.simulated.as_ref().map(|(name, _)| name),
        "name": status.name,
        "rate_hz": status.rate_hz,
        "axes": axes.collect::<Vec<_>>(),
        "tables": tables.collect::<Vec<_>>(),
        "foreign_bytes": status.foreign_bytes,
        "silent_s": status.silent_s,
        "ended": status.ended,
        "waits_for": status.waits_for,
        "answers": answers.collect::<Vec<_>>(),
        "recording": status.recording,
        "records": on.asked.as_ref().map(|asked| json!({"words": asked.words, "command": asked.command})),
        "came": on.came.as_ref().map(|Recorded { counted, .. }| {
            json!({"samples": counted.samples, "lost": counted.lost, "seconds": counted.seconds, "delay_s": counted.known_delay_s})
        }),
        "runs": on.runs,
        "fault": on.fault,
    })
}

fn answer(answered: &Answered) -> Value {
    json!({"what": answered.what, "tick": answered.tick, "accepted": answered.accepted})
}

/// The picture of the last ticks, or of those about a trigger.
fn scope(live: &Live, parameters: &HashMap<String, String>) -> Result<Value, Refusal> {
    let axis = number::<usize>(parameters, "axis").unwrap_or(0);
    let level = || number::<f64>(parameters, "level");
    let trigger = match parameters.get("trigger").map_or("none", String::as_str) {
        "none" => None,
        "reference" => Some((Channel::Reference, level()?)),
        "position" => Some((Channel::Position, level()?)),
        "command" => Some((Channel::Command, level()?)),
        other => {
            return Err(Refusal::bad(format!(
                "trigger = {}: allowed are none, reference, position, command",
                other.chars().take(40).collect::<String>()
            )));
        }
    };
    let window = Window {
        ticks: number(parameters, "ticks")?,
        trigger,
    };
    let Some(scope) = live.scope(axis, &window) else {
        return Ok(Value::Null);
    };
    let spectrum = parameters.contains_key("spectrum").then(|| spectrum(&scope));
    let errors_um: Vec<f64> = scope.errors_um().collect();
    let columns: [&dyn Fn(usize) -> f64; 4] = [
        &|k| scope.reference_um[k],
        &|k| scope.position_um[k],
        &|k| errors_um[k],
        &|k| scope.command_v[k],
    ];
    let width = number(parameters, "width")?;
    let points = series::columns(0, errors_um.len(), width, |k| k as f64 * scope.period_s, &columns);
    let figures = scope.figures().map(|figures| {
        json!({"ticks": figures.ticks, "rms_um": figures.rms_um, "most_um": figures.most_um, "span_um": figures.span_um})
    });
    Ok(json!({
        "first": scope.first,
        "triggered": scope.triggered,
        "points": points,
        "figures": figures,
        "spectrum": spectrum,
    }))
}

/// Densities of position and error since the last gap.
fn spectrum(scope: &Scope) -> Value {
    let gap = scope.position_um.iter().rposition(|um| um.is_nan());
    let from = gap.map_or(0, |gap| gap + 1);
    let errors_um: Vec<f64> = scope.errors_um().skip(from).collect();
    let (frequency_hz, position) = density(&scope.position_um[from..], scope.period_s);
    let (_, error) = density(&errors_um, scope.period_s);
    json!({"frequency_hz": frequency_hz, "position_um_per_rthz": position, "error_um_per_rthz": error})
}

/// Does what a page asks.
pub(crate) async fn perform(State(app): Shared, content: Bytes) -> Answer {
    let deed: Deed = body(&content)?;
    let own = Arc::clone(&app);
    aside(move || act(&own, deed)).await?;
    app.changed();
    Ok(Json(json!({})).into_response())
}

fn act(app: &Arc<App>, deed: Deed) -> Result<(), Refusal> {
    let refused = |error: BoardError| Refusal::unusable(error);
    match deed {
        Deed::Connect { from } => connect(app, &from, None),
        Deed::Simulate { stage: name, of } => {
            let (_, text) = table(app, of)?;
            let stage = &app.stages[stage(app, &name)?];
            let (address, board) = (stage.serve)(&text).map_err(Refusal::unusable)?;
            connect(app, &address, Some((stage.name, board)))
        }
        Deed::Leave => {
            let gone = app.bench().take();
            drop(gone);
            Ok(())
        }
        Deed::Start => app.live()?.ask(Ask::Start).map_err(refused),
        Deed::Stop => app.live()?.ask(Ask::Stop).map_err(refused),
        Deed::Clear => app.live()?.ask(Ask::Clear).map_err(refused),
        Deed::Gains {
            axis,
            proportional_v_per_um,
            integral_v_per_um_s,
        } => {
            for (name, value) in [("K_p", proportional_v_per_um), ("K_i", integral_v_per_um_s)] {
                if !(0.0..=1e9).contains(&value) {
                    return Err(Refusal::unusable(format!("{name} = {value}: allowed are 0 to 1e9")));
                }
            }
            let gains = [proportional_v_per_um as f32, integral_v_per_um_s as f32];
            app.live()?.ask(Ask::Gains(axis, gains)).map_err(refused)
        }
        Deed::Play { wish } => {
            let live = app.live()?;
            let (wishes, ..) = wish.read(live.from())?;
            live.ask(Ask::Play(&wishes)).map_err(refused)
        }
        Deed::Record { wish } => {
            let live = app.live()?;
            let (wishes, seconds, recording) = wish.read(live.from())?;
            live.record(seconds, &wishes).map_err(refused)?;
            if let Some(on) = app.bench().as_mut() {
                (on.asked, on.fault) = (Some(recording), None);
            }
            Ok(())
        }
        Deed::Keep { role } => keep(app, role),
        Deed::Upload { of } => send(app, of),
    }
}

fn connect(app: &App, from: &str, simulated: Option<(&'static str, Box<dyn Send + Sync>)>) -> Result<(), Refusal> {
    if app.bench().is_some() {
        return Err(Refusal::conflict("a board is connected; disconnect it first"));
    }
    let live = Live::open(from.trim()).map_err(Refusal::unusable)?;
    *app.bench() = Some(OnBench {
        live: Arc::new(live),
        simulated,
        seen: Instant::now(),
        asked: None,
        came: None,
        runs: Vec::new(),
        fault: None,
    });
    Ok(())
}

/// The table of a controller, with its name.
fn table(app: &App, of: Of) -> Result<(String, String), Refusal> {
    let session = app.session();
    let place = Place::of(&session, of)?;
    let name = place.table();
    if !place.has_table(&session.book) {
        return Err(Refusal::conflict("no table yet; make it on the page Controller"));
    }
    let file = session.folder.join(&name);
    let text = std::fs::read_to_string(&file).map_err(|error| Refusal::disk(&file, &error))?;
    Ok((name, text))
}

/// Stops the loop, sends the table, and connects again.
fn send(app: &Arc<App>, of: Of) -> Result<(), Refusal> {
    let (name, text) = table(app, of)?;
    let bytes = Table::parse(&text)
        .and_then(|table| packed(&table, &text))
        .map_err(|error| Refusal::unusable(format!("{name}: {error}")))?;
    let live = app.live()?;
    let from = live.from().to_owned();
    live.ask(Ask::Stop).map_err(Refusal::unusable)?;
    let rests = |status: &Status| status.axes.iter().all(|axis| axis.mode == Mode::Off);
    if !rests(&live.wait(REST, rests)) {
        return Err(Refusal::conflict(
            "the loop does not come to rest; the table was not sent",
        ));
    }
    drop(live);
    let own = Arc::clone(app);
    jobs::start(app, SENDING, move |progress| {
        let Some(OnBench {
            mut live,
            simulated,
            runs,
            came,
            ..
        }) = own.bench().take()
        else {
            return Err(Refusal::conflict("no board is connected"));
        };
        // A server of a probe has one listener at a time: the page that looks at this moment has its answer first.
        while let Err(looked_at) = Arc::try_unwrap(live) {
            live = looked_at;
            std::thread::sleep(NEWS / 10);
        }
        let sent = upload(&from, &bytes, true, &mut |share| progress.at(0.9 * share, &name));
        let again = Live::open(&from).map_err(Refusal::unusable)?;
        *own.bench() = Some(OnBench {
            live: Arc::new(again),
            simulated,
            seen: Instant::now(),
            asked: None,
            came,
            runs,
            fault: None,
        });
        let sent = sent.map_err(Refusal::unusable)?;
        sent.taken
            .map_err(|refused| Refusal::unusable(BoardError::TableRefused { to: from, refused }))?;
        match sent.runs {
            Some(true) => Ok(()),
            _ => Err(Refusal::unusable(
                "the board has the table and does not say that it runs with it; look at it",
            )),
        }
    })
}
