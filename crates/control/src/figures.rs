//! How far a run is off: eq. 19, and how much of it is lateness, gain and offset.

use crate::adapted::Adapted;

/// What a run leaves behind, one value a sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tracked {
    /// Desired position, micrometres.
    pub reference_um: Vec<f64>,
    /// Sensor readings, micrometres.
    pub measured_um: Vec<f64>,
    /// Position of the platform itself, micrometres.
    pub true_um: Vec<f64>,
    /// Commands, volts at the actuator before the converter.
    pub command_v: Vec<f64>,
    /// Whether the command met a limit.
    pub limited: Vec<bool>,
    /// What the law has learned of gain and zero at the end; none where it does not learn.
    pub adapted: Option<Adapted>,
}

impl Tracked {
    /// The part from a sample on.
    #[must_use]
    pub fn from(&self, first: usize) -> Self {
        fn part<T: Copy>(values: &[T], first: usize) -> Vec<T> {
            values.get(first..).unwrap_or(&[]).to_vec()
        }
        Self {
            reference_um: part(&self.reference_um, first),
            measured_um: part(&self.measured_um, first),
            true_um: part(&self.true_um, first),
            command_v: part(&self.command_v, first),
            limited: part(&self.limited, first),
            adapted: self.adapted,
        }
    }

    /// Share of the samples on which the command met a limit, percent.
    pub fn limited_percent(&self) -> f64 {
        let limited = self.limited.iter().filter(|&&limited| limited).count();
        100.0 * limited as f64 / self.limited.len().max(1) as f64
    }
}

/// The figures of the judged part of a run.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct RunFigures {
    /// Eq. 19 against the platform's own position, percent of peak to peak.
    pub true_percent: f64,
    /// Eq. 19 against the sensor's readings, percent of peak to peak: all that an experiment can know.
    pub measured_percent: f64,
    /// Largest error of the readings, percent of peak to peak.
    pub largest_percent: f64,
    /// The time by which the readings are late: `sum e y_d' / sum y_d'^2`, microseconds.
    pub late_us: f64,
    /// Share of the squared error that lateness explains, percent.
    pub late_share_percent: f64,
    /// What the readings lack in amplitude: `sum e (y_d - mean) / sum (y_d - mean)^2`, percent.
    pub gain_percent: f64,
    /// Share of the squared error that it explains, percent.
    pub gain_share_percent: f64,
    /// Share of the squared error in its mean, percent.
    pub offset_share_percent: f64,
}

/// Judges whole periods of a run by eq. 19, `e_rms = rms(y_d - y) / (max y_d - min y_d)`.
///
/// Over whole periods y_d - mean, its derivative and a constant are orthogonal, so that the three shares add up, to 100
/// where nothing else is wrong. `None` for a reference that stands still or has fewer than three samples.
///
/// # Example
/// ```
/// use hysteron_control::figures::{Tracked, judge};
/// let reference_um: Vec<f64> = (0..1000).map(|k| 5.0 - 5.0 * (std::f64::consts::TAU * f64::from(k) / 500.0).cos()).collect();
/// let position: Vec<f64> = reference_um.iter().map(|um| um + 0.1).collect();
/// let run = Tracked { measured_um: position.clone(), true_um: position, reference_um, ..Tracked::default() };
/// let figures = judge(&run, 20e-6);
/// assert!(figures.is_some_and(|figures| (figures.true_percent - 1.0).abs() < 1e-9)); // 0.1 of 10 um
/// ```
pub fn judge(run: &Tracked, sample_period_s: f64) -> Option<RunFigures> {
    let reference = &run.reference_um;
    let n = reference.len();
    let high = reference.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = reference.iter().copied().fold(f64::INFINITY, f64::min);
    if n < 3 || high <= low {
        return None;
    }
    let error: Vec<f64> = reference.iter().zip(&run.measured_um).map(|(r, y)| r - y).collect();
    let squared = |values: &mut dyn Iterator<Item = f64>| values.map(|e| e * e).sum::<f64>();
    let total = squared(&mut error.iter().copied());
    let of_true = squared(&mut reference.iter().zip(&run.true_um).map(|(r, y)| r - y));
    let percent = |sum: f64| 100.0 * (sum / n as f64).sqrt() / (high - low);
    let mean = reference.iter().sum::<f64>() / n as f64;
    let offset = error.iter().sum::<f64>() / n as f64;
    // Central differences, the period's ends joined.
    let slope = |k: usize| (reference[(k + 1) % n] - reference[(k + n - 1) % n]) / (2.0 * sample_period_s);
    let project = |basis: &dyn Fn(usize) -> f64| -> (f64, f64) {
        let (mut along, mut own) = (0.0, 0.0);
        for (k, e) in error.iter().enumerate() {
            let b = basis(k);
            along += b * e;
            own += b * b;
        }
        (along / own, 100.0 * along * along / own / total.max(f64::MIN_POSITIVE))
    };
    let (late_s, late_share) = project(&slope);
    let (gain, gain_share) = project(&|k| reference[k] - mean);
    Some(RunFigures {
        true_percent: percent(of_true),
        measured_percent: percent(total),
        largest_percent: 100.0 * error.iter().fold(0.0_f64, |most, e| most.max(e.abs())) / (high - low),
        late_us: 1e6 * late_s,
        late_share_percent: late_share,
        gain_percent: 100.0 * gain,
        gain_share_percent: gain_share,
        offset_share_percent: 100.0 * n as f64 * offset * offset / total.max(f64::MIN_POSITIVE),
    })
}

/// What set-point steps end in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steps {
    /// Time from a step until the error stays within the band, seconds, the longest; none where one does not before the next or the end.
    pub settling_s: Option<f64>,
    /// How far the position goes beyond a set-point, as a share of the step, the largest.
    pub overshoot: f64,
}

/// Who knows a step ahead begins earlier, seconds at most: the end of each hold is not judged.
const AHEAD_S: f64 = 2e-3;

/// Judges the jumps of a reference that stands still in between; the band is a share of each jump.
pub fn steps(reference_um: &[f64], position_um: &[f64], sample_period_s: f64, band: f64) -> Steps {
    let jumps: Vec<usize> = (1..reference_um.len())
        .filter(|&k| reference_um[k] != reference_um[k - 1])
        .collect();
    let ends = jumps.iter().skip(1).copied().chain([reference_um.len()]);
    let mut all = Steps {
        settling_s: Some(0.0),
        overshoot: 0.0,
    };
    let ahead = (AHEAD_S / sample_period_s).round() as usize;
    for (&from, end) in jumps.iter().zip(ends) {
        let to = end.saturating_sub(ahead).max(from);
        let step_um = reference_um[from] - reference_um[from - 1];
        // Positive beyond the set-point.
        let beyond = |k: usize| (position_um[k] - reference_um[k]) / step_um;
        let last_outside = (from..to).rev().find(|&k| beyond(k).abs() > band);
        let settled = last_outside.map_or(from, |k| k + 1);
        let settling_s = (settled < to).then_some((settled - from) as f64 * sample_period_s);
        all.settling_s = all.settling_s.zip(settling_s).map(|(longest, this)| longest.max(this));
        all.overshoot = (from..to).map(beyond).fold(all.overshoot, f64::max);
    }
    all
}

/// The lateness that alone gives a sine an error (eq. 19), microseconds: `rms|1 - e^(-j w tau)| = |2 sin(w tau / 2)|`
/// over `2 sqrt 2`. `None` where no lateness gives that much.
pub fn lateness_us(error_percent: f64, frequency_hz: f64) -> Option<f64> {
    let half = error_percent / 100.0 * std::f64::consts::SQRT_2;
    (0.0..=1.0)
        .contains(&half)
        .then(|| 1e6 * half.asin() / (std::f64::consts::PI * frequency_hz))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A mode that answers a jump, `1 - e^(-z w t) (cos w_d t + z / sqrt(1 - z^2) sin w_d t)`: its overshoot is `e^(-pi z / sqrt(1 - z^2))`; a
    /// lag settles to 1 % in `ln 100` of its time constants, and a jump that is missed by more than the band never.
    #[test]
    fn val_steps_by_closed_forms() {
        let period_s = 20e-6;
        // Up, and from rest there down.
        let reference: Vec<f64> = (0..20_000)
            .map(|k| if (1000..10_000).contains(&k) { 5.0 } else { 4.0 })
            .collect();
        let answer = |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let since = |k: usize, from: usize| of((k.saturating_sub(from)) as f64 * period_s);
            let at = |k: usize| 4.0 + since(k, 1000) - since(k, 10_000);
            (0..20_000).map(at).collect()
        };
        let (damping, omega): (f64, f64) = (0.2, TAU * 200.0);
        let rest = (1.0 - damping * damping).sqrt();
        let mode = |t: f64| {
            let phase = omega * rest * t;
            1.0 - (-damping * omega * t).exp() * (phase.cos() + damping / rest * phase.sin())
        };
        let found = steps(&reference, &answer(&mode), period_s, 0.01);
        let overshoot = (-std::f64::consts::PI * damping / rest).exp();
        assert!((found.overshoot - overshoot).abs() < 1e-3, "{found:?}, {overshoot}");
        // The envelope is below 1 % then.
        let latest_s = (100.0 / rest).ln() / (damping * omega);
        assert!(
            found.settling_s.is_some_and(|s| s < latest_s && s > 0.6 * latest_s),
            "{found:?}, {latest_s}"
        );
        let found = steps(&reference, &answer(&|t| 1.0 - (-t / 3e-3).exp()), period_s, 0.01);
        assert!(
            (found.settling_s.unwrap() - 3e-3 * 100.0_f64.ln()).abs() < 2.0 * period_s,
            "{found:?}"
        );
        assert!(found.overshoot <= 0.0);
        let found = steps(
            &reference,
            &answer(&|t| if t > 0.0 { 0.98 } else { 0.0 }),
            period_s,
            0.01,
        );
        assert_eq!(found.settling_s, None);
    }

    /// A sine that comes 20 us late, 1 % small and 0.01 um low at 500 Hz: closed forms for all figures.
    #[test]
    fn val_lateness_gain_and_offset_are_told_apart() {
        let omega = TAU * 500.0;
        let at = |k: f64| 1.0 - (omega * k * 20e-6).cos();
        let run = |late: f64, gain: f64, offset: f64| {
            let reference_um: Vec<f64> = (0..1000).map(|k| at(f64::from(k))).collect();
            let measured_um: Vec<f64> = (0..1000)
                .map(|k| 1.0 + gain * (at(f64::from(k) - late) - 1.0) - offset)
                .collect();
            Tracked {
                true_um: measured_um.clone(),
                command_v: vec![0.0; 1000],
                reference_um,
                measured_um,
                limited: vec![false; 1000],
                adapted: None,
            }
        };
        let late = judge(&run(1.0, 1.0, 0.0), 20e-6).unwrap();
        let expected = 100.0 * (omega * 10e-6).sin() / std::f64::consts::SQRT_2;
        assert!((late.measured_percent - expected).abs() < 1e-9, "{late:?}");
        assert!((lateness_us(expected, 500.0).unwrap() - 20.0).abs() < 1e-9);
        // A late sine is also short by 1 - cos(w tau) = 0.2 %; central differences are short by (w T)^2 / 6 = 7e-4.
        assert!(
            (late.late_us - 20.0).abs() < 0.05 && late.late_share_percent > 99.8,
            "{late:?}"
        );
        let small = judge(&run(0.0, 0.99, 0.0), 20e-6).unwrap();
        assert!(
            (small.gain_percent - 1.0).abs() < 1e-9 && small.gain_share_percent > 99.999,
            "{small:?}"
        );
        let low = judge(&run(0.0, 1.0, 0.01), 20e-6).unwrap();
        assert!(
            (low.measured_percent - 0.5).abs() < 1e-9 && low.offset_share_percent > 99.999,
            "{low:?}"
        );
        assert!((low.largest_percent - 0.5).abs() < 1e-9);
        let mixed = judge(&run(1.0, 0.99, 0.01), 20e-6).unwrap();
        let shares = mixed.late_share_percent + mixed.gain_share_percent + mixed.offset_share_percent;
        assert!((shares - 100.0).abs() < 1e-6, "{mixed:?}");
    }

    #[test]
    fn refuse_to_judge_what_stands_still() {
        let still = Tracked {
            reference_um: vec![1.0; 10],
            measured_um: vec![1.0; 10],
            true_um: vec![1.0; 10],
            command_v: vec![0.0; 10],
            limited: vec![false; 10],
            adapted: None,
        };
        assert_eq!(judge(&still, 20e-6), None);
        assert_eq!(lateness_us(90.0, 500.0), None);
    }
}
