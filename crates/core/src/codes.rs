//! Converter codes and volts: 16-bit DACs and ADCs.

use crate::error::{ParamError, finite, in_range};
use crate::real::Real;

/// A code of a 16-bit digital-to-analogue converter, offset binary: 0 is the lowest voltage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct DacCode(pub u16);

/// A code of a 16-bit analogue-to-digital converter, offset binary: 0 is the lowest voltage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct AdcCode(pub u16);

impl DacCode {
    /// The code as a two's complement word, for converters that take those.
    pub fn twos_complement(self) -> i16 {
        (self.0 ^ 0x8000).cast_signed()
    }
}

impl AdcCode {
    /// From the two's complement word of converters that give those.
    pub fn from_twos_complement(word: i16) -> Self {
        Self(word.cast_unsigned() ^ 0x8000)
    }
}

/// Number of steps between the lowest and the highest code.
const STEPS: f64 = 65_535.0;

/// No converter spans fewer or more volts: a step of 15 pV lies below any reference's noise, a step of 15 V is no step.
const SMALLEST_SPAN_V: f64 = 1e-6;
const LARGEST_SPAN_V: f64 = 1e6;

/// The line between a converter's codes and volts: code 0 is `min_v`, code 65535 is `max_v`.
///
/// `max_v` is the voltage of the highest code. Data sheets that divide the full scale by 65536 name the voltage one step
/// above it: give `min_v + full_scale * 65535 / 65536`.
///
/// # Example
/// ```
/// use hysteron_core::codes::{AdcCode, Converter, DacCode};
/// let dac = Converter::new(0.0_f32, 10.0)?;
/// assert_eq!(dac.code(10.0), DacCode(65535));
/// assert_eq!(dac.code(-3.0), DacCode(0)); // saturates
/// let adc = Converter::new(-10.0_f64, 10.0)?;
/// assert!((adc.volts(AdcCode(32768)) - 20.0 / 65535.0 / 2.0).abs() < 1e-12);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter<T> {
    min_v: T,
    v_per_code: T,
    codes_per_v: T,
}

/// From numbers to codes without a library call: `as` saturates and maps NaN to 0.
pub trait ToCode: Real {
    /// The value cut to a whole number, saturated to 0..=65535.
    fn to_code(self) -> u16;
    /// The code as a number, exact.
    fn from_code(code: u16) -> Self;
}

macro_rules! impl_to_code {
    ($type:ty) => {
        impl ToCode for $type {
            #[inline(always)]
            fn to_code(self) -> u16 {
                // A conversion that saturates, and one instruction for the range; `as u16` compares twice as floating-point numbers.
                (self as i32).clamp(0, 65_535) as u16
            }
            #[inline(always)]
            fn from_code(code: u16) -> Self {
                Self::from(code)
            }
        }
    };
}
impl_to_code!(f32);
impl_to_code!(f64);

impl<T: ToCode> Converter<T> {
    /// Builds a converter.
    ///
    /// # Errors
    /// Voltages that are not finite or not ascending, or less than 1 uV or more than 1e6 V apart.
    pub fn new(min_v: T, max_v: T) -> Result<Self, ParamError> {
        finite("min_v", None, min_v)?;
        finite("max_v", None, max_v)?;
        if max_v <= min_v {
            let (value, previous) = (max_v.to_f64(), min_v.to_f64());
            return Err(ParamError::NotIncreasing {
                name: "converter limit",
                index: 2,
                value,
                previous,
            });
        }
        let span = max_v - min_v;
        in_range("converter span", None, span, SMALLEST_SPAN_V, LARGEST_SPAN_V)?;
        let steps = T::from_f64(STEPS);
        Ok(Self {
            min_v,
            v_per_code: span / steps,
            codes_per_v: steps / span,
        })
    }

    /// The nearest code; voltages outside the range give the nearest end, NaN the lowest.
    #[inline(always)]
    pub fn code(&self, volts: T) -> DacCode {
        DacCode(((volts - self.min_v) * self.codes_per_v + T::from_f64(0.5)).to_code())
    }

    /// Voltage of code 0, volts a code, codes a volt.
    pub fn coefficients(&self) -> [T; 3] {
        [self.min_v, self.v_per_code, self.codes_per_v]
    }

    /// The voltage of a code.
    #[inline(always)]
    pub fn volts(&self, code: AdcCode) -> T {
        self.min_v + T::from_code(code.0) * self.v_per_code
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_every_code_comes_back() {
        let converter = Converter::new(-10.0_f32, 10.0).unwrap();
        let exact = Converter::new(-10.0_f64, 10.0).unwrap();
        for code in 0..=u16::MAX {
            assert_eq!(converter.code(converter.volts(AdcCode(code))), DacCode(code));
            assert_eq!(exact.code(exact.volts(AdcCode(code))), DacCode(code));
            let word = DacCode(code).twos_complement();
            assert_eq!(AdcCode::from_twos_complement(word), AdcCode(code));
        }
        assert_eq!(DacCode(0).twos_complement(), i16::MIN);
        assert_eq!(DacCode(0x8000).twos_complement(), 0);
    }

    #[test]
    fn val_rounds_to_the_nearest_and_saturates() {
        let converter = Converter::new(0.0_f64, 65_535.0).unwrap();
        for (volts, code) in [
            (1.49, 1),
            (1.51, 2),
            (-7.0, 0),
            (1e30, 65_535),
            (f64::NAN, 0),
            (f64::INFINITY, 65_535),
        ] {
            assert_eq!(converter.code(volts), DacCode(code), "{volts}");
        }
    }

    #[test]
    fn refuse_ranges_that_do_not_ascend() {
        assert!(Converter::new(1.0_f32, 1.0).is_err());
        assert!(Converter::new(f32::NAN, 1.0).is_err());
        use std::string::ToString;
        assert_eq!(
            Converter::new(2.0_f32, 1.5).unwrap_err().to_string(),
            "converter limit[2] = 1.5 must exceed converter limit[1] = 2; sort the values"
        );
        // The span itself would be infinite in f32, and every voltage with it.
        assert_eq!(
            Converter::new(-3e38_f32, 3e38).unwrap_err().to_string(),
            "converter span = inf must lie in 0.000001 to 1000000"
        );
    }
}
