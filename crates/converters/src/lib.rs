//! Drivers of the converters around a stage, for any bus and pins by embedded-hal 1.
//!
//! | converter | bits | range | on |
//! |---|---|---|---|
//! | [`ad5683r`] | DAC, 16 | 0 to 2.5 V, its own reference | the Nucleo boards' images |
//! | [`ad5791`] | DAC, 20 | what the references are, to +-10 V | a board of one's own |
//! | [`ad7608`] | ADC, 18, eight channels at one instant | +-10 V or +-5 V | a board of one's own |
//!
//! Pins of a chip do not fail, and what they say is not looked at. A bus that fails leaves the select line high.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod ad5683r;
pub mod ad5791;
pub mod ad7608;

use embedded_hal::digital::OutputPin;

/// A converter's select line, low until this is dropped, however a transfer ends.
struct Selected<'l, P: OutputPin>(&'l mut P);

impl<'l, P: OutputPin> Selected<'l, P> {
    #[inline(always)]
    fn new(line: &'l mut P) -> Self {
        let _ = line.set_low();
        Self(line)
    }
}

impl<P: OutputPin> Drop for Selected<'_, P> {
    #[inline(always)]
    fn drop(&mut self) {
        let _ = self.0.set_high();
    }
}
