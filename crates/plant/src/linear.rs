//! Linear blocks, discretised exactly for an input that runs in a straight line over each step.
//!
//! A straight line between the step's two ends contains the zero-order hold (both ends equal) as a special case, so one
//! formula serves the staircase of a converter and the smooth signals inside the stage, without the half step of delay
//! that holding the old value inside the stage would add.

/// A unit-gain first-order lag `tau x' = u - x`.
///
/// `x(h) = e x(0) + (1 - e) u(0) + (1 - (1 - e) tau / h) (u(h) - u(0))`, `e = exp(-h / tau)`.
///
/// # Cost
/// 3 multiplications a step.
#[derive(Debug, Clone)]
pub(crate) struct Lag {
    time_constant_s: f64,
    decay: f64,
    start: f64,
    slope: f64,
    /// The lagged signal at the end of the last step.
    pub(crate) output: f64,
}

impl Lag {
    pub(crate) fn new(time_constant_s: f64) -> Self {
        Self {
            time_constant_s,
            decay: 1.0,
            start: 0.0,
            slope: 0.0,
            output: 0.0,
        }
    }

    /// Recomputes the coefficients for steps of `step_s`.
    pub(crate) fn set_step(&mut self, step_s: f64) {
        let z = step_s / self.time_constant_s;
        self.start = -(-z).exp_m1();
        self.decay = 1.0 - self.start;
        // 1 - (1 - exp(-z)) / z loses all its digits for small z; four terms of its series are then exact to 1e-14.
        self.slope = if z < 1e-3 {
            z * (0.5 - z * (1.0 / 6.0 - z * (1.0 / 24.0 - z / 120.0)))
        } else {
            1.0 - self.start / z
        };
    }

    /// Another time constant from here on.
    pub(crate) fn set_time_constant(&mut self, time_constant_s: f64, step_s: f64) {
        self.time_constant_s = time_constant_s;
        self.set_step(step_s);
    }

    /// One step, the input running from `from` to `to`.
    #[inline]
    pub(crate) fn advance(&mut self, from: f64, to: f64) -> f64 {
        self.output = self.decay * self.output + self.start * from + self.slope * (to - from);
        self.output
    }
}

/// A unit-gain second-order mode `x'' + 2 zeta w x' + w^2 x = w^2 u`, zeta < 1.
///
/// About the steady ramp `x = u - 2 zeta s / w`, `x' = s` (s the input's slope) the motion is free, and the free motion over
/// one step is a fixed matrix: exact for any step, however long.
///
/// # Cost
/// 6 multiplications and a division by a constant a step.
#[derive(Debug, Clone)]
pub(crate) struct Oscillator {
    omega_rad_per_s: f64,
    damping: f64,
    per_step: f64,
    free: [[f64; 2]; 2],
    /// Position at the end of the last step.
    pub(crate) output: f64,
    rate: f64,
}

impl Oscillator {
    pub(crate) fn new(frequency_hz: f64, damping: f64) -> Self {
        let omega_rad_per_s = std::f64::consts::TAU * frequency_hz;
        Self {
            omega_rad_per_s,
            damping,
            per_step: 0.0,
            free: [[1.0, 0.0], [0.0, 1.0]],
            output: 0.0,
            rate: 0.0,
        }
    }

    /// Recomputes the free motion over `step_s`.
    pub(crate) fn set_step(&mut self, step_s: f64) {
        let (omega, zeta) = (self.omega_rad_per_s, self.damping);
        let damped = omega * (1.0 - zeta * zeta).sqrt();
        let (sin, cos) = (damped * step_s).sin_cos();
        let decay = (-zeta * omega * step_s).exp();
        let mixed = zeta * omega / damped * sin;
        self.free = [
            [decay * (cos + mixed), decay * sin / damped],
            [-decay * omega * omega / damped * sin, decay * (cos - mixed)],
        ];
        self.per_step = 1.0 / step_s;
    }

    /// One step, the input running from `from` to `to`.
    #[inline]
    pub(crate) fn advance(&mut self, from: f64, to: f64) -> f64 {
        let slope = (to - from) * self.per_step;
        let behind = 2.0 * self.damping * slope / self.omega_rad_per_s;
        let offset = self.output - (from - behind);
        let offset_rate = self.rate - slope;
        self.output = to - behind + self.free[0][0] * offset + self.free[0][1] * offset_rate;
        self.rate = slope + self.free[1][0] * offset + self.free[1][1] * offset_rate;
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::{Lag, Oscillator};

    /// Exact for a hold, so the step length does not matter: rounding only.
    #[test]
    fn val_lag_step_response_is_one_minus_exp() {
        for step_s in [1e-6, 2e-5, 1e-3, 0.5] {
            let mut lag = Lag::new(1e-4);
            lag.set_step(step_s);
            for n in 1..=20 {
                let y = lag.advance(1.0, 1.0);
                let exact = 1.0 - (-(f64::from(n) * step_s) / 1e-4).exp();
                assert!((y - exact).abs() < 1e-12, "{step_s} {n}: {y} {exact}");
            }
        }
    }

    /// Ramp response u - tau (1 - exp(-t / tau)), for steps on both sides of the series switch at h / tau = 1e-3.
    #[test]
    fn val_lag_ramp_response() {
        for step_s in [0.9e-3, 1.1e-3, 0.3] {
            let mut lag = Lag::new(1.0);
            lag.set_step(step_s);
            let mut y = 0.0;
            for n in 0..50 {
                y = lag.advance(f64::from(n) * step_s, f64::from(n + 1) * step_s);
            }
            let t = 50.0 * step_s;
            assert!((y - (t - 1.0 + (-t).exp())).abs() < 1e-12, "{step_s}");
        }
    }

    /// `1 - exp(-zeta w t) (cos wd t + zeta / sqrt(1 - zeta^2) sin wd t)`, whatever the step.
    #[test]
    fn val_oscillator_step_response() {
        let (frequency_hz, zeta) = (739.0, 0.02);
        let omega = std::f64::consts::TAU * frequency_hz;
        let damped = omega * f64::sqrt(1.0 - zeta * zeta);
        for step_s in [5e-6, 2e-5, 1e-3] {
            let mut mode = Oscillator::new(frequency_hz, zeta);
            mode.set_step(step_s);
            for n in 1..=200 {
                let y = mode.advance(1.0, 1.0);
                let t = f64::from(n) * step_s;
                let exact = 1.0
                    - (-zeta * omega * t).exp()
                        * ((damped * t).cos() + zeta / (1.0 - zeta * zeta).sqrt() * (damped * t).sin());
                assert!((y - exact).abs() < 1e-10, "{step_s} {n}: {y} {exact}");
            }
        }
    }
}
