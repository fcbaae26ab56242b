//! Scans of both axes by the firmware: in the emulator, or on a board.

use crate::chip::{Chip, RATE_HZ};
use crate::error::TrialError;
use crate::on_board::{Looped, enough, no_fault};
use hysteron_board::host::complete;
use hysteron_board::telemetry::Capture;
use hysteron_board::two_axes::TwoAxisRig;
use hysteron_board::{BoardError, FALL_TICKS, Mode, Request, Setup, Shape};
use hysteron_control::design::Controller;
use hysteron_plant::StageConfig;
use hysteron_tracking::bench::Bench;
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

/// What each axis is asked for: the scan, and the rise to where it begins.
fn requests(scan: Scan, range_um: [f64; 2], feedback: bool) -> [Request; 2] {
    shapes(scan).map(|(shape, frequency_hz)| Request {
        shape,
        frequency_hz,
        range_um: Some(range_um),
        seconds: RISE_S + scan.seconds(),
        feedforward: true,
        feedback,
    })
}

/// Every scan by an image of both axes, the same controller on each, told of the shares that were measured. Worked out ahead: every frame
/// is compared with the host's.
pub(crate) fn on_chip(
    chip: &Chip,
    controller: &Controller,
    bench: &Bench<'_>,
    measured_shares: [f64; 2],
) -> Result<Vec<ScanFigures>, TrialError> {
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
        let [x, y] = requests(scan, bench.range_um, controller.feedback.is_some());
        let ticks = (seconds * RATE_HZ).round() as u32 + FALL_TICKS;
        let [of_x, of_y] = axes.session.banks().each_ref().map(|banks| banks[0]);
        let setups = [x.setup(&of_x)?, y.setup(&of_y)?].map(|setup| Setup { ticks, ..setup });
        let [x, y] = axes.tables.each_ref().map(complete);
        axes.session.run_ahead(&setups, (x?, y?), &mut rig)?;
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

/// Every scan by a board of both axes, by its own sensors; adds the ticks that did not come to `lost`.
pub(crate) fn on_board(
    looped: &Looped<'_>,
    range_um: [f64; 2],
    loop_kind: &'static str,
    lost: &mut u64,
    progress: &dyn Fn(&str, f64),
) -> Result<Vec<ScanFigures>, TrialError> {
    let mut all = Vec::new();
    for scan in Scan::ALL {
        let name = scan.name();
        let references = requests(scan, range_um, looped.feedback).map(|request| (request, None));
        let captured = looped.axes(&references, &|part| progress(name, part))?;
        let [of_x, of_y] = captured.as_slice() else {
            return Err(BoardError::OneAxis.into());
        };
        no_fault(of_x, name)?;
        no_fault(of_y, name)?;
        *lost += of_x.counts.lost.max(of_y.counts.lost);
        let rate_hz = f64::from(of_x.about.hello.sample_rate_hz);
        let wanted = (scan.seconds() * rate_hz).round() as usize;
        // Both axes of a tick, by its number.
        let mut beside = running(of_y).peekable();
        let both = running(of_x).filter_map(|(number, x)| {
            while beside.next_if(|(other, _)| *other < number).is_some() {}
            let (_, y) = beside.next_if(|(other, _)| *other == number)?;
            Some(([x[0], y[0]], [x[1], y[1]]))
        });
        let (path, was): (Vec<_>, Vec<_>) = both.take(wanted).unzip();
        enough(path.len() as u64, wanted as u64, name)?;
        let scanned = Scanned {
            name: "complete",
            loop_kind,
            scan,
            range_um,
            period_s: 1.0 / rate_hz,
        };
        all.push(scanned.figures(&path, &was));
    }
    Ok(all)
}

/// Number, reference and position of every tick in which the loop ran.
fn running(captured: &Capture) -> impl Iterator<Item = (u32, [f64; 2])> {
    let recordings = captured.pieces.iter().map(|piece| &piece.recording);
    let ticks = recordings.flat_map(|recording| recording.frames.iter().zip(&recording.position_um));
    let running = ticks.filter(|(frame, _)| frame.mode() == Mode::Running);
    running.map(|(frame, &position_um)| (frame.number, [f64::from(frame.reference_um), position_um]))
}
