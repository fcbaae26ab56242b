//! Scans of both axes of one stage: a raster and a spiral, the error of each axis and of the path.

use crate::bench::{Bench, Contender};
use crate::error::TrackingError;
use crate::experiment::PLAYS;
use crate::run::{Law, law};
use hysteron_core::bank::PlayState;
use hysteron_core::control_law::ControlState;
use hysteron_core::surroundings::{DesignedLaw, DesignedState, LoopInput};
use hysteron_plant::{CrossCoupling, Stage, StageConfig};
use std::f64::consts::{PI, TAU};

/// Shares of the second axis' motion in the first and of the first's in the second: within the 0.1 to 3 % of flexure stages.
pub const SHARES: [f64; 2] = [0.01, -0.006];
/// Lines a second of both scans: a triangle of 100 Hz, turns of a circle.
pub const LINES_HZ: f64 = 100.0;
/// Lines of the raster, there and back.
const RASTER_LINES: f64 = 40.0;
/// Turns of the spiral.
const SPIRAL_TURNS: f64 = 20.0;
/// Rise from rest to the first point, and settling there, seconds: as for the other references.
const RISE_S: f64 = 0.02;
const SETTLING_S: f64 = 0.06;
/// The nearest point of the path is looked for as far to either side of the one that is due, seconds: a twentieth of a line.
const NEAR_S: f64 = 0.5e-3;

/// A path of both axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scan {
    /// X goes to and fro in straight lines of 100 Hz while Y goes from one end of the range to the other, 40 lines in 0.4 s.
    Raster,
    /// From the middle outwards, 20 turns at 100 Hz, the last of the range's width.
    Spiral,
}

/// What a controller did on a scan.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ScanFigures {
    /// The controller of both axes.
    pub name: String,
    /// `open` or `closed`.
    #[serde(rename = "loop")]
    pub loop_kind: &'static str,
    /// `raster` or `spiral`.
    pub scan: &'static str,
    /// Rms of reference minus position of the first axis at the same instant, percent of the range.
    pub x_percent: f64,
    /// The same of the second axis.
    pub y_percent: f64,
    /// Rms of the distance of the position from the nearest point of the path, percent of the range: being late along it is none.
    pub path_percent: f64,
    /// Largest such distance, nanometres.
    pub path_largest_nm: f64,
    /// The path and where the stage was, to draw, micrometres.
    #[serde(skip)]
    pub history: [Vec<[f64; 2]>; 2],
}

impl Scan {
    /// Both of them.
    pub const ALL: [Self; 2] = [Self::Raster, Self::Spiral];

    /// Its name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Raster => "raster",
            Self::Spiral => "spiral",
        }
    }

    /// Its length, seconds.
    pub fn seconds(self) -> f64 {
        match self {
            Self::Raster => RASTER_LINES / LINES_HZ,
            Self::Spiral => SPIRAL_TURNS / LINES_HZ,
        }
    }

    /// Both coordinates at a time, as shares of the range.
    fn at(self, time_s: f64) -> [f64; 2] {
        let done = time_s / self.seconds();
        match self {
            Self::Raster => {
                let phase = (LINES_HZ * time_s).fract();
                [1.0 - (2.0 * phase - 1.0).abs(), done]
            }
            Self::Spiral => {
                let (sin, cos) = (TAU * LINES_HZ * time_s).sin_cos();
                [0.5 + 0.5 * done * cos, 0.5 + 0.5 * done * sin]
            }
        }
    }

    /// The reference of both axes, and where the judged part begins.
    fn reference(self, [low_um, high_um]: [f64; 2], period_s: f64) -> (Vec<[f64; 2]>, usize) {
        let point = |time_s: f64| self.at(time_s).map(|share| low_um + (high_um - low_um) * share);
        let samples = |time_s: f64| (time_s / period_s).round() as usize;
        let rise = samples(RISE_S + SETTLING_S);
        let risen = |k: usize| 0.5 * (1.0 - (PI * (k as f64 * period_s / RISE_S).min(1.0)).cos());
        let mut path: Vec<[f64; 2]> = (0..rise).map(|k| point(0.0).map(|first| first * risen(k))).collect();
        path.extend((0..samples(self.seconds())).map(|k| point(k as f64 * period_s)));
        (path, rise)
    }
}

/// Two stages that know nothing of each other become the axes of one.
fn axes(config: &StageConfig, seed: u64) -> Result<[Stage; 2], TrackingError> {
    let beside = |ratio| StageConfig {
        cross_coupling: Some(CrossCoupling {
            ratio,
            lag_s: config.amplifier.lag_s,
            hysteresis: config.hysteresis.clone(),
            mode: config.modes.first().copied(),
        }),
        ..config.clone()
    };
    Ok([
        Stage::new(&beside(SHARES[0]), seed)?,
        Stage::new(&beside(SHARES[1]), seed.wrapping_add(1))?,
    ])
}

fn step(stages: &mut [Stage; 2], [x_v, y_v]: [f64; 2]) {
    let [x, y] = stages;
    x.step_two_axes(x_v, y_v);
    y.step_two_axes(y_v, x_v);
}

/// What of the other axis' motion each sensor shows while its own axis rests: what a user measures to tell the controllers.
///
/// # Errors
/// A stage that cannot be built.
pub fn measured_shares(config: &StageConfig, seed: u64) -> Result<[f64; 2], TrackingError> {
    const SLOW_HZ: f64 = 10.0;
    let top_v = config.hysteresis.reference_v.min(config.amplifier.max_v);
    let mut shares = [0.0; 2];
    for (rests, share) in shares.iter_mut().enumerate() {
        let mut stages = axes(config, seed.wrapping_add(2))?;
        let (mut moved, mut seen) = (Vec::new(), Vec::new());
        // The second of two periods.
        let period = (1.0 / SLOW_HZ / config.sample_period_s).round() as usize;
        for k in 0..2 * period {
            let mut command_v = [0.0; 2];
            command_v[1 - rests] = 0.5 * top_v * (1.0 - (TAU * k as f64 / period as f64).cos());
            step(&mut stages, command_v);
            if k >= period {
                seen.push(stages[rests].sample().position_um);
                moved.push(stages[1 - rests].sample().position_um);
            }
        }
        let n = period as f64;
        let (mean_seen, mean_moved) = (seen.iter().sum::<f64>() / n, moved.iter().sum::<f64>() / n);
        let pairs = || seen.iter().zip(&moved).map(|(s, m)| (s - mean_seen, m - mean_moved));
        *share = pairs().map(|(s, m)| s * m).sum::<f64>() / pairs().map(|(_, m)| m * m).sum::<f64>();
    }
    Ok(shares)
}

/// The controller of one axis while it runs.
enum Axis {
    Complete(Box<(DesignedLaw<f64>, DesignedState<f64>)>),
    Paper(Box<(Law<PLAYS>, PaperState)>),
}

type PaperState = ControlState<f64, PlayState<f64, PLAYS>>;

impl Axis {
    fn new(contender: &Contender<'_>, bench: &Bench<'_>, share: Option<f64>) -> Result<Self, TrackingError> {
        match contender {
            Contender::Complete(law) => {
                let mut law = **law;
                law.surroundings.cross = share;
                let state = law.rest(0.0);
                Ok(Self::Complete(Box::new((law, state))))
            }
            Contender::Paper(controller) => {
                let law: Law<PLAYS> = law(bench.stage, controller.inverse, controller.gains)?;
                let plays = match &law.feedforward {
                    Some(inverse) => inverse.start_at(0.0, 0.0),
                    None => PlayState::virgin(),
                };
                let state = law.start(plays, 0.0);
                Ok(Self::Paper(Box::new((law, state))))
            }
        }
    }

    /// Samples that the reference is known before it is due.
    fn ahead(&self) -> usize {
        match self {
            Self::Complete(running) => running.0.ahead(),
            Self::Paper(_) => 0,
        }
    }

    fn step(&mut self, reference_ahead: f64, motion2_ahead: f64, measured: f64) -> f64 {
        match self {
            Self::Complete(running) => {
                let (law, state) = &mut **running;
                let rest = law.surroundings.rest;
                law.step(
                    state,
                    LoopInput {
                        reference_ahead,
                        measured,
                        motion2_ahead: motion2_ahead - rest,
                        ..LoopInput::default()
                    },
                )
            }
            Self::Paper(running) => {
                let (law, state) = &mut **running;
                law.step(state, reference_ahead, measured)
            }
        }
    }
}

/// Lets a controller of each axis, both alike, drive the stage along a scan. With `shares` the controllers know of the other axis.
///
/// # Errors
/// A stage or controller that cannot be run.
///
/// # Cost
/// 48 000 samples of both axes for the raster, 14 000 for the spiral.
pub(crate) fn scan(
    name: &str,
    loop_kind: &'static str,
    bench: &Bench<'_>,
    contender: &Contender<'_>,
    scan: Scan,
    shares: Option<[f64; 2]>,
) -> Result<ScanFigures, TrackingError> {
    let period_s = bench.stage.sample_period_s;
    let (path, from) = scan.reference(bench.range_um, period_s);
    let mut stages = axes(bench.stage, bench.seed)?;
    let of = |axis: usize| Axis::new(contender, bench, shares.map(|shares| shares[axis]));
    let mut controllers = [of(0)?, of(1)?];
    let ahead = controllers[0].ahead();
    let last = path.last().copied().unwrap_or_default();
    let mut was = Vec::with_capacity(path.len());
    for k in 0..path.len() + ahead {
        if k >= ahead {
            was.push([0, 1].map(|axis| stages[axis].sample().true_position_um));
        }
        let point = path.get(k).copied().unwrap_or(last);
        let commands = [0, 1].map(|axis: usize| {
            let measured = stages[axis].sample().position_um;
            controllers[axis].step(point[axis], point[1 - axis], measured)
        });
        step(&mut stages, commands);
    }
    let run = Scanned {
        name,
        loop_kind,
        scan,
        range_um: bench.range_um,
        period_s,
    };
    Ok(run.figures(&path[from..], &was[from..]))
}

/// What a scan was run with.
#[derive(Debug, Clone, Copy)]
pub struct Scanned<'a> {
    /// The controller of both axes.
    pub name: &'a str,
    /// `open` or `closed`.
    pub loop_kind: &'static str,
    /// The path.
    pub scan: Scan,
    /// Lowest and highest reference, micrometres.
    pub range_um: [f64; 2],
    /// Sample period, seconds.
    pub period_s: f64,
}

impl Scanned<'_> {
    /// The figures of both axes from where they should have been and were, micrometres.
    pub fn figures(&self, path: &[[f64; 2]], was: &[[f64; 2]]) -> ScanFigures {
        let range_um = self.range_um[1] - self.range_um[0];
        let rms = |errors: &mut dyn Iterator<Item = f64>| {
            let (n, sum) = errors.fold((0.0, 0.0), |(n, sum), error| (n + 1.0, sum + error * error));
            100.0 * (sum / f64::max(n, 1.0)).sqrt() / range_um
        };
        let of_axis = |axis: usize| rms(&mut path.iter().zip(was).map(|(r, y)| r[axis] - y[axis]));
        let distances = distances_um(path, was, (NEAR_S / self.period_s).round() as usize);
        ScanFigures {
            name: self.name.to_owned(),
            loop_kind: self.loop_kind,
            scan: self.scan.name(),
            x_percent: of_axis(0),
            y_percent: of_axis(1),
            path_percent: rms(&mut distances.iter().copied()),
            path_largest_nm: 1e3 * distances.iter().copied().fold(0.0, f64::max),
            history: [path.to_vec(), was.to_vec()],
        }
    }
}

/// Distance of each position from the nearest of the path's straight pieces that are due within so many samples.
fn distances_um(path: &[[f64; 2]], was: &[[f64; 2]], near: usize) -> Vec<f64> {
    let mut distances = Vec::with_capacity(was.len());
    for (k, at) in was.iter().enumerate() {
        let pieces = &path[k.saturating_sub(near)..(k + near + 1).min(path.len())];
        let nearest = pieces.windows(2).map(|piece| to_piece_um(*at, piece[0], piece[1]));
        distances.push(nearest.fold(f64::INFINITY, f64::min));
    }
    distances
}

/// Distance of a point from a straight piece.
fn to_piece_um([x, y]: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let squared = dx * dx + dy * dy;
    let along = if squared > 0.0 {
        (((x - from[0]) * dx + (y - from[1]) * dy) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (x - from[0] - along * dx).hypot(y - from[1] - along * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_distance_from_a_path_by_hand() {
        let path = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]];
        // Late along the path is no distance from it; beyond its end it is.
        let was = [[0.0, 0.3], [0.4, 0.0], [1.1, -0.2], [3.3, 0.4]];
        let found = distances_um(&path, &was, 2);
        for (found, wanted) in found.iter().zip([0.3, 0.0, 0.2, 0.5]) {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
        assert_eq!(
            to_piece_um([1.0, 1.0], [1.0, 0.0], [1.0, 0.0]),
            1.0,
            "a piece without length"
        );
    }

    #[test]
    fn val_scans_stay_in_range_and_do_not_jump() {
        for scan in Scan::ALL {
            let (path, from) = scan.reference([3.0, 13.0], 20e-6);
            let all = || path.iter().flatten().copied();
            assert!(all().all(|um| (0.0..=13.0 + 1e-9).contains(&um)), "{scan:?}");
            let reached = path[from..]
                .iter()
                .flatten()
                .copied()
                .fold([f64::INFINITY, 0.0], |[low, high], um| [low.min(um), high.max(um)]);
            // A spiral's last turn ends at the range's edge; the others lie within a turn's pitch of it.
            assert!(reached[0] < 3.3 && reached[1] > 12.7, "{scan:?} {reached:?}");
            let jump = path.windows(2).flat_map(|p| [p[1][0] - p[0][0], p[1][1] - p[0][1]]);
            // 10 um there and back at 100 Hz are 0.04 um a sample, the turn of a circle 10 um wide pi / 2 of that, and a hundredth more
            // for what it widens by.
            assert!(
                jump.fold(0.0, |most: f64, step| most.max(step.abs())) < 0.0635,
                "{scan:?}"
            );
        }
    }
}
