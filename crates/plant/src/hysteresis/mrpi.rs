//! The paper's modified rate-dependent Prandtl-Ishlinskii model as a stage, written from its equations.

use rand::RngExt;

use crate::error::{StageError, within};

/// `y = b1 x^3 + b2 x + sum_i q_i w_i`, `w_i = max(h_l - r_i, min(h_r, w_i))`, `h_l = x - alpha |x'|`, `h_r = x + beta |x'|` (eqs 7-10).
///
/// x is the voltage over `reference_v`; y is scaled to the stroke by [`super::Hysteresis`]. The rate x' is the stage's own (the voltage's slope
/// seen through a 10 us lag, which has the half-sample delay of the paper's backward difference at 50 kHz).
///
/// # Reference
/// The paper's eqs 7 to 10; the one-sided play is its eq. 4.
#[derive(Debug, Clone, PartialEq)]
pub struct Mrpi {
    /// b1, the cubic coefficient.
    pub cubic: f64,
    /// b2, the linear coefficient.
    pub linear: f64,
    /// r_i, fractions of `reference_v`.
    pub thresholds: Vec<f64>,
    /// q_i.
    pub weights: Vec<f64>,
    /// alpha, seconds.
    pub alpha_s: f64,
    /// beta, seconds.
    pub beta_s: f64,
}

impl Mrpi {
    /// The paper's example of figure 2: four plays with thresholds at 0, 1/4, 1/2 and 3/4.
    pub fn figure_2() -> Self {
        Self {
            cubic: -0.0820,
            linear: 0.5,
            thresholds: vec![0.0, 0.25, 0.5, 0.75],
            weights: vec![0.2667, 0.1690, 0.0973, 0.1447],
            alpha_s: 5e-4,
            beta_s: 8e-4,
        }
    }

    /// Draws a model with 8 to 14 plays.
    ///
    /// # Range
    /// b2 = 1, b1 = -0.15 to 0.10; thresholds graded from 0.01 to 0.8 by a power law of exponent 1 to 2, weights 0.02 to 0.10 each; alpha and beta
    /// 10 to 100 us, their ratio 0.7 to 1.4.
    pub fn random(rng: &mut impl RngExt) -> Self {
        let plays = rng.random_range(8..=14_usize);
        let grading = rng.random_range(1.0..2.0);
        let thresholds = (0..plays)
            .map(|i| 0.01 + 0.79 * ((i as f64 + 0.5) / plays as f64).powf(grading))
            .collect::<Vec<f64>>();
        let weights = thresholds.iter().map(|_| rng.random_range(0.02..0.10)).collect();
        let alpha_s = 1e-5 * 10_f64.powf(rng.random_range(0.0..1.0));
        Self {
            cubic: rng.random_range(-0.15..0.10),
            linear: 1.0,
            thresholds,
            weights,
            alpha_s,
            beta_s: alpha_s * rng.random_range(0.7..1.4),
        }
    }

    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within("hysteresis.mrpi.cubic", self.cubic, -1e3, 1e3, "b1 is dimensionless")?;
        within("hysteresis.mrpi.linear", self.linear, -1e3, 1e3, "b2 is dimensionless")?;
        within(
            "hysteresis.mrpi.alpha_s",
            self.alpha_s,
            0.0,
            0.1,
            "alpha is 1e-5 to 1e-3 s",
        )?;
        within(
            "hysteresis.mrpi.beta_s",
            self.beta_s,
            0.0,
            0.1,
            "beta is 1e-5 to 1e-3 s",
        )?;
        if self.weights.len() != self.thresholds.len() {
            return Err(StageError::Length {
                name: "hysteresis.mrpi.weights".to_owned(),
                found: self.weights.len(),
                wanted: format!("as many as thresholds ({})", self.thresholds.len()),
                advice: "give one weight for each threshold",
            });
        }
        for (i, (&threshold, &weight)) in self.thresholds.iter().zip(&self.weights).enumerate() {
            within(
                &format!("hysteresis.mrpi.thresholds[{i}]"),
                threshold,
                0.0,
                1e3,
                "thresholds are fractions of reference_v",
            )?;
            within(
                &format!("hysteresis.mrpi.weights[{i}]"),
                weight,
                -1e3,
                1e3,
                "weights are dimensionless",
            )?;
        }
        Ok(())
    }
}

/// The model in motion.
#[derive(Debug, Clone)]
pub(crate) struct MrpiState {
    config: Mrpi,
    per_volt: f64,
    outputs: Vec<f64>,
}

impl MrpiState {
    pub(crate) fn new(config: &Mrpi, reference_v: f64) -> Self {
        Self {
            config: config.clone(),
            per_volt: 1.0 / reference_v,
            outputs: vec![0.0; config.weights.len()],
        }
    }

    pub(crate) fn advance(&mut self, voltage_v: f64, rate_v_per_s: f64) -> f64 {
        let x = voltage_v * self.per_volt;
        let speed = (rate_v_per_s * self.per_volt).abs();
        let left = x - self.config.alpha_s * speed;
        let right = x + self.config.beta_s * speed;
        let mut y = (self.config.cubic * x * x + self.config.linear) * x;
        for ((w, r), q) in self
            .outputs
            .iter_mut()
            .zip(&self.config.thresholds)
            .zip(&self.config.weights)
        {
            *w = w.min(right).max(left - r);
            y += q * *w;
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::{Mrpi, MrpiState};

    /// Figure 1: one play with r = 0.1, alpha = 3e-4 s, beta = 1e-4 s, v = 0.5 - 0.5 cos, backward difference at 20 us: openings at mid
    /// stroke 0.1126, 0.3513, 0.6520 at 10, 200, 500 Hz (of the input's peak to peak, 1), read to four digits.
    #[test]
    fn val_figure_1_openings() {
        for (frequency_hz, expected) in [(10.0, 0.1126), (200.0, 0.3513), (500.0, 0.6520)] {
            let config = Mrpi {
                cubic: 0.0,
                linear: 0.0,
                thresholds: vec![0.1],
                weights: vec![1.0],
                alpha_s: 3e-4,
                beta_s: 1e-4,
            };
            let mut state = MrpiState::new(&config, 1.0);
            let period_s = 2e-5;
            let samples = (4.0 / (frequency_hz * period_s)) as usize;
            let one = samples / 4;
            let mut before = 0.0;
            let (mut v, mut y) = (Vec::new(), Vec::new());
            for n in 0..samples {
                let input = 0.5 - 0.5 * (std::f64::consts::TAU * frequency_hz * n as f64 * period_s).cos();
                let output = state.advance(input, (input - before) / period_s);
                before = input;
                if n >= samples - one {
                    v.push(input);
                    y.push(output);
                }
            }
            let at = |rising: bool| {
                let i = (1..v.len())
                    .find(|&i| {
                        if rising {
                            v[i - 1] < 0.5 && v[i] >= 0.5
                        } else {
                            v[i - 1] >= 0.5 && v[i] < 0.5
                        }
                    })
                    .unwrap();
                y[i - 1] + (y[i] - y[i - 1]) * (0.5 - v[i - 1]) / (v[i] - v[i - 1])
            };
            let opening = at(false) - at(true);
            assert!(
                (opening - expected).abs() < 1e-3,
                "{frequency_hz} Hz: {opening}, figure {expected}"
            );
        }
    }

    /// Figure 2: y of the last of four periods runs from 0.0786 to 0.8463 at 10 Hz and from 0.0980 to 0.8342 at 500 Hz, with thresholds
    /// 0, .25, .5, .75 of the largest input 0.9333.
    #[test]
    fn val_figure_2_ranges() {
        for (frequency_hz, low, high) in [(10.0, 0.0786, 0.8463), (500.0, 0.0980, 0.8342)] {
            let mut config = Mrpi::figure_2();
            config.thresholds.iter_mut().for_each(|r| *r *= 0.9333);
            let mut state = MrpiState::new(&config, 1.0);
            let period_s = 2e-5;
            let samples = (4.0 / (frequency_hz * period_s)) as usize;
            let mut before = 0.5;
            let mut range = (f64::MAX, f64::MIN);
            for n in 0..samples {
                let x = std::f64::consts::TAU * frequency_hz * n as f64 * period_s;
                let input = 0.25 * x.sin() + 0.3 * (3.0 * x).sin() + 0.5;
                let output = state.advance(input, (input - before) / period_s);
                before = input;
                if n >= samples / 4 * 3 {
                    range = (range.0.min(output), range.1.max(output));
                }
            }
            assert!(
                (range.0 - low).abs() < 1e-3 && (range.1 - high).abs() < 1e-3,
                "{frequency_hz} Hz: {range:?}"
            );
        }
    }
}
