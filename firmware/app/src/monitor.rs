//! Watches sensor, command, error and clock, and says what is wrong.

/// What is wrong; the number is what frames and logs carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Fault {
    /// The sensor's code stood at an end of its range for [`RAIL_SAMPLES`].
    SensorRange = 1,
    /// The sensor's code stood still for [`STUCK_SAMPLES`] while the command moved.
    SensorStuck = 2,
    /// The position moved in one sample by more than the stage can.
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
    /// The integral is beyond [`DISAGREEMENT_SHARE`] of the inverse's span: the stage or its sensor is not the one the inverse is of.
    Disagreement = 10,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 10] = [
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
    ];

    /// The fault of a frame's number; `None` for 0 and numbers that are none.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|fault| *fault as u8 == code)
    }
}

/// Two glitches in a row are no end of the range; a third is.
pub const RAIL_SAMPLES: u16 = 3;
/// Codes beside either end that count as the end: a sensor's offset and noise may keep it off the last one.
const RAIL_CODES: u16 = 8;
/// 1 ms at 50 kHz. A sensor with noise of a third of a code or more repeats itself 50 times once in 10^9 trials at most (0.65^50 = 4e-10).
pub const STUCK_SAMPLES: u16 = 50;
/// Codes that the command must have moved the stage by meanwhile.
pub const STUCK_CODES: f32 = 16.0;
/// A lightly damped mode doubles a step of the command.
const OVERSHOOT: f32 = 2.0;
/// Codes of noise that are no jump.
const NOISE_CODES: f32 = 32.0;
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
/// Above what hysteresis, creep and drift leave to the integral: a stage without an inverse has loops of 15 to 23 % up to 100 Hz
/// (the paper's openings), and creeps by a few percent.
pub const DISAGREEMENT_SHARE: f32 = 0.3;
/// 1 ms at 50 kHz: what a stage on a held command does not mind.
pub const WATCHDOG_SAMPLES: u32 = 50;
/// Mean error that is no error of tracking any more.
pub const FOLLOWING_SHARE: f32 = 0.25;

/// What the monitor has to know of a table and a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Monitor {
    jump_codes: i32,
    stuck_v: f32,
    swing_um: f32,
    swing_samples: u16,
    following_um: f32,
    disagreement_v: f32,
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
    /// Largest change of the command in one sample, volts.
    pub change_v: f32,
}

/// What the monitor remembers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MonitorState {
    code: u16,
    seen: bool,
    railed: u16,
    same: u16,
    lowest_v: f32,
    highest_v: f32,
    saturated: u16,
    swings: u8,
    since_crossing: u16,
    extreme_um: f32,
    mean_um: f32,
    late: u8,
}

/// What a tick has seen and done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// The sensor's code.
    pub code: u16,
    /// Reference, micrometres.
    pub reference_um: f32,
    /// Measured position, micrometres.
    pub measured_um: f32,
    /// Command, volts.
    pub command_v: f32,
    /// Whether the limiter changed it.
    pub limited: bool,
    /// The integral beside an inverse, volts; 0 without one or the other.
    pub feedback_v: f32,
}

impl Monitor {
    /// Limits for a table; `half_period` is that of the reference's highest frequency, samples.
    pub fn new(scales: &Scales, half_period: u32) -> Self {
        let jump_um = OVERSHOOT * scales.change_v / scales.slopes_v_per_um[0];
        // The error of a reference has its harmonics, of which the third is the largest; a swing has to be faster than the fourth.
        let fastest = (half_period / 4).min(u32::from(SWING_SAMPLES)) as u16;
        Self {
            jump_codes: (jump_um / scales.um_per_code + NOISE_CODES) as i32,
            stuck_v: STUCK_CODES * scales.um_per_code * scales.slopes_v_per_um[1],
            swing_um: SWING_SHARE * scales.range_um,
            swing_samples: fastest,
            following_um: FOLLOWING_SHARE * scales.range_um,
            disagreement_v: DISAGREEMENT_SHARE * scales.span_v,
        }
    }

    /// Largest change of the sensor's code that is no jump.
    pub fn jump_codes(&self) -> i32 {
        self.jump_codes
    }

    /// The sensor, whatever the loop does.
    ///
    /// # Cost
    /// About 20 instructions.
    #[inline(always)]
    pub fn sensor(&self, state: &mut MonitorState, code: u16, command_v: f32) -> Option<Fault> {
        let moved = i32::from(code) - i32::from(state.code);
        let jumped = state.seen && (moved > self.jump_codes || moved < -self.jump_codes);
        if moved == 0 && state.seen {
            state.same = state.same.saturating_add(1);
            state.lowest_v = if command_v < state.lowest_v {
                command_v
            } else {
                state.lowest_v
            };
            state.highest_v = if command_v > state.highest_v {
                command_v
            } else {
                state.highest_v
            };
        } else {
            state.same = 1;
            state.lowest_v = command_v;
            state.highest_v = command_v;
        }
        (state.code, state.seen) = (code, true);
        state.railed = if code < RAIL_CODES || code > u16::MAX - RAIL_CODES {
            state.railed.saturating_add(1)
        } else {
            0
        };
        if state.railed >= RAIL_SAMPLES {
            return Some(Fault::SensorRange);
        }
        if jumped {
            return Some(Fault::SensorJump);
        }
        let stuck = state.same >= STUCK_SAMPLES && state.highest_v - state.lowest_v > self.stuck_v;
        stuck.then_some(Fault::SensorStuck)
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
        if tick.feedback_v > self.disagreement_v || tick.feedback_v < -self.disagreement_v {
            return Some(Fault::Disagreement);
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
