//! Which physical effect a model lacks.

use crate::bends::bends;
use crate::diagnosis::{Before, Diagnosis, Level, Reason, Unexplained, Verdict, WhereItFails};
use crate::evidence::{Evidence, Seen, errors};
use crate::investigation::{Best, Investigation};
use crate::next_record;
use crate::noise;
use crate::odds::Odds;
use crate::reasons;
use crate::rules::Thresholds;
use crate::verdict::{self, Decision};
use crate::witness::locks::Courses;
use crate::witness::traces::Traces;
use crate::witness::where_it_fails::where_it_fails;
use crate::witness::{dead_band, structure};
use hysteron_acquisition::{Kind, inspect};
use hysteron_data::{Dataset, Role};
use hysteron_identify::effects::{UserEffect, late};
use hysteron_identify::search::Thinned;
use hysteron_identify::{EffectId, EffectName, IdentifyError, Model, check_own_effect, period, present_step};
use rayon::prelude::*;

/// Effects that are looked for one after another.
const MOST_ROUNDS: usize = 3;

/// Names the physical effect that a model lacks, from all records. `progress` gets the share done and what is tried now.
///
/// # Cost
/// A few passes over the records, some hundred over the samples that a search runs on ([`Thinned`]): some seconds for 60 000 samples,
/// below twenty for a million in one record.
pub fn diagnose(dataset: &Dataset, model: &Model, progress: &(dyn Fn(f64, &str) + Sync)) -> Diagnosis {
    examine(dataset, model, &[], progress).0
}

/// As [`diagnose`], with effects of the user's own among the candidates.
///
/// # Errors
/// An effect whose equations need a column that the records lack.
pub fn diagnose_with(
    dataset: &Dataset,
    model: &Model,
    own: &[UserEffect],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Result<Diagnosis, IdentifyError> {
    own.iter().try_for_each(|effect| check_own_effect(*effect, dataset))?;
    Ok(examine(dataset, model, own, progress).0)
}

/// The diagnosis and the evidence behind it.
///
/// # Cost
/// As [`diagnose`].
pub fn examine(
    dataset: &Dataset,
    model: &Model,
    own: &[UserEffect],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> (Diagnosis, Evidence) {
    progress(0.0, "model");
    let fitted_to = as_fitted(dataset);
    let dataset = fitted_to.as_ref().unwrap_or(dataset);
    let before = Before::of(&present_step(dataset, model));
    let known_delay_s = controllers_delay_s(dataset, model);
    let late = known_delay_s.map(|delay_s| as_late_as_the_controller(dataset, delay_s));
    let seen_by_stage = late.as_ref().unwrap_or(dataset);
    let rig = inspect(dataset);
    let floor = late.as_ref().map_or(rig.noise, noise::noise_floor);
    let reasons = reasons::of(
        dataset,
        floor.rms_um,
        rig.finds(Kind::PositionLeads),
        &Thresholds::DEFAULT,
    );
    let blocking: Vec<Reason> = reasons.iter().copied().filter(|r| r.blocks()).collect();
    let fails = fails(dataset, model);
    progress(0.05, "free shape");
    let thinned = Thinned::of(seen_by_stage, floor.rms_um);
    let investigation = Investigation::new(&thinned, model, own, floor.rms_um, &reasons);
    let (mut diagnosis, evidence) = match investigation {
        Ok(mut investigation) if blocking.is_empty() => {
            go_round(&mut investigation, progress);
            let of_records = OfRecords {
                before,
                fails: fails.clone(),
                rig: rig.kinds(),
            };
            let (mut diagnosis, evidence) = conclude(model, &investigation, of_records, progress);
            if diagnosis.verdict == Verdict::Unknown && !investigation.nothing_taken() {
                // What was tried and did not stand hides where to look.
                diagnosis
                    .unexplained
                    .locked_to
                    .clone_from(&evidence.free_fails.locked_to);
            }
            (diagnosis, evidence)
        }
        _ => unanswered(
            before,
            if blocking.is_empty() {
                vec![Reason::NothingMoves]
            } else {
                blocking
            },
        ),
    };
    diagnosis.where_it_fails = fails;
    diagnosis.noise_rms_um = floor.rms_um;
    diagnosis.noise = Some(floor);
    diagnosis.known_delay_s = known_delay_s;
    diagnosis.acquisition = rig.findings;
    if diagnosis.cannot_answer.is_empty() {
        diagnosis.cannot_answer = reasons;
    }
    progress(1.0, "done");
    (diagnosis, evidence)
}

/// Rounds until nothing significant is found.
pub(crate) fn go_round(investigation: &mut Investigation<'_>, progress: &(dyn Fn(f64, &str) + Sync)) {
    for round in 0..MOST_ROUNDS {
        let (from, to) = (0.15 + 0.25 * round as f64, 0.4 + 0.25 * round as f64);
        let best = investigation.round(&|share, effect| progress(from + (to - from) * share, effect));
        match best.into_iter().next().filter(|best: &Best| best.significant) {
            Some(best) => investigation.take(best),
            None => break,
        }
        let left = investigation.scale.excess(investigation.search.standing());
        if left < 0.02 * investigation.base_excess {
            break;
        }
    }
}

/// What the records show without a search.
#[derive(Clone)]
pub(crate) struct OfRecords {
    /// Errors of the given model.
    pub before: Before,
    /// Where it fails.
    pub fails: WhereItFails,
    /// What was found of converters, clocks and cables.
    pub rig: Vec<Kind>,
}

/// The verdict on what an investigation has found.
pub(crate) fn conclude(
    model: &Model,
    investigation: &Investigation<'_>,
    of_records: OfRecords,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> (Diagnosis, Evidence) {
    progress(0.92, "what remains");
    let thresholds = &investigation.thresholds;
    let evidence = evidence(model, investigation, of_records);
    let odds = Odds::of(&evidence);
    let decision = verdict::decide_by(&evidence, &odds, thresholds);
    let ranking = verdict::ranking(&evidence, thresholds);
    let residuals = investigation.residuals();
    let unexplained = Unexplained {
        percent: evidence.left_percent,
        noise_percent: evidence.noise_percent,
        locked_to: courses(investigation, &residuals).locks(),
    };
    let next_record = next_record::choose(investigation, &decision, &odds);
    let Decision {
        verdict,
        set,
        further,
        share,
        shape_too_poor,
    } = decision;
    let diagnosis = Diagnosis {
        verdict,
        also_possible: set,
        odds,
        further,
        share,
        shape_too_poor,
        shape_determined: investigation.shape_determined,
        cannot_answer: Vec::new(),
        noise_rms_um: investigation.search.noise_um(),
        noise: None,
        known_delay_s: None,
        acquisition: Vec::new(),
        before: evidence.before,
        where_it_fails: WhereItFails::default(),
        free_shape: investigation.base,
        ranking,
        next_record,
        unexplained,
    };
    (diagnosis, evidence)
}

/// The probabilities on what an investigation has tried so far.
pub(crate) fn odds(model: &Model, investigation: &Investigation<'_>, of_records: &OfRecords) -> Odds {
    Odds::of(&evidence(model, investigation, of_records.clone()))
}

/// Residuals of the records, run-in included, beside what they may go with.
fn courses<'a>(investigation: &'a Investigation<'_>, residuals: &'a [Vec<f64>]) -> Courses<'a> {
    let records = investigation.traces().each.iter().zip(residuals);
    let own = records.map(|(trace, residual)| &residual[trace.from..]);
    Courses::new(investigation.traces(), own)
}

fn evidence(model: &Model, investigation: &Investigation<'_>, of_records: OfRecords) -> Evidence {
    let OfRecords { before, fails, rig } = of_records;
    let search = &investigation.search;
    let standing = search.standing();
    let residuals = investigation.residuals();
    let left = errors(search, standing);
    let traces = investigation.traces();
    let has = |effect: EffectId| model.effects.iter().any(|fitted| fitted.name == effect);
    let is_mode = |name: &EffectName| name.id().map(EffectId::narrowest) == Some(EffectId::Resonance);
    let mut taken = investigation.rounds.iter().filter_map(|round| round.taken.as_ref());
    let has_a_mode = model.effects.iter().any(|fitted| is_mode(&fitted.name)) || taken.any(is_mode);
    Evidence {
        reasons: Vec::new(),
        before,
        base: investigation.base,
        one_amplitude: reasons::sines_of_one_amplitude(search.dataset()),
        shape_determined: investigation.shape_determined,
        base_excess: investigation.base_excess,
        left_excess: investigation.scale.excess(standing),
        left_percent: left.pooled().unwrap_or(0.0),
        noise_percent: investigation.scale.noise_percent(search.noise_um()),
        more_than_noise: structure::more_than_noise(traces, &residuals),
        rounds: investigation.rounds.clone(),
        shape: bends(model, investigation),
        seen: Seen {
            dead_band: if has(EffectId::Backlash) {
                None
            } else {
                dead_band::find(traces, &left)
            },
            ring: if has_a_mode {
                None
            } else {
                investigation.ring(&residuals)
            },
        },
        rig,
        fails,
        free_fails: where_it_fails(&courses(investigation, investigation.residuals_at_first())),
    }
}

/// Where the given model fails, on the records as they are.
pub(crate) fn fails(dataset: &Dataset, model: &Model) -> WhereItFails {
    let (states, errors_um): (Vec<_>, Vec<Vec<f64>>) = dataset
        .records
        .par_iter()
        .map(|record| {
            let simulated = model.simulate(record);
            let errors = record.position_um.iter().zip(&simulated.output).map(|(y, m)| y - m);
            (simulated.initial, errors.collect())
        })
        .unzip();
    let traces = Traces::new(dataset, &states, noise::noise_floor(dataset).rms_um);
    where_it_fails(&Courses::new(&traces, errors_um.iter().map(Vec::as_slice)))
}

fn unanswered(before: Before, reasons: Vec<Reason>) -> (Diagnosis, Evidence) {
    let evidence = Evidence {
        reasons: reasons.clone(),
        before,
        ..Evidence::default()
    };
    let diagnosis = Diagnosis {
        verdict: Verdict::Unknown,
        also_possible: Vec::new(),
        odds: Odds::default(),
        further: Vec::new(),
        share: None,
        shape_too_poor: false,
        shape_determined: true,
        cannot_answer: reasons,
        noise_rms_um: 0.0,
        noise: None,
        known_delay_s: None,
        acquisition: Vec::new(),
        before,
        where_it_fails: WhereItFails::default(),
        free_shape: Before::default(),
        ranking: Vec::new(),
        next_record: None,
        unexplained: Unexplained {
            percent: before.pooled().unwrap_or(0.0),
            noise_percent: 0.0,
            locked_to: Vec::new(),
        },
    };
    (diagnosis, evidence)
}

/// The delay that is the controller's own, as the recordings say, where the model has none that would stand for it, seconds.
pub(crate) fn controllers_delay_s(dataset: &Dataset, model: &Model) -> Option<f64> {
    let has_delay = model.effects.iter().any(|effect| effect.name == EffectId::Delay);
    dataset.known.delay_s.filter(|delay_s| *delay_s > 0.0 && !has_delay)
}

/// Records of which none was meant to be fitted, as those of another day: the candidates are fitted to all of them, by turns.
fn as_fitted(dataset: &Dataset) -> Option<Dataset> {
    let none = dataset.records.iter().all(|record| record.role != Role::Identify);
    none.then(|| {
        let mut fitted = dataset.clone();
        fitted
            .records
            .iter_mut()
            .for_each(|record| record.role = Role::Identify);
        fitted
    })
}

/// The records with each drive as the stage gets it, so much later than it was commanded.
fn as_late_as_the_controller(dataset: &Dataset, delay_s: f64) -> Dataset {
    let mut delayed = dataset.clone();
    for record in &mut delayed.records {
        let found = period::detect(&record.voltage_v).filter(|period| period.from == 0);
        let run_in = found.map_or(0, |period| period.samples);
        let drives = [Some(&mut record.voltage_v), record.voltage2_v.as_mut()];
        for drive in drives.into_iter().flatten() {
            late(delay_s, record.period_s, run_in, drive);
        }
    }
    delayed
}

impl Level {
    /// The word in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Physical => "physical",
            Self::Shape => "shape",
        }
    }
}
