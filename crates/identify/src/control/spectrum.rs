//! Signals through a response of frequency.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

/// A signal whose end leads back to its beginning, through a response of the frequency in periods a sample, in place.
pub(super) fn through_spectrum(signal: &mut [f64], response: impl Fn(f64) -> Complex64) {
    let n = signal.len() as f64;
    let mut planner = RealFftPlanner::<f64>::new();
    let forward = planner.plan_fft_forward(signal.len());
    let inverse = planner.plan_fft_inverse(signal.len());
    let mut lines = forward.make_output_vec();
    // Lengths are the plans' own.
    let _ = forward.process(signal, &mut lines);
    for (k, line) in lines.iter_mut().enumerate() {
        *line = *line * response(k as f64 / n) / n;
    }
    // A real signal has real ends of its spectrum; what the response leaves there is rounding.
    for end in [0, lines.len() - 1] {
        lines[end].im = 0.0;
    }
    let _ = inverse.process(&mut lines, signal);
}
