//! One axis of a picture: its range, its ticks at round numbers, linear or logarithmic.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use crate::number::{signed, superscript};

/// One labelled tick.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tick {
    /// Where it is, in the axis's own coordinate.
    pub(crate) at: f64,
    /// What it says.
    pub(crate) label: String,
}

/// An axis. Its coordinate is the value itself or, on a logarithmic axis, the value's decimal logarithm.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Axis {
    /// Lowest coordinate shown.
    pub(crate) low: f64,
    /// Highest coordinate shown, always above the lowest.
    pub(crate) high: f64,
    /// Ticks, ascending.
    pub(crate) ticks: Vec<Tick>,
    log: bool,
}

/// The smallest and the largest finite value.
pub(crate) fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .filter(|value| value.is_finite())
        .fold(None, |found, value| match found {
            None => Some((value, value)),
            Some((low, high)) => Some((value.min(low), value.max(high))),
        })
}

impl Axis {
    /// A linear axis over a range, with about `ticks` ticks at steps of 1, 2 or 5 times a power of ten. A range of no
    /// width is widened about its value.
    pub(crate) fn linear(low: f64, high: f64, ticks: usize) -> Self {
        let (low, high) = widened(low, high);
        // One tick gives no scale: finer steps until there are two. A step below half the width always gives two.
        let (step, at) = (ticks.max(1)..=ticks.max(1) + 5)
            .map(|ticks| {
                let step = step(high - low, ticks);
                let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
                (
                    step,
                    (first..=last).map(|index| index as f64 * step).collect::<Vec<f64>>(),
                )
            })
            .find(|(_, at)| at.len() >= 2)
            .unwrap_or((high - low, vec![low, high]));
        Self {
            low,
            high,
            ticks: labelled(&at, step),
            log: false,
        }
    }

    /// A linear axis with a twentieth of its width to spare on both sides.
    pub(crate) fn padded(low: f64, high: f64, ticks: usize) -> Self {
        let (low, high) = widened(low, high);
        let spare = 0.05 * (high - low);
        Self::linear(low - spare, high + spare, ticks)
    }

    /// A logarithmic axis over a range of positive values: a tick at each power of ten, or at 1, 2 and 5 times a power of
    /// ten where there are few powers, or at every second, third, ... power where there are many.
    pub(crate) fn logarithmic(low: f64, high: f64, ticks: usize) -> Self {
        let low = if low > 0.0 && low.is_finite() {
            low
        } else {
            f64::MIN_POSITIVE
        };
        let high = if high > low && high.is_finite() {
            high
        } else {
            low * 10.0
        };
        let (low, high) = (low.log10(), high.log10());
        let (first, last) = ((low - 1e-9).ceil() as i32, (high + 1e-9).floor() as i32);
        let powers = (last - first + 1).max(0) as usize;
        let mut ticks_found = Vec::new();
        if powers < 3 {
            for exponent in first - 1..=last {
                for mantissa in [1.0f64, 2.0, 5.0] {
                    let at = mantissa.log10() + f64::from(exponent);
                    if at >= low - 1e-9 && at <= high + 1e-9 {
                        ticks_found.push(Tick {
                            at,
                            label: power_label(mantissa, exponent),
                        });
                    }
                }
            }
        } else {
            let stride = powers.div_ceil(ticks.max(2)) as i32;
            for exponent in (first..=last).filter(|exponent| exponent.rem_euclid(stride) == 0) {
                ticks_found.push(Tick {
                    at: f64::from(exponent),
                    label: power_label(1.0, exponent),
                });
            }
        }
        Self {
            low,
            high,
            ticks: ticks_found,
            log: true,
        }
    }

    /// The coordinate of a value; values that a logarithmic axis cannot show give the lowest coordinate.
    pub(crate) fn coordinate(&self, value: f64) -> f64 {
        if !self.log {
            value
        } else if value > 0.0 {
            value.log10().max(self.low)
        } else {
            self.low
        }
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, at: &f64, (first, last): (i32, i32)) -> i32 {
        let share = ((at - self.low) / (self.high - self.low)).clamp(0.0, 1.0);
        first + (share * f64::from(last - first)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Lines between ticks would say nothing more.
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.ticks.iter().map(|tick| tick.at).collect()
        }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format(at: &f64) -> String {
        at.to_string()
    }

    /// The label of the tick at a coordinate.
    fn format_ext(&self, at: &f64) -> String {
        self.ticks
            .iter()
            .find(|tick| tick.at == *at)
            .map_or_else(String::new, |tick| tick.label.clone())
    }
}

/// A range with a width: a single value gets a tenth of itself on both sides, zero gets one.
fn widened(low: f64, high: f64) -> (f64, f64) {
    let (low, high) = if low.is_finite() && high.is_finite() {
        (low, high)
    } else {
        (0.0, 1.0)
    };
    let (low, high) = (low.min(high), low.max(high));
    // Below this, ticks at the double's own resolution would read alike.
    if high - low > 1e-9 * low.abs().max(high.abs()) {
        (low, high)
    } else if low == 0.0 {
        (-1.0, 1.0)
    } else {
        (low - 0.1 * low.abs(), high + 0.1 * high.abs())
    }
}

/// The step of 1, 2 or 5 times a power of ten that comes closest, in ratio, to giving `ticks` steps: at most half more.
fn step(width: f64, ticks: usize) -> f64 {
    let raw = width / ticks.max(1) as f64;
    let power = 10f64.powf(raw.log10().floor());
    // The borders are the geometric means of neighbouring steps.
    let mantissa = match raw / power {
        ratio if ratio < 2f64.sqrt() => 1.0,
        ratio if ratio < 10f64.sqrt() => 2.0,
        ratio if ratio < 50f64.sqrt() => 5.0,
        _ => 10.0,
    };
    mantissa * power
}

/// Ticks with as many digits as their step needs, all in one power of ten where plain numbers would be long.
fn labelled(at: &[f64], step: f64) -> Vec<Tick> {
    let largest = at.iter().fold(0.0f64, |found, value| found.max(value.abs()));
    let step_exponent = (step.log10() + 1e-9).floor() as i32;
    let power = if largest >= 1e5 || step < 1e-4 {
        (largest.log10() + 1e-9).floor() as i32
    } else {
        0
    };
    let decimals = (power - step_exponent).max(0) as usize;
    at.iter()
        .map(|value| {
            let mantissa = signed(&format!("{:.*}", decimals, value / 10f64.powi(power)));
            let label = if power == 0 || *value == 0.0 {
                mantissa
            } else {
                format!("{mantissa}×10{}", superscript(power))
            };
            Tick { at: *value, label }
        })
        .collect()
}

/// `mantissa 10^exponent`, plain from 0.001 to 10 000.
fn power_label(mantissa: f64, exponent: i32) -> String {
    match exponent {
        -3..=-1 => format!(
            "{:.*}",
            exponent.unsigned_abs() as usize,
            mantissa * 10f64.powi(exponent)
        ),
        0..=4 => format!("{:.0}", mantissa * 10f64.powi(exponent)),
        _ if mantissa == 1.0 => format!("10{}", superscript(exponent)),
        _ => format!("{mantissa:.0}×10{}", superscript(exponent)),
    }
}

#[cfg(test)]
mod tests {
    use super::Axis;
    use proptest::prelude::{prop_assert, proptest};

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|tick| tick.label.as_str()).collect()
    }

    #[test]
    fn golden_ticks() {
        assert_eq!(
            labels(&Axis::linear(-1.0, 1.0, 5)),
            ["−1.0", "−0.5", "0.0", "0.5", "1.0"]
        );
        assert_eq!(
            labels(&Axis::linear(0.0, 130.0, 6)),
            ["0", "20", "40", "60", "80", "100", "120"]
        );
        assert_eq!(labels(&Axis::linear(-1.9, 1.9, 4)), ["−1", "0", "1"]);
        assert_eq!(labels(&Axis::linear(0.0, 2e-6, 2)), ["0", "1×10⁻⁶", "2×10⁻⁶"]);
        assert_eq!(labels(&Axis::linear(0.0, 1e6, 2)), ["0.0", "0.5×10⁶", "1.0×10⁶"]);
        assert_eq!(
            labels(&Axis::logarithmic(1.0, 25_000.0, 8)),
            ["1", "10", "100", "1000", "10000"]
        );
        assert_eq!(labels(&Axis::logarithmic(30.0, 300.0, 8)), ["50", "100", "200"]);
        assert_eq!(
            labels(&Axis::logarithmic(1e-9, 1e3, 5)),
            ["10⁻⁹", "10⁻⁶", "0.001", "1", "1000"]
        );
    }

    #[test]
    fn prop_a_constant_gets_an_axis_with_its_value_inside() {
        for value in [0.0, 5.0, -3.0, 1e-12, 1e12] {
            let axis = Axis::padded(value, value, 5);
            assert!(
                axis.low < value && value < axis.high && !axis.ticks.is_empty(),
                "{axis:?}"
            );
        }
    }

    proptest! {
        #[test]
        fn prop_ticks_are_few_inside_and_told_apart(low in -1e6f64..1e6, exponent in -3f64..6.0, wanted in 2usize..10) {
            let axis = Axis::linear(low, low + 10f64.powf(exponent), wanted);
            let labels = labels(&axis);
            prop_assert!(labels.len() >= 2 && labels.len() <= wanted * 3 / 2 + 2, "{labels:?}");
            prop_assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
            let spare = 1e-6 * (axis.high - axis.low);
            prop_assert!(axis.ticks.iter().all(|t| t.at >= axis.low - spare && t.at <= axis.high + spare));
        }

        #[test]
        fn prop_logarithmic_ticks_are_few_inside_and_told_apart(low in -12f64..6.0, decades in 0.5f64..15.0) {
            let axis = Axis::logarithmic(10f64.powf(low), 10f64.powf(low + decades), 6);
            let labels = labels(&axis);
            prop_assert!(!labels.is_empty() && labels.len() <= 9, "{labels:?}");
            prop_assert!(labels.windows(2).all(|pair| pair[0] != pair[1]), "{labels:?}");
        }
    }
}
