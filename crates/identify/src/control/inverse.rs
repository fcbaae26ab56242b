//! The direct inverse of the hysteresis, identified through the known linear part on either side of it.

use super::linear_part::{LONGEST_LAG_S, LinearPart};
use super::model::{CREEP_FAST, CREEP_SLOW, CreepPart, InversePart, PLAYS};
use super::spectrum::through_spectrum;
use super::timing::{AmplifierLag, LARGEST_GROWTH, MOST_OFF, Timing, behind_lag};
use crate::error::IdentifyError;
use crate::normal::Normal;
use hysteron_core::corner_polynomial::CornerPolynomial;
use hysteron_core::effects::creep::CreepInverse;
use hysteron_core::model::{AtRest as _, Hysteresis as _};
use hysteron_core::play;
use hysteron_core::play_polynomial::INPUT_DEGREE;
use hysteron_data::Record;
use nalgebra::{DMatrix, DVector, DVectorView};
use rayon::prelude::*;
use realfft::num_complex::Complex64;
use std::f64::consts::{PI, TAU};

/// Coefficients of the inverse: constant, powers of the input, three a play.
const COLUMNS: usize = 1 + INPUT_DEGREE + 3 * PLAYS;
/// Rows taken of each record, evenly spread: eighty unknowns and a hundred times as many rows of each record.
pub(super) const ROWS_A_RECORD: usize = 8_000;
/// Ridge on the scaled columns, the least that is tried.
const RIDGE: f64 = 1e-9;
/// The least on a model's own answers, which have no noise to keep coefficients small.
const LEAST_RIDGE_OF_A_MODEL: f64 = 1e-8;
/// The largest.
const LARGEST_RIDGE: f64 = 1e-2;
/// Least slope of an inverse, as a share of its mean: a stack's slope after a turn is half its mean and more.
const LEAST_SLOPE: f64 = 0.2;
/// How much farther than the records the inverse's input may go, as a share of their range.
const MARGIN: f64 = 0.05;

/// Rounds of filling in what the structure hides; each leaves some 60 % of what the one before did, less than noise after six.
pub(super) const ROUNDS: usize = 6;

/// A record as the inverse sees it: its input, and the command as it was.
pub(super) struct Seen<'a> {
    pub record: &'a Record,
    /// Position before the structure, micrometres.
    before_structure_um: Vec<f64>,
    /// Position before structure and creep, micrometres.
    pub before_creep_um: Vec<f64>,
    /// One-past-last sample that the end of the record does not disturb.
    pub to: usize,
}

/// What of a timing is fitted: the time constant and its growth, or the latency as well.
#[derive(Debug, Clone, Copy)]
enum Free {
    Lag = 2,
    LagAndLatency = 3,
}

/// The rows of a fit, kept so that other lags can be tried on them.
struct Problem {
    rows: Vec<[f64; COLUMNS]>,
    /// Record and sample of each row.
    places: Vec<(usize, usize)>,
    /// What the rows of each record are multiplied by.
    factors: Vec<f64>,
    normal: Normal,
    scale: Scale,
}

/// The records' range: play outputs are taken from its middle in halves of it, so that powers stay apart.
#[derive(Debug, Clone, Copy)]
struct Scale {
    low_um: f64,
    high_um: f64,
}

impl Scale {
    fn middle(self) -> f64 {
        0.5 * (self.low_um + self.high_um)
    }

    fn half(self) -> f64 {
        0.5 * (self.high_um - self.low_um)
    }
}

impl<'a> Seen<'a> {
    /// Undoes structure and creep in a record's positions. In bands where the structure lets nothing through (beyond a mode, in
    /// an antiresonance) the voltage stands in, `gain_um_per_v` micrometres a volt, until [`Self::fill`] knows better.
    pub(super) fn new(record: &'a Record, around: &Around<'_>, gain_um_per_v: f64) -> Self {
        let behind_v = behind_lag(record, around.timing(around.linear.into()));
        let seen_um = filtered(&record.position_um, record.period_s, |omega, rate_hz| {
            let share = around.linear.usable_share(omega, rate_hz);
            (share > 0.0).then(|| share / around.linear.structure(omega))
        });
        let hidden_v = hidden(&behind_v, around.linear, record.period_s);
        let before_structure_um = seen_um
            .iter()
            .zip(&hidden_v)
            .map(|(y, v)| y + gain_um_per_v * v)
            .collect();
        // Two milliseconds: over them the added end makes itself felt.
        let end = (2e-3 / record.period_s).ceil() as usize;
        Self {
            record,
            before_structure_um,
            before_creep_um: Vec::new(),
            to: record.len().saturating_sub(end),
        }
    }

    pub(super) fn undo_creep(&mut self, creep: &CreepInverse<f64, CREEP_FAST, CREEP_SLOW>) {
        let mut state = creep.rest_at(0.0);
        self.before_creep_um = self
            .before_structure_um
            .iter()
            .map(|&y| creep.step(&mut state, y))
            .collect();
    }

    /// Corrects the hidden bands by what the inverse asks for and the command was not.
    fn fill(
        &mut self,
        inverse: &CornerPolynomial<f64, PLAYS>,
        around: &Around<'_>,
        timing: Timing,
        gain_um_per_v: f64,
    ) {
        let record = self.record;
        let mut state = inverse.at_rest(0.0, 0.0);
        let behind_v = behind_lag(record, timing);
        let miss_v: Vec<f64> = self
            .before_creep_um
            .iter()
            .zip(&behind_v)
            .map(|(&x, v)| v - inverse.step(&mut state, x))
            .collect();
        self.correct(&miss_v, around.linear, gain_um_per_v);
    }

    /// Takes up what was missed in the hidden bands, so many micrometres a unit of it.
    pub(super) fn correct(&mut self, missed: &[f64], linear: &LinearPart, um_per_unit: f64) {
        let hidden = hidden(missed, linear, self.record.period_s);
        self.before_structure_um
            .iter_mut()
            .zip(&hidden)
            .for_each(|(x, missed)| *x += um_per_unit * missed);
    }
}

/// The part of a signal in bands that the structure hides.
fn hidden(signal: &[f64], linear: &LinearPart, period_s: f64) -> Vec<f64> {
    filtered(signal, period_s, |omega, rate_hz| {
        Some(Complex64::new(1.0 - linear.usable_share(omega, rate_hz), 0.0))
    })
}

/// A signal through a response of frequency (rad/s) and sample rate. The signal, which starts at rest at 0, is led back there
/// smoothly, so that its ends meet.
fn filtered(signal: &[f64], period_s: f64, response: impl Fn(f64, f64) -> Option<Complex64>) -> Vec<f64> {
    let back = (0.02 / period_s).ceil() as usize;
    let last = signal.last().copied().unwrap_or(0.0);
    let mut time: Vec<f64> = signal.to_vec();
    time.extend((0..back).map(|k| last * 0.5 * (1.0 + (PI * (k + 1) as f64 / back as f64).cos())));
    // Rest, up to a length that transforms fast.
    time.resize((time.len() + back).next_multiple_of(4096), 0.0);
    through_spectrum(&mut time, |share| {
        response(TAU * share / period_s, 1.0 / period_s).unwrap_or_default()
    });
    time.truncate(signal.len());
    time
}

impl Problem {
    /// Builds the rows from the inverse's inputs, one series a record; a factor multiplies the error of each.
    fn new(inputs: &[&[f64]], factors: &[f64]) -> Self {
        let all = || inputs.iter().flat_map(|series| series.iter().copied());
        let scale = Scale {
            low_um: all().fold(f64::INFINITY, f64::min),
            high_um: all().fold(f64::NEG_INFINITY, f64::max),
        };
        let thresholds = thresholds(scale);
        let of_record = |(series, factor): (&&[f64], &f64)| {
            let stride = series.len().div_ceil(ROWS_A_RECORD).max(1);
            let mut plays = [0.0; PLAYS];
            let mut rows = Vec::with_capacity(ROWS_A_RECORD);
            for (k, &x) in series.iter().enumerate() {
                play::advance(&thresholds, &mut plays, x, x);
                if k % stride == 0 {
                    rows.push((k, row(scale, x, &plays).map(|cell| factor * cell)));
                }
            }
            let columns = DMatrix::from_fn(rows.len(), COLUMNS, |i, j| rows[i].1[j]);
            (Normal::of_columns(&columns, &DVector::zeros(rows.len())), rows)
        };
        let each: Vec<(Normal, Vec<_>)> = inputs.par_iter().zip(factors).map(of_record).collect();
        let mut problem = Self {
            rows: Vec::new(),
            places: Vec::new(),
            factors: factors.to_vec(),
            normal: Normal::new(COLUMNS),
            scale,
        };
        for (number, (normal, rows)) in each.into_iter().enumerate() {
            problem.normal.add_scaled(&normal, 1.0);
            problem.places.extend(rows.iter().map(|&(k, _)| (number, k)));
            problem.rows.extend(rows.into_iter().map(|(_, row)| row));
        }
        problem
    }

    /// Refuses too few rows.
    fn enough(&self) -> Result<(), IdentifyError> {
        if self.rows.len() < 10 * COLUMNS {
            return Err(IdentifyError::TooFewSamples {
                samples: self.rows.len(),
                parameters: COLUMNS,
            });
        }
        Ok(())
    }

    /// Solves for voltages: coefficients and what is left of each row, times its factor, V.
    fn solve<S: AsRef<[f64]> + Sync>(&self, targets: &[S], ridge: f64) -> (Vec<f64>, Vec<f64>) {
        let target = |&(record, k): &(usize, usize)| self.factors[record] * targets[record].as_ref()[k];
        let parts: Vec<[f64; COLUMNS]> = self
            .rows
            .par_chunks(ROWS_A_RECORD)
            .zip(self.places.par_chunks(ROWS_A_RECORD))
            .map(|(rows, places)| {
                let mut sum = [0.0; COLUMNS];
                for (row, place) in rows.iter().zip(places) {
                    let target = target(place);
                    sum.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * target);
                }
                sum
            })
            .collect();
        let right = DVector::from_fn(COLUMNS, |i, _| parts.iter().map(|part| part[i]).sum());
        let coefficients = self.normal.solve_for(&right, ridge);
        let by = DVectorView::from_slice(&coefficients, COLUMNS);
        let rows = self.rows.par_iter().zip(&self.places).with_min_len(1000);
        let left = rows.map(|(row, place)| target(place) - DVectorView::from_slice(row, COLUMNS).dot(&by));
        let left = left.collect();
        (coefficients, left)
    }

    /// The rms of what is left, volts.
    fn rms(&self, left: &[f64]) -> f64 {
        let counted: f64 = self
            .places
            .iter()
            .map(|&(record, _)| self.factors[record].powi(2))
            .sum();
        (left.iter().map(|v| v * v).sum::<f64>() / counted.max(f64::MIN_POSITIVE)).sqrt()
    }

    /// The constant lag with which the records leave least, by golden section between 0 and 0.4 ms.
    fn constant_lag(&self, seen: &[Seen<'_>], around: &Around<'_>) -> Timing {
        let (low_v, high_v) = crate::family::range(seen.iter().flat_map(|s| s.record.voltage_v.iter().copied()));
        let constant = |tau_s: f64| {
            around.timing(AmplifierLag {
                tau_s,
                about_v: 0.5 * (low_v + high_v),
                per_v: 0.0,
            })
        };
        let cost = |tau_s: f64| self.rms(&self.left(seen, constant(tau_s)));
        let (mut low, mut high) = (0.0, LONGEST_LAG_S);
        let golden = 0.5 * (5_f64.sqrt() - 1.0);
        let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
        let (mut cost_a, mut cost_b) = (cost(a), cost(b));
        while high - low > 1e-6 {
            if cost_a < cost_b {
                (high, b, cost_b) = (b, a, cost_a);
                a = high - golden * (high - low);
                cost_a = cost(a);
            } else {
                (low, a, cost_a) = (a, b, cost_b);
                b = low + golden * (high - low);
                cost_b = cost(b);
            }
        }
        constant(0.5 * (low + high))
    }

    /// What the rows leave with a timing, volts.
    fn left(&self, seen: &[Seen<'_>], timing: Timing) -> Vec<f64> {
        self.solve(&behind(seen, timing), RIDGE).1
    }

    /// The timing that leaves least, by steps of Gauss and Newton from another: time constant and growth, and the latency where it is free,
    /// about the one that is stated.
    fn refined(&self, seen: &[Seen<'_>], from: Timing, stated_s: f64, free: Free) -> Timing {
        const STEP: f64 = 1e-3;
        const STEPS: usize = 5;
        let period_s = seen.first().map_or(0.0, |s| s.record.period_s);
        let most_per_v = LARGEST_GROWTH / from.lag.about_v.abs().max(f64::MIN_POSITIVE);
        let scale = [from.lag.tau_s.max(1e-6), most_per_v, period_s];
        let free = free as usize;
        let within = |mut timing: Timing| {
            let most_s = MOST_OFF * period_s;
            timing.lag.tau_s = timing.lag.tau_s.clamp(0.0, LONGEST_LAG_S);
            timing.lag.per_v = timing.lag.per_v.clamp(-most_per_v, most_per_v);
            timing.latency_s = timing.latency_s.clamp(stated_s - most_s, stated_s + most_s);
            timing
        };
        let (mut timing, mut left) = (from, self.left(seen, from));
        for _ in 0..STEPS {
            let moved = |k: usize| timing.moved(std::array::from_fn(|i| if i == k { STEP * scale[i] } else { 0.0 }));
            let slopes: Vec<Vec<f64>> = (0..free)
                .into_par_iter()
                .map(|k| {
                    self.left(seen, moved(k))
                        .iter()
                        .zip(&left)
                        .map(|(a, b)| (a - b) / STEP)
                        .collect()
                })
                .collect();
            let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let right = DVector::from_fn(free, |i, _| product(&slopes[i], &left));
            let normal = DMatrix::from_fn(free, free, |i, j| product(&slopes[i], &slopes[j]));
            let Some(factor) = normal.cholesky() else {
                break;
            };
            let step = factor.solve(&right);
            // Half of a scale at most, in the step's own direction; then half of that where it went too far.
            let whole = (0.5 / step.amax()).min(1.0);
            let tried = [1.0, 0.5, 0.25].into_iter().find_map(|share| {
                let by = std::array::from_fn(|i| step.get(i).map_or(0.0, |step| -scale[i] * whole * share * step));
                let next = within(timing.moved(by));
                let next_left = self.left(seen, next);
                (self.rms(&next_left) < self.rms(&left)).then_some((next, next_left))
            });
            let Some(next) = tried else {
                break;
            };
            (timing, left) = next;
        }
        timing
    }

    /// The inverse of the least ridge, from `least` on in decades, that rises everywhere, with the rms of what is left, volts. Where
    /// none does, that of the largest, to be refused.
    fn rising(&self, targets: &[impl AsRef<[f64]> + Sync], least: f64) -> (InversePart, f64) {
        let (low_v, high_v) = crate::family::range(targets.iter().flat_map(|target| target.as_ref().iter().copied()));
        let mean_slope = (high_v - low_v) / (self.scale.high_um - self.scale.low_um);
        let mut ridge = least;
        loop {
            let (coefficients, left) = self.solve(targets, ridge);
            let inverse = part(self.scale, &coefficients);
            if inverse.smallest_slope_v_per_um() > LEAST_SLOPE * mean_slope || ridge >= LARGEST_RIDGE {
                return (inverse, self.rms(&left));
            }
            ridge *= 10.0;
        }
    }
}

/// The voltages behind latency and lag of each record.
fn behind(seen: &[Seen<'_>], timing: Timing) -> Vec<Vec<f64>> {
    seen.par_iter().map(|s| behind_lag(s.record, timing)).collect()
}

/// Graded: dense near 0, where every turn begins.
fn thresholds(scale: Scale) -> [f64; PLAYS] {
    let range = scale.high_um - scale.low_um;
    core::array::from_fn(|i| range * ((i as f64 + 0.5) / PLAYS as f64).powi(2))
}

fn row(scale: Scale, x: f64, plays: &[f64; PLAYS]) -> [f64; COLUMNS] {
    let mut row = [1.0; COLUMNS];
    let place = |x: f64| (x - scale.middle()) / scale.half();
    let mut power = 1.0;
    for cell in &mut row[1..=INPUT_DEGREE] {
        power *= place(x);
        *cell = power;
    }
    for (cells, &w) in row[1 + INPUT_DEGREE..].chunks_exact_mut(3).zip(plays) {
        let w = place(w);
        cells.copy_from_slice(&[w, w * w, w * w * w]);
    }
    row
}

/// Expands powers of `(x - m) / h` into powers of x.
fn expand(coefficients: &[f64], scale: Scale) -> Vec<f64> {
    let (m, h) = (scale.middle(), scale.half());
    let mut sum = vec![0.0; coefficients.len() + 1];
    // Horner: p = (p) * (x - m) / h + c.
    for &c in coefficients.iter().rev() {
        let mut next = vec![0.0; sum.len()];
        for (i, &value) in sum.iter().enumerate() {
            next[i] -= value * m / h;
            if i + 1 < next.len() {
                next[i + 1] += value / h;
            }
        }
        next[0] += c;
        sum = next;
    }
    // Once more for the power that each coefficient still lacks: c_1 belongs to the first power.
    let mut shifted = vec![0.0; sum.len()];
    for (i, &value) in sum.iter().enumerate() {
        shifted[i] -= value * m / h;
        if i + 1 < shifted.len() {
            shifted[i + 1] += value / h;
        }
    }
    shifted
}

fn part(scale: Scale, coefficients: &[f64]) -> InversePart {
    let of_input = expand(&coefficients[1..=INPUT_DEGREE], scale);
    let plays: Vec<Vec<f64>> = coefficients[1 + INPUT_DEGREE..]
        .chunks_exact(3)
        .map(|three| expand(three, scale))
        .collect();
    let margin = MARGIN * (scale.high_um - scale.low_um);
    InversePart {
        input_min_um: scale.low_um - margin,
        input_max_um: scale.high_um + margin,
        thresholds_um: thresholds(scale).to_vec(),
        offset_v: coefficients[0] + of_input[0] + plays.iter().map(|p| p[0]).sum::<f64>(),
        input_function: of_input[1..].to_vec(),
        linear: plays.iter().map(|p| p[1]).collect(),
        quadratic: plays.iter().map(|p| p[2]).collect(),
        cubic: plays.iter().map(|p| p[3]).collect(),
    }
}

/// The chain around the inverse that a fit needs.
pub(super) struct Around<'a> {
    /// Modes, and a first lag.
    pub linear: &'a LinearPart,
    /// Creep.
    pub creep: &'a CreepPart,
    /// Latency of the controller, hold included, seconds.
    pub latency_s: f64,
    /// Static gain for small signals, micrometres per volt.
    pub gain_um_per_v: f64,
}

impl Around<'_> {
    /// The latency as it is known, with a lag.
    fn timing(&self, lag: AmplifierLag) -> Timing {
        Timing {
            latency_s: self.latency_s,
            lag,
            averaged: !self.linear.modes.is_empty(),
        }
    }
}

/// Positions from rest, and the voltages that they stand for.
pub(super) struct Pairs {
    pub position_um: Vec<f64>,
    pub voltage_v: Vec<f64>,
    /// What its error is multiplied by.
    pub factor: f64,
}

/// Fits the inverse to series of pairs; with the rms of what is left, volts. Where no ridge makes it rise everywhere the smoothest is
/// returned, to be refused.
pub(super) fn fit_pairs(series: &[Pairs]) -> (InversePart, f64) {
    let positions_um: Vec<&[f64]> = series.iter().map(|pairs| pairs.position_um.as_slice()).collect();
    let voltages_v: Vec<&[f64]> = series.iter().map(|pairs| pairs.voltage_v.as_slice()).collect();
    let factors: Vec<f64> = series.iter().map(|pairs| pairs.factor).collect();
    Problem::new(&positions_um, &factors).rising(&voltages_v, LEAST_RIDGE_OF_A_MODEL)
}

/// Fits the inverse to records with a timing; returns it with the rms of what is left, volts.
pub(super) fn table(seen: &[Seen<'_>], timing: Timing) -> (InversePart, f64) {
    let inputs: Vec<&[f64]> = seen.iter().map(|s| &s.before_creep_um[..s.to]).collect();
    Problem::new(&inputs, &vec![1.0; inputs.len()]).rising(&behind(seen, timing), RIDGE)
}

/// Fits inverse and timing to records; returns them with the rms of what is left, volts. What the structure hides is filled in in so many
/// rounds, [`ROUNDS`] where all of it is wanted. The first round takes the latency as stated.
pub(super) fn fit(
    records: &[&Record],
    around: &Around<'_>,
    rounds: usize,
) -> Result<(InversePart, Timing, f64), IdentifyError> {
    let Some(first) = records.first() else {
        return Err(IdentifyError::NothingToFit);
    };
    let rate_hz = 1.0 / first.period_s;
    let creep = around.creep.to_core::<f64>(rate_hz)?;
    let mut seen: Vec<Seen<'_>> = records
        .par_iter()
        .map(|record| Seen::new(record, around, around.gain_um_per_v))
        .collect();
    let mut timing = None;
    for round in 1.. {
        seen.par_iter_mut().for_each(|record| record.undo_creep(&creep));
        let inputs: Vec<&[f64]> = seen.iter().map(|s| &s.before_creep_um[..s.to]).collect();
        let problem = Problem::new(&inputs, &vec![1.0; inputs.len()]);
        problem.enough()?;
        let found = match timing {
            None => problem.refined(&seen, problem.constant_lag(&seen, around), around.latency_s, Free::Lag),
            Some(last) => problem.refined(&seen, last, around.latency_s, Free::LagAndLatency),
        };
        let (part, left_v) = problem.rising(&behind(&seen, found), RIDGE);
        if round == rounds {
            return Ok((part, found, left_v));
        }
        // What is filled in by one that falls runs away.
        if part.smallest_slope_v_per_um() > 0.0 {
            let inverse = part.to_core::<f64>(rate_hz)?;
            seen.par_iter_mut()
                .for_each(|record| record.fill(&inverse, around, found, around.gain_um_per_v));
        }
        timing = Some(found);
    }
    Err(IdentifyError::NothingToFit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_expanded_powers_are_the_same_polynomial() {
        let scale = Scale {
            low_um: 1.0,
            high_um: 9.0,
        };
        let coefficients = [0.3, -0.2, 0.05];
        let expanded = expand(&coefficients, scale);
        for x in [0.0, 3.0, 7.5] {
            let u: f64 = (x - 5.0) / 4.0;
            let wanted = 0.3 * u - 0.2 * u * u + 0.05 * u * u * u;
            let found: f64 = expanded.iter().rev().fold(0.0, |sum, c| sum * x + c);
            assert!((found - wanted).abs() < 1e-12, "{x}: {found} {wanted}");
        }
    }
}
