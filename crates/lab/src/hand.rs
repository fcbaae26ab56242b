//! A step's model moved by hand: its parameters within their bounds, its run over a record of the user's own beside the fitted one,
//! and the moved model as a step of its own.

use crate::App;
use crate::api::{Answer, Parameters, Shared, aside, number};
use crate::book::{Recipe, Turn};
use crate::error::Refusal;
use crate::session::Fitted;
use crate::{jobs, series, views, work};
use axum::Json;
use axum::extract::{Query, State};
use axum::response::IntoResponse;
use hysteron_data::Dataset;
use hysteron_diagnose::{ByHand, Start};
use hysteron_identify::{InitialState, Knob, MOVED_BY_HAND, Model, Turned};
use serde_json::{Value, json};
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

/// A step's model in somebody's hand.
pub(crate) struct InHand {
    dataset: Arc<Dataset>,
    model: ByHand,
    /// The starts that the fitted model found, by record: while a slider moves, none is looked for.
    starts: Mutex<BTreeMap<usize, InitialState>>,
}

impl InHand {
    fn start(&self, index: usize) -> Result<InitialState, Refusal> {
        let mut starts = self.starts.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(&known) = starts.get(&index) {
            return Ok(known);
        }
        let found = self.model.start(self.record(index)?);
        starts.insert(index, found);
        Ok(found)
    }

    fn record(&self, index: usize) -> Result<&hysteron_data::Record, Refusal> {
        let record = self.dataset.records.get(index);
        record.ok_or_else(|| Refusal::absent(format!("there is no record {index}")))
    }
}

/// The model of a step, taken in hand once and kept for the next request.
fn taken(app: &App, step: usize) -> Result<Arc<InHand>, Refusal> {
    let (dataset, model) = {
        let mut session = app.session();
        session.step(step)?;
        if let Some((_, there)) = session.in_hand.as_ref().filter(|(number, _)| *number == step) {
            return Ok(Arc::clone(there));
        }
        (session.data_of(step)?, session.model(step)?)
    };
    let taken = Arc::new(InHand {
        model: ByHand::new(&dataset, model),
        dataset,
        starts: Mutex::default(),
    });
    app.session().in_hand = Some((step, Arc::clone(&taken)));
    Ok(taken)
}

/// The values that a request gives, in the order of the parameters.
fn values(parameters: &HashMap<String, String>) -> Result<Option<Vec<f64>>, Refusal> {
    let Some(text) = parameters.get("values") else {
        return Ok(None);
    };
    let value = |text: &str| {
        text.parse().map_err(|_| {
            Refusal::bad(format!(
                "values: `{}` is no number; give one for each parameter, with commas between",
                text.chars().take(40).collect::<String>()
            ))
        })
    };
    text.split(',').map(value).collect::<Result<Vec<f64>, _>>().map(Some)
}

/// Without values what can be moved, with the measured and the fitted series; with them the moved model's series and error. `rest` says that
/// nothing moves any more: then the record's start is chosen anew, as a comparison does.
pub(crate) async fn by_hand(State(app): Shared, Query(parameters): Parameters) -> Answer {
    let step = number(&parameters, "step")?;
    let index: usize = number(&parameters, "record")?;
    let width: usize = number(&parameters, "width")?;
    let values = values(&parameters)?;
    aside(move || {
        let taken = taken(&app, step)?;
        let shown = match values {
            None => fitted(&app, (step, index, width), &taken, &parameters)?,
            Some(values) => moved(&taken, (index, width), &values, &parameters)?,
        };
        Ok(Json(shown).into_response())
    })
    .await
}

/// Of a picture's numbers a pixel needs no more digits than these.
fn of_a_picture(series: &[f64]) -> Vec<f32> {
    series.iter().map(|value| *value as f32).collect()
}

fn fitted(
    app: &App,
    (step, index, width): (usize, usize, usize),
    taken: &InHand,
    parameters: &HashMap<String, String>,
) -> Result<Value, Refusal> {
    let comparison = work::comparison(app, step)?;
    let (record, first, len) = views::stretch(&comparison, index, parameters)?;
    let s = &record.series;
    let error = |k: usize| s.measured[k] - s.modelled[k];
    let all: [&dyn Fn(usize) -> f64; 3] = [&|k| s.measured[k], &|k| s.modelled[k], &error];
    let points = series::columns(first, len, width, |k| s.at_s(k), &all);
    Ok(json!({
        "knobs": taken.model.knobs().iter().map(knob).collect::<Vec<_>>(),
        "nrmse_percent": record.nrmse_percent,
        "x": points.x,
        "y": points.y.iter().map(|series| of_a_picture(series)).collect::<Vec<_>>(),
        "samples": points.samples,
    }))
}

fn knob(knob: &Knob) -> Value {
    json!({
        "effect": knob.effect(), "name": knob.name, "unit": knob.unit, "what": knob.what,
        "min": knob.min, "max": knob.max, "value": knob.value,
    })
}

fn moved(
    taken: &InHand,
    (index, width): (usize, usize),
    values: &[f64],
    parameters: &HashMap<String, String>,
) -> Result<Value, Refusal> {
    let start = match parameters.contains_key("rest") {
        true => Start::Chosen,
        false => Start::Known(taken.start(index)?),
    };
    let record = taken.record(index)?;
    let played = taken
        .model
        .play(record, values, start)
        .map_err(|error| Refusal::bad(error.to_string()))?;
    let (first, len) = views::window(parameters, record.start_s, record.period_s, record.len());
    let measured = taken.model.measured(record);
    let error = |k: usize| measured[k] - played.modelled[k];
    let all: [&dyn Fn(usize) -> f64; 2] = [&|k| played.modelled[k], &error];
    let points = series::columns(first, len, width, |_| 0.0, &all);
    Ok(json!({
        "nrmse_percent": played.nrmse_percent,
        "y": points.y.iter().map(|series| of_a_picture(series)).collect::<Vec<_>>(),
    }))
}

/// Keeps the current step's model, moved by hand, as a step of its own.
pub(crate) fn keep(app: &Arc<App>, values: &[f64]) -> Result<(), Refusal> {
    let (dataset, number, model) = {
        let session = app.session();
        let work::Base { dataset, number, model } = work::Base::of(&session)?;
        if !session.book.fresh(session.step(number)?) {
            return Err(Refusal::conflict(
                "this step was fitted before the data grew; fit it anew, then move what comes of it",
            ));
        }
        (dataset, number, model)
    };
    let recipe = recipe(&model, &dataset, values)?;
    let own = Arc::clone(app);
    jobs::start(app, "keeping what was moved", move |progress| {
        let kept = work::perform(recipe, &dataset, Some(&model), &|share, what| progress.at(share, what))?;
        own.session().take_steps(Some(number), vec![kept])
    })
}

/// What moves a model to these values, and what may be refused of it before anything is done.
fn recipe(model: &Model, dataset: &Dataset, values: &[f64]) -> Result<Recipe, Refusal> {
    let (_, turned) = model.moved_to_keep(dataset, values).map_err(Refusal::unusable)?;
    let turn = |turned: &Turned| Turn {
        parameter: turned.knob.full_name(),
        to: turned.to,
    };
    Ok(Recipe::Moved {
        turns: turned.iter().map(turn).collect(),
    })
}

/// Carries out what was moved on a model: the same one, or one that was fitted anew.
pub(crate) fn carry_out(
    turns: &[Turn],
    dataset: &Dataset,
    before: &Model,
    at: &(dyn Fn(f64, &str) + Sync),
) -> Result<Fitted, Refusal> {
    at(0.1, MOVED_BY_HAND);
    let knobs = before.knobs(dataset);
    if let Some(gone) = turns
        .iter()
        .find(|turn| knobs.iter().all(|knob| knob.full_name() != turn.parameter))
    {
        return Err(Refusal::unusable(format!(
            "{} was moved by hand, and the model fitted anew has nothing of this name to move; go to the step before it",
            gone.parameter
        )));
    }
    let value = |knob: &Knob| {
        let turn = turns.iter().find(|turn| turn.parameter == knob.full_name());
        turn.map_or(knob.value, |turn| turn.to)
    };
    let values: Vec<f64> = knobs.iter().map(value).collect();
    let (model, turned) = before.moved_to_keep(dataset, &values).map_err(Refusal::unusable)?;
    let comparison = hysteron_diagnose::compare(dataset, &model, &|share| at(0.3 + 0.7 * share, "comparing"));
    Ok(Fitted {
        recipe: Recipe::Moved { turns: turns.to_vec() },
        title: MOVED_BY_HAND.to_owned(),
        model,
        said: Some(Turned::words(&turned)),
        comparison,
    })
}
