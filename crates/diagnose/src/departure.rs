//! How far a free shape departs from the model's own plays between the loops that were recorded, where nothing says which of them is right.

use hysteron_data::{Dataset, Role};
use hysteron_identify::family::{peak_to_peak, range};
use hysteron_identify::{InitialState, Model};

/// A free shape may depart by so many times the error that the model's own plays leave: it takes no more than that error.
const MOST_OVER_ERROR: f64 = 2.5;

/// Departures below this share of the stroke are those of any two families.
const OF_ANY_FAMILY_PERCENT: f64 = 2.0;

/// Turning points of the probe.
const TURNS: usize = 24;

/// Samples from one turning point to the next.
const SAMPLES: usize = 100;

/// Whether a shaped model says more between the recorded loops than its gain on them allows. `error_percent` is what the own plays leave of
/// the fitted records, percent of peak to peak.
///
/// # Cost
/// Some 2400 samples of each model.
pub(crate) fn departs(dataset: &Dataset, own: &Model, shaped: &Model, error_percent: f64) -> bool {
    departure_percent(dataset, own, shaped)
        .is_some_and(|percent| percent > OF_ANY_FAMILY_PERCENT && percent > MOST_OVER_ERROR * error_percent)
}

/// Rms between the plays of two models on a decaying triangle over the fitted voltages, percent of the first one's peak to peak; a constant
/// between them does not count.
fn departure_percent(dataset: &Dataset, own: &Model, shaped: &Model) -> Option<f64> {
    let record = dataset.with_role(Role::Identify).next()?;
    let drive = decaying(dataset);
    let plays_of = |model: &Model| -> Option<Vec<f64>> {
        let mut plays = model.clone();
        plays.effects.clear();
        plays.simulate_input(&drive, record.period_s, InitialState::REST).ok()
    };
    let (own, shaped) = (plays_of(own)?, plays_of(shaped)?);
    let between: Vec<f64> = own.iter().zip(&shaped).map(|(own, shaped)| shaped - own).collect();
    let n = between.len() as f64;
    let mean = between.iter().sum::<f64>() / n;
    let rms = (between.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt();
    let stroke_um = peak_to_peak(&own);
    (stroke_um > 0.0).then(|| 100.0 * rms / stroke_um)
}

/// A triangle from the lowest of the fitted voltages on, whose ends go to the middle.
fn decaying(dataset: &Dataset) -> Vec<f64> {
    let fitted = dataset.with_role(Role::Identify);
    let (low, high) = range(fitted.flat_map(|record| record.voltage_v.iter().copied()));
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let mut from = low;
    let mut drive = Vec::with_capacity(TURNS * SAMPLES);
    for turn in 0..TURNS {
        let reach = half * (1.0 - turn as f64 / TURNS as f64);
        let to = if turn % 2 == 0 { middle + reach } else { middle - reach };
        drive.extend((0..SAMPLES).map(|k| from + (to - from) * k as f64 / SAMPLES as f64));
        from = to;
    }
    drive
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_data::Record;
    use hysteron_identify::{Family, FitOptions, fit};

    /// A sine of a line with a play, its model, and the model with all its coefficients times `stretched`.
    fn fitted(stretched: f64) -> (Dataset, Model, Model) {
        let voltage_v: Vec<f64> = (0..2000).map(|k| 50.0 - 50.0 * (f64::from(k) * 0.0126).cos()).collect();
        let mut play: f64 = 0.0;
        let mut position = |v: f64| {
            play = play.clamp(v - 5.0, v + 5.0);
            0.05 * v + 0.05 * play
        };
        let position_um = voltage_v.iter().map(|v| position(*v)).collect();
        let mut dataset = Dataset::default();
        dataset
            .records
            .push(Record::new("sine.csv", Role::Identify, 1e-3, voltage_v, position_um));
        let own = fit(&dataset, &FitOptions::new(Family::Mpi), &|_| {})
            .expect("fits")
            .model;
        let mut other = own.clone();
        other.coefficients.iter_mut().for_each(|own| *own *= stretched);
        (dataset, own, other)
    }

    /// A departure within 2.5 times the error, or below 2 %, is a gain that the records allow; more is none.
    #[test]
    fn bva_departures_on_both_sides_of_the_error() {
        let (dataset, own, other) = fitted(1.3);
        let percent = departure_percent(&dataset, &own, &other).expect("moves");
        assert!(percent > OF_ANY_FAMILY_PERCENT, "{percent}");
        let at = percent / MOST_OVER_ERROR;
        assert!(departs(&dataset, &own, &other, 0.99 * at));
        assert!(!departs(&dataset, &own, &other, 1.01 * at));
        let (dataset, own, near) = fitted(1.02);
        assert!(departure_percent(&dataset, &own, &near).expect("moves") < OF_ANY_FAMILY_PERCENT);
        assert!(!departs(&dataset, &own, &near, 0.0));
    }

    /// The same model departs by nothing, and a constant between two does not count.
    #[test]
    fn val_a_model_does_not_depart_from_itself() {
        let (dataset, own, _) = fitted(1.0);
        assert_eq!(departure_percent(&dataset, &own, &own), Some(0.0));
        let drive = decaying(&dataset);
        assert_eq!(drive.len(), TURNS * SAMPLES);
        let (low, high) = range(drive.iter().copied());
        assert!(low >= 0.0 && high <= 100.0 && high - low > 95.0);
    }
}
