//! From lines of a spectrum to one period.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// `sum_k a_k cos(2 pi k n / length + phi_k)` for the lines (k, a_k, phi_k), 0 < k < length / 2.
pub(super) fn periodic(length: usize, lines: &[(usize, f64, f64)]) -> Vec<f64> {
    let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(length);
    let mut spectrum = plan.make_input_vec();
    for &(k, amplitude, phase_rad) in lines {
        if let Some(bin) = spectrum.get_mut(k) {
            *bin = Complex::from_polar(0.5 * amplitude, phase_rad);
        }
    }
    let mut samples = plan.make_output_vec();
    // The lengths are the plan's own and the bins at 0 and Nyquist are real: it cannot fail; if it ever did, silence is the answer.
    if plan.process(&mut spectrum, &mut samples).is_err() {
        samples.fill(0.0);
    }
    samples
}
