//! Gain, zero and lag of the feedforward, learned slowly while the law runs.

use crate::effects::admit;
use crate::error::{ParamError, in_range};
use crate::real::Real;

/// Length of a block whose mean is one step of learning: noise is averaged, and a period of 10 Hz still has a hundred of them.
const BLOCK_S: f64 = 1e-3;
/// Largest change of the gain that may be learned: a stage that changes by more is another one.
const LARGEST_GAIN_CHANGE: f64 = 0.2;

/// The target of the inverse becomes `x + g x + z + L x'`: `g`, `z` and `L` follow what position and feedback say that the feedforward misses.
///
/// `m = e + c v_fb` is what the feedforward misses: the error and what the feedback added, in micrometres. Once in a block of about 1 ms,
/// on means over it, `g += (T / tau) m~ x~ / P` and `z += (T / tau) m`. The tilde takes off a running mean and `P` is a running mean of
/// `x~^2`, both over `tau`. A reference that stands has no `x~`: then the gain does not move, and the zero alone follows. So no part has
/// to be drawn back to where it began, and none is.
///
/// The lag has the same law, `L += (T / tau) <m~ x'> / Q` with `Q` the running mean of `x'^2`, and its products are formed at every sample:
/// a period may be as short as a block. What the hysteresis misses is a lag to a slow reference, and a wrong one to a fast one: `L` learns
/// only where the rms of `x'` is that of a sine at `lag_from_hz` and more, and it acts on no motion faster than `lag_up_to_um_per_s`.
///
/// A dead zone takes noise off `m` and `m~`. Gain and lag learn only where their bound times the rms of `x~` and `x'` exceeds that zone. A
/// block with a reading that is no number or stands in for a bad one, or a sample that may not count, is thrown away whole.
///
/// # Units
/// Micrometres; the gain is a share, the lag is in samples.
/// # Range
/// All stay within their bounds. In one `tau` gain and lag move by their bound at most.
/// # Cost
/// 9 additions, 4 multiplies and 6 compares a step; once a block 3 divisions and 20 multiply-adds.
/// # Reference
/// Goodwin, Sin, Adaptive Filtering, Prediction and Control (1984), normalised gradient with dead zone and projection.
/// # Example
/// ```
/// use hysteron_core::adaptation::{Adaptation, AdaptationNumbers, AdaptationState, Sample};
/// let numbers = AdaptationNumbers {
///     gain_bound: 0.05,
///     zero_bound_um: 0.1,
///     lag_bound_s: 10e-6,
///     lag_from_hz: 250.0,
///     lag_up_to_um_per_s: 30e3,
///     time_s: 1.0,
///     dead_um: 0.001,
///     um_per_v: 0.1,
/// };
/// let adaptation = Adaptation::<f64>::new(&numbers, 50e3)?;
/// let mut state = AdaptationState::default();
/// for _ in 0..500_000 {
///     let missed = 0.03 - state.zero(); // a zero that is off by 0.03 um, a reference that stands
///     let sample = Sample { motion: 5.0, error: missed, correction: 0.0, counts: true };
///     adaptation.learn(&mut state, sample);
/// }
/// assert!((state.zero() - 0.029).abs() < 1e-5 && state.gain() == 0.0); // up to the dead zone
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adaptation<T> {
    gain_bound: T,
    zero_bound: T,
    dead: T,
    um_per_v: T,
    samples: u32,
    share_of_a_sample: T,
    rate: T,
    least_square: T,
    lag_bound: T,
    fastest: T,
    least_rise: T,
    slow: T,
}

/// What is learned while a law runs, how far, and from what.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdaptationNumbers {
    /// Most that the gain may change, a share.
    pub gain_bound: f64,
    /// Most that the zero may change.
    pub zero_bound_um: f64,
    /// Most that the lag may change; 0 learns none.
    pub lag_bound_s: f64,
    /// Slowest sine that the lag is learned from.
    pub lag_from_hz: f64,
    /// Fastest motion that a lag is undone of, and learned from.
    pub lag_up_to_um_per_s: f64,
    /// Time constant of learning.
    pub time_s: f64,
    /// What of a miss is taken for noise.
    pub dead_um: f64,
    /// Motion of the stage for a volt.
    pub um_per_v: f64,
}

/// What is learned, and the means that it is learned from.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AdaptationState<T> {
    gain: T,
    zero: T,
    lag: T,
    /// The last target that was no other than a number, before what is learned.
    target: T,
    last_motion: T,
    sum_motion: T,
    sum_missed: T,
    sum_late: T,
    sum_rise: T,
    taken: u32,
    spoilt: bool,
    /// A sample of the block rose faster than a lag is learned from.
    jumped: bool,
    means: Option<Means<T>>,
}

/// Running means over blocks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Means<T> {
    motion: T,
    missed: T,
    square: T,
    rise: T,
    /// Time that the means were formed over, in time constants.
    age: T,
}

/// What a sample of the loop shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<T> {
    /// Reference that is due, above the rest, micrometres.
    pub motion: T,
    /// That reference less the position, micrometres; no number where the sensor is in doubt.
    pub error: T,
    /// What the feedback added to the command, volts.
    pub correction: T,
    /// Whether the command was the law's own: not limited, and not on the way from rest.
    pub counts: bool,
}

impl<T: Real> Adaptation<T> {
    /// Builds it, at a sample rate (Hz).
    ///
    /// # Errors
    /// A gain outside 1e-4 to 0.2, a zero outside 0 to 1e3 um, a lag outside 0 to 1e-3 s, learned from outside 0 to 1e6 Hz or up to outside 0
    /// to 1e9 um/s, a time constant outside 0.1 to 1e3 s, a dead zone outside 1e-6 to 1e3 um, a motion for a volt outside 0 to 1e3 um, a
    /// sample rate outside 100 to 1e7 Hz.
    pub fn new(numbers: &AdaptationNumbers, sample_rate_hz: f64) -> Result<Self, ParamError> {
        let &AdaptationNumbers {
            gain_bound,
            zero_bound_um,
            lag_bound_s,
            lag_from_hz,
            lag_up_to_um_per_s,
            time_s,
            dead_um,
            um_per_v,
        } = numbers;
        in_range("adapted gain", None, gain_bound, 1e-4, LARGEST_GAIN_CHANGE)?;
        in_range("adapted zero", None, zero_bound_um, 0.0, 1e3)?;
        in_range("adapted lag", None, lag_bound_s, 0.0, 1e-3)?;
        in_range("lag_from_hz of adaptation", None, lag_from_hz, 0.0, 1e6)?;
        in_range("lag_up_to_um_per_s of adaptation", None, lag_up_to_um_per_s, 0.0, 1e9)?;
        in_range("time constant of adaptation", None, time_s, 0.1, 1e3)?;
        in_range("dead zone of adaptation", None, dead_um, 1e-6, 1e3)?;
        in_range("um_per_v of adaptation", None, um_per_v, 0.0, 1e3)?;
        in_range("sample_rate_hz", None, sample_rate_hz, 100.0, 1e7)?;
        // Rounded; at least one.
        let samples = ((BLOCK_S * sample_rate_hz + 0.5) as u32).max(1);
        let block_s = f64::from(samples) / sample_rate_hz;
        let least = dead_um / gain_bound;
        let lag_bound = lag_bound_s * sample_rate_hz;
        // No lag to learn: no rise is enough.
        let least_rise = if lag_bound > 0.0 { dead_um / lag_bound } else { 1e15 };
        let slow = core::f64::consts::TAU * lag_from_hz / sample_rate_hz;
        Ok(Self {
            gain_bound: T::from_f64(gain_bound),
            zero_bound: T::from_f64(zero_bound_um),
            dead: T::from_f64(dead_um),
            um_per_v: T::from_f64(um_per_v),
            samples,
            share_of_a_sample: T::from_f64(1.0 / f64::from(samples)),
            rate: T::from_f64(block_s / time_s),
            least_square: T::from_f64(least * least),
            lag_bound: T::from_f64(lag_bound),
            fastest: T::from_f64(lag_up_to_um_per_s / sample_rate_hz),
            least_rise: T::from_f64(least_rise * least_rise),
            slow: T::from_f64(slow * slow),
        })
    }

    /// Bounds of gain and zero, dead zone, motion for a volt, share of a sample in a block, rate of learning, least mean square of the
    /// swing; bound of the lag (samples), fastest motion (um a sample), least mean square of the rise, its least share of that of the swing;
    /// and the samples of a block.
    pub fn coefficients(&self) -> ([T; 11], u32) {
        let numbers = [
            self.gain_bound,
            self.zero_bound,
            self.dead,
            self.um_per_v,
            self.share_of_a_sample,
            self.rate,
            self.least_square,
            self.lag_bound,
            self.fastest,
            self.least_rise,
            self.slow,
        ];
        (numbers, self.samples)
    }

    /// The target of the inverse with what was learned.
    #[inline(always)]
    pub fn adapted(&self, state: &mut AdaptationState<T>, target: T) -> T {
        let rise = target - state.target;
        state.target = admit(target, state.target);
        // A NaN fails the comparison.
        let late = if rise.magnitude() <= self.fastest {
            state.lag * rise
        } else {
            T::ZERO
        };
        target + state.gain * target + state.zero + late
    }

    /// One sample.
    #[inline(always)]
    pub fn learn(&self, state: &mut AdaptationState<T>, sample: Sample<T>) {
        let missed = sample.error + self.um_per_v * sample.correction;
        // A NaN fails the comparison.
        let usable = missed.magnitude() <= T::from_f64(1e6) && sample.motion.magnitude() <= T::from_f64(1e6);
        if usable && sample.counts {
            let rise = sample.motion - state.last_motion;
            let mean = state.means.map_or(T::ZERO, |means| means.missed);
            state.last_motion = sample.motion;
            state.jumped |= rise.magnitude() > self.fastest;
            state.sum_motion += sample.motion;
            state.sum_missed += missed;
            state.sum_late += self.beyond_noise(missed - mean) * rise;
            state.sum_rise += rise * rise;
        } else {
            state.spoilt = true;
        }
        state.taken += 1;
        if state.taken >= self.samples {
            self.end_block(state);
        }
    }

    /// Learns from the means over a block, and begins the next.
    #[inline(never)]
    fn end_block(&self, state: &mut AdaptationState<T>) {
        let [motion, missed, late, rise] = [state.sum_motion, state.sum_missed, state.sum_late, state.sum_rise]
            .map(|sum| sum * self.share_of_a_sample);
        let (spoilt, jumped) = (state.spoilt, state.jumped);
        (state.sum_motion, state.sum_missed) = (T::ZERO, T::ZERO);
        (state.sum_late, state.sum_rise) = (T::ZERO, T::ZERO);
        (state.taken, state.spoilt, state.jumped) = (0, false, false);
        if spoilt {
            // A sample may be missing: the next rise would be over more than one.
            state.jumped = true;
            return;
        }
        let mut means = state.means.unwrap_or(Means {
            motion,
            missed,
            square: T::ZERO,
            rise: T::ZERO,
            age: T::ZERO,
        });
        let (swing, missed_swing) = (motion - means.motion, missed - means.missed);
        means.motion += self.rate * swing;
        means.missed += self.rate * missed_swing;
        means.square += self.rate * (swing * swing - means.square);
        if !jumped {
            means.rise += self.rate * (rise - means.rise);
        }
        means.age = (means.age + self.rate).select_min(T::ONE);
        state.means = Some(means);
        if means.square > self.least_square {
            let asked = self.beyond_noise(missed_swing) * (swing / means.square);
            let step = within(admit(asked, T::ZERO), self.gain_bound);
            state.gain = within(state.gain + self.rate * step, self.gain_bound);
        }
        // Before a time constant is over, a slow reference may have risen without a swing.
        let quick = means.age >= T::ONE && means.rise > self.slow * means.square;
        if !jumped && quick && means.rise > self.least_rise {
            let step = within(admit(late / means.rise, T::ZERO), self.lag_bound);
            state.lag = within(state.lag + self.rate * step, self.lag_bound);
        }
        let zero = state.zero + self.rate * self.beyond_noise(missed);
        state.zero = within(zero, self.zero_bound);
    }

    #[inline(always)]
    fn beyond_noise(&self, missed: T) -> T {
        missed - within(missed, self.dead)
    }
}

#[inline(always)]
fn within<T: Real>(value: T, bound: T) -> T {
    value.select_min(bound).select_max(-bound)
}

impl<T: Real> AdaptationState<T> {
    /// The reading of this sample is none of the sensor's: the block that it belongs to teaches nothing.
    pub(crate) fn spoil_block(&mut self) {
        self.spoilt = true;
    }

    /// Learned change of the gain: a share of the motion.
    pub fn gain(&self) -> T {
        self.gain
    }

    /// Learned change of the zero, micrometres.
    pub fn zero(&self) -> T {
        self.zero
    }

    /// Learned lag, samples: how much later than the feedforward expects the stage answers.
    pub fn lag(&self) -> T {
        self.lag
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gain, zero, time, dead zone, motion for a volt; a lag of two samples of 1 kHz, learned from 10 Hz and up to 5 um a sample.
    fn numbers([gain_bound, zero_bound_um, time_s, dead_um, um_per_v]: [f64; 5]) -> AdaptationNumbers {
        AdaptationNumbers {
            gain_bound,
            zero_bound_um,
            lag_bound_s: 1e-3,
            lag_from_hz: 10.0,
            lag_up_to_um_per_s: 5e3,
            time_s,
            dead_um,
            um_per_v,
        }
    }

    fn part<T: Real>(values: [f64; 5], sample_rate_hz: f64) -> Adaptation<T> {
        Adaptation::new(&numbers(values), sample_rate_hz).unwrap()
    }

    fn small() -> Adaptation<f32> {
        part([0.05, 0.1, 0.1, 0.001, 0.1], 1e3)
    }

    #[test]
    fn prop_finite_and_within_bounds_for_every_input() {
        let part = small();
        let mut state = AdaptationState::default();
        let numbers = [f32::NAN, f32::INFINITY, f32::MAX, f32::MIN, 1e6, -1e6, 1e-30, 0.0, 3.0];
        for motion in numbers {
            for error in numbers {
                for correction in numbers {
                    for _ in 0..3 {
                        part.learn(
                            &mut state,
                            Sample {
                                motion,
                                error,
                                correction,
                                counts: true,
                            },
                        );
                        assert!(state.gain().abs() <= 0.05 && state.zero().abs() <= 0.1 && state.lag().abs() <= 1.0);
                        assert!(part.adapted(&mut state, 10.0).is_finite());
                    }
                }
            }
        }
    }

    /// Blocks of 1 ms: 50 samples at 50 kHz, and 1.6 at 1.6 kHz, of which 2 are 1.25 ms. A swing of 1 nm / 0.05 = 0.02 um is the least.
    #[test]
    fn val_coefficients_by_hand() {
        let of = |time_s, rate_hz| part::<f64>([0.05, 0.1, time_s, 0.001, 0.2], rate_hz);
        for (part, rate_hz, wanted, samples) in [
            (
                of(1.0, 50e3),
                50e3,
                [0.05, 0.1, 0.001, 0.2, 0.02, 0.001, 0.0004, 50.0, 0.1, 4e-10],
                50,
            ),
            (
                of(0.5, 1.6e3),
                1.6e3,
                [0.05, 0.1, 0.001, 0.2, 0.5, 0.0025, 0.0004, 1.6, 3.125, 3.906_25e-7],
                2,
            ),
            (
                of(0.5, 400.0),
                400.0,
                [0.05, 0.1, 0.001, 0.2, 1.0, 0.005, 0.0004, 0.4, 12.5, 6.25e-6],
                1,
            ),
        ] {
            let (found, taken) = part.coefficients();
            assert_eq!(taken, samples);
            for (found, wanted) in found.into_iter().zip(wanted) {
                assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
            }
            let slow = core::f64::consts::TAU * 10.0 / rate_hz;
            assert!((found[10] - slow * slow).abs() < 1e-15);
        }
    }

    /// Blocks of two samples, 1 ms; `rate` 0.008. The first sets the means 2 and 0.05. The second has a swing of 4 and asks for more than the
    /// bound; the third, of -1, asks for `0.0002 (-1 / 0.134976)`.
    #[test]
    fn val_three_blocks_by_hand() {
        let part = part::<f64>([0.1, 1.0, 0.125, 0.001, 0.5], 2e3);
        let mut state = AdaptationState::default();
        let blocks = [
            ([(1.0, 0.02, 0.04), (3.0, 0.06, 0.0)], 0.0, 0.000_392),
            ([(6.0, 0.03, 0.0), (6.0, 0.04, -0.02)], -0.000_8, 0.000_624),
            (
                [(1.032, 0.051_04, 0.0), (1.032, 0.051_04, 0.0)],
                -0.000_811_853_96,
                0.001_024_32,
            ),
        ];
        for (samples, gain, zero) in blocks {
            for (motion, error, correction) in samples {
                let sample = Sample {
                    motion,
                    error,
                    correction,
                    counts: true,
                };
                part.learn(&mut state, sample);
            }
            let (gain_off, zero_off) = (state.gain() - gain, state.zero() - zero);
            assert!(
                gain_off.abs() < 1e-11 && zero_off.abs() < 1e-12,
                "{} {}, {} {}",
                state.gain(),
                gain,
                state.zero(),
                zero
            );
        }
        // 10 - 10 x 0.00081185396 + 0.00102432
        assert!((part.adapted(&mut state, 10.0) - 9.992_905_780_4).abs() < 1e-9);
    }

    /// Blocks of one sample, `rate` 1/100, a bound of one sample: the recurrence beside the law, on rises that ask for less than the bound and
    /// for more.
    #[test]
    fn val_lag_by_a_second_recurrence() {
        let values = AdaptationNumbers {
            lag_from_hz: 0.0,
            lag_up_to_um_per_s: 2e3,
            ..numbers([0.1, 1e3, 0.1, 1e-6, 0.0])
        };
        let part = Adaptation::<f64>::new(&values, 1e3).unwrap();
        let rate = 0.01;
        let mut state = AdaptationState::default();
        let (mut mean, mut square, mut lag) = (0.0, 0.0, 0.0);
        let mut last = 0.0;
        let told = Sample {
            motion: 0.0,
            error: 0.0,
            correction: 0.0,
            counts: true,
        };
        // A time constant of rest, before which no lag is learned.
        (0..100).for_each(|_| part.learn(&mut state, told));
        for (motion, error) in [(2.0, 0.01), (0.0, -0.03), (2.0, 0.2), (1.5, 0.0)] {
            let rise: f64 = motion - last;
            let from_mean: f64 = error - mean;
            let heard = from_mean - from_mean.clamp(-1e-6, 1e-6);
            square += rate * (rise * rise - square);
            if square > 0.0 {
                let step: f64 = heard * rise / square;
                lag = (lag + rate * step.clamp(-1.0, 1.0)).clamp(-1.0, 1.0);
            }
            mean += rate * from_mean;
            last = motion;
            part.learn(&mut state, Sample { motion, error, ..told });
            assert!((state.lag() - lag).abs() < 1e-12, "{motion}: {} {lag}", state.lag());
        }
        assert!(lag > 0.005, "{lag}");
        // Undone of a rise of 2 um, and of none above.
        let (gain, zero) = (state.gain(), state.zero());
        assert!((part.adapted(&mut state, 2.0) - (2.0 + 2.0 * gain + zero + 2.0 * lag)).abs() < 1e-12);
        assert!((part.adapted(&mut state, 4.1) - (4.1 + 4.1 * gain + zero)).abs() < 1e-12);
        assert!((part.adapted(&mut state, 3.1) - (3.1 + 3.1 * gain + zero - lag)).abs() < 1e-12);
    }

    /// The least swing, exactly: `rate` 1/16 of a square of 1/4 is the square of 1/64 / 1/8. It teaches no gain, a little more does.
    #[test]
    fn bva_the_least_swing() {
        let part = part::<f64>([0.125, 1.0, 0.125, 0.015_625, 0.0], 128.0);
        for (motion, learns) in [(0.5, false), (-0.5, false), (0.500_1, true), (-0.500_1, true)] {
            let mut state = AdaptationState::default();
            for (motion, error) in [(0.0, 0.0), (motion, 1.0)] {
                let sample = Sample {
                    motion,
                    error,
                    correction: 0.0,
                    counts: true,
                };
                part.learn(&mut state, sample);
            }
            assert_eq!(state.gain() != 0.0, learns, "{motion}: {}", state.gain());
        }
    }

    /// A number of 1e6 um still counts, more does not, of either signal.
    #[test]
    fn bva_the_largest_sample_that_counts() {
        let part = part::<f64>([0.1, 1e3, 0.1, 1e-6, 0.1], 1e3);
        for (motion, error, counts) in [
            (1e6, 1.0, true),
            (-1e6, 1.0, true),
            (1.1e6, 1.0, false),
            (-1.1e6, 1.0, false),
            (f64::NAN, 1.0, false),
            (1.0, 1e6, true),
            (1.0, -1e6, true),
            (1.0, 1.1e6, false),
            (1.0, f64::NAN, false),
        ] {
            let mut state = AdaptationState::default();
            let sample = Sample {
                motion,
                error,
                correction: 0.0,
                counts: true,
            };
            part.learn(&mut state, sample);
            assert_eq!(state.zero() != 0.0, counts, "{motion} {error}");
        }
    }

    #[test]
    fn refuse_bounds_that_are_none() {
        use std::string::ToString;
        assert_eq!(
            Adaptation::<f32>::new(&numbers([0.3, 0.1, 1.0, 1e-3, 0.1]), 50e3)
                .unwrap_err()
                .to_string(),
            "adapted gain = 0.3 must lie in 0.0001 to 0.2"
        );
        for values in [
            [f64::NAN, 0.1, 1.0, 1e-3, 0.1],
            [0.05, -0.1, 1.0, 1e-3, 0.1],
            [0.05, 0.1, 0.0, 1e-3, 0.1],
            [0.05, 0.1, 1.0, 0.0, 0.1],
            [0.05, 0.1, 1.0, 1e-3, f64::INFINITY],
        ] {
            assert!(Adaptation::<f32>::new(&numbers(values), 50e3).is_err());
        }
        let good = numbers([0.05, 0.1, 1.0, 1e-3, 0.1]);
        for (lag_bound_s, lag_from_hz, lag_up_to_um_per_s, allowed) in [
            (1e-3, 1e6, 1e9, true),
            (0.0, 0.0, 0.0, true),
            (1.1e-3, 10.0, 1e3, false),
            (-1e-6, 10.0, 1e3, false),
            (1e-6, f64::NAN, 1e3, false),
            (1e-6, 10.0, 1.1e9, false),
        ] {
            let lag = AdaptationNumbers {
                lag_bound_s,
                lag_from_hz,
                lag_up_to_um_per_s,
                ..good
            };
            assert_eq!(Adaptation::<f32>::new(&lag, 50e3).is_ok(), allowed, "{lag:?}");
        }
    }
}
