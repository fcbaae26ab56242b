//! Scans of both axes by the firmware in the emulator.

use crate::commands::control::chip::{Chip, RATE_HZ, refused};
use crate::error::CliError;
use hysteron_board::host::complete;
use hysteron_board::two_axes::TwoAxisRig;
use hysteron_board::{FALL_TICKS, Mode, Request, Setup, Shape};
use hysteron_plant::StageConfig;
use hysteron_tracking::bench::Bench;
use hysteron_tracking::design::Controller;
use hysteron_tracking::scans::{LINES_HZ, SHARES, Scan, ScanFigures, Scanned};

/// Longest rise to the first point, seconds: the loop runs then.
const RISE_S: f64 = 0.06;

/// Shape and turns a second of each axis.
fn shapes(scan: Scan) -> [(Shape, f64); 2] {
    match scan {
        // Up once while the other goes to and fro.
        Scan::Raster => [(Shape::Triangle, LINES_HZ), (Shape::Triangle, 0.5 / scan.seconds())],
        Scan::Spiral => [(Shape::Spiral, LINES_HZ), (Shape::SpiralSine, LINES_HZ)],
    }
}

/// Every scan by an image of both axes, the same controller on each, told of the shares that were measured. Worked out ahead: every frame
/// is compared with the host's.
pub(super) fn scans(
    chip: &Chip,
    controller: &Controller,
    bench: &Bench<'_>,
    measured_shares: [f64; 2],
) -> Result<Vec<ScanFigures>, CliError> {
    let stage: &StageConfig = bench.stage;
    let loop_kind = if controller.feedback.is_some() {
        "closed"
    } else {
        "open"
    };
    let name = format!("complete on {}", chip.name());
    let mut axes = chip.start_axes(&format!("{loop_kind}-axes"), controller, stage, measured_shares)?;
    let mut all = Vec::new();
    for scan in Scan::ALL {
        let seconds = RISE_S + scan.seconds();
        let mut rig = TwoAxisRig::new([stage, stage], SHARES, bench.seed, seconds)?;
        let request = |(shape, frequency_hz): (Shape, f64)| Request {
            shape,
            frequency_hz,
            range_um: Some(bench.range_um),
            seconds,
            feedforward: true,
            feedback: controller.feedback.is_some(),
        };
        let ticks = (seconds * RATE_HZ).round() as u32 + FALL_TICKS;
        let [x, y] = shapes(scan).map(request);
        let [of_x, of_y] = axes.session.banks().each_ref().map(|banks| banks[0]);
        let setups = [x.setup(&of_x)?, y.setup(&of_y)?].map(|setup| Setup { ticks, ..setup });
        let [x, y] = axes.tables.each_ref().map(complete);
        axes.session
            .run_ahead(&setups, (x.map_err(refused)?, y.map_err(refused)?), &mut rig)?;
        let [of_x, of_y] = &rig.recordings;
        let both = of_x
            .frames
            .iter()
            .zip(&of_y.frames)
            .zip(rig.true_um[0].iter().zip(&rig.true_um[1]));
        let running = both.filter(|((x, y), _)| x.mode() == Mode::Running && y.mode() == Mode::Running);
        let (path, was): (Vec<_>, Vec<_>) = running
            .take((scan.seconds() * RATE_HZ).round() as usize)
            .map(|((x, y), (true_x, true_y))| ([x, y].map(|frame| f64::from(frame.reference_um)), [*true_x, *true_y]))
            .unzip();
        let scanned = Scanned {
            name: &name,
            loop_kind,
            scan,
            range_um: bench.range_um,
            period_s: 1.0 / RATE_HZ,
        };
        all.push(scanned.figures(&path, &was));
    }
    Ok(all)
}
