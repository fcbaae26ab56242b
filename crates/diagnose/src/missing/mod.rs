//! Which physical effect a model lacks.
//!
//! Every candidate is fitted in its place, jointly with a hysteresis of free shape, and judged on records it was not fitted to.

mod bench;
mod bends;
mod candidates;
mod chain;
mod dead_band;
mod filters;
pub(crate) mod hum;
mod judge;
mod lines;
mod locks;
#[cfg(test)]
mod made;
mod next_record;
mod regression;
mod remains;
mod ringing;
mod sample_clock;
mod shape;
mod structure;
mod traces;
mod user;
mod where_it_fails;

use crate::diagnosis::{Before, Diagnosis, RankedEffect, WhereItFails};
use crate::noise;
use bench::{Bench, Trial};
use candidates::PHYSICAL;
use chain::{Base, Effect, Shape};
use hum::Hum;
use hysteron_data::{Dataset, Role};
use hysteron_identify::effects::{Effect as _, UserEffect};
use hysteron_identify::{EffectId, Family, IdentifyError, Model, Placement, check_own_effect, placement};
use judge::Judge;
use locks::Courses;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use traces::Traces;
pub(crate) use traces::controllers_delay_s;

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
    own.iter().try_for_each(|effect| check_own_effect(*effect, dataset))?;
    Ok(search(dataset, model, own, progress))
}

/// Names of the effects that are more than the shape of the loops.
pub(crate) fn physical() -> impl Iterator<Item = &'static str> {
    PHYSICAL.iter().map(|candidate| candidate.name).chain(["mains-hum"])
}

/// The search, with effects of the user's own whose columns are there.
pub(crate) fn search(
    dataset: &Dataset,
    model: &Model,
    own: &[UserEffect],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Diagnosis {
    let known_delay_s = controllers_delay_s(dataset, model);
    Diagnosis {
        known_delay_s,
        ..answer(dataset, model, known_delay_s, own, progress)
    }
}

fn answer(
    original: &Dataset,
    model: &Model,
    known_delay_s: Option<f64>,
    own: &[UserEffect],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Diagnosis {
    progress(0.0, "model");
    let simulated = traces::initial_states(original, model);
    let states: Vec<_> = simulated.iter().map(|s| s.0).collect();
    let before = before(original, &simulated);
    let late = known_delay_s.map(|delay_s| traces::as_late_as_the_controller(original, delay_s, &states));
    let dataset = late.as_ref().unwrap_or(original);
    let humless = traces::without_hum(dataset, model);
    let dataset = humless.as_ref().unwrap_or(dataset);
    let floor = noise::noise_floor(dataset);
    // A model is judged on the grid on which it was fitted and on which it forecasts, and so is what is tried beside it.
    let fine = model.is_dynamic();
    let traces = Traces::new(dataset, &states, floor.rms_um, fine);
    let reasons = judge::cannot_answer(dataset, &traces, floor.rms_um);
    let look = |traces, noise_um, (from, to): (f64, f64)| {
        look(model, traces, noise_um, &before, own, &|done: f64, name: &str| {
            progress(from + (to - from) * done, name);
        })
    };
    let fails = where_the_model_fails(original, &simulated, &traces);
    let searched = look(&traces, floor.rms_um, (0.02, 0.6));
    let residuals = searched.residuals();
    let mut diagnosis = match searched.hum(&residuals) {
        // All that hums looks like noise beside it: what else is missing is looked for without.
        Some((hum, entry)) if entry.significant => {
            let humless = hum::without(dataset, &traces, &residuals, &hum);
            let floor = noise::noise_floor(&humless);
            let without = Traces::new(&humless, &states, floor.rms_um, fine);
            let mut searched = look(&without, floor.rms_um, (0.6, 0.95));
            searched.judge.without(hum);
            let residuals = searched.residuals();
            conclude(model, searched, &residuals, before, reasons, Some(entry), progress)
        }
        other => {
            let entry = other.map(|o| o.1);
            conclude(model, searched, &residuals, before, reasons, entry, progress)
        }
    };
    diagnosis.where_it_fails = fails;
    diagnosis.noise = Some(floor.at_most(diagnosis.noise_rms_um));
    diagnosis
}

/// Where the model fails as it was given, on the records as they are.
fn where_the_model_fails(
    dataset: &Dataset,
    simulated: &[(hysteron_identify::InitialState, Vec<f64>)],
    traces: &Traces,
) -> WhereItFails {
    let errors = |(record, (_, output)): (&hysteron_data::Record, &(_, Vec<f64>))| -> Vec<f64> {
        record.position_um.iter().zip(output).map(|(y, m)| y - m).collect()
    };
    let errors_um: Vec<Vec<f64>> = dataset.records.iter().zip(simulated).map(errors).collect();
    where_it_fails::where_it_fails(&Courses::new(traces, errors_um.iter().map(Vec::as_slice)))
}

/// Searches beside the hysteresis that forecasts: one of free shape, or where the records do not determine that, the model's family.
fn look<'a>(
    model: &Model,
    traces: &'a Traces,
    noise_um: f64,
    before: &Before,
    own: &[UserEffect],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Searched<'a> {
    progress(0.0, "free shape");
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
    let given_effects = given(model, traces);
    let searching = |base: Base, from: f64, to: f64| {
        let told = |done: f64, name: &str| progress(from + (to - from) * done, name);
        Searched::new(model, traces, base, &given_effects, noise_um, own, &told)
    };
    let searched = searching(base, 0.0, 0.8);
    let determined = shape::is_determined(before, &searched.start, searched.last());
    if !determined || searched.is_users_own(own) {
        let stiff = searching(shape::of_family(model, traces), 0.8, 1.0);
        // An effect of the user's own may bend the position: where it does, the hysteresis that forecasts better counts.
        if !determined || stiff.last().validate_percent < searched.last().validate_percent {
            return stiff;
        }
    }
    searched
}

/// What a search with one kind of hysteresis found.
struct Searched<'a> {
    bench: Bench<'a>,
    judge: Judge,
    start: Trial,
    found: Vec<(&'static str, Trial)>,
    ranking: Vec<RankedEffect>,
    rivals: Vec<(&'static str, Trial)>,
}

impl<'a> Searched<'a> {
    /// Looks for effects one after another until none is significant.
    fn new(
        model: &Model,
        traces: &'a Traces,
        base: Base,
        given: &[Effect],
        noise_um: f64,
        own: &[UserEffect],
        progress: &(dyn Fn(f64, &str) + Sync),
    ) -> Self {
        let (bare, bare_start) = Bench::new(traces, base, given, noise_um);
        let (mut bench, mut start) = with_own_rate(model, &bare, &bare_start);
        // What was tried already at this start, for the first round.
        let mut tried = Vec::new();
        if start.effects.len() > bare_start.effects.len() {
            match rate_beside_dynamics(&bare, &bare_start, &bench, &start) {
                Rate::Other(effects) => {
                    start = bare.fit(&effects, Some(2));
                    bench = bare.referring_to(&start);
                    bench.weigh_by(&start);
                    start = bench.fit(&effects, Some(2));
                }
                Rate::Stays(trials) => tried = trials,
            }
        }
        let judge = Judge::new(&bench, &start);
        let mut found: Vec<(&'static str, Trial)> = Vec::new();
        let mut ranking = Vec::new();
        let mut rivals: Vec<(&'static str, Trial)> = Vec::new();
        for round in 0..ROUNDS {
            let current = found.last().map_or(&start, |f| &f.1).clone();
            let from = round as f64 / ROUNDS as f64;
            let here = bench.referring_to(&current);
            let mut trials = try_all(&here, &current, |_| true, &std::mem::take(&mut tried), &|done, name| {
                progress(from + done / ROUNDS as f64, name);
            });
            trials.extend(user::trials(&here, &current, own, &|name| {
                progress(from + 1.0 / ROUNDS as f64, name);
            }));
            let mut ranked = judge.rank(&bench, &current, &trials);
            if round == 0 {
                ranking = ranked.iter().map(|r| r.1.clone()).collect();
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
        let mut searched = Self {
            bench,
            judge,
            start,
            found,
            ranking,
            rivals,
        };
        searched.reconsider();
        searched
    }

    /// What was found first was chosen while the second was still missing: its rivals are judged again beside the second.
    fn reconsider(&mut self) {
        let [first, second] = self.found.as_slice() else {
            return;
        };
        // These two stand for each other: neither is a second thing beside the other.
        let twins = ["delay", "first-order-lag"];
        if twins.contains(&first.0) && twins.contains(&second.0) {
            return;
        }
        let added = |from: &Trial, to: &Trial| -> Vec<Effect> {
            to.effects
                .iter()
                .filter(|e| !is_given(&from.effects, e))
                .cloned()
                .collect()
        };
        let second_alone = added(&first.1, &second.1);
        let here = self.bench.referring_to(&second.1);
        let beside = |effects: &[Effect]| {
            let mut all = effects.to_vec();
            all.extend(second_alone.iter().filter(|e| !is_given(effects, e)).cloned());
            here.fit_to_the_end(&all)
        };
        let current = beside(&self.start.effects);
        let trials: Vec<(&'static str, Trial)> = self
            .rivals
            .par_iter()
            .with_max_len(1)
            .filter(|(name, _)| *name != second.0 && self.ranking.iter().any(|r| r.effect == *name && r.significant))
            .map(|(name, trial)| {
                let known = *name == first.0;
                (
                    *name,
                    if known {
                        second.1.clone()
                    } else {
                        beside(&trial.effects)
                    },
                )
            })
            .collect();
        let ranked = self.judge.rank(&self.bench, &current, &trials);
        let Some((best, entry)) = ranked.first() else { return };
        if !entry.significant {
            return;
        }
        let (name, trial) = trials[*best].clone();
        if name != first.0 {
            let alone = self
                .rivals
                .iter()
                .find(|r| r.0 == name)
                .map_or_else(|| trial.clone(), |r| r.1.clone());
            self.found[0] = (name, alone);
            self.found[1].1 = trial;
        }
        let again: Vec<RankedEffect> = ranked.into_iter().map(|r| r.1).collect();
        self.ranking.retain(|r| !again.iter().any(|a| a.effect == r.effect));
        self.ranking.splice(0..0, again);
    }

    /// Whether the first effect found is one of the user's.
    fn is_users_own(&self, own: &[UserEffect]) -> bool {
        let first = self.found.first();
        first.is_some_and(|(name, _)| own.iter().any(|effect| effect.description().name == *name))
    }

    /// What it leaves of every record, at the full rate.
    fn residuals(&self) -> Vec<Vec<f64>> {
        self.bench.full_residuals(self.last())
    }

    /// The hum in what is left, and how much it counts.
    fn hum(&self, residuals: &[Vec<f64>]) -> Option<(Hum, RankedEffect)> {
        let hum = hum::find(self.bench.traces, residuals, self.bench.noise_um)?;
        let entry = self.judge.hum(&self.bench, self.last(), &hum);
        Some((hum, entry))
    }

    fn last(&self) -> &Trial {
        self.found.last().map_or(&self.start, |f| &f.1)
    }
}

/// The model as it stands, its own rate dependence fitted anew with everything: what it has already is no missing effect.
fn with_own_rate<'a>(model: &Model, bare: &Bench<'a>, bare_start: &Trial) -> (Bench<'a>, Trial) {
    let (mut bench, mut start) = (bare.clone(), bare_start.clone());
    if matches!(model.family, Family::Mrpi | Family::Wrpi) && !start.effects.iter().any(Effect::is_rate) {
        let rate = candidates::rate_of_model(&bench, &start.effects);
        let with_rate = bench.fit(&rate, Some(2));
        if judge::total(&bench, &start, &with_rate) > 0.0 {
            bench = bench.referring_to(&with_rate);
            bench.weigh_by(&with_rate);
            start = with_rate;
        }
    }
    let start = bench.fit(&start.effects.clone(), Some(2));
    (bench, start)
}

/// What becomes of a model's own rate dependence.
enum Rate {
    /// It stays as it was fitted; what was tried beside it on the way.
    Stays(Vec<(&'static str, Trial)>),
    /// The model's effects with another one, or with none.
    Other(Vec<Effect>),
}

/// The model's own rate dependence, or none, as it is beside a delay, a lag or a resonance, where that explains more than the
/// one fitted without them: an envelope widened to imitate a lag hides the lag.
fn rate_beside_dynamics(bare: &Bench<'_>, bare_start: &Trial, rated: &Bench<'_>, rated_start: &Trial) -> Rate {
    // What is hidden so shows in the forecast, or in the fit.
    if rated_start.identify_percent.max(rated_start.validate_percent) < judge::MATTERS_PERCENT {
        return Rate::Stays(Vec::new());
    }
    let dynamic = |name: &str| ["delay", "first-order-lag", "resonance"].contains(&name);
    let trials =
        |bench: &Bench<'_>, start: &Trial| try_all(&bench.referring_to(start), start, dynamic, &[], &|_, _| {});
    let mut without: Vec<(f64, Trial)> = trials(bare, bare_start)
        .into_iter()
        .map(|t| (judge::total(bare, rated_start, &t.1), t.1))
        .collect();
    without.sort_by(|a, b| b.0.total_cmp(&a.0));
    let beside: Vec<(f64, Vec<Effect>)> = without[..without.len().min(2)]
        .par_iter()
        .map(|(_, trial)| {
            let effects = candidates::rate_of_model(&bare.referring_to(trial), &trial.effects);
            let both = bare.referring_to(trial).fit_to_the_end(&effects);
            let own = effects
                .into_iter()
                .filter(|e| is_given(&bare_start.effects, e) || e.is_rate())
                .collect();
            (judge::total(bare, rated_start, &both), own)
        })
        .collect();
    let best_without = without.first().map_or(f64::NEG_INFINITY, |t| t.0);
    let Some(best_beside) = beside.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)) else {
        return Rate::Stays(Vec::new());
    };
    let as_it_was = trials(rated, rated_start);
    let falls = as_it_was.iter().map(|t| judge::total(rated, rated_start, &t.1));
    let least = falls.fold(0.0, f64::max) + judge::THRESHOLD;
    let (best, effects) = if best_beside.0 > best_without + judge::UNDECIDED {
        best_beside
    } else {
        (best_without, bare_start.effects.clone())
    };
    if best > least {
        Rate::Other(effects)
    } else {
        Rate::Stays(as_it_was)
    }
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
            "thermal-drift" => {
                given.extend([Effect::Temperature, Effect::TemperatureGain]);
                if traces.without_temperature() {
                    given.push(Effect::ElapsedTime);
                }
                if value("rest_share") > 0.0 {
                    given.push(Effect::StartOffset);
                }
            }
            "saturation" => given.extend(limits(traces, &value)),
            "cross-coupling" => given.push(Effect::Cross),
            _ => given.extend(user::given(effect)),
        }
    }
    given
}

/// A model's rails and stops, those that a record reaches.
fn limits(traces: &Traces, value: &impl Fn(&str) -> f64) -> Vec<Effect> {
    let mut limits = Vec::new();
    let drive = |name: &str| (value(name) - traces.middle_v) / traces.unit_v;
    let (low, high) = (drive("rail_low"), drive("rail_high"));
    if low > -1.0 || high < 1.0 {
        limits.push(Effect::ClipDrive { low, high });
    }
    let position = |name: &str| value(name) - traces.middle_um;
    let (low_um, high_um) = (position("stop_low"), position("stop_high"));
    let (lowest_um, highest_um) = chain::position_range(&traces.each);
    if low_um > lowest_um || high_um < highest_um {
        limits.push(Effect::EndStop { low_um, high_um });
    }
    limits
}

/// The wanted candidates' best forms, in parallel; those that were tried already at the same start are not tried again.
fn try_all(
    bench: &Bench<'_>,
    current: &Trial,
    wanted: impl Fn(&str) -> bool + Sync,
    tried: &[(&'static str, Trial)],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Vec<(&'static str, Trial)> {
    let done = AtomicUsize::new(0);
    PHYSICAL
        .par_iter()
        .with_max_len(1)
        .filter(|candidate| wanted(candidate.name))
        .flat_map_iter(|candidate| {
            progress(
                done.load(Ordering::Relaxed) as f64 / PHYSICAL.len() as f64,
                candidate.name,
            );
            let mut fitted: Vec<_> = tried.iter().filter(|t| t.0 == candidate.name).cloned().collect();
            if fitted.is_empty() {
                let forms = (candidate.search)(bench, &current.effects);
                let each = forms.into_iter().map(|effects| bench.fit_to_the_end(&effects));
                fitted.extend(each.map(|trial| (candidate.name, trial)));
            }
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

fn conclude(
    model: &Model,
    searched: Searched<'_>,
    residuals: &[Vec<f64>],
    before: Before,
    reasons: Vec<String>,
    hum: Option<RankedEffect>,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Diagnosis {
    let Searched {
        bench,
        judge,
        start,
        found,
        mut ranking,
        rivals,
    } = searched;
    let bench = &bench;
    progress(0.95, "what remains");
    let last = found.last().map_or(&start, |f| &f.1);
    let remains = remains::remains(bench, last, residuals);
    let mut names: Vec<String> = found.iter().map(|f| f.0.to_owned()).collect();
    match hum {
        Some(effect) if effect.significant => {
            // The larger of the two is the verdict.
            let first = ranking.first().filter(|r| r.significant);
            let larger = first.is_none_or(|r| effect.share > r.share);
            names.insert(if larger { 0 } else { names.len() }, effect.effect.clone());
            ranking.insert(if larger { 0 } else { ranking.len().min(1) }, effect);
        }
        insignificant => ranking.extend(insignificant),
    }
    if !names.iter().any(|n| n == "resonance")
        && let Some(entry) = ringing::find(bench, last, residuals, remains.percent / 100.0 * bench.traces.stroke_um)
    {
        ranking.retain(|r| r.effect != "resonance");
        names.push("resonance".to_owned());
        ranking.insert(names.len() - 1, entry);
    }
    let mut shape = shape::shape(model, bench, last);
    // The plays take lost motion in: whatever the fits say of it, the position stands still.
    if !model.effects.iter().any(|effect| effect.name == EffectId::Backlash)
        && let Some(entry) = dead_band::find(bench, last)
    {
        shape.ranking.retain(|r| r.effect != "backlash");
        names.push("backlash".to_owned());
        ranking.insert(names.len() - 1, entry);
    }
    let physical = names.first().cloned();
    // Jumps between levels move the zero at the records' starts too.
    let by_starts = last.effects.contains(&Effect::StartOffset);
    let drifts_all = ranking
        .iter()
        .any(|r| r.effect == "thermal-drift" && r.significant && r.share > judge::DRIFT_SHARE);
    let jumps = by_starts
        && !drifts_all
        && structure::jumps(bench.traces, residuals, 0.3 * traces::start_scatter_um(bench.traces));
    let drifts = !jumps || physical.as_deref() != Some("thermal-drift");
    if jumps {
        names.retain(|name| name != "thermal-drift");
    }
    // An effect that makes the forecast worse than the model's own is none.
    let forecasts = found.is_empty()
        || before
            .validate_percent
            .is_none_or(|percent| last.validate_percent <= percent);
    let hum_alone = ranking
        .first()
        .is_some_and(|r| r.effect == "mains-hum" && r.significant && r.share > judge::HUM_ALONE)
        && remains.percent <= remains.noise_percent;
    let enough = (hum_alone || judge.explains_enough(last, remains.percent)) && drifts && forecasts;
    let structured = structure::more_than_noise(bench.traces, residuals);
    let verdict = if !reasons.is_empty() {
        "unknown".to_owned()
    } else if let Some(name) = physical {
        // A ring after a step, a dead band and a drift that all records share are seen as such, whatever else remains.
        let rings = name == "resonance" && found.is_empty();
        let stands = |name: &&String| match name.as_str() {
            "backlash" => true,
            "thermal-drift" => judge.drifts_alike(&start, &found),
            _ => false,
        };
        match names.iter().find(stands) {
            _ if enough || rings => name,
            Some(seen) => seen.clone(),
            None => "unknown".to_owned(),
        }
    } else if !before.exceeds(judge::MATTERS_PERCENT) && shape.ranking.iter().all(|r| !r.significant) {
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
    if shape.ranking.iter().any(|r| r.significant && r.effect == verdict) {
        let significant = shape.ranking.iter().filter(|r| r.significant);
        names.extend(significant.map(|r| r.effect.clone()));
    }
    ranking.extend(shape.ranking);
    let also_possible = judge.also_possible(&verdict, &ranking, bench.base.shape == Shape::Free);
    let next_record = next_record::choose(
        bench,
        &verdict,
        &also_possible,
        &rivals,
        last,
        remains.percent / 100.0 * bench.traces.stroke_um,
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
        noise: None,
        known_delay_s: None,
        before,
        where_it_fails: WhereItFails::default(),
        free_shape: Before {
            identify_percent: Some(start.identify_percent),
            validate_percent: Some(start.validate_percent),
        },
        ranking,
        next_record,
        unexplained: remains,
    }
}

/// Whether a chain has an effect of this kind already.
fn is_given(effects: &[Effect], effect: &Effect) -> bool {
    effects.iter().any(|e| match (e, effect) {
        (Effect::User { effect: a, .. }, Effect::User { effect: b, .. }) => a == b,
        _ => std::mem::discriminant(e) == std::mem::discriminant(effect),
    })
}
