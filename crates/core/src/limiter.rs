//! Range and slew limits of a command.

use crate::error::{ParamError, finite, in_range};
use crate::real::{Real, rarely};

/// Keeps a command within a range and its changes within a slew rate.
///
/// # Units
/// Limits in the command's unit; slew in that unit a second.
/// # Cost
/// 3 compares and an addition a step; 2 compares and an addition more where the command meets a limit.
/// # Example
/// ```
/// use hysteron_core::limiter::Limiter;
/// let limiter = Limiter::new(0.0, 100.0, 1e4, 50e3)?; // volts, 10 V/ms at 50 kHz
/// let mut state = limiter.start_at(0.0);
/// let first: f64 = limiter.step(&mut state, 150.0);
/// assert!((first - 0.2).abs() < 1e-12 && state.limited());
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limiter<T> {
    min: T,
    max: T,
    largest_change: T,
    /// A little less: a change of this much, as it is computed, is not above the largest, however either is rounded.
    usual_change: T,
}

/// The last command that was let through, and what had been asked for; for limiters of one range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimiterState<T> {
    last: T,
    asked: T,
}

impl<T: Real> Limiter<T> {
    /// Builds a limiter.
    ///
    /// # Errors
    /// - Limits that are not finite or not ascending.
    /// - A slew rate that is not finite, or so slow that the number type loses a sample's change beside the largest
    ///   limit: in `f32`, 200 V at 50 kHz need at least 3 V/s, or the output would stand still.
    pub fn new(min: T, max: T, slew_per_s: T, sample_rate_hz: T) -> Result<Self, ParamError> {
        finite("lower limit", None, min)?;
        finite("upper limit", None, max)?;
        if max <= min {
            let (value, previous) = (max.to_f64(), min.to_f64());
            return Err(ParamError::NotIncreasing {
                name: "limit",
                index: 2,
                value,
                previous,
            });
        }
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        let spacing = spacing_at(min.magnitude().select_max(max.magnitude()));
        // Four spacings: rounding then changes a step by an eighth at most.
        let slowest = 4.0 * spacing.to_f64() * sample_rate_hz.to_f64();
        in_range("slew_per_s", None, slew_per_s, slowest, f64::MAX)?;
        let largest_change = slew_per_s / sample_rate_hz;
        Ok(Self {
            min,
            max,
            largest_change,
            usual_change: largest_change - T::from_f64(4.0) * spacing,
        })
    }

    /// Lowest and highest output, and its largest change a sample.
    pub fn limits(&self) -> [T; 3] {
        [self.min, self.max, self.largest_change]
    }

    /// State with the output at a value (brought into the range).
    pub fn start_at(&self, value: T) -> LimiterState<T> {
        let last = self.min.select_max(value).select_min(self.max);
        LimiterState { last, asked: last }
    }

    /// One sample. A command that is not finite holds the last one and counts as limited.
    #[inline(always)]
    pub fn step(&self, state: &mut LimiterState<T>, command: T) -> T {
        if self.lets_through(state, command) {
            return command;
        }
        rarely();
        if command.is_finite() {
            return self.limit(state, command);
        }
        state.asked = command;
        state.last
    }

    /// Brings a finite command within the limits.
    #[inline(always)]
    pub(crate) fn limit(&self, state: &mut LimiterState<T>, command: T) -> T {
        let lowest = self.min.select_max(state.last - self.largest_change);
        let highest = self.max.select_min(state.last + self.largest_change);
        let allowed = if T::MAX_INSTRUCTION {
            lowest.select_max(command).select_min(highest)
        } else if command > highest {
            highest
        } else if command >= lowest {
            command
        } else {
            lowest
        };
        *state = LimiterState {
            last: allowed,
            asked: command,
        };
        allowed
    }

    /// The usual sample, a command well within all limits; changes nothing where it is not. A NaN is not.
    ///
    /// Never with [`Real::MAX_INSTRUCTION`]: [`Self::limit`] is then as short as the question.
    #[inline(always)]
    pub(crate) fn lets_through(&self, state: &mut LimiterState<T>, command: T) -> bool {
        let within = !T::MAX_INSTRUCTION
            && command >= self.min
            && command <= self.max
            && (command - state.last).magnitude() <= self.usual_change;
        if within {
            *state = LimiterState {
                last: command,
                asked: command,
            };
        }
        within
    }
}

/// The spacing of the number type's values at `magnitude`, to a factor of 2 upwards: the smallest power-of-two share of
/// it that still changes it when added.
fn spacing_at<T: Real>(magnitude: T) -> T {
    let half = T::from_f64(0.5);
    let mut spacing = magnitude;
    // Ends after at most 54 halvings, the digits of `f64`.
    while magnitude + spacing * half != magnitude {
        spacing = spacing * half;
    }
    spacing
}

impl<T: Real> LimiterState<T> {
    /// Whether the last command was changed.
    #[inline(always)]
    pub fn limited(&self) -> bool {
        self.asked != self.last
    }

    /// The last command that was let through.
    pub fn last(&self) -> T {
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The distance from 1 to the next number, of both types.
    #[test]
    fn val_spacing_of_numbers() {
        assert_eq!(spacing_at(1.0_f64), f64::EPSILON);
        assert_eq!(spacing_at(1.0_f32), f32::EPSILON);
        let of_100 = spacing_at(100.0_f64);
        assert!(100.0 + of_100 != 100.0 && 100.0 + 0.5 * of_100 == 100.0);
    }

    /// The short way is taken where it is the shorter one.
    #[test]
    fn val_the_usual_command_takes_the_short_way() {
        let limiter = Limiter::new(0.0, 10.0, 100.0, 50.0).unwrap();
        let mut state = limiter.start_at(5.0);
        assert_eq!(limiter.lets_through(&mut state, 5.5), !f64::MAX_INSTRUCTION);
        assert!(!limiter.lets_through(&mut state, 11.0) && !limiter.lets_through(&mut state, f64::NAN));
    }

    #[test]
    fn val_range_and_slew() {
        let limiter = Limiter::new(0.0, 10.0, 100.0, 50.0).unwrap(); // 2 a sample
        let mut state = limiter.start_at(-5.0);
        let outputs = [4.0, 4.0, 4.0, 20.0, 20.0, 20.0, 20.0].map(|command| limiter.step(&mut state, command));
        assert_eq!(outputs, [2.0, 4.0, 4.0, 6.0, 8.0, 10.0, 10.0]);
        assert!(state.limited());
        assert_eq!(limiter.step(&mut state, f64::NAN), 10.0);
        assert_eq!(limiter.step(&mut state, f64::NEG_INFINITY), 10.0);
    }

    /// What the way that most samples take may not let through, a case a line: where the command was, where it is asked to go, and what
    /// comes of it. Limits of -10 and 10, 1 a sample.
    #[test]
    fn bva_what_is_not_let_through() {
        let limiter = Limiter::new(-10.0_f64, 10.0, 50.0, 50.0).unwrap();
        assert_eq!(limiter.limits(), [-10.0, 10.0, 1.0]);
        let cases = [
            (-10.0, -10.5, -10.0),
            (10.0, 10.5, 10.0),
            // As far on the other side of 0.
            (2.0, -2.0, 1.0),
            (-2.0, 2.0, -1.0),
            // Less than twice the last, or a part of it.
            (9.0, 4.0, 8.0),
            (-9.0, -4.0, -8.0),
            (4.0, 9.0, 5.0),
            (-4.0, -9.0, -5.0),
            (9.5, 10.5, 10.0),
            (-9.5, -10.5, -10.0),
        ];
        for (last, asked, wanted) in cases {
            let mut state = limiter.start_at(last);
            assert_eq!(limiter.step(&mut state, asked), wanted, "{last} {asked}");
            assert!(state.limited() && state.last() == wanted);
        }
        for (last, asked) in [
            (-10.0, -10.0),
            (10.0, 10.0),
            (3.0, 3.9),
            (3.0, 2.1),
            (3.0, 4.0),
            (3.0, 2.0),
        ] {
            let mut state = limiter.start_at(last);
            assert_eq!(limiter.step(&mut state, asked), asked, "{last} {asked}");
            assert!(!state.limited() && state.last() == asked);
        }
    }

    /// Just above the slowest slew that is accepted, the `f32` output still arrives, at the slew asked for within 1/8.
    #[test]
    fn val_slowest_slew_moves() {
        let limiter = Limiter::new(0.0_f32, 200.0, 4.0, 50e3).unwrap();
        let mut state = limiter.start_at(150.0);
        for _ in 0..50_000 {
            limiter.step(&mut state, 200.0);
        }
        assert!((state.last() - 154.0).abs() < 0.5, "{}", state.last());
    }

    /// In `f32` a slow slew rate used to freeze the output: 150 V + 2 uV rounds to 150 V.
    #[test]
    fn regress_slew_below_the_number_types_resolution() {
        use std::string::ToString;
        assert_eq!(
            Limiter::new(0.0_f32, 200.0, 0.1, 50e3).unwrap_err().to_string(),
            "slew_per_s = 0.1 must be finite and at least 2.384185791015625"
        );
        // The same limits in f64 are fine.
        assert!(Limiter::new(0.0_f64, 200.0, 0.1, 50e3).is_ok());
    }

    #[test]
    fn refuse_bad_limits() {
        assert!(Limiter::new(1.0, 1.0, 1.0, 1.0).is_err());
        assert!(Limiter::new(0.0, 1.0, 0.0, 1.0).is_err());
        assert!(Limiter::new(0.0, f64::INFINITY, 1.0, 1.0).is_err());
    }
}
