//! The uniform sample clock behind printed time stamps.
//!
//! Stamps in a file are rounded: `0.000033, 0.000067, 0.000100` is 30 kHz printed to a microsecond. The clock is found
//! from how exactly the stamps are printed:
//!
//! 1. each stamp `t_i` may be off by its rounding `q_i` (the last printed digit: `10^-decimals`, or the last
//!    significant digit where a program prints those), by [`ROUNDING_ULPS`] of floating point, or by
//!    [`HARMLESS_JITTER`] of a period, whichever is largest; but rounding is believed only up to
//!    [`COARSEST_ROUNDING`] of a period, so that a sample left out is never taken for rounding;
//! 2. where the printed step repeats exactly, it is the period; else the period is the number with the fewest digits,
//!    as a period or as a rate, that lies within the rounding of the first and last stamp.

/// Jitter that needs no resampling, in periods: at the steepest slope of a full-stroke sine with 50 samples a period
/// it moves the position by 6e-5 of the stroke, below the noise of the records this is for (1e-4 and more).
const HARMLESS_JITTER: f64 = 1e-3;

/// Rounding of stamps that is believed, in periods. A sample left out moves a stamp by a whole period and can then
/// never pass; above it the stamps do not fix the clock (48 kHz printed to 10 us).
const COARSEST_ROUNDING: f64 = 0.25;

/// Rounding of `start + i * period` in floating point, in units in the last place of the largest stamp: one for the
/// product, one for the sum, one for printing and reading, doubled.
const ROUNDING_ULPS: f64 = 6.0;

/// Digits of a period or rate that a person writes. A period of more is a computed one and stays to its last bit.
const WRITTEN_DIGITS: usize = 9;

/// Significant digits that tell all numbers of single precision apart.
const SINGLE_DIGITS: i32 = 9;

/// A uniform clock, in the unit of the stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Clock {
    pub(crate) start: f64,
    pub(crate) period: f64,
}

/// Why stamps are not a uniform clock. Indices count samples from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ClockFault {
    /// Fewer than two stamps.
    TooFew,
    /// Equal to or before the stamp before it.
    NotIncreasing { index: usize },
    /// The step to this stamp differs from the usual one (a sample is missing, the clock jitters, or the stamps are
    /// printed too coarsely to tell).
    Uneven {
        index: usize,
        step: f64,
        period: f64,
        allowed: f64,
    },
    /// The span of the stamps is no finite number, or too small against their size.
    Unrepresentable,
}

/// How exactly the stamps of a file are printed: collected while reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Printed {
    /// Most digits after the point (negative: zeros before it).
    decimals: i32,
    /// Most significant digits.
    digits: i32,
}

impl Printed {
    pub(crate) const NONE: Printed = Printed {
        decimals: -400,
        digits: 0,
    };

    /// Stamps from a binary file with so many significant digits: 7 for single, 17 for double precision.
    pub(crate) fn significant(digits: i32) -> Printed {
        Printed { decimals: 400, digits }
    }

    /// Takes note of a stamp's text, a valid number; `comma` says that its decimal sign is `,`.
    pub(crate) fn observe(&mut self, text: &[u8], comma: bool) {
        let point = if comma { b',' } else { b'.' };
        let (mut decimals, mut digits, mut after_point) = (0i32, 0i32, false);
        for (at, &byte) in text.iter().enumerate() {
            match byte {
                b'0'..=b'9' => {
                    digits += i32::from(digits > 0 || byte != b'0');
                    decimals += i32::from(after_point);
                }
                _ if byte == point => after_point = true,
                b'e' | b'E' => {
                    let exponent = std::str::from_utf8(&text[at + 1..])
                        .ok()
                        .and_then(|e| e.parse::<i32>().ok());
                    decimals -= exponent.unwrap_or(0).clamp(-400, 400);
                    break;
                }
                _ => {}
            }
        }
        self.decimals = self.decimals.max(decimals);
        self.digits = self.digits.max(digits);
    }

    /// The rounding of a stamp: one unit of its last printed digit.
    pub(crate) fn rounding(&self, stamp: f64) -> f64 {
        let fixed = power_of_ten(-self.decimals);
        if stamp == 0.0 || self.digits >= 17 {
            return fixed;
        }
        let leading = stamp.abs().log10().floor() as i32;
        fixed.max(power_of_ten(leading + 1 - self.digits.max(1)))
    }
}

fn power_of_ten(exponent: i32) -> f64 {
    10f64.powi(exponent.clamp(-400, 400))
}

/// Whether stamps up to `largest` can be told apart on a clock with this period, with room for the rounding of both.
pub(crate) fn is_representable(largest: f64, period: f64) -> bool {
    let room = 0.96; // so that what is written can be read: the period read differs by less than 1 %
    largest.is_finite() && ROUNDING_ULPS * ulp(largest) <= room * COARSEST_ROUNDING * period
}

/// The rate of a period, as a person writes it where the two differ by rounding only.
pub(crate) fn rate(period: f64) -> f64 {
    let rate = 1.0 / period;
    // 12 digits are more than any oscillator is good for; 4 units in the last place are what two divisions leave
    match round_to_digits(rate, 12) {
        Some(written) if (written - rate).abs() <= 4.0 * ulp(rate) => written,
        _ => rate,
    }
}

/// Finds the clock of the stamps; see the head of the file for the rules.
///
/// # Cost
/// Linear in the stamps; no memory unless there is a fault to describe.
pub(crate) fn infer(stamps: &[f64], printed: Printed) -> Result<Clock, ClockFault> {
    let (Some(&first), Some(&second), Some(&last)) = (stamps.first(), stamps.get(1), stamps.last()) else {
        return Err(ClockFault::TooFew);
    };
    if let Some(index) = stamps.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(ClockFault::NotIncreasing { index: index + 1 });
    }
    let largest = first.abs().max(last.abs());
    let steps = (stamps.len() - 1) as f64;
    let chord = (last - first) / steps;
    let floating = ROUNDING_ULPS * ulp(largest);
    if !chord.is_finite() || floating > COARSEST_ROUNDING * chord {
        return Err(ClockFault::Unrepresentable);
    }
    let test = Test {
        stamps,
        printed,
        floating,
    };
    for step in printed_steps(first, second, printed) {
        if test.passes(step, Some(floating)) {
            // what a person writes, where the stamps' own rounding cannot tell it from their step
            let mut written = up_to_digits(step, floating / steps, WRITTEN_DIGITS);
            let written = written.find(|period| test.passes(*period, Some(floating)));
            let period = written.unwrap_or(step);
            return Ok(Clock { start: first, period });
        }
    }
    let off = test
        .furthest(chord)
        .max(printed.rounding(first))
        .max(printed.rounding(last))
        .max(floating);
    let slack = off.min(COARSEST_ROUNDING * chord) / steps;
    for period in simplest(chord, slack) {
        if test.passes(period, None) {
            return Ok(Clock { start: first, period });
        }
    }
    Err(test.fault(chord))
}

/// The first step, as the two stamps print it.
fn printed_steps(first: f64, second: f64, printed: Printed) -> impl Iterator<Item = f64> {
    let step = second - first;
    let decimals = usize::try_from(printed.decimals)
        .ok()
        .filter(|&decimals| decimals <= 15);
    let rounded = decimals.and_then(|decimals| format!("{step:.decimals$}").parse::<f64>().ok());
    // of stamps in single precision the first step is no better than any other
    let exact = (decimals.is_some() || printed.digits > SINGLE_DIGITS).then_some(step);
    [rounded, exact].into_iter().flatten().filter(|step| *step > 0.0)
}

/// Numbers within `slack` of `period`, those with fewer digits (as a period, then as a rate) first; `period` last.
pub(crate) fn simplest(period: f64, slack: f64) -> impl Iterator<Item = f64> {
    up_to_digits(period, slack, 15).chain([period])
}

/// As [`simplest`], of numbers with so many digits at most, and without `period` itself.
fn up_to_digits(period: f64, slack: f64, digits: usize) -> impl Iterator<Item = f64> {
    (1..=digits).flat_map(move |digits| {
        let as_period = round_to_digits(period, digits);
        let as_rate = round_to_digits(1.0 / period, digits).map(|rate| 1.0 / rate);
        [as_period, as_rate]
            .into_iter()
            .flatten()
            .filter(move |candidate| (candidate - period).abs() <= slack)
    })
}

fn round_to_digits(value: f64, digits: usize) -> Option<f64> {
    format!("{:.*e}", digits - 1, value)
        .parse()
        .ok()
        .filter(|rounded: &f64| rounded.is_finite() && *rounded > 0.0)
}

/// Distance from a number to the next larger one.
fn ulp(value: f64) -> f64 {
    let value = value.abs();
    f64::from_bits(value.to_bits() + 1) - value
}

struct Test<'a> {
    stamps: &'a [f64],
    printed: Printed,
    floating: f64,
}

impl Test<'_> {
    /// How far a stamp may be off a clock with this period.
    fn allowed(&self, stamp: f64, period: f64) -> f64 {
        let rounding = self.printed.rounding(stamp).min(COARSEST_ROUNDING * period);
        rounding.max(self.floating).max(HARMLESS_JITTER * period)
    }

    /// Whether every stamp, and every step between two, fits the period, within `allowed` or the stamps' own rounding.
    fn passes(&self, period: f64, allowed: Option<f64>) -> bool {
        let start = self.stamps[0];
        let mut before = 0.0;
        self.stamps.iter().enumerate().all(|(index, &stamp)| {
            let off = stamp - (start + index as f64 * period);
            let allowed = allowed.unwrap_or_else(|| self.allowed(stamp, period) * (1.0 + 1e-9));
            let fits = off.abs() <= allowed && (off - before).abs() <= allowed;
            before = off;
            fits
        })
    }

    /// The largest distance of a stamp from the clock.
    fn furthest(&self, period: f64) -> f64 {
        let start = self.stamps[0];
        let off = |(index, &stamp): (usize, &f64)| (stamp - (start + index as f64 * period)).abs();
        self.stamps.iter().enumerate().map(off).fold(0.0, f64::max)
    }

    /// What to say when no clock fits: the first step that is off the usual (median) one, else the stamp that is
    /// furthest off.
    fn fault(&self, chord: f64) -> ClockFault {
        let mut steps: Vec<f64> = self.stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let middle = steps.len() / 2;
        let (_, &mut period, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
        let uneven = |index: usize, allowed: f64, period: f64| ClockFault::Uneven {
            index,
            step: self.stamps[index] - self.stamps[index - 1],
            period,
            allowed,
        };
        for (index, pair) in self.stamps.windows(2).enumerate() {
            let allowed = self.allowed(pair[1], period);
            if (pair[1] - pair[0] - period).abs() > allowed {
                return uneven(index + 1, allowed, period);
            }
        }
        let start = self.stamps[0];
        let off = |index: usize| (self.stamps[index] - (start + index as f64 * chord)).abs();
        let worst = (1..self.stamps.len())
            .max_by(|&a, &b| off(a).total_cmp(&off(b)))
            .unwrap_or(1);
        uneven(worst, self.allowed(self.stamps[worst], chord), chord)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expect: Result<(f64, f64), ClockFault>) {
        let mut printed = Printed::NONE;
        let stamps: Vec<f64> = text
            .split_whitespace()
            .map(|stamp| {
                printed.observe(stamp.as_bytes(), false);
                stamp.parse().unwrap()
            })
            .collect();
        let found = infer(&stamps, printed).map(|clock| (clock.start, clock.period));
        assert_eq!(found, expect, "{text}");
    }

    fn printed_at(rate_hz: f64, samples: usize, print: impl Fn(f64) -> String) -> String {
        let stamps: Vec<String> = (0..samples).map(|index| print(index as f64 / rate_hz)).collect();
        stamps.join(" ")
    }

    #[test]
    fn val_exact_and_rounded_stamps() {
        check("0 0.0002 0.0004 0.0006000000000000001", Ok((0.0, 0.0002)));
        check("0.000000 0.000625 0.001250", Ok((0.0, 0.000625)));
        check("0 1", Ok((0.0, 1.0)));
        check("1 3 5 7", Ok((1.0, 2.0)));
        check("-0.2 -0.1 0.0 0.1", Ok((-0.2, 0.1)));
        check("0 2e-5 4e-5 6E-05", Ok((0.0, 2e-5)));
        check("0.000000 0.000033 0.000067 0.000100 0.000133", Ok((0.0, 1.0 / 30000.0)));
        check(
            "1700000000.0001 1700000000.0002 1700000000.0003",
            Ok((1_700_000_000.000_1, 0.0001)),
        );
    }

    #[test]
    fn val_rates_come_back_from_rounded_stamps() {
        for rate in [3.6, 60.0, 1600.0, 4999.7, 12e3, 30e3, 44.1e3, 48e3, 50e3] {
            let text = printed_at(rate, 5000, |t| format!("{t:.6}"));
            check(&text, Ok((0.0, 1.0 / rate)));
            check(&printed_at(rate, 1000, |t| format!("{t:?}")), Ok((0.0, 1.0 / rate)));
        }
        // six and seven significant digits, as `%g` and numpy's `%.7g` print
        for rate in [1000.0, 5000.0] {
            check(
                &printed_at(rate, 9000, |t| {
                    format!("{}", format!("{t:.6e}").parse::<f64>().unwrap())
                }),
                Ok((0.0, 1.0 / rate)),
            );
        }
        // truncated instead of rounded
        check(
            &printed_at(30e3, 5000, |t| format!("{:.6}", (t * 1e6 + 1e-6).floor() / 1e6)),
            Ok((0.0, 1.0 / 30e3)),
        );
    }

    /// A clock that begins late has steps that are off by the rounding of its stamps.
    #[test]
    fn regress_a_rate_is_what_a_person_writes() {
        for rate_hz in [12e3, 50e3, 48e3, 30e3, 7.0, 4999.7] {
            for start_s in [0.0, 0.3, 17.77] {
                let stamps: Vec<f64> = (0..400).map(|k| start_s + f64::from(k) / rate_hz).collect();
                let clock = infer(&stamps, Printed::significant(17)).unwrap();
                assert_eq!(rate(clock.period), rate_hz, "from {start_s} s");
            }
        }
        // 1 / (1 / 49) is not 49
        assert!((1..100_000).all(|rate_hz| rate(1.0 / f64::from(rate_hz)) == f64::from(rate_hz)));
        assert_eq!(rate(std::f64::consts::PI), 1.0 / std::f64::consts::PI);
    }

    #[test]
    fn refuse_stamps_without_a_uniform_clock() {
        check("", Err(ClockFault::TooFew));
        check("1", Err(ClockFault::TooFew));
        check("0 1 1 2", Err(ClockFault::NotIncreasing { index: 2 }));
        check("0 1 0.5 2", Err(ClockFault::NotIncreasing { index: 2 }));
        // a sample left out is found where it is, also when the stamps are integers
        let uneven = |index, step, period, allowed| {
            Err(ClockFault::Uneven {
                index,
                step,
                period,
                allowed,
            })
        };
        check("0 1 2 4 5 6 7", uneven(3, 2.0, 1.0, 0.25));
        check("0 1 2 3 5", uneven(4, 2.0, 1.0, 0.25));
        check("0.00 0.10 0.20 0.40", uneven(3, 0.2, 0.1, 0.01));
        // 48 kHz printed to ten microseconds
        let coarse = infer(
            &[0.0, 2e-5, 4e-5, 6e-5, 8e-5, 10e-5, 13e-5, 15e-5, 17e-5],
            Printed { decimals: 5, digits: 2 },
        );
        assert!(matches!(coarse, Err(ClockFault::Uneven { index: 6, .. })), "{coarse:?}");
        check("1e308 1.5e308", Ok((1e308, 5e307)));
        check("-1.5e308 1.5e308", Err(ClockFault::Unrepresentable));
        check("1e16 10000000000000002", Err(ClockFault::Unrepresentable));
    }

    #[test]
    fn val_harmless_jitter_passes_and_more_does_not() {
        let jittering = |size: f64| {
            let stamps: Vec<f64> = (0..1000)
                .map(|i| 0.001 * f64::from(i) + if i % 3 == 1 { size * 0.001 } else { 0.0 })
                .collect();
            infer(
                &stamps,
                Printed {
                    decimals: 400,
                    digits: 17,
                },
            )
        };
        let clock = jittering(0.9 * HARMLESS_JITTER).unwrap();
        assert!((clock.period / 0.001 - 1.0).abs() < 1e-6, "{clock:?}");
        assert!(matches!(
            jittering(1.2 * HARMLESS_JITTER),
            Err(ClockFault::Uneven { index: 1, .. })
        ));
    }
}
