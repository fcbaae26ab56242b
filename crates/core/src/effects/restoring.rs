//! A mode whose restoring force is no straight line: a spring that hardens or softens, friction, hysteresis.

use crate::effects::resonance::{Mode, ModeState};
use crate::effects::{Block, admit};
use crate::error::{ParamError, in_range};
use crate::fading::faded;
use crate::real::Real;
use core::f64::consts::TAU;

/// Beyond so many half strokes the spring goes on as stiff as it is there.
const SPRING_TO: f64 = 1.5;

/// Least stiffness within that, over the one in the middle.
const LEAST_STIFFNESS: f64 = 0.05;

/// Radians of the mode, with its spring at its stiffest, that one step of the integration goes at most; the same with the memory alone.
const RADIANS: f64 = 0.2;
const MEMORY_RADIANS: f64 = 0.4;

/// Steps of the integration a sample at most.
const MOST_STEPS: f64 = 64.0;

/// No force of memory is larger.
const LARGEST_FORCE: f64 = 1e12;

/// Times that a step's end and the force there follow each other.
const FOLLOWED: usize = 3;

/// Numbers of a [`RestoringMode`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestoringNumbers {
    /// Of small motion in the middle, without memory, undamped; hertz.
    pub frequency_hz: f64,
    /// zeta
    pub damping: f64,
    /// Where the spring has that stiffness.
    pub middle: f64,
    /// Half of the stroke.
    pub half: f64,
    /// a and b: half a stroke above the middle the stiffness is 1 + a + b, below it 1 - a + b.
    pub stiffness: [f64; 2],
    /// The force that remembers.
    pub memory: Memory,
}

/// A force that remembers where the motion turned: `dz = A dq - (G |dq| z + D dq |z|) / g`, over the stiffness in the middle.
///
/// Bouc and Wen's with an exponent of 1; with D = 0 Dahl's friction, which slides at A / G.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Memory {
    /// A: its stiffness after a turn, over that of the spring; 0 for no memory.
    pub stiffness: f64,
    /// G, one over the unit of the motion.
    pub fading: f64,
    /// D, the same; below 0 the loop opens outwards, above it inwards.
    pub lean: f64,
    /// By how much more than in motion it holds at rest: `g = 1 + s / (1 + (q' / r)^2)`, Hess and Soom's form of Stribeck's bump.
    pub sticking: f64,
    /// r, half of that is left at this rate; units of the motion a second.
    pub sticking_to: f64,
}

/// `q'' + 2 zeta w q' + w^2 (q + r(q) + z) = w^2 u`, `r' = a x + b x^2` with `x = (q - middle) / half`, z as [`Memory`].
///
/// Each sample is cut into steps of a fifth of a radian, and of less where the memory is far stiffer than the spring. The straight part moves as [`Mode`] does; r and z run in straight lines over
/// a step, and follow its end three times.
///
/// # Units
/// Input and output alike (micrometres); frequency in hertz, damping a pure number.
/// # Range
/// A stiffness of 0.05 and more up to 1.5 half strokes, straight on beyond; memory 0 to 1e4 times as stiff as the spring.
/// # Cost
/// 45 multiply-adds a step of the integration, with memory twice as many and six divisions; 1 to 64 steps a sample.
/// # Reference
/// Kovacic, Brennan, The Duffing Equation (Wiley 2011), ch. 1; Ismail, Ikhouane, Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161 (Bouc
/// and Wen); Olsson, Astrom, Canudas de Wit, Gafvert, Lischinsky, Eur. J. Control 4 (1998) 176 (friction).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestoringMode<T> {
    /// Displacement and rate behind a step of the straight mode, by those before it and the input before and at it.
    moves: [[T; 4]; 2],
    steps: u32,
    per_step: T,
    middle: T,
    half: T,
    per_half: T,
    bend: [T; 2],
    stiffness: T,
    fading: T,
    lean: T,
    sticking: T,
    /// `(w / r)^2`, of the rate over w.
    per_sticking: T,
    /// Whether there is any memory.
    remembers: bool,
    /// No force of memory is larger.
    most: T,
}

/// A step of a mode as a matrix.
fn moves<T: Real>(mode: &Mode<f64>) -> [[T; 4]; 2] {
    let each: [[f64; 2]; 4] = core::array::from_fn(|i| {
        let one = |at: usize| if i == at { 1.0 } else { 0.0 };
        let mut state = ModeState {
            motion: [one(0), one(1)],
            input: one(2),
        };
        mode.step(&mut state, one(3));
        state.motion
    });
    core::array::from_fn(|row| each.map(|column| T::from_f64(column[row])))
}

/// State of a [`RestoringMode`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestoringState<T> {
    /// Displacement and rate over w; the input that belongs to them less the bend of the spring and the memory.
    pub mode: ModeState<T>,
    /// The force that remembers, over the stiffness.
    pub memory: T,
    /// The input.
    pub input: T,
}

impl<T: Real> RestoringMode<T> {
    /// Builds the mode.
    ///
    /// # Errors
    /// What [`Mode::new`] refuses; a half stroke of 0 and less, a stiffness below a twentieth, a memory outside its range.
    pub fn new(numbers: &RestoringNumbers, sample_rate_hz: f64) -> Result<Self, ParamError> {
        let &RestoringNumbers {
            frequency_hz,
            damping,
            middle,
            half,
            stiffness: [a, b],
            memory,
        } = numbers;
        in_range("middle", None, middle, -1e12, 1e12)?;
        in_range("half stroke", None, half, 1e-12, 1e12)?;
        in_range("frequency_hz", None, frequency_hz, 1e-3, 1e7)?;
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        for part in [a, b] {
            in_range("change of the stiffness", None, part, -1e3, 1e3)?;
        }
        let at = |x: f64| 1.0 + (a + b * x) * x;
        let turn = if b > 0.0 { -0.5 * a / b } else { SPRING_TO };
        let (low, high) = (at(-SPRING_TO), at(SPRING_TO));
        let least = low.min(high).min(at(turn.clamp(-SPRING_TO, SPRING_TO)));
        in_range("least stiffness", None, least, LEAST_STIFFNESS, f64::MAX)?;
        in_range("stiffness of the memory", None, memory.stiffness, 0.0, 1e4)?;
        in_range("fading", None, memory.fading, 0.0, 1e12)?;
        in_range("lean", None, memory.lean, -1e12, 1e12)?;
        in_range("sticking", None, memory.sticking, 0.0, 10.0)?;
        let angle = TAU * frequency_hz / sample_rate_hz;
        let of_spring = libm::sqrt(low.max(high).max(1.0)) / RADIANS;
        let of_memory = libm::sqrt(memory.stiffness) / MEMORY_RADIANS;
        let steps = libm::ceil(angle * of_spring.max(of_memory)).clamp(1.0, MOST_STEPS);
        let w = TAU * frequency_hz;
        let per_sticking = if memory.sticking > 0.0 {
            in_range("rate of sticking", None, memory.sticking_to, 1e-12, 1e12)?;
            w / memory.sticking_to
        } else {
            0.0
        };
        Ok(Self {
            moves: moves(&Mode::new(frequency_hz, damping, sample_rate_hz * steps)?),
            steps: steps as u32,
            per_step: T::from_f64(1.0 / steps),
            middle: T::from_f64(middle),
            half: T::from_f64(half),
            per_half: T::from_f64(1.0 / half),
            bend: [T::from_f64(0.5 * a), T::from_f64(b / 3.0)],
            stiffness: T::from_f64(memory.stiffness),
            fading: T::from_f64(memory.fading),
            lean: T::from_f64(memory.lean),
            sticking: T::from_f64(memory.sticking),
            per_sticking: T::from_f64(per_sticking * per_sticking),
            remembers: memory.stiffness > 0.0,
            most: T::from_f64(LARGEST_FORCE),
        })
    }

    /// What the spring adds to a straight one, and how that grows with the motion.
    #[inline(always)]
    fn spring(&self, at: T) -> (T, T) {
        let x = (at - self.middle) * self.per_half;
        let most = T::from_f64(SPRING_TO);
        let within = x.select_max(T::ZERO - most).select_min(most);
        let [quadratic, cubic] = self.bend;
        let slope = (T::from_f64(3.0) * cubic * within + T::from_f64(2.0) * quadratic) * within;
        let force = (cubic * within + quadratic) * within * within;
        (self.half * (force + slope * (x - within)), slope)
    }

    /// The memory after a way, and how it goes with the memory before and with the way; `rate` is the rate over w.
    #[inline(always)]
    fn remembered(&self, memory: T, way: T, rate: T) -> [T; 3] {
        if !self.remembers {
            return [T::ZERO; 3];
        }
        let ahead = way >= T::ZERO;
        let length = way.magnitude();
        let (mut fading, mut lean) = (self.fading, self.lean);
        if self.sticking > T::ZERO {
            // 1 / g
            let moving = (T::ONE + self.per_sticking * rate * rate).select_min(self.most);
            let slides = moving / (moving + self.sticking);
            (fading, lean) = (fading * slides, lean * slides);
        }
        let sign = if ahead { T::ONE } else { T::ZERO - T::ONE };
        let push = sign * self.stiffness;
        let fades = |memory: T| {
            if (memory >= T::ZERO) == ahead {
                fading + lean
            } else {
                fading - lean
            }
        };
        let half_way = memory + T::from_f64(0.5) * length * (push - fades(memory) * memory);
        let fades = fades(half_way);
        let through = length * faded((fades * length).select_max(T::ZERO - T::ONE));
        let after = memory + through * (push - fades * memory);
        let after = after.select_max(T::ZERO - self.most).select_min(self.most);
        [after, T::ONE - fades * through, self.stiffness - sign * fades * after]
    }

    /// A step of the integration; how it makes small changes of displacement, rate, memory and of the input before and at it
    /// into those of the first three.
    #[inline(always)]
    fn advance(&self, state: &mut RestoringState<T>, input: T) -> [[T; 5]; 3] {
        let [q, p] = state.mode.motion;
        let [from, rate_from] = self
            .moves
            .map(|[of_q, of_p, of_from, _]| of_q * q + of_p * p + of_from * state.mode.input);
        let [to, rate_to] = self.moves.map(|[.., of_to]| of_to);
        let (bend, slope_before) = self.spring(q);
        let mut straight = input - (bend + state.memory);
        let (mut at, mut rate) = (q, p);
        let (mut slope, mut memory) = (slope_before, [state.memory, T::ONE, T::ZERO]);
        for _ in 0..FOLLOWED {
            at = from + to * straight;
            rate = rate_from + rate_to * straight;
            memory = self.remembered(state.memory, at - q, T::from_f64(0.5) * (p + rate));
            let spring = self.spring(at);
            slope = spring.1;
            straight = input - (spring.0 + memory[0]);
        }
        let [memory, of_memory, of_way] = memory;
        *state = RestoringState {
            mode: ModeState {
                motion: [at, rate],
                input: straight,
            },
            memory,
            input,
        };
        // What the end's own force undoes of a change there.
        let least = T::ONE / (T::ONE + to * (slope + of_way));
        let of_end = |row: [T; 4]| {
            let [of_q, of_p, of_from, of_to] = row;
            // Changes of q, p, z, the input before and at it, with the end's displacement left out.
            [
                of_q - of_from * slope_before + of_to * of_way,
                of_p,
                T::ZERO - of_from - of_to * of_memory,
                of_from,
                of_to,
            ]
        };
        let [open, open_rate] = self.moves.map(of_end);
        let end = open.map(|part| part * least);
        let mut rates = open_rate;
        let mut memories = [T::ZERO - of_way, T::ZERO, of_memory, T::ZERO, T::ZERO];
        for ((rate, memory), end) in rates.iter_mut().zip(&mut memories).zip(end) {
            *rate -= rate_to * (slope + of_way) * end;
            *memory += of_way * end;
        }
        [end, rates, memories]
    }

    /// As [`Block::step`]; returns how it makes small changes of displacement, rate over w, memory, and of the input before and at it,
    /// into those of the first three.
    ///
    /// # Cost
    /// That of a step and 60 multiply-adds a step of the integration.
    pub fn step_linearised(&self, state: &mut RestoringState<T>, input: T) -> [[T; 5]; 3] {
        let input = admit(input, state.input);
        let (from, way) = (state.input, input - state.input);
        let mut all = [[T::ZERO; 5]; 3];
        for (i, row) in all.iter_mut().enumerate() {
            if let Some(own) = row.get_mut(i) {
                *own = T::ONE;
            }
        }
        let mut before = T::ZERO;
        for step in 1..=self.steps {
            let share = T::from_f64(f64::from(step)) * self.per_step;
            let last = step == self.steps;
            let linear = self.advance(state, if last { input } else { from + way * share });
            let share = if last { T::ONE } else { share };
            // The input before and at a step is a mixture of those before and at the sample.
            let mixed = [[T::ONE - before, before], [T::ONE - share, share]];
            all = linear.map(|[of_q, of_p, of_z, of_before, of_input]| {
                let [of_q, of_p, of_z] =
                    [(of_q, 0), (of_p, 1), (of_z, 2)].map(|(factor, i)| all[i].map(|part| factor * part));
                core::array::from_fn(|j| {
                    let own = of_q[j] + of_p[j] + of_z[j];
                    match j {
                        3 => own + of_before * mixed[0][0] + of_input * mixed[1][0],
                        4 => own + of_before * mixed[0][1] + of_input * mixed[1][1],
                        _ => own,
                    }
                })
            });
            before = share;
        }
        all
    }
}

/// Steps towards where a rest is.
const RESTED: usize = 60;

impl<T: Real> Block<T> for RestoringMode<T> {
    type State = RestoringState<T>;

    /// Rest without a force that remembers.
    fn rest_at(&self, input: T) -> RestoringState<T> {
        let input = admit(input, T::ZERO);
        // Between two ends that enclose it: no stiffness is below a twentieth.
        let reach = (input - self.middle).magnitude() * T::from_f64(1.0 / LEAST_STIFFNESS) + self.half;
        let (mut low, mut high) = (self.middle - reach, self.middle + reach);
        for _ in 0..RESTED {
            let between = T::from_f64(0.5) * (low + high);
            if between + self.spring(between).0 < input {
                low = between;
            } else {
                high = between;
            }
        }
        let at = T::from_f64(0.5) * (low + high);
        RestoringState {
            mode: ModeState {
                motion: [at, T::ZERO],
                input: input - self.spring(at).0,
            },
            memory: T::ZERO,
            input,
        }
    }

    #[inline(always)]
    fn step(&self, state: &mut RestoringState<T>, input: T) -> T {
        let input = admit(input, state.input);
        let (from, way) = (state.input, input - state.input);
        for step in 1..self.steps {
            self.advance(state, from + way * (T::from_f64(f64::from(step)) * self.per_step));
        }
        self.advance(state, input);
        state.mode.motion[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const STRAIGHT: RestoringNumbers = RestoringNumbers {
        frequency_hz: 68.0,
        damping: 0.05,
        middle: 0.0,
        half: 100.0,
        stiffness: [0.0, 0.0],
        memory: Memory {
            stiffness: 0.0,
            fading: 0.0,
            lean: 0.0,
            sticking: 0.0,
            sticking_to: 0.0,
        },
    };

    fn respond(numbers: &RestoringNumbers, rate_hz: f64, inputs: impl Iterator<Item = f64>) -> Vec<f64> {
        let mode = RestoringMode::<f64>::new(numbers, rate_hz).unwrap();
        let mut state = mode.rest_at(0.0);
        inputs.map(|input| mode.step(&mut state, input)).collect()
    }

    fn drive(samples: usize, size: f64) -> impl Iterator<Item = f64> {
        (0..samples).map(move |k| size * ((0.31 * k as f64).sin() + (0.073 * k as f64).sin()))
    }

    #[test]
    fn val_a_straight_spring_is_a_mode() {
        let linear = Mode::<f64>::new(68.0, 0.05, 610.0).unwrap();
        let mut state = linear.rest_at(0.0);
        let found = respond(&STRAIGHT, 610.0, drive(400, 100.0));
        for (found, input) in found.iter().zip(drive(400, 100.0)) {
            let wanted = linear.step(&mut state, input);
            assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
        }
    }

    /// Against Runge and Kutta's fourth-order rule in 400 steps a sample: a hardening spring, friction and Bouc and Wen's loop.
    #[test]
    fn val_forces_are_those_of_their_equations() {
        let hard = RestoringNumbers {
            stiffness: [0.1, 0.6],
            ..STRAIGHT
        };
        let loops = RestoringNumbers {
            memory: Memory {
                stiffness: 1.0,
                fading: 8e-3,
                lean: -1.1e-2,
                ..Memory::default()
            },
            ..STRAIGHT
        };
        let rubs = RestoringNumbers {
            memory: Memory {
                stiffness: 10.0,
                fading: 0.25,
                sticking: 0.5,
                sticking_to: 2000.0,
                ..Memory::default()
            },
            ..STRAIGHT
        };
        for (numbers, within) in [(hard, 2e-3), (loops, 2e-3), (rubs, 1e-2)] {
            let found = respond(&numbers, 610.0, drive(300, 40.0));
            let wanted = by_runge_kutta(&numbers, 610.0, &drive(300, 40.0).collect::<Vec<_>>());
            let size = wanted.iter().map(|y| y * y).sum::<f64>().sqrt();
            let off = found
                .iter()
                .zip(&wanted)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>()
                .sqrt();
            assert!(off < within * size, "{numbers:?}: {}", off / size);
        }
    }

    fn by_runge_kutta(numbers: &RestoringNumbers, rate_hz: f64, inputs: &[f64]) -> Vec<f64> {
        const FINE: usize = 400;
        let w = TAU * numbers.frequency_hz;
        let ([a, b], memory) = (numbers.stiffness, numbers.memory);
        let slopes = |[q, v, z]: [f64; 3], u: f64| {
            let x = (q - numbers.middle) / numbers.half;
            let bend = numbers.half * (0.5 * a * x * x + b / 3.0 * x.powi(3));
            let g = if memory.sticking > 0.0 {
                1.0 + memory.sticking / (1.0 + (v / memory.sticking_to).powi(2))
            } else {
                1.0
            };
            let fades = memory.fading * v.abs() * z + memory.lean * v * z.abs();
            [
                v,
                w * w * (u - q - bend - z) - 2.0 * numbers.damping * w * v,
                memory.stiffness * v - fades / g,
            ]
        };
        let h = 1.0 / rate_hz / FINE as f64;
        let add = |x: [f64; 3], d: [f64; 3], h: f64| [x[0] + h * d[0], x[1] + h * d[1], x[2] + h * d[2]];
        let mut x = [0.0; 3];
        let mut last = 0.0;
        let each = inputs.iter().map(|&input| {
            for i in 0..FINE {
                let at = |part: f64| last + (input - last) * (i as f64 + part) / FINE as f64;
                let k1 = slopes(x, at(0.0));
                let k2 = slopes(add(x, k1, 0.5 * h), at(0.5));
                let k3 = slopes(add(x, k2, 0.5 * h), at(0.5));
                let k4 = slopes(add(x, k3, h), at(1.0));
                for (n, value) in x.iter_mut().enumerate() {
                    *value += h / 6.0 * (k1[n] + 2.0 * k2[n] + 2.0 * k3[n] + k4[n]);
                }
            }
            last = input;
            x[0]
        });
        each.collect()
    }

    /// At rest a hardening spring stands where its force is the input: x + x^2 / 20 + x^3 / 5 at x = 1/2.
    #[test]
    fn val_rest_is_where_the_forces_meet() {
        let hard = RestoringNumbers {
            stiffness: [0.1, 0.6],
            ..STRAIGHT
        };
        let mode = RestoringMode::<f64>::new(&hard, 610.0).unwrap();
        let input = 100.0 * (0.5 + 0.0125 + 0.025);
        let mut state = mode.rest_at(input);
        assert!((state.mode.motion[0] - 50.0).abs() < 1e-9, "{state:?}");
        assert!((mode.step(&mut state, input) - 50.0).abs() < 1e-9);
    }

    #[test]
    fn prop_finite_for_every_input() {
        let all = RestoringNumbers {
            stiffness: [-0.2, -0.2],
            memory: Memory {
                stiffness: 50.0,
                fading: 1.0,
                lean: -2.0,
                sticking: 1.0,
                sticking_to: 1.0,
            },
            damping: 1e-6,
            ..STRAIGHT
        };
        let mode = RestoringMode::<f32>::new(&all, 610.0).unwrap();
        let mut state = mode.rest_at(f32::NAN);
        for k in 0..3000 {
            let input = [1e6, -1e6, f32::NAN, f32::INFINITY, 0.0, 1e30][k % 6];
            assert!(mode.step(&mut state, input).is_finite(), "{k}");
        }
    }

    #[test]
    fn refuse_springs_that_push() {
        for stiffness in [[0.0, -0.5], [0.7, 0.0], [0.0, f64::NAN], [2.0, 1.0]] {
            let soft = RestoringNumbers { stiffness, ..STRAIGHT };
            assert!(RestoringMode::<f64>::new(&soft, 610.0).is_err(), "{stiffness:?}");
        }
        let memory = Memory {
            stiffness: -1.0,
            ..Memory::default()
        };
        assert!(RestoringMode::<f64>::new(&RestoringNumbers { memory, ..STRAIGHT }, 610.0).is_err());
    }
}
