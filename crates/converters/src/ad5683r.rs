//! Analog Devices AD5683R, a 16-bit DAC on SPI (data sheet rev. D).

use crate::Selected;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use hysteron_core::codes::DacCode;

/// Bits of a word, "Serial Interface".
pub const WORD_BITS: u32 = 24;
/// Fastest bus: a period of SCLK of 20 ns at least (timing characteristics, 2.7 V and above).
pub const MOST_HZ: u32 = 50_000_000;
/// LDAC low, at least: 15 ns and a margin (timing characteristics, "LDAC pulse width low").
pub const LDAC_LOW_NS: u32 = 50;
/// SYNC high between two words, at least: 20 ns (timing characteristics, t8).
pub const SYNC_HIGH_NS: u32 = 20;
/// SCLK rests low: data change at the rising edge and are taken at the falling one (its timing diagram), which is mode 1.
pub const CLOCK_POLARITY: bool = false;
/// The second edge takes the data.
pub const CLOCK_PHASE: bool = true;

/// What it holds once its power has come: zero scale ("Power-On Reset").
pub const POWER_ON: DacCode = DacCode(0);

/// When a code of the input register reaches the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Update {
    /// With the word, whatever LDAC is.
    AtOnce,
    /// At the next fall of LDAC; at once while it is low.
    ByLdac,
}

impl Update {
    /// Command 3 writes input register and output, command 1 the input register ("Command Definitions").
    const fn command(self) -> u8 {
        match self {
            Self::AtOnce => 0b0011,
            Self::ByLdac => 0b0001,
        }
    }
}

/// Command 5: the next word from SDO is the input register's. Not all models have that pin.
const READ_BACK: u8 = 0b0101;

/// What asks a converter for its code.
pub const ASK: [u8; 3] = [READ_BACK << 4, 0, 0];
/// What a converter is sent while it answers: no operation.
pub const WHILE_IT_ANSWERS: [u8; 3] = [0; 3];

/// The code of an answer, which lies as in a word that writes it.
pub const fn answered(answer: [u8; 3]) -> DacCode {
    let [high, middle, low] = answer;
    DacCode(u16::from_be_bytes([high << 4 | middle >> 4, middle << 4 | low >> 4]))
}

/// The 24 bits of a code: command, code, four that do not matter ("Input Shift Register").
#[inline(always)]
pub const fn word(code: DacCode, update: Update) -> [u8; 3] {
    let [high, low] = code.0.to_be_bytes();
    [update.command() << 4 | high >> 4, high << 4 | low >> 4, low << 4]
}

/// The converters of `N` axes on one bus: mode 1, at most [`MOST_HZ`].
pub struct Ad5683r<B, P, const N: usize> {
    bus: B,
    syncs: [P; N],
}

impl<B: SpiBus, P: OutputPin, const N: usize> Ad5683r<B, P, N> {
    /// Takes the bus and each converter's SYNC, which is low while a word is written to it.
    pub fn new(bus: B, syncs: [P; N]) -> Self {
        Self { bus, syncs }
    }

    /// Writes the outputs' codes, one after the other.
    ///
    /// # Errors
    /// What the bus says.
    #[inline(always)]
    pub fn set(&mut self, codes: [DacCode; N], update: Update) -> Result<(), B::Error> {
        for (sync, code) in self.syncs.iter_mut().zip(codes) {
            let _selected = Selected::new(sync);
            self.bus.write(&word(code, update))?;
            self.bus.flush()?;
        }
        Ok(())
    }
}

/// The codes that converters hold, by a bus that reads their SDO, one after the other.
///
/// # Errors
/// What the bus says.
pub fn held<B: SpiBus, P: OutputPin, const N: usize>(
    bus: &mut B,
    syncs: &mut [P; N],
) -> Result<[DacCode; N], B::Error> {
    let mut codes = [DacCode(0); N];
    for (sync, code) in syncs.iter_mut().zip(&mut codes) {
        let mut answer = [0; 3];
        for word in [ASK, WHILE_IT_ANSWERS] {
            let _selected = Selected::new(sync);
            bus.transfer(&mut answer, &word)?;
            bus.flush()?;
        }
        *code = answered(answer);
    }
    Ok(codes)
}
