//! The plays of a bank on a Cortex-M7: five at a time, as registers are loaded and stored.
//!
//! A compiler loads the plays' numbers one by one, which is most of what a bank costs. `vldm` and `vstm` move five in one instruction,
//! and `vmaxnm` and `vminnm` need no comparison, so that every sample takes the same number of instructions whatever its plays do.
#![no_std]
#![cfg(target_arch = "arm")]
#![warn(missing_docs)]

use core::arch::asm;
use hysteron_core::plays_sum::{Bank, SumOfPlays, rest};

/// Plays of a block.
const FIVE: usize = 5;

/// Every play, in blocks of five; those that do not fill one before them, one by one.
///
/// # Cost
/// 24 instructions for five plays, whatever moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fives;

impl<const N: usize> SumOfPlays<f32, N> for Fives {
    #[inline(always)]
    fn step(bank: &Bank<'_, f32, N>, outputs: &mut [f32; N], _: &mut [f32; N], left: f32, right: f32) -> f32 {
        let blocks = N / FIVE;
        let (mut this, mut next) = rest(bank, outputs, FIVE * blocks, left, right);
        let mut block = Block {
            thresholds: bank.thresholds[..FIVE * blocks].as_ptr_range().end,
            weights: bank.weights[..FIVE * blocks].as_ptr_range().end,
            outputs: outputs[..FIVE * blocks].as_mut_ptr_range().end,
        };
        for number in 0..blocks {
            if number == 0 && N % FIVE == 0 {
                // SAFETY: each of the arrays has `blocks` times five numbers before the end that the block began at.
                (this, next) = unsafe {
                    if N % 2 == 0 {
                        block.last::<true>(left, right, bank.offset)
                    } else {
                        block.last::<false>(left, right, bank.offset)
                    }
                };
            } else {
                // SAFETY: as above; of the `blocks` blocks this is one.
                (this, next) = unsafe { block.before(left, right, this, next) };
            }
        }
        this + next
    }
}

/// The ends of five plays' numbers.
struct Block {
    thresholds: *const f32,
    weights: *const f32,
    outputs: *mut f32,
}

/// Five plays; `$first` and `$second` add to the two sums first.
macro_rules! five {
    ($block:ident, $left:ident, $right:ident, $first:literal, $second:literal, $($sums:tt)*) => {
        asm!(
            "vldmdb {outputs}!, {{s6-s10}}",
            "vldmdb {thresholds}!, {{s11-s15}}",
            "vsub.f32 s11, {left}, s11",
            "vsub.f32 s12, {left}, s12",
            "vsub.f32 s13, {left}, s13",
            "vsub.f32 s14, {left}, s14",
            "vsub.f32 s15, {left}, s15",
            "vminnm.f32 s6, {right}, s6",
            "vminnm.f32 s7, {right}, s7",
            "vminnm.f32 s8, {right}, s8",
            "vminnm.f32 s9, {right}, s9",
            "vminnm.f32 s10, {right}, s10",
            "vmaxnm.f32 s6, s11, s6",
            "vmaxnm.f32 s7, s12, s7",
            "vmaxnm.f32 s8, s13, s8",
            "vmaxnm.f32 s9, s14, s9",
            "vmaxnm.f32 s10, s15, s10",
            "vldmdb {weights}!, {{s11-s15}}",
            "vstmia {outputs}, {{s6-s10}}",
            $first,
            $second,
            "vmla.f32 {next}, s13, s8",
            "vmla.f32 {this}, s12, s7",
            "vmla.f32 {next}, s11, s6",
            outputs = inout(reg) $block.outputs,
            thresholds = inout(reg) $block.thresholds,
            weights = inout(reg) $block.weights,
            left = in(sreg_low16) $left,
            right = in(sreg_low16) $right,
            $($sums)*
            out("s6") _, out("s7") _, out("s8") _, out("s9") _, out("s10") _,
            out("s11") _, out("s12") _, out("s13") _, out("s14") _, out("s15") _,
            options(nostack),
        )
    };
}

impl Block {
    /// The bank's last five plays, of an even number or an odd one: which of the sums begins with the offset. The other begins with a
    /// product: a zero to begin with would stay in a register for others to use, and take four instructions more a tick.
    ///
    /// # Safety
    /// Five numbers lie before each end, those of the outputs for this alone to write.
    #[inline(always)]
    unsafe fn last<const EVEN: bool>(&mut self, left: f32, right: f32, offset: f32) -> (f32, f32) {
        let (mut this, mut next) = (offset, offset);
        // SAFETY: it reads and writes the numbers named above.
        unsafe {
            if EVEN {
                five!(
                    self, left, right,
                    "vmul.f32 {next}, s15, s10",
                    "vmla.f32 {this}, s14, s9",
                    this = inout(sreg_low16) this,
                    next = out(sreg_low16) next,
                );
            } else {
                five!(
                    self, left, right,
                    "vmla.f32 {next}, s15, s10",
                    "vmul.f32 {this}, s14, s9",
                    this = out(sreg_low16) this,
                    next = inout(sreg_low16) next,
                );
            }
        }
        // An odd number of plays: the sums change places.
        (next, this)
    }

    /// Five plays before those that `this` and `next` sum up.
    ///
    /// # Safety
    /// As [`Self::last`].
    #[inline(always)]
    unsafe fn before(&mut self, left: f32, right: f32, mut this: f32, mut next: f32) -> (f32, f32) {
        // SAFETY: it reads and writes the numbers named above.
        unsafe {
            five!(
                self, left, right,
                "vmla.f32 {next}, s15, s10",
                "vmla.f32 {this}, s14, s9",
                this = inout(sreg_low16) this,
                next = inout(sreg_low16) next,
            );
        }
        (next, this)
    }
}
