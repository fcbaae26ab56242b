//! The number type of the core: `f32` on the chip, `f64` on the host.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A floating-point number. Implemented for `f32` and `f64`; the same source runs in both.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// Whether maximum and minimum are instructions of the processor: then a choice by them is shorter than a branch.
    const MAX_INSTRUCTION: bool = cfg!(feature = "max-instruction");
    /// 0
    const ZERO: Self;
    /// 1
    const ONE: Self;
    /// The nearest value of this type.
    fn from_f64(value: f64) -> Self;
    /// The value as `f64`, exact.
    fn to_f64(self) -> f64;
    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;

    /// The larger of the two by compare-select (`f32::max` calls out of line on a Cortex-M4).
    /// Returns `other` when `self` is NaN.
    ///
    /// With the feature `max-instruction` by the processor's own, which returns `self` where `other` is NaN, and of two zeros the
    /// positive one; no step of this crate depends on either.
    #[inline(always)]
    fn select_max(self, other: Self) -> Self {
        #[cfg(feature = "max-instruction")]
        return self.instruction_max(other);
        #[cfg(not(feature = "max-instruction"))]
        if self > other { self } else { other }
    }

    /// The smaller of the two by compare-select. Returns `other` when `self` is NaN. The feature as in [`Self::select_max`].
    #[inline(always)]
    fn select_min(self, other: Self) -> Self {
        #[cfg(feature = "max-instruction")]
        return self.instruction_min(other);
        #[cfg(not(feature = "max-instruction"))]
        if self < other { self } else { other }
    }

    /// The larger by the processor's instruction (`vmaxnm` of Cortex-M7, M33, M55), where it has one.
    #[cfg(feature = "max-instruction")]
    fn instruction_max(self, other: Self) -> Self;
    /// The smaller, `vminnm`.
    #[cfg(feature = "max-instruction")]
    fn instruction_min(self, other: Self) -> Self;

    /// Absolute value, one instruction.
    fn magnitude(self) -> Self;
}

/// Marks the branch that it is called in as one that is hardly ever taken: the compiler then keeps it a branch, out of the way.
#[cold]
#[inline]
pub(crate) fn rarely() {}

macro_rules! impl_real {
    ($type:ty) => {
        impl Real for $type {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as $type
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                <$type>::is_finite(self)
            }
            #[inline(always)]
            fn magnitude(self) -> Self {
                <$type>::abs(self)
            }
            #[cfg(feature = "max-instruction")]
            #[inline(always)]
            fn instruction_max(self, other: Self) -> Self {
                <$type>::max(self, other)
            }
            #[cfg(feature = "max-instruction")]
            #[inline(always)]
            fn instruction_min(self, other: Self) -> Self {
                <$type>::min(self, other)
            }
        }
    };
}
impl_real!(f32);
impl_real!(f64);
