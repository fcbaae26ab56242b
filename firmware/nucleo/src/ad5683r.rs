//! Analog Devices AD5683R, a 16-bit DAC on SPI: any board's bus and pin by embedded-hal.

use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use hysteron_core::codes::DacCode;
use hysteron_firmware::ad5683r::{ASK, Update, WHILE_IT_ANSWERS, answered, word};

/// The converters of `N` axes on one bus: mode 1, at most [`hysteron_firmware::ad5683r::MOST_HZ`].
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
            // Pins of these chips do not fail.
            let _ = sync.set_low();
            let written = self.bus.write(&word(code, update)).and_then(|()| self.bus.flush());
            let _ = sync.set_high();
            written?;
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
            let _ = sync.set_low();
            let read = bus.transfer(&mut answer, &word).and_then(|()| bus.flush());
            let _ = sync.set_high();
            read?;
        }
        *code = answered(answer);
    }
    Ok(codes)
}
