//! Quantities a record has, and the units they may come in.

use std::fmt;

/// A quantity of a record; the name is the one in the native header, before the unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quantity {
    /// Time of the sample.
    Time,
    /// Voltage commanded at the actuator.
    Voltage,
    /// Measured displacement.
    Position,
    /// Desired displacement.
    Reference,
    /// Stage temperature.
    Temperature,
    /// Voltage commanded on the other axis.
    Voltage2,
}

impl Quantity {
    /// All quantities, in the order of the native header.
    pub const ALL: [Quantity; 6] = [
        Quantity::Time,
        Quantity::Voltage,
        Quantity::Position,
        Quantity::Reference,
        Quantity::Temperature,
        Quantity::Voltage2,
    ];

    /// The name in the native header, before the unit.
    pub const fn name(self) -> &'static str {
        match self {
            Quantity::Time => "time",
            Quantity::Voltage => "voltage",
            Quantity::Position => "position",
            Quantity::Reference => "reference",
            Quantity::Temperature => "temperature",
            Quantity::Voltage2 => "voltage2",
        }
    }

    /// Whether no record is without it.
    pub const fn is_required(self) -> bool {
        matches!(self, Quantity::Time | Quantity::Voltage | Quantity::Position)
    }

    /// The units it may come in; the first is the one of [`Record`](crate::Record).
    pub const fn units(self) -> &'static [Unit] {
        match self {
            Quantity::Time => TIME,
            Quantity::Voltage | Quantity::Voltage2 => VOLTAGE,
            Quantity::Position | Quantity::Reference => LENGTH,
            Quantity::Temperature => TEMPERATURE,
        }
    }

    /// The unit with a native suffix (`mv`), if it is one of this quantity.
    pub fn unit(self, suffix: &str) -> Option<Unit> {
        self.units().iter().find(|unit| unit.suffix == suffix).copied()
    }

    /// The unit of [`Record`](crate::Record).
    pub const fn base_unit(self) -> Unit {
        self.units()[0]
    }

    /// The suffixes of its units, for an error message.
    pub(crate) fn known_suffixes(self) -> String {
        let known: Vec<String> = self
            .units()
            .iter()
            .map(|unit| format!("`{}_{}`", self.name(), unit.suffix))
            .collect();
        known.join(", ")
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

/// A unit, by its exact conversion to the unit of [`Record`](crate::Record): `(value - offset) * times / by`.
///
/// One of `times` and `by` is 1 wherever the conversion is a power of ten, so that `5 mV` is the number nearest to
/// 0.005 V and not one rounding further.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Suffix in the native header.
    pub suffix: &'static str,
    /// Symbol as people write it.
    pub symbol: &'static str,
    offset: f64,
    times: f64,
    by: f64,
}

impl Unit {
    const fn scaled(suffix: &'static str, symbol: &'static str, times: f64, by: f64) -> Unit {
        Unit {
            suffix,
            symbol,
            offset: 0.0,
            times,
            by,
        }
    }

    /// Whether it is the unit of [`Record`](crate::Record) itself.
    pub fn is_base(&self) -> bool {
        self.offset == 0.0 && self.times == 1.0 && self.by == 1.0
    }

    /// A value in this unit in the unit of [`Record`](crate::Record).
    pub fn to_base(&self, value: f64) -> f64 {
        (value - self.offset) * self.times / self.by
    }

    /// A difference of two values in this unit in the unit of [`Record`](crate::Record).
    pub fn difference_to_base(&self, difference: f64) -> f64 {
        difference * self.times / self.by
    }
}

const TIME: &[Unit] = &[
    Unit::scaled("s", "s", 1.0, 1.0),
    Unit::scaled("ms", "ms", 1.0, 1e3),
    Unit::scaled("us", "µs", 1.0, 1e6),
    Unit::scaled("ns", "ns", 1.0, 1e9),
    Unit::scaled("min", "min", 60.0, 1.0),
];

const VOLTAGE: &[Unit] = &[
    Unit::scaled("v", "V", 1.0, 1.0),
    Unit::scaled("mv", "mV", 1.0, 1e3),
    Unit::scaled("uv", "µV", 1.0, 1e6),
    Unit::scaled("kv", "kV", 1e3, 1.0),
];

const LENGTH: &[Unit] = &[
    Unit::scaled("um", "µm", 1.0, 1.0),
    Unit::scaled("nm", "nm", 1.0, 1e3),
    Unit::scaled("pm", "pm", 1.0, 1e6),
    Unit::scaled("mm", "mm", 1e3, 1.0),
    Unit::scaled("m", "m", 1e6, 1.0),
];

const TEMPERATURE: &[Unit] = &[
    Unit::scaled("c", "°C", 1.0, 1.0),
    Unit {
        suffix: "k",
        symbol: "K",
        offset: 273.15,
        times: 1.0,
        by: 1.0,
    },
    Unit {
        suffix: "f",
        symbol: "°F",
        offset: 32.0,
        times: 5.0,
        by: 9.0,
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_conversions_are_the_nearest_number() {
        for (quantity, suffix, value, expect) in [
            (Quantity::Time, "s", 0.1, 0.1),
            (Quantity::Time, "ms", 0.2, 0.0002),
            (Quantity::Time, "us", 20.0, 2e-5),
            (Quantity::Time, "min", 2.0, 120.0),
            (Quantity::Voltage, "mv", 5.0, 0.005),
            (Quantity::Voltage, "kv", 0.15, 150.0),
            (Quantity::Voltage2, "uv", 3.0, 3e-6),
            (Quantity::Position, "nm", 1.1, 0.0011),
            (Quantity::Position, "mm", 0.05, 50.0),
            (Quantity::Reference, "m", 1e-6, 1.0),
            (Quantity::Temperature, "k", 273.15, 0.0),
            (Quantity::Temperature, "f", 212.0, 100.0),
        ] {
            let unit = quantity.unit(suffix).unwrap();
            assert_eq!(unit.to_base(value), expect, "{quantity}_{suffix}");
        }
    }

    #[test]
    fn val_the_first_unit_is_the_one_of_the_record() {
        for quantity in Quantity::ALL {
            assert!(quantity.base_unit().is_base());
            assert_eq!(quantity.units().iter().filter(|unit| unit.is_base()).count(), 1);
        }
    }
}
