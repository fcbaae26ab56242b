//! Parameters as people write them: `44.4 nm/V` in place of `4.44e-2 um/V`, with the digits that the standard error allows.

use hysteron_diagnose::diagnosis::EffectParameter;
use hysteron_identify::Parameter;

/// Significant digits of a value without a standard error.
const DIGITS: i32 = 4;
/// Significant digits of a standard error.
const ERROR_DIGITS: i32 = 2;
/// Most digits after the decimal point.
const MOST_DECIMALS: i32 = 6;

/// A parameter to be printed.
#[derive(Debug, Clone, Copy)]
pub struct Amount<'a> {
    /// Name.
    pub name: &'a str,
    /// Value in its unit.
    pub value: f64,
    /// Standard error in the same unit, where there is one.
    pub standard_error: Option<f64>,
    /// Unit, such as `um/V`; empty for a pure number.
    pub unit: &'a str,
}

impl<'a> From<&'a Parameter> for Amount<'a> {
    fn from(parameter: &'a Parameter) -> Self {
        Self {
            name: &parameter.name,
            value: parameter.value,
            standard_error: parameter.standard_error,
            unit: &parameter.unit,
        }
    }
}

impl<'a> From<&'a EffectParameter> for Amount<'a> {
    fn from(parameter: &'a EffectParameter) -> Self {
        Self {
            name: &parameter.name,
            value: parameter.value,
            standard_error: None,
            unit: &parameter.unit,
        }
    }
}

/// A parameter as printed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Name.
    pub name: String,
    /// Value.
    pub value: String,
    /// Standard error; `-` where there is none.
    pub standard_error: String,
    /// Unit, with the prefix that fits the values.
    pub unit: String,
}

/// The parameters with one prefix and one number of decimals for all of a unit. A second mode of no share is left out.
///
/// # Example
/// ```
/// use hysteron_report::amounts::{Amount, written};
/// let weight = Amount { name: "weight", value: 0.044_373, standard_error: Some(0.0025), unit: "um/V" };
/// let row = &written(&[weight])[0];
/// assert_eq!((row.value.as_str(), row.standard_error.as_str(), row.unit.as_str()), ("44.4", "2.5", "nm/V"));
/// ```
pub fn written(amounts: &[Amount<'_>]) -> Vec<Written> {
    let shown = of_one_mode(amounts);
    shown
        .iter()
        .map(|amount| {
            let alike = || {
                shown
                    .iter()
                    .filter(|other| other.unit == amount.unit && other.value.is_finite())
            };
            let largest = alike().map(|other| other.value.abs()).fold(0.0, f64::max);
            let (factor, unit) = prefixed(amount.unit, largest);
            let errors = alike().filter_map(|other| other.standard_error.filter(|e| *e > 0.0 && e.is_finite()));
            let least = errors.fold(f64::INFINITY, f64::min);
            let number = |value: f64| fixed(value * factor, decimals(largest * factor, least * factor));
            let value = number(amount.value);
            Written {
                name: amount.name.to_owned(),
                value: if least.is_finite() {
                    value
                } else {
                    without_zeros(&value).to_owned()
                },
                standard_error: amount.standard_error.map_or_else(|| "-".to_owned(), number),
                unit,
            }
        })
        .collect()
}

/// Each parameter in a line without its standard error: `delay 140.6 us`. A second mode of no share is left out.
pub fn plain(amounts: &[Amount<'_>]) -> Vec<String> {
    of_one_mode(amounts)
        .into_iter()
        .map(|a| {
            let (factor, unit) = prefixed(a.unit, a.value.abs());
            let scaled = a.value * factor;
            let text = fixed(scaled, decimals(scaled.abs(), f64::INFINITY));
            format!("{} {} {unit}", a.name, without_zeros(&text))
                .trim_end()
                .to_owned()
        })
        .collect()
}

/// All parameters, or those of the first mode where the second has no share.
fn of_one_mode<'a>(amounts: &'a [Amount<'a>]) -> Vec<&'a Amount<'a>> {
    let one_mode = amounts.iter().any(|a| a.name.trim_end() == "share_2" && a.value == 0.0);
    let shown = amounts
        .iter()
        .filter(|a| !(one_mode && a.name.trim_end().ends_with("_2")));
    shown.collect()
}

/// A number without the zeros at its end that no standard error stands for.
fn without_zeros(text: &str) -> &str {
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        text
    }
}

/// Digits after the point: two of the least standard error, or five in all of the largest value.
fn decimals(largest: f64, least_error: f64) -> i32 {
    let first_digit = |value: f64| value.log10().floor() as i32;
    let of_value = if largest > 0.0 {
        DIGITS - 1 - first_digit(largest)
    } else {
        0
    };
    let of_error = if least_error.is_finite() {
        ERROR_DIGITS - 1 - first_digit(least_error)
    } else {
        of_value
    };
    // An error far below the value's last printed digit asks for no more of them.
    of_error.min(of_value + 2).max(0)
}

/// A number with so many decimals; with an exponent where they do not reach.
fn fixed(value: f64, decimals: i32) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    if decimals > MOST_DECIMALS {
        return format!("{value:.2e}");
    }
    let text = format!("{value:.*}", decimals.max(0) as usize);
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        _ => text,
    }
}

/// The factor and the unit in which the largest of some values is at least 1.
pub(crate) fn prefixed(unit: &str, largest: f64) -> (f64, String) {
    let prefixes = |base: &str| -> &'static [(&'static str, f64)] {
        match base {
            "um" => &[("um", 1.0), ("nm", 1e3), ("pm", 1e6)],
            "V" if unit == "V/s" => &[("MV", 1e-6), ("kV", 1e-3), ("V", 1.0), ("mV", 1e3)],
            "V" => &[("V", 1.0), ("mV", 1e3), ("uV", 1e6)],
            "s" => &[("s", 1.0), ("ms", 1e3), ("us", 1e6)],
            "Hz" => &[("kHz", 1e-3), ("Hz", 1.0)],
            _ => &[],
        }
    };
    let end = unit.find(['/', ' ', '^']).unwrap_or(unit.len());
    let (base, rest) = unit.split_at(end);
    let least = if base == "Hz" { 10.0 } else { 1.0 };
    let all = if largest > 0.0 { prefixes(base) } else { &[] };
    let fits = |(_, factor): &&(&str, f64)| largest * factor >= least;
    all.iter().find(fits).or(all.last()).map_or_else(
        || (1.0, unit.to_owned()),
        |(name, factor)| (*factor, format!("{name}{rest}")),
    )
}

#[cfg(test)]
mod tests {
    use super::{Amount, plain, written};

    fn of<'a>(name: &'a str, value: f64, standard_error: Option<f64>, unit: &'a str) -> Amount<'a> {
        Amount {
            name,
            value,
            standard_error,
            unit,
        }
    }

    #[test]
    fn golden_parameters_read_as_people_write_them() {
        let rows = [
            (1.4057e-4, "s", "delay 140.6 us"),
            (888.83, "Hz", "delay 888.8 Hz"),
            (20_000.0, "Hz", "delay 20 kHz"),
            (61_659.0, "V/s", "delay 61.66 kV/s"),
            (0.8404, "", "delay 0.8404"),
            (0.03, "", "delay 0.03"),
            (0.0, "um", "delay 0 um"),
            (-5.868e-6, "um/V^3", "delay -5.868 pm/V^3"),
            (1.2e-9, "", "delay 1.20e-9"),
        ];
        for (value, unit, expected) in rows {
            assert_eq!(plain(&[of("delay", value, None, unit)]), [expected]);
        }
    }

    #[test]
    fn golden_one_unit_has_one_prefix_and_as_many_digits_as_its_best_known_value() {
        let rows = written(&[
            of("weight[1]", 0.044_372_8, Some(2.5e-3), "um/V"),
            of("weight[2]", -0.001_702, Some(4.95e-3), "um/V"),
            of("offset", -0.013_16, None, "um"),
        ]);
        let texts: Vec<String> = rows
            .iter()
            .map(|row| format!("{} {} {} {}", row.name, row.value, row.standard_error, row.unit))
            .collect();
        assert_eq!(
            texts,
            [
                "weight[1] 44.4 2.5 nm/V",
                "weight[2] -1.7 5.0 nm/V",
                "offset -13.16 - nm"
            ]
        );
    }

    #[test]
    fn golden_a_second_mode_of_no_share_is_left_out() {
        let modes = [
            of("frequency", 888.95, Some(0.016), "Hz"),
            of("frequency_2", 2e4, None, "Hz"),
            of("share_2", 0.0, None, ""),
        ];
        let rows = written(&modes);
        assert_eq!(rows.len(), 1);
        assert_eq!((rows[0].value.as_str(), rows[0].unit.as_str()), ("888.950", "Hz"));
        assert_eq!(plain(&modes), ["frequency 889 Hz"]);
    }
}
