//! Identification for control: from the records of the experiment protocol to everything that a controller undoes.
//!
//! The order is that of what each step needs: structure and a first lag from a small multisine, creep from holds, the
//! direct inverse of the hysteresis through both, and with it the lag on large signals, to which a small multisine is
//! biased by the hysteresis of small loops. Nothing but records goes in.

mod creep_fit;
mod fading_fit;
mod fading_part;
pub mod from_model;
mod held_out;
mod inverse;
pub mod linear_part;
pub mod model;
mod refine;
mod sensor;
mod spectrum;
mod timing;

pub use fading_part::FadingPart;
pub(crate) use from_model::Linear;
pub use from_model::{Part, RecordedHold, Undone, chain_of};
pub use held_out::HeldOut;
pub use linear_part::{FrequencyResponse, LinearPart, ModeOfStage, SmallSignal, fit_small_signal, frequency_response};
pub use model::{AroundPart, ControlModel, CreepPart, HumPart, InversePart};
pub use refine::refine;

use crate::covered::{Covered, SmallSignalBand};
use crate::error::IdentifyError;
use hysteron_data::{Dataset, Record, Role};

/// Records whose file begins so are small multisines.
pub const FRF: &str = "frf";
/// Records whose file begins so are holds.
pub const HOLD: &str = "hold";

/// Identifies a stage from the records of a campaign.
///
/// Records with role `identify` are taken by the beginning of their name: `frf` small multisines, `hold` steps and rests,
/// all others large signals from a stage that was cycled and rests at 0 V. Where the sensor's bandwidth is known, its filter is undone first
/// and in the chain.
///
/// # Errors
/// - no record of one of the three kinds, or records that do not show what they are for;
/// - large-signal records with different sample periods.
pub fn identify(dataset: &Dataset) -> Result<ControlModel, IdentifyError> {
    let sensor_lag_s = sensor::lag_s(dataset);
    let dataset = &*sensor::undone(dataset);
    let of_kind = |kind: &str| -> Vec<&Record> {
        dataset
            .with_role(Role::Identify)
            .filter(|record| record.file.starts_with(kind))
            .collect()
    };
    let missing = |what: &str| IdentifyError::Control {
        reason: format!("the dataset has no {what}; `hysteron campaign` records what is needed"),
    };
    let small = of_kind(FRF);
    let frf = small
        .first()
        .ok_or_else(|| missing("small multisine (a record named frf..)"))?;
    let holds = of_kind(HOLD);
    if holds.is_empty() {
        return Err(missing("hold (a record named hold..)"));
    }
    let large: Vec<&Record> = dataset
        .with_role(Role::Identify)
        .filter(|record| !record.file.starts_with(FRF) && !record.file.starts_with(HOLD))
        .collect();
    let first = large.first().ok_or_else(|| missing("large-signal record"))?;
    let period_s = first.period_s;
    if let Some(other) = large.iter().find(|r| (r.period_s / period_s - 1.0).abs() > 1e-6) {
        return Err(IdentifyError::Control {
            reason: format!(
                "{} has a sample period of {} s, {} of {period_s} s; record both at the controller's rate",
                other.file, other.period_s, first.file
            ),
        });
    }
    let stated_s = dataset.known.delay_s.ok_or_else(|| IdentifyError::Control {
        reason: "the controller's latency is not known; give known.delay_s in dataset.toml".into(),
    })?;
    let response = frequency_response(frf)?;
    let small_signal = fit_small_signal(&response, stated_s, frf.period_s)?;
    let by_holds = creep_fit::fit(&holds)?;
    let Hysteresis {
        creep,
        inverse,
        fading,
        timing: timing::Timing { lag, latency_s, .. },
        left_v,
    } = hysteresis(&large, &small_signal, by_holds)?;
    let mut linear = small_signal.linear.clone();
    linear.lag_s = lag.tau_s;
    linear.lag_growth = (lag.per_v != 0.0).then_some([lag.about_v, lag.per_v]);
    let swing_v = large
        .iter()
        .map(|record| crate::family::peak_to_peak(&record.voltage_v))
        .fold(0.0, f64::max);
    Ok(ControlModel {
        sample_period_s: period_s,
        latency_s,
        voltage_min_v: dataset.known.voltage_min_v.unwrap_or(f64::MIN),
        voltage_max_v: dataset.known.voltage_max_v.unwrap_or(f64::MAX),
        small_signal_um_per_v: small_signal.gain_um_per_v,
        misfit_percent: 100.0 * left_v / swing_v,
        model_error_um: None,
        held_out: held_out::held_out(dataset),
        linear,
        creep,
        inverse,
        fading,
        around: model::AroundPart {
            sensor_lag_s,
            ..model::AroundPart::default()
        },
        covered: Covered {
            small_signal: small_signal.told_to_hz.map(|up_to_hz| SmallSignalBand {
                up_to_hz,
                record: frf.file.clone(),
            }),
            ..Covered::by(dataset)
        },
    })
}

/// What the large signals say.
struct Hysteresis {
    creep: CreepPart,
    inverse: InversePart,
    fading: Option<FadingPart>,
    timing: timing::Timing,
    /// Rms of what is left, volts.
    left_v: f64,
}

/// Fits the hysteresis to large signals, a table of plays or fading elements, with the timing and the creep that go with it.
fn hysteresis(large: &[&Record], small_signal: &SmallSignal, by_holds: CreepPart) -> Result<Hysteresis, IdentifyError> {
    let stated_s = small_signal.latency_s;
    fn around<'a>(small_signal: &'a SmallSignal, creep: &'a CreepPart, latency_s: f64) -> inverse::Around<'a> {
        inverse::Around {
            linear: &small_signal.linear,
            creep,
            latency_s,
            gain_um_per_v: small_signal.gain_um_per_v,
        }
    }
    let through = |creep: &CreepPart, latency_s: f64, rounds: usize| {
        inverse::fit(large, &around(small_signal, creep, latency_s), rounds)
    };
    // Two rounds tell the latency, which fast creep would otherwise be taken for.
    let (table, timing, _) = through(&by_holds, stated_s, 2)?;
    if fading_fit::foretell_better(large, &around(small_signal, &by_holds, stated_s), timing, &table)? {
        let elements = |creep: &CreepPart, from, rounds: usize| {
            fading_fit::fit(large, &around(small_signal, creep, stated_s), from, rounds)
        };
        let (_, timing, _) = elements(&by_holds, timing, 2)?;
        let creep = creep_fit::as_fast_as_loops_say(by_holds.clone(), &|creep| {
            elements(creep, timing, 1).map_or(f64::INFINITY, |(_, _, left_um)| left_um)
        });
        let (part, timing, left_um) = elements(&creep, timing, fading_fit::ROUNDS)?;
        if part.to_core::<f64>().is_ok() {
            return Ok(Hysteresis {
                creep,
                // The table beside them says where the stroke ends.
                inverse: table,
                left_v: left_um / part.mean_gain_um_per_v(),
                fading: Some(part),
                timing,
            });
        }
    }
    let creep = creep_fit::as_fast_as_loops_say(by_holds, &|creep| {
        through(creep, timing.latency_s, 1).map_or(f64::INFINITY, |(_, _, left_v)| left_v)
    });
    let (inverse, timing, left_v) = through(&creep, timing.latency_s, inverse::ROUNDS)?;
    Ok(Hysteresis {
        creep,
        inverse,
        fading: None,
        timing,
        left_v,
    })
}
