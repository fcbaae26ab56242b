//! Creep from holds: what the position still does while the voltage stands.

use super::model::{CREEP_FAST, CREEP_SLOW, CreepPart};
use crate::error::IdentifyError;
use hysteron_data::Record;
use nalgebra::{DMatrix, DVector};

/// How strongly neighbouring elements are held equal, as a share of the data's own weight: the logarithmic law is the prior,
/// so that elements which a hold of seconds cannot tell apart (below a millisecond, above the hold) follow their neighbours.
const PRIOR: f64 = 1e-2;
/// Time after a change of the voltage that is not looked at, seconds: lag and latency are over, and ringing of 700 Hz with 2 %
/// damping has lost 99 % of the little that a smooth move leaves.
const SETTLING_S: f64 = 0.05;

/// Time constants, one every 0.67 decades from 0.35 ms to 350 s: five fast, five slow.
pub(super) fn time_constants() -> [f64; CREEP_FAST + CREEP_SLOW] {
    core::array::from_fn(|i| 3.5e-4 * 10_f64.powf(i as f64 * 6.0 / 9.0))
}

/// Fits the shares of a creep chain to records in which the voltage rests at levels.
///
/// The displacement before creep is unknown but constant at each level: a level a hold and the shares are solved for
/// together, by Gauss-Newton from shares of zero.
///
/// # Errors
/// Records without two different levels held for at least a second.
pub(super) fn fit(holds: &[&Record]) -> Result<CreepPart, IdentifyError> {
    let tau_s = time_constants();
    let states = tau_s.len();
    let plans: Vec<Plan> = holds.iter().map(|record| Plan::new(record)).collect();
    let held: usize = plans.iter().map(|plan| plan.levels.len()).sum();
    if held == 0 {
        return Err(IdentifyError::Control {
            reason: "no record holds the voltage for a second or more; record a step with at least 10 s of rest".into(),
        });
    }
    let mut levels: Vec<Vec<f64>> = plans.iter().map(Plan::first_levels).collect();
    let mut shares = vec![0.0; states];
    for _ in 0..6 {
        let unknowns = held + states;
        let mut normal = DMatrix::<f64>::zeros(unknowns, unknowns);
        let mut right = DVector::<f64>::zeros(unknowns);
        let mut offset = 0;
        for (plan, level_um) in plans.iter().zip(&levels) {
            plan.rows(level_um, &shares, &tau_s, &mut |row_levels, crept, miss, weight| {
                let mut row = DVector::<f64>::zeros(unknowns);
                for (i, &value) in row_levels.iter().enumerate() {
                    row[offset + i] = value;
                }
                for (i, &value) in crept.iter().enumerate() {
                    row[held + i] = value;
                }
                normal.ger(weight, &row, &row, 1.0);
                right.axpy(weight * miss, &row, 1.0);
            });
            offset += plan.levels.len();
        }
        let scale = (held..unknowns).map(|i| normal[(i, i)]).sum::<f64>() / states as f64 * PRIOR;
        for i in 1..states {
            let (a, b) = (held + i - 1, held + i);
            normal[(a, a)] += scale;
            normal[(b, b)] += scale;
            normal[(a, b)] -= scale;
            normal[(b, a)] -= scale;
            let difference = scale * (shares[i] - shares[i - 1]);
            right[b] -= difference;
            right[a] += difference;
        }
        let Some(step) = normal.lu().solve(&right) else {
            break;
        };
        let mut next = step.iter();
        levels
            .iter_mut()
            .flatten()
            .zip(&mut next)
            .for_each(|(level, d)| *level += d);
        shares.iter_mut().zip(next).for_each(|(share, d)| *share += d);
    }
    // A share below zero is noise about a share of zero; the core's chain has none.
    let shares: Vec<f64> = shares.iter().map(|share| share.clamp(0.0, 0.2)).collect();
    Ok(CreepPart {
        tau_s: tau_s.to_vec(),
        shares,
    })
}

/// Faster elements have lost 95 % before a hold is looked at.
const UNSEEN_S: f64 = SETTLING_S / 3.0;
/// How much of its fast creep is tried: none, half, all that the slow creep suggests.
const TRIED: [f64; 3] = [0.0, 0.5, 1.0];
/// The most that is taken of it.
const MOST_FAST: f64 = 1.5;

/// The creep with as much of what is faster than a hold can show as leaves least of the large signals: the lowest point of a parabola
/// through what three amounts leave.
///
/// # Cost
/// Three fits of the inverse.
pub(super) fn as_fast_as_loops_say(by_holds: CreepPart, left: &(dyn Fn(&CreepPart) -> f64 + Sync)) -> CreepPart {
    let with = |amount: f64| {
        let mut creep = by_holds.clone();
        let fast = creep
            .tau_s
            .iter()
            .zip(&mut creep.shares)
            .filter(|(tau_s, _)| **tau_s < UNSEEN_S);
        fast.for_each(|(_, share)| *share *= amount);
        creep
    };
    let squares = TRIED.map(|amount| left(&with(amount)).powi(2));
    let (down, up) = (squares[0] - squares[1], squares[2] - squares[1]);
    let bend = down + up;
    if !(bend > 0.0 && bend.is_finite()) {
        return by_holds;
    }
    with((0.5 + 0.25 * (down - up) / bend).clamp(0.0, MOST_FAST))
}

/// Where the voltage of a record rests, and where it moves.
struct Plan<'a> {
    record: &'a Record,
    /// First and one-past-last sample of each rest.
    levels: Vec<(usize, usize)>,
}

impl<'a> Plan<'a> {
    fn new(record: &'a Record) -> Self {
        let least = (1.0 / record.period_s).ceil() as usize;
        let mut levels = Vec::new();
        let mut start = 0;
        for k in 1..=record.len() {
            if k == record.len() || record.voltage_v[k] != record.voltage_v[start] {
                // A rest at the record's start, before anything has moved, has no level to find.
                if k - start >= least && start > 0 {
                    levels.push((start, k));
                }
                start = k;
            }
        }
        Self { record, levels }
    }

    fn first_levels(&self) -> Vec<f64> {
        let settling = (SETTLING_S / self.record.period_s).ceil() as usize;
        self.levels
            .iter()
            .map(|&(from, to)| self.record.position_um[(from + settling).min(to - 1)])
            .collect()
    }

    /// For every sample at rest after settling: what a unit of each level contributes, what a unit of each share does, and
    /// what the model misses. Samples are weighed by 1 / t within a hold: every decade of time counts alike.
    fn rows(&self, level_um: &[f64], shares: &[f64], tau_s: &[f64], add: &mut impl FnMut(&[f64], &[f64], f64, f64)) {
        let period_s = self.record.period_s;
        let settling = (SETTLING_S / period_s).ceil() as usize;
        let decays: Vec<f64> = tau_s.iter().map(|tau| (-period_s / tau).exp()).collect();
        // The answer of each element to each level's profile: 0 before its hold, a ramp up to it, 1 in it, 0 after.
        let mut elements = vec![vec![0.0; tau_s.len()]; level_um.len()];
        for k in 0..self.record.len() {
            let profile: Vec<f64> = (0..level_um.len()).map(|i| self.profile(i, k)).collect();
            for (states, &part) in elements.iter_mut().zip(&profile) {
                for (state, &decay) in states.iter_mut().zip(&decays) {
                    *state = decay * *state + (1.0 - decay) * part;
                }
            }
            let Some(&(from, _)) = self.levels.iter().find(|&&(from, to)| k >= from + settling && k < to) else {
                continue;
            };
            let row: Vec<f64> = profile
                .iter()
                .zip(&elements)
                .map(|(part, states)| part + shares.iter().zip(states).map(|(c, s)| c * s).sum::<f64>())
                .collect();
            let crept: Vec<f64> = (0..tau_s.len())
                .map(|j| {
                    level_um
                        .iter()
                        .zip(&elements)
                        .map(|(level, states)| level * states[j])
                        .sum()
                })
                .collect();
            let fitted: f64 = row.iter().zip(level_um).map(|(r, level)| r * level).sum();
            let weight = 1.0 / (k - from) as f64;
            add(&row, &crept, self.record.position_um[k] - fitted, weight);
        }
    }

    /// How much of level `i` stands at sample `k`: 1 in its rest, half cosines over the moves beside it.
    fn profile(&self, i: usize, k: usize) -> f64 {
        let (from, to) = self.levels[i];
        if (from..to).contains(&k) {
            return 1.0;
        }
        let ramp = |start: usize, end: usize| {
            let share = (k - start) as f64 / (end - start) as f64;
            0.5 * (1.0 - (std::f64::consts::PI * share).cos())
        };
        if k < from {
            // The move begins where the voltage leaves the rest before.
            let start = if i == 0 {
                self.moves_from(from)
            } else {
                self.levels[i - 1].1 - 1
            };
            if k > start { ramp(start, from) } else { 0.0 }
        } else {
            match self.levels.get(i + 1) {
                Some(&(next, _)) if k < next => 1.0 - ramp(to - 1, next),
                _ => 0.0,
            }
        }
    }

    /// The last sample at which the voltage is still what it was at the start.
    fn moves_from(&self, from: usize) -> usize {
        let start_v = self.record.voltage_v[0];
        (0..from)
            .take_while(|&k| self.record.voltage_v[k] == start_v)
            .last()
            .unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is left is least at 0.3 of the fast creep: the three fast elements get it, the slow ones stay. Where nothing bends upwards the
    /// holds have the last word; beyond one and a half nothing is taken.
    #[test]
    fn bva_as_much_fast_creep_as_leaves_least() {
        let tau_s = time_constants().to_vec();
        let by_holds = CreepPart {
            shares: vec![0.01; tau_s.len()],
            tau_s,
        };
        let fast = |left: &(dyn Fn(f64) -> f64 + Sync)| {
            let found = as_fast_as_loops_say(by_holds.clone(), &|creep| left(creep.shares[0] / 0.01));
            assert_eq!(found.shares[3..], by_holds.shares[3..]);
            assert!(found.shares[..3].iter().all(|share| *share == found.shares[0]));
            found.shares[0] / 0.01
        };
        assert!((fast(&|amount| (1.0 + (amount - 0.3).powi(2)).sqrt()) - 0.3).abs() < 1e-9);
        assert_eq!(fast(&|amount| 2.0 - amount.powi(2)), 1.0);
        assert_eq!(fast(&|_| f64::INFINITY), 1.0);
        assert!((fast(&|amount| (1.0 + (amount - 1.49).powi(2)).sqrt()) - 1.49).abs() < 1e-9);
        assert_eq!(fast(&|amount| (1.0 + (amount - 1.6).powi(2)).sqrt()), 1.5);
        assert_eq!(fast(&|amount| (1.0 + (amount + 0.2).powi(2)).sqrt()), 0.0);
    }
}
