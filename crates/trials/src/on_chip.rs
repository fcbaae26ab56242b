//! The references of [`SHAPES`] by the firmware in the emulator, at a simulated stage.

use crate::chip::{Chip, Follow};
use crate::error::TrialError;
use crate::learning::Plan;
use crate::scans;
use hysteron_board::{Machine, Shape};
use hysteron_control::adapted::{Adaptation, Adapted};
use hysteron_control::design::{Controller, beyond};
use hysteron_control::learning::LearnedReference;
use hysteron_control::reference::{self, SHAPES};
use hysteron_identify::covered::Beyond;
use hysteron_tracking::bench::Bench;
use hysteron_tracking::scans::ScanFigures;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// What is asked of the emulator.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// What it plays.
    pub machine: Machine,
    /// The firmware's sources.
    pub firmware: &'a Path,
    /// Whether references may leave what the records cover.
    pub beyond_records: bool,
    /// Corrections of each reference that is learned, at most; none for no learning.
    pub iterations: Option<usize>,
    /// Shares of the other axis' motion that reach each axis, as measured.
    pub measured_shares: [f64; 2],
}

/// What the same controller reached as firmware.
#[derive(Debug, Clone, Serialize)]
pub struct OnChip {
    /// The machine that ran it.
    pub machine: &'static str,
    /// Open loop, and closed where there is feedback.
    pub controllers: Vec<OnChipFigures>,
    /// Ticks that ran at the sample clock; the others were worked out ahead and compared bit by bit.
    pub clocked_ticks: u32,
    /// Of these the late and lost ones.
    pub late_ticks: u32,
    /// References that it learned run by run.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub learned: Vec<LearnedReference>,
    /// Scans of both axes.
    pub scans: Vec<ScanFigures>,
    /// Bounds of what the law learns of gain, zero and lag; none where it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<Adaptation>,
    /// What of the references leaves the records, as was granted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beyond: Vec<Beyond>,
}

/// What a loop reached.
#[derive(Debug, Clone, Serialize)]
pub struct OnChipFigures {
    /// The law, and the machine that ran it.
    pub name: String,
    /// `open` or `closed`.
    #[serde(rename = "loop")]
    pub loop_kind: &'static str,
    /// As the controllers' of the report.
    pub rms_percent: BTreeMap<String, f64>,
    /// As the controllers' of the report.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub adapted: BTreeMap<String, Adapted>,
    /// Largest error from 5 ms after a move to the range's upper end to 10 s after it, averaged over a millisecond.
    pub creep_peak_percent: f64,
}

/// Tracks the references, settled and judged for as long as on the host: an image for each loop. Progress gets what runs and the share
/// done, 0 to 1.
///
/// # Errors
/// References beyond the records that were not granted, refused before an image is built; an image that cannot be built or run, or that
/// stops on this stage.
pub fn track(
    controller: &Controller,
    bench: &Bench<'_>,
    asked: &Asked<'_>,
    progress: &dyn Fn(&str, f64),
) -> Result<OnChip, TrialError> {
    let beyond = beyond::simulated(controller, bench.range_um, asked.beyond_records)?;
    let stage = bench.stage;
    let chip = Chip::new(asked.machine, asked.firmware, None)?;
    let references = references(bench);
    let open = controller.without_feedback();
    let loops = [
        ("open", Some(&open)),
        ("closed", controller.feedback.as_ref().map(|_| controller)),
    ];
    let mut report = OnChip {
        machine: chip.name(),
        controllers: Vec::new(),
        clocked_ticks: 0,
        late_ticks: 0,
        learned: Vec::new(),
        scans: Vec::new(),
        adaptation: controller.adaptation.clone(),
        beyond,
    };
    for (number, (loop_kind, controller)) in loops.into_iter().enumerate() {
        let Some(controller) = controller else { continue };
        let done = |share: f64| 0.5 * (number as f64 + share);
        progress(&format!("on the chip, {loop_kind} loop"), done(0.0));
        let mut running = chip.start_law(loop_kind, controller, stage)?;
        let seed = |number: usize| bench.seed.wrapping_add(number as u64);
        let feedback = controller.feedback.is_some();
        let reached = running.follow(stage, &references, feedback, seed)?;
        report.clocked_ticks += reached.clocked_ticks;
        report.late_ticks += reached.late_ticks;
        report.controllers.push(OnChipFigures {
            name: format!("complete on {}", chip.name()),
            loop_kind,
            rms_percent: reached.percent,
            adapted: reached.adapted,
            creep_peak_percent: running.hold(stage, bench.range_um, feedback, bench.seed)?,
        });
        if let (Some(most), false) = (asked.iterations, feedback) {
            progress("learning on the chip", done(0.3));
            let plan = Plan {
                controller,
                range_um: bench.range_um,
                most,
                references: &SHAPES,
            };
            report.learned = plan.on_chip(&mut running, stage, bench.seed)?;
        }
        progress(&format!("both axes on the chip, {loop_kind} loop"), done(0.5));
        report
            .scans
            .extend(scans::on_chip(&chip, controller, bench, asked.measured_shares)?);
        progress(&format!("on the chip, {loop_kind} loop"), done(1.0));
    }
    Ok(report)
}

/// The references as the image follows them.
fn references(bench: &Bench<'_>) -> Vec<Follow> {
    let [low_um, high_um] = bench.range_um;
    let period_s = bench.stage.sample_period_s;
    let follow = |(name, shape): (&'static str, reference::Shape)| {
        let here = shape.reference(bench.range_um, period_s);
        Follow {
            name,
            shape: of_the_board(shape),
            frequency_hz: shape.frequency_hz(),
            range_um: bench.range_um,
            stroke_um: high_um - low_um,
            settling_s: here.judged_from as f64 * period_s,
            judged_s: (here.samples_um.len() - here.judged_from) as f64 * period_s,
        }
    };
    SHAPES.into_iter().map(follow).collect()
}

/// A reference as the board makes it.
pub(crate) fn of_the_board(shape: reference::Shape) -> Shape {
    match shape {
        reference::Shape::Sine { .. } => Shape::Sine,
        reference::Shape::ComplexHarmonic { .. } => Shape::ComplexHarmonic,
        reference::Shape::Triangle { .. } => Shape::Triangle,
    }
}
