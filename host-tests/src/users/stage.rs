//! The true stage: voltage, hysteresis, position, reading.

use super::elements::{At, Element};
use super::loops::Loops;

/// A stage with everything in it.
#[derive(Debug, Clone)]
pub(crate) struct Stage {
    /// Voltages that the loops span.
    pub(crate) range_v: [f64; 2],
    /// Displacement over them, micrometres.
    pub(crate) stroke_um: f64,
    /// The hysteresis.
    pub(crate) loops: Loops,
    /// Where the displacement is 0, micrometres on the sensor's scale.
    pub(crate) zero_um: f64,
    /// Before the hysteresis, on volts.
    pub(crate) before: Vec<Element>,
    /// Domains that relax: share of the irreversible displacement, time constants, states.
    pub(crate) relaxing: Option<Relaxing>,
    /// After the hysteresis, on micrometres of motion.
    pub(crate) after: Vec<Element>,
    /// In the sensor, on its reading.
    pub(crate) sensor: Vec<Element>,
}

/// Domains that switch with delays of several lengths.
#[derive(Debug, Clone)]
pub(crate) struct Relaxing {
    /// Share of the irreversible part that relaxes.
    pub(crate) share: f64,
    /// Time constants, seconds.
    pub(crate) taus_s: Vec<f64>,
    /// One state each.
    pub(crate) states: Vec<f64>,
}

/// What there is to see of a stage.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    /// Voltage behind the amplifier.
    pub(crate) amplifier_v: f64,
    /// The sensor's reading without noise, micrometres.
    pub(crate) reading_um: f64,
}

impl Stage {
    /// The next moment.
    pub(crate) fn step(&mut self, at: &At) -> Seen {
        self.pass(at, Element::step, false)
    }

    /// At rest at a voltage, its dynamics settled; the hysteresis goes there from where it is.
    pub(crate) fn rest(&mut self, at: &At) -> Seen {
        self.pass(at, Element::rest, true)
    }

    fn pass(&mut self, at: &At, through: fn(&mut Element, f64, &At) -> f64, rests: bool) -> Seen {
        let volts = self
            .before
            .iter_mut()
            .fold(at.command_v, |v, element| through(element, v, at));
        let [low, high] = self.range_v;
        let u = -1.0 + 2.0 * (volts - low) / (high - low);
        let at_once = if rests { self.loops.go(u) } else { self.loops.step(u) };
        let displacement = match &mut self.relaxing {
            Some(relaxing) => relaxing.pass(at_once, 0.5 * u * RELAXING_SLOPE, at.dt_s, rests),
            None => at_once,
        };
        let moved = self.stroke_um * displacement;
        let position = self.after.iter_mut().fold(moved, |y, element| through(element, y, at));
        let reading = self
            .sensor
            .iter_mut()
            .fold(position + self.zero_um, |y, element| through(element, y, at));
        Seen {
            amplifier_v: volts,
            reading_um: reading,
        }
    }
}

/// Share of the mean slope that domains follow at once.
const RELAXING_SLOPE: f64 = 0.6;

impl Relaxing {
    fn pass(&mut self, displacement: f64, reversible: f64, dt_s: f64, rests: bool) -> f64 {
        let target = displacement - reversible;
        let each = self.share / self.taus_s.len() as f64;
        let mut slow = 0.0;
        for (state, tau) in self.states.iter_mut().zip(&self.taus_s) {
            *state += (target - *state) * if rests { 1.0 } else { -(-dt_s / tau).exp_m1() };
            slow += each * *state;
        }
        reversible + (1.0 - self.share) * target + slow
    }
}
