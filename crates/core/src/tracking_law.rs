//! The complete control law: every identified effect undone in the feedforward, feedback on what is left.

use crate::biquad::{Biquad, BiquadState};
use crate::corner_polynomial::CornerPolynomial;
use crate::corners::CornerState;
use crate::effects::admit;
use crate::effects::creep::{CreepInverse, CreepInverseState};
use crate::effects::lag::HeldLagInverse;
use crate::limiter::{Limiter, LimiterState};
use crate::model::DirectInverse;
use crate::pi_controller::{Asked, PiController, PiState};
use crate::preview::{Preview, PreviewState};
use crate::real::Real;
use crate::trust::{Trust, TrustState};

/// Coefficients of the preview filter of a designed controller: 0.64 ms at 50 kHz.
pub const TAPS: usize = 32;
/// Plays of its direct inverse: 18 graded ones with cubics reached half the error of 10 even ones on simulated stages, and 24 half of
/// what 18 leave of a complex harmonic, whose corners a mode of 8 kHz answers; more do not fit two axes into half a tick.
pub const PLAYS: usize = 24;
/// Its fading elements, where it has these instead of plays: lengths an octave apart from an eleventh of the range on.
pub const FADING: usize = 4;
/// Its elements of creep that run at every sample.
pub const CREEP_FAST: usize = 5;
/// Its elements of creep that run once in [`CREEP_DIVIDER`] samples.
pub const CREEP_SLOW: usize = 5;
/// Samples a step of the slow elements: 1 ms at 50 kHz.
pub const CREEP_DIVIDER: u32 = 50;

/// The stage's chain backwards: structure and latency ([`Preview`] and one second-order section for what lies between two
/// modes), creep, hysteresis (a direct inverse: plays, where no other is given), amplifier's lag.
///
/// TAPS coefficients of the preview, PLAYS play operators, FAST and SLOW elements of creep. A lag of 0 and shares of 0
/// take a compensator out without another type.
///
/// # Units
/// Micrometres in, volts at the actuator out.
/// # Cost
/// TAPS + 2 FAST + 22 multiply-adds and 2 to PLAYS + 2 compares a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feedforward<
    T,
    const TAPS: usize,
    const PLAYS: usize,
    const FAST: usize,
    const SLOW: usize,
    H = CornerPolynomial<T, PLAYS>,
> {
    /// Latency and structure.
    pub preview: Preview<T, TAPS>,
    /// The inverse of an antiresonance and the mode above it; identity for one mode.
    pub second_mode: Biquad<T>,
    /// Creep.
    pub creep: CreepInverse<T, FAST, SLOW>,
    /// Hysteresis: position before creep in, voltage behind the amplifier's lag out.
    pub hysteresis: H,
    /// The amplifier's lag behind the converter's hold.
    pub lead: HeldLagInverse<T>,
}

/// State of [`Feedforward`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeedforwardState<
    T,
    const TAPS: usize,
    const PLAYS: usize,
    const FAST: usize,
    const SLOW: usize,
    S = CornerState<T, PLAYS>,
> {
    preview: PreviewState<T, TAPS>,
    second_mode: BiquadState<T>,
    creep: CreepInverseState<T, FAST, SLOW>,
    hysteresis: S,
    wanted_v: T,
}

impl<T: Real, const TAPS: usize, const PLAYS: usize, const FAST: usize, const SLOW: usize, H: DirectInverse<T>>
    Feedforward<T, TAPS, PLAYS, FAST, SLOW, H>
{
    /// The state of a stage that was cycled and rests at 0 V and 0 um.
    pub fn rest(&self) -> FeedforwardState<T, TAPS, PLAYS, FAST, SLOW, H::State> {
        let mut hysteresis = self.hysteresis.rest();
        let wanted_v = self.hysteresis.step(&mut hysteresis, T::ZERO);
        FeedforwardState {
            preview: self.preview.rest_at(T::ZERO),
            second_mode: BiquadState::default(),
            creep: self.creep.rest_at(T::ZERO),
            hysteresis,
            wanted_v,
        }
    }

    /// One sample: the command for a reference that comes [`Preview::ahead`] samples before it is due.
    #[inline(always)]
    pub fn step(&self, state: &mut FeedforwardState<T, TAPS, PLAYS, FAST, SLOW, H::State>, reference_ahead: T) -> T {
        let previewed = self.preview.step(&mut state.preview, reference_ahead);
        let before_structure = self.second_mode.step(&mut state.second_mode, previewed);
        let before_creep = self.creep.step(&mut state.creep, before_structure);
        let actuator_v = self.hysteresis.step(&mut state.hysteresis, before_creep);
        // The hysteresis is bounded: its constructor refuses what is not.
        self.lead.step_admitted(&mut state.wanted_v, actuator_v)
    }
}

/// Integral feedback on a lightly damped stage: `C = I B_1 B_2 + D`.
///
/// `B_1`, `B_2` in series with the integral are notches or any second-order shape; `D` beside it is a damping filter
/// (positive position feedback and its kin are such filters). Unused ones are identity and zero.
///
/// # Units
/// Micrometres of error in, volts out.
/// # Cost
/// 16 multiply-adds and 6 compares a step; those of [`Trust`] more where it is bounded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feedback<T> {
    /// Integral (and proportional, where one is wanted).
    pub integral: PiController<T>,
    /// In series with it.
    pub series: [Biquad<T>; 2],
    /// Beside it.
    pub damping: Biquad<T>,
    /// How far all of it may go from the feedforward; unbounded without.
    pub trust: Option<Trust<T>>,
}

/// State of [`Feedback`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FeedbackState<T> {
    integral: PiState<T>,
    series: [BiquadState<T>; 2],
    damping: BiquadState<T>,
    trust: TrustState<T>,
}

impl<T: Real> Feedback<T> {
    /// One sample: the correction that is asked for at an error.
    ///
    /// Anti-windup: the integral, last of the series, does not move further than to where it meets the limit. Before it the
    /// sections see small numbers: behind it, a section that differentiates would multiply the rounding of its hundred volts.
    #[inline(always)]
    pub fn ask(&self, state: &mut FeedbackState<T>, error: T) -> Asked<T> {
        let error = admit(error, T::ZERO);
        let damping = self.damping.step_admitted(&mut state.damping, error);
        let first = self.series[0].step_admitted(&mut state.series[0], error);
        let shaped = self.series[1].step_admitted(&mut state.series[1], first);
        let asked = self.integral.ask_checked(&state.integral, shaped);
        Asked {
            output: asked.output + damping,
            ..asked
        }
    }

    /// What the sensor is trusted with of a correction that is asked for.
    #[inline(always)]
    pub fn bound(&self, state: &mut FeedbackState<T>, asked: Asked<T>) -> T {
        match &self.trust {
            Some(trust) => trust.bound(&mut state.trust, asked.output),
            None => asked.output,
        }
    }

    /// The correction went out, changed by `excess`: how far the integral goes.
    #[inline(always)]
    pub fn take(&self, state: &mut FeedbackState<T>, asked: Asked<T>, excess: T) {
        self.integral.take_limited(&mut state.integral, asked, excess);
    }
}

/// Feedforward and feedback through a limiter.
///
/// The error is formed against the reference that is due at this sample, the one that the feedforward has prepared the
/// stage for: against any other the feedback would undo the preview.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackingLaw<
    T,
    const TAPS: usize,
    const PLAYS: usize,
    const FAST: usize,
    const SLOW: usize,
    H = CornerPolynomial<T, PLAYS>,
> {
    /// The chain backwards.
    pub feedforward: Feedforward<T, TAPS, PLAYS, FAST, SLOW, H>,
    /// Feedback; `None` for open loop.
    pub feedback: Option<Feedback<T>>,
    /// Limits of the command.
    pub limiter: Limiter<T>,
}

/// State of [`TrackingLaw`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackingState<
    T,
    const TAPS: usize,
    const PLAYS: usize,
    const FAST: usize,
    const SLOW: usize,
    S = CornerState<T, PLAYS>,
> {
    pub(crate) feedforward: FeedforwardState<T, TAPS, PLAYS, FAST, SLOW, S>,
    feedback: FeedbackState<T>,
    /// What the feedback was allowed to add last.
    correction: T,
    limiter: LimiterState<T>,
}

impl<T: Real, const TAPS: usize, const PLAYS: usize, const FAST: usize, const SLOW: usize, H: DirectInverse<T>>
    TrackingLaw<T, TAPS, PLAYS, FAST, SLOW, H>
{
    /// The state of a stage that was cycled and rests at 0 V and 0 um.
    pub fn rest(&self) -> TrackingState<T, TAPS, PLAYS, FAST, SLOW, H::State> {
        TrackingState {
            feedforward: self.feedforward.rest(),
            feedback: FeedbackState::default(),
            correction: T::ZERO,
            limiter: self.limiter.start_at(T::ZERO),
        }
    }

    /// The feedforward's command with feedback on an error, through a limiter: its own, or a slower one on the way from rest.
    #[inline(always)]
    pub(crate) fn close(
        &self,
        state: &mut TrackingState<T, TAPS, PLAYS, FAST, SLOW, H::State>,
        command: T,
        error: T,
        limiter: &Limiter<T>,
    ) -> T {
        let Some(feedback) = &self.feedback else {
            state.correction = T::ZERO;
            return limiter.step(&mut state.limiter, command);
        };
        let asked = feedback.ask(&mut state.feedback, error);
        let bounded = feedback.bound(&mut state.feedback, asked);
        let wanted = command + bounded;
        let allowed = limiter.step(&mut state.limiter, wanted);
        state.correction = bounded;
        feedback.take(
            &mut state.feedback,
            asked,
            (bounded - asked.output) + (allowed - wanted),
        );
        allowed
    }
}

impl<T: Copy, const TAPS: usize, const PLAYS: usize, const FAST: usize, const SLOW: usize, S>
    TrackingState<T, TAPS, PLAYS, FAST, SLOW, S>
{
    /// Goes on from another command than its own.
    #[inline(always)]
    pub(crate) fn resume_at(&mut self, limiter: LimiterState<T>) {
        self.limiter = limiter;
    }

    /// Feedback as at rest.
    pub(crate) fn forget_errors(&mut self)
    where
        T: Real,
    {
        self.feedback = FeedbackState::default();
        self.correction = T::ZERO;
    }

    /// The limiter, which knows whether the last command met a limit.
    pub fn limiter(&self) -> &LimiterState<T> {
        &self.limiter
    }

    /// What the feedback was allowed to add to the last command, volts; 0 in open loop.
    pub fn correction(&self) -> T {
        self.correction
    }

    /// What the feedback has integrated, volts.
    pub fn integral(&self) -> T
    where
        T: Real,
    {
        self.feedback.integral.integral()
    }
}
