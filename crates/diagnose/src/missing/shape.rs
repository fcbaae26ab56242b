//! The second level: what is seen only against the model's own family of plays.

use crate::diagnosis::{Before, Level, RankedEffect};
use crate::missing::bench::{Bench, Trial};
use crate::missing::chain::{Base, Effect, Shape};
use crate::missing::judge;
use crate::missing::traces::Traces;
use hysteron_identify::effects::with_small_plays;
use hysteron_identify::{Family, Model};
use rayon::prelude::*;

/// What the family of plays lacks against a free shape.
pub(crate) struct ShapeAnswer {
    pub too_poor: bool,
    pub ranking: Vec<RankedEffect>,
}

/// A family that leaves less than this above the free shape is rich enough, percent: ten plays leave 0.24 to 0.97 on
/// stages in which nothing is missing.
const TOO_POOR_PERCENT: f64 = 0.5;

/// Share of what the family leaves above the free shape that an effect of shape must take to be named.
const LEAST_SHARE: f64 = 0.97;

/// With the right effect the family comes down to the free shape; this much above it, as a ratio of errors, is a richer shape.
const AS_GOOD: f64 = 1.5;

/// A bend of the voltage is another thing than the stage's own shape where it leaves less than this share of what a bend of the position
/// leaves: the outputs of a stage's own elements saturate, which bends its loops over the position. On stages of the play class 36 hidden
/// bends left below 0.32 or above 0.8 (`calibrate 12 3000 asymmetry`); elements whose outputs are cut off at both ends make 0.38 alone.
const OF_THE_VOLTAGE: f64 = 0.35;

/// ... takes this share, which the small loops of a stage's own shape bring down ...
const LEAST_BEND: f64 = 0.9;

/// ... of more than this, percent ...
const LEAST_BEND_PERCENT: f64 = 0.25;

/// ... and leaves no more than ten plays leave at the most where nothing is missing, percent.
const COARSE_PERCENT: f64 = 0.97;

/// What ten plays leave at the least there, percent: where that is reached, [`LEAST_SHARE`] is enough.
const FINE_PERCENT: f64 = 0.24;

/// A free shape whose forecast is worse than the model's own by this factor is not determined by the records: sines of one
/// amplitude leave the inside of the loops open.
const UNDETERMINED: f64 = 2.0;

/// Whether the records that are fitted determine a free shape well enough to forecast the others.
pub(crate) fn is_determined(before: &Before, start: &Trial) -> bool {
    before
        .validate_percent
        .is_none_or(|percent| start.validate_percent < UNDETERMINED * percent.max(judge::MATTERS_PERCENT))
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
fn mean_square(identify_percent: f64, validate_percent: f64) -> f64 {
    (identify_percent.powi(2) + validate_percent.powi(2)) / 2.0
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
    let (plays, start) = Bench::new(bench.traces, base, &last.effects, bench.noise_um);
    let start = plays.fit(&start.effects, Some(1));
    let pooled = |t: &Trial| mean_square(t.identify_percent, t.validate_percent);
    let above = (pooled(&start) - pooled(last)).max(0.0);
    let stroke = bench.traces.stroke_um;
    let with = |more: Effect| last.effects.iter().cloned().chain([more]).collect::<Vec<_>>();
    let mut forms = vec![
        ("asymmetry", with(Effect::DrivePowers)),
        ("sensor-nonlinearity", with(Effect::SensorPowers)),
    ];
    for k in 0..6 {
        // From a five-hundredth of the stroke, five times the notes' largest flexure slack, to a tenth.
        let width_um = 0.002 * stroke * 50f64.powf(f64::from(k) / 5.0);
        forms.push(("backlash", with(Effect::Backlash { width_um })));
    }
    let denser = Base {
        // The span is two of these units.
        thresholds: with_small_plays(&plays.base.thresholds, 2.0),
        ..plays.base.clone()
    };
    let denser = (denser.thresholds.len() > plays.base.thresholds.len())
        .then(|| Bench::new(bench.traces, denser, &last.effects, bench.noise_um).0);
    let mut trials: Vec<(&str, Vec<Effect>, Trial)> = forms
        .into_par_iter()
        .map(|(name, effects)| {
            let trial = plays.fit_to_the_end(&effects);
            (name, effects.last().cloned().into_iter().collect(), trial)
        })
        .collect();
    if let Some(denser) = denser {
        trials.push(("amplitude-gain", Vec::new(), denser.fit_to_the_end(&start.effects)));
    }
    let mut ranking: Vec<RankedEffect> = Vec::new();
    for (name, added, trial) in trials {
        let share = if above > 0.0 {
            (pooled(&start) - pooled(&trial)) / above
        } else {
            0.0
        };
        let entry = RankedEffect {
            effect: name.to_owned(),
            identify_percent: trial.identify_percent,
            validate_percent: trial.validate_percent,
            statistic: share,
            threshold: LEAST_SHARE,
            log_likelihood_gain: judge::total(&plays, &start, &trial),
            effective_samples: trial.effective.iter().sum(),
            share,
            // Every piezo ceramic's gain grows with the stroke: more plays tell of no effect beside the hysteresis.
            significant: name != "amplitude-gain"
                && share > LEAST_SHARE
                && above.sqrt() > TOO_POOR_PERCENT
                && pooled(&trial).sqrt() < AS_GOOD * pooled(last).sqrt(),
            level: Level::Shape,
            parameters: plays.parameters(&trial, &added.iter().collect::<Vec<_>>()),
        };
        match ranking.iter_mut().find(|r| r.effect == name) {
            Some(old) if old.share >= share => {}
            Some(old) => *old = entry,
            None => ranking.push(entry),
        }
    }
    let of_the_position = ranking
        .iter()
        .find(|r| r.effect == "sensor-nonlinearity")
        .map_or(0.0, |r| r.share.max(0.0));
    if let Some(bend) = ranking.iter_mut().find(|r| r.effect == "asymmetry") {
        let percent = mean_square(bend.identify_percent, bend.validate_percent).sqrt();
        let of_the_voltage = bend.share > LEAST_BEND
            && 1.0 - bend.share < OF_THE_VOLTAGE * (1.0 - of_the_position)
            && above.sqrt() > LEAST_BEND_PERCENT
            && percent < COARSE_PERCENT;
        let all = bend.share > LEAST_SHARE && above.sqrt() > TOO_POOR_PERCENT && percent < FINE_PERCENT;
        bend.significant |= of_the_voltage || all;
    }
    ranking.sort_by(|a, b| b.share.total_cmp(&a.share));
    ShapeAnswer {
        too_poor: above.sqrt() > TOO_POOR_PERCENT,
        ranking,
    }
}
