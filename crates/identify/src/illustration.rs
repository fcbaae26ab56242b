//! What an effect does, shown on an imagined stage: one record without it and with it, computed by the effect itself.
//!
//! The stage has 0 to 100 V, some 10 um and a loop opening of some 15 %. The effect is sized so that the two readings
//! differ by 3 % of peak to peak, the lower end of what is called strong.

use crate::chain::{Chain, Link};
use crate::chain_facts::facts;
use crate::chain_trace::Trace;
use crate::columns::Design;
use crate::effects::{Bounds, Effect, Facts, Scene, Shape};
use crate::family::{Family, peak_to_peak};
use crate::placement::{Placement, thresholds};
use crate::start_state::InitialState;
use hysteron_data::{Dataset, Record, Role};
use std::f64::consts::TAU;
use std::sync::Arc;

/// An effect shown on one record.
#[derive(Debug, Clone, PartialEq)]
pub struct Illustration {
    /// What was played, for people.
    pub excitation: String,
    /// Sample period, seconds.
    pub period_s: f64,
    /// Command, volts.
    pub voltage_v: Vec<f64>,
    /// The other axis' command, where that is what matters, volts.
    pub voltage2_v: Option<Vec<f64>>,
    /// Position without the effect, micrometres.
    pub without_um: Vec<f64>,
    /// Position with it, micrometres.
    pub with_um: Vec<f64>,
    /// The effect's parameters; none where it is a matter of the hysteresis' shape.
    pub values: Vec<f64>,
    /// Rms distance of the two about its mean, percent of the stroke in the record, of the full stroke where it rests.
    pub differs_percent: f64,
}

/// What the two readings should differ by, percent of peak to peak.
const TARGET_PERCENT: f64 = 3.0;
/// The first values whose distance is within this factor of the target are taken: the list begins with what is usual.
const NEAR: f64 = 1.5;
const FULL_V: f64 = 100.0;
const FULL_UM: f64 = 10.0;
/// Thresholds as shares of the range, and their weights as shares of the gain; the widest leaves the loop open at full stroke.
const PLAYS: [(f64, f64); 6] = [
    (0.05, 0.10),
    (0.10, 0.09),
    (0.20, 0.08),
    (0.30, 0.07),
    (0.45, 0.06),
    (0.60, 0.05),
];

/// Shows an effect on the record that its description names.
///
/// # Errors
/// In words, why the imagined stage cannot have it.
///
/// # Cost
/// Some tens of simulations of up to 6000 samples.
///
/// # Example
/// ```
/// let delay = hysteron_identify::EffectId::Delay.effect();
/// let shown = hysteron_identify::illustration::illustrate(&delay)?;
/// assert!((1.0..9.0).contains(&shown.differs_percent));
/// # Ok::<(), String>(())
/// ```
pub fn illustrate(effect: &Arc<dyn Effect>) -> Result<Illustration, String> {
    let dataset = dataset();
    let facts = facts(&dataset, Family::Pi);
    let bounds = effect.bounds(&facts)?;
    let scene = effect.description().scene;
    let record = dataset
        .records
        .iter()
        .find(|record| record.file == file(scene))
        .ok_or("no record of that kind")?;
    let (design, coefficients) = stage();
    let bare = run(&design, &coefficients, None, record);
    let mut best: Option<(f64, Vec<f64>, Vec<f64>)> = None;
    for values in candidates(effect.as_ref(), &facts, &bounds) {
        let with = with_effect(effect, &values, &facts, record);
        let percent = differs_percent(&bare, &with);
        let off = (percent.max(1e-9) / TARGET_PERCENT).ln().abs();
        if best.as_ref().is_none_or(|(least, ..)| off < *least) {
            best = Some((off, values, with));
        }
        if off < NEAR.ln() {
            break;
        }
    }
    let (_, values, with_um) = best.ok_or("no value of its parameters shows it")?;
    Ok(Illustration {
        excitation: record.excitation.clone(),
        period_s: record.period_s,
        voltage_v: record.voltage_v.clone(),
        voltage2_v: record.voltage2_v.clone(),
        differs_percent: differs_percent(&bare, &with_um),
        without_um: bare,
        with_um,
        values,
    })
}

/// The hysteresis of the imagined stage.
fn stage() -> (Design, Vec<f64>) {
    let gain = FULL_UM / FULL_V;
    let plays: f64 = PLAYS.iter().map(|(_, weight)| weight).sum();
    let mut coefficients = vec![0.0, gain * (1.0 - plays)];
    coefficients.extend(PLAYS.iter().map(|(_, weight)| gain * weight));
    let widths = PLAYS.iter().map(|(threshold, _)| threshold * FULL_V).collect();
    (Design::still(Family::Pi, widths), coefficients)
}

fn with_effect(effect: &Arc<dyn Effect>, values: &[f64], facts: &Facts, record: &Record) -> Vec<f64> {
    let (bare, coefficients) = stage();
    let shape = Shape {
        family: bare.family,
        thresholds: bare.thresholds.clone(),
    };
    let place = |plays| thresholds(Placement::Log, plays, &[&record.voltage_v]);
    if let Some(richer) = effect.reshape(&shape, facts, &place) {
        let coefficients = enrich(&richer, &bare.thresholds, &coefficients);
        return run(
            &Design::still(richer.family, richer.thresholds),
            &coefficients,
            None,
            record,
        );
    }
    let link = Link {
        effect: Arc::clone(effect),
        values: values.to_vec(),
    };
    run(&bare, &coefficients, Some(link), record)
}

/// Coefficients of the richer hysteresis that a change of shape stands for: new plays of the same family have a fifth of the
/// gain between them; where plays have polynomials, their outputs bend by a tenth at full stroke.
fn enrich(richer: &Shape, before: &[f64], coefficients: &[f64]) -> Vec<f64> {
    let gain = FULL_UM / FULL_V;
    let powers = richer.family.input_powers().len();
    let mut all = vec![0.0; 1 + powers];
    all[1] = coefficients[1];
    let bends = richer.family.coefficients_a_play() > 1;
    // Each weight goes to the play nearest to where it was.
    let mut weights = vec![0.0; richer.thresholds.len()];
    for (old, weight) in before.iter().zip(&coefficients[2..]) {
        let away = |i: &usize| (richer.thresholds[*i] - old).abs();
        if let Some(nearest) = (0..weights.len()).min_by(|a, b| away(a).total_cmp(&away(b))) {
            weights[nearest] += weight;
        }
    }
    if !bends {
        let added: Vec<usize> = (0..weights.len()).filter(|&i| weights[i] == 0.0).collect();
        for &i in &added {
            weights[i] = 0.2 * gain / added.len() as f64;
        }
    }
    all.extend(&weights);
    if bends {
        all.extend(weights.iter().map(|weight| 0.5 * weight / FULL_V));
        all.extend(weights.iter().map(|_| 0.0));
    }
    all
}

fn run(design: &Design, coefficients: &[f64], link: Option<Link>, record: &Record) -> Vec<f64> {
    let chain = Chain::new(design.clone(), link.into_iter().collect(), [0.0, FULL_V]);
    let trace = Trace::new(record, InitialState::REST, chain.dynamic());
    let coefficients = chain.basis().of_powers(&design.thresholds, coefficients);
    chain.respond(&coefficients, &trace, &vec![Vec::new(); chain.links.len()])
}

/// Values to try: where searches start, all parameters together, then each alone, moved away from where it does nothing.
fn candidates(effect: &dyn Effect, facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
    const SHARES: [f64; 9] = [0.003, 0.006, 0.01, 0.02, 0.03, 0.06, 0.1, 0.2, 0.4];
    let mut all = effect.starts(facts, bounds);
    let neutral: Vec<f64> = bounds.iter().map(|b| b.neutral).collect();
    let moved = |b: &Bounds, share: f64| {
        // Towards the farther bound; up where both are as far.
        let up = b.max - b.neutral >= b.neutral - b.min;
        b.neutral + share * if up { b.max - b.neutral } else { b.min - b.neutral }
    };
    for share in SHARES {
        let together = bounds
            .iter()
            .map(|b| if b.fitted { moved(b, share) } else { b.neutral });
        all.push(together.collect());
    }
    for (j, b) in bounds.iter().enumerate().filter(|(_, b)| b.fitted) {
        for share in SHARES {
            let mut values = neutral.clone();
            values[j] = moved(b, share);
            all.push(values);
        }
    }
    all
}

fn differs_percent(without: &[f64], with: &[f64]) -> f64 {
    let n = without.len() as f64;
    let difference = || without.iter().zip(with).map(|(a, b)| b - a);
    let mean = difference().sum::<f64>() / n;
    let rms = (difference().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt();
    let stroke = peak_to_peak(without);
    100.0 * rms / if stroke > 0.0 { stroke } else { FULL_UM }
}

fn file(scene: Scene) -> &'static str {
    match scene {
        Scene::FastSine => "fast-sine.csv",
        Scene::SlowSine => "slow-sine.csv",
        Scene::Edge => "edge.csv",
        Scene::Hold => "hold.csv",
        Scene::Ladder => "ladder.csv",
        Scene::OtherAxis => "other-axis.csv",
    }
}

/// The record that shows a kind of scene, for a stage that is driven between two voltages; its position is a straight line.
pub fn scene_record(scene: Scene, range_v: [f64; 2]) -> Option<Record> {
    let mut record = dataset()
        .records
        .into_iter()
        .find(|record| record.file == file(scene))?;
    for voltage in record
        .voltage_v
        .iter_mut()
        .chain(record.voltage2_v.iter_mut().flatten())
    {
        *voltage = range_v[0] + *voltage / FULL_V * (range_v[1] - range_v[0]);
    }
    Some(record)
}

/// One record of each kind, from a stage that has come to rest at 0 V.
fn dataset() -> Dataset {
    let sine = |hz: f64| move |t: f64| 0.5 * FULL_V * (1.0 - (TAU * hz * t).cos());
    let ladder = |t: f64| {
        const STEPS: [f64; 6] = [0.02, 0.05, 0.1, 0.25, 0.5, 1.0];
        let cycle = (11.0 * t) as usize;
        // Each amplitude twice, about the middle; a quarter of a cycle first goes there.
        0.5 * FULL_V * (1.0 + STEPS[(cycle / 2).min(STEPS.len() - 1)] * (TAU * 11.0 * t).sin())
    };
    let hold = |t: f64| match t {
        t if t < 5.0 => 0.0,
        t if t < 65.0 => 0.8 * FULL_V,
        _ => 0.2 * FULL_V,
    };
    let edge = |t: f64| 0.5 * FULL_V * ((t - 2e-3) / 1e-4).clamp(0.0, 1.0);
    let records = vec![
        record(Scene::FastSine, "sine 503 Hz, 0 to 100 V", 2e-5, 300, sine(503.0)),
        record(Scene::SlowSine, "sine 11 Hz, 0 to 100 V", 2e-4, 1000, sine(11.0)),
        record(Scene::Edge, "step of 50 V within 0.1 ms", 2e-5, 1000, edge),
        record(
            Scene::Hold,
            "step to 80 V, after a minute to 20 V, while the room warms by 1 K",
            0.05,
            2500,
            hold,
        ),
        record(
            Scene::Ladder,
            "sines of 11 Hz about 50 V, 2, 5, 10, 25, 50, 100 % of the range, twice each",
            1e-3,
            1090,
            ladder,
        ),
        record(
            Scene::OtherAxis,
            "this axis at rest at 50 V, the other one a sine of 7 Hz",
            2e-4,
            2000,
            |_| 0.5 * FULL_V,
        ),
    ];
    Dataset {
        name: "illustration".to_owned(),
        records,
        ..Dataset::default()
    }
}

fn record(scene: Scene, excitation: &str, period_s: f64, samples: usize, voltage: impl Fn(f64) -> f64) -> Record {
    let series = |f: &dyn Fn(f64) -> f64| (0..samples).map(|k| f(k as f64 * period_s)).collect::<Vec<f64>>();
    let voltage_v = series(&voltage);
    let rise = if scene == Scene::Hold {
        1.0 / (samples as f64 * period_s)
    } else {
        0.0
    };
    Record {
        file: file(scene).to_owned(),
        role: Role::Identify,
        excitation: excitation.to_owned(),
        start_s: 0.0,
        period_s,
        position_um: voltage_v.iter().map(|v| v * FULL_UM / FULL_V).collect(),
        voltage_v,
        reference_um: None,
        temperature_c: Some(series(&|t| 20.0 + rise * t)),
        voltage2_v: (scene == Scene::OtherAxis).then(|| series(&|t| 0.5 * FULL_V * (1.0 - (TAU * 7.0 * t).cos()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::catalogue;

    /// Every effect of the catalogue shows on its own record, by about what was asked for: the list of values has steps of
    /// at most three, whose half in the logarithm is 1.7; five leaves room for effects that grow faster than their parameter.
    #[test]
    fn val_every_effect_shows_on_its_record() {
        for effect in catalogue() {
            let name = effect.description().name;
            let shown = illustrate(&effect).unwrap();
            assert!(
                (TARGET_PERCENT / 5.0..=TARGET_PERCENT * 5.0).contains(&shown.differs_percent),
                "{name}: {} %, {:?}",
                shown.differs_percent,
                shown.values
            );
            assert!(shown.with_um.iter().all(|y| y.is_finite()), "{name}");
        }
    }
}
