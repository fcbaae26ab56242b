//! The power of what is no line, octave by octave from half the sampling rate down.

use crate::median;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// Octaves below half the sampling rate that are looked at; what is slower is drift.
const OCTAVES: usize = 6;
/// Fewest bins from which an octave's level is told.
const FEWEST_BINS: usize = 12;
/// The median of an exponential distribution of mean 1.
const MEDIAN: f64 = std::f64::consts::LN_2;

/// Power in one octave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Octave {
    /// Variance of white noise with this power a hertz.
    pub level: f64,
    /// Bins that were looked at.
    pub bins: usize,
}

impl Octave {
    /// Standard error of the level, as a share of it: median of exponentials, neighbours of a Hann window correlated.
    pub(crate) fn uncertainty(self) -> f64 {
        1.7 / (self.bins as f64).sqrt()
    }
}

/// Hann-windowed transform of a series about its mean, and the sum of the squared window.
pub(crate) fn transform(values: &[f64]) -> (Vec<Complex<f64>>, f64) {
    let n = values.len();
    let forward = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let mean = values.iter().sum::<f64>() / n as f64;
    let mut squares = 0.0;
    let mut time: Vec<f64> = values
        .iter()
        .enumerate()
        .map(|(k, v)| {
            let w = hann(k, n);
            squares += w * w;
            w * (v - mean)
        })
        .collect();
    let mut bins = forward.make_output_vec();
    if forward.process(&mut time, &mut bins).is_err() {
        bins.fill(Complex::new(0.0, 0.0));
    }
    (bins, squares)
}

/// Power of each bin of that transform.
pub(crate) fn power(values: &[f64]) -> Vec<f64> {
    transform(values).0.iter().map(|bin| bin.norm_sqr()).collect()
}

/// A Hann window's weight.
pub(crate) fn hann(k: usize, n: usize) -> f64 {
    0.5 - 0.5 * (std::f64::consts::TAU * (k as f64 + 0.5) / n as f64).cos()
}

/// Octaves of a series, the fastest first; bins for which `line` holds are left out.
///
/// The level is by the median of the bins: a line among them, be it hum, coupling or a folded ripple, does not count.
pub(crate) fn octaves(values: &[f64], line: impl Fn(usize) -> bool) -> Vec<Octave> {
    if values.len() < 2 * FEWEST_BINS {
        return Vec::new();
    }
    let (bins, squares) = transform(values);
    let power = |k: usize| bins[k].norm_sqr() / squares;
    by_octave(values.len(), |k| (!line(k)).then(|| power(k)))
}

fn by_octave(n: usize, power: impl Fn(usize) -> Option<f64>) -> Vec<Octave> {
    let mut found = Vec::new();
    for octave in 0..OCTAVES {
        let mut powers: Vec<f64> = ((n >> (octave + 2)).max(3)..n >> (octave + 1))
            .filter_map(&power)
            .collect();
        if powers.len() < FEWEST_BINS {
            break;
        }
        found.push(Octave {
            level: median(&mut powers) / MEDIAN,
            bins: powers.len(),
        });
    }
    found
}

/// Neighbouring bins over which the answer to a drive is one factor.
const ALIKE: usize = 15;
/// Neighbours of a Hann window are correlated: so many of them are one.
const CORRELATED: f64 = 1.5;

/// Octaves of what of a series does not go with a drive, and beside each what the drive itself has there.
pub(crate) fn octaves_beside(values: &[f64], drive: &[f64]) -> Vec<(Octave, f64)> {
    let n = values.len();
    if n < 2 * ALIKE * FEWEST_BINS {
        return octaves(values, |_| false)
            .into_iter()
            .map(|o| (o, f64::INFINITY))
            .collect();
    }
    let ((bins, squares), (drives, _)) = (transform(values), transform(drive));
    let mut left = vec![0.0; bins.len()];
    for ((left, bins), drives) in left.chunks_mut(ALIKE).zip(bins.chunks(ALIKE)).zip(drives.chunks(ALIKE)) {
        let power: f64 = drives.iter().map(|d| d.norm_sqr()).sum();
        let cross: Complex<f64> = bins.iter().zip(drives).map(|(b, d)| b * d.conj()).sum();
        let factor = cross / power.max(f64::MIN_POSITIVE);
        let freedom = 1.0 / (1.0 - CORRELATED / (bins.len() as f64).max(2.0 * CORRELATED));
        for ((left, b), d) in left.iter_mut().zip(bins).zip(drives) {
            *left = (b - factor * d).norm_sqr() / squares * freedom;
        }
    }
    let of_drive = by_octave(n, |k| Some(drives[k].norm_sqr() / squares));
    by_octave(n, |k| Some(left[k]))
        .into_iter()
        .zip(of_drive)
        .map(|(octave, drive)| (octave, drive.level))
        .collect()
}

/// Variance of a noise with these octaves, slower ones as the last, and the bins behind it.
pub(crate) fn variance(octaves: &[Octave]) -> Option<(f64, usize)> {
    let last = octaves.last()?;
    let mut share = 1.0;
    let mut sum = 0.0;
    for octave in octaves {
        share *= 0.5;
        sum += share * octave.level;
    }
    Some((sum + share * last.level, octaves.iter().map(|o| o.bins).sum()))
}

/// The fastest octaves that are one level: the drive's answer falls from octave to octave, white noise does not.
pub(crate) fn level_ones(octaves: &[Octave]) -> &[Octave] {
    let alike = |pair: &[Octave]| {
        let apart = 4.0 * pair[0].uncertainty().hypot(pair[1].uncertainty());
        let ratio = pair[1].level / pair[0].level.max(f64::MIN_POSITIVE);
        ratio < 1.3 + apart && ratio > 1.0 / (1.3 + apart)
    };
    let levels = octaves.windows(2).take_while(|pair| alike(pair)).count();
    &octaves[..(levels + 1).min(octaves.len())]
}
