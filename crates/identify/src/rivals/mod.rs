//! The rate-dependent play models that the paper counts parameters of in its Table 1, as direct inverses, to be compared with.
//!
//! They are fitted and run on the PC only. All use two-sided plays (eq. 2), as their authors do; with half the one-sided thresholds
//! of eq. 16 these are the paper's own plays but for a shift.

mod dead_zones;
mod fit;

pub use fit::{FittedRival, fit_rival};

use dead_zones::DeadZones;
use hysteron_core::model::Hysteresis;
use hysteron_core::play::two_sided;
use serde::Serialize;

/// A model of the paper's Table 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rival {
    /// Weights that change with the rate, `x = sum (k_i + l_i v') F_ri[v]`, dead zones behind: Ang, Khosla, Riviere, IEEE/ASME
    /// Trans. Mechatronics 12 (2007) 134.
    DynamicWeights,
    /// Thresholds that grow with the logarithm of the rate, `r_i = i a ln(b + l |v'|^e)`: Al Janaideh, Su, Rakheja, Smart Mater.
    /// Struct. 17 (2008) 035026. Its envelopes of hyperbolic tangents are replaced by the cubic that the paper gives its own rivals.
    LogThresholds,
    /// Thresholds that grow with the rate and keep their distance, `r_i = a i + b |v'|`, dead zones behind: Al Janaideh, Krejci,
    /// IEEE/ASME Trans. Mechatronics 18 (2013) 1498.
    LinearThresholds,
    /// Plays that do not know the rate, and beside them a damper `c |v'|^m sgn v'`: Yang, Li, Gu, Zhu, Int. J. Adv. Robot. Syst. 11
    /// (2014) 163. There the damper's parameters are functions of a sine's frequency, which a controller does not know: here constants.
    VelocityDamping,
}

/// What a step costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Operations {
    /// Multiply-adds.
    pub multiply_adds: usize,
    /// Compares and selects.
    pub compares: usize,
    /// Calls of a logarithm or a power: 12 to 1600 instructions each on a Cortex-M4F.
    pub calls: usize,
}

impl Rival {
    /// All of them, in the order of Table 1.
    pub const ALL: [Self; 4] = [
        Self::DynamicWeights,
        Self::LogThresholds,
        Self::LinearThresholds,
        Self::VelocityDamping,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::DynamicWeights => "Ang",
            Self::LogThresholds => "Al Janaideh, logarithm",
            Self::LinearThresholds => "Al Janaideh, linear",
            Self::VelocityDamping => "Yang",
        }
    }

    /// Parameters that Table 1 counts for ten plays (and four dead zones where there are any).
    pub fn published_parameters(self) -> usize {
        match self {
            Self::DynamicWeights => 24,
            Self::LogThresholds | Self::VelocityDamping => 23,
            Self::LinearThresholds => 16,
        }
    }

    /// Dead zones behind the plays: m = 4 in Table 1.
    fn dead_zones(self) -> usize {
        match self {
            Self::DynamicWeights | Self::LinearThresholds => 4,
            Self::LogThresholds | Self::VelocityDamping => 0,
        }
    }

    /// Columns that the plays, the input and its rate contribute.
    fn columns(self, plays: usize) -> usize {
        match self {
            Self::DynamicWeights => 2 * plays,
            Self::LogThresholds => plays + 2,
            Self::LinearThresholds => plays,
            Self::VelocityDamping => plays + 3,
        }
    }

    /// What a step costs: two compares a play; multiply-adds for weights, moving thresholds and the input function.
    pub fn operations(self, plays: usize) -> Operations {
        let zones = self.dead_zones();
        let (multiply_adds, calls) = match self {
            // k_i + l_i v', and times the play.
            Self::DynamicWeights => (2 * plays + zones + 1, 0),
            // i times one logarithm; weights; the cubic.
            Self::LogThresholds => (2 * plays + 5, 2),
            // One |v'| for all; weights.
            Self::LinearThresholds => (2 * plays + zones + 2, 0),
            Self::VelocityDamping => (plays + 5, 1),
        };
        Operations {
            multiply_adds,
            compares: 2 * plays + zones,
            calls,
        }
    }
}

/// The parameters in which a rival is not linear.
///
/// # Units
/// Of the input, and of its rate per second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) enum Shape {
    Fixed,
    /// `alpha ln(beta + lambda |v'|^epsilon)`.
    Log {
        alpha: f64,
        beta: f64,
        lambda: f64,
        epsilon: f64,
    },
    /// `alpha i + beta_s |v'|`.
    Linear {
        alpha: f64,
        beta_s: f64,
    },
    Power {
        exponent: f64,
    },
}

impl Shape {
    fn parameters(self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Log { .. } => 4,
            Self::Linear { .. } => 2,
            Self::Power { .. } => 1,
        }
    }

    /// Threshold of play i at a rate; `static_threshold` where the rate does not move it.
    fn threshold(self, i: usize, static_threshold: f64, moved: f64) -> f64 {
        match self {
            Self::Fixed | Self::Power { .. } => static_threshold,
            Self::Log { .. } => i as f64 * moved,
            // p_0 weighs the input itself: that play has no width at any rate.
            Self::Linear { alpha, .. } if i > 0 => alpha * i as f64 + moved,
            Self::Linear { .. } => 0.0,
        }
    }

    /// What the rate does to thresholds, the same for all plays.
    fn moved(self, rate_per_s: f64) -> f64 {
        match self {
            Self::Fixed | Self::Power { .. } => 0.0,
            Self::Log {
                alpha,
                beta,
                lambda,
                epsilon,
            } => alpha * (beta + lambda * rate_per_s.abs().powf(epsilon)).ln(),
            Self::Linear { beta_s, .. } => beta_s * rate_per_s.abs(),
        }
    }
}

/// A rival with its plays' thresholds: everything that its columns depend on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Columns {
    pub rival: Rival,
    pub thresholds: Vec<f64>,
    pub shape: Shape,
}

/// State of a rival: the plays' outputs and the last input.
#[derive(Debug, Clone, PartialEq)]
pub struct RivalState {
    outputs: Vec<f64>,
    last: f64,
}

impl Columns {
    fn start(&self, input: f64) -> RivalState {
        RivalState {
            outputs: vec![input; self.thresholds.len()],
            last: input,
        }
    }

    /// Moves the plays to the next input and writes the columns; the rate is the backward difference.
    fn advance(&self, state: &mut RivalState, input: f64, samples_per_s: f64, row: &mut [f64]) {
        let rate = (input - state.last) * samples_per_s;
        state.last = input;
        let moved = self.shape.moved(rate);
        for (i, (output, &threshold)) in state.outputs.iter_mut().zip(&self.thresholds).enumerate() {
            *output = two_sided(input, *output, self.shape.threshold(i, threshold, moved));
        }
        let n = state.outputs.len();
        let (plays, rest) = row.split_at_mut(n);
        plays.copy_from_slice(&state.outputs);
        match self.rival {
            Rival::DynamicWeights => rest.iter_mut().zip(plays).for_each(|(cell, play)| *cell = rate * *play),
            Rival::LinearThresholds => {}
            Rival::LogThresholds | Rival::VelocityDamping => {
                rest[0] = input;
                rest[1] = input * input * input;
                if let Shape::Power { exponent } = self.shape {
                    rest[2] = rate.signum() * rate.abs().powf(exponent);
                }
            }
        }
    }
}

/// A fitted rival at the sample rate it was fitted at, as a direct inverse: the output is a voltage.
#[derive(Debug, Clone, PartialEq)]
pub struct RivalModel {
    columns: Columns,
    weights: Vec<f64>,
    zones: DeadZones,
    offset: f64,
    range: [f64; 2],
    samples_per_s: f64,
}

impl RivalModel {
    /// Which one it is.
    pub fn rival(&self) -> Rival {
        self.columns.rival
    }

    /// Parameters that were fitted, without the offset (the sensor's zero, which the paper leaves out) and without the thresholds of
    /// eq. 16.
    pub fn parameters(&self) -> usize {
        self.weights.len() + self.zones.slopes().len() + self.columns.shape.parameters()
    }

    /// The state after the input has rested at this value.
    pub fn start(&self, input: f64) -> RivalState {
        self.columns.start(input)
    }
}

impl Hysteresis<f64> for RivalModel {
    type State = RivalState;

    /// Inputs beyond the range of the fit are brought into it; the rate is counted at the sample rate of the fit.
    ///
    /// # Cost
    /// [`Rival::operations`]; allocates, as it is no code for a controller.
    fn step(&self, state: &mut RivalState, input: f64) -> f64 {
        let [low, high] = self.range;
        // A NaN becomes the low end.
        let input = input.max(low).min(high);
        let mut row = vec![0.0; self.weights.len()];
        self.columns.advance(state, input, self.samples_per_s, &mut row);
        let inner: f64 = row.iter().zip(&self.weights).map(|(x, w)| x * w).sum();
        self.offset + self.zones.output(inner)
    }
}
