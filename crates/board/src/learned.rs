//! What a board's law has learned, put together from the bits of its frames.

use hysteron_firmware::learned::{Learned, WORD_TICKS, WORDS, place};
use hysteron_firmware::wire::{Frame, LEARNED};

/// As the last whole words of some frames say, in their order and with gaps or without; none where not all of them came, and of a law
/// that does not learn.
pub(crate) fn learned<'a>(frames: impl IntoIterator<Item = &'a Frame>) -> Option<Learned> {
    let mut words = [None; WORDS];
    let mut bank = None;
    // The bits of a word so far, and the frame that has the next one.
    let (mut word, mut due) = (0, None);
    for frame in frames {
        if bank != Some(frame.bank()) {
            // Another table has another law.
            (words, bank, due) = ([None; WORDS], Some(frame.bank()), None);
        }
        let bit = frame.number % WORD_TICKS;
        if bit == 0 {
            word = 0;
        } else if due != Some(frame.number) {
            due = None;
            continue;
        }
        word |= u32::from(frame.flags & LEARNED != 0) << bit;
        due = Some(frame.number.wrapping_add(1));
        if bit == WORD_TICKS - 1 {
            words[place(frame.number)] = Some(word);
        }
    }
    let [Some(gain), Some(zero), Some(lag), Some(learns)] = words else {
        return None;
    };
    Learned::from_words([gain, zero, lag, learns])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gain 0.03125, zero -0.5 um, lag 0.75 samples, and that it learns.
    const WORDS_AS_THEY_COME: [u32; 4] = [0x3d00_0000, 0xbf00_0000, 0x3f40_0000, 1];
    const LEARNED_OF_THEM: Learned = Learned {
        gain: 0.031_25,
        zero_um: -0.5,
        lag_samples: 0.75,
    };

    fn frame(number: u32) -> Frame {
        let word = WORDS_AS_THEY_COME[(number / 32 % 4) as usize];
        let bit = (word >> (number % 32) & 1) as u16;
        Frame {
            number,
            reference_um: 0.0,
            command_v: 0.0,
            dac: 0,
            flags: bit << 3,
        }
    }

    fn of(numbers: impl IntoIterator<Item = u32>) -> Option<Learned> {
        learned(&numbers.into_iter().map(frame).collect::<Vec<_>>())
    }

    /// Four words of 32 bits, wherever one begins to listen and over the counter's end; one tick less does not do.
    #[test]
    fn val_words_come_back() {
        assert_eq!(of(0..128), Some(LEARNED_OF_THEM));
        assert_eq!(of(0..127), None);
        assert_eq!(of(32..160), Some(LEARNED_OF_THEM));
        assert_eq!(of(1..128), None, "the gain's lowest bit is missing");
        assert_eq!(of(1..160), Some(LEARNED_OF_THEM));
        assert_eq!(of((u32::MAX - 63..=u32::MAX).chain(0..64)), Some(LEARNED_OF_THEM));
    }

    /// A word with a tick missing is none, however many are; the others stay, and the next time it comes whole.
    #[test]
    fn val_a_gap_costs_the_words_that_it_is_in() {
        for (from, to) in [(40, 41), (33, 64), (40, 72), (40, 168)] {
            let before = (0..from).chain(to..to.max(128));
            assert_eq!(of(before.clone()), None, "{from} {to}");
            assert_eq!(of(before.chain(to.max(128)..320)), Some(LEARNED_OF_THEM), "{from} {to}");
        }
    }

    /// Words of another table are none of this one's.
    #[test]
    fn val_another_table_begins_anew() {
        let other = |number| Frame {
            flags: frame(number).flags | 1 << 13,
            ..frame(number)
        };
        let frames: Vec<Frame> = (0..96).map(frame).chain((96..128).map(other)).collect();
        assert_eq!(learned(&frames), None);
        let frames: Vec<Frame> = frames.into_iter().chain((128..224).map(other)).collect();
        assert_eq!(learned(&frames), Some(LEARNED_OF_THEM));
    }
}
