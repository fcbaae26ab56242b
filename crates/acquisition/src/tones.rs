//! Tones of neither drive nor mains in the position.

use crate::comb::{Comb, without_parabola};
use crate::octaves::transform;
use crate::plain::{figure, names};
use crate::report::{Channel, Finding, Kind, Quantity, Unit};
use crate::{median, rests, span};
use hysteron_data::Record;

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

/// A tone: hertz as recorded, amplitude in micrometres.
type Found = (f64, f64);

/// The largest tone in the position of each record.
pub(crate) fn tones(records: &[Record], noise_um: f64) -> Option<Finding> {
    let largest_v = records.iter().map(|r| span(&r.voltage_v)).fold(0.0, f64::max);
    let seen: Vec<(&Record, Found)> = records
        .iter()
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

fn tone(record: &Record, largest_v: f64) -> Option<Found> {
    let comb = Comb::find(&record.voltage_v);
    let mut left = match &comb {
        Some(comb) if comb.periods(record.len()) > 9.0 => comb.remainder(&record.position_um),
        _ => {
            let rest = rests::rests(record, largest_v)
                .into_iter()
                .max_by_key(ExactSizeIterator::len)?;
            record.position_um[rest].to_vec()
        }
    };
    left.drain(..left.len().saturating_sub(LONGEST));
    without_parabola(&mut left);
    let n = left.len();
    if n < 8 * AROUND {
        return None;
    }
    let power: Vec<f64> = transform(&left).0.iter().map(|bin| bin.norm_sqr()).collect();
    let at_rest = comb.is_none();
    let other = record.voltage2_v.as_deref().and_then(Comb::find);
    let hz = |bin: f64| bin / (n as f64 * record.period_s);
    let known = |bin: usize| {
        // Harmonics above half the sampling rate come back folded.
        let folded = [bin as f64, n as f64 - bin as f64, n as f64 + bin as f64];
        let near = |comb: &Comb| folded.iter().any(|&bin| comb.distance(bin, n) < 6.0);
        (!at_rest && comb.as_ref().is_some_and(near))
            || other.as_ref().is_some_and(near)
            || is_mains(hz(bin as f64), hz(1.0), 1.0 / record.period_s)
    };
    // Another axis that moves in no known way may be anywhere.
    if record.voltage2_v.as_deref().is_some_and(|v2| span(v2) > 0.0) && other.is_none() {
        return None;
    }
    let peak = (SLOWEST..power.len().checked_sub(WIDE + 1)?)
        .filter(|&k| power[k] >= power[k - 1] && power[k] >= power[k + 1] && !known(k))
        .filter(|&k| stands_out(&power, k))
        .max_by(|&a, &b| power[a].total_cmp(&power[b]))?;
    let size = |part: &[f64]| {
        let (mut a, mut b) = (0.0, 0.0);
        for (k, y) in part.iter().enumerate() {
            let (sin, cos) = (std::f64::consts::TAU * peak as f64 / n as f64 * k as f64).sin_cos();
            let w = crate::octaves::hann(k, part.len());
            (a, b) = (a + w * y * cos, b + w * y * sin);
        }
        4.0 * a.hypot(b) / part.len() as f64
    };
    let (first, second) = (size(&left[..n / 2]), size(&left[n / 2..]));
    (first < LASTS * second && second < LASTS * first).then(|| (hz(peak as f64), 0.5 * (first + second)))
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
