//! A controller on stages that are not the one it was designed for: the whole table of errors, no line left out.

use crate::bench::{Bench, Contender};
use crate::error::TrackingError;
use hysteron_control::design::Controller;
use hysteron_control::figures::judge;
use hysteron_control::reference::SHAPES;
use hysteron_plant::StageConfig;
use hysteron_plant::hysteresis::{BoucWen, Family, Mixed};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// One controller on one changed stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RobustnessRow {
    /// What was changed, in words; `nominal` for nothing.
    pub change: &'static str,
    /// `open` or `closed`.
    #[serde(rename = "loop")]
    pub loop_kind: &'static str,
    /// Rms of reference minus true position over whole periods, percent of the reference's peak to peak, by reference.
    pub rms_percent: BTreeMap<String, f64>,
    /// Rms of the true position at rest about its own drift, nanometres.
    pub rest_nm: f64,
    /// Whether the loop came to rest.
    pub stable: bool,
}

/// The stage as it is, and each change of it alone: gain +-10 %, mass +-20 % (every mode), one more sample of latency, 30 % of the
/// displacement from a Bouc-Wen operator, which no play model shares.
pub fn changes(stage: &StageConfig) -> Vec<(&'static str, StageConfig)> {
    let gain = |factor: f64| {
        let mut changed = stage.clone();
        changed.hysteresis.stroke_um *= factor;
        changed
    };
    let mass = |factor: f64| {
        let mut changed = stage.clone();
        let modes = changed.modes.iter_mut();
        modes.for_each(|mode| mode.frequency_hz /= f64::sqrt(factor));
        changed
    };
    let mut later = stage.clone();
    later.controller_delay_s += stage.sample_period_s;
    vec![
        ("nominal", stage.clone()),
        ("gain +10 %", gain(1.1)),
        ("gain -10 %", gain(0.9)),
        ("mass +20 %", mass(1.2)),
        ("mass -20 %", mass(0.8)),
        ("one more sample of delay", later),
        ("30 % Bouc-Wen", with_bouc_wen(stage, 0.3)),
    ]
}

/// Loop opening of the Bouc-Wen part: as wide as the presets' own loops.
const BOUC_WEN_OPENING: f64 = 0.16;
/// Its saturation, as a share of the full voltage, sharpness and roundness: the middles of what piezo stacks are fitted with (Low
/// and Guo 1995).
const BOUC_WEN_SATURATION: f64 = 0.13;
const BOUC_WEN_EXPONENT: f64 = 1.4;
const BOUC_WEN_ROUNDNESS: f64 = 0.65;

fn with_bouc_wen(stage: &StageConfig, share_of_second: f64) -> StageConfig {
    let mut changed = stage.clone();
    let second = Family::BoucWen(BoucWen {
        loop_opening: BOUC_WEN_OPENING,
        saturation_v: BOUC_WEN_SATURATION * stage.hysteresis.reference_v,
        exponent: BOUC_WEN_EXPONENT,
        roundness: BOUC_WEN_ROUNDNESS,
    });
    changed.hysteresis.family = Family::Mixed(Box::new(Mixed {
        first: stage.hysteresis.family.clone(),
        second,
        share_of_second,
    }));
    changed
}

/// Runs one controller, open and closed, on the stage and on each change of it: it was designed for the unchanged one.
///
/// # Errors
/// A stage or controller that cannot be run.
///
/// # Cost
/// 14 rows of 8 runs each, some 5 million samples.
pub fn robustness(bench: &Bench<'_>, controller: &Controller) -> Result<Vec<RobustnessRow>, TrackingError> {
    let closed = controller.law::<f64>()?;
    let mut loops = vec![("open", controller.without_feedback().law::<f64>()?)];
    if closed.feedback().is_some() {
        loops.push(("closed", closed));
    }
    let stages = changes(bench.stage);
    let rows: Vec<_> = stages
        .iter()
        .flat_map(|(change, stage)| loops.iter().map(move |(kind, law)| (*change, stage, *kind, law)))
        .collect();
    rows.par_iter()
        .map(|&(change, stage, loop_kind, law)| {
            let bench = Bench { stage, ..*bench };
            let contender = Contender::Complete(Box::new(*law));
            let mut rms_percent = BTreeMap::new();
            for (key, shape) in SHAPES {
                let run = contender.track(&bench, &shape.reference(bench.range_um, stage.sample_period_s))?;
                let percent = judge(&run, stage.sample_period_s).map_or(f64::NAN, |figures| figures.true_percent);
                rms_percent.insert(key.to_owned(), percent);
            }
            let rest_nm = bench.noise_at_rest_nm(&contender)?;
            Ok(RobustnessRow {
                change,
                loop_kind,
                rms_percent,
                rest_nm,
                stable: bench.rests(rest_nm),
            })
        })
        .collect()
}
