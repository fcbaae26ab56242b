//! The inverse of a learned chain, fitted to records along references as well.

use super::from_model::{AGES_S, Played, played, quasi_static};
use super::inverse::{Pairs, fit_pairs};
use super::model::ControlModel;
use crate::error::IdentifyError;
use crate::family::peak_to_peak;
use crate::model::Model;
use crate::start_state::InitialState;
use hysteron_data::Record;

/// What an error on the model's own cycles counts beside one on a record: they stand in where no record goes.
const FACTOR_OF_CYCLES: f64 = 0.1;

/// Fits the inverse of the chain that [`super::chain_of`] made of the same model to slow records as well.
///
/// Of each record the inverse's input is what the model's hysteresis says, at rest in time, and by how much the position was off the
/// model: on records so slow that nothing else acts, what a model leaves is hysteresis. The fit runs over them and, a hundredth as
/// heavy, over the model's own cycles; it is as good as the records are like the references to come. They begin at rest at 0 V.
///
/// # Errors
/// As [`super::chain_of`]; a record whose drive turns between its rows.
///
/// # Cost
/// One simulation of the records, one least squares of 60 unknowns.
pub fn refine(chain: &mut ControlModel, model: &Model, records: &[Record]) -> Result<(), IdentifyError> {
    let alone = quasi_static(model);
    let Played { mut series, rest_um } = played(&alone)?;
    for pairs in &mut series {
        pairs.factor = FACTOR_OF_CYCLES;
    }
    for record in records {
        turns_are_seen(record)?;
        let hysteresis_um = alone.simulate_input(&record.voltage_v, AGES_S, InitialState::REST)?;
        let modelled_um = model.simulate_from_rest(record);
        let off = record.position_um.iter().zip(&modelled_um).map(|(y, m)| y - m);
        series.push(Pairs {
            position_um: hysteresis_um
                .iter()
                .zip(off)
                .map(|(x, off)| x - rest_um + off)
                .collect(),
            voltage_v: record.voltage_v.clone(),
            factor: 1.0,
        });
    }
    let (inverse, left_v) = fit_pairs(&series);
    chain.misfit_percent = 100.0 * left_v / (model.input_max - model.input_min);
    chain.inverse = inverse;
    Ok(())
}

/// How far beyond the rows the drive may have gone where it turned, as a share of its range: plays remember the turn.
const LARGEST_MISS: f64 = 0.01;

/// Refuses rows that are too far apart to show where the drive turned.
///
/// Between straight lines that step `a` from row to row before the turn and `b` after it, the turn lies at most `a b / (a + b)` beyond a row.
fn turns_are_seen(record: &Record) -> Result<(), IdentifyError> {
    let v = &record.voltage_v;
    let turns = v.windows(3).filter(|w| (w[1] - w[0]) * (w[2] - w[1]) < 0.0);
    let missed_v = turns
        .map(|w| {
            let (a, b) = ((w[1] - w[0]).abs(), (w[2] - w[1]).abs());
            a * b / (a + b)
        })
        .fold(0.0, f64::max);
    let share = missed_v / peak_to_peak(v).max(f64::MIN_POSITIVE);
    if share <= LARGEST_MISS {
        return Ok(());
    }
    Err(IdentifyError::Control {
        reason: format!(
            "{}: the drive turns between rows, up to {:.1} % of its range beyond them; record it at a higher rate, or drive the stage more \
             slowly",
            record.file,
            100.0 * share
        ),
    })
}
