//! The moving structure: one or more lightly damped modes between the stack and the platform.

use crate::error::{StageError, within};
use crate::linear::Oscillator;

/// One mode, `share w^2 / (s^2 + 2 zeta w s + w^2)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// Natural frequency, hertz.
    pub frequency_hz: f64,
    /// Damping ratio zeta.
    pub damping: f64,
    /// Share of the static displacement. The shares of all modes are normalised to a sum of 1; neighbours with the same sign have an
    /// antiresonance between them, with opposite signs none.
    pub share: f64,
}

impl Mode {
    pub(crate) fn validate(&self, name: &str) -> Result<(), StageError> {
        within(
            &format!("{name}.frequency_hz"),
            self.frequency_hz,
            0.1,
            1e6,
            "stages have their first mode at 200 Hz to 20 kHz",
        )?;
        within(
            &format!("{name}.damping"),
            self.damping,
            0.0,
            0.99,
            "a mode is underdamped: flexures have 0.005 to 0.05",
        )?;
        within(
            &format!("{name}.share"),
            self.share,
            -10.0,
            10.0,
            "the first mode has about 1, later ones 0.02 to 0.2",
        )
    }
}

pub(crate) fn validate(modes: &[Mode]) -> Result<(), StageError> {
    for (i, mode) in modes.iter().enumerate() {
        mode.validate(&format!("modes[{i}]"))?;
    }
    if modes.is_empty() {
        return Ok(());
    }
    let sum = modes.iter().map(|mode| mode.share).sum();
    within(
        "sum of modes[..].share",
        sum,
        0.05,
        100.0,
        "the modes together must carry the static displacement",
    )
}

/// The modes in motion.
#[derive(Debug, Clone)]
pub(crate) struct StructureState {
    modes: Vec<(f64, Oscillator)>,
}

impl StructureState {
    pub(crate) fn new(modes: &[Mode]) -> Self {
        let sum: f64 = modes.iter().map(|mode| mode.share).sum();
        let modes = modes
            .iter()
            .map(|mode| (mode.share / sum, Oscillator::new(mode.frequency_hz, mode.damping)))
            .collect();
        Self { modes }
    }

    pub(crate) fn set_step(&mut self, step_s: f64) {
        self.modes.iter_mut().for_each(|(_, mode)| mode.set_step(step_s));
    }

    #[inline]
    pub(crate) fn advance(&mut self, from: f64, to: f64) -> f64 {
        if self.modes.is_empty() {
            return to;
        }
        self.modes
            .iter_mut()
            .map(|(share, mode)| *share * mode.advance(from, to))
            .sum()
    }
}
