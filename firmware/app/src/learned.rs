//! What a law has learned while it ran, a bit of it in each frame: it changes slowly, and a frame has no room for numbers of it.
//!
//! The frames of 32 ticks carry a word, the lowest bit first; word `number / 32 % 4` is gain, zero, lag, and 1 of a law that learns. So
//! all of it comes every 128 ticks, 2.6 ms at 50 kHz, and a host that has lost frames has the words between.

/// Ticks that carry a word.
pub const WORD_TICKS: u32 = 32;
/// Words of all of it.
pub const WORDS: usize = 4;

/// What a law has learned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learned {
    /// Change of the gain, a share.
    pub gain: f32,
    /// Change of the zero, micrometres.
    pub zero_um: f32,
    /// Change of the lag, samples.
    pub lag_samples: f32,
}

impl Learned {
    /// From its words, as they come; none of a law that does not learn.
    pub fn from_words([gain, zero_um, lag_samples, learns]: [u32; WORDS]) -> Option<Self> {
        (learns == 1).then_some(Self {
            gain: f32::from_bits(gain),
            zero_um: f32::from_bits(zero_um),
            lag_samples: f32::from_bits(lag_samples),
        })
    }
}

/// The word that begins in the frame of a number.
#[inline(always)]
pub(crate) fn word(learned: Option<Learned>, number: u32) -> u32 {
    let Some(learned) = learned else { return 0 };
    match place(number) {
        0 => learned.gain.to_bits(),
        1 => learned.zero_um.to_bits(),
        2 => learned.lag_samples.to_bits(),
        _ => 1,
    }
}

/// Which word the frame of a number carries a bit of.
pub fn place(number: u32) -> usize {
    (number / WORD_TICKS) as usize % WORDS
}
