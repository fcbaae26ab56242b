//! What a sensor's filter hides of the position, undone where its bandwidth is known.
//!
//! No record tells the filter from the amplifier's lag, which stands before the hysteresis and is undone with it.

use super::spectrum::through_spectrum;
use hysteron_data::{Dataset, Record};
use realfft::num_complex::Complex64;
use std::borrow::Cow;
use std::f64::consts::TAU;

/// Most that a line of a reading is raised by, with the noise in it.
const MOST: f64 = 10.0;
/// Shortest way on which a record's end is led back to its beginning, samples.
const SHORTEST_WAY_BACK: usize = 1024;

/// Time constant of the filter, seconds; 0 where nothing is known of it.
pub(super) fn lag_s(dataset: &Dataset) -> f64 {
    dataset.known.sensor_bandwidth_hz.map_or(0.0, |hz| 1.0 / (TAU * hz))
}

/// The dataset with positions in the place of readings.
pub(super) fn undone(dataset: &Dataset) -> Cow<'_, Dataset> {
    let tau_s = lag_s(dataset);
    if tau_s <= 0.0 {
        return Cow::Borrowed(dataset);
    }
    let before = |record: &Record| Record {
        position_um: before_filter(&record.position_um, tau_s / record.period_s),
        ..record.clone()
    };
    Cow::Owned(Dataset {
        records: dataset.records.iter().map(before).collect(),
        ..dataset.clone()
    })
}

/// The signal before a lag of so many samples. A cubic leads its end back to its beginning, with the slopes of both.
fn before_filter(reading: &[f64], tau_samples: f64) -> Vec<f64> {
    let n = reading.len();
    let [first, second, third, .., third_last, second_last, last] = *reading else {
        return reading.to_vec();
    };
    let whole = (n + SHORTEST_WAY_BACK).next_multiple_of(4096);
    let back = (whole - n + 1) as f64;
    let slopes = [
        (1.5 * last - 2.0 * second_last + 0.5 * third_last) * back,
        (-1.5 * first + 2.0 * second - 0.5 * third) * back,
    ];
    let bridge = |k: usize| {
        let u = (k + 1) as f64 / back;
        let rise = u * u * (3.0 - 2.0 * u);
        last + (first - last) * rise + u * (1.0 - u) * ((1.0 - u) * slopes[0] - u * slopes[1])
    };
    let mut time = reading.to_vec();
    time.extend((0..whole - n).map(bridge));
    through_spectrum(&mut time, |share| {
        let raised = Complex64::new(1.0, TAU * share * tau_samples);
        raised * (MOST / raised.norm()).min(1.0)
    });
    time.truncate(n);
    time
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_data::{Known, Role};

    /// Sines and a ramp behind a lag of half a sample and of four, from their closed forms; the ends, where the slope has a corner, apart.
    #[test]
    fn val_a_known_filter_is_undone() {
        let period_s = 20e-6;
        for bandwidth_hz in [15_915.5, 1_989.4] {
            let tau_s = 1.0 / (TAU * bandwidth_hz);
            // What comes out after a sine has come in for long, beside what came in.
            let behind = |t: f64, hz: f64| {
                let w = TAU * hz;
                let gain = 1.0 / (1.0 + (w * tau_s).powi(2)).sqrt();
                (gain * (w * t - (w * tau_s).atan()).sin(), (w * t).sin())
            };
            let both: Vec<(f64, f64)> = (0..20_000)
                .map(|k| {
                    let t = f64::from(k) * period_s;
                    let (slow, mode) = (behind(t, 500.0), behind(t, 6_000.0));
                    (
                        5.0 * slow.0 + 0.1 * mode.0 + 20.0 * (t - tau_s),
                        5.0 * slow.1 + 0.1 * mode.1 + 20.0 * t,
                    )
                })
                .collect();
            let (reading_um, true_um): (Vec<f64>, Vec<f64>) = both.into_iter().unzip();
            let record = Record::new("a.csv", Role::Identify, period_s, vec![0.0; 20_000], reading_um.clone());
            let dataset = Dataset {
                known: Known {
                    sensor_bandwidth_hz: Some(bandwidth_hz),
                    ..Known::default()
                },
                records: vec![record],
                ..Dataset::default()
            };
            let found = &undone(&dataset).records[0].position_um;
            let off = |values: &[f64]| {
                let inner = (200..19_800).map(|k| (values[k] - true_um[k]).abs());
                inner.fold(0.0, f64::max)
            };
            assert!(
                off(&reading_um) > 0.1 && off(found) < 2e-3,
                "{bandwidth_hz}: {}",
                off(found)
            );
        }
    }

    #[test]
    fn val_an_unknown_filter_leaves_the_records_alone() {
        let dataset = Dataset {
            records: vec![Record::new(
                "a.csv",
                Role::Identify,
                1e-3,
                vec![0.0; 3],
                vec![1.0, 3.0, 2.0],
            )],
            ..Dataset::default()
        };
        assert!(matches!(undone(&dataset), Cow::Borrowed(_)));
        assert_eq!(lag_s(&dataset), 0.0);
    }
}
