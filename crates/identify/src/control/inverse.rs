//! The direct inverse of the hysteresis, identified through the known linear part on either side of it.

use super::linear_part::LinearPart;
use super::model::{CREEP_FAST, CREEP_SLOW, CreepPart, InversePart, PLAYS};
use crate::error::IdentifyError;
use crate::normal::Normal;
use hysteron_core::corner_polynomial::CornerPolynomial;
use hysteron_core::effects::creep::CreepInverse;
use hysteron_core::model::{AtRest as _, Hysteresis as _};
use hysteron_core::play;
use hysteron_core::play_polynomial::INPUT_DEGREE;
use hysteron_data::Record;
use nalgebra::DVector;
use rayon::prelude::*;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;
use std::f64::consts::{PI, TAU};

/// Coefficients of the inverse: constant, powers of the input, three a play.
const COLUMNS: usize = 1 + INPUT_DEGREE + 3 * PLAYS;
/// Rows taken of each record, evenly spread: eighty unknowns and a hundred times as many rows of each record.
const ROWS_A_RECORD: usize = 8_000;
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
struct Seen<'a> {
    record: &'a Record,
    /// Position before the structure, micrometres.
    before_structure_um: Vec<f64>,
    /// Position before structure and creep, micrometres.
    before_creep_um: Vec<f64>,
    /// One-past-last sample that the end of the record does not disturb.
    to: usize,
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
    fn new(record: &'a Record, around: &Around<'_>, gain_um_per_v: f64) -> Self {
        let behind_v = behind_lag(
            &record.voltage_v,
            record.period_s,
            around.latency_s,
            around.linear.lag_s,
        );
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

    fn undo_creep(&mut self, creep: &CreepInverse<f64, CREEP_FAST, CREEP_SLOW>) {
        let mut state = creep.rest_at(0.0);
        self.before_creep_um = self
            .before_structure_um
            .iter()
            .map(|&y| creep.step(&mut state, y))
            .collect();
    }

    /// Corrects the hidden bands by what the inverse asks for and the command was not.
    fn fill(&mut self, inverse: &CornerPolynomial<f64, PLAYS>, around: &Around<'_>, lag_s: f64, gain_um_per_v: f64) {
        let (record, period_s) = (self.record, self.record.period_s);
        let mut state = inverse.at_rest(0.0, 0.0);
        let behind_v = behind_lag(&record.voltage_v, period_s, around.latency_s, lag_s);
        let miss_v: Vec<f64> = self
            .before_creep_um
            .iter()
            .zip(&behind_v)
            .map(|(&x, v)| v - inverse.step(&mut state, x))
            .collect();
        let hidden_v = hidden(&miss_v, around.linear, period_s);
        self.before_structure_um
            .iter_mut()
            .zip(&hidden_v)
            .for_each(|(x, v)| *x += gain_um_per_v * v);
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
    let n = time.len();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(n), planner.plan_fft_inverse(n));
    let mut lines = forward.make_output_vec();
    // Lengths are the plans' own.
    let _ = forward.process(&mut time, &mut lines);
    for (k, line) in lines.iter_mut().enumerate() {
        let omega = TAU * k as f64 / (n as f64 * period_s);
        *line = response(omega, 1.0 / period_s).map_or_else(Complex64::default, |h| *line * h / n as f64);
    }
    // A real signal has real ends of its spectrum; what the response leaves there is rounding.
    for end in [0, lines.len() - 1] {
        lines[end].im = 0.0;
    }
    let _ = inverse.process(&mut lines, &mut time);
    time.truncate(signal.len());
    time
}

/// The voltage behind latency, converter's hold and lag at each sample: exact for a command that is held.
pub(super) fn behind_lag(voltage_v: &[f64], period_s: f64, latency_s: f64, lag_s: f64) -> Vec<f64> {
    let whole_and_part = (latency_s / period_s - 0.5).max(0.0);
    // A rounding below a whole number of samples is the whole number.
    let whole = (whole_and_part + 1e-9).floor();
    let late = (whole_and_part - whole).max(0.0) * period_s;
    let keep = |time_s: f64| if lag_s > 0.0 { (-time_s / lag_s).exp() } else { 0.0 };
    let (over_late, over_rest) = (keep(late), keep(period_s - late));
    let at = |k: usize, behind: usize| k.checked_sub(behind).map_or(0.0, |i| voltage_v[i]);
    let whole = whole as usize;
    let mut output = 0.0;
    (0..voltage_v.len())
        .map(|k| {
            let now = output;
            if late > 0.0 {
                let older = at(k, whole + 1);
                output = older + (output - older) * over_late;
            }
            let newer = at(k, whole);
            output = newer + (output - newer) * over_rest;
            now
        })
        .collect()
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
        let mut problem = Self {
            rows: Vec::new(),
            places: Vec::new(),
            factors: factors.to_vec(),
            normal: Normal::new(COLUMNS),
            scale,
        };
        for (number, (series, factor)) in inputs.iter().zip(factors).enumerate() {
            let stride = series.len().div_ceil(ROWS_A_RECORD).max(1);
            let mut plays = [0.0; PLAYS];
            for (k, &x) in series.iter().enumerate() {
                play::advance(&thresholds, &mut plays, x, x);
                if k % stride == 0 {
                    let row = row(scale, x, &plays).map(|cell| factor * cell);
                    problem.normal.add_row(&row, 0.0);
                    problem.rows.push(row);
                    problem.places.push((number, k));
                }
            }
        }
        problem
    }

    /// Solves for voltages: coefficients and the mean square of what is left, V^2.
    fn solve<S: AsRef<[f64]>>(&self, targets: &[S], ridge: f64) -> (Vec<f64>, f64) {
        let mut right = DVector::<f64>::zeros(COLUMNS);
        for (row, &(record, k)) in self.rows.iter().zip(&self.places) {
            let target = self.factors[record] * targets[record].as_ref()[k];
            right.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * target);
        }
        let coefficients = self.normal.solve_for(&right, ridge);
        let squares: f64 = self
            .rows
            .iter()
            .zip(&self.places)
            .map(|(row, &(record, k))| {
                let fitted: f64 = row.iter().zip(&coefficients).map(|(x, c)| x * c).sum();
                (self.factors[record] * targets[record].as_ref()[k] - fitted).powi(2)
            })
            .sum();
        let counted: f64 = self
            .places
            .iter()
            .map(|&(record, _)| self.factors[record].powi(2))
            .sum();
        (coefficients, squares / counted.max(f64::MIN_POSITIVE))
    }

    /// The lag with which the records leave least, by golden section between 0 and 0.4 ms, and the inverse with it.
    fn solve_with_lag(&self, seen: &[Seen<'_>], latency_s: f64) -> Result<(InversePart, f64, f64), IdentifyError> {
        if self.rows.len() < 10 * COLUMNS {
            return Err(IdentifyError::TooFewSamples {
                samples: self.rows.len(),
                parameters: COLUMNS,
            });
        }
        let cost = |lag_s: f64| self.solve(&behind(seen, latency_s, lag_s), RIDGE).1;
        let (mut low, mut high) = (0.0, LONGEST_LAG_S);
        let golden = 0.5 * (5_f64.sqrt() - 1.0);
        let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
        let (mut cost_a, mut cost_b) = (cost(a), cost(b));
        while high - low > 1e-8 {
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
        let lag_s = 0.5 * (low + high);
        let (inverse, left_v) = self.rising(&behind(seen, latency_s, lag_s), RIDGE);
        Ok((inverse, lag_s, left_v))
    }

    /// The inverse of the least ridge, from `least` on in decades, that rises everywhere, with the rms of what is left, volts. Where
    /// none does, that of the largest, to be refused.
    fn rising(&self, targets: &[impl AsRef<[f64]>], least: f64) -> (InversePart, f64) {
        let (low_v, high_v) = crate::family::range(targets.iter().flat_map(|target| target.as_ref().iter().copied()));
        let mean_slope = (high_v - low_v) / (self.scale.high_um - self.scale.low_um);
        let mut ridge = least;
        loop {
            let (coefficients, squares) = self.solve(targets, ridge);
            let inverse = part(self.scale, &coefficients);
            if inverse.smallest_slope_v_per_um() > LEAST_SLOPE * mean_slope || ridge >= LARGEST_RIDGE {
                return (inverse, squares.sqrt());
            }
            ridge *= 10.0;
        }
    }
}

/// The voltages behind latency and lag of each record.
fn behind(seen: &[Seen<'_>], latency_s: f64, lag_s: f64) -> Vec<Vec<f64>> {
    seen.iter()
        .map(|s| behind_lag(&s.record.voltage_v, s.record.period_s, latency_s, lag_s))
        .collect()
}

/// Longest lag that is looked for: 50 ohm into 8 uF.
const LONGEST_LAG_S: f64 = 4e-4;

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

/// Fits inverse and lag to records; returns them with the rms of what is left, volts. What the structure hides is filled in in so many
/// rounds, [`ROUNDS`] where all of it is wanted.
pub(super) fn fit(
    records: &[&Record],
    around: &Around<'_>,
    rounds: usize,
) -> Result<(InversePart, f64, f64), IdentifyError> {
    let Some(first) = records.first() else {
        return Err(IdentifyError::NothingToFit);
    };
    let rate_hz = 1.0 / first.period_s;
    let creep = around.creep.to_core::<f64>(rate_hz)?;
    let mut seen: Vec<Seen<'_>> = records
        .par_iter()
        .map(|record| Seen::new(record, around, around.gain_um_per_v))
        .collect();
    let mut round = 1;
    loop {
        seen.par_iter_mut().for_each(|record| record.undo_creep(&creep));
        let inputs: Vec<&[f64]> = seen.iter().map(|s| &s.before_creep_um[..s.to]).collect();
        let found = Problem::new(&inputs, &vec![1.0; inputs.len()]).solve_with_lag(&seen, around.latency_s)?;
        if round == rounds || around.linear.modes.is_empty() {
            return Ok(found);
        }
        round += 1;
        let inverse = found.0.to_core::<f64>(rate_hz)?;
        seen.par_iter_mut()
            .for_each(|record| record.fill(&inverse, around, found.1, around.gain_um_per_v));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step of 1 V behind 1.5 samples of latency (one of computing, half of hold) and a lag.
    #[test]
    fn val_step_behind_the_lag() {
        let voltage = [1.0; 20];
        let found = behind_lag(&voltage, 20e-6, 30e-6, 60e-6);
        for (k, v) in found.iter().enumerate() {
            let since_s = 20e-6 * (k as f64 - 1.0);
            let wanted = if since_s > 0.0 {
                1.0 - (-since_s / 60e-6).exp()
            } else {
                0.0
            };
            assert!((v - wanted).abs() < 1e-12, "{k}: {v} {wanted}");
        }
        // A quarter of a sample later.
        let found = behind_lag(&voltage, 20e-6, 35e-6, 60e-6);
        assert!((found[5] - (1.0 - (-75e-6_f64 / 60e-6).exp())).abs() < 1e-12);
    }

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
