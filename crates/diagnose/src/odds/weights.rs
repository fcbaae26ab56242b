//! The weights of the terms, fitted to 379 cases by `cargo xtask calibrate odds --write`.

use super::TERMS;

/// The weight of each [`Term`](super::Term), in their order.
pub const WEIGHTS: [f64; TERMS] = [
    -0.059, -0.047, 1.684, 0.153, -0.068, 0.100, 1.350, -1.468, 0.639, 0.535, -0.350, -0.261, -4.715, 0.601, -0.900,
    4.104, 1.113, 0.090, 2.083, 1.469, -0.423, 0.419, 5.181, 0.362, -0.319, -0.637, -0.897, -0.598, -0.297, 2.085,
    -0.424, 2.337, 0.011, -0.647, 0.046, 1.123, 0.207, -0.406, 2.030, 1.555, -2.635, 5.030, -2.208,
];
