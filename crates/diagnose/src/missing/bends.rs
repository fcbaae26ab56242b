//! A bend of the voltage or of the position: asymmetry, or the sensor's nonlinearity.

use crate::diagnosis::RankedEffect;
use crate::missing::bench::{Bench, Trial};
use crate::missing::chain::{Base, Effect, Shape};
use crate::missing::judge;
use crate::missing::shape::{self, mean_square_percent};
use hysteron_identify::{Family, Model};
use std::slice;

/// A family that lacks less than this without a bend has none of the voltage, percent.
const LEAST_PERCENT: f64 = 0.25;

/// A bend of the position is told from less: where nothing is hidden, none that takes nine tenths of what the family lacks forecasts
/// better than the free shape (`calibrate 12 5000 nothing`, `12 61000 nothing`). It must still be more than the coarseness of many plays.
const LEAST_OF_THE_POSITION_PERCENT: f64 = 0.1;

/// With the right bend of the voltage the family comes down to the free shape, as a ratio of errors: stages in which nothing is hidden
/// stay 1.4 times above it or more (`calibrate 12 5000 nothing`).
const AS_FREE: f64 = 1.25;

/// Turns that a strong bend of the position takes at the most: it is fitted on the position that the last turn found.
const TURNS: usize = 6;

/// On stages whose own loops saturate nothing comes down to the free shape. A bend of the voltage must take this share of what the
/// family lacks ...
const LEAST_SHARE: f64 = 0.9;

/// ... and leave less than this share of what a bend of the position leaves, which the saturating loops make (elements whose outputs
/// are cut off at both ends made 0.5 where nothing was hidden) ...
const OF_THE_VOLTAGE: f64 = 0.35;

/// ... or just less, where the model has no bend: a classic Prandtl-Ishlinskii model lacks the stage's own as well.
const OF_THE_VOLTAGE_UNBENT: f64 = 1.0;

/// A bend of the position must take this much of the logarithm of the held-out error of a hysteresis whose minor loops are congruent,
/// whatever their shape: at most 0.11 where nothing is hidden (54 stages, `calibrate 8 5000 nothing`), 0.99 to 6 behind a sensor that bends
/// by more than 1 % (13 stages, `calibrate 8 61000 sensor-nonlinearity`).
const NOT_CONGRUENT: f64 = 0.5;

/// More than this is left, percent, where the minor loops are not congruent for another reason than a bend: Bouc-Wen stages keep 0.65
/// to 1.5, others less than 0.11.
const MOST_LEFT_PERCENT: f64 = 0.2;

/// Bends that the model has.
pub(crate) fn own(model: &Model) -> impl Iterator<Item = Effect> {
    model.effects.iter().filter_map(|effect| match effect.name.as_str() {
        "asymmetry" => Some(Effect::DrivePowers),
        "sensor-nonlinearity" => Some(Effect::SensorPowers),
        _ => None,
    })
}

/// A new bench's first trial, fitted to the end.
pub(crate) fn start(plays: &Bench<'_>, first: Trial) -> Trial {
    if first.effects.contains(&Effect::SensorPowers) {
        to_the_end(plays, &first.effects)
    } else {
        plays.fit(&first.effects, Some(1))
    }
}

/// Both bends beside the model's own family and its `effects`, with as many plays as the free shape: what is left then is no coarseness
/// of few plays.
pub(crate) fn bends(model: &Model, bench: &Bench<'_>, effects: &[Effect], last: &Trial) -> Vec<RankedEffect> {
    let base = Base {
        thresholds: bench.base.thresholds.clone(),
        ..shape::of_family(model, bench.traces)
    };
    let (fine, start) = Bench::new(bench.traces, base, effects, bench.noise_um);
    let start = self::start(&fine, start);
    let with = |bends: &[Effect]| {
        let more = bends.iter().filter(|bend| !effects.contains(bend));
        effects.iter().chain(more).cloned().collect::<Vec<_>>()
    };
    let (voltage, position) = (Effect::DrivePowers, Effect::SensorPowers);
    let (of_voltage, (of_position, of_both)) = rayon::join(
        || fine.fit_to_the_end(&with(slice::from_ref(&voltage))),
        || {
            rayon::join(
                || to_the_end(&fine, &with(slice::from_ref(&position))),
                || to_the_end(&fine, &with(&[voltage.clone(), position.clone()])),
            )
        },
    );
    let free = mean_square_percent(last);
    let above = |trial: &Trial| (mean_square_percent(trial) - free).max(0.0);
    let better = |trial: &Trial, rival: &Trial| judge::total(&fine, rival, trial) > judge::THRESHOLD;
    // Two powers that forecast better than the free shape with its three numbers a play: the free shape cannot bend the sum of its
    // plays, and no stage's own shape that was tried is such a sum, bent.
    let beats_the_free_shape = |trial: &Trial| judge::total(&fine, last, trial) > judge::UNDECIDED;

    let mut asymmetry = shape::entry("asymmetry", &fine, (&start, last), &of_voltage, Some(&voltage));
    let mut sensor = shape::entry(
        "sensor-nonlinearity",
        &fine,
        (&start, last),
        &of_position,
        Some(&position),
    );
    let lacks_percent = above(&start).sqrt();
    let both = beats_the_free_shape(&of_both) && better(&of_both, &of_voltage) && better(&of_both, &of_position);
    if lacks_percent > LEAST_PERCENT {
        let most = if model.family == Family::Pi {
            OF_THE_VOLTAGE_UNBENT
        } else {
            OF_THE_VOLTAGE
        };
        let comes_down = mean_square_percent(&of_voltage) < AS_FREE.powi(2) * free;
        let more_than_the_stages_own = asymmetry.share > LEAST_SHARE && above(&of_voltage) < most * above(&of_position);
        asymmetry.significant = both || better(&of_voltage, &of_position) && (comes_down || more_than_the_stages_own);
    }
    if lacks_percent > LEAST_OF_THE_POSITION_PERCENT {
        let alone =
            sensor.share > LEAST_SHARE && better(&of_position, &of_voltage) && beats_the_free_shape(&of_position);
        sensor.significant = lacks_percent > LEAST_PERCENT && both || alone;
        if !sensor.significant
            && !effects.contains(&Effect::SensorPowers)
            && let Some(entry) = not_congruent(bench, &start, last)
        {
            // A bend of the voltage leaves the minor loops congruent.
            asymmetry.significant &= both;
            sensor = entry;
        }
    }
    vec![asymmetry, sensor]
}

/// A bend of the position where it shows that the minor loops are not congruent: equal ones between the same voltages, at another history,
/// have the same shape on a Preisach plane (Mayergoyz 1991, section 1.3), however it is filled, and one bent in voltage; a sensor's bend stretches
/// each by the slope where it lies.
fn not_congruent(bench: &Bench<'_>, start: &Trial, last: &Trial) -> Option<RankedEffect> {
    let base = Base {
        shape: Shape::Plane,
        ..bench.base.clone()
    };
    let (plane, straight) = Bench::new(bench.traces, base, &last.effects, bench.noise_um);
    let bend = Effect::SensorPowers;
    let effects: Vec<Effect> = last.effects.iter().cloned().chain([bend.clone()]).collect();
    let bent = to_the_end(&plane, &effects);
    if mean_square_percent(&bent).sqrt() > MOST_LEFT_PERCENT {
        return None;
    }
    // The bend may come with another ridge, and gain by that alone.
    let mut ridges = vec![straight.ridge, bent.ridge];
    ridges.dedup();
    let gain = ridges
        .into_iter()
        .map(|ridge| {
            let without = plane.with_ridge(ridge).fit_to_the_end(&last.effects);
            judge::total(&plane, &without, &bent)
        })
        .fold(f64::INFINITY, f64::min);
    (gain > NOT_CONGRUENT).then(|| RankedEffect {
        statistic: gain,
        threshold: NOT_CONGRUENT,
        significant: true,
        ..shape::entry("sensor-nonlinearity", &plane, (start, last), &bent, Some(&bend))
    })
}

/// A bend of the position, fitted until the position stands still.
fn to_the_end(fine: &Bench<'_>, effects: &[Effect]) -> Trial {
    let mut best = fine.fit_to_the_end(effects);
    for _ in 0..TURNS {
        let again = fine.referring_to(&best).fit(effects, Some(2));
        let stands_still = mean_square_percent(&again) > 0.95 * mean_square_percent(&best);
        if mean_square_percent(&again) < mean_square_percent(&best) {
            best = again;
        }
        if stands_still {
            break;
        }
    }
    best
}
