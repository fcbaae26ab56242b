//! A weighted sum over a bank of plays, moved with it.

use crate::play;
use crate::real::Real;

/// Moves a bank of plays by one sample and sums over them, weighted.
///
/// Every implementation gives the same bits: two sums, one of the first play and every second behind it, which begins with the offset,
/// and one of the others, both made from the last play to the first, every product and every addition rounded, and then added. So plays
/// that weigh nothing behind the others change no bit. [`FirstPlays`] runs anywhere; a processor that loads many registers at once may do
/// better with all of them.
pub trait SumOfPlays<T, const N: usize> {
    /// One sample of a bank in which only the first plays can move: ascending thresholds, `left <= right`, outputs that began equal or
    /// on one side. `sums` is what it remembers beside the outputs: from each play on, the sum over it and every second one behind it.
    fn step(bank: &Bank<'_, T, N>, outputs: &mut [T; N], sums: &mut [T; N], left: T, right: T) -> T;
}

/// Thresholds and weights of a bank of plays.
#[derive(Debug, Clone, Copy)]
pub struct Bank<'a, T, const N: usize> {
    /// Ascending.
    pub thresholds: &'a [T; N],
    /// Of their outputs in the sum.
    pub weights: &'a [T; N],
    /// The sum where all outputs are 0.
    pub offset: T,
}

/// What the sums from a play behind the last on are, and from the next on.
#[inline(always)]
pub fn behind<T: Real>(last: usize, offset: T) -> (T, T) {
    if last.is_multiple_of(2) {
        (offset, T::ZERO)
    } else {
        (T::ZERO, offset)
    }
}

/// The sum over plays that stand, as every [`SumOfPlays`] rounds it. Both slices have the same length.
#[inline(always)]
pub fn sum<T: Real>(offset: T, weights: &[T], outputs: &[T]) -> T {
    let (mut next, mut this) = behind(weights.len(), offset);
    let pairs = weights.rchunks_exact(2).zip(outputs.rchunks_exact(2));
    for (weight, output) in pairs {
        this += weight[1] * output[1];
        next += weight[0] * output[0];
    }
    let first = weights.rchunks_exact(2).remainder().iter();
    for (&weight, &output) in first.zip(outputs) {
        this += weight * output;
    }
    this + next
}

/// Moves the plays from `first` on, all of them; the sums from there and from the next on, each over every second play.
#[inline(always)]
pub fn rest<T: Real, const N: usize>(
    bank: &Bank<'_, T, N>,
    outputs: &mut [T; N],
    first: usize,
    left: T,
    right: T,
) -> (T, T) {
    let (thresholds, weights) = (bank.thresholds.iter().skip(first), bank.weights.iter().skip(first));
    let (mut this, mut next) = behind(N, bank.offset);
    for ((output, &threshold), &weight) in outputs.iter_mut().skip(first).zip(thresholds).zip(weights).rev() {
        *output = play::enveloped(left, right, *output, threshold);
        (this, next) = (next + weight * *output, this);
    }
    (this, next)
}

/// From each play on the sum over it and every second one behind it.
pub fn sums<T: Real, const N: usize>(offset: T, weights: &[T; N], outputs: &[T; N]) -> [T; N] {
    let mut sums = [T::ZERO; N];
    let (mut this, mut next) = behind(N, offset);
    for ((sum, &weight), &output) in sums.iter_mut().zip(weights).zip(outputs).rev() {
        (this, next) = (next + weight * output, this);
        *sum = this;
    }
    sums
}

/// Touches the plays that move and the first that does not; what the others sum to is remembered.
///
/// Where a sample moves plays, those that it moves are the first ones, all on one side, as [`crate::play::advance_ordered`] says. So the sums
/// from the first play behind them on stand, and those before are made anew.
///
/// # Cost
/// In instructions of a Cortex-M4F, for each of the first ten plays that moves: 11 where they are pushed up, 8 where they are pushed
/// down; about 18 for each behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstPlays;

impl<T: Real, const N: usize> SumOfPlays<T, N> for FirstPlays {
    #[inline(always)]
    fn step(bank: &Bank<'_, T, N>, outputs: &mut [T; N], sums: &mut [T; N], left: T, right: T) -> T {
        let mut plays = Plays { bank, outputs, sums };
        let (this, next) = if right < plays.outputs[0] {
            plays.push_down(right)
        } else {
            plays.push_up(left)
        };
        this + next
    }
}

/// Plays whose way is written out one after the other: a counter takes more than what it counts.
const WRITTEN_OUT: usize = 10;

/// `from_two!` of the first plays around that of the next ones, [`WRITTEN_OUT`] in all, around those behind.
macro_rules! written_out {
    ($from_two:ident, $behind:expr) => {
        $from_two!(0, $from_two!(2, $from_two!(4, $from_two!(6, $from_two!(8, $behind)))))
    };
}

/// A bank under way. What its methods return are the sums from a play on and from the one behind it, each over every second play.
struct Plays<'a, T, const N: usize> {
    bank: &'a Bank<'a, T, N>,
    outputs: &'a mut [T; N],
    sums: &'a mut [T; N],
}

impl<T: Real, const N: usize> Plays<'_, T, N> {
    /// Those that stand, from a play on.
    #[inline(always)]
    fn standing(&self, play: usize) -> (T, T) {
        let (this, next) = behind(N, self.bank.offset);
        let sum = |play: usize| self.sums.get(play).copied();
        match sum(play) {
            Some(of_play) => (of_play, sum(play + 1).unwrap_or(this)),
            None => (this, next),
        }
    }

    /// With a play that is now at `output`, `behind` it what follows.
    #[inline(always)]
    fn with(&mut self, play: usize, output: T, behind: (T, T)) -> (T, T) {
        let (Some(sum), Some(&weight)) = (self.sums.get_mut(play), self.bank.weights.get(play)) else {
            return behind;
        };
        *sum = behind.1 + weight * output;
        (*sum, behind.0)
    }

    /// To `h_l - r_i`, as far as that is above.
    #[inline(always)]
    fn push_up(&mut self, left: T) -> (T, T) {
        macro_rules! from {
            ($play:expr, $behind:expr) => {
                match self.pushed_up($play, left) {
                    Some(pushed) => {
                        let behind = $behind;
                        self.with($play, pushed, behind)
                    }
                    None => self.standing($play),
                }
            };
        }
        macro_rules! from_two {
            ($play:expr, $behind:expr) => {
                from!($play, from!($play + 1, $behind))
            };
        }
        written_out!(from_two, self.push_others(|play, plays| plays.pushed_up(play, left)))
    }

    /// To `h_r`, as far as that is below: where it is below a play, it is below the one before.
    #[inline(always)]
    fn push_down(&mut self, right: T) -> (T, T) {
        macro_rules! from_two {
            ($play:expr, $behind:expr) => {
                if let Some(pushed) = self.pushed_down($play + 1, right) {
                    if let Some(output) = self.outputs.get_mut($play) {
                        *output = pushed;
                    }
                    let behind = $behind;
                    let behind = self.with($play + 1, pushed, behind);
                    self.with($play, pushed, behind)
                } else {
                    let behind = self.standing($play + 1);
                    match self.pushed_down($play, right) {
                        Some(pushed) => self.with($play, pushed, behind),
                        None => self.standing($play),
                    }
                }
            };
        }
        written_out!(from_two, self.push_others(|play, plays| plays.pushed_down(play, right)))
    }

    /// The plays behind those that are written out.
    #[inline(always)]
    fn push_others(&mut self, pushed: impl Fn(usize, &mut Self) -> Option<T>) -> (T, T) {
        if N <= WRITTEN_OUT {
            return self.standing(N);
        }
        let mut end = WRITTEN_OUT;
        while pushed(end, self).is_some() {
            end += 1;
        }
        let mut behind = self.standing(end);
        for play in (WRITTEN_OUT..end).rev() {
            let output = self.outputs.get(play).copied().unwrap_or(T::ZERO);
            behind = self.with(play, output, behind);
        }
        behind
    }

    #[inline(always)]
    fn pushed_up(&mut self, play: usize, left: T) -> Option<T> {
        let (output, &threshold) = (self.outputs.get_mut(play)?, self.bank.thresholds.get(play)?);
        let pushed = left - threshold;
        if pushed < *output {
            return None;
        }
        *output = pushed;
        Some(pushed)
    }

    #[inline(always)]
    fn pushed_down(&mut self, play: usize, right: T) -> Option<T> {
        let output = self.outputs.get_mut(play)?;
        if right >= *output {
            return None;
        }
        *output = right;
        Some(right)
    }
}
