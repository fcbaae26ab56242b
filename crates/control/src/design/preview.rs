//! The finite filter in front of the inverse: latency and structure undone, by least squares in the frequency domain.

use hysteron_core::biquad::Biquad;
use hysteron_identify::control::LinearPart;
use nalgebra::{DMatrix, DVector};
use realfft::num_complex::Complex64;
use std::f64::consts::TAU;

pub use hysteron_core::tracking_law::TAPS;
/// Samples that a previewed reference comes before it is due: half of the filter looks ahead, half back.
pub const AHEAD: usize = 16;
/// Frequencies of the least squares, evenly over half the sample rate: sixteen a coefficient.
const GRID: usize = 16 * TAPS;
/// References have full amplitude up to here, hertz; above, they and their errors fall with 1/f (corners of triangles).
const FULL_AMPLITUDE_HZ: f64 = 1500.0;
/// Weight of the filter's own gain above the usable band, against relative errors of the position within it: keeps the kicks
/// that corners ask for within the amplifier's range.
const QUIET: f64 = 1e-3;

/// How well the filter does what it is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreviewQuality {
    /// Largest error of the position up to 500 Hz, as a share of the reference: latency, structure and filter together.
    pub worst_to_500_hz: f64,
    /// The same up to 1 kHz.
    pub worst_to_1_khz: f64,
    /// Highest frequency to which the gain stays within 3 dB and the phase within 30 degrees, hertz.
    pub bandwidth_hz: f64,
}

/// What the filter has to undo: the structure behind the section that takes care of a second mode.
pub struct Undone<'a> {
    /// The identified lag and modes.
    pub linear: &'a LinearPart,
    /// The section beside the filter.
    pub second_mode: Biquad<f64>,
    /// Time by which the inverse has to come early, seconds.
    pub advance_s: f64,
    /// Sample period, seconds.
    pub period_s: f64,
    /// Samples that the reference comes before it is due.
    pub ahead: usize,
}

impl Undone<'_> {
    fn response(&self, omega: f64) -> Complex64 {
        section(&self.second_mode, Complex64::from_polar(1.0, -omega * self.period_s)) * self.linear.structure(omega)
    }
}

/// `H` of a second-order section where a sample's delay is `z`, `e^(-j w T)`.
fn section(biquad: &Biquad<f64>, z: Complex64) -> Complex64 {
    let (above, below) = fraction(biquad, z);
    above / below
}

/// Numerator and denominator of that.
pub(super) fn fraction(biquad: &Biquad<f64>, z: Complex64) -> (Complex64, Complex64) {
    let (b, a) = biquad.coefficients();
    (b[0] + z * (b[1] + z * b[2]), 1.0 + z * (a[0] + z * a[1]))
}

/// Designs `H(z)` so that `H(e^(j w T)) B(e^(j w T)) M(j w) = e^(j w a)`, with `a` the time by which the inverse has to come
/// early and B the section for a second mode.
///
/// With `ahead` = 0 the same least squares is the best causal extrapolation for references below the band.
pub fn design(undone: &Undone<'_>, band_hz: f64) -> [f64; TAPS] {
    let (period_s, ahead) = (undone.period_s, undone.ahead);
    let mut normal = DMatrix::<f64>::zeros(TAPS, TAPS);
    let mut right = DVector::<f64>::zeros(TAPS);
    for n in 0..=GRID {
        let hz = 0.5 / period_s * n as f64 / GRID as f64;
        let omega = TAU * hz;
        let structure = undone.response(omega);
        let amplitude = (FULL_AMPLITUDE_HZ / hz.max(FULL_AMPLITUDE_HZ)).powi(2);
        let (wanted, weight) = if n == 0 {
            // Rest stays rest.
            (Complex64::new(1.0, 0.0), 1e6)
        } else if hz <= band_hz {
            let wanted = Complex64::from_polar(1.0, omega * undone.advance_s) / structure;
            (wanted, amplitude * structure.norm_sqr())
        } else {
            (Complex64::default(), QUIET * amplitude * structure.norm_sqr().min(1.0))
        };
        let row: Vec<Complex64> = (0..TAPS)
            .map(|j| Complex64::from_polar(1.0, omega * period_s * (ahead as f64 - j as f64)))
            .collect();
        for i in 0..TAPS {
            for j in 0..TAPS {
                normal[(i, j)] += weight * (row[i].conj() * row[j]).re;
            }
            right[i] += weight * (row[i].conj() * wanted).re;
        }
    }
    let scale = normal.trace() / TAPS as f64;
    for i in 0..TAPS {
        normal[(i, i)] += RIDGE * scale;
    }
    let solution = normal.cholesky().map(|factor| factor.solve(&right)).unwrap_or_default();
    let mut taps = [0.0; TAPS];
    taps.iter_mut()
        .zip(solution.iter())
        .for_each(|(tap, value)| *tap = *value);
    let sum: f64 = taps.iter().sum();
    if sum != 0.0 {
        taps.iter_mut().for_each(|tap| *tap /= sum);
    }
    taps
}

/// Ridge, as a share of the mean weight of a coefficient: the sixth digit of a coefficient.
const RIDGE: f64 = 1e-12;

/// Response from the reference to the position.
fn through(taps: &[f64; TAPS], undone: &Undone<'_>, hz: f64) -> Complex64 {
    let (period_s, ahead) = (undone.period_s, undone.ahead);
    let omega = TAU * hz;
    let gain: Complex64 = taps
        .iter()
        .enumerate()
        .map(|(j, h)| Complex64::from_polar(*h, omega * (period_s * (ahead as f64 - j as f64) - undone.advance_s)))
        .sum();
    gain * undone.response(omega)
}

/// What a filter leaves of a reference of one frequency.
pub fn error_at(taps: &[f64; TAPS], undone: &Undone<'_>, hz: f64) -> f64 {
    (through(taps, undone, hz) - 1.0).norm()
}

/// Judges a filter on the linear part that it was designed for.
pub fn quality(taps: &[f64; TAPS], undone: &Undone<'_>) -> PreviewQuality {
    let period_s = undone.period_s;
    let at = |hz: f64| through(taps, undone, hz);
    let worst = |to_hz: f64| {
        (1..=200)
            .map(|n| (at(to_hz * f64::from(n) / 200.0) - 1.0).norm())
            .fold(0.0, f64::max)
    };
    let highest = 0.5 / period_s;
    let bandwidth_hz = (1..2000)
        .map(|n| highest * f64::from(n) / 2000.0)
        .take_while(|&hz| {
            let gain = at(hz);
            (0.708..1.413).contains(&gain.norm()) && gain.arg().abs() < 30_f64.to_radians()
        })
        .last()
        .unwrap_or(0.0);
    PreviewQuality {
        worst_to_500_hz: worst(500.0),
        worst_to_1_khz: worst(1000.0),
        bandwidth_hz,
    }
}
