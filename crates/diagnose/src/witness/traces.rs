//! Records as witnesses without a hysteresis model see them: scaled drive, run-in, rests.

use crate::witness::filters::running_mean;
use hysteron_data::{Dataset, Record};
use hysteron_identify::InitialState;
use hysteron_identify::family::{peak_to_peak, range};
use rayon::prelude::*;

/// Volts and micrometres of what the traces have scaled.
#[derive(Debug, Clone, Copy)]
struct Scales {
    middle_v: f64,
    unit_v: f64,
    middle2_v: f64,
    unit2_v: f64,
    middle_um: f64,
}

/// One record.
#[derive(Debug, Clone)]
pub(crate) struct Trace {
    pub period_s: f64,
    /// Drive scaled to -1 .. 1 over all records; a periodic record has one period of run-in before it.
    pub drive: Vec<f64>,
    /// Position, micrometres, as long as `drive` (in the run-in the first period's).
    pub position_um: Vec<f64>,
    /// First sample of the record itself.
    pub from: usize,
    /// Remanent fraction of the plays at the first sample of `drive`.
    pub fraction: f64,
    pub temperature_c: Option<Vec<f64>>,
    /// Drive of the other axis, scaled to -1 .. 1.
    pub drive2: Option<Vec<f64>>,
    /// Peak to peak of the position; 0 where the drive stands still.
    pub stroke_um: f64,
    /// Position of the rest at the record's start against the other records that start there; 0 where there is no such rest.
    pub start_offset_um: f64,
    /// Standard error of that.
    pub start_error_um: f64,
}

/// The records of a dataset and the scales they share.
#[derive(Debug, Clone)]
pub(crate) struct Traces {
    pub each: Vec<Trace>,
    /// Volts of one unit of the scaled drive.
    pub unit_v: f64,
    /// Largest stroke, micrometres.
    pub stroke_um: f64,
}

impl Traces {
    /// Prepares the records; the state in which each starts is the one that the search found.
    pub(crate) fn new(dataset: &Dataset, states: &[InitialState], noise_um: f64) -> Self {
        let (low, high) = range(dataset.records.iter().flat_map(|r| &r.voltage_v).copied());
        let (middle_v, unit_v) = ((high + low) / 2.0, ((high - low) / 2.0).max(f64::MIN_POSITIVE));
        let other: Vec<&Vec<f64>> = dataset.records.iter().filter_map(|r| r.voltage2_v.as_ref()).collect();
        let (low2, high2) = range(other.iter().copied().flatten().copied());
        let (middle2_v, unit2_v) = ((high2 + low2) / 2.0, ((high2 - low2) / 2.0).max(f64::MIN_POSITIVE));
        let moves = high2 > low2;
        let middle_um = {
            let (low, high) = range(dataset.records.iter().flat_map(|r| &r.position_um).copied());
            (low + high) / 2.0
        };
        let scales = Scales {
            middle_v,
            unit_v,
            middle2_v,
            unit2_v,
            middle_um,
        };
        let mut each: Vec<Trace> = dataset
            .records
            .par_iter()
            .zip(states)
            .map(|(record, &state)| Trace::new(record, state, scales, moves))
            .collect();
        start_offsets(&mut each, noise_um);
        let stroke_um = each.iter().map(|t| t.stroke_um).fold(0.0, f64::max);
        Self {
            each,
            unit_v,
            stroke_um,
        }
    }
}

impl Trace {
    fn new(record: &Record, state: InitialState, scales: Scales, other_moves: bool) -> Self {
        let scale = |v: f64| (v - scales.middle_v) / scales.unit_v;
        let scale2 = |v: f64| (v - scales.middle2_v) / scales.unit2_v;
        let (run_in, fraction) = match state {
            // At the low end of all drives every play has come down with the drive, whatever was before: nothing to run in,
            // and what is slow (creep) starts from rest.
            _ if scale(record.voltage_v[0]) < -1.0 + 2e-3 => (0, 0.0),
            InitialState::Periodic { samples } => (samples, 0.0),
            InitialState::Remanent { fraction } => (0, fraction),
        };
        let extend = |values: &[f64]| -> Vec<f64> { values[..run_in].iter().chain(values).copied().collect() };
        let drive: Vec<f64> = extend(&record.voltage_v).into_iter().map(scale).collect();
        let moves = peak_to_peak(&record.voltage_v) > 0.0;
        Self {
            period_s: record.period_s,
            position_um: extend(&record.position_um)
                .into_iter()
                .map(|y| y - scales.middle_um)
                .collect(),
            from: run_in,
            fraction,
            // Temperature moves in minutes; its sensor's noise would only blur the column.
            temperature_c: record
                .temperature_c
                .as_ref()
                .map(|t| extend(&running_mean(t, (t.len() / 8).max(1)))),
            drive2: match &record.voltage2_v {
                Some(v) if other_moves => Some(extend(v).into_iter().map(scale2).collect()),
                _ => None,
            },
            stroke_um: if moves { peak_to_peak(&record.position_um) } else { 0.0 },
            start_offset_um: 0.0,
            start_error_um: f64::INFINITY,
            drive,
        }
    }

    /// The record's own samples of a series as long as `drive`.
    pub(crate) fn len(&self) -> usize {
        self.drive.len()
    }
}

/// Where records that start at rest at the low end of the drive find the position, against their median.
fn start_offsets(traces: &mut [Trace], noise_um: f64) {
    // Within a thousandth of the span the position has moved by less than a thousandth of the stroke.
    let rest = |t: &Trace| -> usize {
        if t.fraction > 0.0 || t.drive[t.from] > -1.0 + 2e-3 {
            return 0;
        }
        t.drive[t.from..]
            .iter()
            .take_while(|v| (*v - t.drive[t.from]).abs() < 1e-3)
            .take(200)
            .count()
    };
    let mean = |t: &Trace| {
        let n = rest(t);
        (n > 0).then(|| {
            (
                t.position_um[t.from..t.from + n].iter().sum::<f64>() / n as f64,
                noise_um / (n as f64).sqrt(),
            )
        })
    };
    let found: Vec<_> = traces.iter().map(mean).collect();
    let mut levels: Vec<f64> = found.iter().flatten().map(|f| f.0).collect();
    levels.sort_by(f64::total_cmp);
    let Some(&median) = levels.get(levels.len() / 2) else {
        return;
    };
    for (trace, found) in traces.iter_mut().zip(found) {
        if let Some((level, error)) = found {
            trace.start_offset_um = level - median;
            trace.start_error_um = error;
        }
    }
}

/// Whether a position that follows the temperature also moves the zero at the records' starts, as heat does and creep does not;
/// true where the records cannot say. Between records a body follows the air's temperature in part or as a whole.
pub(crate) fn moves_the_zero(traces: &Traces, um_per_k: f64) -> bool {
    let known = traces.each.iter().filter(|t| t.start_error_um.is_finite());
    let starts: Vec<(f64, f64)> = known
        .filter_map(|t| Some((t.start_offset_um, *t.temperature_c.as_ref()?.get(t.from)?)))
        .collect();
    if starts.len() < 4 || um_per_k == 0.0 {
        return true;
    }
    let n = starts.len() as f64;
    let (mean_um, mean_k) = starts.iter().fold((0.0, 0.0), |m, s| (m.0 + s.0 / n, m.1 + s.1 / n));
    let (mut all, mut across, mut foretold) = (0.0, 0.0, 0.0);
    for (offset_um, kelvin) in starts {
        let (offset, moved) = (offset_um - mean_um, um_per_k * (kelvin - mean_k));
        all += offset * offset;
        across += offset * moved;
        foretold += moved * moved;
    }
    let followed = (across / foretold.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let left = all - 2.0 * followed * across + followed * followed * foretold;
    left < 0.5 * all
}
