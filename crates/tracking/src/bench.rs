//! The references that controllers are held to, each controller beside the others on the same stage.

use crate::complete;
use crate::error::TrackingError;
use crate::experiment::{self, IDENTIFIED_HZ, RECORD_S, Reading, sines};
use crate::run::PiGains;
use crate::scans::{Scan, ScanFigures, measured_shares, scan};
use hysteron_control::adapted::{Adaptation, Adapted};
use hysteron_control::design::{Controller, DesignedLaw};
use hysteron_control::expected::SWINGS_PERCENT;
use hysteron_control::figures::{Steps, Tracked, judge, steps};
use hysteron_control::learning::LearnedReference;
use hysteron_control::reference::{Reference, SHAPES};
use hysteron_control::response::{Response, line_response};
use hysteron_excitation::{Excitation, Multisine, with_rise};
use hysteron_identify::{Family, FitOptions, FitReport, fit};
use hysteron_plant::{StageConfig, StageError};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The reference whose run is kept to be drawn.
const DRAWN: &str = "500";
/// Highest line of the multisine that bandwidths are measured with, hertz.
const MULTISINE_HZ: f64 = 10e3;
/// Twice the first mode is enough: lines above it would only take amplitude from those below.
const MULTISINE_MODES: f64 = 2.0;
/// Its largest deviation as a share of the range: with some hundred lines the rms is a quarter of that, 1 %.
const MULTISINE_SHARE: f64 = 0.04;
/// Its period, seconds: lines 20 Hz apart, less than the width of a mode at 1 kHz with 2 % damping.
const MULTISINE_PERIOD_S: f64 = 0.1;
/// Periods before those that are judged: 0.5 s, in which rise and ringing are over and fast creep stands.
const SETTLING_PERIODS: u32 = 5;
/// Periods judged.
const JUDGED_PERIODS: u32 = 4;
/// Length of the rise from rest to where a reference begins, half a cosine, seconds.
const RISE_S: f64 = 0.02;
/// Name of the staircase among references.
pub const STAIRCASE: &str = "staircase";
/// Length of each hold of the staircase, seconds.
const HOLD_S: f64 = 10.0;
/// Length of each of its moves, half a cosine, seconds.
const MOVE_S: f64 = 10e-3;
/// Time after a move from which creep is judged, seconds.
const JUDGED_AFTER_S: f64 = 5e-3;

/// Size of a set-point step as a share of the range: a micrometre of ten.
const STEP_SHARE: f64 = 0.1;
/// Length of the hold after it, seconds.
const STEP_HOLD_S: f64 = 0.2;
/// A step has settled when the error stays below this share of it.
const STEP_BAND: f64 = 0.01;

/// Rms at rest above which a loop counts as unstable, as a share of the references' peak to peak: a loop that oscillates
/// swings by percents; the noise of a stable one is below 1e-4.
const OSCILLATES: f64 = 1e-3;

/// What one controller did.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ControllerFigures {
    /// The controller.
    pub name: String,
    /// `open` or `closed`.
    #[serde(rename = "loop")]
    pub loop_kind: &'static str,
    /// Rms of reference minus position over whole periods, percent of the reference's peak to peak, by reference.
    pub rms_percent: BTreeMap<String, f64>,
    /// What the law had learned of gain and zero at the end of each of these runs, and of the staircase, [`STAIRCASE`]; empty where it does not
    /// learn.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub adapted: BTreeMap<String, Adapted>,
    /// Lag of 30 degrees, hertz; none where there is none up to twice the first mode and 10 kHz.
    pub lag30_hz: Option<f64>,
    /// Gain of -3 dB, hertz.
    pub minus3db_hz: Option<f64>,
    /// Rms of the position at rest about its own drift, nanometres.
    pub noise_nm: f64,
    /// Largest error from 5 ms after each move of a staircase with 10 s holds, percent of its range; not measured for the
    /// paper's controllers without an inverse.
    pub creep_peak_percent: Option<f64>,
    /// Time from a set-point step, a jump of a tenth of the range in its middle, up or down, until the error stays below 1 % of it,
    /// milliseconds, the longer one; none where it does not within 0.2 s.
    pub step_settling_ms: Option<f64>,
    /// How far the position goes beyond the new set-point, percent of the step, the larger one.
    pub step_overshoot_percent: f64,
    /// Whether it came to rest, and swings no further than it is asked to on any reference.
    pub stable: bool,
    /// References on which the command met the amplifier's limits for more than 1 % of the time, and steps on which it met them at all.
    #[serde(skip)]
    pub limited_on: Vec<String>,
    /// Two periods at 500 Hz, to draw.
    #[serde(skip)]
    pub history: Tracked,
    /// The response to the small multisine, to draw.
    #[serde(skip)]
    pub response: Response,
}

/// Every controller on one stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct TrackReport {
    /// The stage.
    pub stage: String,
    /// Its first mode as identified, hertz; none for a rigid one.
    pub first_mode_hz: Option<f64>,
    /// Peak to peak of the references, micrometres.
    pub stroke_um: f64,
    /// `true` position or `measured`.
    pub position: &'static str,
    /// The controllers.
    pub controllers: Vec<ControllerFigures>,
    /// Bounds of what the designed controller learns of gain and zero; none where it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<Adaptation>,
    /// Iterative learning of references that repeat, open loop; empty where none was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub learned: Vec<LearnedReference>,
    /// The same on scans of both axes, which couple.
    pub scans: Vec<ScanFigures>,
    /// Sample period of the histories, seconds.
    #[serde(skip)]
    pub period_s: f64,
    /// What of the other axis' motion reaches each, as measured before the scans, um/um.
    pub measured_shares: [f64; 2],
}

/// What a run along the staircase came to.
struct Staircase {
    creep_peak_percent: f64,
    adapted: Option<Adapted>,
}

/// A controller ready to run.
pub(crate) enum Contender<'a> {
    Complete(Box<DesignedLaw<f64>>),
    Paper(experiment::Controller<'a>),
}

/// The stage, the range of the references, and the seed of noise.
#[derive(Debug, Clone, Copy)]
pub struct Bench<'a> {
    /// The stage.
    pub stage: &'a StageConfig,
    /// Seed of sensor noise and of the multisine for bandwidths.
    pub seed: u64,
    /// Lowest and highest reference, micrometres.
    pub range_um: [f64; 2],
    /// The first mode, hertz, as far as it is known: bandwidths are looked for up to twice it.
    pub first_mode_hz: Option<f64>,
}

/// Holds a designed controller, open and closed, and the paper's controllers to all references.
///
/// # Errors
/// A stage or controller that cannot be run, sines that the paper's inverses cannot be fitted to.
///
/// # Cost
/// About 6 million samples of stage and controller, some 10 s on two cores.
pub fn compare(
    name: &str,
    bench: &Bench<'_>,
    controller: &Controller,
    with_paper: bool,
) -> Result<TrackReport, TrackingError> {
    let closed = controller.law::<f64>()?;
    let open = controller.without_feedback().law::<f64>()?;
    let mut contenders = vec![(
        "complete feedforward".to_owned(),
        "open",
        Contender::Complete(Box::new(open)),
    )];
    if closed.feedback().is_some() {
        contenders.push((
            "complete feedforward + feedback".to_owned(),
            "closed",
            Contender::Complete(Box::new(closed)),
        ));
    }
    let inverses = if with_paper {
        bench.paper_inverses()?
    } else {
        Vec::new()
    };
    let gains = Reading::ActuatorVoltsPerMicrometre.gains(bench.stage);
    if with_paper {
        for report in &inverses {
            let name = format!("paper's {}", report.model.family.name().to_uppercase());
            contenders.push((name, "open", Contender::of_paper(Some(report), None)));
        }
        contenders.push((
            "paper's PI".to_owned(),
            "closed",
            Contender::of_paper(None, Some(gains)),
        ));
        for report in &inverses {
            let name = format!("paper's PI + {}", report.model.family.name().to_uppercase());
            contenders.push((name, "closed", Contender::of_paper(Some(report), Some(gains))));
        }
    }
    let controllers: Result<Vec<ControllerFigures>, TrackingError> = contenders
        .par_iter()
        .map(|(name, loop_kind, contender)| bench.figures(name, loop_kind, contender))
        .collect();
    let measured_shares = measured_shares(bench.stage, bench.seed)?;
    Ok(TrackReport {
        scans: scans(bench, &contenders, measured_shares)?,
        measured_shares,
        adaptation: controller.adaptation.clone(),
        learned: Vec::new(),
        period_s: bench.period_s(),
        stage: name.to_owned(),
        first_mode_hz: bench.first_mode_hz,
        stroke_um: bench.range_um[1] - bench.range_um[0],
        position: "true",
        controllers: controllers?,
    })
}

/// Name of a complete law that is not told of the other axis.
const UNAWARE: &str = ", not told of the other axis";

/// Every controller on every scan; the complete one in open loop also without knowing of the other axis.
fn scans(
    bench: &Bench<'_>,
    contenders: &[(String, &'static str, Contender<'_>)],
    shares: [f64; 2],
) -> Result<Vec<ScanFigures>, TrackingError> {
    let mut runs = Vec::new();
    for kind in Scan::ALL {
        for (name, loop_kind, contender) in contenders {
            let aware = matches!(contender, Contender::Complete(_));
            if aware && *loop_kind == "open" {
                runs.push((kind, format!("{name}{UNAWARE}"), *loop_kind, contender, None));
            }
            runs.push((kind, name.clone(), *loop_kind, contender, aware.then_some(shares)));
        }
    }
    runs.par_iter()
        .map(|(kind, name, loop_kind, contender, shares)| scan(name, loop_kind, bench, contender, *kind, *shares))
        .collect()
}

impl<'a> Contender<'a> {
    fn of_paper(report: Option<&'a FitReport>, gains: Option<PiGains>) -> Self {
        Self::Paper(experiment::Controller {
            inverse: report.map(|report| &report.model),
            gains,
            further_samples: 0,
        })
    }

    /// The judged part of a run.
    pub(crate) fn track(&self, bench: &Bench<'_>, reference: &Reference) -> Result<Tracked, TrackingError> {
        match self {
            Self::Complete(law) => {
                Ok(complete::track(bench.stage, bench.seed, law, reference)?.from(reference.judged_from))
            }
            Self::Paper(controller) => controller.track(bench.stage, bench.seed, reference),
        }
    }
}

impl Bench<'_> {
    fn period_s(&self) -> f64 {
        self.stage.sample_period_s
    }

    /// MPI and MRPI as the paper identifies them, on sines at 10, 100 and 500 Hz, here over the range of the references and a
    /// tenth more: the paper's inverses have no memory of larger loops to fit.
    fn paper_inverses(&self) -> Result<Vec<FitReport>, TrackingError> {
        let top_v = self.stage.hysteresis.reference_v.min(self.stage.amplifier.max_v);
        let stroke_um = self.stage.hysteresis.stroke_um;
        let margin_um = 0.1 * (self.range_um[1] - self.range_um[0]);
        let voltage = |position_um: f64| (position_um / stroke_um * top_v).clamp(0.0, top_v);
        let range_v = [
            voltage(self.range_um[0] - margin_um),
            voltage(self.range_um[1] + margin_um),
        ];
        let samples = (RECORD_S / self.period_s()).round() as usize;
        let records = sines(self.stage, &IDENTIFIED_HZ, range_v, |_| samples, self.seed)?;
        [Family::Mpi, Family::Mrpi]
            .into_iter()
            .map(|family| Ok(fit(&records, &FitOptions::paper(family), &|_| ())?))
            .collect()
    }

    fn figures(
        &self,
        name: &str,
        loop_kind: &'static str,
        contender: &Contender<'_>,
    ) -> Result<ControllerFigures, TrackingError> {
        let mut rms_percent = BTreeMap::new();
        let mut adapted = BTreeMap::new();
        let mut limited_on = Vec::new();
        let mut history = None;
        for (key, shape) in SHAPES {
            let run = contender.track(self, &shape.reference(self.range_um, self.period_s()))?;
            if run.limited_percent() > 1.0 {
                limited_on.push(key.to_owned());
            }
            let figures = judge(&run, self.period_s()).ok_or_else(|| StageError::Conflict {
                what: format!("the reference {key} does not move"),
                advice: "give a range whose second end lies above its first",
            })?;
            rms_percent.insert(key.to_owned(), figures.true_percent);
            adapted.extend(run.adapted.map(|learned| (key.to_owned(), learned)));
            if key == DRAWN {
                let two_periods = (2.0 / shape.frequency_hz() / self.period_s()).round() as usize;
                history = Some(run.from(run.reference_um.len().saturating_sub(two_periods + 1)));
            }
        }
        let run = contender.track(self, &self.multisine()?)?;
        let found = line_response(
            &run.reference_um,
            &run.true_um,
            self.period_s(),
            JUDGED_PERIODS as usize,
        );
        let (steps, limited) = self.steps(contender)?;
        if limited {
            limited_on.push("steps".to_owned());
        }
        let noise_nm = self.noise_at_rest_nm(contender)?;
        let lost = rms_percent
            .values()
            .any(|percent| percent.is_nan() || *percent >= SWINGS_PERCENT);
        let has_inverse = !matches!(contender, Contender::Paper(controller) if controller.inverse.is_none());
        let staircase = has_inverse.then(|| self.staircase(contender)).transpose()?;
        let on_stairs = staircase.as_ref().and_then(|staircase| staircase.adapted);
        adapted.extend(on_stairs.map(|learned| (STAIRCASE.to_owned(), learned)));
        Ok(ControllerFigures {
            name: name.to_owned(),
            loop_kind,
            rms_percent,
            adapted,
            lag30_hz: found.lag_30_deg().map(|crossing| crossing.frequency_hz),
            minus3db_hz: found.minus_3_db().map(|crossing| crossing.frequency_hz),
            noise_nm,
            stable: self.rests(noise_nm) && !lost,
            creep_peak_percent: staircase.map(|staircase| staircase.creep_peak_percent),
            step_settling_ms: steps.settling_s.map(|settling_s| 1e3 * settling_s),
            step_overshoot_percent: 100.0 * steps.overshoot,
            limited_on,
            history: history.unwrap_or_default(),
            response: found,
        })
    }

    /// Whether what is left at rest, nanometres rms, is noise: a loop that oscillates swings until the amplifier or the hysteresis limits it.
    pub(crate) fn rests(&self, rest_nm: f64) -> bool {
        rest_nm < 1e3 * OSCILLATES * (self.range_um[1] - self.range_um[0])
    }

    /// A small multisine in the middle of the range, settled.
    fn multisine(&self) -> Result<Reference, TrackingError> {
        let [low_um, high_um] = self.range_um;
        // The generator of commands knows numbers; its volts are micrometres here.
        let multisine = Multisine {
            low_hz: 20.0,
            high_hz: MULTISINE_HZ
                .min(MULTISINE_MODES * self.first_mode_hz.unwrap_or(f64::INFINITY))
                .min(0.2 / self.period_s()),
            period_s: MULTISINE_PERIOD_S,
            periods: SETTLING_PERIODS + JUDGED_PERIODS,
            bias_v: 0.5 * (low_um + high_um),
            peak_v: MULTISINE_SHARE * (high_um - low_um),
            seed: self.seed,
        };
        let samples_um = with_rise(&multisine.samples(self.period_s())?, RISE_S, self.period_s())?;
        let judged = (f64::from(JUDGED_PERIODS) * MULTISINE_PERIOD_S / self.period_s()).round() as usize;
        Ok(Reference {
            judged_from: samples_um.len() - judged,
            samples_um,
            ..Reference::default()
        })
    }

    /// Rms about a straight line over the last 0.2 s of a second at rest in the middle of the range.
    pub(crate) fn noise_at_rest_nm(&self, contender: &Contender<'_>) -> Result<f64, TrackingError> {
        let middle_um = 0.5 * (self.range_um[0] + self.range_um[1]);
        let samples = |time_s: f64| (time_s / self.period_s()).round() as usize;
        let mut samples_um: Vec<f64> = half_cosine(0.0, middle_um, samples(RISE_S)).collect();
        samples_um.resize(samples(1.0), middle_um);
        let reference = Reference {
            samples_um,
            judged_from: samples(0.8),
            ..Reference::default()
        };
        let run = contender.track(self, &reference)?;
        Ok(1e3 * rms_about_a_line(&run.true_um))
    }

    /// A jump up and one down, about the middle of the range; whether the command met the amplifier's limits on them.
    fn steps(&self, contender: &Contender<'_>) -> Result<(Steps, bool), TrackingError> {
        let [low_um, high_um] = self.range_um;
        let middle_um = 0.5 * (low_um + high_um);
        let (below_um, above_um) = (
            middle_um - 0.5 * STEP_SHARE * (high_um - low_um),
            middle_um + 0.5 * STEP_SHARE * (high_um - low_um),
        );
        let samples = |time_s: f64| (time_s / self.period_s()).round() as usize;
        let (rise, hold) = (samples(RISE_S), samples(STEP_HOLD_S));
        let mut samples_um: Vec<f64> = half_cosine(0.0, below_um, rise).collect();
        for level_um in [below_um, below_um, above_um, below_um] {
            samples_um.extend(std::iter::repeat_n(level_um, hold));
        }
        let run = contender.track(
            self,
            &Reference {
                samples_um,
                judged_from: rise + hold,
                ..Reference::default()
            },
        )?;
        let found = steps(&run.reference_um, &run.true_um, self.period_s(), STEP_BAND);
        Ok((found, run.limited.contains(&true)))
    }

    /// 10 s at the middle, the top, the bottom and the middle again.
    fn staircase(&self, contender: &Contender<'_>) -> Result<Staircase, TrackingError> {
        let [low_um, high_um] = self.range_um;
        let middle_um = 0.5 * (low_um + high_um);
        let samples = |time_s: f64| (time_s / self.period_s()).round() as usize;
        let (moving, holding, after) = (samples(MOVE_S), samples(HOLD_S), samples(JUDGED_AFTER_S));
        let mut samples_um = Vec::with_capacity(4 * (moving + holding));
        let mut judged = Vec::new();
        for pair in [0.0, middle_um, high_um, low_um, middle_um].windows(2) {
            samples_um.extend(half_cosine(pair[0], pair[1], moving));
            judged.push(samples_um.len() + after..samples_um.len() + holding);
            samples_um.extend(std::iter::repeat_n(pair[1], holding));
        }
        let run = contender.track(
            self,
            &Reference {
                samples_um,
                judged_from: 0,
                ..Reference::default()
            },
        )?;
        let largest = judged
            .into_iter()
            .flatten()
            .map(|k| (run.reference_um[k] - run.true_um[k]).abs())
            .fold(0.0, f64::max);
        Ok(Staircase {
            creep_peak_percent: 100.0 * largest / (high_um - low_um),
            adapted: run.adapted,
        })
    }
}

/// A move of so many samples from one level to another.
fn half_cosine(from_um: f64, to_um: f64, samples: usize) -> impl Iterator<Item = f64> {
    (0..samples).map(move |k| {
        let share = 0.5 * (1.0 - (std::f64::consts::PI * k as f64 / samples as f64).cos());
        from_um + (to_um - from_um) * share
    })
}

/// Rms of what is left of values about their least-squares line.
fn rms_about_a_line(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let mean = values.iter().sum::<f64>() / n;
    let slope = values
        .iter()
        .enumerate()
        .map(|(k, y)| (k as f64 - middle) * (y - mean))
        .sum::<f64>()
        / values
            .iter()
            .enumerate()
            .map(|(k, _)| (k as f64 - middle).powi(2))
            .sum::<f64>();
    let left = values
        .iter()
        .enumerate()
        .map(|(k, y)| (y - mean - slope * (k as f64 - middle)).powi(2));
    (left.sum::<f64>() / n).sqrt()
}
