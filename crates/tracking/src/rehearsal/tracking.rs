//! The references that controllers are asked to follow on the stage, and how far off the position is.

use super::{BESIDE_HZ, Hidden, PERIOD_S, Rehearsal};
use crate::complete::track_beside;
use crate::error::TrackingError;
use hysteron_control::design::Controller;
use hysteron_control::figures::Tracked;
use hysteron_control::reference::Reference;
use hysteron_plant::StageConfig;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

#[derive(Debug, Clone, Copy)]
enum Kind {
    Sine(f64),
    /// A move to the top, and 4 s there.
    Hold,
}

/// What controllers are asked to follow.
const REFERENCES: [(&str, Kind); 4] = [
    ("10", Kind::Sine(10.0)),
    ("100", Kind::Sine(100.0)),
    ("500", Kind::Sine(500.0)),
    ("hold", Kind::Hold),
];

impl Rehearsal {
    /// Runs a controller along every reference: rms of reference less true position, percent of the range, by reference.
    ///
    /// # Errors
    /// A stage or controller that cannot be run.
    pub fn errors(&self, stage: &StageConfig, controller: &Controller) -> Result<BTreeMap<String, f64>, TrackingError> {
        let [low_um, high_um] = self.range_um();
        REFERENCES
            .into_par_iter()
            .enumerate()
            .map(|(number, (name, kind))| {
                let judged = self.followed(stage, controller, number, kind)?;
                let squares: f64 = judged
                    .reference_um
                    .iter()
                    .zip(&judged.true_um)
                    .map(|(r, y)| (r - y).powi(2))
                    .sum();
                let rms_um = (squares / judged.true_um.len().max(1) as f64).sqrt();
                Ok((name.to_owned(), 100.0 * rms_um / (high_um - low_um)))
            })
            .collect()
    }

    /// The judged part of the hold among the references: 4 s at the top of the range, sample by sample.
    ///
    /// # Errors
    /// As [`Self::errors`].
    pub fn hold(&self, stage: &StageConfig, controller: &Controller) -> Result<Tracked, TrackingError> {
        self.followed(stage, controller, REFERENCES.len() - 1, Kind::Hold)
    }

    fn followed(
        &self,
        stage: &StageConfig,
        controller: &Controller,
        number: usize,
        kind: Kind,
    ) -> Result<Tracked, TrackingError> {
        let law = controller.law::<f64>()?;
        let reference = self.reference(kind);
        let beside_v = self.beside_v(stage, reference.samples_um.len());
        let seed = !self.noise_seed(number as u64);
        let run = track_beside(stage, seed, &law, &reference, &beside_v)?;
        Ok(run.from(reference.judged_from))
    }

    /// The other axis' command beside a reference of so many samples; empty without one.
    pub(super) fn beside_v(&self, stage: &StageConfig, samples: usize) -> Vec<f64> {
        if stage.cross_coupling.is_none() {
            return Vec::new();
        }
        (0..samples)
            .map(|k| 0.4 * self.full_v() * (1.0 - (TAU * BESIDE_HZ * k as f64 * PERIOD_S).cos()))
            .collect()
    }

    /// Time before a reference is judged, seconds: what is learned in the loop has a time constant of 0.3 s, and gets six of them.
    pub fn settling_s(&self) -> f64 {
        if self.hidden == Hidden::MainsHum { 1.8 } else { 0.1 }
    }

    fn reference(&self, kind: Kind) -> Reference {
        let [low_um, high_um] = self.range_um();
        let samples = |time_s: f64| (time_s / PERIOD_S).round() as usize;
        let move_to = |from: f64, to: f64| {
            let n = samples(0.02);
            (0..n).map(move |k| from + (to - from) * 0.5 * (1.0 - (PI * k as f64 / n as f64).cos()))
        };
        match kind {
            Kind::Sine(hz) => {
                let settling = (self.settling_s() * hz).ceil().max(2.0);
                let judged = (0.1 * hz).ceil().max(2.0);
                let mut samples_um: Vec<f64> = move_to(0.0, low_um).collect();
                let from = samples_um.len();
                samples_um.extend(
                    (0..samples((settling + judged) / hz))
                        .map(|k| low_um + (high_um - low_um) * 0.5 * (1.0 - (TAU * hz * k as f64 * PERIOD_S).cos())),
                );
                Reference {
                    samples_um,
                    judged_from: from + samples(settling / hz),
                    ..Reference::default()
                }
            }
            Kind::Hold => {
                let mut samples_um: Vec<f64> = move_to(0.0, high_um).collect();
                samples_um.extend(std::iter::repeat_n(high_um, samples(4.0)));
                Reference {
                    judged_from: samples(0.02 + self.settling_s()),
                    samples_um,
                    ..Reference::default()
                }
            }
        }
    }
}
