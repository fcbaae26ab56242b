//! Changes at run time: what a host sends byte by byte, one a tick, and the last of whose ticks acknowledges it.

use crate::trajectory::{CHUNK_POINTS, Shape};
use crate::wire::Order;

/// A change of what the controller does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Change {
    /// Gains of the PI controller, at any time.
    Gains {
        /// K_p, V/um.
        proportional_v_per_um: f32,
        /// K_i, V/(um s).
        integral_v_per_um_s: f32,
    },
    /// Another reference; at the safe level only, since it begins elsewhere.
    Trajectory {
        /// Its shape.
        shape: Shape,
        /// Turns a tick, in 2^-32.
        phase_step: u32,
        /// Lowest position, micrometres.
        low_um: f32,
        /// Highest position, micrometres.
        high_um: f32,
    },
    /// Which parts run; at the safe level only.
    Parts {
        /// The inverse.
        feedforward: bool,
        /// The PI controller.
        feedback: bool,
    },
    /// Points of [`Shape::Table`]; at the safe level only. A table is uploaded in chunks, each with its answer, and then selected.
    Chunk {
        /// Which chunk, from 0 on.
        chunk: u8,
        /// Its points, from 0 at the lowest position to 65535 at the highest.
        shares: [u16; CHUNK_POINTS],
    },
    /// Another of the tables in the image, with the gains that it came with; at the safe level only, since the plays begin anew. Refused
    /// where the reference does not lie in that table's range.
    Bank(u8),
}

/// Longest change.
const MOST_BYTES: usize = 17;

/// The bytes of a change that have come.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mailbox {
    bytes: [u8; MOST_BYTES],
    length: usize,
}

impl Mailbox {
    /// One more byte; those that are too many make the change one that is refused.
    #[inline(always)]
    pub fn push(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(self.length) {
            *place = byte;
        }
        self.length = (self.length + 1).min(MOST_BYTES + 1);
    }

    /// The change of a kind, if the bytes are one; empties the box.
    pub fn take(&mut self, kind: u8) -> Option<Change> {
        let Self { bytes: b, length } = core::mem::take(self);
        let number = |i: usize| f32::from_le_bytes(core::array::from_fn(|k| b.get(i + k).copied().unwrap_or(0)));
        match (kind, length) {
            (0, 8) => Some(Change::Gains {
                proportional_v_per_um: number(0),
                integral_v_per_um_s: number(4),
            }),
            (1, 13) => Some(Change::Trajectory {
                shape: Shape::from_code(b[0])?,
                phase_step: u32::from_le_bytes([b[1], b[2], b[3], b[4]]),
                low_um: number(5),
                high_um: number(9),
            }),
            (2, 2) => Some(Change::Parts {
                feedforward: b[0] != 0,
                feedback: b[1] != 0,
            }),
            (3, 17) => Some(Change::Chunk {
                chunk: b[0],
                shares: core::array::from_fn(|i| {
                    u16::from_le_bytes(core::array::from_fn(|k| b.get(1 + 2 * i + k).copied().unwrap_or(0)))
                }),
            }),
            (4, 1) => Some(Change::Bank(b[0])),
            _ => None,
        }
    }
}

impl Change {
    /// What it is, in words.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Gains { .. } => "other gains",
            Self::Trajectory { .. } => "another reference",
            Self::Parts { .. } => "other parts",
            Self::Chunk { .. } => "points of a reference",
            Self::Bank(_) => "another table",
        }
    }

    /// The orders of the host that make it: the last is [`Order::Apply`], whose tick answers.
    pub fn orders(&self) -> impl Iterator<Item = Order> + use<> {
        let mut bytes = [0; MOST_BYTES];
        let (kind, length) = match *self {
            Self::Gains {
                proportional_v_per_um,
                integral_v_per_um_s,
            } => {
                bytes[..4].copy_from_slice(&proportional_v_per_um.to_le_bytes());
                bytes[4..8].copy_from_slice(&integral_v_per_um_s.to_le_bytes());
                (0, 8)
            }
            Self::Trajectory {
                shape,
                phase_step,
                low_um,
                high_um,
            } => {
                bytes[0] = shape as u8;
                bytes[1..5].copy_from_slice(&phase_step.to_le_bytes());
                bytes[5..9].copy_from_slice(&low_um.to_le_bytes());
                bytes[9..13].copy_from_slice(&high_um.to_le_bytes());
                (1, 13)
            }
            Self::Parts { feedforward, feedback } => {
                bytes[..2].copy_from_slice(&[u8::from(feedforward), u8::from(feedback)]);
                (2, 2)
            }
            Self::Chunk { chunk, shares } => {
                bytes[0] = chunk;
                for (place, share) in bytes[1..].chunks_exact_mut(2).zip(shares) {
                    place.copy_from_slice(&share.to_le_bytes());
                }
                (3, 17)
            }
            Self::Bank(bank) => {
                bytes[0] = bank;
                (4, 1)
            }
        };
        let sent = bytes.into_iter().take(length).map(Order::Byte);
        sent.chain(core::iter::once(Order::Apply(kind)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_changes_come_back_and_rubbish_is_refused() {
        let changes = [
            Change::Gains {
                proportional_v_per_um: 0.5,
                integral_v_per_um_s: 7e3,
            },
            Change::Trajectory {
                shape: Shape::Triangle,
                phase_step: 0x0102_0304,
                low_um: -1.5,
                high_um: 2.25,
            },
            Change::Parts {
                feedforward: true,
                feedback: false,
            },
            Change::Chunk {
                chunk: 31,
                shares: [0, 1, 2, 3, 0x1234, 5, 6, 65_535],
            },
            Change::Bank(5),
        ];
        for change in changes {
            let mut mailbox = Mailbox::default();
            let mut taken = None;
            for order in change.orders() {
                match order {
                    Order::Byte(byte) => mailbox.push(byte),
                    Order::Apply(kind) => taken = mailbox.take(kind),
                    other => panic!("{other:?}"),
                }
            }
            assert_eq!(taken, Some(change));
            assert_eq!(mailbox, Mailbox::default());
        }
        let mut mailbox = Mailbox::default();
        (0..300).for_each(|_| mailbox.push(0));
        assert_eq!(mailbox.take(1), None, "too long");
        assert_eq!(mailbox.take(0), None, "empty");
        (0..13).for_each(|_| mailbox.push(9));
        assert_eq!(mailbox.take(1), None, "no shape 9");
        assert_eq!(mailbox.take(7), None, "no kind 7");
    }
}
