//! The simulated stages that the workbench offers: `hysteron track --stage NAME --alone`.

use crate::commands::control::track::{SEED, bench, text, usual_um};
use crate::error::CliError;
use hysteron_board::served::Served;
use hysteron_control::design::Controller;
use hysteron_control::expected::Plan;
use hysteron_control::reference::SHAPES;
use hysteron_lab::{SimulatedStage, StageRun};
use hysteron_plant::{Stage, preset};
use hysteron_tracking::bench::{Bench, compare};

/// Each with its run.
pub(crate) fn stages() -> Vec<SimulatedStage> {
    let offered = |name: &'static str| {
        let stage = preset::named(name)?;
        let served = stage.clone();
        Some(SimulatedStage {
            name,
            usual_um: usual_um(&stage),
            run: Box::new(move |controller, range_um| {
                alone(name, &bench(&stage, SEED, range_um, controller), controller).map_err(|error| error.worded())
            }),
            serve: Box::new(move |table| {
                let stage = Stage::new(&served, SEED).map_err(|error| error.to_string())?;
                let board = Served::start(table, stage).map_err(|error| error.to_string())?;
                let address = board.address().to_owned();
                Ok((address, Box::new(board)))
            }),
        })
    };
    preset::NAMES.into_iter().filter_map(offered).collect()
}

fn alone(name: &str, bench: &Bench<'_>, controller: &Controller) -> Result<StageRun, CliError> {
    let report = compare(name, bench, controller, false)?;
    let plan = Plan::new(controller, bench.range_um)?;
    let rows = report.controllers.iter().flat_map(|run| {
        SHAPES.map(|(key, _)| {
            let found_percent = run.rms_percent.get(key).copied().unwrap_or(f64::NAN);
            let closed = run.loop_kind == "closed";
            plan.beside((key, closed), found_percent, run.stable, run.adapted.get(key).copied())
        })
    });
    Ok(StageRun {
        rows: rows.collect(),
        said: text(&report),
    })
}
