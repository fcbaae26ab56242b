//! Analog Devices AD5683R, a 16-bit DAC on SPI (data sheet rev. D): any board's bus and pin by embedded-hal.

use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use hysteron_core::codes::DacCode;

/// The converter: bus mode 1 (clock low, data taken at the falling edge), at most 50 MHz.
pub struct Ad5683r<B, P> {
    bus: B,
    sync: P,
}

/// Command 3: write the input register and the output at once.
const WRITE_AND_UPDATE: u8 = 0b0011;

/// The 24 bits of a code: command, code, four that do not matter (its write sequence).
pub const fn word(code: DacCode) -> [u8; 3] {
    let [high, low] = code.0.to_be_bytes();
    [WRITE_AND_UPDATE << 4 | high >> 4, high << 4 | low >> 4, low << 4]
}

// 0x8000 is the middle; 0xffff has every data bit set and no other.
const _: () = assert!(matches!(word(DacCode(0x8000)), [0x38, 0, 0]));
const _: () = assert!(matches!(word(DacCode(0xffff)), [0x3f, 0xff, 0xf0]));
const _: () = assert!(matches!(word(DacCode(0x1234)), [0x31, 0x23, 0x40]));

impl<B: SpiBus, P: OutputPin> Ad5683r<B, P> {
    /// Takes bus and SYNC, which is low while a word is written.
    pub fn new(bus: B, sync: P) -> Self {
        Self { bus, sync }
    }

    /// Sets the output.
    ///
    /// # Errors
    /// What the bus says.
    #[inline(always)]
    pub fn set(&mut self, code: DacCode) -> Result<(), B::Error> {
        // Pins of these chips do not fail.
        let _ = self.sync.set_low();
        let written = self.bus.write(&word(code)).and_then(|()| self.bus.flush());
        let _ = self.sync.set_high();
        written
    }
}
