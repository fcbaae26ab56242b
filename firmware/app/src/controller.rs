//! One tick: watch, then the control law or the ramp to or from the safe level.

use crate::monitor::{Fault, Monitor, MonitorState, Tick};
use crate::parameters::Parameters;
use crate::trajectory::{Trajectory, Uploaded};
use crate::tuning::{Change, Mailbox};
use crate::wire::{ACCEPTED, REFUSED};
use crate::wire::{Frame, Input, Mode, Order, Setup, flags};
use hysteron_core::codes::AdcCode;
use hysteron_core::control_law::{ControlLaw, ControlState};
use hysteron_core::limiter::LimiterState;
use hysteron_core::model::AtRest;
use hysteron_core::pi_controller::PiController;

/// Control law, trajectory, monitor, and what the controller is at.
///
/// It begins at the safe level. [`Order::Start`] ramps the command to what the inverse asks for at the trajectory's first value, then
/// the loop runs. [`Order::Stop`] and every fault ramp it to the safe level. A fault is latched until [`Order::Clear`], and nothing
/// but a new [`Order::Start`] lets it rise again.
#[derive(Debug, Clone)]
pub struct Controller<I: AtRest<f32>> {
    parameters: Parameters<I>,
    law: ControlLaw<f32, I>,
    state: ControlState<f32, I::State>,
    ramp: LimiterState<f32>,
    monitor: Monitor,
    seen: MonitorState,
    trajectory: Trajectory,
    /// Where the trajectory begins, micrometres.
    first_um: f32,
    setup: Setup,
    mailbox: Mailbox,
    uploaded: Uploaded,
    feedback_weight: f32,
    mode: Mode,
    fault: Option<Fault>,
    command_v: f32,
    number: u32,
}

impl<I: AtRest<f32> + Copy> Controller<I> {
    /// The controller at its safe level.
    pub fn new(parameters: Parameters<I>, setup: &Setup) -> Self {
        let law = ControlLaw {
            feedforward: setup.feedforward.then_some(parameters.inverse),
            feedback: setup.feedback.then_some(parameters.feedback),
            limiter: parameters.limiter,
        };
        let trajectory = Trajectory::new(setup.shape, setup.low_um, setup.high_um, setup.phase_step);
        let uploaded = Uploaded::default();
        let first_um = trajectory.first_um(&uploaded);
        let plays = parameters.inverse.at_rest(first_um, first_um);
        let frequency_hz = setup.frequency_hz(parameters.sample_rate_hz);
        Self {
            law,
            state: law.start(plays, parameters.safe_v),
            ramp: parameters.ramp.start_at(parameters.safe_v),
            monitor: Monitor::new(&parameters.scales, setup.half_period()),
            seen: MonitorState::default(),
            first_um,
            trajectory,
            setup: *setup,
            mailbox: Mailbox::default(),
            uploaded,
            feedback_weight: feedback_weight(frequency_hz, parameters.feedback_up_to_hz),
            mode: Mode::Off,
            fault: None,
            command_v: parameters.safe_v,
            number: 0,
            parameters,
        }
    }

    /// One tick. Total: whatever comes in, the command stays within its limits and never moves faster than its slew.
    ///
    /// `late` says that the tick before ended after the edge of this one.
    ///
    /// # Cost
    /// That of [`ControlLaw::step`] with the table's inverse, two conversions, a look-up, and about 60 instructions of watching.
    #[inline(always)]
    pub fn step(&mut self, input: Input, late: bool) -> Frame {
        let measured_um = self.parameters.adc.volts(AdcCode(input.adc));
        let answer = self.obey(input.order, measured_um);
        if self.mode != Mode::Off {
            let clock = self.monitor.clock(&mut self.seen, late);
            let sensor = self.monitor.sensor(&mut self.seen, input.adc, self.command_v);
            if let Some(fault) = sensor.or(clock) {
                self.trip(fault);
            }
        }
        let (reference_um, limited) = match self.mode {
            Mode::Running => self.run(input.adc, measured_um),
            Mode::Rising => self.rise(),
            Mode::Falling | Mode::Off => self.fall(),
        };
        let frame = Frame {
            number: self.number,
            reference_um,
            command_v: self.command_v,
            dac: self.parameters.dac.code(self.command_v).0,
            flags: flags(limited, self.mode, self.fault) | answer,
        };
        self.number = self.number.wrapping_add(1);
        frame
    }

    /// Latches a fault and begins to fall; the first fault stays.
    #[inline(always)]
    pub fn trip(&mut self, fault: Fault) {
        if self.fault.is_none() {
            self.fault = Some(fault);
        }
        self.begin_to_fall();
    }

    #[inline(always)]
    fn obey(&mut self, order: Order, measured_um: f32) -> u16 {
        match order {
            Order::Start if self.mode == Mode::Off && self.fault.is_none() => self.start(measured_um),
            Order::Stop => self.begin_to_fall(),
            // An interrupt that hung may hang again, and the loop is no longer in it: only a reset ends that.
            Order::Clear if self.mode == Mode::Off && self.fault != Some(Fault::Watchdog) => self.fault = None,
            Order::Byte(byte) => self.mailbox.push(byte),
            Order::Apply(kind) => return self.apply(kind),
            _ => {}
        }
        0
    }

    /// Puts a change in force as a whole, or not at all. What the command does of it, the limiter's slew bounds.
    #[inline(never)]
    fn apply(&mut self, kind: u8) -> u16 {
        let off = self.mode == Mode::Off;
        let accepted = match self.mailbox.take(kind) {
            Some(Change::Gains {
                proportional_v_per_um,
                integral_v_per_um_s,
            }) => {
                let rate_hz = self.parameters.sample_rate_hz;
                let gains = PiController::new(proportional_v_per_um, integral_v_per_um_s, rate_hz);
                gains.is_ok_and(|gains| {
                    self.parameters.feedback = gains;
                    self.law.feedback = self.law.feedback.map(|_| gains);
                    true
                })
            }
            Some(Change::Trajectory {
                shape,
                phase_step,
                low_um,
                high_um,
            }) if off => {
                let setup = Setup {
                    shape,
                    phase_step,
                    low_um,
                    high_um,
                    ..self.setup
                };
                self.set_up(&setup)
            }
            Some(Change::Parts { feedforward, feedback }) if off => {
                let setup = Setup {
                    feedforward,
                    feedback,
                    ..self.setup
                };
                self.set_up(&setup)
            }
            // The reference may begin elsewhere then.
            Some(Change::Chunk { chunk, shares }) if off => {
                let setup = self.setup;
                self.uploaded.put(chunk, shares) && self.set_up(&setup)
            }
            _ => false,
        };
        if accepted { ACCEPTED } else { REFUSED }
    }

    /// Another setup, at the safe level; refuses a reference outside the table's range or above a tenth of the sample rate.
    fn set_up(&mut self, setup: &Setup) -> bool {
        let [min_um, max_um] = self.parameters.range_um;
        // A NaN fails the comparisons.
        let inside = setup.low_um >= min_um && setup.low_um < setup.high_um && setup.high_um <= max_um;
        if !inside || setup.phase_step > u32::MAX / 10 {
            return false;
        }
        let frequency_hz = setup.frequency_hz(self.parameters.sample_rate_hz);
        self.setup = *setup;
        self.law.feedforward = setup.feedforward.then_some(self.parameters.inverse);
        self.law.feedback = setup.feedback.then_some(self.parameters.feedback);
        self.feedback_weight = feedback_weight(frequency_hz, self.parameters.feedback_up_to_hz);
        self.monitor = Monitor::new(&self.parameters.scales, setup.half_period());
        self.trajectory = Trajectory::new(setup.shape, setup.low_um, setup.high_um, setup.phase_step);
        self.first_um = self.trajectory.first_um(&self.uploaded);
        true
    }

    /// The plays where the stage's are: at rest at the safe level after coming down to it, wherever the sensor sees that.
    fn start(&mut self, measured_um: f32) {
        let plays = self.parameters.inverse.at_rest(measured_um, self.first_um);
        self.state = self.law.start(plays, self.command_v);
        self.state.set_feedback_weight(self.feedback_weight);
        self.ramp = self.parameters.ramp.start_at(self.command_v);
        self.seen = MonitorState::default();
        let setup = &self.setup;
        self.trajectory = Trajectory::new(setup.shape, setup.low_um, setup.high_um, setup.phase_step);
        self.mode = Mode::Rising;
    }

    #[inline(always)]
    fn begin_to_fall(&mut self) {
        if self.mode == Mode::Rising || self.mode == Mode::Running {
            self.ramp = self.parameters.ramp.start_at(self.command_v);
            self.mode = Mode::Falling;
        }
    }

    #[inline(always)]
    fn run(&mut self, code: u16, measured_um: f32) -> (f32, bool) {
        let reference_um = self.trajectory.next_um(&self.uploaded);
        self.command_v = self.law.step(&mut self.state, reference_um, measured_um);
        let limited = self.state.limiter.limited();
        let tick = Tick {
            code,
            reference_um,
            measured_um,
            command_v: self.command_v,
            limited,
            feedback_v: match (&self.law.feedforward, &self.law.feedback) {
                (Some(_), Some(_)) => self.state.feedback.integral(),
                _ => 0.0,
            },
        };
        if let Some(fault) = self.monitor.tracking(&mut self.seen, &tick) {
            self.trip(fault);
        }
        (reference_um, limited)
    }

    /// Towards the inverse's command at the trajectory's first value; feedback alone starts from where it is.
    fn rise(&mut self) -> (f32, bool) {
        let first_um = self.first_um;
        let wanted_v = match &self.law.feedforward {
            Some(inverse) => inverse.step(&mut self.state.feedforward, first_um),
            None => self.command_v,
        };
        let before_v = self.command_v;
        self.command_v = self.parameters.ramp.step(&mut self.ramp, wanted_v);
        let limited = self.ramp.limited();
        // Where the stage rests above the trajectory, the inverse asks for less than the amplifier has: as near as it goes is there.
        if !limited || self.command_v == before_v {
            self.state.limiter = self.law.limiter.start_at(self.command_v);
            self.mode = Mode::Running;
        }
        (first_um, limited)
    }

    fn fall(&mut self) -> (f32, bool) {
        self.command_v = self.parameters.ramp.step(&mut self.ramp, self.parameters.safe_v);
        let limited = self.ramp.limited();
        if !limited {
            self.mode = Mode::Off;
        }
        (self.first_um, limited)
    }
}

/// The share of the feedback: 1 up to a frequency, in a straight line to 0 at twice it; the law brings it into 0 to 1.
fn feedback_weight(frequency_hz: f32, up_to_hz: f32) -> f32 {
    2.0 - frequency_hz / up_to_hz
}
