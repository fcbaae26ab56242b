//! Watches sensor, command, error and clock, and says what is wrong.

/// What is wrong; the number is what frames and logs carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Fault {
    /// The sensor's code stood at an end of its range for [`RAIL_SAMPLES`].
    SensorRange = 1,
    /// The sensor's code stood still for [`STUCK_SAMPLES`] while the reference moved.
    SensorStuck = 2,
    /// The position moved by more than the command can have moved the stage: four readings in a row, or here and there too many.
    SensorJump = 3,
    /// The command met a limit on [`SATURATED_SAMPLES`] in a row.
    Saturated = 4,
    /// The error swung [`SWINGS`] times to and fro, faster than the reference can make it.
    Oscillation = 5,
    /// [`LATE_TICKS`] in a row ended after the next edge.
    Overrun = 6,
    /// The reference is not finite.
    Reference = 7,
    /// The mean error, over [`FOLLOWING_SAMPLES`], is beyond [`FOLLOWING_SHARE`] of the range.
    Following = 8,
    /// The interrupt did not come back for [`WATCHDOG_SAMPLES`].
    Watchdog = 9,
    /// The stage, or its sensor, departs further from what the law expects than the table allows: it is not the one of the table.
    Disagreement = 10,
    /// The chip's supply fell below what it and the converters need.
    Supply = 11,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::SensorRange,
        Self::SensorStuck,
        Self::SensorJump,
        Self::Saturated,
        Self::Oscillation,
        Self::Overrun,
        Self::Reference,
        Self::Following,
        Self::Watchdog,
        Self::Disagreement,
        Self::Supply,
    ];

    /// Whether it is the sensor that is in doubt, not the command, the clock or the stage's answer to it.
    pub fn is_of_the_sensor(self) -> bool {
        match self {
            Self::SensorRange | Self::SensorStuck | Self::SensorJump | Self::Following | Self::Disagreement => true,
            Self::Saturated | Self::Oscillation | Self::Overrun | Self::Reference | Self::Watchdog | Self::Supply => {
                false
            }
        }
    }

    /// The fault of a frame's number; `None` for 0 and numbers that are none.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|fault| *fault as u8 == code)
    }
}

/// Two glitches in a row are no end of the range; a third is.
pub const RAIL_SAMPLES: u16 = 3;
/// Codes beside either end that count as the end: a step of a converter of 12 bits, whose highest code is 65 520. A sensor's offset and noise
/// may keep it off the last one.
const RAIL_CODES: u16 = 16;
/// 1 ms at 50 kHz. A sensor with noise of a third of a code or more repeats itself 50 times once in 10^9 trials at most (0.65^50 = 4e-10).
pub const STUCK_SAMPLES: u16 = 50;
/// Codes that the reference must have moved by meanwhile: four steps of a converter of 12 bits. Not the command, which moves on a stage
/// that creeps while the platform is held.
const STUCK_CODES: f32 = 64.0;
/// Codes of noise that are no jump.
const NOISE_CODES: f32 = 32.0;
/// Of the range: what a knock or the sensor's noise may move a reading by, at least.
const JUMP_SHARE: f32 = 0.008;
/// What is left after a sample of how lively the command was: a mode of some hundred hertz with a damping of 0.02 rings for as long.
const FADING: f32 = 0.99;
/// Bad readings in a row that are held over.
const HELD_SAMPLES: u8 = 3;
/// What a bad reading adds to the doubt; every good one takes 1 away.
const DOUBT_A_READING: u16 = 1024;
/// As much doubt as five bad readings at once, or a bad one in 400 for some thousand samples.
const MOST_DOUBT: u16 = 5 * DOUBT_A_READING;
/// 10 ms at 50 kHz: half a period of 50 Hz; a reference that is cut off for longer cannot be reached.
pub const SATURATED_SAMPLES: u16 = 500;
/// Eight periods.
pub const SWINGS: u8 = 16;
/// Longest swing: half a period of 500 Hz at 50 kHz.
const SWING_SAMPLES: u16 = 50;
/// Smallest swing that counts, as a share of the range: above the error of every sine in the paper's tables (5.5 %) there and back.
const SWING_SHARE: f32 = 0.06;
/// One late tick is counted; three in a row mean that the next will be late, too.
pub const LATE_TICKS: u8 = 3;
/// Time constant of the mean error: 50 ms at 50 kHz, a period of 20 Hz.
pub const FOLLOWING_SAMPLES: f32 = 2500.0;
/// Of another axis' motion, what may reach this one and the table does not know of. Stages couple by 0.1 to 3 % and by more near the other's
/// mode (-60 to -30 dB, the catalogue's `cross-coupling`): three times the most; beyond it, the stage is not the one of the table.
pub const COUPLED_SHARE: f32 = 0.1;
/// A reading that was let through and should not have been is none of a stage that is elsewhere.
pub const DEPARTED_SAMPLES: u8 = 3;
/// 1 ms at 50 kHz: what a stage on a held command does not mind.
pub const WATCHDOG_SAMPLES: u32 = 50;
/// Mean error that is no error of tracking any more.
pub const FOLLOWING_SHARE: f32 = 0.25;

/// What the monitor has to know of a table and a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Monitor {
    jump_um: f32,
    jump_um_per_v: f32,
    stuck_um: f32,
    swing_um: f32,
    swing_samples: u16,
    following_um: f32,
    departure_v: f32,
    coupled_v_per_um: f32,
}

/// Numbers of a table that limits are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// Highest reference less the lowest, micrometres.
    pub range_um: f32,
    /// Micrometres of one code of the ADC.
    pub um_per_code: f32,
    /// Smallest and largest slope of the inverse, volts per micrometre.
    pub slopes_v_per_um: [f32; 2],
    /// Highest output of the inverse at rest less the lowest, volts.
    pub span_v: f32,
    /// How far stage and sensor may be from what the law expects, volts.
    pub departure_v: f32,
    /// How much further than a change of the command the platform may go.
    pub overshoot: f32,
}

/// What the monitor remembers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MonitorState {
    code: u16,
    seen: bool,
    railed: u16,
    same: u16,
    lowest_um: f32,
    highest_um: f32,
    /// Where the last tick expected the platform.
    expected_um: f32,
    /// How far from that the last good reading was.
    off_um: f32,
    /// Bad readings in a row.
    held: u8,
    doubt: u16,
    command_v: f32,
    /// The largest change of the command, fading.
    lively_v: f32,
    saturated: u16,
    swings: u8,
    since_crossing: u16,
    extreme_um: f32,
    mean_um: f32,
    /// What another axis may add to the departure.
    coupled_v: f32,
    departed: u8,
    late: u8,
}

/// What a tick has seen and done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Reference, micrometres.
    pub reference_um: f32,
    /// Measured position, micrometres.
    pub measured_um: f32,
    /// Whether the limiter changed the command.
    pub limited: bool,
    /// How far stage and sensor are from what the law expects, volts.
    pub departure_v: f32,
}

/// The smaller; of a NaN and a number the number.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger; of a NaN and a number the number.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

impl MonitorState {
    /// Where the last tick of a run expected the platform, micrometres; none before the first.
    pub fn expected_um(&self) -> Option<f32> {
        self.seen.then_some(self.expected_um)
    }

    /// Whether the last reading was a bad one: in its place stands what the last good one leads to.
    pub fn holds_over(&self) -> bool {
        self.held > 0
    }

    /// Nothing seen yet, the command at rest.
    pub fn at(command_v: f32) -> Self {
        Self {
            command_v,
            ..Self::default()
        }
    }
}

impl Monitor {
    /// Limits for a table; `half_period` is that of the reference's highest frequency, samples.
    pub fn new(scales: &Scales, half_period: u32) -> Self {
        let [smallest, _] = scales.slopes_v_per_um;
        let noise_um = NOISE_CODES * scales.um_per_code;
        let share_um = JUMP_SHARE * scales.range_um;
        // The error of a reference has its harmonics, of which the third is the largest; a swing has to be faster than the fourth.
        let fastest = (half_period / 4).min(u32::from(SWING_SAMPLES)) as u16;
        Self {
            jump_um: larger(noise_um, share_um),
            jump_um_per_v: scales.overshoot / smallest,
            stuck_um: STUCK_CODES * scales.um_per_code,
            swing_um: SWING_SHARE * scales.range_um,
            swing_samples: fastest,
            following_um: FOLLOWING_SHARE * scales.range_um,
            departure_v: scales.departure_v,
            coupled_v_per_um: COUPLED_SHARE * smallest,
        }
    }

    /// Another axis is so far from its rest: [`COUPLED_SHARE`] of that is no fault of this one. Beside one that rests the limit is the table's.
    ///
    /// Between two readings what couples stays below what a knock may do: a tenth of a sine of 10 um at 1 kHz is 0.06 um a sample.
    #[inline(always)]
    pub fn beside(&self, state: &mut MonitorState, away_um: f32) {
        state.coupled_v = self.coupled_v_per_um * away_um.abs();
    }

    /// What the command does now: how far the platform may move of it.
    #[inline(always)]
    pub fn command(&self, state: &mut MonitorState, command_v: f32) {
        let change_v = (command_v - state.command_v).abs();
        let faded_v = FADING * state.lively_v;
        state.lively_v = larger(change_v, faded_v);
        state.command_v = command_v;
    }

    /// The sensor, whatever the loop does: the reading to go by, and what is wrong with it.
    ///
    /// A reading is held against the one before it, the reference's way between both taken off: it may differ by noise and by what the
    /// command has lately done to the platform. One that differs by more is not used; in its place stands what the last good one leads to.
    ///
    /// # Cost
    /// About 40 instructions.
    #[inline(always)]
    pub fn sensor(
        &self,
        state: &mut MonitorState,
        code: u16,
        measured_um: f32,
        expected_um: f32,
    ) -> (f32, Option<Fault>) {
        let stuck = self.stands_still(state, code, expected_um);
        state.railed = if code < RAIL_CODES || code > u16::MAX - RAIL_CODES {
            state.railed.saturating_add(1)
        } else {
            0
        };
        let way_um = (expected_um - state.expected_um).abs();
        let off_um = measured_um - expected_um;
        let moved_um = (off_um - state.off_um).abs();
        let allowed_um = self.jump_um + way_um + self.jump_um_per_v * state.lively_v;
        state.expected_um = expected_um;
        // A NaN fails the comparison.
        if !state.seen || moved_um <= allowed_um {
            (state.seen, state.off_um, state.held) = (true, off_um, 0);
            state.doubt = state.doubt.saturating_sub(1);
        } else {
            state.held = state.held.saturating_add(1);
            state.doubt = state.doubt.saturating_add(DOUBT_A_READING);
        }
        let fault = if state.railed >= RAIL_SAMPLES {
            Some(Fault::SensorRange)
        } else if state.held > HELD_SAMPLES || state.doubt >= MOST_DOUBT {
            Some(Fault::SensorJump)
        } else if stuck {
            Some(Fault::SensorStuck)
        } else {
            None
        };
        (expected_um + state.off_um, fault)
    }

    /// Whether the code has not changed for long while the reference moved.
    #[inline(always)]
    fn stands_still(&self, state: &mut MonitorState, code: u16, expected_um: f32) -> bool {
        if code == state.code && state.seen {
            state.same = state.same.saturating_add(1);
            state.lowest_um = smaller(expected_um, state.lowest_um);
            state.highest_um = larger(expected_um, state.highest_um);
        } else {
            state.same = 1;
            state.lowest_um = expected_um;
            state.highest_um = expected_um;
        }
        state.code = code;
        state.same >= STUCK_SAMPLES && state.highest_um - state.lowest_um > self.stuck_um
    }

    /// How far stage and sensor are from what the law expects.
    #[inline(always)]
    pub fn departure(&self, state: &mut MonitorState, departure_v: f32) -> Option<Fault> {
        // A NaN fails the comparisons.
        let allowed_v = self.departure_v + state.coupled_v;
        let within = departure_v <= allowed_v && departure_v >= -allowed_v;
        state.departed = if within { 0 } else { state.departed.saturating_add(1) };
        (state.departed >= DEPARTED_SAMPLES).then_some(Fault::Disagreement)
    }

    /// Command and error, while the loop runs.
    ///
    /// # Cost
    /// About 30 instructions.
    #[inline(always)]
    pub fn tracking(&self, state: &mut MonitorState, tick: &Tick) -> Option<Fault> {
        let error_um = tick.reference_um - tick.measured_um;
        if !error_um.is_finite() {
            return Some(Fault::Reference);
        }
        state.saturated = if tick.limited {
            state.saturated.saturating_add(1)
        } else {
            0
        };
        if state.saturated >= SATURATED_SAMPLES {
            return Some(Fault::Saturated);
        }
        state.mean_um += (error_um - state.mean_um) * (1.0 / FOLLOWING_SAMPLES);
        if state.mean_um > self.following_um || state.mean_um < -self.following_um {
            return Some(Fault::Following);
        }
        if let Some(fault) = self.departure(state, tick.departure_v) {
            return Some(fault);
        }
        self.swing(state, error_um - state.mean_um)
    }

    /// Counts swings to and fro between crossings of the mean.
    #[inline(always)]
    fn swing(&self, state: &mut MonitorState, error_um: f32) -> Option<Fault> {
        state.since_crossing = state.since_crossing.saturating_add(1);
        if (error_um > 0.0) == (state.extreme_um > 0.0) {
            let larger = (error_um > 0.0) == (error_um > state.extreme_um);
            state.extreme_um = if larger { error_um } else { state.extreme_um };
            return None;
        }
        let large = state.extreme_um > self.swing_um || state.extreme_um < -self.swing_um;
        state.swings = if large && state.since_crossing <= self.swing_samples {
            state.swings.saturating_add(1)
        } else {
            0
        };
        (state.since_crossing, state.extreme_um) = (0, error_um);
        (state.swings >= SWINGS).then_some(Fault::Oscillation)
    }

    /// The clock: whether the tick before ended after the edge of this one.
    #[inline(always)]
    pub fn clock(&self, state: &mut MonitorState, late: bool) -> Option<Fault> {
        state.late = if late { state.late.saturating_add(1) } else { 0 };
        (state.late >= LATE_TICKS).then_some(Fault::Overrun)
    }
}
