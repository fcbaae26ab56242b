//! The high-voltage amplifier: rails, a finite output resistance, a finite current.

use crate::error::{StageError, ordered, within};
use crate::linear::Lag;

/// The amplifier that charges the stack.
#[derive(Debug, Clone, PartialEq)]
pub struct Amplifier {
    /// Volts at the stack for each volt of the converter; the paper's amplifier has 20.
    pub gain: f64,
    /// Lowest output, volts.
    pub min_v: f64,
    /// Highest output, volts.
    pub max_v: f64,
    /// Time constant of output resistance and stack capacitance, seconds (0 for none).
    pub lag_s: f64,
    /// Share by which the stack's capacitance, and with it the lag, grows in a volt above 0 V.
    pub lag_growth_per_v: f64,
    /// Current limit, if it is to be reached.
    pub current_limit: Option<CurrentLimit>,
}

/// A current limit into a capacitance: `-I_sink / C <= dv/dt <= I / C`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurrentLimit {
    /// Largest current, amperes.
    pub current_a: f64,
    /// Largest current that it takes back, amperes; as much as it gives where `None`.
    pub sink_a: Option<f64>,
    /// Capacitance of the stack, microfarads.
    pub capacitance_uf: f64,
}

impl CurrentLimit {
    /// The slew rate, volts per second.
    ///
    /// ```
    /// let limit = hysteron_plant::CurrentLimit { current_a: 0.1, sink_a: None, capacitance_uf: 1.8 };
    /// assert!((limit.slew_v_per_s() - 55_556.0).abs() < 1.0);
    /// ```
    pub fn slew_v_per_s(&self) -> f64 {
        self.slew_of(self.current_a)
    }

    fn slew_of(&self, current_a: f64) -> f64 {
        current_a / (1e-6 * self.capacitance_uf)
    }

    /// Largest rates upward and downward, volts per second.
    fn slews_v_per_s(&self) -> [f64; 2] {
        [self.current_a, self.sink_a.unwrap_or(self.current_a)].map(|current_a| self.slew_of(current_a))
    }
}

impl Default for Amplifier {
    /// The paper's: gain 20, 0 to 200 V, no lag, no current limit.
    fn default() -> Self {
        Self {
            gain: 20.0,
            min_v: 0.0,
            max_v: 200.0,
            lag_s: 0.0,
            lag_growth_per_v: 0.0,
            current_limit: None,
        }
    }
}

impl Amplifier {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "amplifier.gain",
            self.gain,
            1e-3,
            1e4,
            "high-voltage amplifiers have 10 to 100",
        )?;
        within(
            "amplifier.min_v",
            self.min_v,
            -1e4,
            0.0,
            "the stage rests at 0 V, so 0 V must be reachable",
        )?;
        within("amplifier.max_v", self.max_v, 0.0, 1e4, "stacks take 60 to 1000 V")?;
        ordered("amplifier.min_v", self.min_v, "amplifier.max_v", self.max_v)?;
        within(
            "amplifier.lag_s",
            self.lag_s,
            0.0,
            1.0,
            "output resistance times capacitance is 10 to 500 us",
        )?;
        within(
            "amplifier.lag_growth_per_v",
            self.lag_growth_per_v,
            0.0,
            1.0,
            "a stack has 0.3 to 0.6 times more capacitance at its highest voltage: 0.002 to 0.006 a volt for one of 100 to 150 V",
        )?;
        if let Some(limit) = &self.current_limit {
            for (name, current_a) in [
                ("amplifier.current_limit.current_a", Some(limit.current_a)),
                ("amplifier.current_limit.sink_a", limit.sink_a),
            ] {
                if let Some(current_a) = current_a {
                    within(name, current_a, 1e-6, 1e3, "amplifiers give 0.01 to 10 A")?;
                }
            }
            within(
                "amplifier.current_limit.capacitance_uf",
                limit.capacitance_uf,
                1e-4,
                1e4,
                "stacks have 0.01 to 10 uF",
            )?;
        }
        Ok(())
    }
}

/// The amplifier in motion.
#[derive(Debug, Clone)]
pub(crate) struct AmplifierState {
    min_v: f64,
    max_v: f64,
    lag: Option<Lag>,
    /// Of the lag at 0 V, shares a volt.
    growth_per_v: f64,
    lag_s: f64,
    step_s: f64,
    /// Largest rates upward and downward.
    slews_v_per_s: Option<[f64; 2]>,
    /// Largest changes in a step.
    most_v: [f64; 2],
    /// Voltage at the stack.
    pub(crate) output_v: f64,
}

impl AmplifierState {
    pub(crate) fn new(config: &Amplifier) -> Self {
        Self {
            min_v: config.min_v,
            max_v: config.max_v,
            lag: (config.lag_s > 0.0).then(|| Lag::new(config.lag_s)),
            growth_per_v: config.lag_growth_per_v,
            lag_s: config.lag_s,
            step_s: 0.0,
            slews_v_per_s: config.current_limit.map(|limit| limit.slews_v_per_s()),
            most_v: [f64::INFINITY; 2],
            output_v: 0.0,
        }
    }

    pub(crate) fn set_step(&mut self, step_s: f64) {
        if let Some(lag) = &mut self.lag {
            lag.set_step(step_s);
        }
        self.step_s = step_s;
        let slews_v_per_s = self.slews_v_per_s.unwrap_or([f64::INFINITY; 2]);
        self.most_v = slews_v_per_s.map(|slew| slew * step_s);
    }

    /// One step: the command's two ends in, the stack voltage's two ends out.
    #[inline]
    pub(crate) fn advance(&mut self, from_v: f64, to_v: f64) -> (f64, f64) {
        let from_v = from_v.clamp(self.min_v, self.max_v);
        let to_v = to_v.clamp(self.min_v, self.max_v);
        let before_v = self.output_v;
        let wanted_v = match &mut self.lag {
            Some(lag) => {
                if self.growth_per_v > 0.0 {
                    // The steps of a simulation are a small part of the lag.
                    lag.set_time_constant(self.lag_s * (1.0 + self.growth_per_v * before_v.max(0.0)), self.step_s);
                }
                lag.advance(from_v, to_v)
            }
            None => to_v,
        };
        if self.lag.is_none() && self.slews_v_per_s.is_none() {
            self.output_v = to_v;
            return (from_v, to_v);
        }
        let [up_v, down_v] = self.most_v;
        self.output_v = wanted_v.clamp(before_v - down_v, before_v + up_v);
        if let Some(lag) = &mut self.lag {
            lag.output = self.output_v;
        }
        (before_v, self.output_v)
    }
}
