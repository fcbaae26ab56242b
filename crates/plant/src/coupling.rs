//! The other axis: its own stack and structure, a little of whose motion reaches this one.

use crate::error::{StageError, within};
use crate::hysteresis::{Drive, Hysteresis, HysteresisState};
use crate::linear::Lag;
use crate::structure::{Mode, StructureState};

/// Cross-coupling: `ratio` times the motion of the other axis is added to the position.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossCoupling {
    /// Share of the other axis' motion, signed; 0.001 to 0.03 in practice.
    pub ratio: f64,
    /// Time constant of the other axis' amplifier, seconds (0 for none).
    pub lag_s: f64,
    /// The other axis' stack.
    pub hysteresis: Hysteresis,
    /// The other axis' mode.
    pub mode: Option<Mode>,
}

impl CrossCoupling {
    pub(crate) fn validate(&self) -> Result<(), StageError> {
        within(
            "cross_coupling.ratio",
            self.ratio,
            -1.0,
            1.0,
            "stages couple by 0.001 to 0.03",
        )?;
        within(
            "cross_coupling.lag_s",
            self.lag_s,
            0.0,
            1.0,
            "amplifiers lag by 10 to 500 us",
        )?;
        self.hysteresis.validate()?;
        self.mode.map_or(Ok(()), |mode| mode.validate("cross_coupling.mode"))
    }
}

/// The other axis in motion.
#[derive(Debug, Clone)]
pub(crate) struct CouplingState {
    ratio: f64,
    lag: Option<Lag>,
    hysteresis: HysteresisState,
    structure: StructureState,
    stack_um: f64,
}

impl CouplingState {
    pub(crate) fn new(config: &CrossCoupling) -> Result<Self, StageError> {
        config.validate()?;
        Ok(Self {
            ratio: config.ratio,
            lag: (config.lag_s > 0.0).then(|| Lag::new(config.lag_s)),
            hysteresis: HysteresisState::new(&config.hysteresis)?,
            structure: StructureState::new(config.mode.as_slice()),
            stack_um: 0.0,
        })
    }

    pub(crate) fn set_step(&mut self, step_s: f64) {
        if let Some(lag) = &mut self.lag {
            lag.set_step(step_s);
        }
        self.structure.set_step(step_s);
    }

    /// One step of the other axis' voltage; gives what it adds to this axis.
    #[inline]
    pub(crate) fn advance(&mut self, from_v: f64, to_v: f64) -> f64 {
        let from_um = match &self.lag {
            Some(_) => self.stack_um,
            None => self.hysteresis.advance(&Drive::quasi_static(from_v)),
        };
        let at_v = match &mut self.lag {
            Some(lag) => lag.advance(from_v, to_v),
            None => to_v,
        };
        self.stack_um = self.hysteresis.advance(&Drive::quasi_static(at_v));
        self.ratio * self.structure.advance(from_um, self.stack_um)
    }
}
