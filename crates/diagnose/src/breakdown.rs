//! Where the error is: shares of the squared error by frequency, amplitude, position, speed, direction, time, temperature.

use crate::comparison::{Bin, Breakdown, RecordComparison};
use crate::spectrum::periodogram;
use hysteron_data::Record;
use hysteron_identify::Direction;
use hysteron_identify::family::peak_to_peak;

/// A compared record with what is needed to break its error down.
pub(crate) struct Sample<'a> {
    pub record: &'a Record,
    pub compared: &'a RecordComparison,
    /// Peak to peak of the measured output.
    stroke: f64,
    /// Weight of a squared error: as in the pooled percentage, `1 / (samples x stroke^2)`; 0 where nothing moves.
    pub weight: f64,
}

impl<'a> Sample<'a> {
    pub(crate) fn new(record: &'a Record, compared: &'a RecordComparison) -> Self {
        let stroke = peak_to_peak(&compared.series.measured);
        let moves = compared.nrmse_percent.is_some();
        let weight = if moves {
            1.0 / (compared.samples as f64 * stroke * stroke)
        } else {
            0.0
        };
        Self {
            record,
            compared,
            stroke,
            weight,
        }
    }

    pub(crate) fn errors(&self) -> impl Iterator<Item = f64> + '_ {
        self.compared
            .series
            .measured
            .iter()
            .zip(&self.compared.series.modelled)
            .map(|(y, m)| y - m)
    }

    /// Rate of the modelled output (free of noise), output units per second, central difference.
    pub(crate) fn rate(&self, k: usize) -> f64 {
        let y = &self.compared.series.modelled;
        let (before, after) = (k.saturating_sub(1), (k + 1).min(y.len() - 1));
        (y[after] - y[before]) / ((after - before).max(1) as f64 * self.record.period_s)
    }
}

/// Sums of one bin.
#[derive(Clone, Default)]
struct Sums {
    weighted: f64,
    presence: f64,
    squares: f64,
    errors: f64,
    samples: f64,
}

/// All breakdowns that the records allow.
pub(crate) fn breakdowns(samples: &[Sample<'_>], direction: Direction) -> Vec<Breakdown> {
    if samples.iter().all(|sample| sample.weight == 0.0) {
        return Vec::new();
    }
    let unit = direction.output_unit();
    let per_second = if unit == "um" { "um/s" } else { "V/s" };
    let outputs = || samples.iter().flat_map(|s| s.compared.series.measured.iter().copied());
    let (low, high) = (
        outputs().fold(f64::INFINITY, f64::min),
        outputs().fold(f64::NEG_INFINITY, f64::max),
    );
    let fastest = samples
        .iter()
        .flat_map(|s| (0..s.compared.samples).map(|k| s.rate(k).abs()))
        .fold(0.0, f64::max);
    let longest = samples.iter().map(|s| s.record.duration_s()).fold(0.0, f64::max);
    let shortest = samples.iter().map(|s| s.record.period_s).fold(f64::INFINITY, f64::min);
    let strokes = samples.iter().map(|s| s.stroke);
    let widest = strokes.fold(0.0, f64::max);
    let mut all = vec![by_frequency(samples)];
    let amplitude = |s: &Sample<'_>, _: usize| s.stroke;
    all.push(by("amplitude", unit, &even(0.0, widest, 5), samples, amplitude));
    let output = if direction == Direction::Forward {
        "position"
    } else {
        "voltage"
    };
    all.push(by(output, unit, &even(low, high, 10), samples, |s, k| {
        s.compared.series.measured[k]
    }));
    all.push(by(
        "speed",
        per_second,
        &decades(fastest / 1e4, fastest),
        samples,
        |s, k| s.rate(k).abs(),
    ));
    // Slower than a thousandth of the fastest counts as rest.
    let rest = 1e-3 * fastest;
    let edges = [-fastest, -rest, rest, fastest];
    all.push(by("direction", per_second, &edges, samples, |s, k| s.rate(k)));
    let from_start = |s: &Sample<'_>, k: usize| k as f64 * s.record.period_s;
    all.push(by(
        "time",
        "s",
        &decades(shortest.max(longest / 1e5), longest),
        samples,
        from_start,
    ));
    if let Some(breakdown) = by_temperature(samples) {
        all.push(breakdown);
    }
    all.into_iter().filter(|breakdown| breakdown.bins.len() > 1).collect()
}

fn even(low: f64, high: f64, bins: usize) -> Vec<f64> {
    (0..=bins)
        .map(|i| low + (high - low) * i as f64 / bins as f64)
        .collect()
}

/// Edges at 1, 3, 10, 30 .. covering `from` to `to`, the first bin open to zero.
fn decades(from: f64, to: f64) -> Vec<f64> {
    let mut edges = vec![0.0];
    if !(from > 0.0 && to > from) {
        return edges;
    }
    let mut exponent = from.log10().floor() as i32;
    'decades: loop {
        for mantissa in [1.0, 3.0] {
            let edge = mantissa * 10f64.powi(exponent);
            if edge >= from {
                edges.push(edge);
            }
            if edge >= to {
                break 'decades;
            }
        }
        exponent += 1;
    }
    edges
}

/// Breaks the error down by a quantity of each sample.
fn by(
    name: &'static str,
    unit: &'static str,
    edges: &[f64],
    samples: &[Sample<'_>],
    quantity: impl Fn(&Sample<'_>, usize) -> f64,
) -> Breakdown {
    let mut sums = vec![Sums::default(); edges.len().saturating_sub(1)];
    for sample in samples.iter().filter(|sample| sample.weight > 0.0) {
        for (k, error) in sample.errors().enumerate() {
            if sums.is_empty() {
                break;
            }
            let value = quantity(sample, k);
            let bin = edges.partition_point(|&edge| edge <= value).clamp(1, sums.len()) - 1;
            let sum = &mut sums[bin];
            sum.weighted += sample.weight * error * error;
            sum.presence += 1.0 / sample.compared.samples as f64;
            sum.squares += error * error;
            sum.errors += error;
            sum.samples += 1.0;
        }
    }
    finish(name, unit, edges, &sums)
}

fn by_temperature(samples: &[Sample<'_>]) -> Option<Breakdown> {
    if samples.iter().any(|s| s.record.temperature_c.is_none()) {
        return None;
    }
    let temperature = |s: &Sample<'_>, k: usize| s.record.temperature_c.as_ref().map_or(0.0, |t| t[k]);
    let all = || {
        samples
            .iter()
            .flat_map(|s| (0..s.compared.samples).map(move |k| temperature(s, k)))
    };
    let (low, high) = (
        all().fold(f64::INFINITY, f64::min),
        all().fold(f64::NEG_INFINITY, f64::max),
    );
    (high > low).then(|| by("temperature", "degC", &even(low, high, 5), samples, temperature))
}

/// By frequency, from each record's periodogram; the presence of a band is its share of the measured output's power.
fn by_frequency(samples: &[Sample<'_>]) -> Breakdown {
    let moving = || samples.iter().filter(|sample| sample.weight > 0.0);
    let nyquist = moving().map(|s| 0.5 / s.record.period_s).fold(0.0, f64::max);
    let longest = moving().map(|s| s.record.duration_s()).fold(0.0, f64::max);
    let edges = decades(1.0 / longest.max(f64::MIN_POSITIVE), nyquist);
    let mut sums = vec![Sums::default(); edges.len() - 1];
    for sample in moving() {
        let errors: Vec<f64> = sample.errors().collect();
        let power = periodogram(&errors);
        let measured = periodogram(&sample.compared.series.measured);
        let total: f64 = measured.iter().skip(1).sum::<f64>().max(f64::MIN_POSITIVE);
        let n = errors.len() as f64;
        for (bin, (&p, &m)) in power.iter().zip(&measured).enumerate() {
            let frequency = bin as f64 / (n * sample.record.period_s);
            let band = edges.partition_point(|&edge| edge <= frequency).clamp(1, sums.len()) - 1;
            let sum = &mut sums[band];
            sum.weighted += sample.weight * n * p;
            sum.squares += n * p;
            sum.samples += 0.0;
            sum.presence += if bin > 0 { m / total } else { 0.0 };
        }
    }
    // The rms of a band is over all samples: the bands' squares add up to the whole.
    let all_samples: f64 = moving().map(|s| s.compared.samples as f64).sum();
    for sum in &mut sums {
        sum.samples = all_samples;
    }
    finish("frequency", "Hz", &edges, &sums)
}

fn finish(name: &'static str, unit: &'static str, edges: &[f64], sums: &[Sums]) -> Breakdown {
    let whole: f64 = sums.iter().map(|sum| sum.weighted).sum::<f64>().max(f64::MIN_POSITIVE);
    let presence: f64 = sums.iter().map(|sum| sum.presence).sum::<f64>().max(f64::MIN_POSITIVE);
    let bins: Vec<Bin> = sums
        .iter()
        .enumerate()
        .filter(|(_, sum)| sum.presence > 0.0 || sum.weighted > 0.0)
        .map(|(i, sum)| Bin {
            from: edges[i],
            to: edges[i + 1],
            share_percent: 100.0 * sum.weighted / whole,
            samples_percent: 100.0 * sum.presence / presence,
            rms_um: (sum.squares / sum.samples.max(1.0)).sqrt(),
            mean_um: sum.errors / sum.samples.max(1.0),
        })
        .collect();
    let finding = finding(name, unit, &bins);
    Breakdown {
        by: name,
        unit,
        bins,
        finding,
    }
}

/// A bin stands out when it holds at least a fifth of the error and twice its part of the record.
const OUT_OF_PROPORTION: f64 = 2.0;

fn finding(name: &str, unit: &str, bins: &[Bin]) -> String {
    let out = bins
        .iter()
        .filter(|bin| bin.share_percent >= 20.0 && bin.share_percent > OUT_OF_PROPORTION * bin.samples_percent)
        .max_by(|a, b| a.share_percent.total_cmp(&b.share_percent));
    let (presence, everywhere) = if name == "frequency" {
        ("of the measured motion's power", "the power of the motion does")
    } else {
        ("of the samples", "the samples do")
    };
    match out {
        Some(bin) => format!(
            "{:.0} % of the squared error lies at {name} {} to {} {unit}, with {:.0} % {presence}",
            bin.share_percent,
            short(bin.from),
            short(bin.to),
            bin.samples_percent
        ),
        None => format!("no {name} stands out: the error lies where {everywhere}"),
    }
}

/// Three significant digits, without an exponent where people would not write one.
fn short(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    let decimals = (2 - magnitude.log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}
