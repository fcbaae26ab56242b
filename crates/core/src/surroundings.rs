//! The complete law among its surroundings: another axis, the mains, heat and the sensor's own character undone.

use crate::adaptation::{Adaptation, AdaptationState, Sample};
use crate::corner_polynomial::CornerPolynomial;
use crate::corners::CornerState;
use crate::effects::Block;
use crate::effects::admit;
use crate::effects::coupling::{Coupling, CouplingState};
use crate::effects::hum_canceller::{HumCanceller, HumCancellerState};
use crate::effects::lag::{Lag, LagState};
use crate::effects::sensor::SensorCurve;
use crate::effects::thermal::{Heat, HeatState};
use crate::either_inverse::{EitherInverse, EitherState};
use crate::error::{ParamError, in_range};
use crate::limiter::Limiter;
use crate::model::DirectInverse;
use crate::real::Real;
use crate::tracking_law::{self, TrackingLaw, TrackingState};

/// Harmonics of the mains that are taken out.
pub const HARMONICS: usize = 5;

/// A sensor's curve undone: the position `y` with `y_m = m + u + c_2 u^2 + c_3 u^3`, `u = y - m`, by three steps of Newton's method
/// from the reading.
///
/// # Units
/// Micrometres; `c_2` in 1/um, `c_3` in 1/um^2.
/// # Range
/// Where the curve's slope is 0.5 and more (what identification allows) three steps leave less than 1e-6 of the bend.
/// # Cost
/// 3 divisions and 18 multiply-adds a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorInverse<T> {
    middle: T,
    curve: SensorCurve<T>,
}

impl<T: Real> SensorInverse<T> {
    /// Builds it.
    ///
    /// # Errors
    /// Coefficients that the curve refuses; a middle beyond 1e6 um.
    pub fn new(middle_um: f64, quadratic: f64, cubic: f64) -> Result<Self, ParamError> {
        in_range("middle_um", None, middle_um, -1e6, 1e6)?;
        Ok(Self {
            middle: T::from_f64(middle_um),
            curve: SensorCurve::new(T::from_f64(quadratic), T::from_f64(cubic))?,
        })
    }

    /// Middle, and the curve's quadratic and cubic coefficient.
    pub fn coefficients(&self) -> [T; 3] {
        let [quadratic, cubic] = self.curve.coefficients();
        [self.middle, quadratic, cubic]
    }

    /// The position of a reading.
    #[inline(always)]
    pub fn position(&self, reading: T) -> T {
        let from_middle = reading - self.middle;
        let mut u = from_middle;
        for _ in 0..3 {
            // Where the curve turns back there is no position: the slope is kept at a quarter.
            let slope = self.curve.slope(u).select_max(T::from_f64(0.25));
            u -= (self.curve.reading(u) - from_middle) / slope;
        }
        self.middle + admit(u, from_middle)
    }
}

/// What acts on the position beside the command, each part absent where the stage does not have it.
///
/// # Units
/// Micrometres, volts of the other axis, degrees Celsius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surroundings<T> {
    /// Position at rest at 0 V, micrometres.
    pub rest: T,
    /// The other axis.
    pub coupling: Option<Coupling<T>>,
    /// Share of the other axis' motion that reaches this one, where the other axis is controlled, too: its motion is its reference.
    pub cross: Option<T>,
    /// The mains.
    pub hum: Option<HumCanceller<T, HARMONICS>>,
    /// Heat.
    pub heat: Option<Heat<T>>,
    /// The sensor's curve.
    pub sensor: Option<SensorInverse<T>>,
    /// The sensor's own lag: the reference that is due is compared with through the same.
    pub sensor_lag: Option<Lag<T>>,
    /// Gain, zero and lag, learned while the law runs.
    pub adaptation: Option<Adaptation<T>>,
}

impl<T: Real> Surroundings<T> {
    /// Nothing beside the command.
    pub fn none() -> Self {
        Self {
            rest: T::ZERO,
            coupling: None,
            cross: None,
            hum: None,
            heat: None,
            sensor: None,
            sensor_lag: None,
            adaptation: None,
        }
    }
}

/// What a sample of the loop takes in.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LoopInput<T> {
    /// Reference as many samples before it is due as the law was designed for, micrometres.
    pub reference_ahead: T,
    /// Sensor's reading, micrometres.
    pub measured: T,
    /// Command of the other axis, as many samples ahead, volts.
    pub voltage2_ahead: T,
    /// Reference of the other axis, less its rest, as many samples ahead, micrometres.
    pub motion2_ahead: T,
    /// Temperature, degrees Celsius.
    pub temperature_c: T,
}

/// [`TrackingLaw`] with its [`Surroundings`]: `r' = (r - rest - coupling - hum - k d) / (1 + c d)` goes to the feedforward, and the
/// feedback compares the position behind the sensor's curve with `r` itself.
///
/// # Cost
/// That of [`TrackingLaw`] and of each part that is there; 10 instructions and TAPS numbers of state without any.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainLaw<
    T,
    const TAPS: usize,
    const PLAYS: usize,
    const FAST: usize,
    const SLOW: usize,
    H = CornerPolynomial<T, PLAYS>,
> {
    /// The chain backwards, and feedback.
    pub tracking: TrackingLaw<T, TAPS, PLAYS, FAST, SLOW, H>,
    /// What stands around it.
    pub surroundings: Surroundings<T>,
}

/// The law with the sizes of a designed controller.
pub type CompleteLaw<T, H = CornerPolynomial<T, { tracking_law::PLAYS }>> = ChainLaw<
    T,
    { tracking_law::TAPS },
    { tracking_law::PLAYS },
    { tracking_law::CREEP_FAST },
    { tracking_law::CREEP_SLOW },
    H,
>;

/// State of [`CompleteLaw`].
pub type CompleteState<T, S = CornerState<T, { tracking_law::PLAYS }>> = ChainState<
    T,
    { tracking_law::TAPS },
    { tracking_law::PLAYS },
    { tracking_law::CREEP_FAST },
    { tracking_law::CREEP_SLOW },
    S,
>;

/// The law of a design, whichever inverse it has.
pub type DesignedLaw<T> = CompleteLaw<T, EitherInverse<T>>;

/// State of [`DesignedLaw`].
pub type DesignedState<T> = CompleteState<T, EitherState<T>>;

/// State of [`ChainLaw`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainState<
    T,
    const TAPS: usize,
    const PLAYS: usize,
    const FAST: usize,
    const SLOW: usize,
    S = CornerState<T, PLAYS>,
> {
    tracking: TrackingState<T, TAPS, PLAYS, FAST, SLOW, S>,
    /// References that are not due yet; the one that is due next, and comes in as many samples later, is at `place`.
    ring: [T; TAPS],
    place: usize,
    newest: T,
    due: T,
    error: T,
    coupling: Option<CouplingState<T>>,
    hum: Option<HumCancellerState<T, HARMONICS>>,
    heat: Option<HeatState<T>>,
    sensor_lag: Option<LagState<T>>,
    adaptation: AdaptationState<T>,
    /// Whether the law has a part that learns.
    learns: bool,
}

impl<T: Real, const TAPS: usize, const PLAYS: usize, const FAST: usize, const SLOW: usize, H: DirectInverse<T>>
    ChainLaw<T, TAPS, PLAYS, FAST, SLOW, H>
{
    /// Its feedback; none in open loop.
    pub fn feedback(&self) -> Option<&crate::tracking_law::Feedback<T>> {
        self.tracking.feedback.as_ref()
    }

    /// Samples that the reference comes before it is due.
    pub fn ahead(&self) -> usize {
        self.tracking.feedforward.preview.ahead()
    }

    /// The state of a stage that was cycled and rests at 0 V, where that is, at `temperature_c`, the other axis at 0 V.
    pub fn rest(&self, temperature_c: T) -> ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State> {
        ChainState {
            tracking: self.tracking.rest(),
            ring: [self.surroundings.rest; TAPS],
            place: 0,
            newest: self.surroundings.rest,
            due: self.surroundings.rest,
            error: T::ZERO,
            coupling: self.surroundings.coupling.map(|part| part.rest_at(T::ZERO)),
            hum: self.surroundings.hum.map(|part| part.start()),
            heat: self.surroundings.heat.map(|part| part.settled_at(temperature_c)),
            sensor_lag: self
                .surroundings
                .sensor_lag
                .map(|part| part.rest_at(self.surroundings.rest)),
            adaptation: AdaptationState::default(),
            learns: self.surroundings.hum.is_some() || self.surroundings.adaptation.is_some(),
        }
    }

    /// One sample: the command.
    ///
    /// Finite and within the limits for every input.
    #[inline(always)]
    pub fn step(&self, state: &mut ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State>, input: LoopInput<T>) -> T {
        self.step_through(state, input, &self.tracking.limiter)
    }

    /// As [`Self::step`], through another limiter: a slower one on the way from rest to a reference.
    #[inline(always)]
    pub fn step_through(
        &self,
        state: &mut ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State>,
        input: LoopInput<T>,
        limiter: &Limiter<T>,
    ) -> T {
        let command = self.prepare(state, input);
        let error = state.error;
        let allowed = self.tracking.close(&mut state.tracking, command, error, limiter);
        if state.learns {
            self.learn(state, core::ptr::eq(limiter, &self.tracking.limiter));
        }
        allowed
    }

    /// Before a step whose reading stands in for a bad one: gain, zero and lag do not learn from it.
    ///
    /// A reading that is no number says the same. This is for one that feedback can go on with.
    pub fn hold_reading_over(&self, state: &mut ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State>) {
        state.adaptation.spoil_block();
    }

    /// What a sample tells hum, gain, zero and lag. Apart from the step, so that a law which does not learn jumps over little; another
    /// limiter than its own is that of the way from rest.
    #[inline(never)]
    fn learn(&self, state: &mut ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State>, through_its_own_limiter: bool) {
        let around = &self.surroundings;
        if let (Some(part), Some(memory)) = (&around.hum, &mut state.hum) {
            part.learn(memory, state.error);
        }
        if let Some(part) = &around.adaptation {
            let sample = Sample {
                motion: state.due - around.rest,
                error: state.error,
                correction: state.tracking.correction(),
                counts: through_its_own_limiter && !state.tracking.limiter().limited(),
            };
            part.learn(&mut state.adaptation, sample);
        }
    }

    /// One sample of a stage whose command is not the law's: on its way to a safe level, or held there.
    ///
    /// Structure, creep and hysteresis go along with a reference that is where the platform is, so that the law can take over from there;
    /// feedback and hum are left as they are.
    #[inline(always)]
    pub fn follow(
        &self,
        state: &mut ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State>,
        input: LoopInput<T>,
        command: T,
    ) {
        self.prepare(state, input);
        state.tracking.resume_at(self.tracking.limiter.start_at(command));
    }

    /// Before the law takes over again: what was integrated belongs to where the platform was.
    pub fn forget_errors(&self, state: &mut ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State>) {
        state.tracking.forget_errors();
    }

    /// The reference that will be due on a step that takes in `reference_ahead`: where the platform should be when it is read.
    #[inline(always)]
    pub fn next_due(&self, state: &ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State>, reference_ahead: T) -> T {
        match state.ring.get(state.place) {
            Some(&due) if self.ahead() > 0 => due,
            _ => admit(reference_ahead, state.newest),
        }
    }

    /// Feedforward and error of a sample.
    #[inline(always)]
    fn prepare(&self, state: &mut ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State>, input: LoopInput<T>) -> T {
        let around = &self.surroundings;
        let mut target = input.reference_ahead - around.rest;
        if let (Some(part), Some(memory)) = (&around.coupling, &mut state.coupling) {
            target -= part.step(memory, input.voltage2_ahead);
        }
        if let Some(share) = around.cross {
            target -= share * input.motion2_ahead;
        }
        if let Some(memory) = &state.hum {
            target -= memory.predicted();
        }
        if let (Some(part), Some(memory)) = (&around.heat, &mut state.heat) {
            target = part.undo(memory, target, input.temperature_c);
        }
        if let Some(part) = &around.adaptation {
            target = part.adapted(&mut state.adaptation, target);
        }
        let command = self.tracking.feedforward.step(&mut state.tracking.feedforward, target);
        let due = self.take_in(state, input.reference_ahead);
        let expected = match (&around.sensor_lag, &mut state.sensor_lag) {
            (Some(part), Some(memory)) => part.step(memory, due),
            _ => due,
        };
        let position = match &around.sensor {
            Some(part) => part.position(input.measured),
            None => input.measured,
        };
        state.error = expected - position;
        command
    }

    /// Takes in a reference and gives the one that is due.
    #[inline(always)]
    fn take_in(&self, state: &mut ChainState<T, TAPS, PLAYS, FAST, SLOW, H::State>, reference_ahead: T) -> T {
        let newest = admit(reference_ahead, state.newest);
        state.newest = newest;
        let ahead = self.ahead();
        state.due = match state.ring.get_mut(state.place) {
            Some(cell) if ahead > 0 => core::mem::replace(cell, newest),
            _ => newest,
        };
        state.place = if state.place + 1 < ahead { state.place + 1 } else { 0 };
        state.due
    }
}

impl<T: Copy, const TAPS: usize, const PLAYS: usize, const FAST: usize, const SLOW: usize, S>
    ChainState<T, TAPS, PLAYS, FAST, SLOW, S>
{
    /// The reference that is due now: of the last [`ChainLaw::step`], what the position is compared with.
    pub fn due(&self) -> T {
        self.due
    }

    /// That reference, as the sensor can show it, less the position.
    pub fn error(&self) -> T {
        self.error
    }

    /// What the feedback was allowed to add to the last command, volts.
    pub fn correction(&self) -> T {
        self.tracking.correction()
    }

    /// What was learned of gain, zero and lag; nothing in a law that does not learn.
    pub fn adaptation(&self) -> &AdaptationState<T> {
        &self.adaptation
    }

    /// Whether the last command met a limit.
    pub fn limited(&self) -> bool
    where
        T: Real,
    {
        self.tracking.limiter().limited()
    }

    /// What the feedback has integrated, volts.
    pub fn integral(&self) -> T
    where
        T: Real,
    {
        self.tracking.integral()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The inverse of a curve that bends by a quarter of its slope at the ends, at every place of it.
    #[test]
    fn val_sensor_curve_is_undone() {
        let (middle, c2, c3) = (5.0, 0.02, -0.003);
        let inverse = SensorInverse::<f64>::new(middle, c2, c3).unwrap();
        for k in 0..=100 {
            let y = 0.1 * f64::from(k);
            let u = y - middle;
            let reading = middle + u + c2 * u * u + c3 * u * u * u;
            assert!((inverse.position(reading) - y).abs() < 1e-6, "{y}");
        }
        for bad in [f64::NAN, f64::INFINITY] {
            // A reading that is no number is the law's to hold; the inverse only must not hang or panic.
            let _ = inverse.position(bad);
        }
    }
}
