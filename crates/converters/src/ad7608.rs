//! Analog Devices AD7608, eight channels of 18 bits that are sampled at one instant (data sheet rev. A), read by DOUTA alone.
//!
//! Its inputs take +-10 V or +-5 V by a pin, and have a filter of second order before them: 23 kHz or 15 kHz ("Analog Antialiasing
//! Filter"). That is the sensor's delay of some 10 us, which belongs to what is known of a rig.

use crate::Selected;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use hysteron_core::codes::AdcCode;

/// Fastest bus that every supply of the pins allows (timing characteristics, serial read, VDRIVE above 2.7 V).
pub const MOST_HZ: u32 = 15_000_000;
/// From the rise of CONVST to codes that can be read, without oversampling (timing characteristics, tCONV).
pub const CONVERSION_NS: u32 = 4_200;
/// SCLK rests high, the first edge takes the data: mode 2 ("Serial Interface").
pub const CLOCK_POLARITY: bool = true;
/// The first edge.
pub const CLOCK_PHASE: bool = false;
/// Bits of a code.
const BITS: usize = 18;
/// Channels of the chip.
pub const CHANNELS: usize = 8;
/// Bytes that hold all of them.
const BYTES: usize = (BITS * CHANNELS).div_ceil(8);

/// A code: -131 072 at the lower end of the range, 131 071 at the upper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reading(pub i32);

/// The upper 16 bits, 0 at the lower end.
impl From<Reading> for AdcCode {
    fn from(Reading(code): Reading) -> Self {
        Self((code.wrapping_add(1 << (BITS - 1)) >> 2) as u16)
    }
}

/// The converter.
pub struct Ad7608<B, S, C> {
    bus: B,
    select: S,
    convert: C,
}

impl<B: SpiBus, S: OutputPin, C: OutputPin> Ad7608<B, S, C> {
    /// Takes the bus in mode 2, CS, and CONVST A and B tied together.
    pub fn new(bus: B, select: S, convert: C) -> Self {
        Self { bus, select, convert }
    }

    /// Samples all channels at the rise of CONVST, which a timer's channel may do as well: then a tick only reads.
    pub fn sample(&mut self) {
        let _ = self.convert.set_low();
        let _ = self.convert.set_high();
    }

    /// The codes of the first channels, [`CONVERSION_NS`] after they were sampled or later.
    ///
    /// # Errors
    /// What the bus says.
    pub fn read<const N: usize>(&mut self) -> Result<[Reading; N], B::Error> {
        const { assert!(N > 0 && N <= CHANNELS, "an AD7608 has eight channels") };
        let mut bytes = [0; BYTES];
        let (wanted, _) = bytes.split_at_mut((BITS * N).div_ceil(8));
        let _selected = Selected::new(&mut self.select);
        self.bus.read(wanted)?;
        self.bus.flush()?;
        Ok(core::array::from_fn(|channel| unpacked(&bytes, channel)))
    }
}

/// A channel's code: 18 bits from its place on, the sign first.
fn unpacked(bytes: &[u8; BYTES], channel: usize) -> Reading {
    let place = BITS * channel;
    // From an even bit of a byte on, 18 bits end within three bytes.
    let byte = |i: usize| u32::from(bytes.get(place / 8 + i).copied().unwrap_or(0));
    let three = byte(0) << 16 | byte(1) << 8 | byte(2);
    let code = three << (8 + place % 8) >> (32 - BITS);
    // The sign is bit 17.
    Reading((code << (32 - BITS)) as i32 >> (32 - BITS))
}
