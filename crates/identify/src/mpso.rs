//! The paper's way: all parameters at once by a modified particle swarm (objective 17).
//!
//! The paper names the algorithm (Yang, Gu, Zhu 2013) and gives no settings. Here: linearly falling inertia 0.9 to 0.4
//! (Shi and Eberhart 1998), c1 = c2 = 2, velocities limited to a fifth of the search box, global best, and the
//! modification against early stagnation: a particle that has not improved for 30 turns is thrown anew. The swarm
//! takes 2000 turns.

use crate::columns::{Design, Run};
use crate::family::{Family, range};
use hysteron_core::envelope::Envelope;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Particles of the swarm.
pub const PARTICLES: usize = 40;
/// Turns of the swarm.
pub const TURNS: usize = 2000;
/// Turns without improvement after which a particle is thrown anew.
const STAGNATION: u32 = 30;

/// Result of a swarm.
pub(crate) struct Swarmed {
    pub design: Design,
    pub coefficients: Vec<f64>,
}

/// Value of objective 17 for one parameter set.
fn objective(design: &Design, coefficients: &[f64], runs: &[Run<'_>]) -> f64 {
    runs.iter()
        .map(|run| run.weight * design.squared_error(coefficients, run))
        .sum()
}

struct Particle {
    position: Vec<f64>,
    velocity: Vec<f64>,
    best: Vec<f64>,
    best_value: f64,
    value: f64,
    turns_without_gain: u32,
}

/// Runs the swarm. `progress` gets the share done.
pub(crate) fn solve(
    family: Family,
    thresholds: Vec<f64>,
    runs: &[Run<'_>],
    seed: u64,
    progress: &(dyn Fn(f64) + Sync),
) -> Swarmed {
    let design = Design::still(family, thresholds);
    let bounds = search_box(&design, runs);
    let dimensions = bounds.len();
    let split = |x: &[f64]| -> (Design, Vec<f64>) {
        let mut here = design.clone();
        let columns = here.columns();
        if family == Family::Mrpi {
            here.envelope = Envelope {
                alpha_s: x[columns].max(0.0),
                beta_s: x[columns + 1].max(0.0),
            };
        }
        (here, x[..columns].to_vec())
    };
    let value = |x: &[f64]| {
        let (here, coefficients) = split(x);
        objective(&here, &coefficients, runs)
    };
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut throw = |low_high: &[(f64, f64)]| -> Vec<f64> {
        low_high
            .iter()
            .map(|&(low, high)| low + (high - low) * random.random::<f64>())
            .collect()
    };
    let mut swarm: Vec<Particle> = (0..PARTICLES)
        .map(|_| {
            let position = throw(&bounds);
            Particle {
                velocity: vec![0.0; dimensions],
                best: position.clone(),
                position,
                best_value: f64::INFINITY,
                value: f64::INFINITY,
                turns_without_gain: 0,
            }
        })
        .collect();
    let (mut leader, mut leader_value) = (swarm[0].position.clone(), f64::INFINITY);
    for turn in 0..TURNS {
        swarm
            .par_iter_mut()
            .for_each(|particle| particle.value = value(&particle.position));
        for particle in &mut swarm {
            if particle.value < particle.best_value {
                (particle.best_value, particle.turns_without_gain) = (particle.value, 0);
                particle.best.clone_from(&particle.position);
            } else {
                particle.turns_without_gain += 1;
            }
            if particle.best_value < leader_value {
                leader_value = particle.best_value;
                leader.clone_from(&particle.best);
            }
        }
        let inertia = 0.9 - 0.5 * turn as f64 / TURNS as f64;
        for particle in &mut swarm {
            if particle.turns_without_gain > STAGNATION {
                particle.position = throw(&bounds);
                particle.best_value = f64::INFINITY;
                particle.velocity.fill(0.0);
                particle.turns_without_gain = 0;
                continue;
            }
            let pulls = throw(&vec![(0.0, 2.0); 2 * dimensions]);
            for (i, &(low, high)) in bounds.iter().enumerate() {
                let limit = 0.2 * (high - low);
                let pull = pulls[2 * i] * (particle.best[i] - particle.position[i])
                    + pulls[2 * i + 1] * (leader[i] - particle.position[i]);
                particle.velocity[i] = (inertia * particle.velocity[i] + pull).clamp(-limit, limit);
                particle.position[i] = (particle.position[i] + particle.velocity[i]).clamp(low, high);
            }
        }
        progress((turn + 1) as f64 / TURNS as f64);
    }
    let (design, coefficients) = split(&leader);
    Swarmed { design, coefficients }
}

/// Bounds of each parameter, from the records' ranges: with the mean slope s = output span / input span, input function
/// and weights within +-2 s (the paper's Table 2 stays within +-1.6 slopes but for its r = 0 twin), the cubic within a
/// slope at full range, rate weights within a slope at the fastest rate, alpha and beta up to 0.1 ms.
fn search_box(design: &Design, runs: &[Run<'_>]) -> Vec<(f64, f64)> {
    let (low, high) = range(runs.iter().flat_map(|run| run.input.iter().copied()));
    let (output_low, output_high) = range(runs.iter().flat_map(|run| run.output.iter().copied()));
    let fastest = runs
        .iter()
        .flat_map(|run| {
            run.input
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).abs() / run.period_s)
        })
        .fold(0.0, f64::max);
    let (span, output_span) = (high - low, output_high - output_low);
    let slope = output_span / span;
    let mut bounds = vec![(output_low - output_span, output_high + output_span)];
    for &power in design.family.input_powers() {
        let limit = 2.0 * slope / low.abs().max(high.abs()).powi(power - 1);
        bounds.push((-limit, limit));
    }
    bounds.extend(design.thresholds.iter().map(|_| (-2.0 * slope, 2.0 * slope)));
    match design.family {
        Family::Wrpi => {
            let limit = slope / fastest.max(f64::MIN_POSITIVE);
            bounds.extend(design.thresholds.iter().map(|_| (-limit, limit)));
        }
        Family::Mrpi => bounds.extend([(0.0, 1e-4), (0.0, 1e-4)]),
        Family::Pi | Family::Mpi | Family::PlayPolynomial | Family::Duhem => {}
    }
    bounds
}
