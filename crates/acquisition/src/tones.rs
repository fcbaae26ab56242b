//! Tones of neither drive nor mains in the position.

use crate::comb::{Comb, amplitude, without_parabola};
use crate::octaves::power;
use crate::plain::{figure, names};
use crate::report::{Channel, Finding, Kind, Quantity, Unit};
use crate::{median, rests, span};
use hysteron_data::Record;
use rayon::prelude::*;
use std::ops::Range;

/// Power of a bin over the level around it: noise reaches it once in 10^11 bins.
const STANDS_OUT: f64 = 25.0;
/// Bins around a tone over which the level is taken.
const AROUND: usize = 60;
/// Bins on each side that a tone fills.
const WIDE: usize = 3;
/// A tone has the same size in either half; what rings dies away.
const LASTS: f64 = 1.5;
/// Lowest harmonic-free bin: what is slower is drift.
const SLOWEST: usize = 12;
/// Longest part that is looked at, samples.
const LONGEST: usize = 1 << 16;
/// Size of a tone that matters, as a multiple of the noise.
const MATTERS: f64 = 0.5;
/// Periods from which on the drive's harmonics lie far enough apart to be taken out and kept clear of.
const APART: f64 = 9.0;
/// Bins beside a harmonic where its sidebands may be.
const BESIDE: f64 = 3.0;
/// Bins from a harmonic of few periods within which a line is that harmonic: the error of the line's own frequency.
const ON: f64 = 0.5;
/// Harmonics of few periods from which on none stands out from those below, not even beside a mode.
const HIGHEST: f64 = 50.0;
/// Power over the strongest other line that is as fast: where several stand out, they are a drive's.
const BEYOND_OTHERS: f64 = 30.0;
/// Power over that of the drive, times the stage's gain: a drive has not caused it, even through a mode.
const BEYOND_DRIVE: f64 = 100.0;

/// A tone: hertz as recorded, amplitude in micrometres.
type Found = (f64, f64);

/// The largest tone in the position of each record.
pub(crate) fn tones(records: &[Record], noise_um: f64) -> Option<Finding> {
    let largest_v = records.iter().map(|r| span(&r.voltage_v)).fold(0.0, f64::max);
    let seen: Vec<(&Record, Found)> = records
        .par_iter()
        .filter_map(|record| Some((record, tone(record, largest_v)?)))
        .filter(|(_, (_, size))| *size > MATTERS * noise_um)
        .collect();
    let (_, (hz, _)) = seen.iter().max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    Some(Finding {
        kind: Kind::Tone,
        channel: Some(Channel::Position),
        records: names(seen.iter().map(|(record, _)| *record)),
        figure: figure(*hz, Unit::Hertz, Quantity::Frequency),
    })
}

/// The stretch of a record in which tones are looked for.
struct Stretch {
    /// The drive's lines, where it repeats.
    comb: Option<Comb>,
    /// Its samples.
    samples: Range<usize>,
    /// The position, without the drive's harmonics where they lie apart.
    left: Vec<f64>,
}

impl Stretch {
    /// Periods of the drive, else the longest rest, else all of the record.
    fn of(record: &Record, largest_v: f64) -> Self {
        let (len, y) = (record.len(), &record.position_um);
        let comb = Comb::find(&record.voltage_v).map(|comb| Comb {
            from: comb.from.max(len.saturating_sub(LONGEST)),
            ..comb
        });
        let left = match &comb {
            Some(comb) if comb.periods(len) > APART => comb.remainder(y),
            Some(comb) => y[comb.from..].to_vec(),
            None => {
                let rests = rests::rests(record, largest_v).into_iter();
                let samples = rests.max_by_key(ExactSizeIterator::len).unwrap_or(0..len);
                return Self::cut(None, samples.end, y[samples].to_vec());
            }
        };
        Self::cut(comb, len, left)
    }

    /// The last of what is left up to a sample.
    fn cut(comb: Option<Comb>, end: usize, mut left: Vec<f64>) -> Self {
        left.drain(..left.len().saturating_sub(LONGEST));
        without_parabola(&mut left);
        Self {
            comb,
            samples: end - left.len()..end,
            left,
        }
    }

    /// Whether a line, in bins, is a harmonic of a drive.
    fn is_harmonic(&self, comb: &Comb, bin: f64) -> bool {
        let spacing = comb.cycles * self.left.len() as f64;
        let off = comb.distance(bin, self.left.len());
        if spacing > APART {
            off < BESIDE
        } else {
            off < ON && bin < HIGHEST * spacing
        }
    }

    /// Power of a column of the record over the stretch.
    fn power(&self, column: &[f64]) -> Vec<f64> {
        let mut values = column[self.samples.clone()].to_vec();
        without_parabola(&mut values);
        power(&values)
    }

    /// The largest power that the drives can have caused, bin by bin.
    fn driven(&self, record: &Record) -> Vec<f64> {
        let n = self.left.len();
        let lines = self.comb.map_or(0.0, |comb| comb.cycles * n as f64);
        let reach = WIDE + (lines.ceil() as usize).min(AROUND);
        let drives = [Some(&record.voltage_v), record.voltage2_v.as_ref()];
        let mut most = vec![0.0_f64; n / 2 + 1];
        for drive in drives.into_iter().flatten().filter(|drive| span(drive) > 0.0) {
            let gain = span(&record.position_um) / span(drive);
            let power = self.power(drive);
            for (k, most) in most.iter_mut().enumerate() {
                let near = &power[k.saturating_sub(reach)..(k + reach + 1).min(power.len())];
                *most = most.max(gain * gain * near.iter().copied().fold(0.0, f64::max));
            }
        }
        most
    }
}

fn tone(record: &Record, largest_v: f64) -> Option<Found> {
    let stretch = Stretch::of(record, largest_v);
    let left = &stretch.left;
    let n = left.len();
    if n < 8 * AROUND {
        return None;
    }
    let hz = |bin: f64| bin / (n as f64 * record.period_s);
    let power = power(left);
    let mut peaks: Vec<usize> = (SLOWEST..power.len().checked_sub(WIDE + 1)?)
        .filter(|&k| power[k] >= power[k - 1] && power[k] >= power[k + 1])
        .filter(|&k| stands_out(&power, k))
        .filter(|&k| !is_mains(hz(k as f64), hz(1.0), 1.0 / record.period_s))
        .collect();
    if peaks.is_empty() {
        return None;
    }
    let driven = stretch.driven(record);
    peaks.retain(|&k| power[k] > BEYOND_DRIVE * driven[k] && power[k] > BEYOND_OTHERS * strongest_other(&power, k));
    if let Some(comb) = stretch.comb.filter(|_| !peaks.is_empty()) {
        let other = record.voltage2_v.as_deref().and_then(Comb::find);
        let combs: Vec<Comb> = [Some(comb), other].into_iter().flatten().collect();
        let harmonic = |bin: f64| combs.iter().any(|comb| stretch.is_harmonic(comb, bin));
        let whole = stretch.power(&record.position_um);
        peaks.retain(|&k| {
            let bin = between(&power, k);
            // Harmonics above half the sampling rate come back folded, smaller than the last that do not.
            let folded = harmonic(n as f64 - bin) || harmonic(n as f64 + bin);
            !harmonic(bin) && (!folded || power[k] > BEYOND_OTHERS * strongest_other(&whole, k))
        });
    }
    let peak = peaks.into_iter().max_by(|&a, &b| power[a].total_cmp(&power[b]))?;
    let size = |part: &[f64]| amplitude(part, between(&power, peak) / n as f64);
    let (first, second) = (size(&left[..n / 2]), size(&left[n / 2..]));
    (first < LASTS * second && second < LASTS * first).then(|| (hz(peak as f64), 0.5 * (first + second)))
}

/// The frequency of a peak between its bins: under a Hann window the larger neighbour tells it.
fn between(power: &[f64], k: usize) -> f64 {
    let (below, at, above) = (power[k - 1].sqrt(), power[k].sqrt(), power[k + 1].sqrt());
    let (side, larger) = if above > below { (1.0, above) } else { (-1.0, below) };
    let ratio = larger / at.max(f64::MIN_POSITIVE);
    k as f64 + side * ((2.0 * ratio - 1.0) / (ratio + 1.0)).clamp(0.0, 0.5)
}

/// The strongest of the other lines that are as fast: from half its frequency on, and in the upper half of all.
fn strongest_other(power: &[f64], k: usize) -> f64 {
    let from = (k / 2).min(power.len() / 2);
    let others = (from..power.len()).filter(|j| j.abs_diff(k) > WIDE);
    others.map(|j| power[j]).fold(0.0, f64::max)
}

/// Whether a bin stands out from those around it, and is narrow.
fn stands_out(power: &[f64], k: usize) -> bool {
    let (from, to) = (k.saturating_sub(AROUND).max(SLOWEST / 2), (k + AROUND).min(power.len()));
    let mut around: Vec<f64> = (from..to).filter(|&j| j.abs_diff(k) > WIDE).map(|j| power[j]).collect();
    let level = median(&mut around) / std::f64::consts::LN_2;
    let beside = power[k + WIDE].max(power[k - WIDE]);
    power[k] > STANDS_OUT * level && beside < 0.05 * power[k]
}

/// Whether a frequency is a harmonic of the mains, folded where the sampling is slow.
fn is_mains(hz: f64, resolution_hz: f64, rate_hz: f64) -> bool {
    [50.0, 60.0].into_iter().any(|mains| {
        (1..=20).any(|harmonic| {
            let whole = f64::from(harmonic) * mains;
            let folded = (whole - (whole / rate_hz).round() * rate_hz).abs();
            (hz - folded).abs() < 0.012 * whole + 3.0 * resolution_hz
        })
    })
}
