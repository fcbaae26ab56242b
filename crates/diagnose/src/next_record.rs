//! Which record to take next: the explanations that are alive are run on records that this rig can make, and the record after which
//! the right name is likeliest is the one to take.

use crate::diagnosis::{NextRecord, Verdict};
use crate::investigation::Investigation;
use crate::odds::{Likely, Odds};
use crate::verdict::Decision;
use hysteron_data::{Record, Role};
use hysteron_identify::family::peak_to_peak;
use hysteron_identify::search::Trial;
use hysteron_identify::{EffectId, EffectName};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// What the rig can do, from the records that it made.
#[derive(Debug, Clone, Copy)]
struct Rig {
    period_s: f64,
    low_v: f64,
    high_v: f64,
    /// Fastest change that was commanded, volts per second.
    slew_v_per_s: f64,
    /// Longest record, seconds.
    longest_s: f64,
    /// Lowest and highest voltage of the other axis, where it moved.
    other_v: Option<[f64; 2]>,
    /// The temperature that was measured last, degrees Celsius.
    temperature_c: Option<f64>,
}

/// A record that could be made.
struct Proposal {
    words: String,
    drive: Record,
}

/// Samples of a proposal at the most.
const MOST_SAMPLES: usize = 20_000;

/// Explanations that are compared.
const MOST_RIVALS: usize = 6;

/// A record that adds less than this to the probability of the right name tells nothing.
const LEAST_GAIN: f64 = 0.02;

/// An explanation that is alive.
struct Rival<'t> {
    effect: Option<EffectName>,
    trial: &'t Trial,
    probability: f64,
}

/// The record after which the right name is likeliest; `None` where no record that this rig can make would tell the explanations apart.
pub(crate) fn choose(investigation: &Investigation<'_>, decision: &Decision, odds: &Odds) -> Option<NextRecord> {
    let rivals = rivals(investigation, decision, odds);
    if rivals.len() < 2 {
        return None;
    }
    let search = &investigation.search;
    let rig = rig(investigation)?;
    let left_um = search
        .standing()
        .left_um2
        .iter()
        .zip(search.strokes_um())
        .filter(|(_, stroke)| *stroke > 0.0)
        .map(|(left, _)| left.sqrt())
        .fold(0.0, f64::max);
    let sigma_um = search.noise_um().hypot(left_um).max(f64::MIN_POSITIVE);
    let judge = |proposal: Proposal| {
        let outputs: Vec<Vec<f64>> = rivals
            .iter()
            .map(|rival| search.foretell(rival.trial, &proposal.drive))
            .collect();
        let right = right_after(&rivals, &outputs, sigma_um);
        let each = rivals.iter().zip(&right);
        let named: f64 = each.map(|(rival, right)| rival.probability * right).sum();
        (named, right, proposal)
    };
    let judged: Vec<(f64, Vec<f64>, Proposal)> = proposals(&rig).into_par_iter().map(judge).collect();
    let now: f64 = rivals.iter().map(|rival| rival.probability.powi(2)).sum();
    let best = judged.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    let (_, right, proposal) = best.filter(|(named, ..)| named - now > LEAST_GAIN)?;
    let expected = rivals.iter().zip(right).filter_map(|(rival, probability)| {
        let effect = rival.effect.clone()?;
        Some(Likely { effect, probability })
    });
    Some(NextRecord {
        excitation: proposal.words,
        expected: expected.collect(),
        file: None,
        sample_period_s: proposal.drive.period_s,
        voltage_v: proposal.drive.voltage_v,
        voltage2_v: proposal.drive.voltage2_v,
    })
}

/// The explanations that are alive, likeliest first: the verdict and its set; where these are fewer than two and something is missing, or
/// one sine cannot say so, the likeliest candidates. None of them is one as well, unless one is named.
fn rivals<'t>(investigation: &'t Investigation<'_>, decision: &Decision, odds: &Odds) -> Vec<Rival<'t>> {
    let alive = |name: &EffectName| decision.set.contains(name) || decision.verdict.effect() == Some(name);
    let trial_of = |name: &EffectName| {
        let kept = investigation.first_trials.iter().find(|(kept, _)| kept == name);
        kept.map(|(_, trial)| trial)
    };
    let all = || {
        odds.each.iter().filter_map(|likely| {
            Some(Rival {
                effect: Some(likely.effect.clone()),
                trial: trial_of(&likely.effect)?,
                probability: likely.probability,
            })
        })
    };
    let open = decision.verdict != Verdict::Nothing || investigation.one_sine();
    let mut rivals: Vec<Rival<'t>> = all().filter(|rival| rival.effect.as_ref().is_some_and(alive)).collect();
    if rivals.len() < 2 && open {
        rivals = all().take(MOST_RIVALS / 2).collect();
    }
    rivals.truncate(MOST_RIVALS - 1);
    let named = decision
        .verdict
        .effect()
        .is_some_and(|name| *name != EffectId::HysteresisShape);
    if let Some(base) = investigation.base_trial.as_ref()
        && open
        && !named
    {
        rivals.push(Rival {
            effect: None,
            trial: base,
            probability: odds.none,
        });
    }
    let total: f64 = rivals.iter().map(|rival| rival.probability).sum();
    for rival in &mut rivals {
        rival.probability /= total.max(f64::MIN_POSITIVE);
    }
    rivals
}

/// The probability of each explanation after a record, where it is the right one.
fn right_after(rivals: &[Rival<'_>], outputs: &[Vec<f64>], sigma_um: f64) -> Vec<f64> {
    let of = |a: &Vec<f64>| outputs.iter().map(|b| apart(a, b) / sigma_um).collect();
    let before: Vec<f64> = rivals.iter().map(|rival| rival.probability).collect();
    posterior(&before, &outputs.iter().map(of).collect::<Vec<Vec<f64>>>())
}

/// Bayes' rule: each other one lies away from it by so many times what is left unexplained, and what is left counts as one reading.
fn posterior(before: &[f64], apart: &[Vec<f64>]) -> Vec<f64> {
    let right = |i: usize| {
        let others = (0..before.len()).filter(|j| *j != i);
        let against: f64 = others.map(|j| before[j] * (-0.5 * apart[i][j].powi(2)).exp()).sum();
        before[i] / (before[i] + against).max(f64::MIN_POSITIVE)
    };
    (0..before.len()).map(right).collect()
}

fn rig(investigation: &Investigation<'_>) -> Option<Rig> {
    let records = &investigation.search.dataset().records;
    let moving = || records.iter().filter(|record| peak_to_peak(&record.voltage_v) > 0.0);
    let period_s = moving().map(|record| record.period_s).reduce(f64::min)?;
    let facts = investigation.search.facts();
    Some(Rig {
        period_s,
        low_v: facts.voltage_v[0],
        high_v: facts.voltage_v[1],
        slew_v_per_s: facts.peak_rate_v_per_s,
        longest_s: facts.longest_s.max(1.0),
        other_v: facts.voltage2_v.filter(|[low, high]| high > low),
        temperature_c: records
            .iter()
            .rev()
            .find_map(|record| record.temperature_c.as_ref()?.last().copied()),
    })
}

/// Records that a rig of this rate, range and slew can make.
fn proposals(rig: &Rig) -> Vec<Proposal> {
    let span = rig.high_v - rig.low_v;
    let middle = 0.5 * (rig.low_v + rig.high_v);
    // A full sine turns at pi f times the span; twenty samples a period show it.
    let fastest_hz = nice((rig.slew_v_per_s / (PI * span)).min(0.05 / rig.period_s));
    let hold_s = nice(rig.longest_s.clamp(2.0, 60.0));
    let mut all = Vec::new();
    for hz in [fastest_hz, nice(0.3 * fastest_hz), nice(0.05 * fastest_hz)] {
        let words = format!("sine {hz} Hz, full range, 10 periods");
        all.push(rig.proposal(words, 10.0 / hz, 0.002 / hz, |t| {
            middle - 0.5 * span * (TAU * hz * t).cos()
        }));
    }
    all.push(rig.proposal(
        format!("sine {fastest_hz} Hz around mid voltage, 4 periods each at 100, 50, 25 and 10 % of the range"),
        16.0 / fastest_hz,
        0.002 / fastest_hz,
        |t| {
            let size = [1.0, 0.5, 0.25, 0.1][((0.25 * t * fastest_hz) as usize).min(3)];
            middle + 0.5 * size * span * (TAU * fastest_hz * t).sin()
        },
    ));
    for share in [0.05, 0.3] {
        all.push(multisine(rig, share));
    }
    all.push(rig.proposal(
        format!("step to mid voltage and back, held {hold_s} s each"),
        2.2 * hold_s,
        hold_s / 8000.0,
        |t| {
            let up = if (0.1 * hold_s..1.1 * hold_s).contains(&t) {
                0.5
            } else {
                0.0
            };
            rig.low_v + up * span
        },
    ));
    all.extend(triangles(rig, nice((0.02 * fastest_hz).max(1.0 / rig.longest_s))));
    all.push(rig.proposal(
        format!("low voltage for {hold_s} s, nothing moves"),
        hold_s,
        hold_s / 8000.0,
        |_| rig.low_v,
    ));
    all.extend(rig.other_v.map(|other_v| other_axis(rig, other_v, hold_s)));
    all
}

/// A small signal of many frequencies.
fn multisine(rig: &Rig, share: f64) -> Proposal {
    let span = rig.high_v - rig.low_v;
    let middle = 0.5 * (rig.low_v + rig.high_v);
    let top_hz = nice(0.1 / rig.period_s);
    let first_hz = nice((top_hz / 200.0).max(2.0 / rig.longest_s));
    let lines = 24;
    let line_hz = |k: i32| first_hz * (2.0 * (0.5 * (top_hz / first_hz).powf(f64::from(k) / 23.0)).floor() + 1.0);
    rig.proposal(
        format!(
            "multisine at mid voltage, {first_hz} to {top_hz} Hz, {:.0} % of the range, 6 periods",
            100.0 * share
        ),
        6.0 / first_hz,
        rig.period_s,
        |t| {
            let sum: f64 = (0..lines)
                .map(|k| (TAU * line_hz(k) * t - PI * f64::from(k * k) / f64::from(lines)).cos())
                .sum();
            middle + share * span * sum / 8.0
        },
    )
}

/// Slow loops of several sizes, from the low end and around the middle.
fn triangles(rig: &Rig, hz: f64) -> [Proposal; 2] {
    let span = rig.high_v - rig.low_v;
    let middle = 0.5 * (rig.low_v + rig.high_v);
    let sizes = rig.proposal(
        format!("triangles {hz} Hz at 100, 50, 25, 10 and 5 % of the range"),
        5.0 / hz,
        0.001 / hz,
        |t| {
            let size = [1.0, 0.5, 0.25, 0.1, 0.05][((t * hz) as usize).min(4)];
            let phase = (t * hz).fract();
            rig.low_v + size * span * (1.0 - (2.0 * phase - 1.0).abs())
        },
    );
    let decaying = rig.proposal(
        format!("triangle {hz} Hz that decays from the full range to mid voltage, 12 periods"),
        12.0 / hz,
        0.004 / hz,
        |t| {
            let size = (1.0 - t * hz / 12.0).max(0.0);
            let phase = (t * hz).fract();
            middle + size * span * (0.5 - (2.0 * phase - 1.0).abs())
        },
    );
    [sizes, decaying]
}

/// The other axis moves, this one rests.
fn other_axis(rig: &Rig, [low_v, high_v]: [f64; 2], hold_s: f64) -> Proposal {
    let hz = nice(3.0 / hold_s);
    let words =
        format!("low voltage for {hold_s} s, the other axis in triangles of {hz} Hz over {low_v:.4} to {high_v:.4} V");
    let mut proposal = rig.proposal(words, hold_s, 0.002 / hz, |_| rig.low_v);
    let period_s = proposal.drive.period_s;
    let phase = |k: usize| (k as f64 * period_s * hz).fract();
    let samples = proposal.drive.voltage_v.len();
    let triangle = (0..samples).map(|k| low_v + (high_v - low_v) * (1.0 - (2.0 * phase(k) - 1.0).abs()));
    proposal.drive.voltage2_v = Some(triangle.collect());
    proposal
}

impl Rig {
    /// A record within what this rig can do. The other axis rests, and the temperature stays.
    fn proposal(&self, words: String, seconds: f64, period_s: f64, of: impl Fn(f64) -> f64) -> Proposal {
        let period_s = period_s.max(self.period_s);
        let samples = ((seconds / period_s).round() as usize).clamp(200, MOST_SAMPLES);
        let mut voltage_v: Vec<f64> = (0..samples).map(|k| of(k as f64 * period_s)).collect();
        // No faster than the rig has ever gone.
        let most = self.slew_v_per_s * period_s;
        for k in 1..voltage_v.len() {
            let before = voltage_v[k - 1];
            voltage_v[k] = voltage_v[k]
                .clamp(before - most, before + most)
                .clamp(self.low_v, self.high_v);
        }
        let mut drive = Record::new("", Role::Validate, period_s, voltage_v, vec![0.0; samples]);
        drive.temperature_c = self.temperature_c.map(|celsius| vec![celsius; samples]);
        drive.voltage2_v = self.other_v.map(|[low_v, _]| vec![low_v; samples]);
        Proposal { words, drive }
    }
}

/// Two digits, as a person writes them.
fn nice(value: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return 1.0;
    }
    let unit = 10f64.powf(value.log10().floor() - 1.0);
    let digits = (value / unit).round();
    // Divided, not multiplied, where that is exact.
    if unit < 1.0 {
        digits / (1.0 / unit).round()
    } else {
        digits * unit
    }
}

/// Rms between two answers, gain and offset free, micrometres.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (ma, mb) = (mean(a), mean(b));
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        aa += (x - ma).powi(2);
        ab += (x - ma) * (y - mb);
        bb += (y - mb).powi(2);
    }
    ((bb - ab * ab / aa.max(f64::MIN_POSITIVE)).max(0.0) / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig(period_s: f64, slew_v_per_s: f64) -> Rig {
        Rig {
            period_s,
            low_v: 10.0,
            high_v: 50.0,
            slew_v_per_s,
            longest_s: 8.0,
            other_v: Some([-5.0, 20.0]),
            temperature_c: Some(21.0),
        }
    }

    /// An actuator that is sampled at 40 Hz over 10 to 50 V gets no sine of 503 Hz, and nothing leaves its range or its slew.
    #[test]
    fn val_proposals_stay_within_the_rig() {
        for (period_s, slew) in [(0.025, 30.0), (2e-5, 5e4), (1e-3, 400.0)] {
            for Proposal { words, drive } in proposals(&rig(period_s, slew)) {
                assert!(drive.period_s >= period_s, "{words}");
                assert!(drive.voltage_v.len() <= MOST_SAMPLES);
                assert!(drive.voltage_v.iter().all(|v| (10.0..=50.0).contains(v)), "{words}");
                let steps = drive.voltage_v.windows(2).map(|v| (v[1] - v[0]).abs());
                assert!(
                    steps.fold(0.0, f64::max) <= slew * drive.period_s * (1.0 + 1e-9),
                    "{words}"
                );
                let other_v = drive.voltage2_v.unwrap_or_default();
                assert_eq!(other_v.len(), drive.voltage_v.len(), "{words}");
                assert!(other_v.iter().all(|v| (-5.0..=20.0).contains(v)), "{words}");
            }
        }
    }

    /// The other axis moves only where there is one.
    #[test]
    fn bva_another_axis_on_both_sides() {
        let count = |other_v| {
            proposals(&Rig {
                other_v,
                ..rig(1e-3, 400.0)
            })
            .len()
        };
        assert_eq!(count(Some([0.0, 1.0])), count(None) + 1);
    }

    #[test]
    fn val_numbers_as_people_write_them() {
        assert_eq!(format!("{}", nice(0.012_34)), "0.012");
        assert_eq!(format!("{}", nice(4973.0)), "5000");
        assert_eq!(format!("{}", nice(503.2)), "500");
        assert_eq!(format!("{}", nice(0.75)), "0.75");
    }

    /// Bayes by hand: at no distance the odds stay; two sigmas apart an even pair is told by 1 / (1 + e^-2).
    #[test]
    fn val_probabilities_after_a_record() {
        let even = |sigma: f64| posterior(&[0.5, 0.5], &[vec![0.0, sigma], vec![sigma, 0.0]]);
        assert_eq!(even(0.0), [0.5, 0.5]);
        assert!((even(2.0)[0] - 1.0 / (1.0 + (-2.0f64).exp())).abs() < 1e-15);
        let uneven = posterior(&[0.9, 0.1], &[vec![0.0, 1.0], vec![1.0, 0.0]]);
        assert!(uneven[0] > 0.9 && uneven[1] > 0.1 && uneven[1] < 0.2, "{uneven:?}");
    }

    /// Gain and offset are free: what they make of one answer is no difference.
    #[test]
    fn val_gain_and_offset_do_not_part() {
        let a: Vec<f64> = (0..100).map(|k| (f64::from(k) * 0.2).sin()).collect();
        let b: Vec<f64> = a.iter().map(|y| 3.0 * y - 7.0).collect();
        let c: Vec<f64> = (0..100).map(|k| (f64::from(k) * 0.2).cos()).collect();
        assert!(apart(&a, &b) < 1e-7 && apart(&a, &c) > 0.5);
    }
}
