//! Iterative learning on the simulated stage.

use crate::bench::Bench;
use crate::complete;
use crate::error::TrackingError;
use hysteron_control::design::{Controller, DesignedLaw};
use hysteron_control::figures::judge;
use hysteron_control::learning::{Iteration, LEARNED, LearnedReference, Learning, Run, band_hz, learn, whole_period};
use hysteron_control::reference::{RISE_S, Reference, SHAPES, Shape};
use rayon::prelude::*;

/// Learns each reference of [`LEARNED`] in open loop, with at most `most` corrections.
///
/// Each run begins with the stage at rest and has noise of its own.
///
/// # Errors
/// A controller for references that are not known ahead, a stage or controller that cannot be run.
///
/// # Cost
/// A run of each reference for each iteration, some 0.1 s for ten of them.
pub fn learn_references(
    bench: &Bench<'_>,
    controller: &Controller,
    most: usize,
) -> Result<Vec<LearnedReference>, TrackingError> {
    let band_hz = band_hz(controller)?;
    let law = controller.without_feedback().law::<f64>()?;
    let period_s = bench.stage.sample_period_s;
    let learned = SHAPES
        .into_par_iter()
        .filter(|(name, _)| LEARNED.contains(name))
        .filter_map(|(name, shape)| Some((name, shape, whole_period(shape, period_s)?)));
    learned
        .map(|(name, shape, samples)| {
            let learning = Learning {
                samples,
                period_s,
                band_hz,
                most,
            };
            learn(name, learning, |number, correction_um| {
                run(bench, &law, shape, number, correction_um)
            })
        })
        .collect()
}

/// A run on the simulated stage; none where the reference stands still.
fn run(
    bench: &Bench<'_>,
    law: &DesignedLaw<f64>,
    shape: Shape,
    number: usize,
    correction_um: &[f64],
) -> Result<Option<Run>, TrackingError> {
    let period_s = bench.stage.sample_period_s;
    let wanted = shape.reference(bench.range_um, period_s);
    let rise = (RISE_S / period_s).round() as usize;
    let mut samples_um = wanted.samples_um.clone();
    for (value, correction) in samples_um.iter_mut().skip(rise).zip(correction_um.iter().cycle()) {
        *value += correction;
    }
    let corrections = correction_um
        .iter()
        .cycle()
        .skip((samples_um.len() - rise) % correction_um.len());
    let after_um = wanted
        .after_um
        .iter()
        .zip(corrections)
        .map(|(um, correction)| um + correction);
    let asked = Reference {
        samples_um,
        after_um: after_um.collect(),
        ..wanted
    };
    let seed = bench.seed.wrapping_add(number as u64);
    let mut run = complete::track(bench.stage, seed, law, &asked)?.from(wanted.judged_from);
    // What is wanted, not what was asked for.
    run.reference_um = wanted.samples_um[wanted.judged_from..].to_vec();
    let errors = run.reference_um.iter().zip(&run.measured_um).map(|(r, y)| r - y);
    Ok(judge(&run, period_s).map(|figures| Run {
        error_um: (wanted.judged_from - rise..).zip(errors).collect(),
        iteration: Iteration {
            measured_percent: figures.measured_percent,
            true_percent: Some(figures.true_percent),
        },
    }))
}
