//! Rate-independent hysteresis of the piezo stack: several families, one scaling to stroke and loop opening.

pub mod bouc_wen;
pub mod maxwell_slip;
mod memory;
pub mod mrpi;
pub mod preisach;
pub mod rayleigh;
pub mod sigmoid_plays;

pub use bouc_wen::BoucWen;
pub use maxwell_slip::MaxwellSlip;
pub use mrpi::Mrpi;
pub use preisach::{DensityTerm, Preisach};
pub use rayleigh::AmplitudeGain;
pub use sigmoid_plays::SigmoidPlays;

use crate::error::{StageError, within};

/// The hysteresis of the stage, scaled by one reference cycle.
///
/// The stack moves by `stroke_um` when the voltage cycles slowly from 0 V to `reference_v` and back, once the cycle repeats. Apart from
/// [`Family::Linear`] and [`Family::Mrpi`], `y = stroke [(1 - s) v / v_ref + s I[v] / I_pp]`: a reversible straight line and an irreversible operator I with
/// the peak-to-peak output `I_pp` in the reference cycle. The share s follows from the loop opening asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Hysteresis {
    /// Peak-to-peak displacement of the slow reference cycle, micrometres.
    pub stroke_um: f64,
    /// Upper end of the reference cycle, volts.
    pub reference_v: f64,
    /// What happened before time zero.
    pub initial: Initial,
    /// Which operator.
    pub family: Family,
}

/// State of the hysteresis memory at time zero. The displacement is zero in either case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Initial {
    /// Cycled to `reference_v` and back to 0 V: what a careful user does first.
    #[default]
    Conditioned,
    /// All operators at rest: the first loop follows the virgin curve and does not close.
    Virgin,
}

/// The family of hysteresis operators.
#[derive(Debug, Clone, PartialEq)]
pub enum Family {
    /// No hysteresis: displacement proportional to the voltage.
    Linear,
    /// A Preisach plane with a density that changes with the bias.
    Preisach(Preisach),
    /// Very many plays, each with a sigmoid output (a discrete Preisach operator).
    SigmoidPlays(SigmoidPlays),
    /// Forty and more elastoplastic elements.
    MaxwellSlip(MaxwellSlip),
    /// The Bouc-Wen equation; its minor loops neither close nor agree.
    BoucWen(BoucWen),
    /// The paper's own model, eqs 7-10.
    Mrpi(Mrpi),
    /// Two families side by side, each scaled to the same stroke.
    Mixed(Box<Mixed>),
}

/// Two operators that share the displacement: `y = (1 - s) H_1[v] + s H_2[v]`, each of the full stroke.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixed {
    /// H_1.
    pub first: Family,
    /// H_2.
    pub second: Family,
    /// s, from 0 to 1.
    pub share_of_second: f64,
}

impl Hysteresis {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "hysteresis.stroke_um",
            self.stroke_um,
            1e-3,
            1e4,
            "piezo stages move 1 to 1000 um",
        )?;
        within(
            "hysteresis.reference_v",
            self.reference_v,
            1e-2,
            1e4,
            "give the voltage at which stroke_um is reached",
        )?;
        match &self.family {
            Family::Linear => Ok(()),
            Family::Preisach(family) => family.validate(),
            Family::SigmoidPlays(family) => family.validate(),
            Family::MaxwellSlip(family) => family.validate(),
            Family::BoucWen(family) => family.validate(),
            Family::Mrpi(family) => family.validate(),
            Family::Mixed(mixed) => {
                within(
                    "hysteresis.mixed.share_of_second",
                    mixed.share_of_second,
                    0.0,
                    1.0,
                    "give the second family's part of the displacement",
                )?;
                self.of(&mixed.first).validate()?;
                self.of(&mixed.second).validate()
            }
        }
    }

    /// The same stroke and start with another family.
    fn of(&self, family: &Family) -> Self {
        Self {
            family: family.clone(),
            ..self.clone()
        }
    }

    fn loop_opening(&self) -> Option<f64> {
        match &self.family {
            Family::Linear | Family::Mrpi(_) | Family::Mixed(_) => None,
            Family::Preisach(family) => Some(family.loop_opening),
            Family::SigmoidPlays(family) => Some(family.loop_opening),
            Family::MaxwellSlip(family) => Some(family.loop_opening),
            Family::BoucWen(family) => Some(family.loop_opening),
        }
    }
}

/// What moves the hysteresis over one step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drive {
    /// Voltage at the stack.
    pub(crate) voltage_v: f64,
    /// Voltage as the irreversible operator sees it (differs by rate dependence).
    pub(crate) irreversible_v: f64,
    /// Factor on the thresholds of play-like operators (rate dependence).
    pub(crate) threshold_scale: f64,
    /// Rate of the voltage, for the paper's model.
    pub(crate) rate_v_per_s: f64,
}

impl Drive {
    pub(crate) fn quasi_static(voltage_v: f64) -> Self {
        Self {
            voltage_v,
            irreversible_v: voltage_v,
            threshold_scale: 1.0,
            rate_v_per_s: 0.0,
        }
    }
}

#[derive(Debug, Clone)]
enum Operator {
    Linear,
    Preisach(preisach::PreisachState),
    SigmoidPlays(sigmoid_plays::SigmoidPlaysState),
    MaxwellSlip(maxwell_slip::MaxwellSlipState),
    BoucWen(bouc_wen::BoucWenState),
    Mrpi(mrpi::MrpiState),
}

impl Operator {
    fn new(config: &Hysteresis) -> Self {
        match &config.family {
            // Of a mixture each part is an operator of its own.
            Family::Linear | Family::Mixed(_) => Self::Linear,
            Family::Preisach(family) => Self::Preisach(preisach::PreisachState::new(family)),
            Family::SigmoidPlays(family) => Self::SigmoidPlays(sigmoid_plays::SigmoidPlaysState::new(family)),
            Family::MaxwellSlip(family) => Self::MaxwellSlip(maxwell_slip::MaxwellSlipState::new(family)),
            Family::BoucWen(family) => Self::BoucWen(bouc_wen::BoucWenState::new(family)),
            Family::Mrpi(family) => Self::Mrpi(mrpi::MrpiState::new(family, config.reference_v)),
        }
    }

    #[inline]
    fn advance(&mut self, drive: &Drive) -> f64 {
        match self {
            Self::Linear => drive.voltage_v,
            Self::Preisach(state) => state.advance(drive.irreversible_v),
            Self::SigmoidPlays(state) => state.advance(drive.irreversible_v, drive.threshold_scale),
            Self::MaxwellSlip(state) => state.advance(drive.irreversible_v, drive.threshold_scale),
            Self::BoucWen(state) => state.advance(drive.irreversible_v),
            Self::Mrpi(state) => state.advance(drive.voltage_v, drive.rate_v_per_s),
        }
    }
}

/// x, moved to the nearer end where it lies outside: compare and select, which keeps loops in vector registers.
#[inline]
fn between(x: f64, low: f64, high: f64) -> f64 {
    let x = if x < low { low } else { x };
    if x > high { high } else { x }
}

/// The slow reference cycle of an operator, in the operator's own unit.
struct ReferenceCycle {
    peak_to_peak: f64,
    width: f64,
}

fn reference_cycle(operator: &mut Operator, reference_v: f64) -> ReferenceCycle {
    let mut at = |part: f64| operator.advance(&Drive::quasi_static(part * reference_v));
    // Bouc-Wen approaches its limit cycle exponentially; every other family closes at the first return.
    for _ in 0..20 {
        at(1.0);
        at(0.0);
    }
    let bottom = at(0.0);
    let up = at(0.5);
    let top = at(1.0);
    let down = at(0.5);
    at(0.0);
    ReferenceCycle {
        peak_to_peak: top - bottom,
        width: down - up,
    }
}

/// The hysteresis in motion: voltage in, quasi-static displacement out.
#[derive(Debug, Clone)]
pub(crate) struct HysteresisState {
    operator: Operator,
    reversible_um_per_v: f64,
    irreversible_um: f64,
    rest: f64,
    /// The second operator of a mixture, and its share.
    beside: Option<(f64, Box<HysteresisState>)>,
}

impl HysteresisState {
    /// Scales the operator to stroke and loop opening and puts it in its initial state.
    pub(crate) fn new(config: &Hysteresis) -> Result<Self, StageError> {
        config.validate()?;
        if let Family::Mixed(mixed) = &config.family {
            let second = Self::new(&config.of(&mixed.second))?;
            return Ok(Self {
                beside: Some((mixed.share_of_second, Box::new(second))),
                ..Self::new(&config.of(&mixed.first))?
            });
        }
        let mut conditioned = Operator::new(config);
        let cycle = reference_cycle(&mut conditioned, config.reference_v);
        within(
            "hysteresis: output of the reference cycle",
            cycle.peak_to_peak,
            1e-12 * config.reference_v,
            1e12 * config.reference_v,
            "the family's weights must let the displacement rise with the voltage",
        )?;
        let share = match config.loop_opening() {
            None => 1.0,
            Some(opening) => {
                let widest = cycle.width / cycle.peak_to_peak;
                let name = "hysteresis.loop_opening (fraction)";
                within(
                    name,
                    opening,
                    0.0,
                    0.999 * widest,
                    "the family's thresholds allow no wider loop: spread them differently",
                )?;
                opening / widest
            }
        };
        let irreversible_um = config.stroke_um * share / cycle.peak_to_peak;
        let mut operator = match config.initial {
            Initial::Conditioned => conditioned,
            Initial::Virgin => Operator::new(config),
        };
        let rest = operator.advance(&Drive::quasi_static(0.0));
        Ok(Self {
            operator,
            reversible_um_per_v: config.stroke_um * (1.0 - share) / config.reference_v,
            irreversible_um,
            rest,
            beside: None,
        })
    }

    #[inline]
    pub(crate) fn advance(&mut self, drive: &Drive) -> f64 {
        let moved = self.operator.advance(drive) - self.rest;
        let first_um = self.reversible_um_per_v * drive.voltage_v + self.irreversible_um * moved;
        match &mut self.beside {
            Some((share, second)) => first_um + *share * (second.advance(drive) - first_um),
            None => first_um,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{BoucWen, Drive, Family, Hysteresis, HysteresisState, Initial, MaxwellSlip, Mixed};
    use rand::SeedableRng;

    /// A mixture moves by the weighted sum of its parts, sample by sample, and by the whole stroke over the reference cycle.
    #[test]
    fn val_mixture_is_the_weighted_sum() {
        let slip = MaxwellSlip::random(&mut rand_pcg::Pcg64::seed_from_u64(3), 100.0);
        let wen = BoucWen {
            loop_opening: 0.12,
            saturation_v: 13.0,
            exponent: 1.4,
            roundness: 0.65,
        };
        let of = |family: Family| Hysteresis {
            stroke_um: 10.0,
            reference_v: 100.0,
            initial: Initial::Conditioned,
            family,
        };
        let [first, second] = [Family::MaxwellSlip(slip), Family::BoucWen(wen)];
        let mixed = Family::Mixed(Box::new(Mixed {
            first: first.clone(),
            second: second.clone(),
            share_of_second: 0.3,
        }));
        let [mut a, mut b, mut both] = [first, second, mixed].map(|family| HysteresisState::new(&of(family)).unwrap());
        for v in [10.0, 90.0, 30.0, 70.0, 5.0, 100.0, 0.0] {
            let drive = Drive::quasi_static(v);
            let wanted = 0.7 * a.advance(&drive) + 0.3 * b.advance(&drive);
            assert!((both.advance(&drive) - wanted).abs() < 1e-12, "{v} V");
        }
    }
}
