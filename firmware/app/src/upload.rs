//! A table that comes to a board in pieces, and what the board says to each: packets as those of [`crate::telemetry`].
//!
//! The host asks ([`Message`]), the board answers each ([`Answer`]). A piece that is not the one that is due changes nothing, and the
//! answer says which is: whatever is lost or comes twice, host and board go on from there.

use crate::telemetry::{MARK, close, whole};
use core::fmt::{self, Display, Formatter};
use hysteron_slot::{Refusal, Rule, sum};

/// Kind of a [`Message`]'s packet.
pub(crate) const MESSAGE: u8 = b'U';
/// Kind of an [`Answer`]'s packet.
pub(crate) const ANSWER: u8 = b'V';
/// Bytes of a table in a piece.
pub const PIECE_BYTES: usize = 32;
/// Length of a [`Message`]'s packet: mark and kind, what it is, place, a piece, checksum.
pub const MESSAGE_BYTES: usize = 2 + 1 + 4 + PIECE_BYTES + 2;
/// Room for names in an answer: the longest list of fields, and the longest parameter of the core.
const FIELD_BYTES: usize = 96;
const AGAINST_BYTES: usize = 48;
/// Length of an [`Answer`]'s packet.
pub const ANSWER_BYTES: usize = 2 + 2 + 4 + 1 + 2 + 8 + 24 + FIELD_BYTES + AGAINST_BYTES + 2;

/// What the host asks of a board's slots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    /// What each slot holds.
    Ask,
    /// A table of so many bytes with this CRC-32 of them will come.
    Begin {
        /// Bytes.
        length: u32,
        /// Their sum.
        sum: u32,
    },
    /// Bytes from a place on; behind the table's end they are of no meaning.
    Piece {
        /// The first one's place.
        place: u32,
        /// The bytes.
        bytes: [u8; PIECE_BYTES],
    },
    /// That was all of it: check it, and write it to the slot that is not in use.
    Commit,
    /// Start anew, with the newest table.
    Restart,
}

/// What the board says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer<'a> {
    /// To what.
    pub to: Said,
    /// The byte that is due, the sequence of a table, or the slot's own.
    pub number: u32,
    /// Why not; none where it is well.
    pub refused: Option<Refusal<'a>>,
}

/// What an [`Answer`] is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Said {
    /// A piece, or the beginning: the byte that is due.
    Due,
    /// The table as a whole: its sequence, in the first slot or the second.
    Taken(u8),
    /// What a start has found in a slot: the sequence of the table that runs, or why it does not.
    Slot(u8),
    /// The board starts anew.
    Restarting,
}

impl Message {
    /// Its packet.
    pub fn to_packet(&self) -> [u8; MESSAGE_BYTES] {
        let mut packet = [0; MESSAGE_BYTES];
        let (kind, place, piece) = match *self {
            Self::Ask => (0, 0, [0; PIECE_BYTES]),
            Self::Begin { length, sum } => {
                let mut piece = [0; PIECE_BYTES];
                piece[..4].copy_from_slice(&sum.to_le_bytes());
                (1, length, piece)
            }
            Self::Piece { place, bytes } => (2, place, bytes),
            Self::Commit => (3, 0, [0; PIECE_BYTES]),
            Self::Restart => (4, 0, [0; PIECE_BYTES]),
        };
        packet[1] = MESSAGE;
        packet[2] = kind;
        packet[3..7].copy_from_slice(&place.to_le_bytes());
        packet[7..7 + PIECE_BYTES].copy_from_slice(&piece);
        close(packet)
    }

    pub(crate) fn from_packet(packet: &[u8; MESSAGE_BYTES]) -> Option<Self> {
        let place = u32::from_le_bytes([packet[3], packet[4], packet[5], packet[6]]);
        let bytes: [u8; PIECE_BYTES] = core::array::from_fn(|i| packet[7 + i]);
        match packet[2] {
            0 => Some(Self::Ask),
            1 => Some(Self::Begin {
                length: place,
                sum: u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
            }),
            2 => Some(Self::Piece { place, bytes }),
            3 => Some(Self::Commit),
            4 => Some(Self::Restart),
            _ => None,
        }
    }
}

/// Messages in the bytes that come to a board, whatever is between them. A byte of anything else costs a comparison: main reads orders as
/// well, one a tick.
#[derive(Debug, Clone, Copy)]
pub struct Messages {
    bytes: [u8; MESSAGE_BYTES],
    length: usize,
}

impl Default for Messages {
    fn default() -> Self {
        Self {
            bytes: [0; MESSAGE_BYTES],
            length: 0,
        }
    }
}

impl Messages {
    /// One more byte; the message that it completes.
    #[inline(always)]
    pub fn push(&mut self, byte: u8) -> Option<Message> {
        let wrong = match self.length {
            0 => byte != MARK,
            1 => byte != MESSAGE,
            _ => false,
        };
        if wrong {
            self.length = usize::from(byte == MARK);
            return None;
        }
        self.put(byte)
    }

    #[inline(never)]
    fn put(&mut self, byte: u8) -> Option<Message> {
        if let Some(place) = self.bytes.get_mut(self.length) {
            *place = byte;
        }
        self.length += 1;
        if self.length < MESSAGE_BYTES {
            return None;
        }
        if whole(&self.bytes) {
            self.length = 0;
            return Message::from_packet(&self.bytes);
        }
        // One may have begun in what was none.
        let marks = self.bytes.windows(2).skip(1).position(|pair| pair == [MARK, MESSAGE]);
        let begun = marks.map_or(MESSAGE_BYTES, |place| place + 1);
        self.bytes.rotate_left(begun % MESSAGE_BYTES);
        self.length = MESSAGE_BYTES - begun;
        None
    }
}

/// No rule: nothing is refused.
const NO_RULE: u8 = 0xff;

impl<'a> Answer<'a> {
    /// Its packet.
    #[cold]
    pub fn to_packet(&self) -> [u8; ANSWER_BYTES] {
        let mut packet = [0; ANSWER_BYTES];
        let (to, slot) = match self.to {
            Said::Due => (0, 0),
            Said::Taken(slot) => (1, slot),
            Said::Slot(slot) => (2, slot),
            Said::Restarting => (3, 0),
        };
        packet[1] = ANSWER;
        packet[2] = to;
        packet[3] = slot;
        packet[4..8].copy_from_slice(&self.number.to_le_bytes());
        packet[8] = NO_RULE;
        if let Some(refused) = &self.refused {
            packet[8] = refused.rule as u8;
            packet[9..11].copy_from_slice(&refused.index.to_le_bytes());
            let numbers = [
                refused.value,
                refused.allowed[0],
                refused.allowed[1],
                refused.allowed[2],
            ];
            for (place, number) in packet[11..43].chunks_exact_mut(8).zip(numbers) {
                place.copy_from_slice(&number.to_le_bytes());
            }
            let names = packet[43..43 + FIELD_BYTES].iter_mut();
            names.zip(refused.field.bytes()).for_each(|(place, byte)| *place = byte);
            let against = packet[43 + FIELD_BYTES..ANSWER_BYTES - 2].iter_mut();
            against
                .zip(refused.against.bytes())
                .for_each(|(place, byte)| *place = byte);
        }
        close(packet)
    }

    /// From a packet that is whole; none where it is no answer of this version.
    pub fn from_packet(packet: &'a [u8; ANSWER_BYTES]) -> Option<Self> {
        let to = match packet[2] {
            0 => Said::Due,
            1 => Said::Taken(packet[3]),
            2 => Said::Slot(packet[3]),
            3 => Said::Restarting,
            _ => return None,
        };
        let number = |i: usize| f64::from_le_bytes(core::array::from_fn(|k| packet[11 + 8 * i + k]));
        let refused = match packet[8] {
            NO_RULE => None,
            rule => Some(Refusal {
                rule: *Rule::ALL.get(usize::from(rule))?,
                index: u16::from_le_bytes([packet[9], packet[10]]),
                value: number(0),
                allowed: [number(1), number(2), number(3)],
                field: text(&packet[43..43 + FIELD_BYTES])?,
                against: text(&packet[43 + FIELD_BYTES..ANSWER_BYTES - 2])?,
            }),
        };
        Some(Self {
            to,
            number: u32::from_le_bytes([packet[4], packet[5], packet[6], packet[7]]),
            refused,
        })
    }
}

/// Text that is filled up with zeros.
fn text(bytes: &[u8]) -> Option<&str> {
    let length = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    core::str::from_utf8(bytes.get(..length)?).ok()
}

impl Display for Answer<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match (self.to, self.refused) {
            (Said::Slot(slot), Some(refused)) => write!(f, "slot {slot}: {refused}"),
            (Said::Slot(slot), None) => write!(f, "slot {slot}: table {} runs", self.number),
            (Said::Taken(_), Some(refused)) => write!(f, "refused: {refused}"),
            (Said::Taken(slot), None) => write!(f, "taken: table {} in slot {slot}", self.number),
            (Said::Due, Some(refused)) => write!(f, "refused: {refused}"),
            (Said::Due, None) => write!(f, "byte {} is due", self.number),
            (Said::Restarting, Some(refused)) => write!(f, "not restarted: {refused}"),
            (Said::Restarting, None) => f.write_str("restarting"),
        }
    }
}

/// A table on its way: `B` bytes of room.
#[derive(Debug, Clone)]
pub struct Upload<const B: usize> {
    bytes: [u8; B],
    length: usize,
    sum: u32,
    due: usize,
}

impl<const B: usize> Default for Upload<B> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const B: usize> Upload<B> {
    /// None.
    pub const fn new() -> Self {
        Self {
            bytes: [0; B],
            length: 0,
            sum: 0,
            due: 0,
        }
    }

    /// Begins anew.
    ///
    /// # Errors
    /// More bytes than there is room for.
    pub fn begin(&mut self, length: u32, sum: u32) -> Result<u32, Refusal<'static>> {
        self.length = 0;
        self.due = 0;
        if length as usize > B {
            let refused = Refusal::new(Rule::Length, "length", f64::from(length));
            return Err(refused.allowed([B as f64, B as f64, 0.0]));
        }
        self.length = length as usize;
        self.sum = sum;
        Ok(0)
    }

    /// Takes the piece that is due; the place of the next one.
    pub fn piece(&mut self, place: u32, piece: &[u8; PIECE_BYTES]) -> u32 {
        if place as usize == self.due {
            let end = (self.due + PIECE_BYTES).min(self.length);
            if let Some(places) = self.bytes.get_mut(self.due..end) {
                places.iter_mut().zip(piece).for_each(|(place, byte)| *place = *byte);
                self.due = end;
            }
        }
        self.due as u32
    }

    /// The table, once all of it is here as it was sent, with all of the room.
    ///
    /// # Errors
    /// Bytes that are missing, another sum than the host's.
    pub fn whole(&mut self) -> Result<&mut [u8], Refusal<'static>> {
        if self.due < self.length || self.length == 0 {
            let refused = Refusal::new(Rule::Place, "place", self.length as f64);
            return Err(refused.allowed([self.due as f64, 0.0, 0.0]));
        }
        let found = sum(self.bytes.get(..self.length).unwrap_or(&[]));
        if found != self.sum {
            let refused = Refusal::new(Rule::Sum, "crc32", f64::from(self.sum));
            return Err(refused.allowed([f64::from(found), 0.0, 0.0]));
        }
        Ok(&mut self.bytes)
    }

    /// All of the room, for the slots at a start.
    pub fn room(&mut self) -> &mut [u8] {
        &mut self.bytes
    }
}
