//! The dynamic envelope of the rate-dependent play operator (eq. 9).

use crate::real::Real;

/// Dynamic envelope functions, eq. 9: `h_l = v - alpha |v'|`, `h_r = v + beta |v'|`.
///
/// # Units
/// `alpha_s` and `beta_s` are seconds; the rate is the input's unit per second.
/// # Example
/// ```
/// use hysteron_core::envelope::Envelope;
/// let envelope = Envelope { alpha_s: 3e-4, beta_s: 1e-4 };
/// assert_eq!(envelope.bounds(2.0, 0.0), (2.0, 2.0)); // slow inputs have the plain play
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Envelope<T> {
    /// alpha, seconds
    pub alpha_s: T,
    /// beta, seconds
    pub beta_s: T,
}

impl<T: Real> Envelope<T> {
    /// The envelope of changes from sample to sample, in place of rates per second.
    pub(crate) fn a_sample(&self, sample_rate_hz: T) -> Self {
        Self {
            alpha_s: self.alpha_s * sample_rate_hz,
            beta_s: self.beta_s * sample_rate_hz,
        }
    }

    /// `(h_l, h_r)` for one sample.
    #[inline(always)]
    pub fn bounds(&self, input: T, rate_per_s: T) -> (T, T) {
        let speed = rate_per_s.magnitude();
        (input - self.alpha_s * speed, input + self.beta_s * speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eq. 9 at a rise and a fall of the same speed: the bounds move away from the input, not with it.
    #[test]
    fn val_bounds() {
        let envelope = Envelope {
            alpha_s: 3e-4,
            beta_s: 1e-4,
        };
        for rate in [500.0, -500.0] {
            let (left, right) = envelope.bounds(1.0_f64, rate);
            assert!((left - 0.85).abs() < 1e-15 && (right - 1.05).abs() < 1e-15);
        }
        assert_eq!(envelope.bounds(1.0, 0.0), (1.0, 1.0));
    }
}
