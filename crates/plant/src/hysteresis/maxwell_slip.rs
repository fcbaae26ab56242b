//! Maxwell slip: a spring and Coulomb slider in parallel with many others.

use rand::RngExt;

use super::between;
use crate::error::{StageError, within};

/// A sum of elastoplastic elements: `y = sum_i k_i (v - z_i)`, each z_i following the voltage until it slips at +-r_i.
///
/// # Cost
/// One addition and two comparisons an element.
///
/// # Reference
/// Goldfarb and Celanovic, J. Dyn. Syst. Meas. Control 119 (1997) 478: generalised Maxwell slip for piezo stacks.
#[derive(Debug, Clone, PartialEq)]
pub struct MaxwellSlip {
    /// Loop opening of the reference cycle, a fraction.
    pub loop_opening: f64,
    /// Slip limits r_i, volts, any order.
    pub slip_v: Vec<f64>,
    /// Stiffness k_i of each element, any positive unit.
    pub stiffness: Vec<f64>,
}

impl MaxwellSlip {
    /// Draws 40 to 80 elements for inputs from 0 V to `range_v`.
    ///
    /// # Range
    /// Loop opening 0.10 to 0.20; slip limits log-spaced from 0.3 to 60 % of the range with 20 % jitter; stiffness per decade of slip limit
    /// as r^p, p = -0.3 to 0.3, each element by a factor 0.5 to 1.5.
    pub fn random(rng: &mut impl RngExt, range_v: f64) -> Self {
        let elements = rng.random_range(40..=80_usize);
        let power = rng.random_range(-0.3..0.3);
        let slip_v: Vec<f64> = (0..elements)
            .map(|i| {
                let place = i as f64 / (elements - 1) as f64;
                range_v * 0.003 * 200_f64.powf(place) * rng.random_range(0.8..1.2)
            })
            .collect();
        let stiffness = slip_v
            .iter()
            .map(|r| (r / range_v).powf(power) * rng.random_range(0.5..1.5))
            .collect();
        Self {
            loop_opening: rng.random_range(0.10..0.20),
            slip_v,
            stiffness,
        }
    }

    pub(crate) fn validate(&self) -> Result<(), StageError> {
        if self.slip_v.is_empty() || self.slip_v.len() != self.stiffness.len() {
            return Err(StageError::Length {
                name: "hysteresis.maxwell_slip.stiffness".to_owned(),
                found: self.stiffness.len(),
                wanted: format!("as many as slip_v ({}), at least 1", self.slip_v.len()),
                advice: "give one stiffness for each slip limit",
            });
        }
        for (i, (&slip_v, &stiffness)) in self.slip_v.iter().zip(&self.stiffness).enumerate() {
            within(
                &format!("hysteresis.maxwell_slip.slip_v[{i}]"),
                slip_v,
                1e-6,
                1e6,
                "slip limits are positive",
            )?;
            within(
                &format!("hysteresis.maxwell_slip.stiffness[{i}]"),
                stiffness,
                0.0,
                1e9,
                "stiffnesses are not negative",
            )?;
        }
        Ok(())
    }
}

/// The elements in motion.
#[derive(Debug, Clone)]
pub(crate) struct MaxwellSlipState {
    elements: Vec<Element>,
    total: f64,
    input_v: f64,
}

#[derive(Debug, Clone, Copy)]
struct Element {
    slip_v: f64,
    stiffness: f64,
    stretch_v: f64,
}

impl MaxwellSlipState {
    pub(crate) fn new(config: &MaxwellSlip) -> Self {
        let elements: Vec<Element> = config
            .slip_v
            .iter()
            .zip(&config.stiffness)
            .map(|(&slip_v, &stiffness)| Element {
                slip_v,
                stiffness,
                stretch_v: 0.0,
            })
            .collect();
        let total = elements.iter().map(|element| element.stiffness).sum();
        Self {
            elements,
            total,
            input_v: 0.0,
        }
    }

    #[inline]
    pub(crate) fn advance(&mut self, input_v: f64, threshold_scale: f64) -> f64 {
        let moved_v = input_v - self.input_v;
        self.input_v = input_v;
        let mut force = 0.0;
        for element in &mut self.elements {
            let limit_v = element.slip_v * threshold_scale;
            element.stretch_v = between(element.stretch_v + moved_v, -limit_v, limit_v);
            force += element.stiffness * element.stretch_v;
        }
        self.total * input_v - force
    }
}
