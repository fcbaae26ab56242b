//! The simulated stages that the workbench offers: `hysteron track --stage NAME --alone`.

use crate::commands::control::track::{SEED, bench, text, usual_um};
use crate::error::CliError;
use hysteron_control::design::Controller;
use hysteron_control::design::prediction::{Predicted, predict};
use hysteron_control::expected::Row;
use hysteron_control::reference::{SHAPES, Shape};
use hysteron_lab::{SimulatedStage, StageRun};
use hysteron_plant::preset;
use hysteron_tracking::bench::{Bench, compare};

/// Each with its run.
pub(crate) fn stages() -> Vec<SimulatedStage> {
    let offered = |name: &'static str| {
        let stage = preset::named(name)?;
        Some(SimulatedStage {
            name,
            usual_um: usual_um(&stage),
            run: Box::new(move |controller, range_um| {
                alone(name, &bench(&stage, SEED, range_um, controller), controller).map_err(|error| error.to_string())
            }),
        })
    };
    preset::NAMES.into_iter().filter_map(offered).collect()
}

fn alone(name: &str, bench: &Bench<'_>, controller: &Controller) -> Result<StageRun, CliError> {
    let report = compare(name, bench, controller, false)?;
    let expected = predict(controller, None)?;
    let rows = report.controllers.iter().flat_map(|run| {
        let row = |(key, _): (&'static str, Shape)| {
            let at = expected.iter().find(|at| key.parse() == Ok(at.frequency_hz));
            let of = |at: &Predicted| match run.loop_kind {
                "closed" => at.closed_percent,
                _ => Some(at.open_percent),
            };
            Row {
                reference: key,
                loop_kind: run.loop_kind,
                expected_percent: at.and_then(of),
                found_percent: run.rms_percent.get(key).copied().unwrap_or(f64::NAN),
                stable: run.stable,
            }
        };
        SHAPES.map(row)
    });
    Ok(StageRun {
        rows: rows.collect(),
        said: text(&report),
    })
}
