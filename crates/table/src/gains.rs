//! The integral gain that a loop's latency and first mode allow.

use std::f64::consts::PI;

/// What the design has to know of the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopData {
    /// Largest gain of the stage, micrometres per volt: 1 over the smallest slope of the inverse.
    pub gain_um_per_v: f64,
    /// From command to reading, seconds: half a sample of hold, delays, lags.
    pub latency_s: f64,
    /// First mode, hertz, and its damping ratio; none for a rigid stage.
    pub mode: Option<[f64; 2]>,
}

/// A designed integral controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Design {
    /// K_i of eq. 14, volts per micrometre and second; K_p is 0.
    pub integral_v_per_um_s: f64,
    /// Where the loop's gain is 1, hertz.
    pub crossover_hz: f64,
    /// Phase margin there, degrees.
    pub phase_margin_deg: f64,
    /// Gain margin: at the mode where there is one, else where the phase is -180 degrees.
    pub gain_margin: f64,
}

/// Phase margin asked for, and gain margin: the middle of 30 to 60 degrees and the lower end of 2 to 5 that Åström and Hägglund
/// (Advanced PID Control, 2006, section 4.6) give; 60 degrees, since hysteresis takes up to asin(opening) of it, 27 at 45 %.
const PHASE_MARGIN_RAD: f64 = PI / 3.0;
const GAIN_MARGIN: f64 = 2.0;

/// Integral control `L(s) = w_c / s e^(-s T)`, with a mode times at most `1 / (2 zeta)`:
/// the largest `w_c` with `w_c T <= pi / 2 - pi / 3` and `w_c / w_n / (2 zeta) <= 1 / 2`, and `K_i = w_c / gain`.
///
/// There is no proportional part: in front of a lightly damped mode it raises the peak without raising the gain below it.
///
/// # Reference
/// The bound `w_c < 2 zeta w_n` of integral control: Fleming, Leang, Design, Modeling and Control of Nanopositioning Systems (2014).
pub fn design(data: &LoopData) -> Design {
    let by_latency = (0.5 * PI - PHASE_MARGIN_RAD) / data.latency_s;
    let by_mode = data
        .mode
        .map(|[frequency_hz, damping]| 2.0 * PI * frequency_hz * 2.0 * damping);
    let crossover = by_mode.map_or(by_latency, |limit| by_latency.min(limit / GAIN_MARGIN));
    Design {
        integral_v_per_um_s: crossover / data.gain_um_per_v,
        crossover_hz: crossover / (2.0 * PI),
        phase_margin_deg: (0.5 * PI - crossover * data.latency_s).to_degrees(),
        // Without a mode the phase is -180 degrees where w T = pi / 2, and the gain there w_c / w.
        gain_margin: by_mode
            .map_or(f64::INFINITY, |limit| limit / crossover)
            .min(0.5 * PI / data.latency_s / crossover),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed forms: latency of 100 us alone gives w_c = pi / 6 / 100 us; a mode of 1 kHz and 1 % gives w_c = 0.01 x 2 pi x 1 kHz.
    #[test]
    fn val_designs() {
        let rigid = design(&LoopData {
            gain_um_per_v: 0.1,
            latency_s: 1e-4,
            mode: None,
        });
        assert!((rigid.integral_v_per_um_s - PI / 6.0 * 1e5).abs() < 1e-6);
        assert!((rigid.phase_margin_deg - 60.0).abs() < 1e-9 && (rigid.gain_margin - 3.0).abs() < 1e-9);
        let soft = design(&LoopData {
            gain_um_per_v: 0.1,
            latency_s: 1e-4,
            mode: Some([1000.0, 0.01]),
        });
        assert!((soft.crossover_hz - 10.0).abs() < 1e-9 && (soft.gain_margin - 2.0).abs() < 1e-9);
    }
}
