//! Intervals of counts and of medians.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::fmt;

/// A share with Wilson's interval at 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Share {
    /// How many.
    pub of: usize,
    /// Of how many.
    pub all: usize,
}

impl Share {
    /// Counts what a rule says of each.
    pub fn of<T>(all: impl IntoIterator<Item = T>, rule: impl Fn(&T) -> bool) -> Self {
        let mut share = Self::default();
        for item in all {
            share.all += 1;
            share.of += usize::from(rule(&item));
        }
        share
    }

    /// The share in percent; none of nothing.
    pub fn percent(self) -> Option<f64> {
        (self.all > 0).then(|| 100.0 * self.of as f64 / self.all as f64)
    }

    /// Wilson's interval at 95 %, percent.
    pub fn interval(self) -> [f64; 2] {
        let (n, z) = (self.all as f64, 1.959_964);
        if self.all == 0 {
            return [0.0, 100.0];
        }
        let p = self.of as f64 / n;
        let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
        let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
        [100.0 * (middle - half).max(0.0), 100.0 * (middle + half).min(1.0)]
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(percent) = self.percent() else {
            return write!(f, "-");
        };
        let [low, high] = self.interval();
        write!(f, "{percent:.0} % ({} of {}; {low:.0} to {high:.0})", self.of, self.all)
    }
}

/// The median of numbers; none of nothing.
pub fn median(numbers: &[f64]) -> Option<f64> {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    (n > 0).then(|| 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]))
}

/// The median with a bootstrap interval at 95 %, as text.
pub fn median_text(numbers: &[f64]) -> String {
    let Some(middle) = median(numbers) else {
        return "-".to_owned();
    };
    let mut rng = Pcg64::seed_from_u64(1);
    let mut drawn: Vec<f64> = (0..2000)
        .filter_map(|_| {
            let again: Vec<f64> = numbers
                .iter()
                .map(|_| numbers[rng.random_range(0..numbers.len())])
                .collect();
            median(&again)
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    format!(
        "{middle:.2} ({} cases; {:.2} to {:.2})",
        numbers.len(),
        drawn[50],
        drawn[1949]
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wilson (1927) for 2 of 20 and 0 of 20: 2.79 to 30.10 and 0 to 16.11 %.
    #[test]
    fn val_wilson_interval() {
        let [low, high] = Share { of: 2, all: 20 }.interval();
        assert!(
            (low - 2.786).abs() < 0.01 && (high - 30.103).abs() < 0.01,
            "{low} {high}"
        );
        let [low, high] = Share { of: 0, all: 20 }.interval();
        assert!(low == 0.0 && (high - 16.113).abs() < 0.01, "{low} {high}");
    }

    #[test]
    fn val_medians() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(&[]), None);
    }
}
