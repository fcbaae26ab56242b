//! A recorded voltage beside a command: where the command begins in it, and by how much it differs there.

use realfft::RealFftPlanner;

/// Samples that a command is averaged down to before it is looked for.
const COARSE: usize = 8192;
/// Share of a command that must be there to be found.
const LEAST_OVERLAP: f64 = 0.5;

/// How much a recorded voltage is that of a command which begins at a sample of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Likeness {
    /// Sample of the recording at which the command begins; below zero where its beginning is not there.
    pub shift: isize,
    /// Samples of the command that are there.
    pub overlap: usize,
    /// Difference, rms, as a share of the command's range.
    pub off: f64,
    /// Factor of the recorded voltage over the command's.
    pub gain: f64,
    /// Correlation, -1 to 1.
    pub correlation: f64,
    /// Difference that a factor and an offset leave, rms, as a share of the command's range.
    pub shape_off: f64,
}

impl Likeness {
    const NONE: Self = Self {
        shift: 0,
        overlap: 0,
        off: f64::INFINITY,
        gain: 0.0,
        correlation: 0.0,
        shape_off: f64::INFINITY,
    };

    /// What the best shift makes largest: a periodic command shifted by a period is as like, and less of it is there.
    fn score(&self, samples: usize) -> f64 {
        self.correlation.abs() * (self.overlap as f64 / samples as f64).sqrt()
    }
}

/// The likeness where the command's first sample is sample `shift` of the recording, of samples of the command from `from` on.
pub(super) fn at(command_v: &[f64], recorded_v: &[f64], shift: isize, from: usize) -> Likeness {
    let first = from.max(shift.min(0).unsigned_abs());
    let in_recording = first.checked_add_signed(shift).unwrap_or(usize::MAX);
    let pairs = || command_v.iter().skip(first).zip(recorded_v.iter().skip(in_recording));
    let n = command_v
        .len()
        .saturating_sub(first)
        .min(recorded_v.len().saturating_sub(in_recording));
    if n == 0 {
        return Likeness::NONE;
    }
    let (c0, r0) = pairs().fold((0.0, 0.0), |(a, b), (c, r)| (a + c / n as f64, b + r / n as f64));
    let (mut cc, mut rr, mut cr, mut off) = (0.0, 0.0, 0.0, 0.0);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (c, r) in pairs() {
        cc += (c - c0).powi(2);
        rr += (r - r0).powi(2);
        cr += (c - c0) * (r - r0);
        off += (c - r).powi(2);
        (low, high) = (low.min(*c), high.max(*c));
    }
    let correlation = if cc > 0.0 && rr > 0.0 {
        cr / (cc * rr).sqrt()
    } else {
        0.0
    };
    let range = (high - low).max(f64::MIN_POSITIVE);
    let rms = |squares: f64| (squares.max(0.0) / n as f64).sqrt();
    Likeness {
        shift,
        overlap: n,
        off: rms(off) / range,
        gain: if cc > 0.0 { cr / cc } else { 1.0 },
        correlation,
        shape_off: rms(cc * (1.0 - correlation * correlation)) / range,
    }
}

/// The likeness at the best whole shift near `around`, within `reach` samples.
pub(super) fn near(command_v: &[f64], recorded_v: &[f64], around: isize, reach: usize) -> Likeness {
    let reach = reach as isize;
    let each = (around - reach..=around + reach).map(|shift| at(command_v, recorded_v, shift, 0));
    each.max_by(|a, b| a.score(command_v.len()).total_cmp(&b.score(command_v.len())))
        .unwrap_or(Likeness::NONE)
}

/// A first guess of the best shift, a whole number of `.1` samples, and its score; none where less than half of the command can be there.
pub(super) fn coarse(command_v: &[f64], recorded_v: &[f64]) -> Option<(Likeness, usize)> {
    let every = command_v.len().div_ceil(COARSE).max(1);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let shorter = |series: &[f64]| -> Vec<f64> { series.chunks(every).map(mean).collect() };
    let (command, recorded) = (shorter(command_v), shorter(recorded_v));
    let best = correlate(&command, &recorded)?;
    Some((
        Likeness {
            shift: best.shift * every as isize,
            overlap: best.overlap * every,
            ..best
        },
        every,
    ))
}

/// The likeness at the best whole shift of any.
pub(super) fn best(command_v: &[f64], recorded_v: &[f64]) -> Likeness {
    match coarse(command_v, recorded_v) {
        Some((guess, 1)) => guess,
        Some((guess, every)) => near(command_v, recorded_v, guess.shift, every),
        None => Likeness::NONE,
    }
}

/// The best shift of all, by correlation.
fn correlate(command: &[f64], recorded: &[f64]) -> Option<Likeness> {
    let (n, m) = (command.len(), recorded.len());
    let least = (LEAST_OVERLAP * n as f64).ceil() as usize;
    if n < 2 || m < least.max(2) {
        return None;
    }
    let length = (n + m).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    // About one mean, so that little is lost where large sums are taken off each other.
    let middle = command.iter().sum::<f64>() / n as f64;
    let about = |series: &[f64]| -> Vec<f64> { series.iter().map(|v| v - middle).collect() };
    let (command, recorded) = (about(command), about(recorded));
    let spectrum = |series: &[f64]| {
        let mut time = series.to_vec();
        time.resize(length, 0.0);
        let mut lines = forward.make_output_vec();
        // Lengths are the plan's own.
        let _ = forward.process(&mut time, &mut lines);
        lines
    };
    let mut lines: Vec<_> = spectrum(&command)
        .iter()
        .zip(&spectrum(&recorded))
        .map(|(c, r)| c.conj() * r / length as f64)
        .collect();
    let mut products = vec![0.0; length];
    // Real ends, as a real series has them.
    if let [first, .., last] = lines.as_mut_slice() {
        (first.im, last.im) = (0.0, 0.0);
    }
    let _ = inverse.process(&mut lines, &mut products);
    let (of_command, of_recorded) = (Sums::of(&command), Sums::of(&recorded));
    let shifts = -(n as isize - least as isize)..=(m as isize - least as isize);
    let each = shifts.map(|shift| {
        let first = shift.min(0).unsigned_abs();
        let start = shift.max(0).unsigned_abs();
        let count = (n - first).min(m - start);
        let [c, cc] = of_command.over(first, count);
        let [r, rr] = of_recorded.over(start, count);
        let product = products[shift.rem_euclid(length as isize).unsigned_abs()];
        let of = count as f64;
        let (cc, rr, cr) = (cc - c * c / of, rr - r * r / of, product - c * r / of);
        let moves = cc > 1e-12 * of_command.squares() && rr > 1e-12 * of_recorded.squares();
        Likeness {
            shift,
            overlap: count,
            off: f64::INFINITY,
            gain: if moves { cr / cc } else { 0.0 },
            correlation: if moves { cr / (cc * rr).sqrt() } else { 0.0 },
            shape_off: f64::INFINITY,
        }
    });
    let best = each.max_by(|a, b| a.score(n).total_cmp(&b.score(n)))?;
    let from = at(&command, &recorded, best.shift, 0);
    Some(from)
}

/// Running sums of a series and of its squares.
struct Sums(Vec<[f64; 2]>);

impl Sums {
    fn of(series: &[f64]) -> Self {
        let mut sums = vec![[0.0; 2]];
        let mut sum = [0.0; 2];
        for v in series {
            sum = [sum[0] + v, sum[1] + v * v];
            sums.push(sum);
        }
        Self(sums)
    }

    fn over(&self, from: usize, count: usize) -> [f64; 2] {
        let (a, b) = (self.0[from], self.0[from + count]);
        [b[0] - a[0], b[1] - a[1]]
    }

    fn squares(&self) -> f64 {
        self.0.last().map_or(0.0, |sum| sum[1])
    }
}

/// A command as it is at another sample period: straight lines between its samples.
pub(super) fn resampled(command_v: &[f64], period_s: f64, to_period_s: f64) -> Vec<f64> {
    let samples = (command_v.len() as f64 * period_s / to_period_s) as usize;
    (0..samples)
        .map(|k| {
            let at = k as f64 * to_period_s / period_s;
            let first = command_v[(at as usize).min(command_v.len() - 1)];
            let next = command_v[(at as usize + 1).min(command_v.len() - 1)];
            first + (next - first) * at.fract()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command() -> Vec<f64> {
        let wave = |k: usize| 50.0 - 50.0 * (k as f64 * 0.01).cos() + 3.0 * ((k * k % 977) as f64 / 977.0 - 0.5);
        let mut command = vec![0.0; 500];
        command.extend((0..20_000).map(wave));
        command
    }

    /// Before it, behind it, with its beginning or its end cut off, turned over, scaled: the shift is exact.
    #[test]
    fn val_the_shift_is_found() {
        let command = command();
        for (before, cut) in [(0, 0), (1, 0), (3_111, 0), (0, 777), (40, 6_000)] {
            let mut recorded = vec![0.0; before];
            recorded.extend(&command[..command.len() - cut]);
            let found = best(&command, &recorded);
            assert_eq!(found.shift, before as isize);
            assert_eq!(found.overlap, command.len() - cut);
            assert!(found.off < 1e-12 && (found.gain - 1.0).abs() < 1e-9, "{found:?}");
            let late = best(&command, &recorded[before + 300..]);
            assert_eq!(late.shift, -300);
            recorded.iter_mut().for_each(|v| *v *= -0.05);
            let turned = best(&command, &recorded);
            assert_eq!(turned.shift, before as isize);
            assert!((turned.gain + 0.05).abs() < 1e-9 && turned.correlation < -0.999_999);
        }
    }

    #[test]
    fn refuse_what_cannot_be_compared() {
        assert_eq!(best(&command(), &[1.0; 30]), Likeness::NONE);
        assert!(best(&command(), &vec![7.0; 30_000]).correlation.abs() < 1e-9);
        assert_eq!(at(&[1.0, 2.0], &[1.0, 2.0], 5, 0), Likeness::NONE);
        assert_eq!(best(&[], &[]), Likeness::NONE);
    }

    #[test]
    fn val_a_ramp_at_another_period() {
        let ramp: Vec<f64> = (0..100).map(f64::from).collect();
        let found = resampled(&ramp, 1.0, 2.5);
        assert_eq!(found.len(), 40);
        assert_eq!(found[..4], [0.0, 2.5, 5.0, 7.5]);
    }
}
