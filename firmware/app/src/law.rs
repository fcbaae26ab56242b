//! What turns reference and position into a command: the paper's law, or the complete one; the core's own, both of them.

use crate::learned::Learned;
use hysteron_core::control_law::{ControlLaw, ControlState};
use hysteron_core::error::ParamError;
use hysteron_core::limiter::Limiter;
use hysteron_core::model::AtRest;
use hysteron_core::pi_controller::PiController;
use hysteron_core::real::Real as _;
use hysteron_core::surroundings::{CompleteLaw, CompleteState, LoopInput};
use hysteron_core::tracking_law::Feedback;
use hysteron_slot::{Numbers, Sweep};

/// How the chip moves and sums the plays of a bank; the bits are the same on all.
#[cfg(not(all(feature = "max-instruction", target_arch = "arm")))]
pub type Plays = hysteron_core::plays_sum::FirstPlays;
/// How the chip moves and sums the plays of a bank; the bits are the same on all.
#[cfg(all(feature = "max-instruction", target_arch = "arm"))]
pub type Plays = hysteron_cortex_m7::Fives;

/// How a run begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// The sensor's reading.
    pub measured_um: f32,
    /// First value of the trajectory.
    pub first_um: f32,
    /// The command so far.
    pub command_v: f32,
    /// Largest step of a reference on the way to the first value.
    pub rise_um: f32,
}

/// What a law gets beside its reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Now {
    /// The sensor's reading.
    pub measured_um: f32,
    /// What another axis takes in on this tick, less its rest; 0 without one.
    pub beside_um: f32,
    /// The other axis' command of the tick before, volts; 0 without one.
    pub beside_v: f32,
}

/// What a tick of a law has done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// The reference that is due, which the position is to be compared with.
    pub reference_um: f32,
    /// The command.
    pub command_v: f32,
    /// Whether a limiter changed it.
    pub limited: bool,
    /// How far stage and sensor are from what the law expects: of an inverse alone its integral, of a chain the error and what the
    /// feedback added to it; 0 where the law expects nothing.
    pub departure_v: f32,
}

/// A control law as the controller runs it.
pub trait Law: Copy + core::fmt::Debug + 'static {
    /// What it remembers.
    type State: Clone + core::fmt::Debug;

    /// Which of its parts run; `weight` is the share that the reference's frequency leaves to the feedback.
    fn set_parts(&mut self, feedforward: bool, feedback: bool, weight: f32);

    /// Other gains.
    fn set_gains(&mut self, gains: PiController<f32>);

    /// Takes over another table's numbers, but for what only [`Law::start`] needs: a tick has not the time to copy that as well.
    fn adopt(&mut self, other: &Self);

    /// The state of a stage that rests, for a table that no run was made with yet, at the safe level; `table` is what was adopted last. A tick
    /// that starts a run has not the time to make it.
    fn start(&self, start: &Start, table: &Self) -> Self::State;

    /// The state that a run begins with, at the safe level: what can be known of where the stage is stays.
    fn restart(&self, state: &mut Self::State, start: &Start);

    /// A tick away from the trajectory, on the way to the safe level or at it: the command is not the law's, and `share` is left of the
    /// way.
    fn follow(&self, state: &mut Self::State, share: f32, command_v: f32, now: Now);

    /// Where the platform should be on a tick that takes in `coming_um`.
    fn expected_um(&self, state: &Self::State, coming_um: f32) -> f32;

    /// A tick on the way to the trajectory's first value, through the ramp's limiter; whether it is there.
    fn rise(&self, state: &mut Self::State, ramp: &Limiter<f32>, now: Now) -> (Step, bool);

    /// A tick along the trajectory, which the law takes in as many ticks before it is due as it was designed for.
    fn run(&self, state: &mut Self::State, trajectory_um: f32, now: Now) -> Step;

    /// Before a tick whose reading stands in for a bad one: a law that learns does not learn from it.
    fn hold_reading_over(&self, _: &mut Self::State) {}

    /// Whether it comes down along its reference where only the sensor is in doubt; for the others the command goes down on a ramp.
    fn comes_down_itself(&self) -> bool {
        false
    }

    /// What it has learned; none of a law that does not.
    fn learned(&self, _: &Self::State) -> Option<Learned> {
        None
    }

    /// What [`Law::rise`] will take in on its next tick.
    fn coming_um(&self, state: &Self::State) -> f32;

    /// Where the stage rests.
    fn rest_um(&self) -> f32;
}

/// The paper's law, with what it is made of where parts of it are off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paper<I> {
    feedback: PiController<f32>,
    law: ControlLaw<f32, I>,
    feedforward: bool,
    feedback_weight: f32,
}

impl<I: AtRest<f32> + Copy> Paper<I> {
    /// Feedforward and feedback.
    pub fn new(inverse: I, feedback: PiController<f32>, limiter: Limiter<f32>) -> Self {
        let law = ControlLaw {
            feedforward: inverse,
            feedback,
            limiter,
        };
        Self {
            feedback,
            law,
            feedforward: true,
            feedback_weight: 1.0,
        }
    }
}

impl<I: AtRest<f32> + Copy> Paper<I> {
    /// Of a table and its inverse.
    ///
    /// # Errors
    /// What the core refuses.
    #[inline(always)]
    pub fn of<const N: usize>(inverse: I, table: &Numbers<N>) -> Result<Self, ParamError> {
        let (proportional, integral) = (table.proportional_v_per_um as f32, table.integral_v_per_um_s as f32);
        let feedback = PiController::new(proportional, integral, table.sample_rate_hz as f32)?;
        Ok(Self::new(inverse, feedback, table.limiter(table.slew_v_per_s)?))
    }
}

/// State of [`Paper`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperState<S> {
    control: ControlState<f32, S>,
    first_um: f32,
}

impl<I: AtRest<f32> + Copy + core::fmt::Debug + 'static> Law for Paper<I>
where
    I::State: Clone + core::fmt::Debug,
{
    type State = PaperState<I::State>;

    fn set_parts(&mut self, feedforward: bool, feedback: bool, weight: f32) {
        self.feedforward = feedforward;
        self.feedback_weight = if feedback { weight } else { 0.0 };
        self.law.feedback = self.feedback.weighted(self.feedback_weight);
    }

    fn set_gains(&mut self, gains: PiController<f32>) {
        self.feedback = gains;
        self.law.feedback = gains.weighted(self.feedback_weight);
    }

    /// The plays where the stage's are: at rest at the safe level after coming down to it, wherever the sensor sees that.
    fn adopt(&mut self, other: &Self) {
        *self = *other;
    }

    fn start(&self, start: &Start, _: &Self) -> Self::State {
        let plays = self.law.feedforward.at_rest(start.measured_um, start.first_um);
        PaperState {
            control: self.law.start(plays, start.command_v),
            first_um: start.first_um,
        }
    }

    /// The plays alone: what else there is, begins anew.
    fn restart(&self, state: &mut Self::State, start: &Start) {
        *state = self.start(start, self);
    }

    fn follow(&self, _: &mut Self::State, _: f32, _: f32, _: Now) {}

    #[inline(always)]
    fn expected_um(&self, _: &Self::State, coming_um: f32) -> f32 {
        coming_um
    }

    /// Towards the inverse's command at the trajectory's first value; feedback alone starts from where it is.
    fn rise(&self, state: &mut Self::State, ramp: &Limiter<f32>, _: Now) -> (Step, bool) {
        let before_v = state.control.limiter.last();
        let wanted_v = if self.feedforward {
            self.law
                .feedforward
                .step(&mut state.control.feedforward, state.first_um)
        } else {
            before_v
        };
        let command_v = ramp.step(&mut state.control.limiter, wanted_v);
        let limited = state.control.limiter.limited();
        let step = Step {
            reference_um: state.first_um,
            command_v,
            limited,
            departure_v: 0.0,
        };
        // Where the stage rests above the trajectory, the inverse asks for less than the amplifier has: as near as it goes is there.
        (step, !limited || command_v == before_v)
    }

    #[inline(always)]
    fn run(&self, state: &mut Self::State, trajectory_um: f32, now: Now) -> Step {
        let control = &mut state.control;
        let (command_v, departure_v) = if self.feedforward {
            let command_v = self.law.step(control, trajectory_um, now.measured_um);
            (command_v, control.feedback.integral())
        } else {
            (
                self.law.step_feedback(control, 0.0, trajectory_um, now.measured_um),
                0.0,
            )
        };
        Step {
            command_v,
            reference_um: trajectory_um,
            limited: control.limiter.limited(),
            departure_v,
        }
    }

    fn coming_um(&self, state: &Self::State) -> f32 {
        state.first_um
    }

    /// The paper's law does not know of another axis.
    fn rest_um(&self) -> f32 {
        0.0
    }
}

/// The complete law, with the feedback that it has where that is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Complete {
    law: CompleteLaw<f32>,
    feedback: Option<Feedback<f32>>,
    /// Volts of the inverse that a micrometre is at least.
    v_per_um: f32,
    /// What a run begins with: made before the clock runs, since making it takes as long as a tick may.
    rest: CompleteState<f32>,
}

impl Complete {
    /// The law of a table, whose sweep says how steep its inverse is.
    ///
    /// # Errors
    /// What the core refuses; a table without a complete law.
    #[inline(always)]
    pub fn of<const N: usize>(table: &Numbers<N>, sweep: &Sweep) -> Result<Self, ParamError> {
        Ok(Self::new(table.law()?, sweep.slopes_v_per_um[0] as f32))
    }

    /// The same into the place of another law: main's stack has no room for it beside that.
    ///
    /// # Errors
    /// As [`Complete::of`]; the place is as it was.
    #[inline(always)]
    pub fn put<const N: usize>(&mut self, table: &Numbers<N>, sweep: &Sweep) -> Result<(), ParamError> {
        self.law = table.law()?;
        self.feedback = self.law.tracking.feedback;
        self.v_per_um = sweep.slopes_v_per_um[0] as f32;
        self.rest = self.law.rest(0.0);
        Ok(())
    }

    /// Feedforward, and feedback where the law has it; `v_per_um` is the inverse's smallest slope.
    #[cold]
    pub fn new(law: CompleteLaw<f32>, v_per_um: f32) -> Self {
        let feedback = law.tracking.feedback;
        Self {
            law,
            feedback,
            v_per_um,
            rest: law.rest(0.0),
        }
    }

    /// Once in the image: rising, running and falling from the watchdog would each have some kilobytes of it.
    #[inline(never)]
    fn step(&self, state: &mut Preparing, limiter: &Limiter<f32>, reference_um: f32, now: Now) -> Step {
        let way_um = (reference_um - self.law.surroundings.rest).abs();
        state.reach_um = if way_um > state.reach_um {
            way_um
        } else {
            state.reach_um
        };
        let chain = &mut state.chain;
        let offset_um = match state.offset_um {
            Some(offset_um) => offset_um,
            None => now.measured_um - self.law.next_due(chain, reference_um),
        };
        let command_v = self
            .law
            .step_through(chain, input(reference_um, now.measured_um - offset_um, now), limiter);
        state.offset_um = Some(if offset_um.abs() > LEAST_OFFSET_UM {
            OFFSET_FADING * offset_um
        } else {
            0.0
        });
        Step {
            command_v,
            reference_um: chain.due(),
            limited: chain.limited(),
            departure_v: (chain.error() - offset_um) * self.v_per_um + chain.correction(),
        }
    }
}

/// Of how far the platform has been, what creep leaves of it at rest at most.
const RESIDUE_SHARE: f32 = 0.03;
/// Of what the sensor says at rest, the share that is taken over in a sample: 5 ms at 50 kHz, or its noise would move the plays.
const RESTING_SHARE: f32 = 1.0 / 256.0;
/// What is left after a sample of the error that a run begins with: it goes to the feedback over 20 ms at 50 kHz, without a bump.
const OFFSET_FADING: f32 = 0.999;
/// No offset any more, micrometres.
const LEAST_OFFSET_UM: f32 = 1e-6;

/// What the chain takes in.
#[inline(always)]
fn input(reference_um: f32, measured_um: f32, now: Now) -> LoopInput<f32> {
    LoopInput {
        reference_ahead: reference_um,
        measured: measured_um,
        // Not ahead: its reference is known early, its command is not.
        voltage2_ahead: now.beside_v,
        motion2_ahead: now.beside_um,
        ..LoopInput::default()
    }
}

/// State of [`Complete`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preparing {
    chain: CompleteState<f32>,
    first_um: f32,
    rise_um: f32,
    /// Where the reference will be on the next tick of its way.
    coming_um: f32,
    /// What the law took in last before it came down.
    last_um: f32,
    /// How far from the rest it has been since it rose.
    reach_um: f32,
    /// Where the platform is at rest, as the sensor says: it creeps back.
    resting_um: f32,
    /// What the error that the run began with is taken for, and is not the feedback's yet; none before its first tick.
    offset_um: Option<f32>,
    /// Ticks until the first value is due.
    left: usize,
}

impl Law for Complete {
    type State = Preparing;

    /// The feedforward always runs: the feedback compares with what it has prepared. A gain between none and the one that the loop was
    /// designed for is not used: above the frequency up to which feedback helps there is none.
    fn set_parts(&mut self, _: bool, feedback: bool, weight: f32) {
        self.law.tracking.feedback = self.feedback.filter(|_| feedback && weight >= 1.0);
    }

    fn set_gains(&mut self, gains: PiController<f32>) {
        let with = |feedback: Feedback<f32>| Feedback {
            integral: gains,
            ..feedback
        };
        self.feedback = self.feedback.map(with);
        self.law.tracking.feedback = self.law.tracking.feedback.map(with);
    }

    /// The rest stays behind.
    fn adopt(&mut self, other: &Self) {
        self.law = other.law;
        self.feedback = other.feedback;
        self.v_per_um = other.v_per_um;
    }

    /// A stage that was cycled and rests at 0 V, the safe level of such a table.
    fn start(&self, start: &Start, table: &Self) -> Preparing {
        Preparing {
            chain: table.rest,
            first_um: start.first_um,
            rise_um: start.rise_um,
            coming_um: self.law.surroundings.rest,
            last_um: self.law.surroundings.rest,
            reach_um: 0.0,
            resting_um: self.law.surroundings.rest,
            offset_um: None,
            left: self.law.ahead() + 1,
        }
    }

    fn hold_reading_over(&self, state: &mut Preparing) {
        self.law.hold_reading_over(&mut state.chain);
    }

    #[inline(always)]
    fn learned(&self, state: &Preparing) -> Option<Learned> {
        let learned = state.chain.adaptation();
        self.law.surroundings.adaptation.as_ref().map(|_| Learned {
            gain: learned.gain(),
            zero_um: learned.zero(),
            lag_samples: learned.lag(),
        })
    }

    /// A platform in motion has to be stopped before it is let go: its modes go on otherwise.
    fn comes_down_itself(&self) -> bool {
        true
    }

    /// Structure, creep and hysteresis are where the way down and the rest have taken them; an error begins anew.
    fn restart(&self, state: &mut Preparing, start: &Start) {
        self.law.forget_errors(&mut state.chain);
        state.first_um = start.first_um;
        state.rise_um = start.rise_um;
        state.coming_um = state.resting_um;
        state.last_um = state.resting_um;
        state.offset_um = None;
        state.left = self.law.ahead() + 1;
    }

    /// Along a reference that comes down to the stage's rest as the command does to the safe level, and then is where the platform creeps.
    #[inline(never)]
    fn follow(&self, state: &mut Preparing, share: f32, command_v: f32, now: Now) {
        let rest_um = self.law.surroundings.rest;
        let reference_um = if share > 0.0 {
            state.resting_um = rest_um;
            rest_um + share * (state.last_um - rest_um)
        } else {
            let most_um = RESIDUE_SHARE * state.reach_um;
            let left_um = (now.measured_um - rest_um).select_min(most_um).select_max(-most_um);
            // A NaN fails the comparison: what the sensor does not say is rest.
            let left_um = if now.measured_um.is_finite() { left_um } else { 0.0 };
            state.resting_um += RESTING_SHARE * (rest_um + left_um - state.resting_um);
            state.resting_um
        };
        self.law
            .follow(&mut state.chain, input(reference_um, now.measured_um, now), command_v);
    }

    #[inline(always)]
    fn expected_um(&self, state: &Preparing, coming_um: f32) -> f32 {
        self.law.next_due(&state.chain, coming_um)
    }

    /// The reference goes from the stage's rest to the trajectory's first value in a straight line, and the whole law with it.
    fn rise(&self, state: &mut Preparing, ramp: &Limiter<f32>, now: Now) -> (Step, bool) {
        let step = self.step(state, ramp, state.coming_um, now);
        state.last_um = state.coming_um;
        let left_um = state.first_um - state.coming_um;
        if left_um > state.rise_um {
            state.coming_um += state.rise_um;
        } else if left_um < -state.rise_um {
            state.coming_um -= state.rise_um;
        } else {
            state.coming_um = state.first_um;
            state.left = state.left.saturating_sub(1);
        }
        (step, state.left == 0)
    }

    #[inline(always)]
    fn run(&self, state: &mut Preparing, trajectory_um: f32, now: Now) -> Step {
        state.last_um = trajectory_um;
        self.step(state, &self.law.tracking.limiter, trajectory_um, now)
    }

    fn coming_um(&self, state: &Preparing) -> f32 {
        state.coming_um
    }

    fn rest_um(&self) -> f32 {
        self.law.surroundings.rest
    }
}
