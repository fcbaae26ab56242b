//! Rails, held against the records: beyond one the position stands still.

use hysteron_data::Record;
use hysteron_identify::family::peak_to_peak;

/// Share of a record's stroke that is expected beyond a rail at the least, where a record tells.
const EXPECTED: f64 = 0.02;
/// Share of the expected motion from which on the position has not stood still: it lags, creeps and rings on by less.
const MOVED: f64 = 0.7;
/// Fewest passes beyond a rail that tell.
const FEWEST: usize = 3;

/// Whether the position goes on beyond rails, the lower and the upper in volts, as it does within them.
pub(crate) fn moves_beyond(records: &[Record], [low_v, high_v]: [f64; 2]) -> bool {
    [(low_v, -1.0), (high_v, 1.0)].into_iter().any(|(rail_v, outward)| {
        let mut moved: Vec<f64> = records
            .iter()
            .flat_map(|record| passes(record, rail_v, outward))
            .collect();
        moved.sort_by(f64::total_cmp);
        moved.len() >= FEWEST && moved[moved.len() / 2] > MOVED
    })
}

/// The motion of each pass beyond a rail, as a share of the motion that the record's own slope lets expect.
fn passes(record: &Record, rail_v: f64, outward: f64) -> Vec<f64> {
    let (v, y) = (&record.voltage_v, &record.position_um);
    let (span_v, stroke_um) = (peak_to_peak(v), peak_to_peak(y));
    if span_v <= 0.0 || stroke_um <= 0.0 {
        return Vec::new();
    }
    let beyond = |k: &usize| outward * (v[*k] - rail_v) > 0.0;
    let mut found = Vec::new();
    let mut k = 0;
    while k < v.len() {
        if !beyond(&k) {
            k += 1;
            continue;
        }
        let end = (k..v.len()).find(|k| !beyond(k)).unwrap_or(v.len());
        let farthest = (k..end).max_by(|&a, &b| (outward * v[a]).total_cmp(&(outward * v[b])));
        let farthest = farthest.unwrap_or(k);
        let expected_um = stroke_um * (v[farthest] - v[k]).abs() / span_v;
        if expected_um > EXPECTED * stroke_um {
            found.push((y[farthest] - y[k]).abs() / expected_um);
        }
        k = end;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_data::Role;

    /// A stage that stands still above 80 of 100 V, and one that does not.
    #[test]
    fn val_a_rail_stands_and_a_slope_goes_on() {
        let record = |limit_v: f64| {
            let wave = |k: u32| 50.0 - 50.0 * (std::f64::consts::TAU * f64::from(k) / 500.0).cos();
            let voltage_v: Vec<f64> = (0..3000).map(wave).collect();
            let position_um = voltage_v.iter().map(|v| 0.1 * v.min(limit_v)).collect();
            vec![Record::new("sine.csv", Role::Identify, 1e-3, voltage_v, position_um)]
        };
        assert!(!moves_beyond(&record(80.0), [-10.0, 80.0]));
        assert!(moves_beyond(&record(110.0), [-10.0, 80.0]));
        // Rails outside of the records tell nothing.
        assert!(!moves_beyond(&record(110.0), [-10.0, 110.0]));
    }
}
