//! Model against measurement, free simulation, on every record.

use crate::breakdown::{Sample, breakdowns};
use crate::comparison::{Comparison, Pooled, RecordComparison, Series};
use crate::straight_line::StraightLine;
use crate::{error_map, noise, spectrum, swing_map};
use hysteron_acquisition::{Basis, NoiseFloor, NoiseSource};
use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::family::peak_to_peak;
use hysteron_identify::objective::clipped;
use hysteron_identify::{Direction, Model};
use rayon::prelude::*;

/// Compares a model with every record of a dataset. `progress` is called with the share done, 0 to 1.
///
/// Each record is simulated freely from its first sample. Percentages are eq. 19 and those of MATLAB's `compare`;
/// pooled means root mean square over the records that move. The model is read through the converter of the records: readings that
/// are clipped at its ends do not count.
///
/// # Cost
/// Linear in the samples; the series of all records are held for the pictures (3 numbers a sample).
pub fn compare(dataset: &Dataset, model: &Model, progress: &(dyn Fn(f64) + Sync)) -> Comparison {
    let per_um = output_per_um(dataset, model.direction);
    let clipped = clipped(dataset, model.direction);
    let done = std::sync::atomic::AtomicUsize::new(0);
    let mut records: Vec<RecordComparison> = dataset
        .records
        .par_iter()
        .map(|record| {
            let compared = compare_record(record, model, &clipped);
            let count = 1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            progress(0.8 * count as f64 / dataset.records.len() as f64);
            compared
        })
        .collect();
    let least_left = records
        .iter()
        .filter(|record| {
            let counted = record.series.measured.iter().filter(|y| !clipped.contains(y));
            counted.count() >= ENOUGH_TO_BOUND_NOISE
        })
        .map(|record| record.rms_um)
        .fold(f64::INFINITY, f64::min);
    let floor = noise::noise_floor(dataset).at_most(least_left / per_um);
    let noise_rms = floor.rms_um * per_um;
    records
        .iter_mut()
        .for_each(|record| record.noise_ratio = record.rms_um / noise_rms);
    let samples: Vec<Sample<'_>> = dataset
        .records
        .iter()
        .zip(&records)
        .map(|(r, c)| Sample::new(r, c))
        .collect();
    let line = StraightLine::fit(&records);
    let judged = if dataset.with_role(Role::Validate).next().is_some() {
        Role::Validate
    } else {
        Role::Identify
    };
    let comparison = Comparison {
        noise_rms_um: noise_rms,
        noise: floor,
        identify: of_role(&records, Role::Identify),
        validate: of_role(&records, Role::Validate),
        straight_line: line.and_then(|line| line.pooled(&records, judged, &clipped)),
        r#where: breakdowns(&samples, model.direction),
        error_map: error_map::error_map(&samples),
        swing_map: swing_map::swing_map(&samples, noise_rms),
        spectrum: spectrum::spectrum(&records, noise_rms),
        output_unit: model.direction.output_unit(),
        notices: notices(dataset, model, (&records, &clipped), &floor),
        records,
    };
    progress(1.0);
    comparison
}

/// Samples of a record from which on the error that is left there bounds the noise.
const ENOUGH_TO_BOUND_NOISE: usize = 200;

/// What a micrometre of position noise means at the model's output: 1, or for an inverse the mean slope in volts.
fn output_per_um(dataset: &Dataset, direction: Direction) -> f64 {
    let widest = |column: fn(&Record) -> &[f64]| {
        dataset
            .records
            .iter()
            .map(|record| peak_to_peak(column(record)))
            .fold(0.0, f64::max)
    };
    match direction {
        Direction::Forward => 1.0,
        Direction::Inverse => widest(|r| &r.voltage_v) / widest(|r| &r.position_um).max(f64::MIN_POSITIVE),
    }
}

fn compare_record(record: &Record, model: &Model, clipped: &[f64]) -> RecordComparison {
    let mut simulation = model.simulate(record);
    let measured = model.direction.output(record);
    for (modelled, y) in simulation.output.iter_mut().zip(measured) {
        if clipped.contains(y) {
            *modelled = *y;
        }
    }
    // A record at constant voltage has no stroke to be a percentage of, only noise.
    let moves = peak_to_peak(&record.voltage_v) > 0.0;
    let errors = Errors::new((measured, clipped), simulation.output.iter().copied(), moves);
    RecordComparison {
        file: record.file.clone(),
        role: record.role,
        nrmse_percent: errors.percent.map(|percent| percent.0),
        fit_percent: errors.percent.map(|percent| percent.1),
        rms_um: errors.rms,
        max_um: errors.largest,
        noise_ratio: 0.0,
        samples: measured.len(),
        initial_state: simulation.start(),
        start_estimated: simulation.estimated(),
        series: Series {
            start_s: record.start_s,
            period_s: record.period_s,
            input: model.direction.input(record).to_vec(),
            measured: measured.to_vec(),
            modelled: simulation.output,
        },
    }
}

/// How far a modelled series is off, in the output's unit and in percent.
pub(crate) struct Errors {
    rms: f64,
    largest: f64,
    /// Eq. 19 and fit, where the output moves.
    percent: Option<(f64, f64)>,
}

impl Errors {
    /// Eq. 19, percent; none where the output stands still.
    pub(crate) fn nrmse_percent(&self) -> Option<f64> {
        self.percent.map(|percent| percent.0)
    }

    /// Of the samples that are none of the clipped values.
    pub(crate) fn new(
        (measured, clipped): (&[f64], &[f64]),
        modelled: impl Iterator<Item = f64> + Clone,
        moves: bool,
    ) -> Self {
        let counted = || {
            measured
                .iter()
                .zip(modelled.clone())
                .filter(|(y, _)| !clipped.contains(y))
        };
        let n = (counted().count() as f64).max(1.0);
        let errors = || counted().map(|(y, m)| y - m);
        // The sum of nothing is minus zero.
        let rms = (errors().map(|e| e * e).sum::<f64>().abs() / n).sqrt();
        let stroke = peak_to_peak(measured);
        let mean = counted().map(|(y, _)| y).sum::<f64>() / n;
        let deviation = (counted().map(|(y, _)| (y - mean).powi(2)).sum::<f64>() / n).sqrt();
        Self {
            rms,
            largest: errors().fold(0.0, |largest: f64, e| largest.max(e.abs())),
            percent: (moves && stroke > 0.0).then(|| (100.0 * rms / stroke, 100.0 * (1.0 - rms / deviation))),
        }
    }
}

/// Root mean square over the records that move; `None` where none does.
pub(crate) fn pool(errors: impl Iterator<Item = Errors>) -> Option<Pooled> {
    let pool: Vec<_> = errors
        .filter_map(|errors| errors.percent.map(|(nrmse, fit)| (nrmse, fit, errors.rms)))
        .collect();
    let n = pool.len() as f64;
    let root_mean_square = |values: &mut dyn Iterator<Item = f64>| (values.map(|v| v * v).sum::<f64>() / n).sqrt();
    (!pool.is_empty()).then(|| Pooled {
        nrmse_percent: root_mean_square(&mut pool.iter().map(|p| p.0)),
        fit_percent: 100.0 - root_mean_square(&mut pool.iter().map(|p| 100.0 - p.1)),
        rms_um: root_mean_square(&mut pool.iter().map(|p| p.2)),
        records: pool.len(),
    })
}

/// Pooled errors of the records of a role.
fn of_role(records: &[RecordComparison], role: Role) -> Option<Pooled> {
    pool(
        records
            .iter()
            .filter(|record| record.role == role)
            .map(|record| Errors {
                rms: record.rms_um,
                largest: record.max_um,
                percent: record.nrmse_percent.zip(record.fit_percent),
            }),
    )
}

fn notices(
    dataset: &Dataset,
    model: &Model,
    (records, clipped): (&[RecordComparison], &[f64]),
    floor: &NoiseFloor,
) -> Vec<String> {
    let mut notices = Vec::new();
    if !clipped.is_empty() {
        let readings = || dataset.records.iter().flat_map(|record| &record.position_um);
        let (count, all) = (readings().filter(|y| clipped.contains(y)).count(), readings().count());
        let ends: Vec<String> = clipped.iter().map(|end| format!("{end:.4}")).collect();
        notices.push(format!(
            "{count} of {all} readings stand at the end of the sensor's range ({} um): they count in no error and are not fitted; \
             a larger range or a smaller drive shows the stage there",
            ends.join(" and ")
        ));
    }
    if dataset.with_role(Role::Validate).next().is_none() {
        notices.push(
            "no record has role `validate`: nothing here tests the model on data it was not fitted to; give a record \
             that role in dataset.toml"
                .to_owned(),
        );
    }
    if floor.source == NoiseSource::HighPass && floor.basis == Basis::UpperBound {
        notices.push(
            "the noise floor is an upper bound from the fastest part of the position; a record at constant voltage would tell it"
                .to_owned(),
        );
    }
    let outside: Vec<&str> = dataset
        .records
        .iter()
        .filter(|record| {
            let margin = 0.02 * (model.input_max - model.input_min);
            let input = model.direction.input(record);
            input
                .iter()
                .any(|&v| v < model.input_min - margin || v > model.input_max + margin)
        })
        .map(|record| record.file.as_str())
        .collect();
    if !outside.is_empty() {
        notices.push(format!(
            "{} leave{} the range the model was fitted on ({:.4} to {:.4} {}): there it extrapolates",
            outside.join(", "),
            if outside.len() == 1 { "s" } else { "" },
            model.input_min,
            model.input_max,
            model.direction.input_unit()
        ));
    }
    let estimated = records
        .iter()
        .filter(|r| r.role == Role::Validate && r.start_estimated)
        .count();
    if estimated > 0 {
        notices.push(format!(
            "the state before the first sample of {estimated} validation record{} is not in the file: one number each, \
             with creep or drift two (initial_state), was chosen to fit",
            if estimated == 1 { "" } else { "s" }
        ));
    }
    notices
}
