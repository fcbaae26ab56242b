//! What has changed between the campaign's first record and the same command at its end.

use super::matching::Returned;
use super::{Plan, Purpose, ZERO_MATTERS};
use hysteron_identify::family::peak_to_peak;

/// Parts of a rest whose means are compared.
const PARTS_OF_REST: usize = 8;
/// Standard errors from which on a change is one: of eight parts noise alone reaches them once in two thousand times.
const CLEAR: f64 = 6.0;
/// A change of the gain below this spoils no controller, percent: the inverse misses its records by as much.
const GAIN_MATTERS_PERCENT: f64 = 0.1;

/// A figure with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// How much.
    pub value: f64,
    /// Its standard error, from the scatter between parts of the two records.
    pub error: f64,
}

impl Change {
    /// Mean and standard error of the mean.
    fn of(parts: &[f64]) -> Self {
        let n = parts.len() as f64;
        let value = parts.iter().sum::<f64>() / n;
        let squares: f64 = parts.iter().map(|part| (part - value).powi(2)).sum();
        Self {
            value,
            error: (squares / (n - 1.0) / n).sqrt(),
        }
    }

    /// Whether noise does not explain it, and it is larger than what matters.
    fn counts(self, matters: f64) -> bool {
        self.value.abs() > CLEAR * self.error && self.value.abs() > matters
    }
}

/// The first record beside one of the same command later on.
#[derive(Debug, Clone, PartialEq)]
pub struct Drift {
    /// The later record.
    pub name: String,
    /// Change of the gain for small signals, percent.
    pub gain_percent: Change,
    /// Change of the position at rest, micrometres.
    pub zero_um: Change,
    /// Difference of the two over the part that counts, rms, percent of the first one's peak to peak, its rest included.
    pub difference_percent: f64,
    /// What that would be of what does not repeat from period to period alone.
    pub noise_percent: f64,
    /// The campaign's stroke, micrometres.
    pub stroke_um: f64,
}

impl Drift {
    /// Whether the gain has changed beyond what noise explains.
    pub fn of_gain(&self) -> bool {
        self.gain_percent.counts(GAIN_MATTERS_PERCENT)
    }

    /// Whether the zero has changed beyond what noise explains.
    pub fn of_zero(&self) -> bool {
        self.zero_um.counts(ZERO_MATTERS * self.stroke_um)
    }
}

/// The drift between the first record and each later one of its command.
pub fn drifts(plan: &Plan, returned: &Returned) -> Vec<Drift> {
    let Some(first) = returned.of((0, 0)) else {
        return Vec::new();
    };
    let strokes = returned
        .taken
        .iter()
        .map(|taken| peak_to_peak(&taken.record.position_um));
    let stroke_um = strokes.fold(0.0, f64::max);
    let again = |(pass, number): (usize, usize)| {
        let planned = plan.passes.get(pass).and_then(|pass| pass.records.get(number));
        planned.is_some_and(|planned| planned.role == Purpose::Drift)
    };
    let later = returned.taken.iter().filter(|taken| again(taken.at));
    later
        .filter_map(|later| {
            let name = later.record.file.trim_end_matches(".csv").to_owned();
            let of = |a: &super::matching::Taken| (a.record.position_um.clone(), a.rest_um.clone());
            between(name, of(first), of(later), stroke_um)
        })
        .collect()
}

/// Position of the part that counts, whole periods of it, and position at rest.
type Positions = (Vec<f64>, Vec<f64>);

fn between(name: String, first: Positions, later: Positions, stroke_um: f64) -> Option<Drift> {
    let periods = crate::campaign::PERIODS_KEPT;
    let n = first.0.len() / periods;
    if n < 2 || later.0.len() < n * periods {
        return None;
    }
    let without_mean = |positions: &[f64]| -> Vec<f64> {
        let mean = positions.iter().sum::<f64>() / positions.len() as f64;
        positions.iter().map(|y| y - mean).collect()
    };
    let split =
        |positions: &[f64]| -> Vec<Vec<f64>> { positions.chunks_exact(n).take(periods).map(without_mean).collect() };
    let (a, b) = (split(&first.0), split(&later.0));
    let sums: Vec<f64> = (0..n)
        .map(|k| a.iter().chain(&b).map(|period| period[k]).sum())
        .collect();
    // Each period beside the mean of all the others, whose noise is not its own: noise makes no gain smaller.
    let gains: Vec<f64> = a
        .iter()
        .zip(&b)
        .map(|(a, b)| {
            let (of_a, of_b) = (0..n).fold((0.0, 0.0), |(of_a, of_b), k| {
                let others = sums[k] - a[k] - b[k];
                (of_a + others * a[k], of_b + others * b[k])
            });
            100.0 * (of_b / of_a - 1.0)
        })
        .collect();
    let scatter: f64 = (0..n)
        .map(|k| {
            let of = |periods: &[Vec<f64>]| {
                let mean = periods.iter().map(|period| period[k]).sum::<f64>() / periods.len() as f64;
                periods.iter().map(|period| (period[k] - mean).powi(2)).sum::<f64>() / (periods.len() - 1) as f64
            };
            of(&a) + of(&b)
        })
        .sum();
    let rest = first.1.len().min(later.1.len()) / PARTS_OF_REST;
    let parts = first.1.chunks_exact(rest.max(1)).zip(later.1.chunks_exact(rest.max(1)));
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let zeros: Vec<f64> = parts.take(PARTS_OF_REST).map(|(a, b)| mean(b) - mean(a)).collect();
    let squares: f64 = first.0.iter().zip(&later.0).map(|(a, b)| (b - a).powi(2)).sum();
    let whole: Vec<f64> = first.0.iter().chain(&first.1).copied().collect();
    let percent = |square: f64| 100.0 * square.sqrt() / peak_to_peak(&whole).max(f64::MIN_POSITIVE);
    Some(Drift {
        name,
        gain_percent: Change::of(&gains),
        zero_um: Change::of(&zeros),
        difference_percent: percent(squares / first.0.len() as f64),
        noise_percent: percent(scatter / n as f64),
        stroke_um,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    const PERIOD: usize = 500;

    /// Eight periods of 0.1 um about 6 um and a rest of 800 samples at a zero, with uniform noise.
    fn record(gain: f64, zero_um: f64, noise_um: f64, seed: u64) -> Positions {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut noise = || noise_um * 3_f64.sqrt() * random.random_range(-1.0..=1.0);
        let wave = |k: usize| 6.0 + 0.1 * (std::f64::consts::TAU * k as f64 / PERIOD as f64).sin();
        let counts = (0..8 * PERIOD).map(|k| zero_um + gain * wave(k) + noise()).collect();
        (counts, (0..800).map(|_| zero_um + noise()).collect())
    }

    fn drift(gain: f64, zero_um: f64, noise_um: f64, seed: u64) -> Drift {
        let (first, later) = (
            record(1.0, 0.0, noise_um, seed),
            record(gain, zero_um, noise_um, seed + 1000),
        );
        between("again".to_owned(), first, later, 15.0).unwrap()
    }

    #[test]
    fn val_a_change_of_gain_and_zero_is_measured() {
        let found = drift(1.02, 0.1, 1e-3, 1);
        assert!(
            (found.gain_percent.value - 2.0).abs() < 4.0 * found.gain_percent.error,
            "{found:?}"
        );
        assert!(
            (found.zero_um.value - 0.1).abs() < 4.0 * found.zero_um.error,
            "{found:?}"
        );
        assert!(found.of_gain() && found.of_zero());
        // 0.1 um and 2 % of 6 um, of 6.1 um.
        assert!((found.difference_percent - 3.61).abs() < 0.02, "{found:?}");
    }

    /// No change of a noisy sensor is taken for one: 300 pairs, and noise from below a step of the sensor to a fifth of the signal.
    #[test]
    fn bva_noise_alone_is_no_drift() {
        for noise_um in [0.0, 1e-4, 1e-3, 0.02] {
            for seed in 0..75 {
                let found = drift(1.0, 0.0, noise_um, seed);
                assert!(!found.of_gain() && !found.of_zero(), "{noise_um} {seed}: {found:?}");
                let ratio = found.difference_percent / found.noise_percent.max(1e-12);
                assert!(noise_um == 0.0 || (ratio - 1.0).abs() < 0.06, "{found:?}");
            }
        }
    }

    /// Both sides of what matters, 0.1 % and 0.075 um of 15, with little noise; and both sides of what noise explains.
    #[test]
    fn bva_on_both_sides_of_what_is_warned_of() {
        assert!(!drift(1.0009, 0.074, 1e-5, 3).of_gain() && !drift(1.0009, 0.074, 1e-5, 3).of_zero());
        assert!(drift(1.0011, 0.076, 1e-5, 3).of_gain() && drift(1.0011, 0.076, 1e-5, 3).of_zero());
        assert!(drift(0.9989, -0.076, 1e-5, 3).of_gain() && drift(0.9989, -0.076, 1e-5, 3).of_zero());
        // With 0.02 um of noise the gain is good to 0.7 %: 2 % are three of these, 10 % fourteen.
        assert!(!drift(1.02, 0.0, 0.02, 3).of_gain());
        assert!(drift(1.10, 0.0, 0.02, 3).of_gain());
    }

    #[test]
    fn refuse_records_that_are_too_short() {
        assert_eq!(
            between("x".to_owned(), (vec![1.0; 8], vec![]), (vec![1.0; 8], vec![]), 1.0),
            None
        );
    }
}
