//! What a play's output and the input are turned into, well conditioned: powers about the middle of what they reach on the
//! records, and straight lines beyond.
//!
//! The coefficients of these functions and those of [`hysteron_core::play_polynomial`] are the same polynomials: inside the
//! range both give the same output, to rounding.

use crate::effects::Family;

/// The functions of one hysteresis: its family, and the range of inputs it was fitted on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Basis {
    family: Family,
    middle: f64,
    half: f64,
}

/// Middle and half width of what a polynomial is written in.
#[derive(Debug, Clone, Copy)]
struct Window {
    middle: f64,
    half: f64,
}

impl Basis {
    pub(crate) fn new(family: Family, [low, high]: [f64; 2]) -> Self {
        let half = 0.5 * (high - low);
        Self {
            family,
            middle: 0.5 * (low + high),
            half: if half > 0.0 { half } else { 1.0 },
        }
    }

    /// Whether the functions are other than the family's own powers.
    fn centred(&self) -> bool {
        self.family.is_free()
    }

    fn of_input(&self) -> Window {
        Window {
            middle: self.middle,
            half: self.half,
        }
    }

    /// A one-sided play moves between the lowest input and its threshold below the highest.
    fn of_play(&self, threshold: f64) -> Window {
        Window {
            middle: self.middle - 0.5 * threshold,
            // A play as wide as the range hardly moves; a twentieth keeps its powers from exploding.
            half: (self.half - 0.5 * threshold).max(0.05 * self.half),
        }
    }

    /// What a play's or a fading element's functions are written in: what fades along the path of `u^k` fades along that of each power of
    /// the voltage, and what fades along that of 1 stays 1.
    fn of_element(&self, threshold: f64) -> Window {
        match self.family {
            Family::Duhem => self.of_input(),
            _ => self.of_play(threshold),
        }
    }

    /// The three powers that fading elements follow, straight lines beyond the range.
    #[inline(always)]
    pub(crate) fn followed(&self, v: f64) -> [f64; 3] {
        let mut cells = [0.0; 3];
        powers(self.about_the_middle(v), &mut cells);
        cells
    }

    /// The voltage from -1 to 1 over the range.
    #[inline(always)]
    pub(crate) fn about_the_middle(&self, v: f64) -> f64 {
        (v - self.middle) / self.half
    }

    /// Half the range.
    pub(crate) fn half(&self) -> f64 {
        self.half
    }

    /// The input's functions into `cells`, one a power of the family.
    #[inline(always)]
    pub(crate) fn input(&self, v: f64, cells: &mut [f64]) {
        if self.centred() {
            powers(self.about_the_middle(v), cells);
        } else {
            for (cell, &power) in cells.iter_mut().zip(self.family.input_powers()) {
                *cell = v.powi(power);
            }
        }
    }

    /// The sum of the input's functions by their weights, one a power of the family, at each voltage.
    pub(crate) fn input_function(&self, weights: &[f64], voltages_v: &[f64]) -> Vec<f64> {
        if let (true, Ok(weights)) = (self.centred(), weights.try_into()) {
            let basis = self;
            return pulp::Arch::new().dispatch(Polynomial {
                basis,
                weights,
                voltages_v,
            });
        }
        let mut cells = vec![0.0; weights.len()];
        let of_input = |&v: &f64| {
            self.input(v, &mut cells);
            cells.iter().zip(weights).map(|(x, c)| x * c).sum()
        };
        voltages_v.iter().map(of_input).collect()
    }

    /// Functions of plays, by power: as many as the family has coefficients a play.
    #[inline(always)]
    pub(crate) fn plays<const N: usize>(&self, scales: &PlayScales<N>, w: &[f64; N], rate: f64) -> [[f64; N]; 3] {
        let mut functions = [*w, [0.0; N], [0.0; N]];
        match self.family {
            Family::Pi | Family::Mpi | Family::Mrpi | Family::Duhem => {}
            Family::Wrpi => functions[1] = w.map(|w| w * rate),
            Family::PlayPolynomial => {
                for l in 0..N {
                    let x = (w[l] - scales.middle[l]) * scales.per_unit[l];
                    let inside = x.clamp(-1.0, 1.0);
                    let beyond = x - inside;
                    let square = inside * inside;
                    functions[0][l] = x;
                    functions[1][l] = square + 2.0 * inside * beyond;
                    functions[2][l] = (square + 3.0 * inside * beyond) * inside;
                }
            }
        }
        functions
    }

    /// The part of each play, its functions by their weights.
    #[inline(always)]
    pub(crate) fn weighed<const N: usize>(
        &self,
        scales: &PlayScales<N>,
        weights: &[[f64; N]; 3],
        w: &[f64; N],
        rate: f64,
    ) -> [f64; N] {
        by_weight(&self.plays(scales, w, rate), weights)
    }

    /// What [`Self::plays`] needs of thresholds.
    pub(crate) fn scales<const N: usize>(&self, thresholds: &[f64]) -> PlayScales<N> {
        let mut scales = PlayScales {
            middle: [0.0; N],
            per_unit: [0.0; N],
        };
        for (l, &threshold) in thresholds.iter().enumerate().take(N) {
            let window = self.of_play(threshold);
            (scales.middle[l], scales.per_unit[l]) = (window.middle, 1.0 / window.half);
        }
        scales
    }

    /// Coefficients of the core's own powers, laid out as [`crate::columns::fill`] does.
    pub(crate) fn to_powers(self, thresholds: &[f64], coefficients: &[f64]) -> Vec<f64> {
        self.rewritten(thresholds, coefficients, |window, own| {
            shifted(own, -window.middle / window.half, 1.0 / window.half)
        })
    }

    /// The inverse of [`Self::to_powers`].
    pub(crate) fn of_powers(self, thresholds: &[f64], coefficients: &[f64]) -> Vec<f64> {
        self.rewritten(thresholds, coefficients, |window, own| {
            shifted(own, window.middle, window.half)
        })
    }

    fn rewritten(
        self,
        thresholds: &[f64],
        coefficients: &[f64],
        rewrite: impl Fn(Window, &[f64]) -> Vec<f64>,
    ) -> Vec<f64> {
        let mut all = coefficients.to_vec();
        if !self.centred() {
            return all;
        }
        let inputs = self.family.input_powers().len();
        let n = thresholds.len();
        let of_input = rewrite(self.of_input(), &coefficients[1..=inputs]);
        all[0] += of_input[0];
        all[1..=inputs].copy_from_slice(&of_input[1..]);
        for (i, &threshold) in thresholds.iter().enumerate() {
            let at = |power: usize| 1 + inputs + power * n + i;
            let own: Vec<f64> = (0..3).map(|power| coefficients[at(power)]).collect();
            let of_play = rewrite(self.of_element(threshold), &own);
            all[0] += of_play[0];
            (0..3).for_each(|power| all[at(power)] = of_play[power + 1]);
        }
        all
    }
}

/// Degree of a free shape's input function.
const DEGREE: usize = 5;

/// The input function of a free shape over voltages, by the widest vectors of the processor.
struct Polynomial<'p> {
    basis: &'p Basis,
    weights: &'p [f64; DEGREE],
    voltages_v: &'p [f64],
}

impl pulp::NullaryFnOnce for Polynomial<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn call(self) -> Vec<f64> {
        let mut sums = vec![0.0; self.voltages_v.len()];
        for (sum, &v) in sums.iter_mut().zip(self.voltages_v) {
            let mut cells = [0.0; DEGREE];
            powers(self.basis.about_the_middle(v), &mut cells);
            for (x, c) in cells.iter().zip(self.weights) {
                *sum += x * c;
            }
        }
        sums
    }
}

/// Functions by their weights, added up for each element.
#[inline(always)]
pub(crate) fn by_weight<const N: usize>(functions: &[[f64; N]; 3], weights: &[[f64; N]; 3]) -> [f64; N] {
    let mut parts = [0.0; N];
    for l in 0..N {
        parts[l] = weights[0][l] * functions[0][l] + weights[1][l] * functions[1][l] + weights[2][l] * functions[2][l];
    }
    parts
}

/// Middles of plays' travels, and what makes half of each one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlayScales<const N: usize> {
    middle: [f64; N],
    per_unit: [f64; N],
}

/// Powers of `x` from the first on; straight lines beyond -1 and 1.
#[inline(always)]
fn powers(x: f64, cells: &mut [f64]) {
    let inside = x.clamp(-1.0, 1.0);
    let beyond = x - inside;
    let mut before = 1.0;
    for (k, cell) in cells.iter_mut().enumerate() {
        *cell = before * inside + (k + 1) as f64 * before * beyond;
        before *= inside;
    }
}

/// The polynomial `sum c_k x^k`, k from 1, of `x = origin + slope z`, in powers of z from 0.
fn shifted(own: &[f64], origin: f64, slope: f64) -> Vec<f64> {
    // Horner's scheme over polynomials of z.
    let mut sum = vec![0.0; own.len() + 1];
    for &c in own.iter().rev() {
        sum[0] += c;
        for k in (0..sum.len()).rev() {
            let below = if k > 0 { sum[k - 1] * slope } else { 0.0 };
            sum[k] = sum[k] * origin + below;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::{fill, output};

    const THRESHOLDS: [f64; 3] = [2.0, 15.0, 60.0];

    fn coefficients() -> Vec<f64> {
        (0..15).map(|k| 0.3 * f64::from((k * 7) % 5 - 2)).collect()
    }

    fn by_basis(basis: &Basis, c: &[f64], v: f64, outputs: &[f64; 3]) -> f64 {
        let mut cells = [0.0; 5];
        basis.input(v, &mut cells);
        let of_input: f64 = cells.iter().zip(&c[1..6]).map(|(x, c)| x * c).sum();
        let weights = std::array::from_fn(|power| std::array::from_fn(|i| c[6 + 3 * power + i]));
        let of_plays = basis.weighed(&basis.scales(&THRESHOLDS), &weights, outputs, 0.0);
        c[0] + of_input + of_plays.iter().sum::<f64>()
    }

    /// Inside the range the core's powers and these functions are one polynomial; to and fro changes nothing.
    #[test]
    fn val_the_same_polynomials_as_the_cores() {
        let basis = Basis::new(Family::PlayPolynomial, [-10.0, 90.0]);
        let own = coefficients();
        let powers = basis.to_powers(&THRESHOLDS, &own);
        for (a, b) in own.iter().zip(basis.of_powers(&THRESHOLDS, &powers)) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        for (v, outputs) in [(0.0, [-1.0, -8.0, -10.0]), (77.0, [76.0, 70.0, 25.0])] {
            let here = by_basis(&basis, &own, v, &outputs);
            let core = output(Family::PlayPolynomial, &powers, v, 0.0, &outputs);
            assert!((here - core).abs() < 1e-9, "{here} {core}");
            let mut row = vec![0.0; 15];
            fill(Family::PlayPolynomial, v, 0.0, &outputs, &mut row);
            let by_row: f64 = row.iter().zip(&powers).map(|(x, c)| x * c).sum();
            assert!((by_row - core).abs() < 1e-9);
        }
    }

    /// Beyond what was fitted the output goes on in a straight line: no second difference.
    #[test]
    fn val_straight_lines_beyond_the_range() {
        let basis = Basis::new(Family::PlayPolynomial, [0.0, 100.0]);
        let own = coefficients();
        let at = |v: f64| by_basis(&basis, &own, v, &[v - 1.0, v - 10.0, v - 40.0]);
        let second = at(150.0) - 2.0 * at(160.0) + at(170.0);
        assert!(second.abs() < 1e-9, "{second}");
        // No step and no kink at the edge of the input's range.
        let mut edge = [[0.0; 5]; 3];
        for (cells, v) in edge.iter_mut().zip([100.0 - 1e-6, 100.0, 100.0 + 1e-6]) {
            basis.input(v, cells);
        }
        let [before, at, after] = edge;
        for ((a, b), c) in before.iter().zip(at).zip(after) {
            assert!((a - 2.0 * b + c).abs() < 1e-12);
        }
    }
}
