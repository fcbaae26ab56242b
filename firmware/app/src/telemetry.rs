//! What a real board sends of every tick, over whatever carries bytes: packets that are found again after a gap.
//!
//! A packet is [`MARK`], its kind, its contents, and a checksum of kind and contents. One that does not fit where it goes is left out
//! as a whole: the numbers of the frames say how many are missing. What a host asks of a board comes the same way, back.
//!
//! Over a network, a host may ask for the samples by UDP: each datagram holds whole packets, and all else stays on the connection.

use crate::axes::two;
use crate::upload::{ANSWER, ANSWER_BYTES};
use crate::wire::{FRAME_BYTES, Frame, HELLO_BYTES, Hello, Input, Order};
use crate::{table, table_y};

/// First byte of a packet.
pub const MARK: u8 = 0xa5;
/// Kind of an [`About`] of the first axis, and of the second.
const ABOUT: u8 = b'A';
const ABOUT_Y: u8 = b'B';
/// Kind of a [`Sample`] of the first axis, and of the second.
const SAMPLE: u8 = b'S';
const SAMPLE_Y: u8 = b'T';
/// Kind of an [`Order`].
const ORDER: u8 = b'O';
/// Kind of a request for samples by UDP.
const SAMPLES_TO: u8 = b'N';
/// Around the contents: mark, kind, checksum.
const AROUND: usize = 4;
/// Letters of a board's name.
const NAME_BYTES: usize = 16;
/// Length of the converters' ranges.
const RANGE_BYTES: usize = 16;
/// Place of the converters' ranges in an [`About`]'s packet, and of the name behind them.
const RANGES: usize = 2 + HELLO_BYTES;
const NAME: usize = RANGES + RANGE_BYTES;
/// Length of an [`About`]'s packet.
pub const ABOUT_BYTES: usize = AROUND + HELLO_BYTES + RANGE_BYTES + NAME_BYTES;
/// Length of a [`Sample`]'s packet: 1.1 MB a second and axis at 50 kHz.
pub const SAMPLE_BYTES: usize = AROUND + FRAME_BYTES + 2;
/// Length of the packet of an [`Order`], and of a request for samples by UDP.
pub const ORDER_BYTES: usize = AROUND + 2;
/// Most bytes of a datagram: 64 samples, which a frame of Ethernet carries.
pub const DATAGRAM_BYTES: usize = 64 * SAMPLE_BYTES;
/// Samples from the [`About`]s of all tables to the next: whoever comes late waits 0.16 s.
pub const SAMPLES_AN_ABOUT: u32 = 8192;

/// A tick: the frame, and the sensor's code that it answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// What the board did.
    pub frame: Frame,
    /// The sensor's code.
    pub adc: u16,
    /// 0 the first axis, 1 the second.
    pub axis: u8,
}

/// Which board with which table sends, and what its codes mean; one for each table in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct About {
    /// The table.
    pub hello: Hello,
    /// Micrometres of the lowest and the highest ADC code.
    pub adc_um: [f32; 2],
    /// Volts of the lowest and the highest DAC code.
    pub dac_v: [f32; 2],
    /// The board, filled up with zeros.
    pub name: [u8; NAME_BYTES],
    /// The axis that the table is of: 0 the first, 1 the second.
    pub axis: u8,
}

/// What is at the beginning of some bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Found {
    /// A sample of [`SAMPLE_BYTES`].
    Sample(Sample),
    /// A description of [`ABOUT_BYTES`].
    About(About),
    /// An order of [`ORDER_BYTES`].
    Order(Order),
    /// A request for samples at this port, of [`ORDER_BYTES`].
    SamplesTo(u16),
    /// What a board says of its slots, of [`ANSWER_BYTES`]: see [`crate::upload::Answer::from_packet`].
    Answer,
    /// Perhaps a packet, once more bytes have come.
    Incomplete,
    /// No packet: look one byte further.
    Nothing,
}

impl Found {
    /// Bytes that are done with: of no packet one, of one that has not ended none.
    pub fn length(&self) -> usize {
        match self {
            Self::Sample(_) => SAMPLE_BYTES,
            Self::About(_) => ABOUT_BYTES,
            Self::Order(_) | Self::SamplesTo(_) => ORDER_BYTES,
            Self::Answer => ANSWER_BYTES,
            Self::Incomplete => 0,
            Self::Nothing => 1,
        }
    }
}

impl About {
    /// Of each table that is compiled in, of a board with one axis.
    pub fn all(board: &str) -> [Self; table::BANKS] {
        let first = Self::of(board);
        table::hellos().map(|hello| first.with(hello))
    }

    /// Of the first of them; the converters of the others are the same.
    pub fn of(board: &str) -> Self {
        let mut name = [0; NAME_BYTES];
        name.iter_mut()
            .zip(board.bytes())
            .for_each(|(place, byte)| *place = byte);
        Self {
            hello: table::hello(),
            adc_um: [table::ADC_MIN_UM, table::ADC_TOP_UM],
            dac_v: [table::DAC_MIN_V, table::DAC_TOP_V],
            name,
            axis: 0,
        }
    }

    /// The same of another table.
    #[must_use]
    pub fn with(self, hello: Hello) -> Self {
        Self { hello, ..self }
    }

    /// Of each table that is compiled in, of a board with both axes: those of the first axis, then those of the second.
    pub fn of_both(board: &str) -> [Self; table::BANKS + table_y::BANKS] {
        let of_x = Self::of(board);
        let of_y = Self {
            adc_um: [table_y::ADC_MIN_UM, table_y::ADC_TOP_UM],
            dac_v: [table_y::DAC_MIN_V, table_y::DAC_TOP_V],
            axis: 1,
            ..of_x
        };
        let mut all = [of_x; table::BANKS + table_y::BANKS];
        all[table::BANKS..].fill(of_y);
        all.iter_mut()
            .zip(two::hellos())
            .for_each(|(place, hello)| *place = place.with(hello));
        all
    }

    /// The board's name; empty where it is no text.
    pub fn board(&self) -> &str {
        let length = self.name.iter().position(|&byte| byte == 0).unwrap_or(NAME_BYTES);
        let letters = self.name.get(..length).unwrap_or(&[]);
        core::str::from_utf8(letters).unwrap_or("")
    }

    /// Its packet.
    #[cold]
    pub fn to_packet(&self) -> [u8; ABOUT_BYTES] {
        let mut packet = [0; ABOUT_BYTES];
        packet[1] = if self.axis == 0 { ABOUT } else { ABOUT_Y };
        packet[2..RANGES].copy_from_slice(&self.hello.to_bytes());
        let numbers = [self.adc_um[0], self.adc_um[1], self.dac_v[0], self.dac_v[1]];
        for (place, number) in packet[RANGES..NAME].chunks_exact_mut(4).zip(numbers) {
            place.copy_from_slice(&number.to_le_bytes());
        }
        packet[NAME..NAME + NAME_BYTES].copy_from_slice(&self.name);
        close(packet)
    }

    fn from_packet(packet: &[u8; ABOUT_BYTES]) -> Option<Self> {
        let number = |i: usize| f32::from_le_bytes(core::array::from_fn(|k| packet[RANGES + 4 * i + k]));
        Some(Self {
            hello: Hello::from_bytes(&core::array::from_fn(|i| packet[2 + i]))?,
            adc_um: [number(0), number(1)],
            dac_v: [number(2), number(3)],
            name: core::array::from_fn(|i| packet[NAME + i]),
            axis: u8::from(packet[1] == ABOUT_Y),
        })
    }
}

impl Sample {
    /// Its packet.
    pub fn to_packet(&self) -> [u8; SAMPLE_BYTES] {
        let mut packet = [0; SAMPLE_BYTES];
        packet[1] = if self.axis == 0 { SAMPLE } else { SAMPLE_Y };
        packet[2..18].copy_from_slice(&self.frame.to_bytes());
        packet[18..20].copy_from_slice(&self.adc.to_le_bytes());
        close(packet)
    }

    fn from_packet(packet: &[u8; SAMPLE_BYTES]) -> Self {
        Self {
            frame: Frame::from_bytes(&core::array::from_fn(|i| packet[2 + i])),
            adc: u16::from_le_bytes([packet[18], packet[19]]),
            axis: u8::from(packet[1] == SAMPLE_Y),
        }
    }
}

/// Looks for a packet at the beginning of some bytes.
pub fn find(bytes: &[u8]) -> Found {
    match (bytes.first(), bytes.get(1)) {
        (None, _) | (Some(&MARK), None) => Found::Incomplete,
        (Some(&MARK), Some(&(SAMPLE | SAMPLE_Y))) => match bytes.first_chunk() {
            None => Found::Incomplete,
            Some(packet) if whole(packet) => Found::Sample(Sample::from_packet(packet)),
            Some(_) => Found::Nothing,
        },
        (Some(&MARK), Some(&(ABOUT | ABOUT_Y))) => match bytes.first_chunk() {
            None => Found::Incomplete,
            Some(packet) if whole(packet) => About::from_packet(packet).map_or(Found::Nothing, Found::About),
            Some(_) => Found::Nothing,
        },
        (Some(&MARK), Some(&ORDER)) => match bytes.first_chunk::<ORDER_BYTES>() {
            None => Found::Incomplete,
            Some(packet) if whole(packet) => Found::Order(Input::from_bytes([0, 0, packet[2], packet[3]]).order),
            Some(_) => Found::Nothing,
        },
        (Some(&MARK), Some(&SAMPLES_TO)) => match bytes.first_chunk::<ORDER_BYTES>() {
            None => Found::Incomplete,
            Some(packet) if whole(packet) => Found::SamplesTo(u16::from_le_bytes([packet[2], packet[3]])),
            Some(_) => Found::Nothing,
        },
        (Some(&MARK), Some(&ANSWER)) => match bytes.first_chunk::<ANSWER_BYTES>() {
            None => Found::Incomplete,
            Some(packet) if whole(packet) => Found::Answer,
            Some(_) => Found::Nothing,
        },
        _ => Found::Nothing,
    }
}

/// What is in some bytes, one after the other, up to the first that has not ended, which is the last.
pub fn all(bytes: &[u8]) -> impl Iterator<Item = Found> {
    let mut left = Some(bytes).filter(|bytes| !bytes.is_empty());
    core::iter::from_fn(move || {
        let bytes = left?;
        let found = find(bytes);
        let rest = bytes.get(found.length()..).unwrap_or_default();
        left = Some(rest).filter(|rest| found != Found::Incomplete && !rest.is_empty());
        Some(found)
    })
}

/// The packet of an order.
pub fn order_packet(order: Order) -> [u8; ORDER_BYTES] {
    let [_, _, number, value] = Input { adc: 0, order }.to_bytes();
    close([MARK, ORDER, number, value, 0, 0])
}

/// The packet that asks for samples by UDP: at this port of whoever is connected, or by the connection itself at port 0.
pub fn samples_to_packet(port: u16) -> [u8; ORDER_BYTES] {
    let [low, high] = port.to_le_bytes();
    close([MARK, SAMPLES_TO, low, high, 0, 0])
}

/// What a host asks of a board at any time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Requested {
    /// Of the loop.
    Order(Order),
    /// Of the network: where the samples go.
    SamplesTo(u16),
}

/// Requests in the bytes that come to a board, whatever is between them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Requests {
    last: [u8; ORDER_BYTES],
}

impl Requests {
    /// One more byte; the request that it completes. Main's alone, and seldom: it stays out of the interrupt's memory.
    #[cold]
    pub fn push(&mut self, byte: u8) -> Option<Requested> {
        self.last.rotate_left(1);
        self.last[ORDER_BYTES - 1] = byte;
        let requested = match find(&self.last) {
            Found::Order(order) => Requested::Order(order),
            Found::SamplesTo(port) => Requested::SamplesTo(port),
            _ => return None,
        };
        self.last = [0; ORDER_BYTES];
        Some(requested)
    }
}

pub(crate) fn close<const L: usize>(mut packet: [u8; L]) -> [u8; L] {
    packet[0] = MARK;
    let sum = checksum(&packet[1..L - 2]).to_le_bytes();
    packet[L - 2..].copy_from_slice(&sum);
    packet
}

pub(crate) fn whole<const L: usize>(packet: &[u8; L]) -> bool {
    checksum(&packet[1..L - 2]).to_le_bytes() == packet[L - 2..]
}

/// What four bits of the checksum's shift register become: multiples of x^16 + x^12 + x^5 + 1.
const NIBBLES: [u16; 16] = {
    let mut table = [0; 16];
    let mut i = 0;
    while i < 16 {
        let mut sum = (i as u16) << 12;
        let mut bit = 0;
        while bit < 4 {
            sum = if sum & 0x8000 == 0 { sum << 1 } else { sum << 1 ^ 0x1021 };
            bit += 1;
        }
        table[i] = sum;
        i += 1;
    }
    table
};

/// CRC-16 of ITU-T V.41's polynomial, from 0xffff on (the catalogue's CRC-16/IBM-3740).
pub fn checksum(bytes: &[u8]) -> u16 {
    let nibble = |sum: u16, four: u8| sum << 4 ^ NIBBLES[usize::from((sum >> 12) as u8 ^ four) & 15];
    bytes
        .iter()
        .fold(0xffff, |sum, &byte| nibble(nibble(sum, byte >> 4), byte & 15))
}
