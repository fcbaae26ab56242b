//! Every address that is answered.

use crate::bench::Bench;
use crate::controller::{self, Along, Wished};
use crate::error::Refusal;
use crate::export::{self, Download};
use crate::guard::{self, Guard};
use crate::place::{Of, Place};
use crate::reading::Reading;
use crate::undo::{self, Way};
use crate::{
    App, assets, board, bring, came_back, campaign, draft, grow, hand, image, jobs, learn, projects, riddle, rungs,
    state, views, work,
};
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use hysteron_data::Role;
use serde::Deserialize;
use serde_json::json;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use tower::Layer;

/// Largest body of a request that is no file.
const BODY_LIMIT: usize = 64 << 10;

/// How long a page waits for news before it asks again.
const PATIENCE: Duration = Duration::from_secs(20);

pub(crate) type Shared = State<Arc<App>>;
pub(crate) type Answer = Result<Response, Refusal>;
pub(crate) type Parameters = Query<HashMap<String, String>>;

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
        .route("/api/upload", post(bring::upload).layer(DefaultBodyLimit::disable()))
        .route(
            "/api/campaign/upload",
            post(came_back::upload).layer(DefaultBodyLimit::disable()),
        )
        .route("/api/campaign/usual", get(campaign_usual))
        .route("/api/reading", post(bring::reading))
        .route("/api/use", post(bring::use_as))
        .route("/api/forget", post(bring::forget))
        .route("/api/do", post(perform))
        .route("/api/projects", get(projects))
        .route("/api/raw", get(views::raw))
        .route("/api/compare", get(views::compare))
        .route("/api/words", get(views::words))
        .route("/api/spectrum", get(views::spectrum))
        .route("/api/small", get(views::small))
        .route("/api/told", get(views::told))
        .route("/api/series", get(views::plotted))
        .route("/api/by-hand", get(hand::by_hand))
        .route("/api/controller", get(views::controller))
        .route("/api/response", get(views::response))
        .route("/api/correlation", get(views::correlation))
        .route("/api/region", get(views::region))
        .route("/api/diagnosis", get(views::diagnosis))
        .route("/api/effects", get(views::effects))
        .route("/api/effect", get(views::effect))
        .route(
            "/api/own-effect",
            get(draft::show)
                .post(draft::keep)
                .layer(DefaultBodyLimit::max(draft::BODY_LIMIT)),
        )
        .route("/api/board", get(board::look).post(board::perform))
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
pub(crate) async fn aside<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Refusal> + Send + 'static,
) -> Result<T, Refusal> {
    tokio::task::spawn_blocking(work).await.unwrap_or_else(|_| {
        Err(Refusal::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            "a fault of the program; nothing was changed",
        ))
    })
}

pub(crate) fn number<T: std::str::FromStr>(parameters: &HashMap<String, String>, name: &str) -> Result<T, Refusal> {
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

/// The number of a parameter that may be left out.
pub(crate) fn optional<T: std::str::FromStr>(
    parameters: &HashMap<String, String>,
    name: &str,
) -> Result<Option<T>, Refusal> {
    parameters.get(name).map(|_| number(parameters, name)).transpose()
}

pub(crate) fn body<T: for<'a> Deserialize<'a>>(bytes: &Bytes) -> Result<T, Refusal> {
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

/// What a person can do.
#[derive(Deserialize)]
#[serde(tag = "what", rename_all = "kebab-case", deny_unknown_fields)]
enum Deed {
    TakeFiles,
    AddFiles,
    Role {
        record: String,
        role: Role,
    },
    Start {
        name: String,
    },
    Fit {
        model: String,
        plays: usize,
    },
    Add {
        effect: String,
    },
    AddOwn,
    Refit,
    Learn {
        model: String,
        plays: usize,
    },
    KeepMoved {
        values: Vec<f64>,
    },
    Remove {
        step: usize,
    },
    Keep {
        step: usize,
    },
    Name {
        step: usize,
        name: String,
        note: String,
    },
    NewProject {
        name: String,
    },
    OpenProject {
        name: String,
    },
    Diagnose,
    Report,
    Design {
        wishes: Wished,
        #[serde(default)]
        of: Of,
    },
    Track {
        along: Along,
        #[serde(default)]
        of: Of,
    },
    Table {
        bench: Bench,
        #[serde(default)]
        of: Of,
    },
    Image {
        board: String,
        #[serde(default)]
        of: Of,
    },
    CampaignPlan {
        asked: campaign::Asked,
    },
    CampaignReading {
        reading: Reading,
    },
    CampaignLook {
        looked: campaign::Looked,
    },
    CampaignForget {
        file: String,
    },
    CampaignEnd,
    Answer {
        effects: Vec<String>,
    },
    Reveal,
    Stop,
    Undo,
    Redo,
    GoTo {
        step: usize,
    },
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
        Deed::TakeFiles => grow::take_files(&app)?,
        Deed::AddFiles => grow::add_files(&app)?,
        Deed::Role { record, role } => grow::change_role(&app, &record, role)?,
        Deed::Start { name } => grow::take_start(&app, &name)?,
        Deed::Fit { model, plays } => work::fit(&app, &model, plays)?,
        Deed::Add { effect } => work::add(&app, &effect)?,
        Deed::AddOwn => draft::add(&app)?,
        Deed::Refit => work::refit(&app)?,
        Deed::Learn { model, plays } => learn::learn(&app, &model, plays)?,
        Deed::KeepMoved { values } => hand::keep(&app, &values)?,
        Deed::Remove { step } => {
            rungs::remove(&mut app.session(), step)?;
            app.changed();
        }
        Deed::Keep { step } => {
            rungs::keep(&mut app.session(), step)?;
            app.changed();
        }
        Deed::Name { step, name, note } => {
            rungs::name(&mut app.session(), step, &name, &note)?;
            app.changed();
        }
        Deed::NewProject { name } => aside(move || projects::make(&app, &name)).await?,
        Deed::OpenProject { name } => aside(move || projects::open(&app, &name)).await?,
        Deed::Diagnose => work::diagnose(&app)?,
        Deed::Report => work::report(&app)?,
        Deed::Design { wishes, of } => controller::make(&app, of, &wishes)?,
        Deed::Track { along, of } => controller::track(&app, of, &along)?,
        Deed::Table { bench, of } => controller::table(&app, of, &bench)?,
        Deed::Image { board, of } => image::make(&app, of, &board)?,
        Deed::CampaignPlan { asked } => campaign::plan(&app, &asked)?,
        Deed::CampaignReading { reading } => {
            let own = Arc::clone(&app);
            aside(move || came_back::read_so(&own, &reading)).await?;
            app.changed();
        }
        Deed::CampaignLook { looked } => campaign::look(&app, &looked)?,
        Deed::CampaignForget { file } => {
            came_back::forget(&app, &file)?;
            app.changed();
        }
        Deed::CampaignEnd => {
            campaign::forget_all(&app)?;
            app.changed();
        }
        Deed::Answer { effects } => {
            riddle::answer(&app, &effects)?;
            app.changed();
        }
        Deed::Reveal => {
            riddle::reveal(&app)?;
            app.changed();
        }
        Deed::Stop => jobs::stop(&app)?,
        Deed::Undo => undo::go(&app, Way::Undo)?,
        Deed::Redo => undo::go(&app, Way::Redo)?,
        Deed::GoTo { step } => {
            undo::walk(&mut app.session(), step)?;
            app.changed();
        }
    }
    Ok(Json(json!({})).into_response())
}

/// The projects, for their page.
async fn projects(State(app): Shared) -> Answer {
    aside(move || Ok(Json(projects::list(&app)).into_response())).await
}

/// What is known of the bench, for the fields of a campaign's plan.
async fn campaign_usual(State(app): Shared) -> Answer {
    aside(move || Ok(Json(campaign::usual(&app)).into_response())).await
}

async fn download(State(app): Shared, Path(what): Path<String>, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step");
    let (name, kind, bytes): Download = aside(move || match what.as_str() {
        "model" => export::model(&app, step?),
        "report" => export::report(&app, step?),
        "controller" => export::controller(&app, Place::asked(&parameters)?),
        "table" => export::table(&app, Place::asked(&parameters)?),
        "image" => {
            let board = parameters.get("board").map_or("", String::as_str);
            image::download(&app, Place::asked(&parameters)?, board)
        }
        "plan" => came_back::pass(&app, number(&parameters, "pass")?),
        "next" => export::next_record(&app, step?),
        "session" => export::session(&app),
        _ => Err(Refusal::absent(
            "known are model, report, controller, table, image, next, plan, session",
        )),
    })
    .await?;
    let headers = [
        (header::CONTENT_TYPE, kind.to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
    ];
    Ok((headers, bytes).into_response())
}
