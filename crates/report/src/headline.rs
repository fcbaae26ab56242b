//! The answer in plain sentences.

use hysteron_data::Role;
use hysteron_diagnose::{Breakdown, Comparison, Pooled};

use crate::number::{count, edge, percent, significant, unit_text};

/// Ratio to the noise floor up to which the error is noise and little else.
const AT_NOISE: f64 = 1.2;
/// Share of the squared error in one place, percent, that makes it worth naming.
const MOST: f64 = 50.0;

/// Ratio of a share of the error to the share of the samples from which a place stands out; as the findings judge it.
pub(crate) const OUT_OF_PROPORTION: f64 = 2.0;

/// The first sentences of a comparison: how far off the model is, and where; on validation records where there are any.
pub fn headline(comparison: &Comparison) -> Vec<String> {
    let mut sentences = Vec::new();
    match (&comparison.validate, &comparison.identify) {
        (Some(validate), identify) => {
            let opening = "On records it was not fitted to";
            sentences.push(sentence(opening, validate, Role::Validate, comparison));
            if let Some(identify) = identify {
                sentences.push(format!(
                    "On the {} it was fitted to, it is off by {}.",
                    records(identify.records),
                    percent(identify.nrmse_percent)
                ));
            }
        }
        (None, Some(identify)) => {
            sentences.push(sentence(
                "On the records it was fitted to",
                identify,
                Role::Identify,
                comparison,
            ));
            sentences.push("No record was kept to judge it on: give some the role validate.".to_owned());
        }
        (None, None) => sentences.push("No record moves, so there is no error in percent of peak to peak.".to_owned()),
    }
    sentences
}

fn records(number: usize) -> String {
    if number == 1 {
        "record".to_owned()
    } else {
        format!("{} records", count(number))
    }
}

/// The pooled error over the noise floor on the same records, both in percent of peak to peak: as a ladder counts it.
pub(crate) fn pooled_over_noise(comparison: &Comparison, pooled: &Pooled, role: Role) -> f64 {
    let moving = comparison
        .records
        .iter()
        .filter(|record| record.role == role && record.rms_um > 0.0);
    let squares: Vec<f64> = moving
        .filter_map(|record| Some((record.nrmse_percent? * comparison.noise_rms_um / record.rms_um).powi(2)))
        .collect();
    pooled.nrmse_percent / (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn sentence(opening: &str, pooled: &Pooled, role: Role, comparison: &Comparison) -> String {
    let mut text = format!(
        "{opening} the model is off by {} of peak to peak",
        percent(pooled.nrmse_percent)
    );
    let ratio = pooled_over_noise(comparison, pooled, role);
    if ratio.is_finite() {
        if ratio <= AT_NOISE {
            text.push_str(", which is the noise floor");
        } else if ratio < 10.0 {
            text.push_str(&format!(", {ratio:.1} times the noise floor"));
        } else {
            text.push_str(&format!(", {} times the noise floor", significant(ratio)));
        }
    }
    if let Some(place) = place(&comparison.r#where) {
        text.push_str(&format!("; over all records, {place}"));
    }
    text.push('.');
    text
}

/// The one place that holds most of the error and out of proportion.
fn place(breakdowns: &[Breakdown]) -> Option<String> {
    let (breakdown, bin) = breakdowns
        .iter()
        .filter(|breakdown| tells(breakdown))
        .flat_map(|breakdown| breakdown.bins.iter().map(move |bin| (breakdown, bin)))
        .filter(|(_, bin)| bin.share_percent >= MOST && bin.share_percent > OUT_OF_PROPORTION * bin.samples_percent)
        .max_by(|a, b| {
            (a.1.share_percent - a.1.samples_percent).total_cmp(&(b.1.share_percent - b.1.samples_percent))
        })?;
    let share = format!("{:.0}\u{a0}% of the squared error", bin.share_percent);
    if breakdown.by == "direction" {
        return Some(format!(
            "{share} is where the output is {}",
            direction(bin.from, bin.to)
        ));
    }
    let range = range(bin.from, bin.to, breakdown.unit);
    Some(format!("{share} is at {} {range}", quantity_name(breakdown)))
}

/// Least range of temperatures that an error can be said to depend on, kelvin.
const LEAST_KELVIN: f64 = 1.0;

/// Whether the records cover enough of a quantity for a place in it to mean anything.
pub(crate) fn tells(breakdown: &Breakdown) -> bool {
    let (first, last) = (breakdown.bins.first(), breakdown.bins.last());
    let covered = last.map_or(0.0, |bin| bin.to) - first.map_or(0.0, |bin| bin.from);
    breakdown.by != "temperature" || covered >= LEAST_KELVIN
}

/// A bin's range in words, with its unit.
pub(crate) fn range(from: f64, to: f64, unit: &str) -> String {
    let unit = unit_text(unit);
    let to_text = edge(to, to - from);
    if from == 0.0 {
        format!("below {to_text}\u{a0}{unit}")
    } else {
        format!("{} to {to_text}\u{a0}{unit}", edge(from, to - from))
    }
}

/// The name of what an error is broken down by.
pub(crate) fn quantity_name(breakdown: &Breakdown) -> &'static str {
    match (breakdown.by, breakdown.unit) {
        ("time", _) => "time since start",
        // The output of an inverse model.
        ("position", "V") => "voltage",
        (other, _) => other,
    }
}

/// What a range of rates means.
pub(crate) fn direction(from: f64, to: f64) -> &'static str {
    if to <= 0.0 || -from > 10.0 * to.abs() {
        "falling"
    } else if from >= 0.0 || to > 10.0 * from.abs() {
        "rising"
    } else {
        "at rest"
    }
}

#[cfg(test)]
mod tests {
    use super::range;

    #[test]
    fn golden_ranges_have_the_digits_their_width_needs() {
        let rows = [
            (0.0, 0.03, "Hz", "below 0.03\u{a0}Hz"),
            (10_000.0, 30_000.0, "um/s", "10\u{202f}000 to 30\u{202f}000\u{a0}µm/s"),
            (-3.95, -0.003_81, "um", "−4 to 0\u{a0}µm"),
            (-0.003_81, 3.94, "um", "0 to 3.9\u{a0}µm"),
            (1005.2, 1005.9, "um", "1005.2 to 1005.9\u{a0}µm"),
            (3e-8, 1e-7, "s", "3×10⁻⁸ to 1×10⁻⁷\u{a0}s"),
        ];
        for (from, to, unit, expected) in rows {
            assert_eq!(range(from, to, unit), expected);
        }
    }
}
