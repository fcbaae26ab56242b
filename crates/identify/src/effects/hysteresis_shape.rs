//! `hysteresis-shape`

use super::{Bounds, Description, Effect, Facts, Place, Shape};
use crate::family::Family;

pub(super) struct HysteresisShape;

static DESCRIPTION: Description = Description {
    name: "hysteresis-shape",
    place: Place::Hysteresis,
    summary: "The family of play operators is too poor for this stage's loops: nothing physical is missing.",
    equation: "y = c + g(v) + sum (q1 w_i + q2 w_i^2 + q3 w_i^3), g of degree 5, at least 18 plays",
    source: "a Preisach operator is an integral of functions of play outputs (Krejci 1996)",
    parameters: &[],
    shows: "An error that repeats with the drive at every rate, even the lowest; equal minor loops at different biases \
            differ (10 to 40 % in opening), first-order reversal curves are no translates of each other.",
    mistaken_for: "asymmetry, sensor-nonlinearity, backlash: a free shape absorbs nearly all of them",
    separated_by: "Three equal minor loops at three biases and a decaying triangle, slowly.",
    compensated_by: "A play-polynomial or generalised model in the inverse; more plays.",
};

/// Graded thresholds at which the free shape reaches the sensor's noise on simulated stages.
const PLAYS: usize = 18;

impl Effect for HysteresisShape {
    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn bounds(&self, _: &Facts) -> Result<Vec<Bounds>, String> {
        Ok(Vec::new())
    }

    fn reshape(&self, shape: &Shape, facts: &Facts) -> Option<Shape> {
        if shape.family == Family::PlayPolynomial {
            return None;
        }
        let mut thresholds = shape.thresholds.clone();
        let step = (100.0_f64).ln() / (PLAYS - 1) as f64;
        // Logarithmic from 0.9 to 90 % of the span, the widest gaps of the given thresholds first.
        let mut candidates: Vec<f64> = (0..PLAYS)
            .map(|i| 0.009 * facts.span_v() * (step * i as f64).exp())
            .collect();
        while thresholds.len() < PLAYS && !candidates.is_empty() {
            let distance = |c: f64| {
                thresholds
                    .iter()
                    .map(|r| (r.max(1e-9) / c).ln().abs())
                    .fold(f64::INFINITY, f64::min)
            };
            let farthest = (0..candidates.len())
                .max_by(|&a, &b| distance(candidates[a]).total_cmp(&distance(candidates[b])))
                .unwrap_or(0);
            thresholds.push(candidates.swap_remove(farthest));
        }
        thresholds.sort_by(f64::total_cmp);
        thresholds.dedup();
        Some(Shape {
            family: Family::PlayPolynomial,
            thresholds,
        })
    }
}
