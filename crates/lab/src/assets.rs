//! The page itself, inside the binary.

use crate::error::Refusal;
use axum::extract::Path;
use axum::http::header;
use axum::response::{IntoResponse, Response};

/// Name, type, content.
type Asset = (&'static str, &'static str, &'static str);

const JS: &str = "text/javascript; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";

macro_rules! asset {
    ($name:literal, $type:expr) => {
        ($name, $type, include_str!(concat!("../web/", $name)))
    };
}

const ASSETS: [Asset; 27] = [
    asset!("app.js", JS),
    asset!("api.js", JS),
    asset!("dom.js", JS),
    asset!("data.js", JS),
    asset!("compare.js", JS),
    asset!("plots.js", JS),
    asset!("picture.js", JS),
    asset!("map.js", JS),
    asset!("hand.js", JS),
    asset!("diagnose.js", JS),
    asset!("effects.js", JS),
    asset!("own.js", JS),
    asset!("riddle.js", JS),
    asset!("take.js", JS),
    asset!("numbers.js", JS),
    asset!("ladder.js", JS),
    asset!("form.js", JS),
    asset!("controller.js", JS),
    asset!("board.js", JS),
    asset!("campaign.js", JS),
    asset!("projects.js", JS),
    asset!("small.js", JS),
    asset!("stale.js", JS),
    asset!("tour.js", JS),
    asset!("style.css", CSS),
    asset!("vendor/uPlot.esm.js", JS),
    asset!("vendor/uPlot.min.css", CSS),
];

/// The page.
pub(crate) async fn index() -> Response {
    let html = include_str!("../web/index.html");
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], html).into_response()
}

/// A part of the page; nothing else can be named.
pub(crate) async fn asset(Path(name): Path<String>) -> Result<Response, Refusal> {
    let (_, kind, content) = ASSETS
        .iter()
        .find(|asset| asset.0 == name)
        .ok_or_else(|| Refusal::absent("there is no such part of the page"))?;
    Ok(([(header::CONTENT_TYPE, *kind)], *content).into_response())
}
