//! Hysteresis of Duhem's kind: elements whose memory fades along the path of the voltage, forward and inverted sample by sample.

use crate::effects::admit;
use crate::error::{ParamError, finite, in_range};
use crate::model::{DirectInverse, Hysteresis, all_finite, bounded, sum_of_magnitudes};
use crate::real::Real;

/// Degree of the polynomials that the elements and the displacement without memory follow.
pub const FADING_DEGREE: usize = 3;

/// Shortest and longest path over which a memory fades, half ranges: a shorter one is none, and one of twice the range hardly fades.
const PATHS: [f64; 2] = [1.0 / 64.0, 4.0];

/// Least slope of a branch over that of the whole loop: a stack's slope after a turn is half its mean and more.
const LEAST_SLOPE: f64 = 0.1;

/// Parameters of [`FadingModel`], in volts and in the unit of its output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FadingNumbers<const N: usize> {
    /// Lowest voltage, u = -1.
    pub min_v: f64,
    /// Highest voltage, u = 1.
    pub max_v: f64,
    /// c
    pub offset: f64,
    /// g's coefficients of u, u^2, u^3
    pub input_function: [f64; FADING_DEGREE],
    /// L_i, path of the voltage over which an element forgets
    pub lengths_v: [f64; N],
    /// f_i's coefficients of u, u^2, u^3
    pub curves: [[f64; FADING_DEGREE]; N],
    /// What each element holds at rest at 0 V
    pub rest: [f64; N],
}

/// `y = c + g(u) + sum z_i`, `dz_i = |dv| (f_i(u) - z_i) / L_i`, with u from -1 to 1 over the voltages, g and f_i cubics without constant.
///
/// Coleman and Hodgdon's equation with a cubic for its curve is one such element beside a straight g. A step is that of the equation where
/// f_i runs straight from one voltage to the next, with `e^a` by its series up to `a^5 / 120`, `a` the path over the length.
///
/// # Units
/// Volts in, output units out.
/// # Cost
/// 17 multiply-adds and a division an element, 8 multiply-adds a step.
/// # Errors
/// `e^-a` is off by 2e-4 for a = 0.7, by 2e-6 for 0.3: a sine of 1 kHz at 50 kHz goes 0.13 half ranges a step.
/// # Reference
/// Coleman, Hodgdon, A constitutive relation for rate-independent hysteresis in ferromagnetically soft materials, Int. J. Eng. Sci. 24 (1986).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FadingModel<T, const N: usize> {
    middle_v: T,
    half_v: T,
    per_v: T,
    offset: T,
    input_function: [T; FADING_DEGREE],
    /// Half range over each length.
    rates: [T; N],
    curves: [[T; FADING_DEGREE]; N],
    rest: [T; N],
}

/// State of [`FadingModel`] and [`FadingInverse`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FadingState<T, const N: usize> {
    /// Where the voltage is, -1 to 1.
    at: T,
    /// What each element holds.
    held: [T; N],
    /// The output there.
    output: T,
}

/// `c_1 u + c_2 u^2 + c_3 u^3`
#[inline(always)]
fn cubic<T: Real>([first, second, third]: &[T; FADING_DEGREE], u: T) -> T {
    ((*third * u + *second) * u + *first) * u
}

/// `(1 - e^-a) / a` for `a >= -1`: 1 at 0, falling, never below 0.
#[inline(always)]
pub(crate) fn faded<T: Real>(a: T) -> T {
    let [second, third, fourth, fifth] = [2.0, 6.0, 24.0, 120.0].map(|n: f64| T::from_f64(1.0 / n));
    // (e^a - 1) / a
    let growth = (((fifth * a + fourth) * a + third) * a + second) * a + T::ONE;
    growth / (T::ONE + a * growth)
}

impl<T: Real, const N: usize> FadingModel<T, N> {
    /// Builds the model.
    ///
    /// # Errors
    /// A range that is none, a number that is not finite, a length that is no share of the range, an output that is not finite.
    #[cold]
    pub fn new(numbers: &FadingNumbers<N>) -> Result<Self, ParamError> {
        let FadingNumbers {
            min_v,
            max_v,
            offset,
            input_function,
            lengths_v,
            curves,
            rest,
        } = numbers;
        finite("lowest voltage", None, T::from_f64(*min_v))?;
        in_range("range of voltages", None, max_v - min_v, f64::MIN_POSITIVE, f64::MAX)?;
        let half_v = 0.5 * (max_v - min_v);
        for (i, length_v) in lengths_v.iter().enumerate() {
            let [least, most] = PATHS.map(|path| path * half_v);
            in_range("length", Some(i + 1), *length_v, least, most)?;
        }
        let model = Self {
            middle_v: T::from_f64(0.5 * (min_v + max_v)),
            half_v: T::from_f64(half_v),
            per_v: T::from_f64(1.0 / half_v),
            offset: T::from_f64(*offset),
            input_function: input_function.map(T::from_f64),
            rates: lengths_v.map(|length_v| T::from_f64(half_v / length_v)),
            curves: curves.map(|curve| curve.map(T::from_f64)),
            rest: rest.map(T::from_f64),
        };
        finite("range of voltages", None, model.half_v)?;
        finite("offset", None, model.offset)?;
        all_finite("input_function", &model.input_function)?;
        all_finite("curve", model.curves.as_flattened())?;
        all_finite("rest", &model.rest)?;
        // An element is within what its curve reaches, or between that and where it began.
        let most = model.offset.magnitude()
            + sum_of_magnitudes(&model.rest)
            + sum_of_magnitudes(&model.input_function)
            + sum_of_magnitudes(model.curves.as_flattened());
        bounded(most * T::from_f64(2.0 / PATHS[0]), model.half_v)?;
        Ok(model)
    }

    /// The state at rest at 0 V.
    pub fn rest(&self) -> FadingState<T, N> {
        let at = self.place(T::ZERO, T::ZERO);
        FadingState {
            at,
            held: self.rest,
            output: self.output(at, &self.rest),
        }
    }

    /// The state after cycles over the whole range, until nothing of before is left, and on from an end: up to `volts`
    /// where `rising`, else down to them.
    #[cold]
    pub fn cycled(&self, volts: T, rising: bool) -> FadingState<T, N> {
        let least_rate = self
            .rates
            .iter()
            .fold(T::from_f64(PATHS_FORGOTTEN), |least, &rate| least.select_min(rate));
        let cycles = (PATHS_FORGOTTEN / least_rate.to_f64()) as u32;
        let mut state = self.still(T::ZERO - T::ONE);
        for _ in 0..=cycles {
            state = self.along(state, T::ONE);
            state = self.along(state, T::ZERO - T::ONE);
        }
        if !rising {
            state = self.along(state, T::ONE);
        }
        self.along(state, self.place(volts, T::ZERO))
    }

    /// What elements hold that were never moved.
    fn still(&self, at: T) -> FadingState<T, N> {
        let held: [T; N] = core::array::from_fn(|i| cubic(&self.curves[i], at));
        FadingState {
            at,
            held,
            output: self.output(at, &held),
        }
    }

    /// To a place in small steps.
    fn along(&self, mut state: FadingState<T, N>, to: T) -> FadingState<T, N> {
        let step = (to - state.at) * T::from_f64(1.0 / f64::from(STEPS));
        for _ in 1..STEPS {
            state = self.moved(&state, state.at + step);
        }
        self.moved(&state, to)
    }

    /// A voltage from -1 to 1; where it is none, `last`.
    #[inline(always)]
    fn place(&self, volts: T, last: T) -> T {
        within(admit((volts - self.middle_v) * self.per_v, last))
    }

    #[inline(always)]
    fn output(&self, at: T, held: &[T; N]) -> T {
        held.iter()
            .fold(self.offset + cubic(&self.input_function, at), |sum, &z| sum + z)
    }

    /// The state at another place, straight from this one.
    #[inline(always)]
    fn moved(&self, state: &FadingState<T, N>, to: T) -> FadingState<T, N> {
        let way = (to - state.at).magnitude();
        let held = core::array::from_fn(|i| {
            let (from, there) = (cubic(&self.curves[i], state.at), cubic(&self.curves[i], to));
            let a = self.rates[i] * way;
            let share = faded(a);
            state.held[i] + (a * share * (from - state.held[i]) + (there - from) * (T::ONE - share))
        });
        FadingState {
            at: to,
            held,
            output: self.output(to, &held),
        }
    }

    /// `dy / du` on the way up (`sign` 1) or down (-1).
    #[inline(always)]
    fn slope(&self, state: &FadingState<T, N>, sign: T) -> T {
        let [first, second, third] = self.input_function;
        let (two, three) = (T::from_f64(2.0), T::from_f64(3.0));
        let mut memory = T::ZERO;
        for ((&rate, curve), &z) in self.rates.iter().zip(&self.curves).zip(&state.held) {
            memory += rate * (cubic(curve, state.at) - z);
        }
        (three * third * state.at + two * second) * state.at + first + sign * memory
    }

    /// The least slope on branches between turns all over the range, and the mean one of the whole loop; output over half the range.
    #[cold]
    fn least_and_mean_slope(&self) -> [T; 2] {
        let low = self.cycled(self.middle_v - self.half_v, true);
        let high = self.cycled(self.middle_v + self.half_v, true);
        let mut least = self.slope(&low, T::ONE);
        // From each end to each turn and back.
        for (end, sign) in [(low, T::ONE), (high, T::ZERO - T::ONE)] {
            for turn in 1..=TURNS {
                let share = T::from_f64(2.0 * f64::from(turn) / f64::from(TURNS));
                let ways = [(end.at + sign * share, sign), (end.at, T::ZERO - sign)];
                let mut state = end;
                for (to, sign) in ways {
                    let step = (to - state.at) * T::from_f64(1.0 / f64::from(STEPS));
                    least = least.select_min(self.slope(&state, sign));
                    for _ in 0..STEPS {
                        state = self.moved(&state, state.at + step);
                        least = least.select_min(self.slope(&state, sign));
                    }
                }
            }
        }
        [least, (high.output - low.output) * T::from_f64(0.5)]
    }
}

/// Steps of a way over the range.
const STEPS: u32 = 40;
/// Turns between which slopes are looked at.
const TURNS: u32 = 8;
/// Lengths of the longest memory in four of which, a cycle each, the states before are forgotten: to `e^-20`.
const PATHS_FORGOTTEN: f64 = 5.0;

#[inline(always)]
fn within<T: Real>(place: T) -> T {
    place.select_max(T::ZERO - T::ONE).select_min(T::ONE)
}

impl<T: Real, const N: usize> Hysteresis<T> for FadingModel<T, N> {
    type State = FadingState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut FadingState<T, N>, input: T) -> T {
        *state = self.moved(state, self.place(input, state.at));
        state.output
    }
}

/// The inverse of a [`FadingModel`]: the voltage at which it gives what is wanted.
///
/// A step of Newton from where the voltage is, `u + (y - y(u)) / y'(u)`, and one more from there, `y'` that of the direction:
/// `g'(u) + sign sum (f_i(u) - z_i) / L_i`. Then the states go to that voltage, and what is left is made up by the next sample.
///
/// # Units
/// Output units of the model in, volts out.
/// # Cost
/// Two steps of the model, 14 multiply-adds an element, two divisions.
/// # Reference
/// As of [`FadingModel`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FadingInverse<T, const N: usize> {
    model: FadingModel<T, N>,
    /// No slope is less.
    least: T,
}

impl<T: Real, const N: usize> FadingInverse<T, N> {
    /// Builds the inverse.
    ///
    /// # Errors
    /// A model that hardly rises, or falls, on a branch: it has no inverse.
    #[cold]
    pub fn new(model: FadingModel<T, N>) -> Result<Self, ParamError> {
        let [smallest, mean] = model.least_and_mean_slope();
        in_range(
            "displacement over the range",
            None,
            mean + mean,
            f64::MIN_POSITIVE,
            f64::MAX,
        )?;
        in_range(
            "smallest slope over the mean one",
            None,
            smallest / mean,
            LEAST_SLOPE,
            f64::MAX,
        )?;
        Ok(Self {
            model,
            least: mean * T::from_f64(LEAST_SLOPE),
        })
    }

    /// The model.
    pub fn model(&self) -> &FadingModel<T, N> {
        &self.model
    }

    /// Where a step of Newton leads for what is wanted.
    #[inline(always)]
    fn newton(&self, state: &FadingState<T, N>, sign: T, wanted: T) -> T {
        let slope = self.model.slope(state, sign).select_max(self.least);
        within(state.at + (wanted - state.output) / slope)
    }
}

impl<T: Real, const N: usize> Hysteresis<T> for FadingInverse<T, N> {
    type State = FadingState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut FadingState<T, N>, input: T) -> T {
        let wanted = admit(input, state.output);
        let rises = wanted >= state.output;
        let sign = if rises { T::ONE } else { T::ZERO - T::ONE };
        let first = self.model.moved(state, self.newton(state, sign, wanted));
        let second = self.newton(&first, sign, wanted);
        // Not back behind where it came from.
        let to = if rises {
            second.select_max(state.at)
        } else {
            second.select_min(state.at)
        };
        *state = self.model.moved(state, to);
        self.model.middle_v + self.model.half_v * to
    }
}

impl<T: Real, const N: usize> DirectInverse<T> for FadingInverse<T, N> {
    fn rest(&self) -> FadingState<T, N> {
        self.model.rest()
    }
}

impl<T: Copy, const N: usize> FadingState<T, N> {
    /// What each element holds.
    pub fn held(&self) -> [T; N] {
        self.held
    }

    /// The output of the model.
    pub fn output(&self) -> T {
        self.output
    }
}
