//! The dynamic envelope of the rate-dependent play operator (eq. 9).

use crate::real::Real;

/// Dynamic envelope functions, eq. 9: `h_l = v - alpha |v'|`, `h_r = v + beta |v'|`.
///
/// # Units
/// `alpha_s` and `beta_s` are seconds; the rate is the input's unit per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Envelope<T> {
    /// alpha, seconds
    pub alpha_s: T,
    /// beta, seconds
    pub beta_s: T,
}

impl<T: Real> Envelope<T> {
    /// `(h_l, h_r)` for one sample.
    #[inline(always)]
    pub fn bounds(&self, input: T, rate_per_s: T) -> (T, T) {
        let speed = rate_per_s.magnitude();
        (input - self.alpha_s * speed, input + self.beta_s * speed)
    }
}
