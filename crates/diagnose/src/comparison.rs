//! What a comparison of model and measurement says: figures for each record, pooled figures, and where the error is.

use hysteron_acquisition::NoiseFloor;
use hysteron_data::Role;
use serde::Serialize;

/// Figures pooled over the records of one role: root mean square over records.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pooled {
    /// Eq. 19, percent of peak to peak.
    pub nrmse_percent: f64,
    /// `100 (1 - |y - ŷ| / |y - mean y|)`, from the pooled ratio, as MATLAB's `compare`.
    pub fit_percent: f64,
    /// Error, micrometres rms.
    pub rms_um: f64,
    /// Number of records in the pool (records that do not move have no percentage and are left out).
    pub records: usize,
}

/// Model against measurement in one record, free simulation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordComparison {
    /// File of the record.
    pub file: String,
    /// Its role.
    pub role: Role,
    /// Eq. 19, percent of peak to peak; `null` where the output does not move.
    pub nrmse_percent: Option<f64>,
    /// Fit percent; `null` where the output does not move.
    pub fit_percent: Option<f64>,
    /// Error, micrometres rms (volts rms for an inverse model).
    pub rms_um: f64,
    /// Largest error, micrometres (volts for an inverse model).
    pub max_um: f64,
    /// Error over noise floor, both rms.
    pub noise_ratio: f64,
    /// Number of samples.
    pub samples: usize,
    /// How the record's start was taken: `periodic`, or `remanent 0.35`.
    pub initial_state: String,
    /// Whether a number of it was chosen to fit, since the drive does not give it.
    #[serde(skip)]
    pub start_estimated: bool,
    /// The series themselves, for pictures.
    #[serde(skip)]
    pub series: Series,
}

/// The series behind a record's figures. All of one length.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Time of the first sample, seconds.
    pub start_s: f64,
    /// Sample period, seconds.
    pub period_s: f64,
    /// Input of the model: volts (forward) or micrometres (inverse).
    pub input: Vec<f64>,
    /// Measured output: micrometres (forward) or volts (inverse).
    pub measured: Vec<f64>,
    /// Modelled output, same unit.
    pub modelled: Vec<f64>,
}

impl Series {
    /// Time of a sample, seconds.
    pub fn at_s(&self, sample: usize) -> f64 {
        self.start_s + sample as f64 * self.period_s
    }
}

impl Comparison {
    /// The noise floor in words, in the output's unit.
    pub fn noise_in_words(&self) -> String {
        self.noise.in_words(self.noise_rms_um, self.output_unit)
    }

    /// What the model takes away of a straight line's error, in one sentence.
    pub fn beside_a_straight_line(&self) -> Option<String> {
        let (line, judged) = (self.straight_line?, self.validate.or(self.identify)?);
        let kept = judged.nrmse_percent / line.nrmse_percent;
        let takes = format!("the model takes away {:.0} % of that error", 100.0 * (1.0 - kept));
        let verdict = match kept {
            1.0.. => "the model is no better".to_owned(),
            0.7.. => format!("{takes}: hysteresis of this kind barely helps"),
            _ => takes,
        };
        Some(format!(
            "a straight line is off by {:.2} % there: {verdict}",
            line.nrmse_percent
        ))
    }
}

/// The share of the squared error in one bin of one quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bin {
    /// Lower edge.
    pub from: f64,
    /// Upper edge.
    pub to: f64,
    /// Share of the whole squared error, percent.
    pub share_percent: f64,
    /// Share of the samples (for frequency: of the measured motion's power), percent; each record counts the same.
    pub samples_percent: f64,
    /// Error in the bin, rms, output unit.
    pub rms_um: f64,
    /// Mean of the error (measured minus modelled) in the bin, output unit.
    pub mean_um: f64,
}

/// How the error is distributed over one quantity, pooled over all records.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Breakdown {
    /// `frequency`, `amplitude`, `position`, `speed`, `direction`, `time`, `temperature`.
    pub by: &'static str,
    /// Unit of the edges.
    pub unit: &'static str,
    /// The bins, ascending; empty bins are left out.
    pub bins: Vec<Bin>,
    /// One sentence: where the error is out of proportion, or that it is even.
    pub finding: String,
}

/// Mean error over position (columns) and input rate (rows).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorMap {
    /// Column edges: measured position, micrometres, ascending.
    pub position_edges_um: Vec<f64>,
    /// Row edges: rate of the position's drive, output units per second, ascending through zero.
    pub rate_edges_um_per_s: Vec<f64>,
    /// Error rms of each cell, row by row; `None` where no sample fell.
    pub rms_um: Vec<Vec<Option<f64>>>,
    /// Where the error of each cell is largest: the samples about it that fall in the same cell.
    pub worst: Vec<Vec<Option<Stretch>>>,
}

/// A stretch of a record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stretch {
    /// The record.
    pub file: String,
    /// Its first sample, seconds.
    pub from_s: f64,
    /// Its last one, seconds.
    pub to_s: f64,
}

impl Stretch {
    /// Samples `first` to `last` of a record.
    pub(crate) fn of(record: &RecordComparison, first: usize, last: usize) -> Self {
        Self {
            file: record.file.clone(),
            from_s: record.series.at_s(first),
            to_s: record.series.at_s(last),
        }
    }
}

/// Error over the frequency (columns) and amplitude (rows) of the swing that it lies in.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SwingMap {
    /// Column edges: frequency of the swing, hertz, ascending.
    pub frequency_edges_hz: Vec<f64>,
    /// Row edges: amplitude of the swing, half its height, output unit, ascending.
    pub amplitude_edges_um: Vec<f64>,
    /// Error rms of each cell, row by row; `None` where no swing fell.
    pub rms_um: Vec<Vec<Option<f64>>>,
    /// The swing of each cell that has the largest error rms.
    pub worst: Vec<Vec<Option<Stretch>>>,
}

/// Amplitude spectral densities, one-sided, pooled over records.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Spectrum {
    /// Frequencies, hertz, ascending.
    pub frequency_hz: Vec<f64>,
    /// Of the error, output unit per square root of hertz.
    pub residual_um_per_rthz: Vec<f64>,
    /// Of the measured output.
    pub measured_um_per_rthz: Vec<f64>,
    /// Of the noise floor (white at the noise's rms where only its rms is known).
    pub noise_um_per_rthz: Vec<f64>,
}

/// The whole answer of `compare`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Noise floor, micrometres rms; for an inverse model volts rms, by the mean slope of the records.
    pub noise_rms_um: f64,
    /// The noise floor of the position: what it is worth and rests on.
    pub noise: NoiseFloor,
    /// Pooled over the records that the role `identify` marks.
    pub identify: Option<Pooled>,
    /// Pooled over the records that the role `validate` marks.
    pub validate: Option<Pooled>,
    /// What a straight line from input to output reaches on the records that judge the model (role `validate`, else
    /// `identify`), fitted to those with role `identify`: what the model adds to it is what hysteresis explains.
    pub straight_line: Option<Pooled>,
    /// Each record.
    pub records: Vec<RecordComparison>,
    /// Where the error is.
    pub r#where: Vec<Breakdown>,
    /// The error over position and rate.
    pub error_map: ErrorMap,
    /// The error over frequency and amplitude.
    pub swing_map: SwingMap,
    /// The error's spectrum against the noise floor, pooled over records of the most common sample rate.
    #[serde(skip)]
    pub spectrum: Spectrum,
    /// Unit of the compared output: `um`, or `V` for an inverse model.
    pub output_unit: &'static str,
    /// What the user should know of how this was computed.
    pub notices: Vec<String>,
}
