//! The loops that records show.

use crate::family::{peak_to_peak, range};
use hysteron_data::{Dataset, Record};

/// Share of the voltages' span by which a drive turns back in a reversal, and within which reversals count as one.
const REVERSAL: f64 = 0.1;

/// Whether all records go to and fro between the same two voltages: none of them shows a loop inside of another, neither to fit to nor to
/// judge by, and what a free shape does there is anybody's guess.
pub fn one_loop(dataset: &Dataset) -> bool {
    let moves = |record: &&Record| peak_to_peak(&record.voltage_v) > 0.0;
    let records: Vec<&Record> = dataset.records.iter().filter(moves).collect();
    let (low, high) = range(records.iter().flat_map(|record| record.voltage_v.iter().copied()));
    let reach = REVERSAL * (high - low);
    let at_an_end = |v: &f64| v - low < reach || high - v < reach;
    records
        .iter()
        .all(|record| reversals(&record.voltage_v, reach).iter().all(at_an_end))
}

/// Voltages at which a drive turns round and goes back by more than `reach`.
fn reversals(drive: &[f64], reach: f64) -> Vec<f64> {
    let mut found = Vec::new();
    let first = drive.first().copied().unwrap_or(0.0);
    let (mut low, mut high) = (first, first);
    let mut rising = None;
    for &v in drive {
        (low, high) = (low.min(v), high.max(v));
        let turns_down = rising != Some(false) && high - v > reach;
        let turns_up = rising != Some(true) && v - low > reach;
        if turns_down || turns_up {
            let turned = if turns_down { high } else { low };
            if rising.is_some() {
                found.push(turned);
            }
            rising = Some(turns_up);
            (low, high) = (v, v);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_data::Role;

    /// Records between two voltages show one loop; a turn further inside than a tenth of the span shows another.
    #[test]
    fn bva_one_loop_on_both_sides() {
        let zigzag = |ends: &[f64]| -> Vec<f64> {
            let legs = ends.windows(2);
            legs.flat_map(|leg| (0..50).map(|k| leg[0] + (leg[1] - leg[0]) * f64::from(k) / 50.0))
                .collect()
        };
        let of = |drives: &[&[f64]]| {
            let records = drives.iter().map(|ends| {
                let voltage_v = zigzag(ends);
                Record::new("r.csv", Role::Identify, 1e-3, voltage_v.clone(), voltage_v)
            });
            one_loop(&Dataset {
                records: records.collect(),
                ..Dataset::default()
            })
        };
        // From the middle, and a step up that stays.
        assert!(of(&[&[50.0, 100.0, 0.0, 100.0, 0.0], &[0.0, 70.0]]));
        assert!(of(&[&[0.0, 100.0, 0.0], &[0.0, 92.0, 0.0]]));
        assert!(!of(&[&[0.0, 100.0, 0.0], &[0.0, 88.0, 0.0]]));
        assert!(of(&[&[0.0, 100.0, 8.0, 100.0]]));
        assert!(!of(&[&[0.0, 100.0, 12.0, 100.0]]));
        // A ripple turns back by less than a tenth.
        assert!(of(&[&[0.0, 50.0, 42.0, 100.0, 0.0]]));
        assert!(!of(&[&[0.0, 50.0, 38.0, 100.0, 0.0]]));
    }
}
