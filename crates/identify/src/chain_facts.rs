//! What the effects may know of a dataset before they are fitted.

use crate::chain_trace::Trace;
use crate::effects::{Facts, rest};
use crate::family::{Family, peak_to_peak, range};
use crate::initial;
use hysteron_data::{Dataset, Record, Role};

/// What the effects may know of a dataset.
pub fn facts(dataset: &Dataset, family: Family) -> Facts {
    let records = || dataset.with_role(Role::Identify);
    let (v_low, v_high) = range(records().flat_map(|r| r.voltage_v.iter().copied()));
    let (y_low, y_high) = range(records().flat_map(|r| r.position_um.iter().copied()));
    let rate = |v: &[f64], period_s: f64| v.windows(2).map(|w| (w[1] - w[0]).abs() / period_s).fold(0.0, f64::max);
    let with_temperature = records().all(|r| r.temperature_c.is_some());
    let temperatures: Vec<f64> = records()
        .filter_map(|r| r.temperature_c.as_ref())
        .flatten()
        .copied()
        .collect();
    let voltages2: Vec<f64> = records()
        .filter_map(|r| r.voltage2_v.as_ref())
        .flatten()
        .copied()
        .collect();
    let (t_low, t_high) = range(temperatures.iter().copied());
    let (v2_low, v2_high) = range(voltages2.iter().copied());
    Facts {
        voltage_v: [v_low, v_high],
        position_um: [y_low, y_high],
        finest_period_s: records().map(|r| r.period_s).fold(f64::INFINITY, f64::min),
        finest_grid_s: records().map(grid_s).fold(f64::INFINITY, f64::min),
        longest_s: records().map(|r| r.duration_s()).fold(0.0, f64::max),
        peak_rate_v_per_s: records().map(|r| rate(&r.voltage_v, r.period_s)).fold(0.0, f64::max),
        temperature_c: (with_temperature && !temperatures.is_empty()).then(|| {
            [
                t_low,
                temperatures.iter().sum::<f64>() / temperatures.len() as f64,
                t_high,
            ]
        }),
        voltage2_v: (v2_high > v2_low).then_some([v2_low, v2_high]),
        rests: records().any(|r| peak_to_peak(&r.voltage_v) > 0.0 && rest(&r.voltage_v, 1).is_some()),
        family,
    }
}

/// Step of the grid on which a chain with dynamics runs a record, seconds.
fn grid_s(record: &Record) -> f64 {
    let guess = initial::guess(&record.voltage_v, &record.position_um);
    Trace::new(record, guess, true).period_s
}
