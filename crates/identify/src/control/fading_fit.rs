//! Hysteresis of Duhem's kind, identified forward through the known linear part on either side of it.

use super::fading_part::FadingPart;
use super::inverse::{self, Around, ROWS_A_RECORD, Seen};
use super::linear_part::LONGEST_LAG_S;
use super::model::InversePart;
use super::timing::{LARGEST_GROWTH, MOST_OFF, Timing, behind_lag};
use crate::error::IdentifyError;
use crate::fading::lengths;
use crate::normal::Normal;
use hysteron_core::error::ParamError;
use hysteron_core::fading::{FADING_DEGREE, FadingModel, FadingNumbers};
use hysteron_core::model::{DirectInverse as _, Hysteresis as _};
use hysteron_core::tracking_law::FADING;
use hysteron_data::Record;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// What a length has of its own: an element of each power, and what is left of where it began.
const OF_A_LENGTH: usize = FADING_DEGREE + 1;
/// Elements of one power each: those of a length are summed once their coefficients are known.
const SINGLE: usize = FADING * OF_A_LENGTH;
/// Coefficients: constant, powers of the voltage, single elements.
const COLUMNS: usize = 1 + FADING_DEGREE + SINGLE;
/// Ridge on the scaled columns, the least and the largest that is tried.
const RIDGES: [f64; 2] = [1e-10, 1e-4];
/// Most that the lengths are moved together, octaves.
const MOST_OCTAVES: f64 = 0.5;
/// Rounds of filling in what the structure hides. What is said stands there after one; the others follow what that changes.
pub(super) const ROUNDS: usize = 3;
/// Share of the play table's error on records that neither saw, below which fading elements stand in its place.
const CLEARLY: f64 = 0.6;

/// What is not linear: when a command acts, and by how many octaves the lengths are moved.
#[derive(Debug, Clone, Copy)]
struct Trial {
    timing: Timing,
    octaves: f64,
}

/// Records and the range of their voltages.
struct Problem<'s, 'r> {
    seen: &'s [Seen<'r>],
    range_v: [f64; 2],
}

/// Coefficients, and what they leave of each row, micrometres.
struct Solved {
    coefficients: Vec<f64>,
    left_um: Vec<f64>,
}

impl Solved {
    fn rms_um(&self) -> f64 {
        let squares: f64 = self.left_um.iter().map(|um| um * um).sum();
        (squares / (self.left_um.len() as f64).max(1.0)).sqrt()
    }
}

impl Problem<'_, '_> {
    fn lengths_v(&self, octaves: f64) -> Vec<f64> {
        let [low_v, high_v] = self.range_v;
        lengths(FADING, (high_v - low_v) * octaves.exp2())
    }

    /// Elements that follow one power each, from cycles over the range on, and one of each length that follows nothing and begins at 1:
    /// nobody says how far the stage was cycled.
    fn single(&self, octaves: f64) -> Result<FadingModel<f64, SINGLE>, ParamError> {
        let [min_v, max_v] = self.range_v;
        let lengths_v = self.lengths_v(octaves);
        let curve = |i: usize| std::array::from_fn(|power| f64::from(u8::from(power == i % OF_A_LENGTH)));
        let mut numbers = FadingNumbers {
            min_v,
            max_v,
            offset: 0.0,
            input_function: [0.0; FADING_DEGREE],
            lengths_v: std::array::from_fn(|i| lengths_v[i / OF_A_LENGTH]),
            curves: std::array::from_fn(curve),
            rest: [0.0; SINGLE],
        };
        numbers.rest = FadingModel::new(&numbers)?.cycled(0.0, false).held();
        for alone in numbers.rest.iter_mut().skip(FADING_DEGREE).step_by(OF_A_LENGTH) {
            *alone = 1.0;
        }
        FadingModel::new(&numbers)
    }

    /// Least squares with a trial's timing and lengths.
    fn solve(&self, trial: Trial, ridge: f64) -> Result<Solved, ParamError> {
        let single = self.single(trial.octaves)?;
        let [low_v, high_v] = self.range_v;
        let of_record = |seen: &Seen<'_>| -> Vec<([f64; COLUMNS], f64)> {
            let stride = seen.to.div_ceil(ROWS_A_RECORD).max(1);
            let mut state = single.rest();
            let mut rows = Vec::with_capacity(seen.to / stride + 1);
            for (k, v) in behind_lag(seen.record, trial.timing)
                .into_iter()
                .take(seen.to)
                .enumerate()
            {
                single.step(&mut state, v);
                if k % stride == 0 {
                    let u = (2.0 * (v - low_v) / (high_v - low_v) - 1.0).clamp(-1.0, 1.0);
                    let mut row = [1.0; COLUMNS];
                    row[1..=FADING_DEGREE].copy_from_slice(&[u, u * u, u * u * u]);
                    row[1 + FADING_DEGREE..].copy_from_slice(&state.held());
                    rows.push((row, seen.before_creep_um[k]));
                }
            }
            rows
        };
        let rows: Vec<([f64; COLUMNS], f64)> = self.seen.par_iter().flat_map_iter(of_record).collect();
        let mut normal = Normal::new(COLUMNS);
        let mut right = DVector::<f64>::zeros(COLUMNS);
        for (row, target) in &rows {
            normal.add_row(row, 0.0);
            right.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * target);
        }
        let coefficients: Vec<f64> = normal.solve_for(&right, ridge).to_vec();
        let fitted = |row: &[f64]| row.iter().zip(&coefficients).map(|(x, c)| x * c).sum::<f64>();
        let left_um = rows.iter().map(|(row, target)| target - fitted(row)).collect();
        Ok(Solved { coefficients, left_um })
    }

    fn part(&self, octaves: f64, coefficients: &[f64]) -> Result<FadingPart, ParamError> {
        let lengths_v = self.lengths_v(octaves);
        let [min_v, max_v] = self.range_v;
        let three = |from: usize| std::array::from_fn(|power| coefficients[from + power]);
        let of_length = |i: usize| 1 + FADING_DEGREE + OF_A_LENGTH * i;
        let began = self.single(octaves)?.rest().held();
        let rest = |i: usize| {
            (0..OF_A_LENGTH)
                .map(|k| began[OF_A_LENGTH * i + k] * coefficients[of_length(i) + k])
                .sum()
        };
        Ok(FadingPart {
            min_v,
            max_v,
            offset_um: coefficients[0],
            input_function_um: three(1),
            lengths_v: std::array::from_fn(|i| lengths_v[i]),
            curves_um: std::array::from_fn(|i| three(of_length(i))),
            rest_um: std::array::from_fn(rest),
        })
    }

    /// The trial that leaves least, by steps of Gauss and Newton: lag, its growth, latency about the stated one, lengths.
    fn refined(&self, from: Trial, stated_s: f64) -> Result<Trial, ParamError> {
        const FREE: usize = 4;
        const STEP: f64 = 1e-3;
        const STEPS: usize = 5;
        let period_s = self.seen.first().map_or(0.0, |s| s.record.period_s);
        let most_per_v = LARGEST_GROWTH / from.timing.lag.about_v.abs().max(f64::MIN_POSITIVE);
        let scale = [from.timing.lag.tau_s.max(0.5 * period_s), most_per_v, period_s, 1.0];
        let moved = |trial: Trial, by: [f64; FREE]| {
            let mut timing = trial.timing.moved([by[0], by[1], by[2]]);
            let most_s = MOST_OFF * period_s;
            timing.lag.tau_s = timing.lag.tau_s.clamp(0.0, LONGEST_LAG_S);
            timing.lag.per_v = timing.lag.per_v.clamp(-most_per_v, most_per_v);
            timing.latency_s = timing.latency_s.clamp(stated_s - most_s, stated_s + most_s);
            Trial {
                timing,
                octaves: (trial.octaves + by[3]).clamp(-MOST_OCTAVES, MOST_OCTAVES),
            }
        };
        let (mut trial, mut solved) = (from, self.solve(from, RIDGES[0])?);
        for _ in 0..STEPS {
            let slopes = (0..FREE)
                .map(|k| {
                    let by = std::array::from_fn(|i| if i == k { STEP * scale[i] } else { 0.0 });
                    let other = self.solve(moved(trial, by), RIDGES[0])?;
                    let pairs = other.left_um.iter().zip(&solved.left_um);
                    Ok(pairs.map(|(a, b)| (a - b) / STEP).collect::<Vec<f64>>())
                })
                .collect::<Result<Vec<_>, ParamError>>()?;
            let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let right = DVector::from_fn(FREE, |i, _| product(&slopes[i], &solved.left_um));
            let normal = DMatrix::from_fn(FREE, FREE, |i, j| product(&slopes[i], &slopes[j]));
            let Some(factor) = normal.cholesky() else { break };
            let step = factor.solve(&right);
            let whole = (0.5 / step.amax()).min(1.0);
            let mut better = None;
            for share in [1.0, 0.5, 0.25] {
                let next = moved(trial, std::array::from_fn(|i| -scale[i] * whole * share * step[i]));
                let next_solved = self.solve(next, RIDGES[0])?;
                if next_solved.rms_um() < solved.rms_um() {
                    better = Some((next, next_solved));
                    break;
                }
            }
            let Some(next) = better else { break };
            (trial, solved) = next;
        }
        Ok(trial)
    }

    /// The elements of the least ridge that rise everywhere, with the rms of what is left, micrometres; those of the largest where none do.
    fn rising(&self, trial: Trial) -> Result<(FadingPart, f64), ParamError> {
        let [mut ridge, largest] = RIDGES;
        loop {
            let solved = self.solve(trial, ridge)?;
            let part = self.part(trial.octaves, &solved.coefficients)?;
            if part.to_core::<f64>().is_ok() || ridge >= largest {
                return Ok((part, solved.rms_um()));
            }
            ridge *= 10.0;
        }
    }
}

/// Position before creep that elements say of a record, micrometres.
fn said_um(part: &FadingPart, record: &Record, timing: Timing) -> Result<Vec<f64>, ParamError> {
    let model = part.forward::<f64>()?;
    let mut state = model.rest();
    Ok(behind_lag(record, timing)
        .into_iter()
        .map(|v| model.step(&mut state, v))
        .collect())
}

/// Records with structure and creep undone.
fn seen<'a>(records: &[&'a Record], around: &Around<'_>) -> Result<Vec<Seen<'a>>, IdentifyError> {
    let Some(first) = records.first() else {
        return Err(IdentifyError::NothingToFit);
    };
    let creep = around.creep.to_core::<f64>(1.0 / first.period_s)?;
    let undone = |record: &&'a Record| {
        let mut seen = Seen::new(record, around, around.gain_um_per_v);
        seen.undo_creep(&creep);
        seen
    };
    Ok(records.par_iter().map(undone).collect())
}

/// The voltages of records, lowest and highest.
fn range_v(records: &[&Record]) -> [f64; 2] {
    let (low_v, high_v) = crate::family::range(records.iter().flat_map(|record| record.voltage_v.iter().copied()));
    [low_v, high_v]
}

/// Fits elements and timing to records, from another fit's timing; with the rms of what is left, micrometres. The structure's hidden bands are
/// filled in as for a table of plays.
pub(super) fn fit(
    records: &[&Record],
    around: &Around<'_>,
    from: Timing,
    rounds: usize,
) -> Result<(FadingPart, Timing, f64), IdentifyError> {
    let Some(first) = records.first() else {
        return Err(IdentifyError::NothingToFit);
    };
    let creep = around.creep.to_core::<f64>(1.0 / first.period_s)?;
    let range_v = range_v(records);
    let mut seen = seen(records, around)?;
    let mut trial = Trial {
        timing: from,
        octaves: 0.0,
    };
    for round in 1..=rounds {
        let problem = Problem { seen: &seen, range_v };
        trial = problem.refined(trial, around.latency_s)?;
        let (part, left_um) = problem.rising(trial)?;
        if round == rounds {
            return Ok((part, trial.timing, left_um));
        }
        seen.par_iter_mut().try_for_each(|record| {
            let said_um = said_um(&part, record.record, trial.timing)?;
            let both = said_um.iter().zip(&record.before_creep_um);
            let missed_um: Vec<f64> = both.map(|(said, found)| said - found).collect();
            record.correct(&missed_um, around.linear, 1.0);
            record.undo_creep(&creep);
            Ok::<(), ParamError>(())
        })?;
    }
    Err(IdentifyError::NothingToFit)
}

/// Whether fading elements that rise everywhere foretell every second record clearly better from the others than a table of plays does, or
/// whether the table of all records does not invert. Both with the timing of that table.
pub(super) fn foretell_better(
    records: &[&Record],
    around: &Around<'_>,
    timing: Timing,
    table: &InversePart,
) -> Result<bool, IdentifyError> {
    let Some(first) = records.first() else {
        return Ok(false);
    };
    let rate_hz = 1.0 / first.period_s;
    let seen = seen(records, around)?;
    let range_v = range_v(records);
    let all = Problem { seen: &seen, range_v };
    let mut trial = Trial { timing, octaves: 0.0 };
    let rises = |trial: Trial| Ok::<bool, ParamError>(all.rising(trial)?.0.to_core::<f64>().is_ok());
    if !rises(trial)? {
        // Where the table is far off, so is its timing.
        trial = all.refined(trial, around.latency_s)?;
        if !rises(trial)? {
            return Ok(false);
        }
    }
    if table.smallest_slope_v_per_um() <= 0.0 {
        return Ok(true);
    }
    let (mut fitted_to, mut held_out) = (Vec::new(), Vec::new());
    for (number, record) in seen.into_iter().enumerate() {
        if number % 2 == 0 { &mut fitted_to } else { &mut held_out }.push(record);
    }
    let problem = Problem {
        seen: &fitted_to,
        range_v,
    };
    let (fading, _) = problem.rising(trial)?;
    let (table, _) = inverse::table(&fitted_to, timing);
    let plays = table.to_core::<f64>(rate_hz)?;
    let um_per_v = fading.mean_gain_um_per_v();
    let mut squares = [0.0; 2];
    for record in held_out {
        let said_um = said_um(&fading, record.record, trial.timing)?;
        let mut state = plays.rest();
        let voltages = behind_lag(record.record, timing);
        for ((x, said), v) in record
            .before_creep_um
            .iter()
            .zip(&said_um)
            .zip(voltages)
            .take(record.to)
        {
            squares[0] += (said - x).powi(2);
            squares[1] += (um_per_v * (plays.step(&mut state, *x) - v)).powi(2);
        }
    }
    Ok(squares[0] < CLEARLY * CLEARLY * squares[1])
}

#[cfg(test)]
mod tests {
    use super::super::from_model::no_creep;
    use super::super::linear_part::LinearPart;
    use super::super::model::CreepPart;
    use super::super::timing::AmplifierLag;
    use super::*;
    use hysteron_core::bank::PlayBank;
    use hysteron_core::play_polynomial::{PlayPolynomial, PolynomialCoefficients};
    use hysteron_core::thresholds::Thresholds;
    use hysteron_data::Role;
    use std::f64::consts::TAU;

    const PERIOD_S: f64 = 20e-6;
    const LATENCY_S: f64 = 40e-6;

    fn timing(tau_s: f64) -> Timing {
        Timing {
            latency_s: LATENCY_S,
            lag: AmplifierLag {
                tau_s,
                about_v: 50.0,
                per_v: 0.0,
            },
            averaged: false,
        }
    }

    /// Records of 0 to 100 V from rest, of a stage that says where each voltage behind the lag leads.
    fn records(stage: &dyn Fn(&[f64]) -> Vec<f64>) -> Vec<Record> {
        let sweep = |hz: f64, wide: f64| -> Vec<f64> {
            let at = |k: usize| TAU * k as f64 * PERIOD_S;
            let grown = |k: usize| 0.5 * wide * (1.0 - (0.13 * hz * at(k)).cos()) * (1.0 - (hz * at(k)).cos());
            (0..20_000).map(|k| 50.0 * grown(k)).collect()
        };
        [
            (20.0, 1.0),
            (31.0, 0.9),
            (57.0, 0.7),
            (83.0, 0.5),
            (131.0, 0.9),
            (173.0, 0.6),
        ]
        .into_iter()
        .map(|(hz, wide)| {
            let voltage_v = sweep(hz, wide);
            let mut record = Record::new("large.csv", Role::Identify, PERIOD_S, voltage_v, vec![0.0; 20_000]);
            record.position_um = stage(&behind_lag(&record, timing(60e-6)));
            record
        })
        .collect()
    }

    /// Coleman and Hodgdon's stage: one memory of 30 V, a bent curve. It was cycled farther than any record goes.
    fn drifting(behind_v: &[f64]) -> Vec<f64> {
        let model = FadingModel::<f64, 1>::new(&FadingNumbers {
            min_v: 0.0,
            max_v: 130.0,
            offset: 0.0,
            input_function: [5.2, 0.0, 0.0],
            lengths_v: [30.0],
            curves: [[3.9, 0.1, -0.2]],
            rest: [0.0],
        })
        .unwrap();
        let mut state = model.cycled(0.0, false);
        let rest_um = state.output();
        behind_v.iter().map(|v| model.step(&mut state, *v) - rest_um).collect()
    }

    /// Two plays.
    fn plays(behind_v: &[f64]) -> Vec<f64> {
        let bank = PlayBank::new(Thresholds::new([10.0, 25.0]).unwrap(), 0.0, 110.0, 50e3).unwrap();
        let coefficients = PolynomialCoefficients {
            offset: 0.0,
            input_function: [0.08, 0.0, 0.0, 0.0, 0.0],
            linear: [0.02, 0.02],
            quadratic: [0.0; 2],
            cubic: [0.0; 2],
        };
        let model = PlayPolynomial::new(bank, coefficients).unwrap();
        let mut state = hysteron_core::bank::PlayState::virgin();
        behind_v.iter().map(|v| model.step(&mut state, *v)).collect()
    }

    fn with_around<R>(of: impl FnOnce(&Around<'_>) -> R) -> R {
        let linear = LinearPart {
            lag_s: 30e-6,
            lag_growth: None,
            modes: Vec::new(),
        };
        let creep: CreepPart = no_creep();
        of(&Around {
            linear: &linear,
            creep: &creep,
            latency_s: LATENCY_S,
            gain_um_per_v: 0.1,
        })
    }

    /// Elements, lag and latency come back from a lag of half as much, and the inverse gives the voltages of another way.
    #[test]
    fn val_elements_and_lag_are_found() {
        let records = records(&drifting);
        let (fitted_to, other) = records.split_at(5);
        let fitted_to: Vec<&Record> = fitted_to.iter().collect();
        let (part, found, left_um) = with_around(|around| fit(&fitted_to, around, timing(30e-6), 2)).unwrap();
        assert!((found.lag.tau_s - 60e-6).abs() < 1e-6, "{found:?}");
        assert!((found.latency_s - LATENCY_S).abs() < 1e-6, "{found:?}");
        assert!(left_um < 2e-3, "{left_um}");
        let inverse = part.to_core::<f64>().unwrap();
        let mut state = inverse.rest();
        let behind_v = behind_lag(&other[0], found);
        let squares: f64 = behind_v
            .iter()
            .zip(&other[0].position_um)
            .map(|(v, x)| (inverse.step(&mut state, *x) - v).powi(2))
            .sum();
        let rms_v = (squares / behind_v.len() as f64).sqrt();
        assert!(rms_v < 0.05, "{rms_v}");
    }

    /// Each kind of stage gets its own: half the records say what the other half is.
    #[test]
    fn val_the_better_foretold_is_taken() {
        for (stage, wanted) in [(&drifting as &dyn Fn(&[f64]) -> Vec<f64>, true), (&plays, false)] {
            let records = records(stage);
            let all: Vec<&Record> = records.iter().collect();
            let taken = with_around(|around| {
                let (table, found, _) = inverse::fit(&all, around, 2)?;
                foretell_better(&all, around, found, &table)
            });
            assert_eq!(taken.unwrap(), wanted);
        }
    }
}
