//! The second level: what is seen only against the model's own family of plays.

use crate::diagnosis::{Before, Level, RankedEffect};
use crate::missing::bench::{Bench, Trial};
use crate::missing::bends::{self, bends};
use crate::missing::chain::{Base, Effect, Shape};
use crate::missing::judge;
use crate::missing::traces::Traces;
use hysteron_identify::effects::with_small_plays;
use hysteron_identify::{Family, Model};
use rayon::prelude::*;
use std::cmp::Ordering;

/// What the family of plays lacks against a free shape.
pub(crate) struct ShapeAnswer {
    pub too_poor: bool,
    pub ranking: Vec<RankedEffect>,
}

/// A family that leaves less than this above the free shape is rich enough, percent: ten plays leave 0.24 to 0.97 on
/// stages in which nothing is missing.
const TOO_POOR_PERCENT: f64 = 0.5;

/// Share of what the family leaves above the free shape that lost motion must take to be named.
const LEAST_SHARE: f64 = 0.97;

/// With the right effect the family comes down to the free shape; this much above it, as a ratio of errors, is a richer shape.
const AS_GOOD: f64 = 1.5;

/// A free shape whose forecast is worse than the model's own by this factor is not determined by the records: sines of one
/// amplitude leave the inside of the loops open.
const UNDETERMINED: f64 = 2.0;

/// The same before anything is found: a free shape bends to an effect that it has not got yet, and forecasts badly for that, but not as
/// badly as plays of which the records say nothing.
const WILD: f64 = 10.0;

/// Whether the records that are fitted determine a free shape well enough to forecast the others: before anything is added to it (`start`),
/// and with what was found.
pub(crate) fn is_determined(before: &Before, start: &Trial, last: &Trial) -> bool {
    before.validate_percent.is_none_or(|percent| {
        let own = percent.max(judge::MATTERS_PERCENT);
        start.validate_percent < WILD * own && last.validate_percent < UNDETERMINED * own
    })
}

/// The model's own family of plays.
pub(crate) fn of_family(model: &Model, traces: &Traces) -> Base {
    Base {
        shape: match model.family {
            Family::Pi => Shape::Pi,
            Family::PlayPolynomial => Shape::Free,
            Family::Mpi | Family::Wrpi | Family::Mrpi => Shape::Mpi,
        },
        thresholds: model.thresholds.iter().map(|r| r / traces.unit_v).collect(),
        ridge: 1e-12,
    }
}

/// Identification and validation pooled.
pub(crate) fn mean_square_percent(trial: &Trial) -> f64 {
    (trial.identify_percent.powi(2) + trial.validate_percent.powi(2)) / 2.0
}

/// A trial of one more effect as an entry of the ranking, not yet judged: its share is what it takes of what the family's `start`
/// leaves above the `free` shape.
pub(crate) fn entry(
    name: &str,
    plays: &Bench<'_>,
    (start, free): (&Trial, &Trial),
    trial: &Trial,
    added: Option<&Effect>,
) -> RankedEffect {
    let lacks = (mean_square_percent(start) - mean_square_percent(free)).max(0.0);
    let share = if lacks > 0.0 {
        (mean_square_percent(start) - mean_square_percent(trial)) / lacks
    } else {
        0.0
    };
    RankedEffect {
        effect: name.to_owned(),
        identify_percent: trial.identify_percent,
        validate_percent: trial.validate_percent,
        statistic: share,
        threshold: LEAST_SHARE,
        log_likelihood_gain: judge::total(plays, start, trial),
        effective_samples: trial.effective.iter().sum(),
        share,
        significant: false,
        level: Level::Shape,
        parameters: plays.parameters(trial, added.as_slice()),
    }
}

/// Compares the model's family with the free shape, with what was found in both.
pub(crate) fn shape(model: &Model, bench: &Bench<'_>, last: &Trial) -> ShapeAnswer {
    if model.family == Family::PlayPolynomial || bench.base.shape != Shape::Free {
        return ShapeAnswer {
            too_poor: false,
            ranking: Vec::new(),
        };
    }
    let base = of_family(model, bench.traces);
    let effects: Vec<Effect> = last.effects.iter().cloned().chain(bends::own(model)).collect();
    let (plays, start) = Bench::new(bench.traces, base, &effects, bench.noise_um);
    let start = bends::start(&plays, start);
    let lacks = (mean_square_percent(&start) - mean_square_percent(last))
        .max(0.0)
        .sqrt();
    let stroke = bench.traces.stroke_um;
    // From a five-hundredth of the stroke, five times the notes' largest flexure slack, to a tenth.
    let widths_um = (0..6).map(|k| 0.002 * stroke * 50f64.powf(f64::from(k) / 5.0));
    let slacks: Vec<Effect> = widths_um.map(|width_um| Effect::Backlash { width_um }).collect();
    let slack = slacks
        .par_iter()
        .map(|slack| {
            let effects: Vec<Effect> = start.effects.iter().chain([slack]).cloned().collect();
            let trial = plays.fit_to_the_end(&effects);
            let mut entry = entry("backlash", &plays, (&start, last), &trial, Some(slack));
            entry.significant = entry.share > LEAST_SHARE
                && lacks > TOO_POOR_PERCENT
                && mean_square_percent(&trial).sqrt() < AS_GOOD * mean_square_percent(last).sqrt();
            entry
        })
        .max_by(|a, b| a.share.total_cmp(&b.share));
    let mut ranking = bends(model, bench, &effects, last);
    ranking.extend(slack);
    let denser = Base {
        // The span is two of these units.
        thresholds: with_small_plays(&plays.base.thresholds, 2.0),
        ..plays.base.clone()
    };
    if denser.thresholds.len() > plays.base.thresholds.len() {
        let denser = Bench::new(bench.traces, denser, &effects, bench.noise_um).0;
        let trial = denser.fit_to_the_end(&start.effects);
        // Every piezo ceramic's gain grows with the stroke: more plays tell of no effect beside the hysteresis.
        ranking.push(entry("amplitude-gain", &plays, (&start, last), &trial, None));
    }
    ranking.retain(|entry| !model.effects.iter().any(|effect| effect.name.as_str() == entry.effect));
    ranking.sort_by(|a, b| {
        (b.significant, b.share)
            .partial_cmp(&(a.significant, a.share))
            .unwrap_or(Ordering::Equal)
    });
    ShapeAnswer {
        too_poor: lacks > TOO_POOR_PERCENT,
        ranking,
    }
}
