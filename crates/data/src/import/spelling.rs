//! How people spell quantities and units in the names of columns: `Time [s]`, `Voltage/V`, `Position, µm`, `disp_um`.

use crate::units::{Quantity, Unit};

/// What a column's name says.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Named {
    /// The quantities it may be, best guess only.
    pub(crate) quantity: Option<(Quantity, Certainty)>,
    /// The name without the unit.
    pub(crate) base: String,
    /// What stands where a unit stands.
    pub(crate) unit: Option<String>,
}

/// How sure a name is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Certainty {
    /// The name contains a word for the quantity: `Piezo voltage`.
    Contains,
    /// The name is a word for the quantity: `Voltage`, `u`.
    Is,
}

/// Spellings of units by native suffix, compared with their case (`mV` is not `MV`).
const SPELLINGS: &[(&str, &[&str])] = &[
    (
        "s",
        &[
            "s", "sec", "secs", "second", "seconds", "Sekunde", "Sekunden", "S", "SEC", "Second", "Seconds", "Sec",
        ],
    ),
    ("ms", &["ms", "msec", "millisecond", "milliseconds"]),
    ("us", &["us", "µs", "μs", "usec", "microsecond", "microseconds", "US"]),
    ("ns", &["ns", "nsec", "nanosecond", "nanoseconds", "NS"]),
    ("min", &["min", "minute", "minutes"]),
    ("v", &["V", "v", "volt", "volts", "Volt", "Volts", "VOLT", "VOLTS"]),
    ("mv", &["mV", "mv", "millivolt", "millivolts"]),
    ("uv", &["uV", "µV", "μV", "uv", "microvolt", "microvolts"]),
    ("kv", &["kV", "kv", "KV", "kilovolt", "kilovolts"]),
    (
        "um",
        &[
            "um",
            "µm",
            "μm",
            "micron",
            "microns",
            "micrometer",
            "micrometers",
            "micrometre",
            "micrometres",
            "mum",
            "UM",
        ],
    ),
    (
        "nm",
        &["nm", "nanometer", "nanometers", "nanometre", "nanometres", "NM"],
    ),
    ("pm", &["pm", "picometer", "picometre", "PM"]),
    ("mm", &["mm", "millimeter", "millimeters", "millimetre", "millimetres"]),
    ("m", &["m", "meter", "meters", "metre", "metres"]),
    (
        "c",
        &[
            "°C", "C", "c", "degC", "deg C", "deg. C", "degree C", "Celsius", "celsius", "oC", "ºC",
        ],
    ),
    ("k", &["K", "k", "kelvin", "Kelvin"]),
    ("f", &["°F", "F", "f", "degF", "deg F", "Fahrenheit", "fahrenheit"]),
];

/// The unit a spelling is, if it is one of the quantity.
pub(crate) fn unit(quantity: Quantity, spelled: &str) -> Option<Unit> {
    let spelled = spelled.trim();
    let (suffix, _) = SPELLINGS.iter().find(|(_, known)| known.contains(&spelled))?;
    quantity.unit(suffix)
}

/// The symbols of a quantity's units, for an error message.
pub(crate) fn known_units(quantity: Quantity) -> String {
    let symbols: Vec<&str> = quantity.units().iter().map(|unit| unit.symbol).collect();
    symbols.join(", ")
}

/// Whether it is a unit of any quantity.
pub(crate) fn is_unit(spelled: &str) -> bool {
    let spelled = unbracketed(spelled.trim()).unwrap_or(spelled).trim();
    SPELLINGS.iter().any(|(_, known)| known.contains(&spelled))
}

/// The text in a pair of brackets around all of it.
pub(crate) fn unbracketed(text: &str) -> Option<&str> {
    [('(', ')'), ('[', ']'), ('{', '}'), ('<', '>')]
        .into_iter()
        .find_map(|(open, close)| text.strip_prefix(open)?.strip_suffix(close))
}

/// Reads a column's name.
pub(crate) fn read(name: &str) -> Named {
    let (base, unit) = split_unit(name.trim());
    let words = words(&base);
    let quantity = quantity_of(&words, unit.as_deref());
    Named { quantity, base, unit }
}

/// The name and the unit in it.
fn split_unit(name: &str) -> (String, Option<String>) {
    let cut = |at: usize, unit: &str| {
        let base = name[..at].trim_end_matches(|c: char| c.is_whitespace() || "_-.,/:".contains(c));
        (base.trim().to_owned(), Some(unit.trim().to_owned()))
    };
    // brackets at the end: whatever stands in them is the unit, known or not
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')] {
        if let Some(inside) = name.strip_suffix(close)
            && let Some(at) = inside.rfind(open)
            && at > 0
        {
            return cut(at, &inside[at + open.len_utf8()..]);
        }
    }
    // after a slash or comma too
    if let Some(at) = name.rfind(['/', ','])
        && at > 0
        && !name[at + 1..].trim().is_empty()
    {
        return cut(at, &name[at + 1..]);
    }
    // else only a known one: `disp_um`, `Position in nm`, `Voltage V`
    if let Some(at) = name.rfind(|c: char| c.is_whitespace() || "_-.:".contains(c)) {
        let width = name[at..].chars().next().map_or(1, char::len_utf8);
        let last = &name[at + width..];
        // `y_m` is a measured y and `u_c` a control voltage in every textbook: one-letter units that are also such
        // letters need a word before them
        let letter = ["m", "c", "k", "f", "C", "K", "F"].contains(&last);
        if is_unit(last) && !(letter && at < 3) {
            let (base, unit) = cut(at, last);
            return (base.strip_suffix(" in").map(str::to_owned).unwrap_or(base), unit);
        }
    }
    (name.to_owned(), None)
}

/// The words of a name in lower case; `setPoint2` is `set`, `point`, `2`.
fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut kind = ' ';
    for character in name.chars() {
        let now = match character {
            c if c.is_ascii_digit() => '0',
            c if c.is_uppercase() => 'A',
            c if c.is_alphabetic() => 'a',
            _ => ' ',
        };
        let joined = now == kind || (kind == 'A' && now == 'a');
        match words.last_mut() {
            Some(word) if now != ' ' && joined => word.extend(character.to_lowercase()),
            _ if now != ' ' => words.push(character.to_lowercase().collect()),
            _ => {}
        }
        kind = now;
    }
    words
}

/// Names that are a quantity as they stand, words joined.
const NAMES: &[(Quantity, &[&str])] = &[
    (
        Quantity::Time,
        &[
            "t",
            "time",
            "times",
            "timestamp",
            "elapsedtime",
            "relativetime",
            "timeaxis",
            "xaxis",
            "xvalue",
            "zeit",
            "tout",
        ],
    ),
    (
        Quantity::Voltage,
        &[
            "v",
            "u",
            "voltage",
            "volt",
            "volts",
            "drive",
            "drivevoltage",
            "inputvoltage",
            "piezovoltage",
            "commandvoltage",
            "voltagecommand",
            "commandedvoltage",
            "controlvoltage",
            "uin",
            "vin",
            "vcmd",
            "ucmd",
            "vpiezo",
            "upiezo",
            "vdrive",
            "spannung",
            "piezospannung",
            "steuerspannung",
            "ansteuerspannung",
            "stellspannung",
        ],
    ),
    (
        Quantity::Position,
        &[
            "y",
            "pos",
            "position",
            "disp",
            "displacement",
            "actualposition",
            "measuredposition",
            "currentposition",
            "stageposition",
            "sensorposition",
            "positionactual",
            "positionmeasured",
            "posact",
            "auslenkung",
            "weg",
            "stellweg",
            "verschiebung",
            "istposition",
        ],
    ),
    (
        Quantity::Reference,
        &[
            "r",
            "ref",
            "reference",
            "yref",
            "yr",
            "setpoint",
            "target",
            "targetposition",
            "desiredposition",
            "commandedposition",
            "positioncommand",
            "positionsetpoint",
            "positiontarget",
            "positionreference",
            "referenceposition",
            "sollwert",
            "sollposition",
        ],
    ),
    (
        Quantity::Temperature,
        &["temp", "temperature", "stagetemperature", "temperatur"],
    ),
    (
        Quantity::Voltage2,
        &["v2", "u2", "voltage2", "vy", "uy", "otheraxisvoltage"],
    ),
];

/// Words that make a name one of a quantity, unless one of [`CONTRARY`] is with them.
const WORDS: &[(Quantity, &[&str])] = &[
    (Quantity::Reference, &["reference", "setpoint", "target", "desired"]),
    (Quantity::Temperature, &["temperature"]),
    (Quantity::Time, &["time", "zeit"]),
    (Quantity::Voltage, &["voltage", "spannung"]),
    (Quantity::Position, &["position", "displacement", "auslenkung"]),
];

/// Words by which a name is something else: an error signal, a sensor's voltage, a second channel.
const CONTRARY: &[&str] = &[
    "error",
    "deviation",
    "sensor",
    "monitor",
    "raw",
    "noise",
    "std",
    "sigma",
    "velocity",
    "speed",
    "2",
    "3",
    "4",
];

fn quantity_of(words: &[String], unit: Option<&str>) -> Option<(Quantity, Certainty)> {
    let joined = words.concat();
    // a capital T is a temperature where its unit says so
    if joined == "t" && unit.is_some_and(|spelled| self::unit(Quantity::Temperature, spelled).is_some()) {
        return Some((Quantity::Temperature, Certainty::Is));
    }
    if let Some((quantity, _)) = NAMES.iter().find(|(_, names)| names.contains(&joined.as_str())) {
        return Some((*quantity, Certainty::Is));
    }
    let has = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
    if has(CONTRARY) {
        return None;
    }
    WORDS
        .iter()
        .find(|(_, list)| has(list))
        .map(|(quantity, _)| (*quantity, Certainty::Contains))
}

#[cfg(test)]
mod tests {
    use super::*;
    use Certainty::{Contains, Is};
    use Quantity::{Position, Reference, Temperature, Time, Voltage, Voltage2};

    #[test]
    fn val_names_and_units_as_people_spell_them() {
        for (name, quantity, suffix) in [
            ("Time [s]", Some((Time, Is)), Some("s")),
            ("t (ms)", Some((Time, Is)), Some("ms")),
            ("time_s", Some((Time, Is)), Some("s")),
            ("Time", Some((Time, Is)), None),
            ("t/µs", Some((Time, Is)), Some("us")),
            ("Elapsed Time (sec)", Some((Time, Is)), Some("s")),
            ("Sample time [s]", Some((Time, Contains)), Some("s")),
            ("Voltage/V", Some((Voltage, Is)), Some("v")),
            ("Voltage / mV", Some((Voltage, Is)), Some("mv")),
            ("Piezo voltage (V)", Some((Voltage, Is)), Some("v")),
            ("Amplifier output voltage [kV]", Some((Voltage, Contains)), Some("kv")),
            ("u {V}", Some((Voltage, Is)), Some("v")),
            ("voltage_mv", Some((Voltage, Is)), Some("mv")),
            ("Voltage V", Some((Voltage, Is)), Some("v")),
            ("Position, um", Some((Position, Is)), Some("um")),
            ("Position in µm", Some((Position, Is)), Some("um")),
            ("POSITION_UM", Some((Position, Is)), Some("um")),
            ("disp_nm", Some((Position, Is)), Some("nm")),
            ("Displacement <mm>", Some((Position, Is)), Some("mm")),
            ("Actual Position of axis 1", Some((Position, Contains)), None),
            ("Target Position of axis 1", Some((Reference, Contains)), None),
            ("Target Position (um)", Some((Reference, Is)), Some("um")),
            ("setPoint [µm]", Some((Reference, Is)), Some("um")),
            ("T [°C]", Some((Temperature, Is)), Some("c")),
            ("T [s]", Some((Time, Is)), Some("s")),
            ("Stage temperature (K)", Some((Temperature, Is)), Some("k")),
            ("voltage2_v", Some((Voltage2, Is)), Some("v")),
            ("position_m", Some((Position, Is)), Some("m")),
            ("y_m", None, None),
            ("u_c", None, None),
            ("Sensor voltage (V)", None, None),
            ("Voltage monitor (V)", None, None),
            ("Position error (um)", None, None),
            ("CH1", None, None),
            ("Channel A (V)", None, None),
            ("", None, None),
        ] {
            let found = read(name);
            assert_eq!(found.quantity, quantity, "{name}");
            if let Some((quantity, _)) = quantity {
                let spelled = found.unit.and_then(|spelled| unit(quantity, &spelled));
                assert_eq!(spelled.map(|unit| unit.suffix), suffix, "{name}");
            }
        }
    }

    #[test]
    fn refuse_units_that_are_not_of_the_quantity_or_unclear() {
        for (quantity, spelled) in [
            (Voltage, "MV"),
            (Time, "MS"),
            (Position, "V"),
            (Position, "inch"),
            (Voltage, "dB"),
            (Time, ""),
            (Voltage, "um"),
        ] {
            assert_eq!(unit(quantity, spelled), None, "{spelled}");
        }
    }

    #[test]
    fn val_every_unit_is_spelled_by_its_symbol_and_suffix() {
        for quantity in Quantity::ALL {
            for known in quantity.units() {
                assert_eq!(unit(quantity, known.symbol), Some(*known));
                assert_eq!(unit(quantity, known.suffix), Some(*known));
            }
        }
    }
}
