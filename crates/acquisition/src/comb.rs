//! A periodic drive: its true period, that need not be a whole number of samples, and what of a series goes with it.

use crate::octaves::{hann, power};
use crate::{median, span};

/// A drive that repeats to the record's end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Comb {
    /// Cycles a sample of the fundamental.
    pub cycles: f64,
    /// First sample from which on it repeats.
    pub from: usize,
}

/// Power beside the harmonics, as a share of all, up to which a drive counts as periodic: a monitored voltage has noise.
const BESIDE: f64 = 1e-4;
/// Fewest periods that tell that a drive repeats.
const FEWEST_PERIODS: f64 = 1.9;
/// Most periods of the strongest line that one period of the drive may have.
const MOST_LINES: usize = 40;
/// Harmonics that are taken out.
const HARMONICS: usize = 150;
/// Power of a harmonic's bins over the median of all, from which on it is there.
const STANDS_OUT: f64 = 20.0;
/// Share of what is left below which a harmonic need not be taken out again.
const SMALL: f64 = 1e-4;
/// Longest part of a record that is looked at, samples.
const LONGEST: usize = 1 << 17;
/// Bins of a Hann window that a line fills on each side.
pub(crate) const WIDTH: f64 = 2.5;
/// Bins from a line at which a Hann window has left a hundred-thousandth of its power.
const FAR: f64 = 4.5;

impl Comb {
    /// The period of a drive, if it has one: of the whole record, or of its later part.
    pub(crate) fn find(drive: &[f64]) -> Option<Self> {
        let n = drive.len();
        if n < 32 || span(drive) <= 0.0 {
            return None;
        }
        [0, n / 4, n / 2].into_iter().find_map(|from| {
            let from = from.max(n.saturating_sub(LONGEST));
            fundamental(&drive[from..]).map(|cycles| Self { cycles, from })
        })
    }

    /// Periods in the part that repeats of a record of `len` samples.
    pub(crate) fn periods(&self, len: usize) -> f64 {
        self.cycles * (len - self.from) as f64
    }

    /// The repeating part of a series, cut to whole periods, without its harmonics.
    pub(crate) fn remainder(&self, series: &[f64]) -> Vec<f64> {
        let periods = self.periods(series.len()).floor().max(1.0);
        let samples = ((periods / self.cycles).round() as usize).min(series.len() - self.from);
        let mut left = series[series.len() - samples..].to_vec();
        without_parabola(&mut left);
        let highest = ((0.5 / self.cycles) as usize).min(HARMONICS);
        let mut harmonics = self.standing_out(&left, highest);
        // Windowed projections hardly see each other; what they do see is gone after four rounds.
        for _ in 0..4 {
            let largest = span(&left);
            harmonics.retain(|&harmonic| take_out(&mut left, harmonic as f64 * self.cycles) > SMALL * largest);
            without_parabola(&mut left);
        }
        left
    }

    /// The harmonics up to the highest that stand out from what is between them; the others need not be taken out.
    fn standing_out(&self, series: &[f64], highest: usize) -> Vec<usize> {
        let power = power(series);
        let level = STANDS_OUT * median(&mut power.clone());
        let stands_out = |harmonic: &usize| {
            let bin = (*harmonic as f64 * self.cycles * series.len() as f64).round() as usize;
            let near = power.get(bin.saturating_sub(1)..(bin + 2).min(power.len()));
            near.is_some_and(|near| near.iter().any(|&power| power > level))
        };
        (1..=highest).filter(stands_out).collect()
    }

    /// Whether a bin of a transform of `len` samples lies on a line of the drive.
    pub(crate) fn is_on_line(&self, bin: usize, len: usize) -> bool {
        self.distance(bin as f64, len) < WIDTH
    }

    /// Bins from the nearest line of the drive.
    pub(crate) fn distance(&self, bin: f64, len: usize) -> f64 {
        let spacing = self.cycles * len as f64;
        (bin - (bin / spacing).round() * spacing).abs()
    }

    /// Whether bins stay free between the lines of `len` samples.
    pub(crate) fn leaves_gaps(&self, len: usize) -> bool {
        self.cycles * len as f64 > 2.0 * WIDTH + 1.5
    }
}

/// Cosine and sine weights of a line under a Hann window, twice the mean product.
fn projection(series: &[f64], cycles: f64) -> (f64, f64) {
    let n = series.len();
    let step = std::f64::consts::TAU * cycles;
    let (turn_sin, turn_cos) = step.sin_cos();
    let (mut c, mut s) = (1.0f64, 0.0f64);
    let (mut a, mut b, mut weight) = (0.0, 0.0, 0.0);
    for (k, y) in series.iter().enumerate() {
        // Rounding of the rotation is taken out now and then.
        if k % 1024 == 0 {
            (s, c) = (step * k as f64).sin_cos();
        }
        let w = hann(k, n);
        (a, b, weight) = (a + w * y * c, b + w * y * s, weight + w);
        (c, s) = (c * turn_cos - s * turn_sin, s * turn_cos + c * turn_sin);
    }
    (2.0 * a / weight, 2.0 * b / weight)
}

/// Amplitude of a line.
pub(crate) fn amplitude(series: &[f64], cycles: f64) -> f64 {
    let (a, b) = projection(series, cycles);
    a.hypot(b)
}

/// Phase of a line, from -pi to pi.
pub(crate) fn phase(series: &[f64], cycles: f64) -> f64 {
    let (a, b) = projection(series, cycles);
    (-b).atan2(a)
}

/// Takes a line out of a series; its amplitude.
fn take_out(series: &mut [f64], cycles: f64) -> f64 {
    let (a, b) = projection(series, cycles);
    let step = std::f64::consts::TAU * cycles;
    let (turn_sin, turn_cos) = step.sin_cos();
    let (mut c, mut s) = (1.0f64, 0.0f64);
    for (k, y) in series.iter_mut().enumerate() {
        if k % 1024 == 0 {
            (s, c) = (step * k as f64).sin_cos();
        }
        *y -= a * c + b * s;
        (c, s) = (c * turn_cos - s * turn_sin, s * turn_cos + c * turn_sin);
    }
    a.hypot(b)
}

/// Takes the least-squares parabola out.
pub(crate) fn without_parabola(values: &mut [f64]) {
    let n = values.len() as f64;
    if n < 4.0 {
        return;
    }
    let centre = (n - 1.0) / 2.0;
    let mean_square = (n * n - 1.0) / 12.0;
    // Orthogonal on an even grid: 1, x, x^2 - mean(x^2).
    let bases: [fn(f64, f64) -> f64; 3] = [|_, _| 1.0, |x, _| x, |x, m| x * x - m];
    for base in bases {
        let at = |k: usize| base(k as f64 - centre, mean_square);
        let (dot, norm) = values.iter().enumerate().fold((0.0, 0.0), |(dot, norm), (k, v)| {
            (dot + at(k) * v, norm + at(k) * at(k))
        });
        let share = dot / norm.max(f64::MIN_POSITIVE);
        values.iter_mut().enumerate().for_each(|(k, v)| *v -= share * at(k));
    }
}

/// Cycles a sample of the fundamental, where all but a ten-thousandth of the power lies on its harmonics.
fn fundamental(drive: &[f64]) -> Option<f64> {
    let n = drive.len();
    let power = power(drive);
    let strongest = (1..power.len()).max_by(|&a, &b| power[a].total_cmp(&power[b]))?;
    // The strongest line between its bins, by the phase it gains from the first half to the second.
    let line = sharpened(drive, strongest as f64 / n as f64);
    let total: f64 = power[1..].iter().sum();
    (1..=MOST_LINES).find_map(|lines| {
        let cycles = line / lines as f64;
        let spacing = cycles * n as f64;
        if spacing < FEWEST_PERIODS {
            return None;
        }
        // Few periods have lines a few bins apart: nothing lies well beside them, and the samples themselves decide.
        if spacing < 2.0 * FAR + 2.0 {
            return repeating(drive, cycles);
        }
        let beside: f64 = (1..power.len())
            .filter(|&k| {
                let nearest = (k as f64 / spacing).round() * spacing;
                (k as f64 - nearest).abs() > FAR
            })
            .map(|k| power[k])
            .sum();
        (beside < BESIDE * total).then(|| refined(drive, cycles))
    })
}

/// Part of the period by which the phase of a line of few periods may be wrong: it sees its own mirror image.
const OFF: f64 = 0.02;
/// Halvings of that part.
const HALVINGS: usize = 12;

/// The fundamental near `cycles` after whose period a drive is the same, if it is.
fn repeating(drive: &[f64], cycles: f64) -> Option<f64> {
    let (mut lag, mut step) = (1.0 / cycles, OFF / cycles);
    let mut least = apart(drive, lag);
    for _ in 0..HALVINGS {
        step *= 0.5;
        for tried in [lag - step, lag + step] {
            let apart = apart(drive, tried);
            if apart < least {
                (lag, least) = (tried, apart);
            }
        }
    }
    (least < BESIDE).then(|| 1.0 / lag)
}

/// How far a drive differs from itself a lag later, by straight lines between its samples, as a share of its power.
fn apart(drive: &[f64], lag: f64) -> f64 {
    let (whole, part) = (lag.floor() as usize, lag.fract());
    let mean = drive.iter().sum::<f64>() / drive.len() as f64;
    let (mut apart, mut all) = (0.0, 0.0);
    for k in 0..drive.len().saturating_sub(whole + 1) {
        let later = drive[k + whole] + part * (drive[k + whole + 1] - drive[k + whole]);
        apart += (later - drive[k]).powi(2);
        all += (drive[k] - mean).powi(2);
    }
    if all > 0.0 { apart / all } else { f64::INFINITY }
}

/// The frequency of a line near `cycles`, by the phase that it gains from the first half to the second.
fn sharpened(series: &[f64], mut cycles: f64) -> f64 {
    let half = series.len() / 2;
    for _ in 0..3 {
        let expected = std::f64::consts::TAU * cycles * half as f64;
        let gained = phase(&series[half..2 * half], cycles) - phase(&series[..half], cycles) - expected;
        let turns = gained / std::f64::consts::TAU;
        let off = turns - turns.round();
        cycles += off / half as f64;
    }
    cycles
}

/// The fundamental by ever higher harmonics, as far as the drive has them.
fn refined(drive: &[f64], cycles: f64) -> f64 {
    let size = |cycles: f64| amplitude(drive, cycles);
    let strongest = (1..=5).map(|h| size(f64::from(h) * cycles)).fold(0.0, f64::max);
    let mut best = cycles;
    for harmonic in [1.0, 3.0, 9.0, 27.0, 81.0] {
        let line = harmonic * best;
        if line < 0.45 && size(line) > 1e-3 * strongest {
            let found = sharpened(drive, line) / harmonic;
            // A line of its own beside the harmonic would pull it away.
            if ((found - best) * harmonic * drive.len() as f64).abs() < 0.5 {
                best = found;
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(n: usize, cycles: f64) -> Vec<f64> {
        (0..n)
            .map(|k| 13.0 - 13.0 * (std::f64::consts::TAU * cycles * k as f64).cos())
            .collect()
    }

    /// A clock that is off by 100 ppm moves a record of 50 periods by 0.005 periods.
    #[test]
    fn val_a_period_off_the_clock() {
        for ppm in [0.0, 100.0, 250.0, 500.0] {
            let cycles = 0.005 * (1.0 + 1e-6 * ppm);
            let found = Comb::find(&sine(10_000, cycles)).unwrap();
            assert!((found.cycles / cycles - 1.0).abs() < 1e-9, "{ppm}: {found:?}");
        }
    }

    #[test]
    fn val_a_triangle_and_a_period_between_samples() {
        for cycles in [97.0 / 50_000.0, 0.01, 0.0037] {
            let triangle: Vec<f64> = (0..20_000)
                .map(|k| (2.0 * (cycles * f64::from(k)).fract() - 1.0).abs())
                .collect();
            let found = Comb::find(&triangle).unwrap();
            assert!((found.cycles / cycles - 1.0).abs() < 1e-6, "{cycles}: {found:?}");
        }
    }

    /// Windowed halves of few periods see their mirror image, and the phase between them is off by a hundredth of a turn.
    #[test]
    fn val_few_periods() {
        for (periods, n) in [(2.0, 900), (2.6, 5000), (5.0, 2500), (6.3, 800)] {
            let cycles = periods / f64::from(n);
            let found = Comb::find(&sine(n as usize, cycles)).unwrap();
            assert!((found.cycles / cycles - 1.0).abs() < 1e-4, "{periods}: {found:?}");
        }
    }

    #[test]
    fn refuse_ramps_rests_and_a_single_period() {
        assert_eq!(Comb::find(&vec![3.0; 500]), None);
        assert_eq!(Comb::find(&(0..500).map(f64::from).collect::<Vec<_>>()), None);
        assert_eq!(Comb::find(&sine(500, 0.002)), None);
    }
}
