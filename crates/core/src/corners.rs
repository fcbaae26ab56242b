//! A bank of plays as the corners of its input: what a sample changes costs the same for ten plays as for a hundred.
//!
//! With thresholds ascending and one envelope for all, outputs do not rise from play to play, and a sample moves the first k of them,
//! all on one side: to `h_r`, or to `h_l - r_i`. So the outputs are segments, each with one value, and the newest segment covers the
//! first plays. A sample that turns puts a segment on top; one that goes on lengthens the top one over those below.

use crate::bank::{InputState, PlayBank};
use crate::envelope::Envelope;
use crate::error::ParamError;
use crate::model::{AtRest, Hysteresis};
use crate::mpi::MpiCoefficients;
use crate::mrpi::Mrpi;
use crate::real::Real;

/// One play of the bank: its threshold, and sums over the plays up to it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Play<T> {
    threshold: T,
    /// `sum q_j`
    weight: T,
    /// `sum q_j r_j`
    moment: T,
}

/// The outputs of the plays from the end of the corner above to `end`: `w_i = value`, on the left side `w_i = value - r_i`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Corner<T> {
    value: T,
    left: bool,
    /// `sum q_i w_i` over all plays at the last sample at which this corner was the top.
    sum: T,
    end: usize,
}

/// [`crate::mrpi::Mrpi`] computed from the corners of its input: the same play outputs, bit by bit; the same sum but for rounding.
///
/// With every segment goes the sum over all plays at the last sample at which it was the top. A sample that moves the first k plays
/// from a corner `v_c` to `v` changes that sum by `(v - v_c) sum q_j` over those k, and from the right side to the left by
/// `-sum q_j r_j` besides.
///
/// # Cost
/// In instructions of a Cortex-M4F: about 80 a sample, 20 for each corner that it wipes out, 10 log2 N where it jumps into a segment.
/// [`crate::mrpi::Mrpi`] takes 7 for each play that moves and 4 for each: above about 30 plays this is faster.
/// # Errors
/// The sum takes one rounding for each corner that is remembered, N at most, and is made anew from constants whenever a sample moves
/// the widest play: it does not drift (`val_ten_million_samples_do_not_drift`).
/// # Reference
/// The wiping-out of corners: Mayergoyz, Mathematical Models of Hysteresis and Their Applications (2003), section 1.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerMrpi<T, const N: usize> {
    plays: [Play<T>; N],
    bank: PlayBank<T, N>,
    envelope: Envelope<T>,
    offset: T,
    cubic: T,
    linear: T,
}

/// The corners of a bank, and its last input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerState<T, const N: usize> {
    top: Corner<T>,
    /// Those below the top; the first is none, and covers no play.
    below: [Corner<T>; N],
    depth: usize,
    input: InputState<T>,
}

impl<T: Real, const N: usize> CornerMrpi<T, N> {
    /// Builds the model.
    ///
    /// # Errors
    /// As [`Mrpi::new`].
    pub fn new(
        bank: PlayBank<T, N>,
        coefficients: MpiCoefficients<T, N>,
        envelope: Envelope<T>,
    ) -> Result<Self, ParamError> {
        Mrpi::new(bank, coefficients, envelope)?;
        let (mut weight, mut moment) = (0.0, 0.0);
        let mut plays = [Play {
            threshold: T::ZERO,
            weight: T::ZERO,
            moment: T::ZERO,
        }; N];
        let given = bank.thresholds().values().iter().zip(&coefficients.weights);
        for (play, (&threshold, &q)) in plays.iter_mut().zip(given) {
            // Rounded once, whatever the number of plays.
            weight += q.to_f64();
            moment += q.to_f64() * threshold.to_f64();
            *play = Play {
                threshold,
                weight: T::from_f64(weight),
                moment: T::from_f64(moment),
            };
        }
        let MpiCoefficients {
            offset, cubic, linear, ..
        } = coefficients;
        Ok(Self {
            plays,
            bank,
            envelope,
            offset,
            cubic,
            linear,
        })
    }

    /// The plays' outputs, for comparison: O(N).
    pub fn outputs(&self, state: &CornerState<T, N>) -> [T; N] {
        let mut depth = state.depth;
        let mut corner = state.top;
        core::array::from_fn(|i| {
            while corner.end <= i && depth > 0 {
                corner = state.below[depth];
                depth -= 1;
            }
            corner.output(&self.plays[i])
        })
    }

    /// Moves the first plays to a bound; the very first is known to move.
    #[inline(always)]
    fn sweep<const LEFT: bool>(&self, state: &mut CornerState<T, N>, bound: T) {
        let mut depth = state.depth;
        let mut end = state.top.end;
        if state.top.left != LEFT {
            // A corner of one play is wiped out at once.
            if end > 1
                && let Some(place) = state.below.get_mut(depth + 1)
            {
                *place = state.top;
                depth += 1;
            }
            end = 1;
        }
        let mut corner = state.below.get(depth).unwrap_or(&state.top);
        loop {
            if end < corner.end {
                end = self.reach::<LEFT>(corner, end, bound);
                if end < corner.end {
                    break;
                }
            }
            if depth == 0 {
                break;
            }
            depth -= 1;
            corner = state.below.get(depth).unwrap_or(&state.top);
        }
        let sums = self.plays.get(end - 1).unwrap_or(&self.plays[0]);
        let mut sum = corner.sum + (bound - corner.value) * sums.weight;
        if LEFT && !corner.left {
            sum -= sums.moment;
        }
        if !LEFT && corner.left {
            sum += sums.moment;
        }
        state.top = Corner {
            value: bound,
            left: LEFT,
            sum,
            end,
        };
        state.depth = depth;
    }

    /// Up to which play of a corner a bound moves them, from `from` on.
    ///
    /// On its own side a bound moves all or none, on the other side those up to a threshold. On the left, plays that are there already
    /// count: behind them may be some that are not, where two bounds were rounded onto one output.
    #[inline(always)]
    fn reach<const LEFT: bool>(&self, corner: &Corner<T>, from: usize, bound: T) -> usize {
        if corner.left == LEFT {
            return if corner.touched::<LEFT>(&self.plays[0], bound) {
                corner.end
            } else {
                from
            };
        }
        let touched = |at: usize| {
            self.plays
                .get(at)
                .is_some_and(|play| corner.touched::<LEFT>(play, bound))
        };
        if !touched(from) {
            return from;
        }
        let (mut low, mut high) = (from, corner.end - 1);
        if touched(high) {
            return corner.end;
        }
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if touched(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}

impl<T: Real> Corner<T> {
    #[inline(always)]
    fn output(&self, play: &Play<T>) -> T {
        if self.left {
            self.value - play.threshold
        } else {
            self.value
        }
    }

    /// Whether a bound moves a play.
    #[inline(always)]
    fn touched<const LEFT: bool>(&self, play: &Play<T>, bound: T) -> bool {
        match (LEFT, self.left) {
            (true, true) => bound >= self.value,
            (true, false) => bound - play.threshold >= self.value,
            (false, true) => bound < self.value - play.threshold,
            (false, false) => bound < self.value,
        }
    }
}

impl<T: Real, const N: usize> Hysteresis<T> for CornerMrpi<T, N> {
    type State = CornerState<T, N>;

    #[inline(always)]
    fn step(&self, state: &mut CornerState<T, N>, input: T) -> T {
        let (input, rate) = self.bank.admit(&mut state.input, input);
        let (left, right) = self.envelope.bounds(input, rate);
        let first = &self.plays[0];
        if state.top.touched::<false>(first, right) {
            self.sweep::<false>(state, right);
        } else if state.top.touched::<true>(first, left) {
            self.sweep::<true>(state, left);
        }
        self.offset + ((self.cubic * input * input + self.linear) * input + state.top.sum)
    }
}

impl<T: Real, const N: usize> AtRest<T> for CornerMrpi<T, N> {
    fn at_rest(&self, output: T, last_input: T) -> CornerState<T, N> {
        let corner = |value: T| Corner {
            value,
            left: false,
            sum: value * self.plays[N - 1].weight,
            end: N,
        };
        CornerState {
            top: corner(if output.is_finite() { output } else { T::ZERO }),
            below: [corner(T::ZERO); N],
            depth: 0,
            input: self.bank.input_at(last_input),
        }
    }
}
