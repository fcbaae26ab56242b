//! Records as the search for missing effects sees them: scaled drive, run-in, the rows that are looked at.

use crate::missing::filters::running_mean;
use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::effects::late;
use hysteron_identify::family::{peak_to_peak, range};
use hysteron_identify::initial::rested;
use hysteron_identify::{EffectId, InitialState, Model, grid};
use rayon::prelude::*;

/// Rows of a record that a fit looks at: neighbouring samples tell the same, and 1200 rows resolve 60 periods of 20.
const ROWS: usize = 1200;

/// Volts and micrometres of what the traces have scaled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scales {
    pub middle_v: f64,
    pub unit_v: f64,
    pub middle2_v: f64,
    pub unit2_v: f64,
    pub middle_um: f64,
}

/// One record.
#[derive(Debug, Clone)]
pub(crate) struct Trace {
    pub scales: Scales,
    pub role: Role,
    pub period_s: f64,
    /// Drive scaled to -1 .. 1 over all records; a periodic record has one period of run-in before it.
    pub drive: Vec<f64>,
    /// Position, micrometres, as long as `drive` (in the run-in the first period's).
    pub position_um: Vec<f64>,
    /// First sample of the record itself.
    pub from: usize,
    /// Whether the stage rested before that, where there is a run-in.
    pub rested: bool,
    /// Samples that are looked at.
    pub rows: Vec<usize>,
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
    /// The same record between its samples, its rows those of this one; `None` where the samples are the grid.
    pub finer: Option<Box<Trace>>,
}

/// The records of a dataset and the scales they share.
#[derive(Debug, Clone)]
pub(crate) struct Traces {
    pub each: Vec<Trace>,
    /// Volts of one unit of the scaled drive.
    pub unit_v: f64,
    /// Volts of the scaled drive's zero.
    pub middle_v: f64,
    /// Micrometres of the traces' zero.
    pub middle_um: f64,
    /// Largest stroke, micrometres.
    pub stroke_um: f64,
}

impl Traces {
    /// Prepares the records; the state in which each starts is the one the model found. `fine` asks for a finer grid where a
    /// drive needs one.
    pub(crate) fn new(dataset: &Dataset, states: &[InitialState], noise_um: f64, fine: bool) -> Self {
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
        if fine {
            let records = dataset.records.par_iter().zip(states);
            each.par_iter_mut().zip(records).for_each(|(trace, (record, &state))| {
                if let InitialState::Periodic { samples } = state {
                    trace.finer = trace.between_samples(&record.voltage_v, samples).map(Box::new);
                }
            });
        }
        let stroke_um = each.iter().map(|t| t.stroke_um).fold(0.0, f64::max);
        Self {
            each,
            unit_v,
            middle_v,
            middle_um,
            stroke_um,
        }
    }

    /// Whether no record has a temperature: then heat shows as time.
    pub(crate) fn without_temperature(&self) -> bool {
        self.each.iter().all(|t| t.temperature_c.is_none())
    }
}

/// The state in which each record finds the plays, as the model sees it.
pub(crate) fn initial_states(dataset: &Dataset, model: &Model) -> Vec<(InitialState, Vec<f64>)> {
    dataset
        .records
        .par_iter()
        .map(|record| {
            let simulation = model.simulate(record);
            (simulation.initial, simulation.output)
        })
        .collect()
}

/// The delay that is the controller's own, as the recordings say, where the model has none that would stand for it, seconds.
pub(crate) fn controllers_delay_s(dataset: &Dataset, model: &Model) -> Option<f64> {
    let has_delay = model.effects.iter().any(|effect| effect.name == EffectId::Delay);
    dataset.known.delay_s.filter(|delay_s| *delay_s > 0.0 && !has_delay)
}

/// The records with each drive as the stage gets it, so much later than it was commanded.
pub(crate) fn as_late_as_the_controller(dataset: &Dataset, delay_s: f64, states: &[InitialState]) -> Dataset {
    let mut delayed = dataset.clone();
    delayed.records.par_iter_mut().zip(states).for_each(|(record, state)| {
        let run_in = match *state {
            InitialState::Periodic { samples } => samples,
            InitialState::Remanent { .. } => 0,
        };
        let drives = [Some(&mut record.voltage_v), record.voltage2_v.as_mut()];
        drives
            .into_iter()
            .flatten()
            .for_each(|drive| late(delay_s, record.period_s, run_in, drive));
    });
    delayed
}

/// The records without the mains hum that the model knows of; `None` where it knows of none.
pub(crate) fn without_hum(dataset: &Dataset, model: &Model) -> Option<Dataset> {
    if !model.effects.iter().any(|effect| effect.name == EffectId::MainsHum) {
        return None;
    }
    let mut humless = dataset.clone();
    humless.records.par_iter_mut().for_each(|record| {
        let hum_um = model.hum_um(record).unwrap_or_default();
        record.position_um.iter_mut().zip(hum_um).for_each(|(y, hum)| *y -= hum);
    });
    Some(humless)
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
        let first = run_in + if fraction > 0.0 { settled(&drive) } else { 0 };
        let stride = (drive.len() - first).div_ceil(ROWS).max(1);
        Self {
            scales,
            role: record.role,
            period_s: record.period_s,
            position_um: extend(&record.position_um)
                .into_iter()
                .map(|y| y - scales.middle_um)
                .collect(),
            from: run_in,
            rested: run_in > 0 && rested(&record.position_um, run_in),
            rows: (first..drive.len()).step_by(stride).collect(),
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
            finer: None,
            drive,
        }
    }

    /// The record on the grid on which a chain that moves signals in time is fitted; `None` where that is its samples.
    fn between_samples(&self, voltage_v: &[f64], period: usize) -> Option<Self> {
        let every = grid::refinement(&voltage_v[..period]);
        if every == 1 {
            return None;
        }
        let mut drive = grid::drive(voltage_v, period, every);
        // A record that starts at the low end has nothing to run in.
        drive.drain(..(period - self.from) * every);
        drive
            .iter_mut()
            .for_each(|v| *v = (*v - self.scales.middle_v) / self.scales.unit_v);
        let slow = |values: &[f64]| grid::slow(values, 0, every);
        Some(Self {
            period_s: self.period_s / every as f64,
            position_um: slow(&self.position_um),
            from: self.from * every,
            rows: self.rows.iter().map(|k| k * every).collect(),
            temperature_c: self.temperature_c.as_deref().map(slow),
            drive2: self.drive2.as_deref().map(slow),
            drive,
            ..self.clone()
        })
    }

    /// The record as a chain runs over it.
    pub(crate) fn on_grid(&self) -> &Self {
        self.finer.as_deref().unwrap_or(self)
    }

    /// The record's own samples of a series on the grid.
    pub(crate) fn recorded<'a>(&self, series: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        series.iter().copied().step_by(self.samples_apart())
    }

    /// Samples of the grid a recorded one.
    fn samples_apart(&self) -> usize {
        self.finer
            .as_ref()
            .map_or(1, |finer| (self.period_s / finer.period_s).round() as usize)
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

/// Where a drive has reached both of its extremes: the state before the record is forgotten; 0 where that is in the second half.
fn settled(drive: &[f64]) -> usize {
    let (low, high) = range(drive.iter().copied());
    let near = 1e-3 * (high - low);
    let both = drive
        .iter()
        .position(|&v| v <= low + near)
        .zip(drive.iter().position(|&v| v >= high - near));
    let k = both.map_or(0, |(a, b)| a.max(b));
    if k < drive.len() / 2 { k } else { 0 }
}

/// Scatter of the records' start offsets about their mean, rms.
pub(crate) fn start_scatter_um(traces: &Traces) -> f64 {
    let known = || {
        traces
            .each
            .iter()
            .filter(|t| t.start_error_um.is_finite())
            .map(|t| t.start_offset_um)
    };
    let n = known().count().max(1) as f64;
    let mean = known().sum::<f64>() / n;
    (known().map(|offset| (offset - mean).powi(2)).sum::<f64>() / n).sqrt()
}
