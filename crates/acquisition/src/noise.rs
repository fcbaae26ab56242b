//! The noise floor of the position sensor, from the records themselves.

use crate::comb::{Comb, without_parabola};
use crate::ends::clipped_at;
use crate::octaves::{Octave, level_ones, octaves, octaves_beside, variance};
use crate::resolution::{code_width, rounding};
use crate::{median, rests, span};
use hysteron_data::{Dataset, Record};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Where the noise floor comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseSource {
    /// Given in the dataset (`[known] sensor_noise_um`).
    Given,
    /// Stretches at constant voltage.
    QuietRecord,
    /// What does not repeat from period to period, hum and other lines left out.
    PeriodScatter,
    /// The fastest part of the position's spectrum, where the drive leaves it level.
    HighPass,
    /// The error that a model leaves, which the noise cannot exceed.
    LeftByTheModel,
}

/// What a noise floor is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// As good as its samples make it.
    Estimate,
    /// The noise is this or less.
    UpperBound,
}

#[derive(Serialize)]
struct InWords {
    rms_um: f64,
    source: NoiseSource,
    basis: Basis,
    samples: usize,
    words: String,
}

impl From<NoiseFloor> for InWords {
    fn from(floor: NoiseFloor) -> Self {
        Self {
            rms_um: floor.rms_um,
            source: floor.source,
            basis: floor.basis,
            samples: floor.samples,
            words: floor.basis_in_words(),
        }
    }
}

/// Share of the noise that is left after a fit took some of it, and estimates are uncertain by a few per cent.
const TAKEN_BY_A_FIT: f64 = 0.9;

/// The noise floor of the position, and what it rests on; as JSON it has its basis in words as well.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(into = "InWords")]
pub struct NoiseFloor {
    /// Noise, micrometres rms.
    pub rms_um: f64,
    /// Where it comes from.
    pub source: NoiseSource,
    /// What it is worth.
    pub basis: Basis,
    /// Degrees of freedom behind the estimate (0 where it was given).
    pub samples: usize,
}

impl NoiseFloor {
    /// The floor where a model leaves this error: noise is never larger than what is left.
    #[must_use]
    pub fn at_most(self, left_rms_um: f64) -> Self {
        if left_rms_um >= self.rms_um || left_rms_um.is_nan() {
            return self;
        }
        // A fit takes a little of the noise with it: that does not make the estimate wrong.
        let (source, basis) = if left_rms_um > TAKEN_BY_A_FIT * self.rms_um {
            (self.source, self.basis)
        } else {
            (NoiseSource::LeftByTheModel, Basis::UpperBound)
        };
        Self {
            rms_um: left_rms_um,
            source,
            basis,
            ..self
        }
    }

    /// What the floor is worth and rests on: `estimate, from stretches at constant voltage`.
    pub fn basis_in_words(&self) -> String {
        format!("{}, {}", self.basis, self.source)
    }

    /// The floor in words where the output is not in micrometres: `2.00 mV rms (estimate, from ...)`.
    pub fn in_words(&self, rms: f64, unit: &str) -> String {
        let finer: &[(f64, &str)] = match unit {
            "um" => &[(1.0, "um"), (1e3, "nm"), (1e6, "pm")],
            "V" => &[(1.0, "V"), (1e3, "mV"), (1e6, "uV")],
            _ => &[(1.0, unit)],
        };
        let (factor, unit) = finer
            .iter()
            .find(|(factor, _)| rms * factor >= 0.1)
            .or(finer.last())
            .map_or((1.0, unit), |&(factor, unit)| (factor, unit));
        // Three significant digits down to a thousandth.
        let value = rms * factor;
        let decimals = match value {
            100.0.. => 0,
            10.0.. => 1,
            1.0.. => 2,
            0.0.. => 3,
            _ => 0,
        };
        format!("{value:.decimals$} {unit} rms ({})", self.basis_in_words())
    }
}

impl core::fmt::Display for NoiseFloor {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(&self.in_words(self.rms_um, "um"))
    }
}

impl core::fmt::Display for Basis {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Estimate => "estimate",
            Self::UpperBound => "upper bound",
        })
    }
}

impl core::fmt::Display for NoiseSource {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Given => "given in the dataset as sensor_noise_um",
            Self::QuietRecord => "from stretches at constant voltage",
            Self::PeriodScatter => "from the scatter between periods",
            Self::HighPass => "from the fastest part of the position",
            Self::LeftByTheModel => "what the model leaves",
        })
    }
}

/// The noise floor of a dataset: given, or the least of what rests, periods and the fastest octaves of its records tell.
///
/// Hum, coupling, folded ripple and ringing are lines: levels are medians over bins, on which a line hardly counts. A
/// period need not be a whole number of samples.
///
/// # Cost
/// A few Fourier transforms a record, of at most 131 072 samples.
pub fn noise_floor(dataset: &Dataset) -> NoiseFloor {
    if let Some(rms_um) = dataset.known.sensor_noise_um {
        return NoiseFloor {
            rms_um,
            source: NoiseSource::Given,
            basis: Basis::Estimate,
            samples: 0,
        };
    }
    let largest_v = dataset.records.iter().map(|r| span(&r.voltage_v)).fold(0.0, f64::max);
    // Clipped readings have no noise, nor have stretches in which some of them are.
    let ends = clipped_at(&dataset.records);
    let clipped = |record: &&Record| record.position_um.iter().any(|y| ends.contains(y));
    let mut each: Vec<Told> = dataset
        .records
        .par_iter()
        .filter(|record| !clipped(record))
        .flat_map_iter(|record| of_record(record, largest_v))
        .collect();
    let finest = dataset
        .records
        .iter()
        .map(|record| code_width(&record.position_um))
        .filter(|&q| q > 0.0)
        .fold(f64::INFINITY, f64::min);
    // A resting sensor may stand on one code: then rounding is the noise, and that rest tells nothing.
    let least_um = if finest.is_finite() { rounding(finest) } else { 0.0 };
    each.retain(|told| told.variance > 0.0);
    let floor = least(&each).unwrap_or_else(|| neighbours(&dataset.records, &ends));
    NoiseFloor {
        rms_um: floor.rms_um.max(least_um),
        ..floor
    }
}

/// What one record tells by one way.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Told {
    variance: f64,
    bins: usize,
    source: NoiseSource,
    basis: Basis,
}

impl Told {
    fn new(octaves: &[Octave], source: NoiseSource, basis: Basis) -> Option<Self> {
        let (variance, bins) = variance(octaves)?;
        variance.is_finite().then_some(Self {
            variance,
            bins,
            source,
            basis,
        })
    }

    /// Standard error as a share.
    fn uncertainty(&self) -> f64 {
        1.7 / (self.bins as f64).sqrt()
    }
}

/// Longest part of a record that is looked at, samples.
const LONGEST: usize = 1 << 17;
/// Parts into which a long rest is cut: a jump or a burst in one does not count.
const PARTS: usize = 8;

fn of_record(record: &Record, largest_v: f64) -> Vec<Told> {
    let mut told = Vec::new();
    told.extend(at_rest(record, largest_v));
    if span(&record.voltage_v) > 0.0 && record.voltage2_v.as_deref().is_none_or(|v2| span(v2) <= 0.0) {
        told.extend(between_periods(record));
    }
    if told.is_empty() || span(&record.voltage_v) > 0.0 {
        told.extend(fastest(record));
    }
    let least = rounding(code_width(&record.position_um)).powi(2);
    told.iter_mut().for_each(|t| t.variance = t.variance.max(least));
    told
}

/// The median part of all rests of a record, octave by octave.
fn at_rest(record: &Record, largest_v: f64) -> Option<Told> {
    let mut parts: Vec<Vec<Octave>> = Vec::new();
    for rest in rests::rests(record, largest_v) {
        let rest = &record.position_um[rest];
        let size = (rest.len() / PARTS).clamp(512, LONGEST).min(rest.len());
        for part in rest.chunks_exact(size) {
            let mut part = part.to_vec();
            without_parabola(&mut part);
            parts.push(octaves(&part, |_| false));
        }
    }
    let longest = parts.iter().map(Vec::len).max()?;
    let combined: Vec<Octave> = (0..longest)
        .map(|octave| {
            let of = || parts.iter().filter_map(|part| part.get(octave));
            Octave {
                level: median(&mut of().map(|o| o.level).collect::<Vec<_>>()),
                bins: of().map(|o| o.bins).sum(),
            }
        })
        .collect();
    Told::new(&combined, NoiseSource::QuietRecord, Basis::Estimate)
}

/// What lies between the lines of a periodic drive.
fn between_periods(record: &Record) -> Option<Told> {
    let comb = Comb::find(&record.voltage_v)?;
    let left = comb.remainder(&record.position_um);
    // Of few periods no bin is free of lines: the fastest octaves tell more.
    if !comb.leaves_gaps(left.len()) {
        return None;
    }
    let found = octaves(&left, |bin| comb.is_on_line(bin, left.len()));
    Told::new(&found, NoiseSource::PeriodScatter, Basis::Estimate)
}

/// Power that the drive has in an octave, as a multiple of what does not go with it, up to which its distortion is no
/// part of the latter: a loop that is 10 % open distorts by a hundredth of the power.
const LITTLE_DRIVE: f64 = 10.0;

/// The fastest octaves: an estimate where two or more have one level and the drive little in them, else an upper bound.
fn fastest(record: &Record) -> Option<Told> {
    let late = record.len().saturating_sub(LONGEST);
    let (y, v) = (&record.position_um[late..], &record.voltage_v[late..]);
    let all = octaves_beside(y, v);
    let gain = span(y) / span(v).max(f64::MIN_POSITIVE);
    let quiet = all
        .iter()
        .take_while(|(octave, drive)| *drive * gain * gain < LITTLE_DRIVE * octave.level)
        .count();
    let octaves: Vec<Octave> = all.into_iter().map(|(octave, _)| octave).collect();
    let level = level_ones(&octaves);
    let basis = if level.len().min(quiet) >= 2 {
        Basis::Estimate
    } else {
        Basis::UpperBound
    };
    Told::new(level, NoiseSource::HighPass, basis)
}

/// The least that is told, together with all that do not differ from it.
fn least(each: &[Told]) -> Option<NoiseFloor> {
    let estimates = each.iter().any(|told| told.basis == Basis::Estimate);
    let basis = if estimates { Basis::Estimate } else { Basis::UpperBound };
    let valid = || each.iter().filter(|told| told.basis == basis);
    let cautious = |told: &Told| told.variance * (1.0 + 2.0 * told.uncertainty());
    let lowest = valid().min_by(|a, b| cautious(a).total_cmp(&cautious(b)))?;
    let alike = |told: &&Told| {
        let apart = 3.0 * told.uncertainty().hypot(lowest.uncertainty());
        (told.variance - lowest.variance).abs() <= apart * lowest.variance
    };
    let pooled: Vec<&Told> = valid().filter(alike).collect();
    let bins: usize = pooled.iter().map(|told| told.bins).sum();
    let variance = pooled.iter().map(|told| told.variance * told.bins as f64).sum::<f64>() / bins as f64;
    // What supposes least is what it rests on.
    let source = [NoiseSource::QuietRecord, NoiseSource::PeriodScatter]
        .into_iter()
        .find(|&source| pooled.iter().any(|told| told.source == source))
        .unwrap_or(NoiseSource::HighPass);
    Some(NoiseFloor {
        rms_um: variance.sqrt(),
        source,
        basis,
        samples: 2 * bins,
    })
}

/// Of records too short for a spectrum, or clipped: white noise leaves third differences of 20 times its variance. Readings at the ends
/// of the converter's range do not count.
fn neighbours(records: &[Record], ends: &[f64]) -> NoiseFloor {
    let thirds = records
        .iter()
        .flat_map(|record| record.position_um.windows(4))
        .filter(|y| !y.iter().any(|y| ends.contains(y)));
    let (squares, samples) = thirds.fold((0.0, 0), |(squares, samples), y| {
        (squares + (y[3] - 3.0 * y[2] + 3.0 * y[1] - y[0]).powi(2), samples + 1)
    });
    NoiseFloor {
        rms_um: (squares / f64::from(samples.max(1)) / 20.0).sqrt(),
        source: NoiseSource::HighPass,
        basis: Basis::UpperBound,
        samples: samples as usize,
    }
}
