//! Play operators, one and many (eqs 1-4, 7, 8).

use crate::real::Real;

/// The two-sided play operator, eq. 2: `f_r(v, w) = max(v - r, min(v + r, w))`.
#[inline(always)]
pub fn two_sided<T: Real>(input: T, output: T, threshold: T) -> T {
    (input - threshold).select_max((input + threshold).select_min(output))
}

/// The one-sided play operator, eq. 4: `f_or(v, w) = max(v - r, min(v, w))`.
#[inline(always)]
pub fn one_sided<T: Real>(input: T, output: T, threshold: T) -> T {
    (input - threshold).select_max(input.select_min(output))
}

/// The one-sided play operator with a dynamic envelope, eq. 8: `f(v, w) = max(h_l - r, min(h_r, w))`.
///
/// `left` is h_l, `right` is h_r of [`crate::envelope::Envelope`]. With both equal to the input it is [`one_sided`].
#[inline(always)]
pub fn enveloped<T: Real>(left: T, right: T, output: T, threshold: T) -> T {
    (left - threshold).select_max(right.select_min(output))
}

/// Moves a bank of play operators by one sample, in place: each output by [`enveloped`] with its own threshold.
///
/// `thresholds` and `outputs` have the same length (further elements of the longer one are left alone).
#[inline(always)]
pub fn advance<T: Real>(thresholds: &[T], outputs: &mut [T], left: T, right: T) {
    for (output, &threshold) in outputs.iter_mut().zip(thresholds) {
        *output = enveloped(left, right, *output, threshold);
    }
}
