//! What the model's own plays lack of the free shape, and whether a bend of the voltage or of the position stands for it.

use crate::evidence::{Bend, Bends, Candidate, Scale};
use crate::investigation::Investigation;
use hysteron_identify::effects::{Effect, catalogue, find};
use hysteron_identify::search::{Search, Shape, Trial};
use hysteron_identify::{EffectId, Family, Model};
use rayon::prelude::*;
use std::sync::Arc;

/// The model's own plays, and as many of its kind as the free shape has with bends beside them; all with what was found.
pub(crate) fn bends(model: &Model, investigation: &Investigation<'_>) -> Bends {
    let mut evidence = Bends::default();
    if model.family.is_free() || !investigation.shape_determined {
        return evidence;
    }
    let search = &investigation.search;
    let free = search.standing();
    evidence.free_percent = search.pooled_percent(free);
    let above = |percent: f64| (percent.powi(2) - evidence.free_percent.powi(2)).max(0.0).sqrt();
    let mut with_found = search.model();
    with_found.family = model.family;
    with_found.envelope = model.envelope;
    let mut fine_plays = with_found.clone();
    with_found.thresholds.clone_from(&model.thresholds);
    if free.family() == Family::Duhem {
        // Its lengths are no thresholds.
        fine_plays.thresholds.clone_from(&model.thresholds);
    }
    if fine_plays.family == Family::Mrpi && fine_plays.envelope.is_none() {
        fine_plays.family = Family::Mpi;
    }
    let of = |plays: &Model| Search::new(search.thinned(), plays, &Shape::Own, search.noise_um()).ok();
    let (own, fine) = rayon::join(|| of(&with_found), || of(&fine_plays));
    evidence.lacks_percent = own.map(|own| above(own.pooled_percent(own.standing())));
    if let Some(fine) = fine {
        evidence.fine_lacks_percent = above(fine.pooled_percent(fine.standing()));
        if evidence.fine_lacks_percent > LEAST_LOOKED_INTO_PERCENT {
            beside(&mut evidence, fine, free);
            let mut each = evidence.each.iter().map(|bend| &bend.candidate);
            let of_position = each.find(|bend| bend.effect == EffectId::SensorNonlinearity);
            if of_position.is_some_and(|bend| bend.share > LEAST_ASKED_SHARE) {
                evidence.not_congruent = not_congruent(search);
            }
        }
    }
    evidence
}

/// A bend of the position behind the free shape, whose minor loops between the same voltages are congruent wherever they lie
/// (Mayergoyz 1991, section 1.3), also behind a bent voltage; a sensor's bend stretches each by its slope there.
fn not_congruent(search: &Search<'_>) -> Option<Candidate> {
    let effect = find(EffectId::SensorNonlinearity);
    let trial = tried(search, &effect)?;
    let same_ridge = search.under_ridge_of(&trial);
    let scale = Scale::of(search);
    let each = [Some(search.standing()), same_ridge.as_ref()].into_iter().flatten();
    let candidates = each.map(|without| scale.candidate(search, &effect.name(), (without, &trial), None));
    candidates.min_by(|a, b| a.statistic.total_cmp(&b.statistic))
}

/// An effect as a round tries it: how much of an error it takes is asked here, not its numbers.
fn tried(search: &Search<'_>, effect: &Arc<dyn Effect>) -> Option<Trial> {
    let trials = search.candidates(std::slice::from_ref(effect), None, &|_, _| ());
    trials.into_iter().next()?.ok()
}

/// Fine plays that lack less of the free shape have no bend, percent.
const LEAST_LOOKED_INTO_PERCENT: f64 = 0.05;

/// Minor loops are not asked where a bend of the position takes less than this of what the plays lack: well below the share from
/// which it may be the answer.
const LEAST_ASKED_SHARE: f64 = 0.6;

/// Each bend beside fine plays, and both of them.
fn beside(evidence: &mut Bends, mut fine: Search<'_>, free: &Trial) {
    let scale = Scale::of(&fine);
    let start = fine.standing().clone();
    let lacks = fine.pooled_percent(&start).powi(2) - evidence.free_percent.powi(2);
    let judged = |fine: &Search<'_>, effect: &Arc<dyn Effect>, trial: &Trial| {
        let mut candidate = scale.candidate(fine, &effect.name(), (&start, trial), None);
        let left_percent = fine.pooled_percent(trial);
        let taken = lacks - (left_percent.powi(2) - evidence.free_percent.powi(2));
        candidate.share = taken / lacks.max(f64::MIN_POSITIVE);
        Bend {
            candidate,
            left_percent,
            over_free: scale.fall(free, trial),
        }
    };
    let effects: Vec<Arc<dyn Effect>> = catalogue()
        .into_iter()
        .filter(|effect| effect.bends_the_loops())
        .collect();
    let trials: Vec<Option<Trial>> = effects.par_iter().map(|effect| fine.candidate(effect).ok()).collect();
    let mut found: Vec<Bend> = effects
        .iter()
        .zip(&trials)
        .filter_map(|(effect, trial)| Some(judged(&fine, effect, trial.as_ref()?)))
        .collect();
    let of_position = |effect: &&Arc<dyn Effect>| effect.name() == EffectId::SensorNonlinearity;
    let of_voltage = effects.iter().position(|effect| effect.name() == EffectId::Asymmetry);
    if let (Some(position), Some(trial)) = (
        effects.iter().find(of_position),
        of_voltage.and_then(|k| trials[k].clone()),
    ) {
        fine.stand_on(trial);
        if let Some(trial) = tried(&fine, position) {
            evidence.both = Some(judged(&fine, position, &trial));
        }
    }
    found.sort_by(|a, b| b.candidate.share.total_cmp(&a.candidate.share));
    evidence.each = found;
}
