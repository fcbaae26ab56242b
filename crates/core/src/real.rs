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

    /// The larger of the two by compare-select (one `vsel` on Cortex-M; `f32::max` calls out of line).
    /// Returns `other` when `self` is NaN.
    #[inline(always)]
    fn select_max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// The smaller of the two by compare-select. Returns `other` when `self` is NaN.
    #[inline(always)]
    fn select_min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    /// Absolute value by compare-select.
    #[inline(always)]
    fn magnitude(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }
}

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
        }
    };
}
impl_real!(f32);
impl_real!(f64);
