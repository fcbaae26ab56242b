//! What board and host say to each other, little-endian: hello, setup, then a code and a frame a tick, then a summary.

use crate::monitor::Fault;
use crate::trajectory::Shape;
use hysteron_slot::Numbers;

/// First bytes of a hello; another version has others.
pub const MAGIC: [u8; 8] = *b"HYSTERN9";
/// Bit of [`Frame::flags`]: the limiter changed the command.
pub const LIMITED: u16 = 1;
/// Bit of [`Frame::flags`]: the change that came with this tick is in force.
pub const ACCEPTED: u16 = 2;
/// Bit of [`Frame::flags`]: the change that came with this tick was refused; nothing has changed.
pub const REFUSED: u16 = 4;
/// Bit of [`Frame::flags`]: a bit of what the law has learned, see [`crate::learned`].
pub const LEARNED: u16 = 8;
/// Place of the [`Mode`] in [`Frame::flags`].
const MODE_BIT: u16 = 4;
/// Place of the fault's number in [`Frame::flags`]; five bits.
const FAULT_BIT: u16 = 8;
/// Place of the bank in [`Frame::flags`]; the last three bits.
pub(crate) const BANK_BIT: u16 = 13;
/// Most tables in an image: what three bits can tell apart.
pub const MOST_BANKS: usize = 1 << (16 - BANK_BIT);
/// Length of an input.
pub const INPUT_BYTES: usize = 4;
/// Length of a hello.
pub const HELLO_BYTES: usize = 56;
/// Length of a setup.
pub const SETUP_BYTES: usize = 20;
/// Length of a frame.
pub const FRAME_BYTES: usize = 16;
/// Length of a summary.
pub const SUMMARY_BYTES: usize = 36;

/// What the board says first, once for each table that it holds: which it is, and what the host has to know of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hello {
    /// SHA-256 of the table's file.
    pub hash: [u8; 32],
    /// Rate of the loop.
    pub sample_rate_hz: f32,
    /// Lowest reference.
    pub input_min_um: f32,
    /// Highest reference.
    pub input_max_um: f32,
    /// Which bank the table is in, from 0 on; the board begins with bank 0.
    pub bank: u8,
    /// How many there are; so many hellos come, of each axis.
    pub banks: u8,
    /// How many axes the image has.
    pub axes: u8,
    /// Whether one of its laws is a complete one, and not the paper's: a tick takes longer.
    pub complete: bool,
}

/// What the host asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Ticks to run; 0 ends the image.
    pub ticks: u32,
    /// What a period of the reference looks like.
    pub shape: Shape,
    /// Turns a tick of the reference, in 2^-32.
    pub phase_step: u32,
    /// Lowest reference.
    pub low_um: f32,
    /// Highest reference.
    pub high_um: f32,
    /// Whether the inverse runs.
    pub feedforward: bool,
    /// Whether the PI controller runs.
    pub feedback: bool,
    /// Whether each tick waits for the sample clock. Without it ticks follow each other at once, for tests of what they compute.
    pub clocked: bool,
}

/// What the host asks of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Order {
    /// Go on.
    #[default]
    None,
    /// Rise from the safe level and run; not while a fault is latched.
    Start,
    /// Fall to the safe level.
    Stop,
    /// Forget the latched fault, once at the safe level.
    Clear,
    /// One more byte of a change, see [`crate::tuning`].
    Byte(u8),
    /// The change of this number is complete: put it in force, and say so in this tick's frame.
    Apply(u8),
    /// Where there are two axes, the changes from here on are for the first (1), for the second (2), or again for both (0).
    To(u8),
    /// For tests of the counters: hold this tick up while so many edges of the sample clock come.
    Stall(u8),
    /// For tests of the watchdog: never come back from this tick.
    Hang,
}

/// What a tick gets: the position's code and an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Input {
    /// The sensor's code.
    pub adc: u16,
    /// What is asked for.
    pub order: Order,
}

/// What the controller is at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// At the safe level.
    Off = 0,
    /// On the ramp to the trajectory's first value.
    Rising = 1,
    /// The loop runs.
    Running = 2,
    /// On the ramp to the safe level.
    Falling = 3,
}

/// What the board did in one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Number of the tick, from 0.
    pub number: u32,
    /// Reference.
    pub reference_um: f32,
    /// Command before the converter.
    pub command_v: f32,
    /// The converter's code.
    pub dac: u16,
    /// [`LIMITED`], [`ACCEPTED`], [`REFUSED`], [`LEARNED`], [`Frame::mode`], [`Frame::fault`] and [`Frame::bank`].
    pub flags: u16,
}

/// A frame's flags.
pub fn flags(limited: bool, mode: Mode, fault: Option<Fault>) -> u16 {
    let fault = fault.map_or(0, |fault| fault as u16);
    (if limited { LIMITED } else { 0 }) | ((mode as u16) << MODE_BIT) | (fault << FAULT_BIT)
}

/// What the board says last. Times in periods of the sample timer's clock.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Summary {
    /// Ticks at whose end the next one was already due.
    pub overruns: u32,
    /// Edges of the sample clock that no tick belongs to, by a second counter.
    pub lost: u32,
    /// Shortest time from the sample clock to the interrupt's first statement.
    pub latency_min: u32,
    /// Longest.
    pub latency_max: u32,
    /// Shortest time of a tick without the exchange with the host.
    pub tick_min: u32,
    /// Longest.
    pub tick_max: u32,
    /// Longest but for those that start a run.
    pub running_max: u32,
    /// Sum over all ticks.
    pub tick_sum: u64,
}

impl Hello {
    /// Of a table in an image of one axis.
    pub fn of<const N: usize>(table: &Numbers<N>, hash: [u8; 32], bank: u8, banks: usize) -> Self {
        Self {
            hash,
            sample_rate_hz: table.sample_rate_hz as f32,
            input_min_um: table.input_min_um as f32,
            input_max_um: table.input_max_um as f32,
            bank,
            banks: banks as u8,
            axes: 1,
            complete: table.chain.is_some(),
        }
    }

    /// The same of a table in an image of both axes.
    #[must_use]
    pub fn of_both(self, complete: bool) -> Self {
        Self {
            axes: 2,
            complete,
            ..self
        }
    }

    /// As bytes.
    pub fn to_bytes(&self) -> [u8; HELLO_BYTES] {
        let mut bytes = [0; HELLO_BYTES];
        bytes[..8].copy_from_slice(&MAGIC);
        bytes[8..40].copy_from_slice(&self.hash);
        bytes[40..44].copy_from_slice(&self.sample_rate_hz.to_le_bytes());
        bytes[44..48].copy_from_slice(&self.input_min_um.to_le_bytes());
        bytes[48..52].copy_from_slice(&self.input_max_um.to_le_bytes());
        bytes[52] = self.bank;
        bytes[53] = self.banks;
        bytes[54] = self.axes;
        bytes[55] = u8::from(self.complete);
        bytes
    }

    /// From bytes; `None` where they do not begin with [`MAGIC`].
    pub fn from_bytes(bytes: &[u8; HELLO_BYTES]) -> Option<Self> {
        let hash = core::array::from_fn(|i| bytes[8 + i]);
        bytes.starts_with(&MAGIC).then(|| Self {
            hash,
            sample_rate_hz: f32::from_le_bytes(word(bytes, 40)),
            input_min_um: f32::from_le_bytes(word(bytes, 44)),
            input_max_um: f32::from_le_bytes(word(bytes, 48)),
            bank: bytes[52],
            banks: bytes[53],
            axes: bytes[54],
            complete: bytes[55] != 0,
        })
    }
}

impl Setup {
    /// Frequency of the reference, hertz.
    pub fn frequency_hz(&self, sample_rate_hz: f32) -> f32 {
        self.phase_step as f32 * (sample_rate_hz / 4_294_967_296.0)
    }

    /// Samples in half a period of the reference's highest harmonic; the largest number where it stands still.
    pub fn half_period(&self) -> u32 {
        let half = (1_u32 << 31).checked_div(self.phase_step).unwrap_or(u32::MAX);
        half / self.shape.highest_harmonic()
    }

    /// As bytes.
    pub fn to_bytes(&self) -> [u8; SETUP_BYTES] {
        let mut bytes = [0; SETUP_BYTES];
        bytes[..4].copy_from_slice(&self.ticks.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.phase_step.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.low_um.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.high_um.to_le_bytes());
        bytes[16] = u8::from(self.feedforward);
        bytes[17] = u8::from(self.feedback);
        bytes[18] = self.shape as u8;
        bytes[19] = u8::from(self.clocked);
        bytes
    }

    /// From bytes; a shape that is none counts as a sine.
    pub fn from_bytes(bytes: &[u8; SETUP_BYTES]) -> Self {
        Self {
            ticks: u32::from_le_bytes(word(bytes, 0)),
            phase_step: u32::from_le_bytes(word(bytes, 4)),
            low_um: f32::from_le_bytes(word(bytes, 8)),
            high_um: f32::from_le_bytes(word(bytes, 12)),
            feedforward: bytes[16] != 0,
            feedback: bytes[17] != 0,
            clocked: bytes[19] != 0,
            shape: Shape::from_code(bytes[18]).unwrap_or_default(),
        }
    }
}

impl Input {
    /// As bytes.
    pub fn to_bytes(&self) -> [u8; INPUT_BYTES] {
        let (order, value) = match self.order {
            Order::None => (0, 0),
            Order::Start => (1, 0),
            Order::Stop => (2, 0),
            Order::Clear => (3, 0),
            Order::Stall(edges) => (4, edges),
            Order::Hang => (5, 0),
            Order::Byte(byte) => (6, byte),
            Order::Apply(kind) => (7, kind),
            Order::To(axis) => (8, axis),
        };
        let [low, high] = self.adc.to_le_bytes();
        [low, high, order, value]
    }

    /// From bytes; an order that is none counts as none.
    #[inline(always)]
    pub fn from_bytes(bytes: [u8; INPUT_BYTES]) -> Self {
        let [low, high, order, value] = bytes;
        let order = match order {
            1 => Order::Start,
            2 => Order::Stop,
            3 => Order::Clear,
            4 => Order::Stall(value),
            5 => Order::Hang,
            6 => Order::Byte(value),
            7 => Order::Apply(value),
            8 => Order::To(value),
            _ => Order::None,
        };
        Self {
            adc: u16::from_le_bytes([low, high]),
            order,
        }
    }
}

impl Frame {
    /// What the controller was at.
    pub fn mode(&self) -> Mode {
        match (self.flags >> MODE_BIT) & 3 {
            1 => Mode::Rising,
            2 => Mode::Running,
            3 => Mode::Falling,
            _ => Mode::Off,
        }
    }

    /// The latched fault.
    pub fn fault(&self) -> Option<Fault> {
        Fault::from_code((self.flags >> FAULT_BIT) as u8 & 31)
    }

    /// The bank of the table that is in force.
    pub fn bank(&self) -> u8 {
        (self.flags >> BANK_BIT) as u8
    }

    /// As bytes.
    pub fn to_bytes(&self) -> [u8; FRAME_BYTES] {
        let mut bytes = [0; FRAME_BYTES];
        bytes[..4].copy_from_slice(&self.number.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.reference_um.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.command_v.to_le_bytes());
        bytes[12..14].copy_from_slice(&self.dac.to_le_bytes());
        bytes[14..].copy_from_slice(&self.flags.to_le_bytes());
        bytes
    }

    /// From bytes.
    pub fn from_bytes(bytes: &[u8; FRAME_BYTES]) -> Self {
        Self {
            number: u32::from_le_bytes(word(bytes, 0)),
            reference_um: f32::from_le_bytes(word(bytes, 4)),
            command_v: f32::from_le_bytes(word(bytes, 8)),
            dac: u16::from_le_bytes([bytes[12], bytes[13]]),
            flags: u16::from_le_bytes([bytes[14], bytes[15]]),
        }
    }
}

impl Summary {
    /// As bytes.
    pub fn to_bytes(&self) -> [u8; SUMMARY_BYTES] {
        let mut bytes = [0; SUMMARY_BYTES];
        let words = [
            self.overruns,
            self.lost,
            self.latency_min,
            self.latency_max,
            self.tick_min,
            self.tick_max,
            self.running_max,
        ];
        for (place, value) in bytes.chunks_exact_mut(4).zip(words) {
            place.copy_from_slice(&value.to_le_bytes());
        }
        bytes[28..].copy_from_slice(&self.tick_sum.to_le_bytes());
        bytes
    }

    /// From bytes.
    pub fn from_bytes(bytes: &[u8; SUMMARY_BYTES]) -> Self {
        let at = |place| u32::from_le_bytes(word(bytes, place));
        Self {
            overruns: at(0),
            lost: at(4),
            latency_min: at(8),
            latency_max: at(12),
            tick_min: at(16),
            tick_max: at(20),
            running_max: at(24),
            tick_sum: u64::from(at(28)) | u64::from(at(32)) << 32,
        }
    }
}

fn word<const L: usize>(bytes: &[u8; L], place: usize) -> [u8; 4] {
    core::array::from_fn(|i| bytes[place + i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_everything_comes_back() {
        let hello = Hello {
            hash: core::array::from_fn(|i| i as u8),
            sample_rate_hz: 5e4,
            input_min_um: -1.5,
            input_max_um: 2.5,
            bank: 2,
            banks: 3,
            axes: 2,
            complete: true,
        };
        assert_eq!(Hello::from_bytes(&hello.to_bytes()), Some(hello));
        assert_eq!(Hello::from_bytes(&[0; HELLO_BYTES]), None);
        let setup = Setup {
            ticks: 7,
            shape: Shape::Triangle,
            phase_step: 1 << 31,
            low_um: -0.5,
            high_um: 2.5,
            feedforward: true,
            feedback: false,
            clocked: true,
        };
        assert_eq!(Setup::from_bytes(&setup.to_bytes()), setup);
        let frame = Frame {
            number: 9,
            reference_um: 1.25,
            command_v: -3.5,
            dac: 0xfedc,
            flags: 1,
        };
        assert_eq!(Frame::from_bytes(&frame.to_bytes()), frame);
        assert_eq!((frame.mode(), frame.fault()), (Mode::Off, None));
        for (bank, fault) in (0..MOST_BANKS as u16).zip(Fault::ALL.into_iter().rev()) {
            let flags = flags(true, Mode::Falling, Some(fault)) | bank << BANK_BIT;
            let frame = Frame { flags, ..frame };
            assert_eq!((frame.mode(), frame.fault()), (Mode::Falling, Some(fault)));
            assert_eq!(u16::from(frame.bank()), bank);
        }
        let orders = [
            Order::None,
            Order::Start,
            Order::Stop,
            Order::Clear,
            Order::Stall(7),
            Order::Hang,
            Order::Byte(0xfe),
            Order::Apply(1),
            Order::To(2),
        ];
        for order in orders {
            let input = Input { adc: 0xabcd, order };
            assert_eq!(Input::from_bytes(input.to_bytes()), input);
        }
        let summary = Summary {
            overruns: 1,
            lost: 8,
            latency_min: 2,
            latency_max: 3,
            tick_min: 4,
            tick_max: 5,
            running_max: 9,
            tick_sum: (6 << 32) + 7,
        };
        assert_eq!(Summary::from_bytes(&summary.to_bytes()), summary);
    }
}
