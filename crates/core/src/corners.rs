//! A bank of plays as the corners of its input: what a sample changes costs the same for ten plays as for a hundred.
//!
//! With thresholds ascending and one envelope for all, outputs do not rise from play to play, and a sample moves the first k of them,
//! all on one side: to `h_r`, or to `h_l - r_i`. So the outputs are segments, each with one value, and the newest segment covers the
//! first plays. A sample that turns puts a segment on top; one that goes on lengthens the top one over those below.

use crate::bank::{InputState, PlayBank};
use crate::real::Real;

/// What a model sums over the first plays of its bank.
pub(crate) trait Sums<T>: Copy {
    /// The sum over the first plays where all of them are at a value: `w_i = value`, on the left side `w_i = value - r_i`.
    fn at(&self, left: bool, value: T) -> T;
}

/// The outputs of the plays from the end of the corner above to `end`: `w_i = value`, on the left side `w_i = value - r_i`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Corner<T> {
    pub(crate) value: T,
    pub(crate) left: bool,
    /// The model's sum over all plays at the last sample at which this corner was the top.
    pub(crate) sum: T,
    pub(crate) end: usize,
}

/// A bank of plays, moved by corners.
///
/// With every segment goes the model's sum over all plays at the last sample at which it was the top. A sample that moves the first k
/// plays from a corner's outputs to others changes that sum by what those k make of the difference, and by nothing else.
///
/// # Cost
/// In instructions of a Cortex-M4F: about 30 a sample that goes on without another play, 50 more for one that turns or reaches another,
/// 20 for each corner that it wipes out, 12 log2 N where it jumps into a segment.
/// # Errors
/// The sum takes one rounding for each corner that is remembered, N at most, and is made anew from constants whenever a sample moves
/// the widest play: it does not drift.
/// # Reference
/// The wiping-out of corners: Mayergoyz, Mathematical Models of Hysteresis and Their Applications (2003), section 1.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Corners<T, S, const N: usize> {
    /// For each play, over the plays up to it.
    sums: [S; N],
    pub(crate) bank: PlayBank<T, N>,
}

/// The corners of a bank, and its last input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerState<T, const N: usize> {
    top: Corner<T>,
    /// Those below the top; the first is none, and covers no play.
    below: [Corner<T>; N],
    depth: usize,
    /// The sum over the plays below the top.
    rest: T,
    /// The top reaches another play at a bound where `bound - offset` is at `limit`, or below it on the right side.
    offset: T,
    limit: T,
    pub(crate) input: InputState<T>,
}

impl<T: Real, S: Sums<T>, const N: usize> Corners<T, S, N> {
    /// `up_to` gives the sums over the plays up to each, in their order.
    pub(crate) fn new(bank: PlayBank<T, N>, up_to: impl FnMut(usize) -> S) -> Self {
        Self {
            sums: core::array::from_fn(up_to),
            bank,
        }
    }

    /// For each play, over the plays up to it.
    pub(crate) fn sums(&self) -> &[S; N] {
        &self.sums
    }

    /// Moves the plays to the bounds of a sample (`left <= right`) and returns the sum over all of them.
    #[inline(always)]
    pub(crate) fn step(&self, state: &mut CornerState<T, N>, left: T, right: T) -> T {
        let (top, first) = (state.top, self.threshold(0));
        if top.left {
            if top.touched::<true>(first, left) {
                self.go_on::<true>(state, left);
            } else if top.touched::<false>(first, right) {
                self.sweep::<false>(state, right);
            }
        } else if top.touched::<false>(first, right) {
            self.go_on::<false>(state, right);
        } else if top.touched::<true>(first, left) {
            self.sweep::<true>(state, left);
        }
        state.top.sum
    }

    /// Moves the top's plays on, which is of this side already.
    #[inline(always)]
    fn go_on<const LEFT: bool>(&self, state: &mut CornerState<T, N>, bound: T) {
        let from_offset = bound - state.offset;
        let reached = if LEFT {
            from_offset >= state.limit
        } else {
            from_offset < state.limit
        };
        if reached {
            self.sweep::<LEFT>(state, bound);
        } else {
            state.top.value = bound;
            state.top.sum = state.rest + self.sums_of(state.top.end).at(LEFT, bound);
        }
    }

    /// Sums over the first plays, one at least.
    #[inline(always)]
    fn sums_of(&self, plays: usize) -> &S {
        self.sums.get(plays - 1).unwrap_or(&self.sums[0])
    }

    #[inline(always)]
    fn threshold(&self, play: usize) -> T {
        self.bank.thresholds().values().get(play).copied().unwrap_or(T::ZERO)
    }

    /// All plays at one output, 0 where it is not finite.
    pub(crate) fn at_rest(&self, output: T, input: InputState<T>) -> CornerState<T, N> {
        let none = Corner {
            value: T::ZERO,
            left: false,
            sum: T::ZERO,
            end: N,
        };
        let value = if output.is_finite() { output } else { T::ZERO };
        CornerState {
            top: Corner {
                value,
                sum: self.sums[N - 1].at(false, value),
                ..none
            },
            below: [none; N],
            depth: 0,
            rest: T::ZERO,
            offset: T::ZERO,
            limit: T::from_f64(f64::NEG_INFINITY),
            input,
        }
    }

    /// The plays' outputs, for comparison: O(N).
    pub(crate) fn outputs(&self, state: &CornerState<T, N>) -> [T; N] {
        let mut depth = state.depth;
        let mut corner = state.top;
        core::array::from_fn(|i| {
            while corner.end <= i && depth > 0 {
                corner = state.below[depth];
                depth -= 1;
            }
            corner.output(self.threshold(i))
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
        let mut corner = &state.top;
        for below in state.below.get(..=depth).unwrap_or_default().iter().rev() {
            corner = below;
            if end < corner.end {
                end = self.reach::<LEFT>(corner, end, bound);
                if end < corner.end {
                    break;
                }
            }
            depth = depth.saturating_sub(1);
        }
        let corner = *corner;
        (state.offset, state.limit) = self.next::<LEFT>(&corner, end);
        let sums = self.sums_of(end);
        state.rest = corner.sum - sums.at(corner.left, corner.value);
        state.depth = depth;
        state.top = Corner {
            value: bound,
            left: LEFT,
            sum: state.rest + sums.at(LEFT, bound),
            end,
        };
    }

    /// Offset and limit of the bounds that move the play after the first `end`, which stands at a corner.
    #[inline(always)]
    fn next<const LEFT: bool>(&self, corner: &Corner<T>, end: usize) -> (T, T) {
        if end >= N {
            let never = if LEFT { f64::INFINITY } else { f64::NEG_INFINITY };
            return (T::ZERO, T::from_f64(never));
        }
        match (LEFT, corner.left) {
            (true, false) => (self.threshold(end), corner.value),
            (false, true) => (T::ZERO, corner.value - self.threshold(end)),
            _ => (T::ZERO, corner.value),
        }
    }

    /// Up to which play of a corner a bound moves them, from `from` on.
    ///
    /// On its own side a bound moves all or none, on the other side those up to a threshold. On the left, plays that are there already
    /// count: behind them may be some that are not, where two bounds were rounded onto one output.
    #[inline(always)]
    fn reach<const LEFT: bool>(&self, corner: &Corner<T>, from: usize, bound: T) -> usize {
        let touched = |threshold: &T| corner.touched::<LEFT>(*threshold, bound);
        // Most corners are wiped out whole.
        if touched(&self.threshold(corner.end - 1)) {
            return corner.end;
        }
        if corner.left == LEFT {
            return from;
        }
        let plays = self.bank.thresholds().values().get(from..corner.end);
        from + plays.unwrap_or_default().partition_point(touched)
    }
}

impl<T: Real> Corner<T> {
    #[inline(always)]
    fn output(&self, threshold: T) -> T {
        if self.left { self.value - threshold } else { self.value }
    }

    /// Whether a bound moves a play.
    #[inline(always)]
    fn touched<const LEFT: bool>(&self, threshold: T, bound: T) -> bool {
        match (LEFT, self.left) {
            (true, true) => bound >= self.value,
            (true, false) => bound - threshold >= self.value,
            (false, true) => bound < self.value - threshold,
            (false, false) => bound < self.value,
        }
    }
}
