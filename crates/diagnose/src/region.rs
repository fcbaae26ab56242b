//! What the error of a stretch of a record goes with.

use crate::comparison::RecordComparison;
use hysteron_identify::EffectId;
use serde::Serialize;
use std::ops::Range;

/// The error in a stretch of one record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Region {
    /// Samples in it.
    pub samples: usize,
    /// Error, rms, output unit.
    pub rms: f64,
    /// Mean of the error (measured minus modelled), output unit.
    pub mean: f64,
    /// Largest error, output unit.
    pub max: f64,
    /// Error over the noise floor.
    pub noise_ratio: f64,
    /// Share of the record's squared error, percent.
    pub share_percent: f64,
    /// Share of the record's samples, percent.
    pub samples_percent: f64,
    /// What the error goes with, largest share first; shares overlap.
    pub goes_with: Vec<GoesWith>,
}

/// A quantity, and the effects that make an error going with it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GoesWith {
    /// `offset`, `speed`, `acceleration`, `position`, `curvature`, `time`.
    pub quantity: &'static str,
    /// Share of the squared error that one coefficient of it takes away, percent.
    pub share_percent: f64,
    /// Effects of the catalogue that could make it.
    pub effects: &'static [EffectId],
}

/// Name, effects, value at a sample.
type Quantity<'a> = (&'static str, &'static [EffectId], Box<dyn Fn(usize) -> f64 + 'a>);

/// The error of a record in a range of samples; `None` where the range holds fewer than eight.
///
/// Shares are those of a regression on one quantity at a time, the mean taken off first (`1 - |e - c q|^2 / |e|^2`).
///
/// # Cost
/// Linear in the samples of the record.
pub fn region(record: &RecordComparison, range: Range<usize>, noise_rms: f64) -> Option<Region> {
    let series = &record.series;
    let all = series.measured.len();
    let range = range.start.min(all)..range.end.min(all);
    let n = range.len();
    if n < 8 {
        return None;
    }
    let error = |k: usize| series.measured[k] - series.modelled[k];
    let squares = |range: Range<usize>| range.map(|k| error(k).powi(2)).sum::<f64>();
    let (here, whole) = (squares(range.clone()), squares(0..all));
    let mean = range.clone().map(error).sum::<f64>() / n as f64;
    // Derivatives of the modelled output: those of the measured one carry the noise that the error carries, too.
    let smooth = |k: usize| series.modelled[(k + 1).min(all - 1)] - series.modelled[k.saturating_sub(1)];
    let bend = |k: usize| {
        series.modelled[(k + 1).min(all - 1)] - 2.0 * series.modelled[k] + series.modelled[k.saturating_sub(1)]
    };
    let middle = range.clone().map(|k| series.modelled[k]).sum::<f64>() / n as f64;
    let quantities: [Quantity<'_>; 5] = [
        (
            "speed",
            &[
                EffectId::Delay,
                EffectId::FirstOrderLag,
                EffectId::RateDependence,
                EffectId::SlewLimit,
            ],
            Box::new(smooth),
        ),
        (
            "acceleration",
            &[EffectId::Resonance, EffectId::FirstOrderLag, EffectId::Delay],
            Box::new(bend),
        ),
        (
            "position",
            &[
                EffectId::AmplitudeGain,
                EffectId::SensorNonlinearity,
                EffectId::ThermalDrift,
                EffectId::CrossCoupling,
            ],
            Box::new(|k| series.modelled[k]),
        ),
        (
            "curvature",
            &[
                EffectId::Asymmetry,
                EffectId::Saturation,
                EffectId::SensorNonlinearity,
                EffectId::HysteresisShape,
            ],
            Box::new(move |k| (series.modelled[k] - middle).powi(2)),
        ),
        (
            "time",
            &[EffectId::Creep, EffectId::ThermalDrift],
            Box::new(|k| k as f64),
        ),
    ];
    let of_mean = if here > 0.0 {
        100.0 * n as f64 * mean * mean / here
    } else {
        0.0
    };
    let mut goes_with = vec![GoesWith {
        quantity: "offset",
        share_percent: of_mean,
        effects: &[EffectId::Creep, EffectId::ThermalDrift, EffectId::Backlash],
    }];
    for (quantity, effects, value) in &quantities {
        goes_with.push(GoesWith {
            quantity,
            share_percent: share(range.clone(), error, mean, value, here),
            effects,
        });
    }
    goes_with.sort_by(|a, b| b.share_percent.total_cmp(&a.share_percent));
    Some(Region {
        samples: n,
        rms: (here / n as f64).sqrt(),
        mean,
        max: range.map(|k| error(k).abs()).fold(0.0, f64::max),
        noise_ratio: (here / n as f64).sqrt() / noise_rms,
        share_percent: if whole > 0.0 { 100.0 * here / whole } else { 0.0 },
        samples_percent: 100.0 * n as f64 / all as f64,
        goes_with,
    })
}

/// Share of the squared error that a quantity takes away, percent.
fn share(
    range: Range<usize>,
    error: impl Fn(usize) -> f64,
    mean: f64,
    value: &dyn Fn(usize) -> f64,
    squares: f64,
) -> f64 {
    let n = range.len() as f64;
    let of_value = range.clone().map(value).sum::<f64>() / n;
    let (mut cross, mut own) = (0.0, 0.0);
    for k in range {
        let q = value(k) - of_value;
        cross += q * (error(k) - mean);
        own += q * q;
    }
    if own > 0.0 && squares > 0.0 {
        100.0 * cross * cross / own / squares
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::region;
    use crate::comparison::{RecordComparison, Series};
    use hysteron_data::Role;

    fn record(error: impl Fn(usize) -> f64) -> RecordComparison {
        let modelled: Vec<f64> = (0..2000).map(|k| (k as f64 * 0.01).sin()).collect();
        let measured = modelled.iter().enumerate().map(|(k, y)| y + error(k)).collect();
        RecordComparison {
            file: "a.csv".into(),
            role: Role::Validate,
            nrmse_percent: None,
            fit_percent: None,
            rms_um: 0.0,
            max_um: 0.0,
            noise_ratio: 0.0,
            samples: 2000,
            initial_state: String::new(),
            start_estimated: false,
            series: Series {
                start_s: 0.0,
                period_s: 1.0,
                input: vec![],
                measured,
                modelled,
            },
        }
    }

    #[test]
    fn val_an_error_is_said_to_go_with_what_made_it() {
        type Error = fn(usize) -> f64;
        let rows: [(&str, Error); 5] = [
            ("offset", |_| 0.1),
            ("speed", |k| 0.02 * (k as f64 * 0.01).cos()),
            ("curvature", |k| 0.02 * (k as f64 * 0.01).sin().powi(2) - 0.01),
            ("time", |k| 1e-5 * (k as f64 - 1000.0)),
            ("position", |k| 0.01 * (k as f64 * 0.01).sin()),
        ];
        for (expected, error) in rows {
            let found = region(&record(error), 0..2000, 1e-3).unwrap();
            assert!(
                found.goes_with[0].share_percent > 90.0,
                "{expected}: {:?}",
                found.goes_with
            );
            let named = found.goes_with.iter().find(|g| g.quantity == expected).unwrap();
            assert!(named.share_percent > 90.0, "{expected}: {:?}", found.goes_with);
        }
    }

    #[test]
    fn val_shares_of_a_stretch_are_of_the_whole_record() {
        let found = region(&record(|k| if k < 500 { 0.1 } else { 0.0 }), 0..1000, 0.01).unwrap();
        assert_eq!((found.share_percent.round(), found.samples_percent), (100.0, 50.0));
        assert!((found.rms - 0.1 / 2f64.sqrt()).abs() < 1e-12 && (found.noise_ratio - found.rms / 0.01).abs() < 1e-9);
        assert_eq!(region(&record(|_| 0.0), 10..12, 0.01), None);
    }
}
