//! The steps of a converter, as a column shows them.

/// A twentieth of a step is the rounding of a file, not another code.
const OFF_GRID: f64 = 0.05;
/// Steps of many sizes lie on a fine enough grid by chance: only those of few codes count.
const FEW_CODES: f64 = 8.0;
/// Fewest such steps.
const FEWEST: u32 = 60;

/// The width of a code, where all values of a column are multiples of one step; 0 where they are not.
pub(crate) fn code_width(values: &[f64]) -> f64 {
    let steps = || values.windows(2).map(|y| (y[1] - y[0]).abs());
    let least = steps().filter(|&step| step > 0.0).fold(f64::INFINITY, f64::min);
    let on_grid = |step: f64| (step / least - (step / least).round()).abs() < OFF_GRID;
    let (mut small, mut off) = (0u32, 0u32);
    for step in steps().filter(|&step| step <= FEW_CODES * least) {
        small += 1;
        off += u32::from(!on_grid(step));
    }
    if least.is_finite() && small >= FEWEST && off * 100 <= small {
        least
    } else {
        0.0
    }
}

/// Standard deviation of rounding to steps of this width.
pub(crate) fn rounding(code_width: f64) -> f64 {
    code_width / 12f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_steps_are_found_and_a_file_of_few_digits_does_not_hide_them() {
        let wave = |k: usize| (k as f64 * 0.01).sin();
        let coarse = |q: f64| -> Vec<f64> { (0..5000).map(|k| (wave(k) / q).round() * q).collect() };
        for q in [0.0731, 1e-3] {
            assert!((code_width(&coarse(q)) / q - 1.0).abs() < 1e-9);
        }
        let written: Vec<f64> = coarse(0.0731).iter().map(|v| (v * 1e3).round() / 1e3).collect();
        assert!((code_width(&written) / 0.073 - 1.0).abs() < 0.02);
        assert_eq!(code_width(&(0..5000).map(wave).collect::<Vec<_>>()), 0.0);
    }
}
