//! What has changed between the campaign's first record and the same command at its end.

use super::matching::Returned;
use super::{Plan, Purpose, ZERO_MATTERS};
use core::fmt::{self, Display, Formatter};
use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::control::FRF;
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

    /// What has changed beyond what noise explains, a sentence each, with what to do.
    pub fn warnings(&self) -> Vec<String> {
        let gain = self.of_gain().then(|| {
            format!(
                "the gain has changed by {:.3} % between the first record and {}, beyond what noise explains: records of one campaign must \
                 be of one stage; let it warm up, look at the range of the sensor, and record again",
                self.gain_percent.value, self.name
            )
        });
        let zero = self.of_zero().then(|| {
            format!(
                "the position at rest has changed by {:.4} um between the first record and {}, beyond what noise explains: the sensor's zero \
                 drifts, or the stage did not rest long enough",
                self.zero_um.value, self.name
            )
        });
        gain.into_iter().chain(zero).collect()
    }
}

impl Display for Drift {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "drift to {}: gain {:+.3} +- {:.3} %, zero {:+.4} +- {:.4} um; difference {:.2} % of peak to peak, rms, of which noise is {:.2} %",
            self.name,
            self.gain_percent.value,
            self.gain_percent.error,
            self.zero_um.value,
            self.zero_um.error,
            self.difference_percent,
            self.noise_percent
        )
    }
}

/// The drift between the first small multisine among a campaign's records and each later one of its command, whose rests are not there.
pub fn among(dataset: &Dataset) -> Vec<Drift> {
    let of_small_signals = |role: Role| {
        let records = dataset.records.iter();
        records.filter(move |record| record.role == role && record.file.starts_with(FRF))
    };
    let Some(first) = of_small_signals(Role::Identify).next() else {
        return Vec::new();
    };
    let strokes = dataset.records.iter().map(|record| peak_to_peak(&record.position_um));
    let stroke_um = strokes.fold(0.0, f64::max);
    let of = |record: &Record| (record.position_um.clone(), Vec::new());
    let again = of_small_signals(Role::Validate).filter(|record| record.voltage_v == first.voltage_v);
    again
        .filter_map(|later| {
            let name = later.file.trim_end_matches(".csv").to_owned();
            between(name, of(first), of(later), stroke_um)
        })
        .collect()
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

/// Position of the part that counts, whole periods of it, and position at rest, empty where it was not kept.
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
    let mut zeros: Vec<f64> = parts.take(PARTS_OF_REST).map(|(a, b)| mean(b) - mean(a)).collect();
    if zeros.is_empty() {
        // From where the records are, without what the change of the gain does there.
        let gain = 1.0 + Change::of(&gains).value / 100.0;
        let periods = first.0.chunks_exact(n).zip(later.0.chunks_exact(n)).take(periods);
        zeros.extend(periods.map(|(a, b)| mean(b) - gain * mean(a)));
    }
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

    /// Without rests the zero is that of the records themselves, and a change of the gain is none of it.
    #[test]
    fn val_a_zero_is_told_without_rests() {
        let without = |gain: f64, zero_um: f64| {
            let (first, _) = record(1.0, 0.0, 1e-3, 5);
            let (later, _) = record(gain, zero_um, 1e-3, 1005);
            between("again".to_owned(), (first, Vec::new()), (later, Vec::new()), 15.0).unwrap()
        };
        let found = without(1.02, 0.0);
        assert!(
            found.of_gain() && !found.of_zero() && found.warnings().len() == 1,
            "{found:?}"
        );
        let found = without(1.0, 0.1);
        assert!(!found.of_gain() && found.of_zero(), "{found:?}");
        assert!((found.zero_um.value - 0.1).abs() < 0.01, "{found:?}");
        assert!(found.warnings()[0].contains("0.1") && found.to_string().contains("drift to again: gain"));
        assert_eq!(without(1.0, 0.0).warnings(), Vec::<String>::new());
    }

    /// The command of the first small multisine again, and no other record.
    #[test]
    fn val_a_campaigns_records_have_their_drift() {
        let taken = |file: &str, role: Role, gain: f64, seed: u64, command: f64| {
            let (position_um, _) = record(gain, 0.0, 1e-4, seed);
            Record::new(file, role, 20e-6, vec![command; position_um.len()], position_um)
        };
        let first = taken("frf-small.csv", Role::Identify, 1.0, 1, 2.0);
        let again = taken("frf-small-again.csv", Role::Validate, 1.02, 2, 2.0);
        let other = taken("frf-other.csv", Role::Validate, 1.02, 3, 3.0);
        let large = taken("large.csv", Role::Validate, 1.02, 4, 2.0);
        let found = |records: Vec<Record>| {
            among(&Dataset {
                records,
                ..Dataset::default()
            })
        };
        let drifts = found(vec![first.clone(), other.clone(), large, again.clone()]);
        assert_eq!(drifts.len(), 1, "{drifts:?}");
        assert!(drifts[0].name == "frf-small-again" && drifts[0].of_gain(), "{drifts:?}");
        assert!(found(vec![first, other]).is_empty() && found(vec![again]).is_empty());
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
