//! The states of an effect file, from sample to sample.

use super::user_file::{DU, Equations, MOST_STATES, Motion, T, TEMPERATURE, U, V, V2, VARIABLES};

/// Values beyond this are no physics; they and those that are not finite count as 0.
const LARGEST: f64 = 1e12;

/// `1 - 1/sqrt 2`: with it both stages of the integrator are L-stable.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// A number that can go on.
pub(super) fn sound(value: f64) -> f64 {
    if value.abs() <= LARGEST { value } else { 0.0 }
}

/// On the straight line from a sample to the next.
fn between(series: &[f64], k: usize, share: f64) -> f64 {
    series[k] + share * (series[k + 1] - series[k])
}

/// What drives an effect along a record, all series of one length.
#[derive(Clone, Copy)]
pub(super) struct Inputs<'a> {
    pub period_s: f64,
    /// Samples before the record's own first one.
    pub run_in: usize,
    pub input: &'a [f64],
    pub stack_v: Option<&'a [f64]>,
    pub temperature_c: Option<&'a [f64]>,
    pub voltage2_v: Option<&'a [f64]>,
}

/// The values of all variables of a definition's expressions, and its `N` states, at one instant.
#[derive(Clone)]
pub(super) struct Machine<'a, const N: usize> {
    equations: &'a Equations,
    inputs: Inputs<'a>,
    values: [f64; VARIABLES.len() + MOST_STATES],
    /// Which states have a rate.
    moves: [bool; N],
}

impl<'a, const N: usize> Machine<'a, N> {
    /// At the first sample, after a long rest there.
    /// `equations` have `N` motions, and the parameters put in.
    pub(super) fn at_rest(equations: &'a Equations, inputs: Inputs<'a>) -> Self {
        let mut machine = Self {
            values: [0.0; VARIABLES.len() + MOST_STATES],
            moves: std::array::from_fn(|i| matches!(equations.motions.get(i), Some(Motion::Rate(_)))),
            equations,
            inputs,
        };
        machine.stand_at(0);
        for (i, at_rest) in equations.at_rest.iter().enumerate() {
            machine.values[VARIABLES.len() + i] = sound(at_rest.eval(&machine.values));
        }
        machine
    }

    fn states(&self) -> [f64; N] {
        std::array::from_fn(|i| self.values[VARIABLES.len() + i])
    }

    fn set(&mut self, states: &[f64; N]) {
        self.values[VARIABLES.len()..][..N].copy_from_slice(states);
    }

    /// The inputs at a sample.
    fn stand_at(&mut self, k: usize) {
        let i = &self.inputs;
        let last = i.input.len().saturating_sub(1);
        let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
        self.values[U] = i.input[k];
        // Central: the input is modelled, hence free of noise, and a backward difference would be half a sample late.
        self.values[DU] = if after > before {
            (i.input[after] - i.input[before]) / ((after - before) as f64 * i.period_s)
        } else {
            0.0
        };
        self.values[T] = (k as f64 - i.run_in as f64) * i.period_s;
        let of = |series: Option<&[f64]>| series.and_then(|s| s.get(k)).copied().unwrap_or(0.0);
        self.values[V] = of(i.stack_v);
        self.values[TEMPERATURE] = of(i.temperature_c);
        self.values[V2] = of(i.voltage2_v);
    }

    /// The inputs between a sample and the next one, on straight lines.
    fn stand_between(&mut self, k: usize, share: f64) {
        let i = &self.inputs;
        let line = |series: &[f64]| between(series, k, share);
        self.values[U] = between(i.input, k, share);
        self.values[DU] = (i.input[k + 1] - i.input[k]) / i.period_s;
        self.values[T] = (k as f64 + share - i.run_in as f64) * i.period_s;
        let of = |series: Option<&[f64]>| series.filter(|s| s.len() > k + 1).map_or(0.0, line);
        self.values[V] = of(i.stack_v);
        self.values[TEMPERATURE] = of(i.temperature_c);
        self.values[V2] = of(i.voltage2_v);
    }

    /// The output at a sample, after the states that are given anew at each sample.
    pub(super) fn output(&mut self, k: usize) -> f64 {
        self.stand_at(k);
        self.renew();
        sound(self.equations.output.eval(&self.values))
    }

    /// The output at a sample where the states do not depend on the input, and its slope over `apart` of the input.
    pub(super) fn slope(&mut self, k: usize, apart: f64) -> f64 {
        let here = self.output(k);
        self.values[U] += apart;
        (sound(self.equations.output.eval(&self.values)) - here) / apart
    }

    /// States with `next`, all from their old values.
    fn renew(&mut self) {
        if self.moves.iter().all(|moves| *moves) {
            return;
        }
        let mut new = self.states();
        for (new, motion) in new.iter_mut().zip(&self.equations.motions) {
            if let Motion::Next(next) = motion {
                *new = sound(next.eval(&self.values));
            }
        }
        self.set(&new);
    }

    /// Rates at the given states; 0 for those that have none.
    fn rates(&mut self, states: &[f64; N]) -> [f64; N] {
        self.set(states);
        let mut rates = [0.0; N];
        for (rate, motion) in rates.iter_mut().zip(&self.equations.motions) {
            if let Motion::Rate(expression) = motion {
                let value = expression.eval(&self.values);
                // A rate may be large where its time constant is small.
                *rate = if value.is_finite() { value } else { 0.0 };
            }
        }
        rates
    }

    /// Moves the states with a rate from a sample to the next.
    ///
    /// Two-stage, second-order, L-stable diagonally implicit Runge-Kutta, two Newton steps a stage with a difference
    /// Jacobian: a time constant far below the sample period makes the state follow at once, and neither explode nor ring.
    ///
    /// # Reference
    /// R. Alexander, "Diagonally implicit Runge-Kutta methods for stiff O.D.E.'s", SIAM J. Numer. Anal. 14 (1977), 1006-1021;
    /// E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", section IV.6.
    pub(super) fn advance(&mut self, k: usize) {
        if !self.moves.contains(&true) {
            return;
        }
        let step = GAMMA * self.inputs.period_s;
        let start = self.states();
        self.stand_between(k, GAMMA);
        let first = self.rates(&start);
        let newton = Newton::new(self, &start, &first, step);
        let mut inner = start;
        newton.correct(&mut inner, &start, &first, step);
        let rates = self.rates(&inner);
        newton.correct(&mut inner, &start, &rates, step);
        // The rate that the first stage came out with.
        let base: [f64; N] = std::array::from_fn(|i| start[i] + (1.0 - GAMMA) / GAMMA * (inner[i] - start[i]));
        let mut end: [f64; N] = std::array::from_fn(|i| start[i] + (inner[i] - start[i]) / GAMMA);
        self.stand_between(k, 1.0);
        for _ in 0..2 {
            let rates = self.rates(&end);
            newton.correct(&mut end, &base, &rates, step);
        }
        let moved = std::array::from_fn(|i| if self.moves[i] { sound(end[i]) } else { start[i] });
        self.set(&moved);
    }
}

/// `1 - step x Jacobian` in triangular factors; as good as 1 where it cannot be solved.
struct Newton<const N: usize> {
    rows: [[f64; N]; N],
    order: [usize; N],
}

impl<const N: usize> Newton<N> {
    fn new(machine: &mut Machine<'_, N>, at: &[f64; N], rates: &[f64; N], step: f64) -> Self {
        let mut rows = [[0.0; N]; N];
        for j in 0..N {
            // A thousandth of what the state moves in a step, or rounding's cube root of itself: whichever is larger.
            let apart = (6e-6 * at[j].abs()).max(1e-3 * step * rates[j].abs()).max(1e-9);
            let mut beside = *at;
            beside[j] += apart;
            let there = machine.rates(&beside);
            for (i, row) in rows.iter_mut().enumerate() {
                row[j] = f64::from(u8::from(i == j)) - step * (there[i] - rates[i]) / apart;
            }
        }
        Self::factored(rows)
    }

    /// Gaussian elimination with row pivots.
    fn factored(mut rows: [[f64; N]; N]) -> Self {
        let mut order: [usize; N] = std::array::from_fn(|i| i);
        for column in 0..N {
            let best = (column..N)
                .max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))
                .unwrap_or(column);
            rows.swap(column, best);
            order.swap(column, best);
            let pivot = rows[column][column];
            if !(pivot.is_normal() && pivot.abs() > 1e-12) {
                return Self {
                    rows: std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j)))),
                    order: std::array::from_fn(|i| i),
                };
            }
            for row in column + 1..N {
                let factor = rows[row][column] / pivot;
                rows[row][column] = factor;
                let above = rows[column];
                for (cell, above) in rows[row].iter_mut().zip(above).skip(column + 1) {
                    *cell -= factor * above;
                }
            }
        }
        Self { rows, order }
    }

    /// One Newton step towards `z = base + step x rate(z)`.
    fn correct(&self, states: &mut [f64; N], base: &[f64; N], rates: &[f64; N], step: f64) {
        let off: [f64; N] = std::array::from_fn(|i| states[i] - base[i] - step * rates[i]);
        let mut x: [f64; N] = std::array::from_fn(|i| off[self.order[i]]);
        for i in 1..N {
            for j in 0..i {
                x[i] -= self.rows[i][j] * x[j];
            }
        }
        for i in (0..N).rev() {
            for j in i + 1..N {
                x[i] -= self.rows[i][j] * x[j];
            }
            x[i] /= self.rows[i][i];
        }
        for (state, x) in states.iter_mut().zip(x) {
            *state = sound(*state - x);
        }
    }
}

/// Steady periodic states before the run-in: shooting over one period (T. J. Aprille, T. N. Trick, 1972, Proc. IEEE 60, 108),
/// one Newton step from where a period at rest leads; exact where the states are linear. `machine` stands at the first sample.
pub(super) fn settle<const N: usize>(machine: &mut Machine<'_, N>) {
    let run_in = machine.inputs.run_in;
    let over_a_period = |machine: &Machine<'_, N>, from: &[f64; N]| -> [f64; N] {
        let mut other = machine.clone();
        other.set(from);
        for k in 0..run_in {
            other.stand_at(k);
            other.renew();
            other.advance(k);
        }
        other.states()
    };
    let from = over_a_period(machine, &machine.states());
    let to = over_a_period(machine, &from);
    let off = |a: &[f64; N], b: &[f64; N]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    let mut best = to;
    // What still moves by a millionth from period to period has settled: no reading shows it.
    if off(&from, &to) > 1e-12 * from.iter().map(|z| z * z).sum::<f64>() {
        let mut rows = [[0.0; N]; N];
        for j in 0..N {
            let apart = (1e-4 * from[j].abs()).max(0.1 * (to[j] - from[j]).abs()).max(1e-9);
            let mut beside = from;
            beside[j] += apart;
            let there = over_a_period(machine, &beside);
            for i in 0..N {
                rows[i][j] = f64::from(u8::from(i == j)) - (there[i] - to[i]) / apart;
            }
        }
        let mut steady = from;
        // The same linear equations as an implicit step of length 1 with the change over a period as the rate.
        let change: [f64; N] = std::array::from_fn(|i| to[i] - from[i]);
        Newton::factored(rows).correct(&mut steady, &from, &change, 1.0);
        let again = over_a_period(machine, &steady);
        if off(&steady, &again) < off(&from, &to) {
            best = again;
        }
    }
    machine.set(&best);
}
