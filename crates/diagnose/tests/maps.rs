//! Maps of the error open where it is: a cell names the stretch of a record in which its error is largest.
#![allow(clippy::unwrap_used, reason = "a test that cannot make its data fails")]

use hysteron_data::{Dataset, Record, Role};
use hysteron_diagnose::{Stretch, compare, of_record};
use hysteron_identify::{Family, FitOptions, fit};

/// Place of the spike, samples of a millisecond.
const SPIKE: usize = 730;

/// A slow triangle and a fast one on a straight stage; in the fast one a spike of five samples.
fn recorded() -> Dataset {
    let triangle = |period: usize| -> Vec<f64> {
        let way = |k: usize| (k % period).min(period - k % period) as f64;
        (0..2000).map(|k| 100.0 * way(k) / (period / 2) as f64).collect()
    };
    let record = |file: &str, role, period| {
        let voltage_v = triangle(period);
        let position_um = voltage_v
            .iter()
            .enumerate()
            .map(|(k, v)| 0.1 * v + 1e-3 * (k as f64).sin());
        Record::new(file, role, 1e-3, voltage_v.clone(), position_um.collect())
    };
    let mut fast = record("fast.csv", Role::Validate, 100);
    fast.position_um[SPIKE..SPIKE + 5].iter_mut().for_each(|y| *y += 1.0);
    Dataset {
        records: vec![record("slow.csv", Role::Identify, 1000), fast],
        ..Dataset::default()
    }
}

/// The cell with the largest error, and where it is largest.
fn worst(rms: &[Vec<Option<f64>>], worst: &[Vec<Option<Stretch>>]) -> Stretch {
    let mut most = (0.0, None);
    for (rms, worst) in rms.iter().flatten().zip(worst.iter().flatten()) {
        assert_eq!(rms.is_some(), worst.is_some(), "a cell with samples opens");
        if let (Some(rms), Some(stretch)) = (rms, worst) {
            assert!(stretch.from_s <= stretch.to_s);
            if *rms > most.0 {
                most = (*rms, Some(stretch.clone()));
            }
        }
    }
    most.1.unwrap()
}

#[test]
fn val_a_cell_opens_where_its_error_is_largest() {
    let dataset = recorded();
    let model = fit(&dataset, &FitOptions::new(Family::Pi), &|_| {}).unwrap().model;
    let comparison = compare(&dataset, &model, &|_| {});
    let spike_s = SPIKE as f64 * 1e-3;
    let (by_rate, by_swing) = (&comparison.error_map, &comparison.swing_map);
    for stretch in [
        worst(&by_rate.rms_um, &by_rate.worst),
        worst(&by_swing.rms_um, &by_swing.worst),
    ] {
        assert_eq!(stretch.file, "fast.csv");
        // A way of half a period, or the part of it that falls into the cell.
        assert!(
            stretch.from_s <= spike_s + 5e-3 && stretch.to_s >= spike_s && stretch.to_s - stretch.from_s <= 0.051,
            "{stretch:?}"
        );
    }
}

#[test]
fn val_a_record_has_a_spectrum_of_its_own() {
    let mut dataset = recorded();
    let still = vec![10.0; 2000];
    dataset
        .records
        .push(Record::new("still.csv", Role::Validate, 1e-3, still.clone(), still));
    let model = fit(&dataset, &FitOptions::new(Family::Pi), &|_| {}).unwrap().model;
    let comparison = compare(&dataset, &model, &|_| {});
    let power = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
    let [slow, fast] = [0, 1].map(|record| power(&of_record(&comparison, record).residual_um_per_rthz));
    // The spike is in one of them.
    assert!(fast > 20.0 * slow, "{fast} {slow}");
    let pooled = power(&comparison.spectrum.residual_um_per_rthz);
    assert!((slow.min(fast)..slow.max(fast)).contains(&pooled));
    for nothing in [2, 3] {
        assert!(of_record(&comparison, nothing).frequency_hz.is_empty());
    }
}
