//! What board and host say to each other, little-endian: hello, setup, then a code and a frame a tick, then a summary.

/// First bytes of a hello; another version has others.
pub const MAGIC: [u8; 8] = *b"HYSTERN2";
/// Bit of [`Frame::flags`]: the limiter changed the command.
pub const LIMITED: u16 = 1;
/// Length of a hello.
pub const HELLO_BYTES: usize = 52;
/// Length of a setup.
pub const SETUP_BYTES: usize = 28;
/// Length of a frame.
pub const FRAME_BYTES: usize = 16;
/// Length of a summary.
pub const SUMMARY_BYTES: usize = 32;

/// What the board says first: which table it holds, and what the host has to know of it.
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
}

/// What the host asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Ticks to run.
    pub ticks: u32,
    /// Turns a tick of the sine, in 2^-32.
    pub phase_step: u32,
    /// Lowest reference.
    pub low_um: f32,
    /// Highest reference.
    pub high_um: f32,
    /// Whether the inverse runs.
    pub feedforward: bool,
    /// Whether the PI controller runs.
    pub feedback: bool,
    /// For tests of the counters: every so many ticks one is held up past its deadline; 0 for none.
    pub stall_every: u32,
    /// Edges of the sample clock that come while such a tick is held up.
    pub stall_edges: u32,
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
    /// [`LIMITED`].
    pub flags: u16,
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
    /// Sum over all ticks.
    pub tick_sum: u64,
}

impl Hello {
    /// As bytes.
    pub fn to_bytes(&self) -> [u8; HELLO_BYTES] {
        let mut bytes = [0; HELLO_BYTES];
        bytes[..8].copy_from_slice(&MAGIC);
        bytes[8..40].copy_from_slice(&self.hash);
        bytes[40..44].copy_from_slice(&self.sample_rate_hz.to_le_bytes());
        bytes[44..48].copy_from_slice(&self.input_min_um.to_le_bytes());
        bytes[48..].copy_from_slice(&self.input_max_um.to_le_bytes());
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
        })
    }
}

impl Setup {
    /// Frequency of the sine, hertz.
    pub fn frequency_hz(&self, sample_rate_hz: f32) -> f32 {
        self.phase_step as f32 * (sample_rate_hz / 4_294_967_296.0)
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
        bytes[20..24].copy_from_slice(&self.stall_every.to_le_bytes());
        bytes[24..].copy_from_slice(&self.stall_edges.to_le_bytes());
        bytes
    }

    /// From bytes.
    pub fn from_bytes(bytes: &[u8; SETUP_BYTES]) -> Self {
        Self {
            ticks: u32::from_le_bytes(word(bytes, 0)),
            phase_step: u32::from_le_bytes(word(bytes, 4)),
            low_um: f32::from_le_bytes(word(bytes, 8)),
            high_um: f32::from_le_bytes(word(bytes, 12)),
            feedforward: bytes[16] != 0,
            feedback: bytes[17] != 0,
            stall_every: u32::from_le_bytes(word(bytes, 20)),
            stall_edges: u32::from_le_bytes(word(bytes, 24)),
        }
    }
}

impl Frame {
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
        ];
        for (place, value) in bytes.chunks_exact_mut(4).zip(words) {
            place.copy_from_slice(&value.to_le_bytes());
        }
        bytes[24..].copy_from_slice(&self.tick_sum.to_le_bytes());
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
            tick_sum: u64::from(at(24)) | u64::from(at(28)) << 32,
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
        };
        assert_eq!(Hello::from_bytes(&hello.to_bytes()), Some(hello));
        assert_eq!(Hello::from_bytes(&[0; HELLO_BYTES]), None);
        let setup = Setup {
            ticks: 7,
            phase_step: 1 << 31,
            low_um: -0.5,
            high_um: 2.5,
            feedforward: true,
            feedback: false,
            stall_every: 3,
            stall_edges: 4,
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
        let summary = Summary {
            overruns: 1,
            lost: 8,
            latency_min: 2,
            latency_max: 3,
            tick_min: 4,
            tick_max: 5,
            tick_sum: (6 << 32) + 7,
        };
        assert_eq!(Summary::from_bytes(&summary.to_bytes()), summary);
    }
}
