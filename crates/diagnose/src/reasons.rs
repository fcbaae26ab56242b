//! Why records cannot answer, or not for every effect.

use crate::diagnosis::Reason;
use crate::rules::{RuleId, Thresholds};
use hysteron_data::{Dataset, Record, Role};
use hysteron_identify::family::{peak_to_peak, range};
use std::f64::consts::TAU;

impl Reason {
    /// Whether it speaks against every answer, not against that for some effects.
    pub fn blocks(self) -> bool {
        match self {
            Self::NothingMoves | Self::AllNoise => true,
            Self::Clipped | Self::OneSine | Self::PositionLeads | Self::NothingHeldOut => false,
        }
    }
}

/// The reasons of a dataset; `leads` says whether its position leads the voltage.
pub(crate) fn of(dataset: &Dataset, noise_um: f64, leads: bool, thresholds: &Thresholds) -> Vec<Reason> {
    let moving: Vec<&Record> = dataset
        .records
        .iter()
        .filter(|record| peak_to_peak(&record.voltage_v) > 0.0)
        .collect();
    if moving.is_empty() {
        return vec![Reason::NothingMoves];
    }
    let mut reasons = Vec::new();
    let stroke_um = moving.iter().map(|r| peak_to_peak(&r.position_um)).fold(0.0, f64::max);
    if stroke_um < thresholds.of(RuleId::StrokeOverNoise) * noise_um {
        reasons.push(Reason::AllNoise);
    }
    let samples: usize = moving.iter().map(|record| record.len()).sum();
    let stuck: usize = moving.iter().map(|record| stuck_at_extremes(record)).sum();
    if stuck as f64 > thresholds.of(RuleId::ClippedShare) * samples as f64 {
        reasons.push(Reason::Clipped);
    }
    if distinct_excitations(&moving) < 2 {
        reasons.push(Reason::OneSine);
    }
    if leads {
        reasons.push(Reason::PositionLeads);
    }
    reasons
}

/// Samples on a top that stands exactly still while the drive moves on.
fn stuck_at_extremes(record: &Record) -> usize {
    let (low, high) = range(record.position_um.iter().copied());
    if high <= low {
        0
    } else {
        record.stuck_at(low) + record.stuck_at(high)
    }
}

/// Whether all records that a fit sees are sines of one amplitude: none of them closes a loop inside of another.
pub(crate) fn sines_of_one_amplitude(dataset: &Dataset) -> bool {
    let fits = |record: &&Record| record.role == Role::Identify && peak_to_peak(&record.voltage_v) > 0.0;
    let sines = dataset.records.iter().filter(fits);
    let amplitudes: Option<Vec<f64>> = sines.map(|r| Some(sine_of(&r.voltage_v, r.period_s)?.1)).collect();
    amplitudes.is_some_and(|amplitudes| {
        let (least, most) = range(amplitudes.iter().copied());
        !amplitudes.is_empty() && most < 1.02 * least
    })
}

/// How many different things were played: sines of one frequency and amplitude count once, anything broad counts as two.
fn distinct_excitations(moving: &[&Record]) -> usize {
    let mut sines: Vec<(f64, f64)> = Vec::new();
    let mut broad = 0;
    for record in moving {
        match sine_of(&record.voltage_v, record.period_s) {
            Some((f, a)) => {
                let alike = |s: &(f64, f64)| (s.0 / f - 1.0).abs() < 0.02 && (s.1 / a - 1.0).abs() < 0.02;
                if !sines.iter().any(alike) {
                    sines.push((f, a));
                }
            }
            None => broad += 2,
        }
    }
    sines.len() + broad
}

/// What a drive that is no sine leaves at the least, of its amplitude: a triangle leaves 0.07.
const NO_SINE: f64 = 0.03;

/// Frequency and amplitude where a drive is one sine about a mean.
fn sine_of(drive: &[f64], period_s: f64) -> Option<(f64, f64)> {
    let (low, high) = range(drive.iter().copied());
    let (middle, amplitude) = ((low + high) / 2.0, (high - low) / 2.0);
    let crossings: Vec<usize> = (1..drive.len())
        .filter(|&k| (drive[k - 1] < middle) != (drive[k] < middle))
        .collect();
    let (first, last) = (*crossings.first()?, *crossings.last()?);
    if crossings.len() < 2 {
        return None;
    }
    // The instants of the crossings between samples.
    let at = |k: usize| k as f64 - (drive[k] - middle) / (drive[k] - drive[k - 1]);
    let f = (crossings.len() - 1) as f64 / (2.0 * (at(last) - at(first)) * period_s);
    let (mut cc, mut ss, mut cs, mut vc, mut vs) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let angle = |k: usize| TAU * f * period_s * k as f64;
    for (k, v) in drive.iter().enumerate() {
        let (s, c) = angle(k).sin_cos();
        (cc, ss, cs) = (cc + c * c, ss + s * s, cs + c * s);
        (vc, vs) = (vc + (v - middle) * c, vs + (v - middle) * s);
    }
    let determinant = cc * ss - cs * cs;
    let (c, s) = ((vc * ss - vs * cs) / determinant, (vs * cc - vc * cs) / determinant);
    let squares: f64 = drive
        .iter()
        .enumerate()
        .map(|(k, v)| {
            let (sin, cos) = angle(k).sin_cos();
            (v - middle - s * sin - c * cos).powi(2)
        })
        .sum();
    ((squares / drive.len() as f64).sqrt() < NO_SINE * amplitude).then_some((f, amplitude))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_acquisition::{Kind, inspect};

    /// Sines of several rates through one play, the position so many samples early.
    fn early(samples: usize) -> Dataset {
        let sine = |hz: f64| {
            let count = (8.0 * 20_000.0 / hz) as usize;
            let mut drive: Vec<f64> = (0..count)
                .map(|k| 50.0 - 50.0 * (TAU * hz * k as f64 / 20_000.0).cos())
                .collect();
            let mut play = 0.0_f64;
            let noise = |k: usize| 1e-4 * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
            let answer = |(k, v): (usize, &f64)| {
                play = play.clamp(v - 6.0, v + 6.0);
                0.07 * v + 0.03 * play + noise(k)
            };
            let position_um = drive
                .iter()
                .enumerate()
                .map(answer)
                .collect::<Vec<_>>()
                .split_off(samples);
            drive.truncate(position_um.len());
            Record::new(format!("{hz}.csv"), Role::Identify, 5e-5, drive, position_um)
        };
        Dataset {
            records: [5.0, 13.0, 41.0, 97.0, 211.0].map(sine).into(),
            ..Dataset::default()
        }
    }

    /// A position that turns before the voltage hides what turns the phase; one that turns with it hides nothing.
    #[test]
    fn bva_a_lead_of_the_position_on_both_sides() {
        let leads = |samples| {
            let dataset = early(samples);
            let leads = inspect(&dataset).finds(Kind::PositionLeads);
            of(&dataset, 1e-4, leads, &Thresholds::DEFAULT).contains(&Reason::PositionLeads)
        };
        assert_eq!([0, 3].map(leads), [false, true]);
    }

    /// A sine is one, cut off anywhere; a triangle leaves 0.07 of its amplitude, a sine with three hundredths of its third harmonic
    /// 0.021, with six 0.042.
    #[test]
    fn bva_a_sine_on_both_sides() {
        let n = 1700;
        let wave =
            |of: &dyn Fn(f64) -> f64| -> Vec<f64> { (0..n).map(|k| 50.0 + 40.0 * of(f64::from(k) / 500.0)).collect() };
        let with_third = |share: f64| wave(&move |t| (TAU * t).sin() + share * (3.0 * TAU * t).sin());
        let (f, a) = sine_of(&with_third(0.0), 1e-3).unwrap();
        assert!((f - 2.0).abs() < 1e-3 && (a - 40.0).abs() < 0.1, "{f} {a}");
        assert!(sine_of(&with_third(0.03), 1e-3).is_some());
        assert!(sine_of(&with_third(0.06), 1e-3).is_none());
        let triangle = wave(&|t: f64| 1.0 - 4.0 * (t.fract() - 0.5).abs());
        assert!(sine_of(&triangle, 1e-3).is_none());
    }
}
