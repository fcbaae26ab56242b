//! References that repeat, learned run by run on a board: a real one, or the firmware in the emulator.

use crate::chip::{RATE_HZ, RISE_TICKS, Running};
use crate::error::TrialError;
use crate::on_board::{Judged, Looped, RAMP_S, Tick, along};
use hysteron_board::upload::Upload;
use hysteron_board::{Mode, Shape, TABLE_POINTS};
use hysteron_control::design::Controller;
use hysteron_control::learning::{
    Iteration, LEARNED, LearnedReference, Learning, Run, band_hz, corrected, learn, whole_period,
};
use hysteron_control::reference;
use hysteron_plant::StageConfig;

/// What is learned, and how.
#[derive(Clone, Copy)]
pub(crate) struct Plan<'a> {
    pub controller: &'a Controller,
    /// Lowest and highest reference, micrometres.
    pub range_um: [f64; 2],
    /// Corrections of each reference, at most.
    pub most: usize,
    /// The references that are played; those that can be learned are.
    pub references: &'a [(&'static str, reference::Shape)],
}

impl Plan<'_> {
    /// Every reference whose period is whole samples, by whatever runs one: name, shape, number of the run and points.
    fn learned(
        &self,
        period_s: f64,
        mut run: impl FnMut(&str, reference::Shape, usize, Upload) -> Result<Run, TrialError>,
    ) -> Result<Vec<LearnedReference>, TrialError> {
        let band_hz = band_hz(self.controller)?;
        let mut all = Vec::new();
        for &(name, shape) in self.references.iter().filter(|(name, _)| LEARNED.contains(name)) {
            let Some(samples) = whole_period(shape, period_s) else {
                continue;
            };
            // What swings faster counts as the loop's own swinging.
            let harmonics = f64::from(Shape::Table.highest_harmonic());
            let learning = Learning {
                samples,
                period_s,
                band_hz: band_hz.min(harmonics * shape.frequency_hz()),
                most: self.most,
            };
            all.push(learn(name, learning, |number, correction_um| {
                run(name, shape, number, self.points(shape, correction_um)?).map(Some)
            })?);
        }
        Ok(all)
    }

    /// What the board's table gets.
    fn points(&self, shape: reference::Shape, correction_um: &[f64]) -> Result<Upload, TrialError> {
        let points = corrected(shape, self.range_um, correction_um, TABLE_POINTS);
        Ok(Upload::of_positions(&points)?)
    }

    /// A run from its ticks, in the phase in which their references are those of the points.
    fn run(&self, shape: reference::Shape, period_s: f64, points: &Upload, ticks: &[Tick]) -> Run {
        let [low_um, high_um] = self.range_um;
        let late = late(points, shape.frequency_hz() * period_s, ticks);
        let ticks: Vec<(usize, f64, Option<f64>)> = ticks
            .iter()
            .filter_map(|tick| Some((tick.number.checked_sub(late)?, tick.measured_um, tick.true_um)))
            .collect();
        let wanted = |k: usize| low_um + (high_um - low_um) * shape.share(k as f64 * period_s);
        let percent = |squares: f64| 100.0 * (squares / ticks.len().max(1) as f64).sqrt() / (high_um - low_um);
        let measured: f64 = ticks.iter().map(|&(k, y, _)| (wanted(k) - y).powi(2)).sum();
        let of_true: Option<f64> = ticks.iter().map(|&(k, _, y)| Some((wanted(k) - y?).powi(2))).sum();
        Run {
            error_um: ticks.iter().map(|&(k, y, _)| (k, wanted(k) - y)).collect(),
            iteration: Iteration {
                measured_percent: percent(measured),
                true_percent: of_true.map(percent),
            },
        }
    }

    /// By a real board; adds the ticks that did not come to `lost`.
    pub(crate) fn on_board(
        &self,
        open: &Looped<'_>,
        rate_hz: f64,
        lost: &mut u64,
        progress: &dyn Fn(&str, usize),
    ) -> Result<Vec<LearnedReference>, TrialError> {
        self.learned(1.0 / rate_hz, |name, shape, number, points| {
            progress(name, number);
            let judged = Judged::of(shape);
            let seconds = RAMP_S + judged.length_s();
            let captured = open.along(points, shape.frequency_hz(), seconds, &|_| ())?;
            *lost += captured.counts.lost;
            let ticks = judged.ticks(&captured, name)?;
            Ok(self.run(shape, 1.0 / rate_hz, &points, &ticks))
        })
    }

    /// By an image without feedback in the emulator, at a simulated stage.
    pub(crate) fn on_chip(
        &self,
        running: &mut Running,
        stage: &StageConfig,
        seed: u64,
    ) -> Result<Vec<LearnedReference>, TrialError> {
        self.learned(1.0 / RATE_HZ, |_, shape, number, points| {
            let here = shape.reference(self.range_um, 1.0 / RATE_HZ);
            let ticks = here.samples_um.len() as u32 + RISE_TICKS;
            let request = along(&points, shape.frequency_hz(), 1.0, false);
            let player = running.along(&request, &points, (stage, seed.wrapping_add(number as u64)), ticks)?;
            let begun = player.begun().unwrap_or(0);
            let judged = player.played.iter().enumerate().skip(begun + here.judged_from);
            let judged = judged.take(here.samples_um.len() - here.judged_from);
            let judged = judged.filter(|(_, tick)| tick.frame.mode() == Mode::Running);
            let ticks: Vec<Tick> = judged
                .map(|(k, tick)| Tick {
                    number: k - begun,
                    reference_um: f64::from(tick.frame.reference_um),
                    measured_um: tick.position_um,
                    true_um: Some(tick.true_um),
                })
                .collect();
            Ok(self.run(shape, 1.0 / RATE_HZ, &points, &ticks))
        })
    }
}

/// Longest that a law may know its reference ahead, ticks, and some.
const LONGEST_AHEAD: usize = 64;

/// Ticks from where the loop ran to where the points began to be due: the law's own preview is among them.
fn late(points: &Upload, turns_a_tick: f64, ticks: &[Tick]) -> usize {
    let [low_um, high_um] = points.range_um;
    let point = |i: usize| low_um + (high_um - low_um) * f64::from(points.shares()[i % TABLE_POINTS]) / 65_535.0;
    let due = |k: usize| {
        let place = (k as f64 * turns_a_tick).fract() * TABLE_POINTS as f64;
        let i = place as usize;
        point(i) + (point(i + 1) - point(i)) * place.fract()
    };
    let off = |late: usize| -> f64 {
        let from_late_on = ticks.iter().filter(|tick| tick.number >= LONGEST_AHEAD);
        from_late_on
            .map(|tick| (tick.reference_um - due(tick.number - late)).powi(2))
            .sum()
    };
    let each = (0..=LONGEST_AHEAD).map(|late| (late, off(late)));
    each.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(late, _)| late)
}

/// What was learned of a reference as the board takes it: one period in micrometres.
pub fn board_points(shape: reference::Shape, range_um: [f64; 2], learned: &LearnedReference) -> Vec<f64> {
    corrected(shape, range_um, &learned.correction_um, TABLE_POINTS)
}
