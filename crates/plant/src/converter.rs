//! Digital-analog and analog-digital converters.

use crate::error::{StageError, ordered, within};

/// A converter of 2^bits equal steps over its range, offset binary: code 0 is `min_v`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Resolution, bits.
    pub bits: u32,
    /// Voltage of code 0, volts.
    pub min_v: f64,
    /// Voltage one step above the highest code, volts.
    pub max_v: f64,
}

impl Converter {
    /// 16 bits over +-10 V, as on the paper's controller board.
    pub const BIPOLAR_16_BIT: Self = Self {
        bits: 16,
        min_v: -10.0,
        max_v: 10.0,
    };
    /// 16 bits over 0 to 10 V: with a gain of 20, 3.05 mV at the stack.
    pub const UNIPOLAR_16_BIT: Self = Self {
        bits: 16,
        min_v: 0.0,
        max_v: 10.0,
    };

    pub(crate) fn validate(&self, name: &str) -> Result<(), StageError> {
        within(
            &format!("{name}.bits"),
            f64::from(self.bits),
            4.0,
            32.0,
            "converters have 12 to 24 bits",
        )?;
        within(
            &format!("{name}.min_v"),
            self.min_v,
            -1e3,
            1e3,
            "converters work within +-10 V",
        )?;
        within(
            &format!("{name}.max_v"),
            self.max_v,
            -1e3,
            1e3,
            "converters work within +-10 V",
        )?;
        ordered(
            &format!("{name}.min_v"),
            self.min_v,
            &format!("{name}.max_v"),
            self.max_v,
        )
    }

    /// One step, volts.
    pub fn step_v(&self) -> f64 {
        (self.max_v - self.min_v) / 2_f64.powi(self.bits as i32)
    }

    /// Highest code.
    pub fn max_code(&self) -> u32 {
        u32::MAX >> (32 - self.bits.clamp(1, 32))
    }

    /// The code nearest to a voltage, the nearest end outside of the range, 0 for NaN.
    ///
    /// ```
    /// use hysteron_plant::Converter;
    /// assert_eq!(Converter::BIPOLAR_16_BIT.code_from_v(0.0), 32_768);
    /// assert_eq!(Converter::BIPOLAR_16_BIT.code_from_v(11.0), 65_535);
    /// ```
    pub fn code_from_v(&self, voltage_v: f64) -> u32 {
        let code = ((voltage_v - self.min_v) / self.step_v()).round();
        // `as` saturates and turns NaN into 0.
        (code as u32).min(self.max_code())
    }

    /// The voltage of a code.
    pub fn v_from_code(&self, code: u32) -> f64 {
        self.min_v + f64::from(code.min(self.max_code())) * self.step_v()
    }

    pub(crate) fn quantise(&self, voltage_v: f64) -> f64 {
        self.v_from_code(self.code_from_v(voltage_v))
    }
}
