//! Differential evolution (Storn and Price, Journal of Global Optimization 11, 1997): the least value in a box, where a simplex
//! would stop in the first dip.

use hysteron_identify::simplex::Vertex;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Members for each variable.
const MEMBERS: usize = 10;
/// Share of the variables that a trial takes over from its mutant.
const CROSSOVER: f64 = 0.7;

/// The least value of `f` found within `bounds` (lowest and highest of each variable), and where; the same for the same seed.
///
/// The best member, moved by 0.5 to 1 of the difference of two others, is crossed with each member in turn.
///
/// # Cost
/// [`MEMBERS`] evaluations for each variable and generation.
pub(super) fn minimum(bounds: &[(f64, f64)], generations: usize, seed: u64, f: impl Fn(&[f64]) -> f64) -> Vertex {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let valued = |x: Vec<f64>| {
        let value = f(&x);
        (x, value)
    };
    let thrown: Vec<Vec<f64>> = (0..MEMBERS * bounds.len())
        .map(|_| {
            let within = |&(low, high): &(f64, f64)| low + (high - low) * random.random::<f64>();
            bounds.iter().map(within).collect()
        })
        .collect();
    let mut members: Vec<Vertex> = thrown.into_iter().map(valued).collect();
    let best = |members: &[Vertex]| {
        let least = members.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        least.map_or_else(|| (Vec::new(), f64::INFINITY), Clone::clone)
    };
    for _ in 0..generations {
        let (leader, _) = best(&members);
        let weight = 0.5 + 0.5 * random.random::<f64>();
        let trials: Vec<Vec<f64>> = (0..members.len())
            .map(|n| {
                let one = &members[random.random_range(0..members.len())].0;
                let other = &members[random.random_range(0..members.len())].0;
                let always = random.random_range(0..bounds.len());
                let mut trial = members[n].0.clone();
                for (i, &(low, high)) in bounds.iter().enumerate() {
                    if i == always || random.random::<f64>() < CROSSOVER {
                        let moved = leader[i] + weight * (one[i] - other[i]);
                        // Outside, anywhere within: on the border the members would gather.
                        trial[i] = if (low..=high).contains(&moved) {
                            moved
                        } else {
                            low + (high - low) * random.random::<f64>()
                        };
                    }
                }
                trial
            })
            .collect();
        let tried: Vec<Vertex> = trials.into_iter().map(valued).collect();
        for (member, trial) in members.iter_mut().zip(tried) {
            if trial.1 <= member.1 {
                *member = trial;
            }
        }
    }
    best(&members)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Rastrigin's function: a parabola with a dip at every whole number, the deepest at 0; the best of three searches.
    #[test]
    fn val_the_deepest_of_many_dips() {
        let rastrigin = |x: &[f64]| x.iter().map(|x| x * x + 10.0 * (1.0 - (TAU * x).cos())).sum::<f64>();
        for first in [0, 3, 6] {
            let searches = (first..first + 3).map(|seed| minimum(&[(-5.0, 4.0); 4], 300, seed, rastrigin));
            let (x, value) = searches.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            assert!(value < 1e-6, "seeds from {first}: {value} at {x:?}");
        }
    }
}
