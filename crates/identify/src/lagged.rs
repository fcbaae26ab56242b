//! Sums of products of two series at many lags.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

/// Samples that one transform takes at most, where the lags are fewer.
const BLOCK: usize = 1 << 20;

/// Sums of `first[t] second[t + k]` over t at each lag k from `-before` to `after`, ascending; outside of either stand zeros.
///
/// # Cost
/// O(n log n), by Fourier transforms of blocks; memory for the lags and for a million samples at most.
pub fn lagged_products(first: &[f64], second: &[f64], before: usize, after: usize) -> Vec<f64> {
    let block = first.len().clamp(1, BLOCK.max(before + after));
    let size = (before + block + after).next_power_of_two().max(2);
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
    // Lengths are the plans' own, and the ends of a real series' spectrum are real: no transform fails.
    let transformed = |values: &[f64], at: usize| {
        let mut time = forward.make_input_vec();
        time[at..at + values.len()].copy_from_slice(values);
        let mut lines = forward.make_output_vec();
        let _ = forward.process(&mut time, &mut lines);
        lines
    };
    let mut sum: Vec<Complex64> = forward.make_output_vec();
    for start in (0..first.len()).step_by(block) {
        let end = (start + block).min(first.len());
        let of_first = transformed(&first[start..end], before);
        // What lies at most so many samples before and behind the block.
        let from = start.saturating_sub(before).min(second.len());
        let beside = &second[from..(end + after).min(second.len())];
        let same = before == 0 && block == first.len() && std::ptr::eq(first, beside);
        let of_second = (!same).then(|| transformed(beside, before.saturating_sub(start - from)));
        let of_second = of_second.as_ref().unwrap_or(&of_first);
        for (sum, (a, b)) in sum.iter_mut().zip(of_first.iter().zip(of_second)) {
            *sum += a.conj() * b;
        }
    }
    if let [zero, .., last] = &mut sum[..] {
        (zero.im, last.im) = (0.0, 0.0);
    }
    let mut time = inverse.make_output_vec();
    let _ = inverse.process(&mut sum, &mut time);
    let lags = (size - before..size).chain(0..=after);
    lags.map(|lag| time[lag] / size as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn by_definition(first: &[f64], second: &[f64], lag: i64) -> f64 {
        let partner = |t: usize| second.get(usize::try_from(t as i64 + lag).ok()?);
        let products = first.iter().enumerate().filter_map(|(t, a)| Some(a * partner(t)?));
        products.sum()
    }

    proptest! {
        #[test]
        fn prop_sums_are_those_of_the_definition(
            first in prop::collection::vec(-1.0..1.0, 0..60),
            second in prop::collection::vec(-1.0..1.0, 0..60),
            before in 0..70_usize,
            after in 0..70_usize,
        ) {
            let found = lagged_products(&first, &second, before, after);
            prop_assert_eq!(found.len(), before + 1 + after);
            for (k, found) in found.iter().enumerate() {
                let wanted = by_definition(&first, &second, k as i64 - before as i64);
                prop_assert!((found - wanted).abs() < 1e-12);
            }
            let own = lagged_products(&first, &first, 0, after);
            for (k, found) in own.iter().enumerate() {
                prop_assert!((found - by_definition(&first, &first, k as i64)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn val_a_series_of_several_blocks() {
        let series = |seed: f64| -> Vec<f64> {
            let values = (0..2 * BLOCK + 12_345).map(|k| (seed * k as f64).sin() + (0.37 * seed * k as f64).cos());
            values.collect()
        };
        let (first, second) = (series(0.11), series(0.113));
        let found = lagged_products(&first, &second, 300, 500);
        for lag in [-300, -7, 0, 250, 500] {
            let wanted = by_definition(&first, &second, lag);
            let at = usize::try_from(lag + 300).unwrap();
            assert!((found[at] - wanted).abs() < 1e-6, "{lag}: {} {wanted}", found[at]);
        }
    }
}
