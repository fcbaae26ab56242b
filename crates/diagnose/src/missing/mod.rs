//! Which physical effect a model lacks.
//!
//! Every candidate is fitted in its place, jointly with a hysteresis of free shape, and judged on records it was not fitted to.

mod bench;
mod candidates;
mod chain;
mod filters;
mod hum;
mod judge;
mod next_record;
mod regression;
mod remains;
mod ringing;
mod shape;
mod structure;
mod traces;
mod user;

use crate::diagnosis::{Before, Diagnosis, RankedEffect};
use crate::noise;
use bench::{Bench, Trial};
use candidates::PHYSICAL;
use chain::{Base, Effect, Shape};
use hysteron_data::{Dataset, Role};
use hysteron_identify::effects::UserEffect;
use hysteron_identify::{Family, IdentifyError, Model, Placement, placement};
use judge::Judge;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use traces::Traces;

/// Plays of the free shape: enough to bring a Preisach density down to a few hundredths of a percent.
const PLAYS: usize = 18;

/// Effects that are looked for one after another.
const ROUNDS: usize = 2;

/// Names the physical effect that a model lacks, from all records. `progress` gets the share done and what is tried now.
///
/// # Cost
/// About 400 regressions of 75 columns on a few thousand rows: seconds; linear in the samples beyond that.
pub fn diagnose(dataset: &Dataset, model: &Model, progress: &(dyn Fn(f64, &str) + Sync)) -> Diagnosis {
    search(dataset, model, &[], progress)
}

/// As [`diagnose`], with effects of the user's own among the candidates.
///
/// # Errors
/// An effect whose equations need a column that the records lack.
/// # Cost
/// Besides that of [`diagnose`], some 300 regressions an effect.
pub fn diagnose_with(
    dataset: &Dataset,
    model: &Model,
    own: &[UserEffect],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Result<Diagnosis, IdentifyError> {
    own.iter().try_for_each(|effect| effect.check(dataset))?;
    Ok(search(dataset, model, own, progress))
}

/// The search, with effects of the user's own whose columns are there.
pub(crate) fn search(
    dataset: &Dataset,
    model: &Model,
    own: &[UserEffect],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Diagnosis {
    let floor = noise::noise_floor(dataset);
    progress(0.0, "model");
    let simulated = traces::initial_states(dataset, model);
    let states: Vec<_> = simulated.iter().map(|s| s.0).collect();
    let traces = Traces::new(dataset, &states, floor.rms_um);
    let before = before(dataset, &simulated);
    let reasons = judge::cannot_answer(dataset, &traces, floor.rms_um);
    progress(0.02, "free shape");
    let inputs: Vec<&[f64]> = traces
        .each
        .iter()
        .filter(|t| t.role == Role::Identify)
        .map(|t| t.drive.as_slice())
        .collect();
    let base = Base {
        shape: Shape::Free,
        thresholds: placement::thresholds(Placement::Data, PLAYS, &inputs),
        ridge: 1e-7,
    };
    let given_effects = given(model, &traces);
    let (mut bench, mut start) = Bench::new(&traces, base, &given_effects, floor.rms_um);
    let shape_determined = shape::is_determined(&before, &start);
    if !shape_determined {
        (bench, start) = Bench::new(&traces, shape::of_family(model, &traces), &given_effects, floor.rms_um);
    }
    if matches!(model.family, Family::Mrpi | Family::Wrpi)
        && !start
            .effects
            .iter()
            .any(|e| matches!(e, Effect::RateShift { .. } | Effect::RateEnvelope { .. }))
    {
        // What the model has already is no missing effect: its rate dependence is fitted anew with everything.
        let given = candidates::rate_of_model(&bench, &start.effects);
        let with_rate = bench.fit(&given, Some(2));
        if judge::total(&bench, &start, &with_rate) > 0.0 {
            bench = bench.referring_to(&with_rate);
            bench.weigh_by(&with_rate);
            start = with_rate;
        }
    }
    let start = bench.fit(&start.effects.clone(), Some(2));
    let judge = Judge::new(&bench, &start);
    let mut found: Vec<(&'static str, Trial)> = Vec::new();
    let mut ranking = Vec::new();
    let mut rivals: Vec<(&'static str, Trial)> = Vec::new();
    for round in 0..ROUNDS {
        let (current, share) = match found.last() {
            Some((_, trial)) => (trial.clone(), 0.5),
            None => (start.clone(), 0.0),
        };
        let here = bench.referring_to(&current);
        let mut trials = try_all(&here, &current, &|done, name| {
            progress(0.05 + share * 0.9 + 0.45 * done, name)
        });
        trials.extend(user::trials(&here, &current, own, &|name| {
            progress(0.05 + share * 0.9 + 0.45, name)
        }));
        let mut ranked = judge.rank(&bench, &current, &trials);
        if round == 0 {
            ranking = ranked.clone();
            rivals = ranked.iter().map(|r| trials[r.0].clone()).collect();
        }
        ranked.retain(|r| r.1.significant);
        let Some((index, _)) = ranked.first() else { break };
        let (name, trial) = &trials[*index];
        found.push((name, trial.clone()));
        if !judge.worth_going_on(found.last().map(|f| &f.1)) {
            break;
        }
    }
    conclude(
        model, &bench, &judge, start, found, ranking, rivals, before, reasons, progress,
    )
}

/// The effects that the model has already, as the search writes them; parameters that are linear here are fitted anew.
fn given(model: &Model, traces: &Traces) -> Vec<Effect> {
    let mut given = Vec::new();
    for effect in &model.effects {
        let value = |name: &str| {
            effect
                .parameters
                .iter()
                .find(|p| p.name == name)
                .map_or(0.0, |p| p.value)
        };
        match effect.name.as_str() {
            "delay" => given.push(Effect::Delay {
                delay_s: value("delay"),
            }),
            "first-order-lag" => {
                for (name, form) in [
                    (
                        "amplifier_tau",
                        (|tau_s| Effect::LagBefore { tau_s }) as fn(f64) -> Effect,
                    ),
                    ("sensor_tau", |tau_s| Effect::LagAfter { tau_s }),
                ] {
                    if value(name) > 0.0 {
                        given.push(form(value(name)));
                    }
                }
            }
            "resonance" => given.push(Effect::Mode {
                frequency_hz: value("frequency"),
                zeta: value("damping"),
            }),
            "slew-limit" if value("slew") > 0.0 => given.push(Effect::Slew {
                per_s: value("slew") / traces.unit_v,
            }),
            "rate-dependence" => given.push(Effect::RateEnvelope {
                up: value("alpha"),
                down: value("beta"),
                narrow: chain::NARROW,
            }),
            "creep" => given.push(Effect::Creep {
                taus_s: candidates::creep_taus(traces),
            }),
            "thermal-drift" => given.extend([Effect::Temperature, Effect::TemperatureGain]),
            "cross-coupling" => given.push(Effect::Cross),
            _ => given.extend(user::given(effect)),
        }
    }
    given
}

/// Every candidate's best forms, in parallel.
fn try_all(bench: &Bench<'_>, current: &Trial, progress: &(dyn Fn(f64, &str) + Sync)) -> Vec<(&'static str, Trial)> {
    let done = AtomicUsize::new(0);
    PHYSICAL
        .par_iter()
        .with_max_len(1)
        .flat_map_iter(|candidate| {
            progress(
                done.load(Ordering::Relaxed) as f64 / PHYSICAL.len() as f64,
                candidate.name,
            );
            let forms = (candidate.search)(bench, &current.effects);
            let fitted: Vec<_> = forms
                .into_iter()
                .map(|effects| (candidate.name, bench.fit_to_the_end(&effects)))
                .collect();
            done.fetch_add(1, Ordering::Relaxed);
            fitted
        })
        .collect()
}

fn before(dataset: &Dataset, simulated: &[(hysteron_identify::InitialState, Vec<f64>)]) -> Before {
    let percent = |role: Role| {
        let squares: Vec<f64> = dataset
            .records
            .iter()
            .zip(simulated)
            .filter(|(r, _)| r.role == role)
            .filter_map(|(r, (_, output))| {
                let stroke = hysteron_identify::family::peak_to_peak(&r.position_um);
                let moves = hysteron_identify::family::peak_to_peak(&r.voltage_v) > 0.0 && stroke > 0.0;
                let square = r
                    .position_um
                    .iter()
                    .zip(output)
                    .map(|(y, m)| (y - m).powi(2))
                    .sum::<f64>();
                moves.then(|| 1e4 * square / r.len() as f64 / stroke.powi(2))
            })
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    Before {
        identify_percent: percent(Role::Identify),
        validate_percent: percent(Role::Validate),
    }
}

#[expect(
    clippy::too_many_arguments,
    reason = "the one place where everything that was found comes together"
)]
fn conclude(
    model: &Model,
    bench: &Bench<'_>,
    judge: &Judge,
    start: Trial,
    found: Vec<(&'static str, Trial)>,
    ranking: Vec<(usize, RankedEffect)>,
    rivals: Vec<(&'static str, Trial)>,
    before: Before,
    reasons: Vec<String>,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Diagnosis {
    progress(0.95, "what remains");
    let last = found.last().map_or(&start, |f| &f.1);
    let residuals = bench.full_residuals(last);
    let hum = hum::find(bench.traces, &residuals, bench.noise_um);
    let remains = remains::remains(bench, last, &residuals, hum.as_ref());
    let mut ranking: Vec<RankedEffect> = ranking.into_iter().map(|r| r.1).collect();
    let mut names: Vec<String> = found.iter().map(|f| f.0.to_owned()).collect();
    if let Some(hum) = &hum {
        let effect = judge.hum(bench, last, hum);
        if effect.significant {
            // The larger of the two is the verdict.
            let first = ranking.first().filter(|r| r.significant);
            let larger = first.is_none_or(|r| effect.share > r.share);
            names.insert(if larger { 0 } else { names.len() }, effect.effect.clone());
            ranking.insert(if larger { 0 } else { ranking.len().min(1) }, effect);
        } else {
            ranking.push(effect);
        }
    }
    if !names.iter().any(|n| n == "resonance")
        && let Some(entry) = ringing::find(
            bench,
            last,
            &residuals,
            remains.percent / 100.0 * bench.traces.stroke_um,
        )
    {
        ranking.retain(|r| r.effect != "resonance");
        names.push("resonance".to_owned());
        ranking.insert(names.len() - 1, entry);
    }
    let shape = shape::shape(model, bench, last);
    let physical = names.first().cloned();
    // Jumps between levels move the zero at the records' starts too.
    let by_starts = last.effects.contains(&Effect::StartOffset);
    let drifts_all = ranking
        .iter()
        .any(|r| r.effect == "thermal-drift" && r.significant && r.share > judge::DRIFT_SHARE);
    let jumps = by_starts
        && !drifts_all
        && structure::jumps(bench.traces, &residuals, 0.3 * traces::start_scatter_um(bench.traces));
    let drifts = !jumps || physical.as_deref() != Some("thermal-drift");
    if jumps {
        names.retain(|name| name != "thermal-drift");
    }
    // An effect that makes the forecast worse than the model's own is none.
    let forecasts = before
        .validate_percent
        .is_none_or(|percent| last.validate_percent <= percent);
    let hum_alone = ranking
        .first()
        .is_some_and(|r| r.effect == "mains-hum" && r.significant && r.share > judge::HUM_ALONE)
        && remains.percent <= remains.noise_percent;
    let enough = (hum_alone || judge.explains_enough(last, hum.as_ref(), remains.percent)) && drifts && forecasts;
    let structured = structure::more_than_noise(bench.traces, &residuals);
    let verdict = if !reasons.is_empty() {
        "unknown".to_owned()
    } else if let Some(name) = physical {
        // A ring after a step is seen as such, whatever else remains.
        if enough || name == "resonance" && found.is_empty() {
            name
        } else {
            "unknown".to_owned()
        }
    } else if !before.exceeds(judge::MATTERS_PERCENT) {
        // Whatever a free shape without the model's rate dependence would leave.
        "none".to_owned()
    } else if remains.percent > judge::MATTERS_PERCENT && (remains.percent > 2.0 * remains.noise_percent || structured)
    {
        "unknown".to_owned()
    } else if let Some(effect) = shape.ranking.first().filter(|r| r.significant) {
        effect.effect.clone()
    } else if shape.too_poor {
        "hysteresis-shape".to_owned()
    } else {
        "none".to_owned()
    };
    ranking.extend(shape.ranking);
    let also_possible = judge.also_possible(&verdict, &ranking, bench.base.shape == Shape::Free);
    let mut unexplained = remains;
    unexplained.locked_to.sort_by(|a, b| b.share.total_cmp(&a.share));
    let next_record = next_record::choose(
        bench,
        &verdict,
        &also_possible,
        &rivals,
        last,
        unexplained.percent / 100.0 * bench.traces.stroke_um,
    );
    let further = names
        .into_iter()
        .filter(|n| *n != verdict && verdict != "unknown")
        .collect();
    progress(1.0, "done");
    Diagnosis {
        verdict,
        also_possible,
        further,
        shape_too_poor: shape.too_poor,
        shape_determined: bench.base.shape == Shape::Free,
        cannot_answer: reasons,
        noise_rms_um: bench.noise_um,
        before,
        free_shape: Before {
            identify_percent: Some(start.identify_percent),
            validate_percent: Some(start.validate_percent),
        },
        ranking,
        next_record,
        unexplained,
    }
}

/// Whether a chain has an effect of this kind already.
fn is_given(effects: &[Effect], effect: &Effect) -> bool {
    effects.iter().any(|e| match (e, effect) {
        (Effect::User { effect: a, .. }, Effect::User { effect: b, .. }) => a == b,
        _ => std::mem::discriminant(e) == std::mem::discriminant(effect),
    })
}
