//! The identified linear part, stepped in time: hold, latency, lag, modes, sensor's lag; modes and lags by their exact solutions between
//! substeps.

use super::feedback::mean_gain_um_per_v;
use hysteron_identify::control::{ControlModel, LinearPart, ModeOfStage};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Steps of the stage a sample.
const SUBSTEPS: usize = 10;

/// A stage without hysteresis, from rest.
#[derive(Debug, Clone)]
pub(crate) struct LinearStage {
    gain_um_per_v: f64,
    waiting_v: VecDeque<f64>,
    amplifier: f64,
    stack_v: f64,
    modes: Vec<Ringing>,
    disturbance_um: f64,
    sensor: f64,
    position_um: f64,
    read_um: f64,
}

impl LinearStage {
    /// The latency and the sensor's lag of a chain with this linear part, its mean gain times a factor.
    pub(crate) fn of(model: &ControlModel, linear: &LinearPart, gain: f64) -> Self {
        let (period_s, substep_s) = (model.sample_period_s, model.sample_period_s / SUBSTEPS as f64);
        let smoothed = |tau_s: f64| {
            if tau_s > 0.0 {
                -(-substep_s / tau_s).exp_m1()
            } else {
                1.0
            }
        };
        // Half a sample of the latency is the hold, which is stepped.
        let late = ((model.latency_s - 0.5 * period_s) / substep_s).ceil().max(0.0);
        Self {
            gain_um_per_v: gain * mean_gain_um_per_v(model),
            waiting_v: VecDeque::from(vec![0.0; late as usize]),
            amplifier: smoothed(linear.lag_s),
            stack_v: 0.0,
            modes: linear.modes.iter().map(|mode| Ringing::of(mode, substep_s)).collect(),
            disturbance_um: 0.0,
            sensor: smoothed(model.around.sensor_lag_s),
            position_um: 0.0,
            read_um: 0.0,
        }
    }

    /// The same under a step of the position, every mode displaced by as much.
    pub(crate) fn disturbed(mut self, disturbance_um: f64) -> Self {
        self.disturbance_um = disturbance_um;
        self.modes.iter_mut().for_each(|mode| mode.state[0] = disturbance_um);
        self
    }

    /// Gain at rest, micrometres per volt.
    pub(crate) fn gain_um_per_v(&self) -> f64 {
        self.gain_um_per_v
    }

    /// The mode that rings longest, its decay per second; none for a rigid stage.
    pub(crate) fn slowest_per_s(&self) -> Option<f64> {
        self.modes.iter().map(|mode| mode.decay).min_by(f64::total_cmp)
    }

    /// The position at the end of the last sample.
    pub(crate) fn position_um(&self) -> f64 {
        self.position_um
    }

    /// What the sensor reads.
    pub(crate) fn read_um(&self) -> f64 {
        self.read_um
    }

    /// Holds a command for a sample; what the sensor reads at its end.
    pub(crate) fn step(&mut self, command_v: f64) -> f64 {
        for _ in 0..SUBSTEPS {
            self.waiting_v.push_back(command_v);
            let arrived_v = self.waiting_v.pop_front().unwrap_or(command_v);
            self.stack_v += self.amplifier * (arrived_v - self.stack_v);
            let force_um = self.gain_um_per_v * self.stack_v;
            let moved_um = if self.modes.is_empty() {
                force_um
            } else {
                self.modes.iter_mut().map(|mode| mode.step(force_um)).sum()
            };
            self.position_um = moved_um + self.disturbance_um;
            self.read_um += self.sensor * (self.position_um - self.read_um);
        }
        self.read_um
    }
}

/// A mode under a force that stands still over a substep.
#[derive(Debug, Clone)]
struct Ringing {
    share: f64,
    /// Position and its rate.
    state: [f64; 2],
    damped: f64,
    decay: f64,
    square: f64,
    /// `e^(-z w dt)` times cosine and sine of the turn in a substep.
    turn: [f64; 2],
}

impl Ringing {
    fn of(mode: &ModeOfStage, substep_s: f64) -> Self {
        let omega = TAU * mode.frequency_hz;
        let decay = mode.damping * omega;
        // A mode that is damped more than critically does not ring.
        let damped = omega * (1.0 - mode.damping * mode.damping).max(1e-6).sqrt();
        let size = (-decay * substep_s).exp();
        Self {
            share: mode.share,
            state: [0.0; 2],
            damped,
            decay,
            square: omega * omega,
            turn: [size * (damped * substep_s).cos(), size * (damped * substep_s).sin()],
        }
    }

    fn step(&mut self, force: f64) -> f64 {
        let [x, rate] = self.state;
        let (from, [cos, sin]) = (x - force, self.turn);
        self.state = [
            force + cos * from + sin * (rate + self.decay * from) / self.damped,
            cos * rate - sin * (self.square * from + self.decay * rate) / self.damped,
        ];
        self.share * self.state[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `1 - e^(-z w t) (cos w_d t + z / sqrt(1 - z^2) sin w_d t)` after a step of the force.
    #[test]
    fn val_a_mode_rings_by_its_closed_form() {
        let (frequency_hz, damping) = (700.0, 0.05);
        let mode = ModeOfStage {
            frequency_hz,
            damping,
            share: 0.5,
        };
        let mut ringing = Ringing::of(&mode, 2e-6);
        let omega = TAU * frequency_hz;
        let rest = f64::sqrt(1.0 - damping * damping);
        for k in 1..=5000 {
            let found = ringing.step(1.0);
            let t = f64::from(k) * 2e-6;
            let phase = omega * rest * t;
            let wanted = 1.0 - (-damping * omega * t).exp() * (phase.cos() + damping / rest * phase.sin());
            assert!((found - 0.5 * wanted).abs() < 1e-9, "{t} s: {found}, {wanted}");
        }
    }
}
