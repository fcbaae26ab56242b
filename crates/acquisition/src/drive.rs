//! Where the voltage comes from: a command, a measurement, a loop around the sensor.

use crate::comb::Comb;
use crate::octaves::{octaves, transform, variance};
use crate::plain::{figure, line, names};
use crate::report::{Channel, Finding, Kind, Quantity, Unit};
use crate::resolution::code_width;
use crate::{median, rests, span};
use hysteron_data::Record;
use rayon::prelude::*;
use realfft::num_complex::Complex;

/// Noise of a voltage over its range from which on it was measured: commands repeat to their last digit.
const MEASURED: f64 = 3e-5;

/// Noise of a voltage where a command would have none: at rest, or from period to period.
fn noise_v(record: &Record, largest_v: f64) -> Option<f64> {
    let v = &record.voltage_v;
    let step = code_width(v);
    let at_rest = rests::rests(record, largest_v)
        .into_iter()
        .filter_map(|rest| variance(&octaves(&v[rest], |_| false)))
        .max_by_key(|(_, bins)| *bins);
    let told = at_rest.or_else(|| {
        let comb = Comb::find(v)?;
        let left = comb.remainder(v);
        if !comb.leaves_gaps(left.len()) {
            return None;
        }
        variance(&octaves(&left, |bin| comb.is_on_line(bin, left.len())))
    });
    // Within a step or so it is the converter of the command.
    told.map(|(variance, _)| variance.sqrt())
        .map(|noise| if noise > 0.8 * step { noise } else { 0.0 })
}

/// A measured voltage, and a drive computed from the sensor.
pub(crate) fn origin(records: &[Record]) -> Option<Finding> {
    let fed: Vec<(&Record, f64)> = records.par_iter().filter_map(|r| Some((r, feedback(r)?))).collect();
    let long = records
        .iter()
        .filter(|r| segments(r) >= FEWEST && span(&r.voltage_v) > 0.0);
    // A loop is closed in all records, or in most.
    let closed = 2 * fed.len() > long.count();
    let clearest = fed.iter().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|_| closed);
    if let Some((_, coherence)) = clearest {
        return Some(Finding {
            kind: Kind::Feedback,
            channel: Some(Channel::Voltage),
            records: names(fed.iter().map(|(record, _)| *record)),
            figure: figure(*coherence, Unit::Factor, Quantity::Coherence),
        });
    }
    let largest_v = records.iter().map(|r| span(&r.voltage_v)).fold(0.0, f64::max);
    let told: Vec<(&Record, f64)> = records
        .par_iter()
        .filter_map(|record| Some((record, noise_v(record, largest_v)?)))
        .collect();
    let noisy = |(_, noise): &&(&Record, f64)| *noise > MEASURED * largest_v;
    let mut measured: Vec<(&Record, f64)> = told.iter().filter(noisy).copied().collect();
    // All columns of a rig are measured, or none: a drive that is not quite periodic has no noise for that.
    if 2 * measured.len() <= told.len() {
        return None;
    }
    measured.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (_, least) = measured.first()?;
    Some(Finding {
        kind: Kind::MeasuredVoltage,
        channel: Some(Channel::Voltage),
        figure: figure(*least, Unit::Volt, Quantity::Noise),
        records: names(measured.iter().map(|(record, _)| *record)),
    })
}

/// Samples of a segment of which spectra are averaged.
const SEGMENT: usize = 256;
/// Fewest segments.
const FEWEST: usize = 8;
/// Coherence that twelve segments have by chance once in a thousand is 0.47 in a bin; the median bin never.
const COHERENT: f64 = 0.35;
/// A stage gives its gain a volt, or a few times that at a mode; what a loop writes into the drive is the inverse of its own
/// gain, at frequencies where it does not follow any more.
const BEYOND_THE_STAGE: f64 = 4.0;

/// Segments of a record, each half over the next.
fn segments(record: &Record) -> usize {
    record.len().saturating_sub(SEGMENT + 2).div_ceil(SEGMENT / 2)
}

/// Coherence of voltage and position over the fastest two octaves, where the position has far more there than the voltage
/// can have caused.
fn feedback(record: &Record) -> Option<f64> {
    let (v, y) = (&record.voltage_v, &record.position_um);
    let gain = line(record)?.slope.abs();
    let count = segments(record);
    if count < FEWEST {
        return None;
    }
    let every = count.div_ceil(400);
    let starts: Vec<usize> = (0..count).step_by(every).map(|k| k * SEGMENT / 2).collect();
    let half = SEGMENT / 2 + 1;
    let (mut vv, mut yy) = (vec![0.0; half], vec![0.0; half]);
    let mut yv = vec![Complex::new(0.0, 0.0); half];
    for start in &starts {
        let part = |series: &[f64]| transform(&curved(&series[*start..start + SEGMENT + 2])).0;
        let (of_v, of_y) = (part(v), part(y));
        for k in 0..half {
            vv[k] += of_v[k].norm_sqr();
            yy[k] += of_y[k].norm_sqr();
            yv[k] += of_y[k] * of_v[k].conj();
        }
    }
    let bins = SEGMENT / 8..SEGMENT / 2 - 2;
    if bins.clone().any(|k| vv[k] <= 0.0 || yy[k] <= 0.0) {
        return None;
    }
    let mut coherence: Vec<f64> = bins.clone().map(|k| yv[k].norm_sqr() / (vv[k] * yy[k])).collect();
    let mut ratio: Vec<f64> = bins.map(|k| yv[k].norm() / vv[k]).collect();
    let (coherence, ratio) = (median(&mut coherence), median(&mut ratio));
    (coherence > COHERENT && ratio > BEYOND_THE_STAGE * gain).then_some(coherence)
}

/// Second differences: what is smooth must not leak into the fast bins.
fn curved(series: &[f64]) -> Vec<f64> {
    series.windows(3).map(|s| s[2] - 2.0 * s[1] + s[0]).collect()
}
