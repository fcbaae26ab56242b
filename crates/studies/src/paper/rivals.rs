//! The models of the paper's Table 1 beside its own, each as the inverse in the same two loops on the same records.

use super::tracking::Bench;
use super::{FAMILIES, chosen_reading, feedback, identified, modelling};
use hysteron_control::figures::judge;
use hysteron_control::reference::Shape;
use hysteron_identify::rivals::{FittedRival, Operations, Rival, fit_rival};
use hysteron_identify::{Family, FitReport};
use hysteron_plant::StageConfig;
use hysteron_tracking::TrackingError;
use hysteron_tracking::experiment::{Controller, PLAYS};
use hysteron_tracking::run::{PiGains, law_of, track_from};
use rayon::prelude::*;

/// Frequencies of the table, hertz: those of identification, and one that no mode here is a multiple of.
pub const RIVALS_HZ: [f64; 4] = [10.0, 100.0, 500.0, 503.0];

/// One model: its size, its fit, and what it does in the paper's two loops.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RivalRow {
    /// The model.
    pub model: String,
    /// Parameters fitted, without the offset.
    pub parameters: usize,
    /// Parameters in the paper's Table 1.
    pub published_parameters: Option<usize>,
    /// Rms error on the records at 10, 100 and 500 Hz that the inverse was fitted to, percent of the voltage's peak to peak.
    pub fit_percent: [f64; 3],
    /// Open loop: rms of reference less reading, percent of peak to peak, at [`RIVALS_HZ`].
    pub open_percent: [f64; 4],
    /// The same with the PI controller.
    pub closed_percent: [f64; 4],
    /// What the paper measured at 500 Hz on its hardware, open and closed.
    pub published_500_hz: [Option<f64>; 2],
    /// What a step of the model costs.
    pub operations: Operations,
}

/// Fits and runs all of them on one stage: sines of 0 to 26 V, N = 10 plays by eq. 16, weights by eq. 18, and the paper's gains under the
/// reading that [`super::study`] takes.
///
/// # Errors
/// As [`super::study`].
///
/// # Cost
/// Four searches of some hundred passes over 30 000 samples: seconds.
pub fn rivals(stage: &StageConfig, seed: u64) -> Result<Vec<RivalRow>, TrackingError> {
    let (records, range_um) = identified(stage, seed)?;
    let bench = Bench { stage, seed, range_um };
    let readings = feedback::readings(&bench)?;
    let gains = readings[chosen_reading(&readings)].gains;
    let inverses = super::fit_inverses(&records)?;
    let own = FAMILIES.iter().zip(&inverses).map(|(&family, report)| {
        let modelling = modelling::error(&records, &report.model);
        own_row(&bench, gains, family, report, modelling.rms_percent)
    });
    let mut rows: Vec<RivalRow> = own.collect::<Result<_, _>>()?;
    let others: Result<Vec<RivalRow>, TrackingError> = Rival::ALL
        .par_iter()
        .map(|&rival| other_row(&bench, gains, &fit_rival(&records, rival, PLAYS)?))
        .collect();
    rows.extend(others?);
    Ok(rows)
}

fn own_row(
    bench: &Bench<'_>,
    gains: PiGains,
    family: Family,
    report: &FitReport,
    fit_percent: [f64; 3],
) -> Result<RivalRow, TrackingError> {
    let errors = |gains| {
        errors(|shape| {
            let controller = Controller {
                inverse: Some(&report.model),
                gains,
                further_samples: 0,
            };
            let (_, figures) = controller.judge(bench.stage, bench.seed, shape, bench.range_um)?;
            Ok(figures.map_or(f64::NAN, |figures| figures.measured_percent))
        })
    };
    let (multiply_adds, published_parameters, published_500_hz) = match family {
        Family::Wrpi => (2 * PLAYS + 5, None, [Some(5.12), Some(4.5)]),
        Family::Mrpi => (PLAYS + 7, Some(14), [Some(1.6), Some(2.3)]),
        _ => (PLAYS + 4, None, [Some(11.0), Some(12.3)]),
    };
    Ok(RivalRow {
        model: family.name().to_uppercase(),
        // The offset is ours: the sensor's zero.
        parameters: report.model.parameters().len() - 1,
        published_parameters,
        fit_percent,
        open_percent: errors(None)?,
        closed_percent: errors(Some(gains))?,
        published_500_hz,
        operations: Operations {
            multiply_adds,
            compares: 2 * PLAYS,
            calls: 0,
        },
    })
}

fn other_row(bench: &Bench<'_>, gains: PiGains, fitted: &FittedRival) -> Result<RivalRow, TrackingError> {
    let model = &fitted.model;
    let errors = |gains| {
        errors(|shape| {
            let reference = shape.reference(bench.range_um, bench.stage.sample_period_s);
            let law = law_of(bench.stage, Some(model.clone()), gains)?;
            let start = model.start(reference.samples_um.first().copied().unwrap_or(0.0));
            let tracked = track_from(bench.stage, bench.seed, &law, start, &reference, 0)?;
            let figures = judge(&tracked.from(reference.judged_from), bench.stage.sample_period_s);
            Ok(figures.map_or(f64::NAN, |figures| figures.measured_percent))
        })
    };
    let rival = model.rival();
    Ok(RivalRow {
        model: rival.name().to_owned(),
        parameters: model.parameters(),
        published_parameters: Some(rival.published_parameters()),
        fit_percent: core::array::from_fn(|i| fitted.rms_percent.get(i).copied().unwrap_or(f64::NAN)),
        open_percent: errors(None)?,
        closed_percent: errors(Some(gains))?,
        published_500_hz: [None; 2],
        operations: rival.operations(PLAYS),
    })
}

/// The error of each frequency's sine.
fn errors(percent: impl Fn(Shape) -> Result<f64, TrackingError>) -> Result<[f64; 4], TrackingError> {
    let mut found = [f64::NAN; 4];
    for (cell, frequency_hz) in found.iter_mut().zip(RIVALS_HZ) {
        *cell = percent(Shape::Sine { frequency_hz })?;
    }
    Ok(found)
}
