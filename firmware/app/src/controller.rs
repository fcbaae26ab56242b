//! One tick: watch, then the control law or the ramp to or from the safe level.

use crate::law::{Law, Now, Start, Step};
use crate::learned::{WORD_TICKS, word};
use crate::monitor::{Fault, Monitor, MonitorState, Tick};
use crate::parameters::Parameters;
use crate::trajectory::{Trajectory, Uploaded};
use crate::tuning::{Change, Mailbox};
use crate::wire::{ACCEPTED, BANK_BIT, LEARNED, REFUSED};
use crate::wire::{Frame, Input, Mode, Order, Setup, flags};
use hysteron_core::codes::AdcCode;
use hysteron_core::limiter::LimiterState;
use hysteron_core::pi_controller::PiController;

/// Control law, trajectory, monitor, and what the controller is at.
///
/// It begins at the safe level. [`Order::Start`] ramps the command to what the law asks for at the trajectory's first value, then
/// the loop runs. [`Order::Stop`] and every fault ramp it to the safe level. A fault is latched until [`Order::Clear`], and nothing
/// but a new [`Order::Start`] lets it rise again.
#[derive(Debug, Clone)]
pub struct Controller<L: Law> {
    /// In force: those of a bank, with what was changed since it was selected.
    parameters: Parameters<L>,
    /// As they were compiled in.
    banks: &'static [Parameters<L>],
    /// The number of the bank in force, at its place in a frame's flags.
    bank_flags: u16,
    state: L::State,
    ramp: LimiterState<f32>,
    monitor: Monitor,
    seen: MonitorState,
    trajectory: Trajectory,
    /// Where the trajectory begins, micrometres.
    first_um: f32,
    /// What the trajectory gives to the next tick on it, micrometres.
    coming_um: f32,
    /// What another axis said of itself before this tick.
    beside: Beside,
    setup: Setup,
    mailbox: Mailbox,
    uploaded: Uploaded,
    mode: Mode,
    fault: Option<Fault>,
    /// The law's state belongs to another table than the one in force.
    stale: bool,
    /// It has run with the table since, and goes along with where the stage is.
    known: bool,
    /// Whether it fell from the way up: there was no trajectory yet.
    rising: bool,
    /// Share of the way to the safe level that a volt is.
    fall_per_v: f32,
    /// Ticks on which the law still brings the platform down; then the ramp does.
    fading: u16,
    /// What the law took in last of it, micrometres.
    faded_um: f32,
    command_v: f32,
    number: u32,
    /// Bits of what the law has learned that are still to go into frames, the next one lowest.
    told: u32,
}

/// What an axis tells another of itself before a tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Beside {
    /// What its law takes in on the tick, less where its stage rests, micrometres; 0 away from the trajectory.
    pub coming_um: f32,
    /// Its command of the tick before, volts.
    pub command_v: f32,
    /// Where its law had its platform on the tick before, less where its stage rests, micrometres.
    pub away_um: f32,
}

impl<L: Law> Controller<L> {
    /// The controller at its safe level, with one table.
    #[cold]
    pub fn new(mut parameters: Parameters<L>, setup: &Setup) -> Self {
        let trajectory = Trajectory::new(setup.shape, setup.low_um, setup.high_um, setup.phase_step);
        let uploaded = Uploaded::default();
        let first_um = trajectory.first_um(&uploaded);
        let frequency_hz = setup.frequency_hz(parameters.sample_rate_hz);
        let feedback_weight = feedback_weight(frequency_hz, parameters.feedback_up_to_hz);
        let law = &mut parameters.law;
        law.set_parts(setup.feedforward, setup.feedback, feedback_weight);
        let start = Start {
            measured_um: first_um,
            first_um,
            command_v: parameters.safe_v,
            rise_um: parameters.rise_um,
        };
        let state = parameters.law.start(&start, &parameters.law);
        Self {
            state,
            ramp: parameters.ramp.start_at(parameters.safe_v),
            monitor: Monitor::new(&parameters.scales, setup.half_period()),
            seen: MonitorState::default(),
            first_um,
            coming_um: first_um,
            beside: Beside::default(),
            trajectory,
            setup: *setup,
            mailbox: Mailbox::default(),
            uploaded,
            mode: Mode::Off,
            fault: None,
            stale: false,
            known: false,
            rising: false,
            fall_per_v: 0.0,
            fading: 0,
            faded_um: first_um,
            command_v: parameters.safe_v,
            number: 0,
            told: 0,
            parameters,
            banks: &[],
            bank_flags: 0,
        }
    }

    /// Gives it the tables that [`Change::Bank`] selects from; the first is the one that it has.
    ///
    /// They have one rate, safe level, command and slew, and the same converters: the build has seen to that.
    #[must_use]
    pub fn with_banks(self, banks: &'static [Parameters<L>]) -> Self {
        Self { banks, ..self }
    }

    /// One tick. Total: whatever comes in, the command stays within its limits and never moves faster than its slew.
    ///
    /// `late` says that the tick before ended after the edge of this one.
    ///
    /// # Cost
    /// That of the law, two conversions, a look-up, and about 60 instructions of watching.
    #[inline(always)]
    pub fn step(&mut self, input: Input, late: bool) -> Frame {
        let measured_um = self.parameters.adc.volts(AdcCode(input.adc));
        let answer = self.obey(input.order, measured_um);
        let mut measured_um = measured_um;
        if self.mode != Mode::Off {
            let clock = self.monitor.clock(&mut self.seen, late);
            self.monitor.beside(&mut self.seen, self.beside.away_um);
            let expected_um = self.expected_um();
            let (used_um, sensor) = self.monitor.sensor(&mut self.seen, input.adc, measured_um, expected_um);
            measured_um = used_um;
            if self.seen.holds_over() {
                self.parameters.law.hold_reading_over(&mut self.state);
            }
            if let Some(fault) = sensor.or(clock) {
                self.trip(fault);
            }
        }
        let (reference_um, limited) = match self.mode {
            Mode::Running => self.run(measured_um),
            Mode::Rising => self.rise(measured_um),
            // Of a law that never does, an image has no way down along its reference.
            Mode::Falling if self.parameters.law.comes_down_itself() && self.fading > 0 => self.fade(measured_um),
            Mode::Falling | Mode::Off => self.fall(measured_um, answer == 0),
        };
        self.monitor.command(&mut self.seen, self.command_v);
        let learned = self.tell();
        let frame = Frame {
            number: self.number,
            reference_um,
            command_v: self.command_v,
            dac: self.parameters.dac.code(self.command_v).0,
            flags: flags(limited, self.mode, self.fault) | self.bank_flags | answer | learned,
        };
        self.number = self.number.wrapping_add(1);
        frame
    }

    /// The next bit of what the law has learned, at its place in a frame's flags.
    #[inline(always)]
    fn tell(&mut self) -> u16 {
        self.told = if self.number.is_multiple_of(WORD_TICKS) {
            word(self.parameters.law.learned(&self.state), self.number)
        } else {
            self.told >> 1
        };
        if self.told & 1 == 0 { 0 } else { LEARNED }
    }

    /// Latches a fault and begins to fall; the first fault stays.
    #[inline(always)]
    pub fn trip(&mut self, fault: Fault) {
        if self.fault.is_none() {
            self.fault = Some(fault);
        }
        self.begin_to_fall();
        if !fault.is_of_the_sensor() && self.mode == Mode::Falling {
            self.begin_to_ramp();
        }
    }

    /// What another axis has to know of this one before the next tick.
    pub fn beside(&self) -> Beside {
        let law = &self.parameters.law;
        let coming_um = match self.mode {
            Mode::Running => self.coming_um - law.rest_um(),
            Mode::Rising => law.coming_um(&self.state) - law.rest_um(),
            Mode::Falling if self.fading > 0 => self.faded_um - law.rest_um(),
            Mode::Falling | Mode::Off => 0.0,
        };
        Beside {
            coming_um,
            command_v: self.command_v,
            away_um: self.seen.expected_um().map_or(0.0, |um| um - law.rest_um()),
        }
    }

    /// What another axis has said of itself.
    pub fn set_beside(&mut self, beside: Beside) {
        self.beside = beside;
    }

    /// Where the platform should be when this tick's reading is taken.
    #[inline(always)]
    fn expected_um(&self) -> f32 {
        let law = &self.parameters.law;
        let coming_um = match self.mode {
            Mode::Running => self.coming_um,
            _ => law.coming_um(&self.state),
        };
        law.expected_um(&self.state, coming_um)
    }

    /// The latched fault.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
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
                    self.parameters.law.set_gains(gains);
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
            Some(Change::Bank(bank)) if off => self.select(bank),
            _ => false,
        };
        if accepted { ACCEPTED } else { REFUSED }
    }

    /// Another table, at the safe level; refuses a bank that there is not, and one whose range the reference leaves.
    fn select(&mut self, bank: u8) -> bool {
        let setup = self.setup;
        match self.banks.get(usize::from(bank)) {
            Some(other) if allows(other.range_um, &setup) => {
                adopt(&mut self.parameters, other);
                self.bank_flags = u16::from(bank) << BANK_BIT;
                (self.stale, self.known) = (true, false);
                self.set_up(&setup)
            }
            _ => false,
        }
    }

    /// Another setup, at the safe level; refuses a reference outside the table's range or above a tenth of the sample rate.
    #[inline(never)]
    fn set_up(&mut self, setup: &Setup) -> bool {
        if !allows(self.parameters.range_um, setup) {
            return false;
        }
        let frequency_hz = setup.frequency_hz(self.parameters.sample_rate_hz);
        self.setup = *setup;
        let feedback_weight = feedback_weight(frequency_hz, self.parameters.feedback_up_to_hz);
        let law = &mut self.parameters.law;
        law.set_parts(setup.feedforward, setup.feedback, feedback_weight);
        self.monitor = Monitor::new(&self.parameters.scales, setup.half_period());
        self.trajectory = Trajectory::new(setup.shape, setup.low_um, setup.high_um, setup.phase_step);
        self.first_um = self.trajectory.first_um(&self.uploaded);
        true
    }

    /// The state has been made before, or this tick would take half as long again as any other.
    fn start(&mut self, measured_um: f32) {
        if self.stale {
            self.make_state();
        }
        let start = self.beginning(measured_um);
        self.parameters.law.restart(&mut self.state, &start);
        self.known = true;
        self.seen = MonitorState::at(self.command_v);
        let setup = &self.setup;
        self.trajectory = Trajectory::new(setup.shape, setup.low_um, setup.high_um, setup.phase_step);
        self.coming_um = self.trajectory.next_um(&self.uploaded);
        self.mode = Mode::Rising;
    }

    fn beginning(&self, measured_um: f32) -> Start {
        Start {
            measured_um,
            first_um: self.first_um,
            command_v: self.command_v,
            rise_um: self.parameters.rise_um,
        }
    }

    /// That of a stage at rest, for a table that has been selected.
    fn make_state(&mut self) {
        let start = self.beginning(self.first_um);
        let table = self.banks.get(usize::from(self.bank_flags >> BANK_BIT));
        begin(
            &mut self.state,
            &self.parameters.law,
            table.map(|table| &table.law),
            &start,
        );
        self.stale = false;
    }

    #[inline(always)]
    fn begin_to_fall(&mut self) {
        if self.mode == Mode::Rising || self.mode == Mode::Running {
            self.rising = self.mode == Mode::Rising;
            self.mode = Mode::Falling;
            self.begin_to_ramp();
            if self.parameters.law.comes_down_itself() {
                self.fading = FADING_SAMPLES;
            }
        }
    }

    /// From where the command is, the law no longer in it.
    #[inline(always)]
    fn begin_to_ramp(&mut self) {
        self.fading = 0;
        self.ramp = self.parameters.ramp.start_at(self.command_v);
        let way_v = self.command_v - self.parameters.safe_v;
        self.fall_per_v = if way_v == 0.0 { 0.0 } else { 1.0 / way_v };
    }

    #[inline(always)]
    fn now(&self, measured_um: f32) -> Now {
        Now {
            measured_um,
            beside_um: self.beside.coming_um,
            beside_v: self.beside.command_v,
        }
    }

    #[inline(always)]
    fn run(&mut self, measured_um: f32) -> (f32, bool) {
        // A tick early, so that another axis can know of it.
        let trajectory_um = self.coming_um;
        self.coming_um = self.trajectory.next_um(&self.uploaded);
        let now = self.now(measured_um);
        let Step {
            reference_um,
            command_v,
            limited,
            departure_v,
        } = self.parameters.law.run(&mut self.state, trajectory_um, now);
        self.command_v = command_v;
        let tick = Tick {
            reference_um,
            measured_um,
            limited,
            departure_v,
        };
        if let Some(fault) = self.monitor.tracking(&mut self.seen, &tick) {
            self.trip(fault);
        }
        (reference_um, limited)
    }

    fn rise(&mut self, measured_um: f32) -> (f32, bool) {
        let now = self.now(measured_um);
        let law = &self.parameters.law;
        let (step, there) = law.rise(&mut self.state, &self.parameters.ramp, now);
        self.command_v = step.command_v;
        if let Some(fault) = self.monitor.departure(&mut self.seen, step.departure_v) {
            self.trip(fault);
        } else if there {
            self.mode = Mode::Running;
        }
        (step.reference_um, step.limited)
    }

    /// Down along the reference, which shrinks towards the rest, with the trajectory in it: the platform is stopped, not let go. A sensor
    /// in doubt is not asked: the feedback keeps what it has.
    #[inline(never)]
    fn fade(&mut self, measured_um: f32) -> (f32, bool) {
        let rest_um = self.parameters.law.rest_um();
        let share = smooth(f32::from(self.fading) * (1.0 / FADING_SAMPLES as f32));
        let from_um = if self.rising {
            self.parameters.law.coming_um(&self.state)
        } else {
            let trajectory_um = self.coming_um;
            self.coming_um = self.trajectory.next_um(&self.uploaded);
            trajectory_um
        };
        let reference_um = rest_um + share * (from_um - rest_um);
        self.faded_um = reference_um;
        // No number is no error: the integral stays.
        let now = self.now(if self.fault.is_some() { f32::NAN } else { measured_um });
        let step = self.parameters.law.run(&mut self.state, reference_um, now);
        self.command_v = step.command_v;
        self.fading -= 1;
        if self.fading == 0 {
            self.begin_to_ramp();
        }
        (step.reference_um, step.limited)
    }

    /// Down, or at the safe level; the law's state goes along, but on a tick that has a change to make.
    fn fall(&mut self, measured_um: f32, along: bool) -> (f32, bool) {
        self.command_v = self.parameters.ramp.step(&mut self.ramp, self.parameters.safe_v);
        let limited = self.ramp.limited();
        if !limited {
            self.mode = Mode::Off;
        }
        if !along {
            return (self.first_um, limited);
        }
        if self.stale {
            // A tick after the one that has taken the table over, which has not the time.
            self.make_state();
        } else if self.known {
            let share = (self.command_v - self.parameters.safe_v) * self.fall_per_v;
            let now = self.now(if self.fault.is_some() { f32::NAN } else { measured_um });
            self.parameters.law.follow(&mut self.state, share, self.command_v, now);
        }
        (self.first_um, limited)
    }
}

/// 20 ms at 50 kHz, as long as the ramp over the whole range.
const FADING_SAMPLES: u16 = 1000;

/// From 0 to 1 without a corner at either end.
fn smooth(share: f32) -> f32 {
    share * share * (3.0 - 2.0 * share)
}

/// As [`adopt`]: straight into its place.
#[inline(never)]
fn begin<L: Law>(place: &mut L::State, law: &L, table: Option<&L>, start: &Start) {
    *place = law.start(start, table.unwrap_or(law));
}

/// A function of its own, whose arguments do not overlap: otherwise it is a `memmove`, 1.6 kB of the fastest memory.
#[inline(never)]
fn adopt<L: Law>(place: &mut Parameters<L>, new: &Parameters<L>) {
    place.law.adopt(&new.law);
    place.set_around(new);
}

/// Whether a table of this range can be asked for a reference. A NaN fails the comparisons.
fn allows([min_um, max_um]: [f32; 2], setup: &Setup) -> bool {
    let inside = setup.low_um >= min_um && setup.low_um < setup.high_um && setup.high_um <= max_um;
    inside && setup.phase_step <= u32::MAX / 10
}

/// The share of the feedback: 1 up to a frequency, in a straight line to 0 at twice it; the law brings it into 0 to 1.
fn feedback_weight(frequency_hz: f32, up_to_hz: f32) -> f32 {
    2.0 - frequency_hz / up_to_hz
}
