//! The columns of a model that is linear in its coefficients: what each sample of a record contributes.

use crate::family::Family;
use crate::start_state::InitialState;
use hysteron_core::envelope::Envelope;
use hysteron_core::{mpi, pi_model, play, play_polynomial, wrpi};

/// One record as the fit sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run<'a> {
    /// Model input.
    pub input: &'a [f64],
    /// Output to be explained.
    pub output: &'a [f64],
    /// Sample period, seconds.
    pub period_s: f64,
    /// State before the first sample.
    pub initial: InitialState,
    /// Weight of each squared error in the objective.
    pub weight: f64,
    /// First sample that is fitted: before it the output depends on a state that is not in the record.
    pub fit_from: usize,
    /// Whether its level is left open: plays wider than its swing hold something that is not in the record.
    pub level_free: bool,
    /// Outputs at which the readings are clipped: such a sample is not fitted.
    pub clipped: &'a [f64],
}

impl Run<'_> {
    /// Whether a sample is fitted.
    pub(crate) fn counts(&self, sample: usize) -> bool {
        sample >= self.fit_from && !self.clipped.contains(&self.output[sample])
    }
}

/// A family with its nonlinear parameters fixed: everything the columns depend on.
#[derive(Debug, Clone)]
pub(crate) struct Design {
    pub family: Family,
    pub thresholds: Vec<f64>,
    /// Zero for all families but MRPI.
    pub envelope: Envelope<f64>,
}

impl Design {
    /// A family whose plays stand still in time: no envelope widens them.
    pub(crate) fn still(family: Family, thresholds: Vec<f64>) -> Self {
        Self {
            family,
            thresholds,
            envelope: Envelope {
                alpha_s: 0.0,
                beta_s: 0.0,
            },
        }
    }

    /// Number of columns: offset, input powers, plays.
    pub(crate) fn columns(&self) -> usize {
        1 + self.family.input_powers().len() + self.family.coefficients_a_play() * self.thresholds.len()
    }

    /// Calls `visit(sample, row, output)` for every `stride`-th sample that is fitted.
    pub(crate) fn for_each_row(&self, run: &Run<'_>, stride: usize, mut visit: impl FnMut(usize, &[f64], f64)) {
        let mut row = vec![0.0; self.columns()];
        let mut stepper = Stepper::new(self, run);
        for (k, (&input, &output)) in run.input.iter().zip(run.output).enumerate() {
            let rate = stepper.advance(input);
            if k % stride == 0 && run.counts(k) {
                fill(self.family, input, rate, &stepper.outputs, &mut row);
                visit(k, &row, output);
            }
        }
    }

    /// The model's output for a run, free simulation, into `visit(sample, modelled)`.
    pub(crate) fn simulate(&self, coefficients: &[f64], run: &Run<'_>, mut visit: impl FnMut(usize, f64)) {
        let mut stepper = Stepper::new(self, run);
        for (k, &input) in run.input.iter().enumerate() {
            let rate = stepper.advance(input);
            visit(k, output(self.family, coefficients, input, rate, &stepper.outputs));
        }
    }

    /// Sum of squared errors of a run over the samples that are fitted, without its weight.
    pub(crate) fn squared_error(&self, coefficients: &[f64], run: &Run<'_>) -> f64 {
        let mut sum = 0.0;
        self.simulate(coefficients, run, |k, modelled| {
            if run.counts(k) {
                sum += (run.output[k] - modelled).powi(2);
            }
        });
        sum
    }

    /// The first sample from which on no play that settles at all still depends on the state before the record: where
    /// runs from the highest and the lowest possible state have met.
    pub(crate) fn settled_from(&self, run: &Run<'_>) -> usize {
        if self.family == Family::Duhem {
            return self.faded_from(run.input);
        }
        let start = |fraction| {
            Stepper::new(
                self,
                &Run {
                    initial: InitialState::Remanent { fraction },
                    ..*run
                },
            )
        };
        let (mut high, mut low) = (start(0.0), start(1.0));
        let mut settled = vec![false; self.thresholds.len()];
        let mut last = 0;
        for (k, &input) in run.input.iter().enumerate() {
            high.advance(input);
            low.advance(input);
            for ((settled, a), b) in settled.iter_mut().zip(&high.outputs).zip(&low.outputs) {
                if !*settled && a == b {
                    (*settled, last) = (true, k);
                }
            }
            if settled.iter().all(|&s| s) {
                break;
            }
        }
        last
    }

    /// The first sample from which on the longest of fading elements holds less than a twentieth of the state before the record.
    fn faded_from(&self, input: &[f64]) -> usize {
        let longest = self.thresholds.iter().copied().fold(0.0, f64::max);
        let mut way = 0.0;
        let steps = input.windows(2).position(|w| {
            way += (w[1] - w[0]).abs();
            way > FADED * longest
        });
        steps.map_or(input.len(), |k| k + 1)
    }
}

/// Lengths along which a state fades to a twentieth.
const FADED: f64 = 3.0;

/// The plays of one run, moving sample by sample.
struct Stepper<'a> {
    thresholds: &'a [f64],
    envelope: Envelope<f64>,
    outputs: Vec<f64>,
    last: f64,
    samples_per_s: f64,
}

impl<'a> Stepper<'a> {
    fn new(design: &'a Design, run: &Run<'_>) -> Self {
        let first = run.input.first().copied().unwrap_or(0.0);
        let before = run.initial.before(run.input);
        let mut stepper = Self {
            thresholds: &design.thresholds,
            envelope: design.envelope,
            outputs: design.thresholds.iter().map(|&r| before(r)).collect(),
            last: first,
            samples_per_s: 1.0 / run.period_s,
        };
        if let InitialState::Periodic { samples } = run.initial {
            // After one whole period both extremes have been passed, and with them all memory from before is wiped out.
            for &input in &run.input[..samples] {
                stepper.advance(input);
            }
        }
        stepper
    }

    /// Moves the plays to `input`; returns the input's rate by backward difference, per second.
    #[inline(always)]
    fn advance(&mut self, input: f64) -> f64 {
        let rate = (input - self.last) * self.samples_per_s;
        self.last = input;
        let (left, right) = self.envelope.bounds(input, rate);
        play::advance(self.thresholds, &mut self.outputs, left, right);
        rate
    }
}

pub(crate) fn fill(family: Family, input: f64, rate: f64, outputs: &[f64], row: &mut [f64]) {
    let powers = family.input_powers();
    row[0] = 1.0;
    for (cell, &power) in row[1..].iter_mut().zip(powers) {
        *cell = input.powi(power);
    }
    let plays = &mut row[1 + powers.len()..];
    let n = outputs.len();
    plays[..n].copy_from_slice(outputs);
    match family {
        // Fading elements are no plays: chains alone run them.
        Family::Pi | Family::Mpi | Family::Mrpi | Family::Duhem => {}
        Family::Wrpi => {
            for (cell, &w) in plays[n..].iter_mut().zip(outputs) {
                *cell = w * rate;
            }
        }
        Family::PlayPolynomial => {
            let (squares, cubes) = plays[n..].split_at_mut(n);
            for ((square, cube), &w) in squares.iter_mut().zip(cubes).zip(outputs) {
                *square = w * w;
                *cube = w * w * w;
            }
        }
    }
}

/// The model's output, by the arithmetic of the core; the coefficients stand as [`fill`] lays the columns out.
#[inline(always)]
pub(crate) fn output(family: Family, coefficients: &[f64], input: f64, rate: f64, outputs: &[f64]) -> f64 {
    let powers = family.input_powers().len();
    let (offset, g) = (coefficients[0], &coefficients[1..=powers]);
    let of_plays = &coefficients[1 + powers..];
    let n = outputs.len();
    offset
        + match family {
            Family::Pi => pi_model::output(g[0], of_plays, input, outputs),
            Family::Mpi | Family::Mrpi => mpi::output(g[1], g[0], of_plays, input, outputs),
            Family::Wrpi => wrpi::output(g[1], g[0], &of_plays[..n], &of_plays[n..], input, rate, outputs),
            Family::Duhem => f64::NAN,
            Family::PlayPolynomial => {
                let (linear, rest) = of_plays.split_at(n);
                let (quadratic, cubic) = rest.split_at(n);
                let g = [g[0], g[1], g[2], g[3], g[4]];
                play_polynomial::output(&g, [linear, quadratic, cubic], input, outputs)
            }
        }
}
