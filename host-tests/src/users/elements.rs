//! What a signal passes on its way through the stage, each exact for an input that is constant over a step.

use std::collections::VecDeque;
use std::f64::consts::TAU;

/// The moment a sample passes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct At {
    /// Seconds since the stage was switched on.
    pub(crate) t_s: f64,
    /// Length of the step, seconds.
    pub(crate) dt_s: f64,
    /// Voltage commanded.
    pub(crate) command_v: f64,
    /// Voltage of the other axis.
    pub(crate) other_v: f64,
    /// Degrees above the first record's start.
    pub(crate) warmer_k: f64,
    /// Records taken before this one.
    pub(crate) record: usize,
}

/// An element of the chain. Voltages are volts, positions and lengths micrometres.
#[derive(Debug, Clone)]
pub(crate) enum Element {
    /// Later by a time.
    Delay { delay_s: f64, past: VecDeque<[f64; 2]> },
    /// A first-order lag whose time constant changes by a share over a span of its input.
    Lag { tau_s: f64, lean: [f64; 2], state: f64 },
    /// A rate limit, up and down, per second.
    Slew { up: f64, down: f64, state: f64 },
    /// A hard limit above.
    Clip { high: f64 },
    /// A spring stop: above a level only a share passes, over a smooth knee.
    SoftStop { level: f64, passes: f64, knee: f64 },
    /// Follows a power of time: relaxations spaced evenly over the decades, with their shares.
    PowerCreep {
        taus_s: Vec<f64>,
        shares: Vec<f64>,
        states: Vec<f64>,
    },
    /// A share of what is above the reversible part follows by relaxation.
    Mode {
        frequency_hz: f64,
        zeta: f64,
        share: f64,
        state: [f64; 2],
        last: f64,
    },
    /// Lost motion.
    Backlash { width: f64, state: f64 },
    /// The other axis through a second-order path, displacement per volt.
    Coupling {
        per_v: f64,
        frequency_hz: f64,
        zeta: f64,
        state: [f64; 2],
    },
    /// Position per kelvin, behind the stage's own time constant.
    ThermalShift { per_k: f64, tau_s: f64, state: f64 },
    /// Gain per kelvin about a fixed point.
    ThermalGain { per_k: f64 },
    /// A bend of the sensor over its range: kind, size, range low and high.
    Bend { kind: Bend, size: f64, range: [f64; 2] },
    /// Mains: frequency, amplitudes of harmonics, phases.
    Hum { mains_hz: f64, harmonics: Vec<[f64; 3]> },
    /// Outside the catalogue: gain that ripples with position.
    Ripple { size: f64, pitch: f64, phase: f64 },
    /// Outside the catalogue: a jump at a moment, back never.
    Slip { at_s: f64, by: f64 },
    /// Outside the catalogue: gain that falls from record to record.
    Ageing { per_record: f64 },
    /// Outside the catalogue: a line far above the sample rate, aliased.
    Pwm { hz: f64, size: f64 },
    /// Outside the catalogue: the command couples electrically into the sensor, by its rate.
    Feedthrough { seconds: f64, per_v: f64, last: f64 },
}

/// The form of a sensor's bend, each at most 1 over a range of -1 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bend {
    /// A parabola.
    Quadratic,
    /// An S.
    Cubic,
    /// A whole period of a sine.
    Sine,
    /// Two straight pieces, the corner a third of the range from below.
    Corner,
    /// Flattens towards the top.
    Flattening,
}

impl Bend {
    /// All of them.
    pub(crate) const ALL: [Self; 5] = [Self::Quadratic, Self::Cubic, Self::Sine, Self::Corner, Self::Flattening];

    fn at(self, x: f64) -> f64 {
        match self {
            Self::Quadratic => x * x,
            Self::Cubic => 2.6 * (x.powi(3) - x),
            Self::Sine => (std::f64::consts::PI * x).sin(),
            Self::Corner => (-0.33 - x).max(0.0) / 0.67,
            Self::Flattening => -(3.0 * (x - 1.0)).exp(),
        }
    }
}

impl Element {
    /// What comes out for the next input.
    pub(crate) fn step(&mut self, x: f64, at: &At) -> f64 {
        let dt = at.dt_s;
        match self {
            Self::Delay { delay_s, past } => delayed(past, *delay_s, x, at.t_s),
            Self::Lag { tau_s, lean, state } => {
                let tau = *tau_s * (1.0 + lean[0] * x / lean[1]);
                *state += (x - *state) * -(-dt / tau).exp_m1();
                *state
            }
            Self::Slew { up, down, state } => {
                *state += (x - *state).clamp(-*down * dt, *up * dt);
                *state
            }
            Self::Clip { high } => x.min(*high),
            Self::SoftStop { level, passes, knee } => {
                let over = (x - *level) / *knee;
                // ln(1 + e^x), without overflow.
                let soft = over.max(0.0) + (-over.abs()).exp().ln_1p();
                x - (1.0 - *passes) * *knee * soft
            }
            Self::PowerCreep { taus_s, shares, states } => {
                let mut sum = x;
                for (state, (tau, share)) in states.iter_mut().zip(taus_s.iter().zip(shares.iter())) {
                    *state += (x - *state) * -(-dt / tau).exp_m1();
                    sum += share * *state;
                }
                sum
            }
            Self::Mode {
                frequency_hz,
                zeta,
                share,
                state,
                last,
            } => {
                let moved = second_order(state, TAU * *frequency_hz, *zeta, 0.5 * (x + *last), dt);
                *last = x;
                (1.0 - *share) * x + *share * moved
            }
            Self::Backlash { width, state } => {
                *state = state.max(x - 0.5 * *width).min(x + 0.5 * *width);
                *state
            }
            Self::Coupling {
                per_v,
                frequency_hz,
                zeta,
                state,
            } => x + *per_v * second_order(state, TAU * *frequency_hz, *zeta, at.other_v, dt),
            Self::ThermalShift { per_k, tau_s, state } => {
                *state += (at.warmer_k - *state) * -(-dt / *tau_s).exp_m1();
                x + *per_k * *state
            }
            Self::ThermalGain { per_k } => x * (1.0 + *per_k * at.warmer_k),
            Self::Bend { kind, size, range } => {
                let middle = 0.5 * (range[0] + range[1]);
                x + *size * kind.at((x - middle) / (range[1] - middle))
            }
            Self::Hum { mains_hz, harmonics } => {
                let line = |[k, size, phase]: &[f64; 3]| size * (TAU * *mains_hz * k * at.t_s + phase).sin();
                x + harmonics.iter().map(line).sum::<f64>()
            }
            Self::Ripple { size, pitch, phase } => x + *size * (TAU * x / *pitch + *phase).sin(),
            Self::Slip { at_s, by } => x + if at.t_s > *at_s { *by } else { 0.0 },
            Self::Ageing { per_record } => x * (1.0 - *per_record * at.record as f64),
            Self::Pwm { hz, size } => x + *size * (TAU * *hz * at.t_s).sin(),
            Self::Feedthrough { seconds, per_v, last } => {
                let rate = if dt > 0.0 { (at.command_v - *last) / dt } else { 0.0 };
                *last = at.command_v;
                x + *per_v * *seconds * rate
            }
        }
    }

    /// Rests at an input, as if for long; what comes out.
    pub(crate) fn rest(&mut self, x: f64, at: &At) -> f64 {
        match self {
            Self::Delay { past, .. } => past.clear(),
            Self::Lag { state, .. } | Self::Slew { state, .. } => *state = x,
            Self::PowerCreep { states, .. } => states.iter_mut().for_each(|state| *state = x),
            Self::Mode { state, last, .. } => {
                *state = [x, 0.0];
                *last = x;
            }
            Self::Coupling { state, .. } => *state = [at.other_v, 0.0],
            Self::Feedthrough { last, .. } => *last = at.command_v,
            _ => {}
        }
        let still = At { dt_s: 0.0, ..*at };
        self.step(x, &still)
    }
}

/// The input a time ago, straight between the samples that are known.
fn delayed(past: &mut VecDeque<[f64; 2]>, delay_s: f64, x: f64, t_s: f64) -> f64 {
    past.push_back([t_s, x]);
    let wanted = t_s - delay_s;
    while past.len() > 2 && past[1][0] <= wanted {
        past.pop_front();
    }
    match (past.front(), past.get(1)) {
        (Some([t0, x0]), Some([t1, x1])) if wanted > *t0 && t1 > t0 => x0 + (x1 - x0) * (wanted - t0) / (t1 - t0),
        (Some([_, x0]), _) => *x0,
        _ => x,
    }
}

/// Deflection of an oscillator of unit gain after a step of a constant input.
fn second_order(state: &mut [f64; 2], omega: f64, zeta: f64, input: f64, dt: f64) -> f64 {
    let damped = omega * (1.0 - zeta * zeta).sqrt();
    let decay = (-zeta * omega * dt).exp();
    let (sin, cos) = (damped * dt).sin_cos();
    let (away, speed) = (state[0] - input, state[1]);
    let slope = (speed + zeta * omega * away) / damped;
    let deflection = decay * (away * cos + slope * sin);
    let speed = decay * (speed * cos - (omega * omega * away + zeta * omega * speed) / damped * sin);
    *state = [input + deflection, speed];
    state[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(t_s: f64, dt_s: f64) -> At {
        At {
            t_s,
            dt_s,
            command_v: 0.0,
            other_v: 0.0,
            warmer_k: 0.0,
            record: 0,
        }
    }

    /// An oscillator's step response in closed form, in steps of any length.
    #[test]
    fn val_the_oscillator_is_exact() {
        let (f, zeta, input) = (700.0, 0.03, 2.0);
        let mut state = [0.0, 0.0];
        for _ in 0..50 {
            second_order(&mut state, TAU * f, zeta, input, 2e-4);
        }
        let (w, t) = (TAU * f, 1e-2);
        let damped = w * (1.0_f64 - zeta * zeta).sqrt();
        let expected =
            input * (1.0 - (-zeta * w * t).exp() * ((damped * t).cos() + zeta * w / damped * (damped * t).sin()));
        assert!((state[0] - expected).abs() < 1e-9, "{} {expected}", state[0]);
    }

    /// A delay of three and a half steps of a ramp.
    #[test]
    fn val_the_delay_interpolates() {
        let mut delay = Element::Delay {
            delay_s: 3.5e-5,
            past: VecDeque::new(),
        };
        let out: Vec<f64> = (0..20)
            .map(|k| delay.step(f64::from(k), &at(f64::from(k) * 1e-5, 1e-5)))
            .collect();
        assert_eq!(out[0], 0.0);
        assert!((out[19] - 15.5).abs() < 1e-9, "{out:?}");
    }

    /// A bend moves the reading by its size at most, about.
    #[test]
    fn prop_bends_are_of_their_size() {
        for kind in Bend::ALL {
            let largest = (-100..=100)
                .map(|k| kind.at(f64::from(k) / 100.0).abs())
                .fold(0.0, f64::max);
            assert!((0.9..1.1).contains(&largest), "{kind:?} {largest}");
        }
    }
}
