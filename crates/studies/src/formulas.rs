//! What the paper's formulas give with the paper's own numbers, computed with the core: figures 1 and 2, Table 2, Table 1.

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::envelope::Envelope;
use hysteron_core::model::Hysteresis;
use hysteron_core::mpi::MpiCoefficients;
use hysteron_core::mrpi::Mrpi;
use hysteron_core::thresholds::Thresholds;
use hysteron_identify::loop_opening::opening_percent;
use hysteron_identify::period::Periodic;
use hysteron_tracking::TrackingError;
use std::f64::consts::{PI, TAU};

/// The paper's sample rate, hertz.
pub const RATE_HZ: f64 = 50e3;

/// Frequencies of figure 1, hertz.
pub const FIGURE_1_HZ: [f64; 3] = [10.0, 200.0, 500.0];
/// Envelope of figure 1, seconds.
const FIGURE_1_ENVELOPE: Envelope<f64> = Envelope {
    alpha_s: 3e-4,
    beta_s: 1e-4,
};
/// Threshold of figure 1.
const FIGURE_1_THRESHOLD: f64 = 0.1;

/// An input and what a model makes of it, one settled period.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// Frequency of the input, hertz.
    pub frequency_hz: f64,
    /// Input.
    pub input: Vec<f64>,
    /// Output.
    pub output: Vec<f64>,
}

impl Loop {
    /// The last of four periods of `drive`, one sample more than a period, so that the loop closes.
    fn of<const N: usize>(model: &Mrpi<f64, N>, frequency_hz: f64, drive: impl Fn(f64) -> f64) -> Self {
        let mut state = PlayState::virgin();
        let a_period = (RATE_HZ / frequency_hz).round() as usize;
        let mut found = Self {
            frequency_hz,
            input: Vec::new(),
            output: Vec::new(),
        };
        for k in 0..=4 * a_period {
            let input = drive(k as f64 / RATE_HZ);
            let output = model.step(&mut state, input);
            if k >= 3 * a_period {
                found.input.push(input);
                found.output.push(output);
            }
        }
        found
    }

    /// Output on the falling minus output on the rising branch where the input passes `level`, interpolated.
    pub fn opening_at(&self, level: f64) -> Option<f64> {
        let pairs = || self.input.windows(2).zip(self.output.windows(2));
        let crossing = |rising: bool| {
            pairs()
                .find(|(v, _)| (v[0] < level) == rising && (v[1] >= level) == rising)
                .map(|(v, y)| y[0] + (y[1] - y[0]) * (level - v[0]) / (v[1] - v[0]))
        };
        Some(crossing(false)? - crossing(true)?)
    }

    /// `integral y dv` around the loop, positive where the output lags: the sum of trapezoids, turned by its sign.
    pub fn area(&self) -> f64 {
        let trapezoids = self.input.windows(2).zip(self.output.windows(2));
        -trapezoids
            .map(|(v, y)| 0.5 * (y[0] + y[1]) * (v[1] - v[0]))
            .sum::<f64>()
    }

    /// Smallest and largest output.
    pub fn range(&self) -> [f64; 2] {
        self.output
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &y| {
                [low.min(y), high.max(y)]
            })
    }
}

/// An MRPI without offset for inputs of -2 to 2, as all of the paper's examples.
fn mrpi<const N: usize>(
    thresholds: [f64; N],
    [cubic, linear]: [f64; 2],
    weights: [f64; N],
    envelope: Envelope<f64>,
) -> Result<Mrpi<f64, N>, TrackingError> {
    let bank = PlayBank::new(Thresholds::new(thresholds)?, -2.0, 2.0, RATE_HZ)?;
    let coefficients = MpiCoefficients {
        offset: 0.0,
        cubic,
        linear,
        weights,
    };
    Ok(Mrpi::new(bank, coefficients, envelope)?)
}

/// Figure 1: one rate-dependent play, r = 0.1, alpha = 3e-4, beta = 1e-4, on v = 0.5 - 0.5 cos 2 pi f t.
///
/// # Errors
/// None for the paper's numbers; those of the core.
pub fn figure_1() -> Result<Vec<Loop>, TrackingError> {
    let play = mrpi([FIGURE_1_THRESHOLD], [0.0, 0.0], [1.0], FIGURE_1_ENVELOPE)?;
    let drive = |f: f64| move |t: f64| 0.5 - 0.5 * (TAU * f * t).cos();
    Ok(FIGURE_1_HZ.map(|f| Loop::of(&play, f, drive(f))).into())
}

/// Opening of figure 1's loop at mid stroke in closed form, r + (alpha + beta) pi f: |v'| is pi f there. It holds as long
/// as the play can follow its envelope, which at 500 Hz it no longer does.
pub fn figure_1_closed_form(frequency_hz: f64) -> f64 {
    FIGURE_1_THRESHOLD + (FIGURE_1_ENVELOPE.alpha_s + FIGURE_1_ENVELOPE.beta_s) * PI * frequency_hz
}

/// Figure 2: an MRPI of four plays, its parameters in section 2.2, on v = 0.25 sin x + 0.3 sin 3x + 0.5 at 10 and 500 Hz.
///
/// The thresholds are not stated; eq. 16 with N = 4 is taken: 0, 1/4, 1/2, 3/4 of the largest v, 0.9333.
///
/// # Errors
/// None for the paper's numbers; those of the core.
pub fn figure_2() -> Result<Vec<Loop>, TrackingError> {
    let at = |x: f64| 0.25 * x.sin() + 0.3 * (3.0 * x).sin() + 0.5;
    let largest = (0..100_000).map(|k| at(TAU * f64::from(k) * 1e-5)).fold(0.0, f64::max);
    let envelope = Envelope {
        alpha_s: 5e-4,
        beta_s: 8e-4,
    };
    let thresholds = [0.0, 0.25, 0.5, 0.75].map(|share| share * largest);
    let model = mrpi(thresholds, [-0.0820, 0.5], [0.2667, 0.1690, 0.0973, 0.1447], envelope)?;
    Ok([10.0, 500.0].map(|f| Loop::of(&model, f, |t| at(TAU * f * t))).into())
}

/// What Table 2 says when it is run.
#[derive(Debug, Clone, PartialEq)]
pub struct Table2 {
    /// Output at an input that rose slowly from 0 to 1, the unit unstated.
    pub output_at_one: f64,
    /// Opening of the loop it asks for at 10, 100 and 500 Hz, percent of the input's peak to peak over the output.
    pub openings_percent: [f64; 3],
}

/// Table 2, the identified inverse MRPI: what it asks for at y = 1, and the loops it inverts, v from y = 0.5 - 0.5 cos x.
///
/// # Errors
/// None for the paper's numbers; those of the core.
pub fn table_2() -> Result<Table2, TrackingError> {
    let weights = [
        -4.8645, -0.3310, -0.0668, -0.1103, -0.0586, -0.0475, -0.0790, 0.0303, 0.6290, -0.6684,
    ];
    let envelope = Envelope {
        alpha_s: 2.1500e-5,
        beta_s: 2.1217e-5,
    };
    let thresholds = core::array::from_fn(|i| i as f64 / 10.0);
    let inverse = mrpi(thresholds, [0.1410, 6.4714], weights, envelope)?;
    let mut state = PlayState::virgin();
    // One second of rise: alpha v' is 2e-5 of the range.
    let output_at_one = (0..=50_000).fold(0.0, |_, k| inverse.step(&mut state, f64::from(k) / 50_000.0));
    let openings_percent = [10.0, 100.0, 500.0].map(|f| {
        let drive = |t: f64| 0.5 - 0.5 * (TAU * f * t).cos();
        let found = Loop::of(&inverse, f, drive);
        let samples = found.input.len() - 1;
        // The measured loop is that of y over v: the inverse's output is the loop's input.
        let twice = |values: &[f64]| [&values[..samples], values].concat();
        let periodic = Periodic { samples, from: 0 };
        opening_percent(&twice(&found.output), &twice(&found.input), periodic).unwrap_or(f64::NAN)
    });
    Ok(Table2 {
        output_at_one,
        openings_percent,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of an independent computation of the same formulas (two programs, agreeing to 1e-4).
    #[test]
    fn val_figures_1_and_2_and_table_2() {
        for (found, wanted) in figure_1().unwrap().iter().zip([0.1126, 0.3513, 0.6520]) {
            assert!((found.opening_at(0.5).unwrap() - wanted).abs() < 1e-3, "{wanted}");
        }
        let rows = [([0.0786, 0.8463], 0.1267), ([0.0980, 0.8342], 0.4050)];
        for (found, (range, area)) in figure_2().unwrap().iter().zip(rows) {
            let [low, high] = found.range();
            assert!(
                (low - range[0]).abs() < 1e-3 && (high - range[1]).abs() < 1e-3,
                "{low} {high}"
            );
            assert!((found.area() - area).abs() < 1e-3, "{}", found.area());
        }
        let table = table_2().unwrap();
        assert!((table.output_at_one - 1.297).abs() < 1e-3, "{table:?}");
        // Known to 0.1 points; the widest opening of a coarse loop depends on the grid by as much again.
        for (found, wanted) in table.openings_percent.iter().zip([8.6, 14.3, 35.8]) {
            assert!((found - wanted).abs() < 0.3, "{table:?}");
        }
    }
}
