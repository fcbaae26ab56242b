//! Numbers and units as people read them.

/// A number with three significant digits and no exponent while that stays readable.
///
/// # Example
/// ```
/// use hysteron_report::significant;
/// assert_eq!(significant(1.2345), "1.23");
/// assert_eq!(significant(0.000_123_4), "0.000123");
/// assert_eq!(significant(123_456.0), "123\u{202f}000");
/// assert_eq!(significant(1.2e-7), "1.20×10⁻⁷");
/// assert_eq!(significant(f64::INFINITY), "–");
/// ```
pub fn significant(value: f64) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    // Rounded to three digits first, so that 9.996 reads 10.0 and not 10.00.
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    let exponent = rounded.abs().log10().floor() as i32;
    match exponent {
        -4..=1 => signed(&format!("{rounded:.*}", (2 - exponent) as usize)),
        2..=3 => signed(&format!("{rounded:.0}")),
        4..=8 => {
            let sign = if rounded < 0.0 { "−" } else { "" };
            format!("{sign}{}", count(rounded.abs().round() as usize))
        }
        _ => {
            let mantissa = rounded / 10f64.powi(exponent);
            format!("{}×10{}", signed(&format!("{mantissa:.2}")), superscript(exponent))
        }
    }
}

/// A count with its thousands set apart: `1 000 000` (with narrow no-break spaces, from five digits on).
pub fn count(value: usize) -> String {
    let digits = value.to_string();
    if digits.len() < 5 {
        return digits;
    }
    let mut grouped = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            grouped.push('\u{202f}');
        }
        grouped.push(digit);
    }
    grouped
}

/// An edge of a bin, with the digits that two significant digits of the bin's width need, and no zeros at its end.
pub(crate) fn edge(value: f64, width: f64) -> String {
    let digits = if width > 0.0 {
        1 - width.log10().floor() as i32
    } else {
        0
    };
    match digits {
        ..=0 if value.abs() >= 1e4 => significant(value),
        ..=0 => signed(&format!("{value:.0}")),
        1..=6 => {
            let text = format!("{:.*}", digits as usize, value);
            signed(text.trim_end_matches('0').trim_end_matches('.'))
        }
        _ => significant(value).replace(".00×", "×"),
    }
}

/// Percent, kept on one line.
pub(crate) fn percent(value: f64) -> String {
    format!("{}\u{a0}%", significant(value))
}

/// A value with its unit, in the unit's smaller sibling where that reads better: `0.72 nm` rather than `0.00072 µm`.
pub(crate) fn quantity(value: f64, unit: &str) -> String {
    let (factor, unit) = readable_unit(unit, value.abs());
    format!("{}\u{a0}{unit}", significant(value * factor))
}

/// The factor and the unit in which a quantity up to `max_abs` reads best; the unit itself where there is no sibling.
pub(crate) fn readable_unit(unit: &str, max_abs: f64) -> (f64, String) {
    // Unit, factor to it, and from which value in it: a tenth, as 0.3 µm reads as well as 300 nm and compares with its
    // neighbours; ten where the larger unit is the less usual one.
    let ladder: &[(&str, f64, f64)] = match unit {
        "um" | "µm" => &[("µm", 1.0, 0.1), ("nm", 1e3, 0.1), ("pm", 1e6, 0.0)],
        "um/s" | "µm/s" => &[("mm/s", 1e-3, 10.0), ("µm/s", 1.0, 0.1), ("nm/s", 1e3, 0.0)],
        "V" => &[("V", 1.0, 0.1), ("mV", 1e3, 0.1), ("µV", 1e6, 0.0)],
        "s" => &[("s", 1.0, 0.1), ("ms", 1e3, 0.1), ("µs", 1e6, 0.0)],
        _ => return (1.0, unit_text(unit)),
    };
    let found = ladder
        .iter()
        .find(|(_, factor, from)| max_abs > 0.0 && max_abs * factor >= *from);
    found.map_or_else(
        || (1.0, unit_text(unit)),
        |(name, factor, _)| (*factor, (*name).to_owned()),
    )
}

/// A unit as printed: `um` becomes `µm`, `um/s` becomes `µm/s`, `C` becomes `°C`.
pub(crate) fn unit_text(unit: &str) -> String {
    match unit {
        "C" | "degC" => "°C".to_owned(),
        _ if unit == "um" || unit.starts_with("um/") => unit.replacen("um", "µm", 1),
        _ => unit.to_owned(),
    }
}

/// An integer in superscript digits.
pub(crate) fn superscript(value: i32) -> String {
    value
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '0' | '4'..='9' => char::from_u32('⁰' as u32 + c as u32 - '0' as u32).unwrap_or(c),
            other => other,
        })
        .collect()
}

/// With a minus sign in place of the hyphen, and no sign before a zero.
pub(crate) fn signed(text: &str) -> String {
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::{count, quantity, readable_unit, significant, superscript};

    #[test]
    fn golden_numbers_read_well() {
        let rows = [
            (9.996, "10.0"),
            (99.96, "100"),
            (-0.5, "−0.500"),
            (1234.6, "1230"),
            (9999.0, "10\u{202f}000"),
            (-123_456.0, "−123\u{202f}000"),
            (1e12, "1.00×10¹²"),
            (f64::NAN, "–"),
        ];
        for (value, expected) in rows {
            assert_eq!(significant(value), expected, "{value}");
        }
        assert_eq!(count(999), "999");
        assert_eq!(count(1_000_000), "1\u{202f}000\u{202f}000");
        assert_eq!(superscript(-12), "⁻¹²");
    }

    #[test]
    fn golden_units_step_down_only_when_it_reads_better() {
        assert_eq!(quantity(0.000_72, "um"), "0.720\u{a0}nm");
        assert_eq!(quantity(0.3, "um"), "0.300\u{a0}µm");
        assert_eq!(quantity(0.0, "um"), "0\u{a0}µm");
        assert_eq!(quantity(12.0, "Hz"), "12.0\u{a0}Hz");
        assert_eq!(readable_unit("s", 0.02), (1e3, "ms".to_owned()));
        assert_eq!(readable_unit("um/s", 126_000.0), (1e-3, "mm/s".to_owned()));
        assert_eq!(readable_unit("um/s", 900.0), (1.0, "µm/s".to_owned()));
        assert_eq!(readable_unit("V", 1e-12), (1e6, "µV".to_owned()));
    }
}
