//! Preisach plane with a density that changes along the diagonal: asymmetric loops, minor loops that depend on the bias.

use rand::RngExt;

use super::memory::{Branches, Memory};
use crate::error::{StageError, within};

/// One part of the Preisach density: exponential across the plane, modulated along it.
#[derive(Debug, Clone, PartialEq)]
pub struct DensityTerm {
    /// Share of this part, any positive number; the sum is normalised.
    pub share: f64,
    /// Mean half width of its relays (threshold of its plays), volts.
    pub threshold_v: f64,
    /// Depth of the modulation with the bias, 0 (congruent minor loops) to below 1.
    pub depth: f64,
    /// Phase of the modulation at 0 V, rad.
    pub phase_rad: f64,
}

/// A Preisach operator whose Everett function is known in closed form.
///
/// With r the half width and s the centre of a relay, the density is
/// `mu(r, s) = sum_k c_k / rho_k exp(-r / rho_k) [1 + eps_k cos(kappa s + phi_k)]`, positive for eps < 1. As a superposition of plays
/// F_r it reads `y = sum_k int c_k / rho_k exp(-r / rho_k) S_k(F_r[v]) dr`, `S_k(s) = s + eps_k / kappa sin(kappa s + phi_k)`: a continuum
/// of plays, each with its own nonlinear output. With all `eps_k = 0` it is a Prandtl-Ishlinskii operator.
///
/// # Units
/// Volts in; the output is scaled to the stroke by [`super::Hysteresis`].
///
/// # Cost
/// One Everett evaluation: one sine-cosine pair and one exponential a part.
///
/// # Reference
/// Mayergoyz (1991) for the operator; Krejci (1996) for the form as an integral of functions of plays.
#[derive(Debug, Clone, PartialEq)]
pub struct Preisach {
    /// Loop opening of the reference cycle, 0 V to `reference_v` (see [`crate::opening::loop_opening`]), a fraction.
    pub loop_opening: f64,
    /// Bias distance after which the modulation repeats, volts.
    pub modulation_period_v: f64,
    /// The density's parts.
    pub terms: Vec<DensityTerm>,
}

impl Preisach {
    /// Draws a density for inputs from 0 V to `range_v`.
    ///
    /// # Range
    /// Loop opening 0.10 to 0.20; 3 parts with thresholds log-uniform in 1-4, 4-15 and 15-60 % of the range, shares 0.5 to 1.5;
    /// depth 0.10 to 0.45 with one phase for all parts within +-0.7 rad; modulation period 0.9 to 2.5 ranges. Equal minor loops at 10 and 90 % bias
    /// then differ in height by up to some 40 %.
    pub fn random(rng: &mut impl RngExt, range_v: f64) -> Self {
        let common_rad = rng.random_range(0.0..std::f64::consts::TAU);
        let terms = [(0.01_f64, 0.04_f64), (0.04, 0.15), (0.15, 0.60)]
            .into_iter()
            .map(|(low, high)| DensityTerm {
                share: rng.random_range(0.5..1.5),
                threshold_v: range_v * rng.random_range(low.ln()..high.ln()).exp(),
                depth: rng.random_range(0.10..0.45),
                phase_rad: common_rad + rng.random_range(-0.7..0.7),
            })
            .collect();
        Self {
            loop_opening: rng.random_range(0.10..0.20),
            modulation_period_v: range_v * rng.random_range(0.9..2.5),
            terms,
        }
    }

    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "hysteresis.preisach.modulation_period_v",
            self.modulation_period_v,
            1e-3,
            1e6,
            "a typical period is 1 to 3 full voltages",
        )?;
        if self.terms.is_empty() {
            return Err(StageError::Length {
                name: "hysteresis.preisach.terms".to_owned(),
                found: 0,
                wanted: "1 or more".to_owned(),
                advice: "use Family::Linear for a stage without hysteresis",
            });
        }
        for (k, term) in self.terms.iter().enumerate() {
            let name = |field: &str| format!("hysteresis.preisach.terms[{k}].{field}");
            within(&name("share"), term.share, 1e-9, 1e9, "shares are positive")?;
            within(
                &name("threshold_v"),
                term.threshold_v,
                1e-4,
                1e5,
                "thresholds of piezo stacks are 1 to 60 % of the full voltage",
            )?;
            within(
                &name("depth"),
                term.depth,
                0.0,
                0.99,
                "a density is positive only for a depth below 1",
            )?;
            within(&name("phase_rad"), term.phase_rad, -1e3, 1e3, "give the phase in rad")?;
        }
        Ok(())
    }
}

/// One part, with everything that does not depend on the input worked out.
#[derive(Debug, Clone)]
struct Part {
    share: f64,
    threshold_v: f64,
    /// `c eps / kappa` and its phase factor.
    swing: f64,
    phase: (f64, f64),
    /// `1 / (1 + i kappa rho)`.
    filter: (f64, f64),
}

/// The density ready for evaluation.
#[derive(Debug, Clone)]
pub(crate) struct Density {
    per_volt_rad: f64,
    parts: Vec<Part>,
}

impl Density {
    fn new(config: &Preisach) -> Self {
        let per_volt_rad = std::f64::consts::TAU / config.modulation_period_v;
        let total: f64 = config.terms.iter().map(|term| term.share).sum();
        let parts = config
            .terms
            .iter()
            .map(|term| {
                let turn = per_volt_rad * term.threshold_v;
                let norm = 1.0 + turn * turn;
                let share = term.share / total;
                Part {
                    share,
                    threshold_v: term.threshold_v,
                    swing: share * term.depth / per_volt_rad,
                    phase: (term.phase_rad.cos(), term.phase_rad.sin()),
                    filter: (1.0 / norm, -turn / norm),
                }
            })
            .collect();
        Self { per_volt_rad, parts }
    }
}

/// An input and the half-angle factor `e^{i kappa v / 2}`: products of two give the factors at both ends of a branch and in its middle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Phasor {
    input_v: f64,
    half: (f64, f64),
}

impl Default for Phasor {
    fn default() -> Self {
        Self {
            input_v: 0.0,
            half: (1.0, 0.0),
        }
    }
}

#[inline]
fn product(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

impl Branches for Density {
    type Point = Phasor;

    #[inline]
    fn point(&self, input_v: f64) -> Phasor {
        let (sin, cos) = (0.5 * self.per_volt_rad * input_v).sin_cos();
        Phasor {
            input_v,
            half: (cos, sin),
        }
    }

    /// `E(a, b) = int_0^R p(r) [S(a - r) - S(b + r)] dr`, R = (a - b) / 2: for each part, with `q = exp(-R / rho)`, `m = (a + b) / 2`,
    /// `2 c [R - rho (1 - q)] + c eps / kappa Im { e^{i phi} [ (e^{i kappa a} - q e^{i kappa m}) / (1 + i kappa rho)
    /// - (e^{i kappa b} - q e^{i kappa m}) / (1 - i kappa rho) ] }`.
    #[inline]
    fn between(&self, low: &Phasor, high: &Phasor) -> f64 {
        let radius_v = 0.5 * (high.input_v - low.input_v);
        let (high_cos, high_sin) = product(high.half, high.half);
        let (low_cos, low_sin) = product(low.half, low.half);
        let (mid_cos, mid_sin) = product(low.half, high.half);
        let mut rise = 0.0;
        for part in &self.parts {
            let left = (-radius_v / part.threshold_v).exp();
            rise += 2.0 * part.share * (radius_v - part.threshold_v * (1.0 - left));
            let (high_re, high_im) = (high_cos - left * mid_cos, high_sin - left * mid_sin);
            let (low_re, low_im) = (low_cos - left * mid_cos, low_sin - left * mid_sin);
            let (re, im) = part.filter;
            let sum_re = (high_re - low_re) * re - (high_im + low_im) * im;
            let sum_im = (high_im - low_im) * re + (high_re + low_re) * im;
            rise += part.swing * (part.phase.0 * sum_im + part.phase.1 * sum_re);
        }
        rise
    }

    /// `int_0^|v| p(r) [S(v -+ r) - S(0)] dr`, the plays inside |v| having left their rest at 0.
    fn virgin(&self, input: &Phasor) -> f64 {
        let radius_v = input.input_v.abs();
        let (cos, sin) = product(input.half, input.half);
        let mut output = 0.0;
        for part in &self.parts {
            let left = (-radius_v / part.threshold_v).exp();
            output += part.share * (radius_v - part.threshold_v * (1.0 - left)) * input.input_v.signum();
            let (re, im) = if input.input_v < 0.0 {
                (part.filter.0, -part.filter.1)
            } else {
                part.filter
            };
            let moved = product((cos - left, sin), (re, im));
            // Im(e^{i phi} moved), minus S(0) (1 - q).
            output += part.swing * (part.phase.0 * moved.1 + part.phase.1 * (moved.0 - (1.0 - left)));
        }
        output
    }
}

/// The operator in motion.
#[derive(Debug, Clone)]
pub(crate) struct PreisachState {
    density: Density,
    memory: Memory<Phasor>,
}

impl PreisachState {
    pub(crate) fn new(config: &Preisach) -> Self {
        Self {
            density: Density::new(config),
            memory: Memory::default(),
        }
    }

    #[inline]
    pub(crate) fn advance(&mut self, input_v: f64) -> f64 {
        self.memory.advance(&self.density, input_v)
    }
}
