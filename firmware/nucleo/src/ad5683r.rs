//! Analog Devices AD5683R, a 16-bit DAC on SPI: any board's bus and pin by embedded-hal.

use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use hysteron_core::codes::DacCode;
use hysteron_firmware::ad5683r::word;

/// The converter: bus mode 1, at most [`hysteron_firmware::ad5683r::MOST_HZ`].
pub struct Ad5683r<B, P> {
    bus: B,
    sync: P,
}

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
