//! The long jobs: fit, add, fit anew, compare, diagnose, report.

use crate::App;
use crate::book::{Book, Recipe};
use crate::error::Refusal;
use crate::jobs::{self, Progress};
use crate::session::{Fitted, Session};
use crate::{draft, export, folder, hand, learn, series};
use hysteron_data::Dataset;
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_diagnose::{Comparison, Signature, signatures};
use hysteron_identify::effects::UnknownEffect;
use hysteron_identify::{Direction, EffectId, Family, FitOptions, Model};
use std::sync::Arc;

/// Most plays; as the command line.
const PLAYS: std::ops::RangeInclusive<usize> = 1..=64;

/// Columns of a card's picture.
const CARD_COLUMNS: usize = 300;

/// Fits a model as a new root.
pub(crate) fn fit(app: &Arc<App>, family: &str, plays: usize) -> Result<(), Refusal> {
    let family = hysteresis(family, plays)?;
    let dataset = app.session().data()?;
    let own = Arc::clone(app);
    jobs::start(app, "fitting", move |progress| {
        let fitted = perform(Recipe::Fit { family, plays }, &dataset, None, &|share, what| {
            progress.at(share, what);
        })?;
        own.session().take_steps(None, vec![fitted])
    })
}

/// The hysteresis model that a page names, with so many plays.
pub(crate) fn hysteresis(family: &str, plays: usize) -> Result<Family, Refusal> {
    if !PLAYS.contains(&plays) {
        return Err(Refusal::bad(format!(
            "{plays} plays: allowed are {} to {}",
            PLAYS.start(),
            PLAYS.end()
        )));
    }
    Family::ALL
        .into_iter()
        .find(|known| known.name() == family)
        .ok_or_else(|| {
            Refusal::bad(format!(
                "`{family}` is no model; known are {}",
                Family::ALL.map(Family::name).join(", ")
            ))
        })
}

/// Adds an effect to the current step's model; one that was fitted before the data grew is fitted anew first.
pub(crate) fn add(app: &Arc<App>, effect: &str) -> Result<(), Refusal> {
    let effect: EffectId = effect
        .parse()
        .map_err(|unknown: UnknownEffect| Refusal::bad(unknown.to_string()))?;
    add_by(app, Recipe::Add { effect })
}

/// Adds by a recipe to the current step's model.
pub(crate) fn add_by(app: &Arc<App>, recipe: Recipe) -> Result<(), Refusal> {
    let (dataset, plan) = {
        let session = app.session();
        let Base { dataset, number, .. } = Base::of(&session)?;
        (dataset, Plan::of(&session.book, number).and(recipe))
    };
    let own = Arc::clone(app);
    jobs::start(app, "adding", move |progress| {
        plan.carry_out(&own, &dataset, progress, 1.0)
    })
}

/// Fits the current step anew on the data as they are, and all steps that it is made of.
pub(crate) fn refit(app: &Arc<App>) -> Result<(), Refusal> {
    let (dataset, number, plan) = {
        let session = app.session();
        let Base { dataset, number, .. } = Base::of(&session)?;
        (dataset, number, Plan::of(&session.book, number))
    };
    if plan.missing.is_empty() && plan.there == Some(number) {
        return Err(Refusal::conflict("this step is fitted on the data as they are"));
    }
    let own = Arc::clone(app);
    jobs::start(app, "fitting anew", move |progress| {
        plan.carry_out(&own, &dataset, progress, 1.0)
    })
}

/// The current step, with the present data.
pub(crate) struct Base {
    pub(crate) dataset: Arc<Dataset>,
    pub(crate) number: usize,
    pub(crate) model: Model,
}

impl Base {
    pub(crate) fn of(session: &Session) -> Result<Self, Refusal> {
        let number = session
            .book
            .current
            .ok_or_else(|| Refusal::conflict("there is no model yet; fit one first"))?;
        Ok(Self {
            dataset: session.data()?,
            number,
            model: session.model(number)?,
        })
    }
}

/// The current step if it is on the present data, else the step that its recipes come to on them, which is the current one then.
pub(crate) fn up_to_date(app: &App, base: Base, progress: &Progress, whole: f64) -> Result<Base, Refusal> {
    let plan = Plan::of(&app.session().book, base.number);
    if plan.missing.is_empty() && plan.there == Some(base.number) {
        return Ok(base);
    }
    plan.carry_out(app, &base.dataset, progress, whole)?;
    Base::of(&app.session())
}

/// How one comes to a step on the present data: from a step that is there, by recipes that are to be carried out.
struct Plan {
    there: Option<usize>,
    missing: Vec<Recipe>,
}

impl Plan {
    /// The way to what a step is. A step on the present data that was made in the same way need not be made again.
    fn of(book: &Book, number: usize) -> Self {
        let recipes: Vec<Recipe> = book.way(number).iter().map(|&k| book.steps[k].recipe.clone()).collect();
        let mut there = None;
        let mut known = 0;
        for recipe in &recipes {
            // The step itself before another one that is the same.
            let same = |k: &usize| {
                let step = &book.steps[*k];
                book.fresh(step) && !step.removed && step.parent == there && step.recipe == *recipe
            };
            let own = book.way(number).into_iter().find(same);
            match own.or_else(|| (0..book.steps.len()).rev().find(same)) {
                Some(found) => there = Some(found),
                None => break,
            }
            known += 1;
        }
        Self {
            there,
            missing: recipes[known..].to_vec(),
        }
    }

    fn and(mut self, recipe: Recipe) -> Self {
        self.missing.push(recipe);
        self
    }

    /// Carries out what is missing, all of it or nothing, and makes the end the current step.
    fn carry_out(self, app: &App, dataset: &Dataset, progress: &Progress, whole: f64) -> Result<(), Refusal> {
        let mut model = match self.there {
            Some(number) => Some(app.session().model(number)?),
            None => None,
        };
        let count = self.missing.len() as f64;
        let mut fitted: Vec<Fitted> = Vec::new();
        let mut learned = false;
        for (k, recipe) in self.missing.into_iter().enumerate() {
            let at = |share: f64, what: &str| progress.at(whole * (k as f64 + share) / count, what);
            match (&recipe, &model) {
                // Learning makes all of its steps at once, and on other data others.
                (Recipe::Learned { .. }, _) if learned => {}
                (Recipe::Learned { .. }, Some(before)) => {
                    learn::go_on(dataset, before, &mut fitted, &at)?;
                    learned = true;
                }
                _ => fitted.push(perform(recipe, dataset, model.as_ref(), &at)?),
            }
            model = fitted.last().map(|one| one.model.clone()).or(model);
        }
        let mut session = app.session();
        if fitted.is_empty() {
            session.book.current = self.there;
            return session.save();
        }
        session.take_steps(self.there, fitted)
    }
}

/// Carries out one recipe on a dataset, and compares.
pub(crate) fn perform(
    recipe: Recipe,
    dataset: &Dataset,
    before: Option<&Model>,
    at: &(dyn Fn(f64, &str) + Sync),
) -> Result<Fitted, Refusal> {
    let (title, model) = match (&recipe, before) {
        (Recipe::Moved { turns }, Some(before)) => return hand::carry_out(turns, dataset, before, at),
        (&Recipe::Fit { family, plays }, _) => {
            let options = FitOptions {
                plays,
                ..FitOptions::new(family)
            };
            let fitted = hysteron_identify::fit(dataset, &options, &|share| at(0.7 * share, family.name()));
            let title = format!("{}, {plays} plays", family.name());
            (title, fitted.map_err(Refusal::unusable)?.model)
        }
        (&Recipe::Add { effect }, Some(before)) => {
            let added = hysteron_diagnose::add(dataset, before, effect, &|share| at(0.8 * share, effect.name()));
            (format!("+ {effect}"), added.map_err(Refusal::unusable)?.model)
        }
        (Recipe::AddOwn { text }, Some(before)) => {
            draft::added(text, dataset, before, &|share, name| at(0.8 * share, name))?
        }
        (Recipe::Add { .. } | Recipe::AddOwn { .. } | Recipe::Learned { .. } | Recipe::Moved { .. }, _) => {
            return Err(Refusal::conflict("there is no model yet; fit one first"));
        }
    };
    let comparison = hysteron_diagnose::compare(dataset, &model, &|share| at(0.8 + 0.2 * share, "comparing"));
    Ok(Fitted {
        recipe,
        title,
        model,
        said: None,
        comparison,
    })
}

/// Diagnoses the current step's model, fitted anew first where the data have grown, and shows what the first candidates do to the data.
pub(crate) fn diagnose(app: &Arc<App>) -> Result<(), Refusal> {
    let base = Base::of(&app.session())?;
    if base.model.direction == Direction::Inverse {
        return Err(Refusal::conflict(
            "an inverse model has no place for physical effects; fit a forward one",
        ));
    }
    let own = Arc::clone(app);
    jobs::start(app, "diagnosing", move |progress| {
        let Base { dataset, number, model } = up_to_date(&own, base, progress, 0.3)?;
        let diagnosis = diagnosed(&dataset, &model, progress, 0.7);
        let comparison = comparison(&own, number)?;
        let mut shown = signatures(&dataset, &model, &comparison, &diagnosis, &[], &|share, effect| {
            progress.at(0.7 + 0.3 * share, effect);
        });
        shown.iter_mut().for_each(for_a_card);
        let shown = serde_json::to_string(&shown).map_err(Refusal::unusable)?;
        let session = own.session();
        folder::write_whole(&session.signatures_file(number), shown.as_bytes())?;
        keep(&session, number, &diagnosis)
    })
}

/// As many points as a card's picture has columns for.
fn for_a_card(signature: &mut Signature) {
    let Signature {
        time_s, without, with, ..
    } = &*signature;
    let points = series::columns(
        0,
        time_s.len(),
        CARD_COLUMNS,
        |k| time_s[k],
        &[&|k| without[k], &|k| with[k]],
    );
    signature.time_s = points.x;
    if let Ok([without, with]) = <[Vec<f64>; 2]>::try_from(points.y) {
        (signature.without, signature.with) = (without, with);
    }
}

fn diagnosed(dataset: &Dataset, model: &Model, progress: &Progress, whole: f64) -> Diagnosis {
    hysteron_diagnose::diagnose(dataset, model, &|share, effect| progress.at(whole * share, effect))
}

/// Keeps a diagnosis: the text of `hysteron diagnose --json`, and the record to take next as `-o` writes it.
fn keep(session: &Session, number: usize, diagnosis: &Diagnosis) -> Result<(), Refusal> {
    let text = serde_json::to_string_pretty(diagnosis).map_err(Refusal::unusable)? + "\n";
    if let Some(next) = &diagnosis.next_record {
        folder::write_whole(&session.next_record_file(number), next.csv().as_bytes())?;
    }
    folder::write_whole(&session.diagnosis_file(number), text.as_bytes())
}

/// Writes the report on the current step; what was diagnosed before is not diagnosed again.
pub(crate) fn report(app: &Arc<App>) -> Result<(), Refusal> {
    let (dataset, number, model) = {
        let mut session = app.session();
        let Base { number, model, .. } = Base::of(&session)?;
        (session.data_of(number)?, number, model)
    };
    let own = Arc::clone(app);
    jobs::start(app, "writing the report", move |progress| {
        let comparison = comparison(&own, number)?;
        let before = std::fs::read_to_string(own.session().diagnosis_file(number)).ok();
        let diagnosis = match before.and_then(|text| serde_json::from_str(&text).ok()) {
            Some(diagnosis) => Some(diagnosis),
            None if model.direction == Direction::Inverse => None,
            None => Some(diagnosed(&dataset, &model, progress, 0.9)),
        };
        progress.at(0.95, "pictures");
        let page = export::report_page(&own, number, &comparison, diagnosis.as_ref())?;
        folder::write_whole(&own.session().report_file(number), page.as_bytes())
    })
}

/// The comparison of a step, from memory or computed now.
pub(crate) fn comparison(app: &App, number: usize) -> Result<Arc<Comparison>, Refusal> {
    let (dataset, model) = {
        let mut session = app.session();
        session.step(number)?;
        if let Some(there) = session.remembered(number) {
            return Ok(there);
        }
        (session.data_of(number)?, session.model(number)?)
    };
    let comparison = Arc::new(hysteron_diagnose::compare(&dataset, &model, &|_| ()));
    app.session().remember(number, Arc::clone(&comparison));
    Ok(comparison)
}
