//! Learning: a fit, then effect after effect as long as the records not fitted to confirm it; each step one of the ladder.

use crate::App;
use crate::book::Recipe;
use crate::error::Refusal;
use crate::jobs;
use crate::session::Fitted;
use crate::work;
use hysteron_data::Dataset;
use hysteron_diagnose::{Learned, learn_from};
use hysteron_identify::{Change, Family, MOVED_BY_HAND, Model};
use hysteron_report::{ladder_text, learned_text};
use std::sync::{Arc, Mutex, PoisonError};

/// Share of the job that the fit takes; the comparisons take as much at its end.
const ENDS: f64 = 0.1;

/// Fits a model as a new root, and learns what is missing from it: the steps of `hysteron learn`.
pub(crate) fn learn(app: &Arc<App>, family: &str, plays: usize) -> Result<(), Refusal> {
    let family = work::hysteresis(family, plays)?;
    let dataset = app.session().data()?;
    let own = Arc::clone(app);
    jobs::start(app, "learning", move |progress| {
        let fit = Recipe::Fit { family, plays };
        let root = work::perform(fit, &dataset, None, &|share, what| progress.at(ENDS * share, what))?;
        let at = |share: f64, what: &str| progress.at(ENDS + (1.0 - ENDS) * share, what);
        let model = root.model.clone();
        let mut steps = vec![root];
        go_on(&dataset, &model, &mut steps, &at)?;
        own.session().take_steps(None, steps)
    })
}

/// Learns what is missing from a model: a step for each that learning makes, compared; the last of all says what learning did.
pub(crate) fn go_on(
    dataset: &Dataset,
    model: &Model,
    steps: &mut Vec<Fitted>,
    at: &(dyn Fn(f64, &str) + Sync),
) -> Result<(), Refusal> {
    let mut known = model.history.len().max(1);
    let rounds = Rounds::default();
    let learned = learn_from(dataset, model.clone(), &|what, share| {
        at((1.0 - ENDS) * rounds.share(share), what);
    });
    let learned = learned.map_err(Refusal::unusable)?;
    let said = said(model.family, &learned);
    let count = learned.rungs.len();
    for (number, rung) in learned.rungs.into_iter().enumerate().skip(1) {
        // The last one also knows the noise floor.
        let model = if number + 1 == count {
            learned.model.clone()
        } else {
            rung
        };
        let comparison = hysteron_diagnose::compare(dataset, &model, &|part| {
            at(1.0 - ENDS + ENDS * (number as f64 + part) / count as f64, "comparing");
        });
        let title = title(&model, known);
        known = model.history.len();
        steps.push(Fitted {
            recipe: Recipe::Learned { step: number },
            title,
            model,
            said: None,
            comparison,
        });
    }
    if let Some(last) = steps.last_mut() {
        last.said = Some(said);
    }
    Ok(())
}

/// What `hysteron learn` prints: the attempts, why it stopped, and the ladder where there is one.
fn said(family: Family, learned: &Learned) -> String {
    let ladder = hysteron_diagnose::ladder(&learned.model);
    let ladder = ladder.map_or_else(String::new, |ladder| format!("\n{}", ladder_text(&ladder)));
    learned_text(family, learned) + &ladder
}

/// What was done to the model in the steps of its history from one on.
fn title(model: &Model, from: usize) -> String {
    let done = model.history.iter().skip(from).map(|step| match step.change {
        Change::Fitted => step.what.to_string(),
        Change::Added => format!("+ {}", step.what),
        Change::Removed => format!("\u{2212} {}", step.what),
        Change::Moved => MOVED_BY_HAND.to_owned(),
    });
    done.collect::<Vec<_>>().join(", ")
}

/// How far learning is: nobody knows how many rounds there will be, so each takes half of what is left.
#[derive(Default)]
struct Rounds(Mutex<(i32, f64)>);

impl Rounds {
    fn share(&self, share: f64) -> f64 {
        let mut at = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A round that begins again lies far before the end of the last; shares of threads come in almost in order.
        if share < 0.5 * at.1 {
            *at = (at.0 + 1, share);
        }
        at.1 = at.1.max(share);
        let before = 0.5_f64.powi(at.0);
        1.0 - before + 0.5 * before * at.1.min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::Rounds;

    #[test]
    fn prop_progress_never_falls_and_never_ends_before_learning_does() {
        let rounds = Rounds::default();
        let mut last = 0.0;
        for share in (0..6).flat_map(|_| (0..=20).map(|k| f64::from(k) / 20.0)) {
            let now = rounds.share(share);
            assert!((last..1.0).contains(&now), "{last} -> {now} at {share}");
            last = now;
        }
        assert!(last > 0.9, "{last}");
    }
}
