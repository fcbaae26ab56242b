//! Identification of a rival: least squares inside, a simplex over the few parameters it is not linear in outside, and Gauss-Newton
//! for a product of both where dead zones stand behind the plays.

use super::{Columns, DeadZones, Rival, RivalModel, Shape};
use crate::columns::Run;
use crate::error::IdentifyError;
use crate::family::MAX_PLAYS;
use crate::family::{Direction, peak_to_peak, range};
use crate::normal::Normal;
use crate::objective::{Weighting, runs};
use crate::separable::{RIDGE, SEARCH_ROWS};
use crate::simplex;
use crate::start_state::InitialState;
use hysteron_core::model::Hysteresis;
use hysteron_data::Dataset;

/// A rival's model and how far it is off.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedRival {
    /// The model.
    pub model: RivalModel,
    /// The objective (eq. 17 with the weights of eq. 18).
    pub objective: f64,
    /// Rms error on each record that it was fitted to, percent of the output's peak to peak.
    pub rms_percent: Vec<f64>,
}

/// Fits a rival as a direct inverse (position to voltage) to the records with role `identify`, with the paper's objective (17) and
/// weights (18), thresholds by eq. 16.
///
/// Each record is run once to settle before it counts, as periodic ones are: all plays are narrower than half the range. All
/// records have one sample rate.
///
/// # Errors
/// As [`crate::fit()`].
///
/// # Cost
/// Some 300 passes over the samples: seconds for 30 000.
pub fn fit_rival(dataset: &Dataset, rival: Rival, plays: usize) -> Result<FittedRival, IdentifyError> {
    let runs = runs(dataset, Direction::Inverse, Weighting::LoopOpening, &[]);
    if runs.is_empty() {
        return Err(IdentifyError::NothingToFit);
    }
    if !(1..=MAX_PLAYS).contains(&plays) {
        return Err(IdentifyError::Plays { plays, max: MAX_PLAYS });
    }
    let (low, high) = range(runs.iter().flat_map(|run| run.input.iter().copied()));
    if high <= low {
        return Err(IdentifyError::NoExcitation { input: "position" });
    }
    let samples = runs.iter().map(|run| run.input.len()).sum();
    let parameters = 1 + rival.columns(plays) + rival.dead_zones();
    if samples <= parameters {
        return Err(IdentifyError::TooFewSamples { samples, parameters });
    }
    let step = 0.5 * (high - low) / plays as f64;
    let scales = Scales {
        step,
        fastest: fastest(&runs).max(f64::MIN_POSITIVE),
        period_s: runs.iter().map(|run| run.period_s).fold(f64::INFINITY, f64::min),
    };
    let columns = |shape| Columns {
        rival,
        thresholds: (0..plays).map(|i| step * i as f64).collect(),
        shape,
    };
    let stride = samples.div_ceil(SEARCH_ROWS);
    let straight = |shape| {
        let rows = Rows::of(&columns(shape), &runs, stride);
        let weights = rows.linear();
        rows.objective(&weights, &DeadZones::default())
    };
    let shape = search(rival, &scales, straight);
    let rows = Rows::of(&columns(shape), &runs, 1);
    let (weights, zones) = rows.bent(rival.dead_zones());
    let objective = rows.objective(&weights, &zones);
    let (offset, inner) = (weights[0], weights[1..].to_vec());
    let model = RivalModel {
        columns: columns(shape),
        weights: inner,
        zones,
        offset,
        range: [low, high],
        samples_per_s: 1.0 / scales.period_s,
    };
    let rms_percent = runs.iter().map(|run| off(&model, run)).collect();
    Ok(FittedRival {
        model,
        objective,
        rms_percent,
    })
}

/// Largest rate of the inputs by differences over ten samples, which the sensor's noise does not rule.
fn fastest(runs: &[Run<'_>]) -> f64 {
    let of_run = |run: &Run<'_>| {
        let tenth = |pair: &[f64]| (pair[10] - pair[0]).abs() / (10.0 * run.period_s);
        run.input.windows(11).map(tenth).fold(0.0, f64::max)
    };
    runs.iter().map(of_run).fold(0.0, f64::max)
}

/// What the search's numbers are counted in.
struct Scales {
    /// Distance of two thresholds.
    step: f64,
    /// Largest rate, per second.
    fastest: f64,
    period_s: f64,
}

/// The parameters that a rival is not linear in, from logarithms.
fn shape_of(rival: Rival, scales: &Scales, logs: &[f64]) -> Shape {
    let value = |i: usize| logs.get(i).copied().unwrap_or(0.0).clamp(-20.0, 20.0).exp();
    match rival {
        Rival::DynamicWeights => Shape::Fixed,
        Rival::LogThresholds => {
            // At rest i times a step; beta = e^(1/q), kept finite; at the fastest rate the logarithm's argument is 1 + s times beta.
            let (rest, q, epsilon) = (scales.step * value(0), value(1).max(0.1), value(3).min(4.0));
            let beta = (1.0 / q).exp();
            Shape::Log {
                alpha: q * rest,
                beta,
                lambda: beta * value(2) / scales.fastest.powf(epsilon),
                epsilon,
            }
        }
        Rival::LinearThresholds => Shape::Linear {
            alpha: scales.step * value(0),
            beta_s: scales.period_s * value(1),
        },
        Rival::VelocityDamping => Shape::Power {
            exponent: value(0).min(4.0),
        },
    }
}

/// The best shape from several starts of a simplex.
fn search(rival: Rival, scales: &Scales, objective: impl Fn(Shape) -> f64) -> Shape {
    // Logarithms of: step at rest, q, growth at the fastest rate, exponent; step, growth in samples; exponent.
    let starts: &[&[f64]] = match rival {
        Rival::DynamicWeights => return Shape::Fixed,
        Rival::LogThresholds => &[&[0.0, 0.0, 0.0, 0.0], &[0.0, 0.0, 1.5, 0.5], &[-0.5, 1.0, -1.0, 0.0]],
        Rival::LinearThresholds => &[&[0.0, -1.0], &[0.0, 1.0], &[-0.3, 2.0]],
        Rival::VelocityDamping => &[&[0.0], &[-0.7]],
    };
    let found = starts.iter().map(|start| {
        simplex::minimum(start, 0.4, 60, simplex::is_level, |logs| {
            objective(shape_of(rival, scales, logs))
        })
    });
    let best = found.min_by(|a, b| a.1.total_cmp(&b.1));
    shape_of(rival, scales, &best.map(|(logs, _)| logs).unwrap_or_default())
}

/// The columns of all samples: offset first.
struct Rows {
    width: usize,
    cells: Vec<f64>,
    targets: Vec<f64>,
    /// Weight of each sample's squared error.
    weights: Vec<f64>,
}

/// Rounds of dead zones and plays in turn; each lowers the objective or is the last.
const ROUNDS: usize = 20;
/// A round that lowers it by less is the last.
const ENOUGH: f64 = 1e-4;

impl Rows {
    /// Every `stride`-th sample.
    fn of(columns: &Columns, runs: &[Run<'_>], stride: usize) -> Self {
        let width = 1 + columns.rival.columns(columns.thresholds.len());
        let mut rows = Self {
            width,
            cells: Vec::new(),
            targets: Vec::new(),
            weights: Vec::new(),
        };
        let mut row = vec![0.0; width];
        row[0] = 1.0;
        for run in runs {
            let mut state = columns.start(run.input.first().copied().unwrap_or(0.0));
            for &input in settling(run) {
                columns.advance(&mut state, input, 1.0 / run.period_s, &mut row[1..]);
            }
            for (k, (&input, &output)) in run.input.iter().zip(run.output).enumerate() {
                columns.advance(&mut state, input, 1.0 / run.period_s, &mut row[1..]);
                if k % stride != 0 {
                    continue;
                }
                rows.cells.extend_from_slice(&row);
                rows.targets.push(output);
                rows.weights.push(run.weight);
            }
        }
        rows
    }

    fn each(&self) -> impl Iterator<Item = (&[f64], f64, f64)> {
        let cells = self.cells.chunks_exact(self.width);
        let samples = cells.zip(&self.targets).zip(&self.weights);
        samples.map(|((row, &target), &weight)| (row, target, weight))
    }

    /// Weighted least squares of columns and target that a row is turned into.
    fn solve(&self, width: usize, turn: impl Fn(&[f64], f64, &mut [f64]) -> f64) -> Vec<f64> {
        let mut normal = Normal::new(width);
        let mut cells = vec![0.0; width];
        for (row, target, weight) in self.each() {
            let left = turn(row, target, &mut cells);
            let scale = weight.sqrt();
            cells.iter_mut().for_each(|cell| *cell *= scale);
            normal.add_row(&cells, scale * left);
        }
        normal.solve(RIDGE)
    }

    fn linear(&self) -> Vec<f64> {
        self.solve(self.width, |row, target, cells| {
            cells.copy_from_slice(row);
            target
        })
    }

    /// Sum before the dead zones, without the offset.
    fn inner(row: &[f64], weights: &[f64]) -> f64 {
        row[1..].iter().zip(&weights[1..]).map(|(x, w)| x * w).sum()
    }

    fn objective(&self, weights: &[f64], zones: &DeadZones) -> f64 {
        let squared = |(row, target, weight): (&[f64], f64, f64)| {
            weight * (target - weights[0] - zones.output(Self::inner(row, weights))).powi(2)
        };
        self.each().map(squared).sum()
    }

    /// Weights and dead zones: the zones' slopes by least squares, the weights by a step of Gauss and Newton, in turn.
    fn bent(&self, count: usize) -> (Vec<f64>, DeadZones) {
        let mut weights = self.linear();
        if count == 0 {
            return (weights, DeadZones::default());
        }
        let (low, high) = range(self.each().map(|(row, ..)| Self::inner(row, &weights)));
        let mut zones = DeadZones::over([low, high], count);
        let mut least = self.objective(&weights, &zones);
        for _ in 0..ROUNDS {
            let (mut next, mut bent) = (weights.clone(), zones.clone());
            let slopes = self.solve(1 + count, |row, target, cells| {
                let x = Self::inner(row, &next);
                cells[0] = 1.0;
                cells[1..].iter_mut().zip(zones.passed(x)).for_each(|(c, p)| *c = p);
                target - x
            });
            next[0] = slopes[0];
            bent.set_slopes(&slopes[1..]);
            let step = self.solve(self.width, |row, target, cells| {
                let x = Self::inner(row, &next);
                let slope = bent.slope(x);
                cells.iter_mut().zip(row).for_each(|(c, value)| *c = slope * value);
                cells[0] = 1.0;
                target - next[0] - bent.output(x)
            });
            let moved = |share: f64| -> Vec<f64> { next.iter().zip(&step).map(|(w, s)| w + share * s).collect() };
            let tried = [1.0, 0.5, 0.25, 0.0].map(|share| (self.objective(&moved(share), &bent), share));
            let (left, share) = tried
                .into_iter()
                .fold((f64::INFINITY, 0.0), |a, b| if b.0 < a.0 { b } else { a });
            if left >= least {
                break;
            }
            let enough = left > (1.0 - ENOUGH) * least;
            (least, weights, zones) = (left, moved(share), bent);
            if enough {
                break;
            }
        }
        (weights, zones)
    }
}

/// What is played before a record counts: a period where it has one, the whole record else.
fn settling<'a>(run: &Run<'a>) -> &'a [f64] {
    match run.initial {
        InitialState::Periodic { samples } => &run.input[..samples.min(run.input.len())],
        InitialState::Remanent { .. } => run.input,
    }
}

/// Rms error on a record, percent of the output's peak to peak.
fn off(model: &RivalModel, run: &Run<'_>) -> f64 {
    let mut state = model.start(run.input.first().copied().unwrap_or(0.0));
    for &input in settling(run) {
        model.step(&mut state, input);
    }
    let outputs = run.input.iter().map(|&input| model.step(&mut state, input));
    let squares: f64 = outputs
        .zip(run.output)
        .map(|(found, wanted)| (wanted - found).powi(2))
        .sum();
    100.0 * (squares / run.input.len() as f64).sqrt() / peak_to_peak(run.output)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot run its subject fails")]
    use super::*;
    use crate::rivals::DeadZones;
    use hysteron_data::{Record, Role};
    use std::f64::consts::TAU;

    const PERIOD_S: f64 = 1e-4;
    const PLAYS: usize = 5;

    /// Positions of three sines over 0 to 10 um, voltages by a rival whose parameters are known.
    fn records(rival: Rival, shape: Shape, weights: Vec<f64>, slopes: &[f64]) -> Dataset {
        let mut zones = DeadZones::over([2.0, 12.0], slopes.len());
        zones.set_slopes(slopes);
        let model = RivalModel {
            columns: Columns {
                rival,
                thresholds: (0..PLAYS).map(|i| i as f64).collect(),
                shape,
            },
            weights,
            zones,
            offset: 1.0,
            range: [0.0, 10.0],
            samples_per_s: 1.0 / PERIOD_S,
        };
        let record = |hz: f64| {
            let position_um: Vec<f64> = (0..4000)
                .map(|k| 5.0 - 5.0 * (TAU * hz * f64::from(k) * PERIOD_S).cos())
                .collect();
            let mut state = model.start(0.0);
            let voltages = position_um
                .iter()
                .chain(&position_um)
                .map(|&y| model.step(&mut state, y));
            let voltage_v = voltages.skip(position_um.len()).collect();
            Record::new(format!("{hz}.csv"), Role::Identify, PERIOD_S, voltage_v, position_um)
        };
        Dataset {
            records: vec![record(5.0), record(20.0), record(50.0)],
            ..Dataset::default()
        }
    }

    /// A rival finds what a rival of known parameters made, without a bend (the fit places levels of its own): nothing but the search's
    /// own end is left, 0.1 % of peak to peak.
    #[test]
    fn val_known_rivals_are_found_again() {
        let plays = vec![2.0, -0.3, -0.2, 0.1, -0.15];
        let with = |more: &[f64]| plays.iter().chain(more).copied().collect::<Vec<f64>>();
        let log = Shape::Log {
            alpha: 0.6,
            beta: 5.0,
            lambda: 0.01,
            epsilon: 1.0,
        };
        let linear = Shape::Linear {
            alpha: 0.9,
            beta_s: 4e-4,
        };
        let cases = [
            (
                Rival::DynamicWeights,
                Shape::Fixed,
                with(&[1e-4, -2e-4, 1e-4, 0.0, -1e-4]),
                &[0.0; 4][..],
            ),
            (Rival::LogThresholds, log, with(&[1.0, 0.002]), &[]),
            (Rival::LinearThresholds, linear, plays.clone(), &[0.0; 4]),
            (
                Rival::VelocityDamping,
                Shape::Power { exponent: 0.7 },
                with(&[1.0, 0.002, 0.01]),
                &[],
            ),
        ];
        for (rival, shape, weights, slopes) in cases {
            let count = weights.len() + slopes.len() + shape.parameters();
            let found = fit_rival(&records(rival, shape, weights, slopes), rival, PLAYS).unwrap();
            assert_eq!(found.model.parameters(), count);
            for percent in &found.rms_percent {
                assert!(*percent < 0.1, "{rival:?}: {:?}", found.rms_percent);
            }
        }
    }

    #[test]
    fn refuse_records_that_stand_still_and_numbers_of_plays() {
        let mut still = records(Rival::LinearThresholds, Shape::Fixed, vec![1.0; PLAYS], &[0.0; 4]);
        assert!(matches!(
            fit_rival(&still, Rival::DynamicWeights, 0),
            Err(IdentifyError::Plays { plays: 0, .. })
        ));
        for record in &mut still.records {
            record.position_um.fill(1.0);
        }
        assert!(matches!(
            fit_rival(&still, Rival::DynamicWeights, PLAYS),
            Err(IdentifyError::NoExcitation { .. })
        ));
        let none = Dataset::default();
        assert!(matches!(
            fit_rival(&none, Rival::DynamicWeights, PLAYS),
            Err(IdentifyError::NothingToFit)
        ));
    }
}
