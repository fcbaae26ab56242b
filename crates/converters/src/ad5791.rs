//! Analog Devices AD5791, a 20-bit DAC on SPI (data sheet rev. E): 24 bits a word, mode 1.

use crate::Selected;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use hysteron_core::codes::DacCode;

/// Fastest bus for writing: a period of SCLK of 28 ns at least (timing characteristics, t1).
pub const MOST_HZ: u32 = 35_000_000;

/// Addresses of registers ("Input Shift Register").
const DAC: u8 = 0b001;
const CONTROL: u8 = 0b010;
/// Bit of the first byte that asks for a register.
const READ: u8 = 1 << 7;
/// Bits of the control register: no twos complement, the output's own amplifier off ("Control Register"). Neither clamped to ground nor
/// cut off, which are set at power-on.
const OFFSET_BINARY: u32 = 1 << 4;
const NO_AMPLIFIER: u32 = 1 << 1;

/// A code of 20 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Code(u32);

impl Code {
    /// The highest.
    pub const TOP: u32 = (1 << 20) - 1;

    /// None beyond 20 bits.
    pub const fn new(code: u32) -> Option<Self> {
        if code <= Self::TOP { Some(Self(code)) } else { None }
    }

    /// The number.
    pub const fn get(self) -> u32 {
        self.0
    }
}

/// The same share of the range: both ends stay ends.
impl From<DacCode> for Code {
    fn from(DacCode(code): DacCode) -> Self {
        let code = u32::from(code);
        Self(code << 4 | code >> 12)
    }
}

/// What the references span, which the linearity of the upper bits is set for ("Linearity compensation").
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Span {
    /// Up to 10 V.
    V10,
    /// Above 10 V up to 12 V.
    V12,
    /// Above 12 V up to 16 V.
    V16,
    /// Above 16 V up to 19 V.
    V19,
    /// Above 19 V up to 20 V.
    V20,
}

impl Span {
    const fn bits(self) -> u32 {
        match self {
            Self::V10 => 0b0000,
            Self::V12 => 0b1001,
            Self::V16 => 0b1010,
            Self::V19 => 0b1011,
            Self::V20 => 0b1100,
        }
    }
}

/// A converter whose output is a buffer of unity gain outside.
pub struct Ad5791<B, P> {
    bus: B,
    sync: P,
}

impl<B: SpiBus, P: OutputPin> Ad5791<B, P> {
    /// Takes the bus, at most at [`MOST_HZ`] in mode 1, and SYNC, which is low while a word is written.
    pub fn new(bus: B, sync: P) -> Self {
        Self { bus, sync }
    }

    /// From power-on, with the output clamped to ground: the code that is safe first, then the output. With LDAC high the output comes on at
    /// what the DAC register holds, which LDAC's fall sets.
    ///
    /// # Errors
    /// What the bus says.
    pub fn begin(&mut self, safe: Code, span: Span) -> Result<(), B::Error> {
        self.set(safe)?;
        self.write(CONTROL, span.bits() << 6 | OFFSET_BINARY | NO_AMPLIFIER)
    }

    /// Writes the input register: the output follows at the rise of SYNC while LDAC is low, else at the fall of LDAC.
    ///
    /// # Errors
    /// What the bus says.
    pub fn set(&mut self, code: Code) -> Result<(), B::Error> {
        self.write(DAC, code.0)
    }

    /// The code that the DAC register holds, by SDO; the bus must be slower for it, 35 ns a half period at least.
    ///
    /// # Errors
    /// What the bus says.
    pub fn held(&mut self) -> Result<Code, B::Error> {
        self.word(&mut [READ | DAC << 4, 0, 0])?;
        let mut answer = [0; 3];
        self.word(&mut answer)?;
        let [high, middle, low] = answer;
        Ok(Code(u32::from_be_bytes([0, high, middle, low]) & Code::TOP))
    }

    fn write(&mut self, address: u8, data: u32) -> Result<(), B::Error> {
        let [_, high, middle, low] = data.to_be_bytes();
        self.word(&mut [address << 4 | high, middle, low])
    }

    fn word(&mut self, word: &mut [u8; 3]) -> Result<(), B::Error> {
        let _selected = Selected::new(&mut self.sync);
        self.bus.transfer_in_place(word)?;
        self.bus.flush()
    }
}
