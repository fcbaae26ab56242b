//! Duhem's family on a stage by Coleman and Hodgdon's equation, which is written here anew.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::{Family, FitOptions, Model, fit, record_errors};
use std::f64::consts::TAU;

/// `dy = a |dv| (f(v) - y) + b dv`, `f(v) = 0.1 v + 2e-6 v^3`, in micrometres and volts.
struct Stage {
    y_um: f64,
    last_v: f64,
}

impl Stage {
    /// Cycled over 0 to 100 V, at 0 V.
    fn cycled() -> Self {
        let mut stage = Self { y_um: 0.0, last_v: 0.0 };
        for k in 0..10 {
            stage.go(if k % 2 == 0 { 100.0 } else { 0.0 });
        }
        stage
    }

    fn go(&mut self, v: f64) -> f64 {
        let steps = ((v - self.last_v).abs() / 0.05).ceil().max(1.0);
        let dv = (v - self.last_v) / steps;
        for step in 0..steps as usize {
            let middle = self.last_v + dv * (step as f64 + 0.5);
            let k = 0.03 * dv.abs();
            let aim = 0.1 * middle + 2e-6 * middle.powi(3);
            self.y_um += (k * (aim - self.y_um) + 0.06 * dv) / (1.0 + 0.5 * k);
        }
        self.last_v = v;
        self.y_um
    }

    /// The answer with a nanometre of noise.
    fn record(&mut self, name: &str, role: Role, voltage_v: Vec<f64>) -> Record {
        let mut seed = name.len() as u64;
        let position_um = voltage_v
            .iter()
            .map(|&v| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                self.go(v) + 1e-3 * ((seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
            })
            .collect();
        Record::new(name, role, 1e-3, voltage_v, position_um)
    }
}

fn sine(low_v: f64, high_v: f64, periods: usize) -> Vec<f64> {
    let (middle, half) = (0.5 * (low_v + high_v), 0.5 * (high_v - low_v));
    (0..400 * periods)
        .map(|k| middle - half * (TAU * k as f64 / 400.0).cos())
        .collect()
}

fn decaying() -> Vec<f64> {
    let turns: Vec<f64> = (0..16)
        .map(|k| 50.0 + (50.0 - 3.0 * f64::from(k)) * if k % 2 == 0 { -1.0 } else { 1.0 })
        .collect();
    let straight = |w: &[f64]| {
        (0..200)
            .map(|k| w[0] + (w[1] - w[0]) * f64::from(k) / 200.0)
            .collect::<Vec<_>>()
    };
    turns.windows(2).flat_map(straight).collect()
}

/// Each record goes on from where the one before has left the stage, as a user's do.
fn dataset() -> Dataset {
    let mut stage = Stage::cycled();
    let of = [
        ("whole", Role::Identify, sine(0.0, 100.0, 3)),
        ("small", Role::Identify, sine(0.0, 40.0, 4)),
        ("middle", Role::Identify, sine(0.0, 70.0, 3)),
        ("high", Role::Identify, sine(60.0, 90.0, 3)),
        ("decaying", Role::Validate, decaying()),
    ];
    Dataset {
        records: of
            .map(|(name, role, voltage_v)| stage.record(name, role, voltage_v))
            .to_vec(),
        ..Dataset::default()
    }
}

fn fitted(dataset: &Dataset, family: Family) -> Model {
    fit(dataset, &FitOptions::new(family), &|_| ()).unwrap().model
}

/// Every record comes to a fifth of a percent, that which took no part to less than a twentieth of what plays leave: these cannot drift.
#[test]
fn val_small_loops_that_drift_are_followed() {
    let dataset = dataset();
    let left = |family: Family| {
        let errors = record_errors(&dataset, &fitted(&dataset, family));
        errors.iter().map(|error| error.percent.unwrap()).collect::<Vec<_>>()
    };
    let (fading, plays) = (left(Family::Duhem), left(Family::PlayPolynomial));
    println!("duhem {fading:?}, play-polynomial {plays:?}");
    assert!(fading.iter().all(|percent| *percent < 0.2), "{fading:?}");
    assert!(plays[4] > 2.0 && fading[4] < 0.05 * plays[4], "{fading:?} {plays:?}");
}

/// Its words are its own: elements with lengths, spread over four octaves below the range.
#[test]
fn val_elements_have_lengths() {
    let model = fitted(&dataset(), Family::Duhem);
    assert_eq!(model.thresholds.len(), 4);
    let longest = model.thresholds[3];
    assert!((longest - 100.0 / 2_f64.sqrt()).abs() < 1e-6, "{:?}", model.thresholds);
    assert_eq!(
        (Family::Duhem.elements(), Family::Duhem.of_an_element()),
        ("fading elements", "length")
    );
    let names: Vec<String> = model.parameters().into_iter().map(|p| p.name).collect();
    assert!(
        names.contains(&"weight_cubic[4]".to_owned()) && names.len() == 18,
        "{names:?}"
    );
}
