//! Sections 4.3 and 4.4: tracking errors over frequency and bandwidths, in open and in closed loop.

use super::{HIGH_V, fit_inverses, last_periods};
use hysteron_control::figures::RunFigures;
use hysteron_control::figures::Tracked;
use hysteron_control::reference::{Shape, noise};
use hysteron_control::response::{Crossing, Response, response};
use hysteron_identify::{Family, FitReport};
use hysteron_plant::StageConfig;
use hysteron_tracking::TrackingError;
use hysteron_tracking::experiment::{Controller, IDENTIFIED_HZ, sines};
use hysteron_tracking::run::PiGains;
use rayon::prelude::*;

/// Frequencies tracked, hertz: 10 to 500 Hz as in figures 11 and 15. The last is no divisor of the 8 kHz mode of one of
/// the presets, which 500 Hz is.
pub const TRACKED_HZ: [f64; 8] = [10.0, 50.0, 100.0, 200.0, 300.0, 400.0, 500.0, 503.0];

/// Fundamental of the complex harmonic, hertz. The paper does not state it; its third harmonic lies within what was
/// identified.
pub const COMPLEX_HARMONIC_HZ: f64 = 100.0;

/// Band of the noise that bandwidths are measured with, hertz: twice the largest bandwidth of the paper, below the mode.
pub const NOISE_BAND_HZ: f64 = 5000.0;
/// Its rms as a share of the trajectories' range, for the figures: within the range by ten times its rms, and 150 times
/// the sensor's noise.
pub const NOISE_SHARE: f64 = 0.05;
/// Other amplitudes, as the paper states none: 30 times the sensor's noise, and what fills the range.
pub const OTHER_NOISE_SHARES: [f64; 2] = [0.01, 0.15];
/// Its length, seconds: 14 half-overlapping segments of 0.66 s.
const NOISE_S: f64 = 5.0;

/// What a controller consists of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct ControllerName {
    /// The inverse in the feedforward.
    pub inverse: Option<Family>,
    /// Whether there is a PI controller.
    pub feedback: bool,
}

impl core::fmt::Display for ControllerName {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let inverse = self.inverse.map(|family| family.name().to_uppercase());
        match (inverse, self.feedback) {
            (Some(name), false) => f.write_str(&name),
            (Some(name), true) => write!(f, "PI+{name}"),
            (None, true) => f.write_str("PI"),
            (None, false) => f.write_str("nothing"),
        }
    }
}

/// How far one controller is off on one trajectory.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct TrackingFigure {
    /// The controller.
    pub controller: ControllerName,
    /// Fundamental frequency, hertz.
    pub frequency_hz: f64,
    /// Whether the trajectory is the complex harmonic rather than a sine.
    pub complex_harmonic: bool,
    /// The figures.
    pub figures: RunFigures,
    /// Share of the samples on which the command met the amplifier's limits, percent.
    pub limited_percent: f64,
}

/// A controller's response to noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Bandwidth {
    /// The controller.
    pub controller: ControllerName,
    /// The response from reference to reading.
    pub response: Response,
    /// Where it lags by 30 degrees.
    pub lag_30_deg: Option<Crossing>,
    /// Where its gain is -3 dB.
    pub minus_3_db: Option<Crossing>,
    /// Share of the samples on which the command met the amplifier's limits, percent.
    pub limited_percent: f64,
}

/// A short run to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// The controller.
    pub controller: ControllerName,
    /// Two periods at 500 Hz.
    pub run: Tracked,
}

/// A stage with the range that trajectories have on it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bench<'a> {
    pub(super) stage: &'a StageConfig,
    pub(super) seed: u64,
    pub(super) range_um: [f64; 2],
}

type Named<'a> = (ControllerName, Controller<'a>);

/// The open-loop controllers: one for each inverse.
fn open(inverses: &[FitReport]) -> Vec<Named<'_>> {
    inverses.iter().map(|report| of(Some(report), None)).collect()
}

/// The closed-loop controllers: PI alone, then PI with each inverse.
fn closed(inverses: &[FitReport], gains: PiGains) -> Vec<Named<'_>> {
    let inverses = core::iter::once(None).chain(inverses.iter().map(Some));
    inverses.map(|report| of(report, Some(gains))).collect()
}

pub(super) fn of(report: Option<&FitReport>, gains: Option<PiGains>) -> Named<'_> {
    let inverse = report.map(|report| &report.model);
    let name = ControllerName {
        inverse: inverse.map(|model| model.family),
        feedback: gains.is_some(),
    };
    let controller = Controller {
        inverse,
        gains,
        further_samples: 0,
    };
    (name, controller)
}

impl Bench<'_> {
    pub(super) fn open_loop(&self, inverses: &[FitReport]) -> Result<Vec<TrackingFigure>, TrackingError> {
        self.all_shapes(&open(inverses))
    }

    pub(super) fn closed_loop(
        &self,
        inverses: &[FitReport],
        gains: PiGains,
    ) -> Result<Vec<TrackingFigure>, TrackingError> {
        self.all_shapes(&closed(inverses, gains))
    }

    fn all_shapes(&self, controllers: &[Named<'_>]) -> Result<Vec<TrackingFigure>, TrackingError> {
        let sines = TRACKED_HZ.map(|frequency_hz| Shape::Sine { frequency_hz });
        let complex = Shape::ComplexHarmonic {
            frequency_hz: COMPLEX_HARMONIC_HZ,
        };
        let shapes: Vec<Shape> = sines.into_iter().chain([complex]).collect();
        let runs: Vec<(&Named<'_>, Shape)> = controllers
            .iter()
            .flat_map(|controller| shapes.iter().map(move |&shape| (controller, shape)))
            .collect();
        let figures: Result<Vec<Option<TrackingFigure>>, TrackingError> = runs
            .par_iter()
            .map(|&(named, shape)| self.figure(named, shape))
            .collect();
        Ok(figures?.into_iter().flatten().collect())
    }

    /// One run, judged.
    pub(super) fn figure(
        &self,
        (name, controller): &Named<'_>,
        shape: Shape,
    ) -> Result<Option<TrackingFigure>, TrackingError> {
        let (tracked, figures) = controller.judge(self.stage, self.seed, shape, self.range_um)?;
        Ok(figures.map(|figures| TrackingFigure {
            controller: *name,
            frequency_hz: shape.frequency_hz(),
            complex_harmonic: matches!(shape, Shape::ComplexHarmonic { .. }),
            figures,
            limited_percent: tracked.limited_percent(),
        }))
    }

    /// 500 Hz with inverses fitted to four periods of each sine: the other reading of K_j in eq. 17.
    pub(super) fn equal_periods(&self) -> Result<Vec<TrackingFigure>, TrackingError> {
        let four_periods = |f: f64| (4.0 / f / self.stage.sample_period_s).round() as usize;
        let records = sines(self.stage, &IDENTIFIED_HZ, [0.0, HIGH_V], four_periods, self.seed)?;
        let inverses = fit_inverses(&records)?;
        let shape = Shape::Sine { frequency_hz: 500.0 };
        let figures: Result<Vec<_>, _> = open(&inverses).iter().map(|named| self.figure(named, shape)).collect();
        Ok(figures?.into_iter().flatten().collect())
    }

    /// MRPI at 500 Hz with a sample of computing that the records do not have.
    pub(super) fn one_sample_late(&self, inverses: &[FitReport]) -> Result<Option<TrackingFigure>, TrackingError> {
        let Some((name, controller)) = open(inverses).pop() else {
            return Ok(None);
        };
        let late = Controller {
            further_samples: 1,
            ..controller
        };
        self.figure(&(name, late), Shape::Sine { frequency_hz: 500.0 })
    }

    pub(super) fn bandwidths(
        &self,
        inverses: &[FitReport],
        gains: PiGains,
        share: f64,
    ) -> Result<Vec<Bandwidth>, TrackingError> {
        closed(inverses, gains)
            .par_iter()
            .map(|named| self.bandwidth(named, share))
            .collect()
    }

    /// The response of one controller to band-limited noise about the middle of the range, its rms a share of it.
    pub(super) fn bandwidth(&self, (name, controller): &Named<'_>, share: f64) -> Result<Bandwidth, TrackingError> {
        let [low_um, high_um] = self.range_um;
        let rms_um = share * (high_um - low_um);
        let period_s = self.stage.sample_period_s;
        let reference = noise(self.range_um, rms_um, NOISE_BAND_HZ, NOISE_S, self.seed, period_s)?;
        let run = controller.track(self.stage, self.seed, &reference)?;
        let response = response(&run.reference_um, &run.measured_um, period_s, NOISE_BAND_HZ);
        Ok(Bandwidth {
            controller: *name,
            lag_30_deg: response.lag_30_deg(),
            minus_3_db: response.minus_3_db(),
            response,
            limited_percent: run.limited_percent(),
        })
    }

    /// Two periods at 500 Hz of every controller.
    pub(super) fn histories(&self, inverses: &[FitReport], gains: PiGains) -> Result<Vec<History>, TrackingError> {
        let frequency_hz = 500.0;
        let mut controllers = open(inverses);
        controllers.extend(closed(inverses, gains));
        let history = |(name, controller): &Named<'_>| {
            let reference = Shape::Sine { frequency_hz }.reference(self.range_um, self.stage.sample_period_s);
            let run = controller.track(self.stage, self.seed, &reference)?;
            Ok(History {
                controller: *name,
                run: last_periods(&run, 2.0, frequency_hz, self.stage.sample_period_s),
            })
        };
        controllers.par_iter().map(history).collect()
    }
}

/// The figure of one controller's sine at one frequency.
pub fn find(figures: &[TrackingFigure], inverse: Option<Family>, frequency_hz: f64) -> Option<&TrackingFigure> {
    figures.iter().find(|figure| {
        figure.controller.inverse == inverse && figure.frequency_hz == frequency_hz && !figure.complex_harmonic
    })
}
