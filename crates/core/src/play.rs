//! Play operators, one and many (eqs 1-4, 7, 8).

use crate::real::Real;

/// The two-sided play operator, eq. 2: `f_r(v, w) = max(v - r, min(v + r, w))`.
#[inline(always)]
///
/// # Example
/// ```
/// use hysteron_core::play::two_sided;
/// let up = two_sided(3.0, 0.0, 1.0);
/// assert_eq!((up, two_sided(2.5, up, 1.0)), (2.0, 2.0)); // a play of 1 V stands still after it turns
/// ```
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

/// As [`advance`], of which it moves the first plays only, where the others cannot move.
///
/// With ascending thresholds and `left <= right`, outputs that any number of samples has reached from equal ones do not rise from
/// play to play, and a play that is strictly inside its bounds has none behind it that is outside: where it was last pushed, those
/// behind it were pushed as far or farther. (Strictly, since two plays may be rounded onto one bound.) All move on one side.
#[inline(always)]
pub fn advance_ordered<T: Real>(thresholds: &[T], outputs: &mut [T], left: T, right: T) {
    let mut moved = false;
    for output in outputs.iter_mut() {
        if right >= *output {
            break;
        }
        *output = right;
        moved = true;
    }
    if moved {
        return;
    }
    for (output, &threshold) in outputs.iter_mut().zip(thresholds) {
        let pushed = left - threshold;
        if pushed < *output {
            break;
        }
        *output = pushed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both operators along one loop, by hand: a play of width r follows its input at a distance once it has been pushed.
    #[test]
    fn val_loops_by_hand() {
        // input, two-sided with r = 1 (dead band 2), one-sided with r = 1 (dead band 1)
        let rows = [
            (0.0, 0.0, 0.0),
            (0.5, 0.0, 0.0), // inside both dead bands
            (1.5, 0.5, 0.5), // pushed up: v - r
            (3.0, 2.0, 2.0),
            (2.5, 2.0, 2.0), // turned: both stand
            (1.5, 2.0, 1.5), // one-sided: pushed down at v
            (0.5, 1.5, 0.5), // two-sided: pushed down at v + r
            (1.2, 1.5, 0.5), // turned again
            (-4.0, -3.0, -4.0),
        ];
        let (mut two, mut one) = (0.0_f64, 0.0_f64);
        for (input, of_two, of_one) in rows {
            two = two_sided(input, two, 1.0);
            one = one_sided(input, one, 1.0);
            assert_eq!((two, one), (of_two, of_one), "input {input}");
        }
    }

    /// `F_or,2r[v] = F_r[v - r]`: the one-sided play is the two-sided one of half the width, shifted by it.
    #[test]
    fn val_one_sided_is_a_shifted_two_sided() {
        for r in [0.0, 0.25, 1.0] {
            // Quarters are exact: no tolerance.
            let (mut one, mut two) = (-r, -r);
            for k in 0..200 {
                let v = f64::from(k * k % 37 - 18) * 0.25;
                one = one_sided(v, one, 2.0 * r);
                two = two_sided(v - r, two, r);
                assert_eq!(one, two, "r {r}, v {v}");
            }
        }
    }

    /// Area of a one-sided play's settled loop over a swing A > r, by hand: a parallelogram of width r and height A - r.
    #[test]
    fn val_loop_area() {
        let (swing, r, steps) = (3.0, 0.5, 3000);
        let (mut w, mut area, mut last) = (0.0, 0.0, (0.0, 0.0));
        for k in 0..=4 * steps {
            let phase = k % (2 * steps);
            let v = swing * f64::from(phase.min(2 * steps - phase)) / f64::from(steps);
            w = one_sided(v, w, r);
            if k > 2 * steps {
                area += 0.5 * (w + last.1) * (last.0 - v);
            }
            last = (v, w);
        }
        // The trapezoid rule is exact but where the play starts and stops: twice (A / steps)^2 / 2.
        assert!((area - r * (swing - r)).abs() < 2e-6, "{area}");
    }

    /// With width 0 a play is its input, whatever it was before; the enveloped play with both bounds at the input is
    /// the one-sided one.
    #[test]
    fn val_limits_of_the_family() {
        for (v, w) in [(0.3, 5.0), (-2.0, 0.1), (1.0, 1.0)] {
            assert_eq!((two_sided(v, w, 0.0), one_sided(v, w, 0.0)), (v, v));
            assert_eq!(enveloped(v, v, w, 0.7), one_sided(v, w, 0.7));
        }
    }

    /// Envelopes that have crossed, `h_l - r > h_r`, as no alpha, beta >= 0 make: the left one wins, as eq. 8 nests them.
    #[test]
    fn val_enveloped_by_hand() {
        for (left, right, w, wanted) in [
            (0.8, 1.1, 5.0, 1.1), // pushed down to h_r
            (0.8, 1.1, 0.1, 0.3), // pushed up to h_l - r
            (0.8, 1.1, 0.9, 0.9), // between
            (2.0, 1.0, 5.0, 1.5),
        ] {
            assert!((enveloped(left, right, w, 0.5_f64) - wanted).abs() < 1e-15);
        }
    }
}
