//! The paper's section 4 on one simulated stage: identification, open loop, closed loop, bandwidth.

mod feedback;
mod modelling;
mod rivals;
mod tracking;

use hysteron_control::figures::Tracked;
use hysteron_data::Dataset;
use hysteron_identify::objective::measured_opening;
use hysteron_identify::{Family, FitOptions, FitReport, fit, loop_opening};
use hysteron_plant::opening::loop_opening as mid_stroke_opening;
use hysteron_plant::{StageConfig, StageError};
use hysteron_tracking::TrackingError;
use hysteron_tracking::experiment::{IDENTIFIED_HZ, RECORD_S, common_range_um, sines};

pub use feedback::{PUBLISHED_PI_HZ, PiReading, chosen_reading};
pub use modelling::{ModellingError, SwarmRace, first_play_lead_s, race};
pub use rivals::{RIVALS_HZ, RivalRow, rivals};
pub use tracking::{
    Bandwidth, COMPLEX_HARMONIC_HZ, ControllerName, History, NOISE_BAND_HZ, NOISE_SHARE, OTHER_NOISE_SHARES,
    TRACKED_HZ, TrackingFigure, find,
};

/// The sine's highest voltage, volts: "fixed amplitude (26 V)".
pub const HIGH_V: f64 = 26.0;
/// Share of the range that trajectories keep away from either end. At 0 V the amplifier ends, and an inverse that leads has
/// to go below where the records went.
pub const INSET: f64 = 0.02;
/// The inverses compared.
pub const FAMILIES: [Family; 3] = [Family::Mpi, Family::Wrpi, Family::Mrpi];

/// Everything the paper measured, on one stage.
#[derive(Debug, Clone)]
pub struct Study {
    /// Name of the preset.
    pub preset: &'static str,
    /// The stage.
    pub stage: StageConfig,
    /// The three sines.
    pub records: Dataset,
    /// Loop openings at mid stroke, percent: what the presets are calibrated to.
    pub openings_percent: [f64; 3],
    /// Loop openings where the loop is widest, percent: what eq. 18 takes here.
    pub widest_percent: [f64; 3],
    /// Weights of eq. 18.
    pub weights: [f64; 3],
    /// Range of all trajectories, micrometres: what every record reaches, less [`INSET`] at either end.
    pub range_um: [f64; 2],
    /// Inverses by separable least squares, in the order of [`FAMILIES`].
    pub inverses: Vec<FitReport>,
    /// How far the inverse MRPI is off on the records it was fitted to.
    pub modelling: ModellingError,
    /// Open loop: each family at each frequency, and the complex harmonic.
    pub open_loop: Vec<TrackingFigure>,
    /// Open loop at 500 Hz with inverses fitted to as many periods of each sine instead of as many samples.
    pub open_loop_equal_periods: Vec<TrackingFigure>,
    /// Open loop at 500 Hz, MRPI, one sample of computing more than in the records.
    pub open_loop_one_sample_late: Option<TrackingFigure>,
    /// PI control under each reading of the gains' units.
    pub readings: Vec<PiReading>,
    /// The reading used: an index into `readings`.
    pub reading: usize,
    /// Closed loop: each controller at each frequency, and the complex harmonic.
    pub closed_loop: Vec<TrackingFigure>,
    /// Bandwidth of each controller, with noise of [`NOISE_SHARE`].
    pub bandwidths: Vec<Bandwidth>,
    /// The same with noise of [`OTHER_NOISE_SHARES`].
    pub other_bandwidths: [Vec<Bandwidth>; 2],
    /// Runs to draw: 500 Hz in open and closed loop.
    pub histories: Vec<History>,
}

/// Redoes the paper on one stage. `progress` is called with the share done, 0 to 1.
///
/// # Errors
/// A stage that cannot be simulated, records that no model can be fitted to.
///
/// # Cost
/// About 6 million samples of stage and controller, a few seconds; [`race`] costs more.
pub fn study(
    preset: &'static str,
    stage: &StageConfig,
    seed: u64,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Study, TrackingError> {
    let (records, range_um) = identified(stage, seed)?;
    let inverses = fit_inverses(&records)?;
    progress(0.1);
    let modelling = modelling::error(&records, &inverses[2].model);
    let bench = tracking::Bench { stage, seed, range_um };
    let open_loop = bench.open_loop(&inverses)?;
    progress(0.25);
    let readings = feedback::readings(&bench)?;
    progress(0.4);
    let reading = chosen_reading(&readings);
    let gains = readings[reading].gains;
    let closed_loop = bench.closed_loop(&inverses, gains)?;
    progress(0.55);
    let bandwidths = bench.bandwidths(&inverses, gains, NOISE_SHARE)?;
    progress(0.7);
    let [small, large] = OTHER_NOISE_SHARES;
    let other_bandwidths = [
        bench.bandwidths(&inverses, gains, small)?,
        bench.bandwidths(&inverses, gains, large)?,
    ];
    progress(0.95);
    let histories = bench.histories(&inverses, gains)?;
    let widest_percent = by_record(&records, |record| measured_opening(record).unwrap_or(f64::NAN));
    let weights = loop_opening::weights(&widest_percent.map(Some));
    let study = Study {
        preset,
        stage: stage.clone(),
        openings_percent: mid_stroke(&records)?,
        widest_percent,
        weights: core::array::from_fn(|i| weights[i]),
        range_um,
        modelling,
        open_loop,
        open_loop_equal_periods: bench.equal_periods()?,
        open_loop_one_sample_late: bench.one_sample_late(&inverses)?,
        readings,
        reading,
        closed_loop,
        bandwidths,
        other_bandwidths,
        histories,
        inverses,
        records,
    };
    progress(1.0);
    Ok(study)
}

/// The three sines, and the range of all trajectories.
fn identified(stage: &StageConfig, seed: u64) -> Result<(Dataset, [f64; 2]), TrackingError> {
    let samples = (RECORD_S / stage.sample_period_s).round() as usize;
    let records = sines(stage, &IDENTIFIED_HZ, [0.0, HIGH_V], |_| samples, seed)?;
    let [low_um, high_um] = common_range_um(&records).ok_or_else(|| StageError::Conflict {
        what: format!("the stage reaches no position at all of {IDENTIFIED_HZ:?} Hz"),
        advice: "give a stage that moves",
    })?;
    let inset_um = INSET * (high_um - low_um);
    Ok((records, [low_um + inset_um, high_um - inset_um]))
}

/// The three inverses by the paper's objective.
fn fit_inverses(records: &Dataset) -> Result<Vec<FitReport>, TrackingError> {
    let fitted = FAMILIES.map(|family| fit(records, &FitOptions::paper(family), &|_| ()));
    fitted.into_iter().map(|report| Ok(report?)).collect()
}

fn by_record(records: &Dataset, figure: impl Fn(&hysteron_data::Record) -> f64) -> [f64; 3] {
    core::array::from_fn(|i| records.records.get(i).map_or(f64::NAN, &figure))
}

/// Loop openings at mid stroke, percent.
fn mid_stroke(records: &Dataset) -> Result<[f64; 3], TrackingError> {
    let mut openings = [f64::NAN; 3];
    for (opening, record) in openings.iter_mut().zip(&records.records) {
        *opening = 100.0 * mid_stroke_opening(&record.voltage_v, &record.position_um)?;
    }
    Ok(openings)
}

/// The last `periods` of a run, for a picture.
fn last_periods(run: &Tracked, periods: f64, frequency_hz: f64, period_s: f64) -> Tracked {
    let samples = (periods / frequency_hz / period_s).round() as usize + 1;
    run.from(run.reference_um.len().saturating_sub(samples))
}
