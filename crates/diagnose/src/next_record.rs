//! Which record to take next: the explanations that are alive are run on records that this rig can make, and the record on which
//! the closest two lie farthest apart is the one to take.

use crate::diagnosis::{NextRecord, Verdict};
use crate::investigation::Investigation;
use crate::verdict::Decision;
use hysteron_identify::EffectName;
use hysteron_identify::family::peak_to_peak;
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
}

/// A record that could be made.
struct Proposal {
    words: String,
    voltage_v: Vec<f64>,
    period_s: f64,
}

/// Samples of a proposal at the most.
const MOST_SAMPLES: usize = 40_000;

/// Explanations that are compared.
const MOST_RIVALS: usize = 4;

/// A difference below this many times what is left tells nothing.
const LEAST_SIGMA: f64 = 0.3;

/// The record to take next; `None` where no record that this rig can make would tell the explanations apart.
pub(crate) fn choose(investigation: &Investigation<'_>, decision: &Decision) -> Option<NextRecord> {
    let rivals = rivals(investigation, decision);
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
    let mut best: Option<(f64, usize, usize, Proposal)> = None;
    for proposal in proposals(&rig) {
        let outputs: Vec<Vec<f64>> = rivals
            .iter()
            .filter_map(|(_, trial)| match trial {
                Some(trial) => search.foretell(trial, &proposal.voltage_v, proposal.period_s),
                None => search.foretell(search.standing(), &proposal.voltage_v, proposal.period_s),
            })
            .collect();
        if outputs.len() < rivals.len() {
            continue;
        }
        if let Some((sigma, a, b)) = closest(&outputs, sigma_um)
            && best.as_ref().is_none_or(|best| sigma > best.0)
        {
            best = Some((sigma, a, b, proposal));
        }
    }
    let (sigma, a, b, proposal) = best.filter(|best| best.0 > LEAST_SIGMA)?;
    let separates = [a, b].into_iter().filter_map(|i| rivals[i].0.clone()).collect();
    Some(NextRecord {
        excitation: proposal.words,
        separates,
        expected_sigma: sigma,
        file: None,
        sample_period_s: proposal.period_s,
        voltage_v: proposal.voltage_v,
    })
}

type Rival<'t> = (Option<EffectName>, Option<&'t hysteron_identify::search::Trial>);

/// The explanations that are alive: the verdict and its set; where nothing is named, or one sine
/// cannot say so, the best candidates, and none of them.
fn rivals<'t>(investigation: &'t Investigation<'_>, decision: &Decision) -> Vec<Rival<'t>> {
    let alive = |name: &EffectName| decision.set.contains(name) || decision.verdict.effect() == Some(name);
    let trials = || investigation.first_trials.iter();
    let mut rivals: Vec<Rival<'t>> = trials()
        .filter(|(name, _)| alive(name))
        .map(|(name, trial)| (Some(name.clone()), Some(trial)))
        .collect();
    if rivals.len() < 2 && (decision.verdict != Verdict::Nothing || investigation.one_sine()) {
        for (name, trial) in trials().take(2) {
            if !rivals.iter().any(|(there, _)| there.as_ref() == Some(name)) {
                rivals.push((Some(name.clone()), Some(trial)));
            }
        }
        if decision.verdict.effect().is_none() {
            rivals.push((None, None));
        }
    }
    rivals.truncate(MOST_RIVALS);
    rivals
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
    })
}

/// Records that a rig of this rate, range and slew can make.
fn proposals(rig: &Rig) -> Vec<Proposal> {
    let span = rig.high_v - rig.low_v;
    let middle = 0.5 * (rig.low_v + rig.high_v);
    // A full sine turns at pi f times the span; twenty samples a period show it.
    let fastest_hz = (rig.slew_v_per_s / (PI * span)).min(0.05 / rig.period_s);
    let mut all = Vec::new();
    let mut propose = |words: String, seconds: f64, period_s: f64, of: &dyn Fn(f64) -> f64| {
        let period_s = period_s.max(rig.period_s);
        let samples = ((seconds / period_s).round() as usize).clamp(200, MOST_SAMPLES);
        let mut voltage_v: Vec<f64> = (0..samples).map(|k| of(k as f64 * period_s)).collect();
        // No faster than the rig has ever gone.
        let most = rig.slew_v_per_s * period_s;
        for k in 1..voltage_v.len() {
            let before = voltage_v[k - 1];
            voltage_v[k] = voltage_v[k]
                .clamp(before - most, before + most)
                .clamp(rig.low_v, rig.high_v);
        }
        all.push(Proposal {
            words,
            voltage_v,
            period_s,
        });
    };
    for hz in [fastest_hz, 0.3 * fastest_hz, 0.05 * fastest_hz] {
        let hz = nice(hz);
        propose(
            format!("sine {hz} Hz, full range, 10 periods"),
            10.0 / hz,
            0.002 / hz,
            &|t| middle - 0.5 * span * (TAU * hz * t).cos(),
        );
    }
    let top_hz = nice(0.1 / rig.period_s);
    let first_hz = nice((top_hz / 200.0).max(2.0 / rig.longest_s));
    for share in [0.05, 0.3] {
        let lines = 24;
        let line_hz = |k: i32| first_hz * (2.0 * (0.5 * (top_hz / first_hz).powf(f64::from(k) / 23.0)).floor() + 1.0);
        propose(
            format!(
                "multisine at mid voltage, {first_hz} to {top_hz} Hz, {:.0} % of the range, 6 periods",
                100.0 * share
            ),
            6.0 / first_hz,
            rig.period_s,
            &|t| {
                let sum: f64 = (0..lines)
                    .map(|k| (TAU * line_hz(k) * t - PI * f64::from(k * k) / f64::from(lines)).cos())
                    .sum();
                middle + share * span * sum / 8.0
            },
        );
    }
    let hold_s = nice(rig.longest_s.clamp(2.0, 60.0));
    propose(
        format!("step to mid voltage and back, held {hold_s} s each"),
        2.2 * hold_s,
        hold_s / 8000.0,
        &|t| {
            let up = if (0.1 * hold_s..1.1 * hold_s).contains(&t) {
                0.5
            } else {
                0.0
            };
            rig.low_v + up * span
        },
    );
    let ladder_hz = nice((0.02 * fastest_hz).max(1.0 / rig.longest_s));
    propose(
        format!("triangles {ladder_hz} Hz at 100, 50, 25, 10 and 5 % of the range"),
        5.0 / ladder_hz,
        0.001 / ladder_hz,
        &|t| {
            let size = [1.0, 0.5, 0.25, 0.1, 0.05][((t * ladder_hz) as usize).min(4)];
            let phase = (t * ladder_hz).fract();
            rig.low_v + size * span * (1.0 - (2.0 * phase - 1.0).abs())
        },
    );
    propose(
        format!("triangle {ladder_hz} Hz that decays from the full range to mid voltage, 12 periods"),
        12.0 / ladder_hz,
        0.004 / ladder_hz,
        &|t| {
            let size = (1.0 - t * ladder_hz / 12.0).max(0.0);
            let phase = (t * ladder_hz).fract();
            middle + size * span * (0.5 - (2.0 * phase - 1.0).abs())
        },
    );
    all
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

/// The two explanations that lie closest together, rms over sigma, gain and offset free.
fn closest(outputs: &[Vec<f64>], sigma_um: f64) -> Option<(f64, usize, usize)> {
    let mut least: Option<(f64, usize, usize)> = None;
    for a in 0..outputs.len() {
        for b in a + 1..outputs.len() {
            let sigma = apart(&outputs[a], &outputs[b]) / sigma_um;
            if least.is_none_or(|l| sigma < l.0) {
                least = Some((sigma, a, b));
            }
        }
    }
    least
}

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

    /// An actuator that is sampled at 40 Hz over 10 to 50 V gets no sine of 503 Hz, and nothing leaves its range or its slew.
    #[test]
    fn val_proposals_stay_within_the_rig() {
        for (period_s, slew) in [(0.025, 30.0), (2e-5, 5e4), (1e-3, 400.0)] {
            let rig = Rig {
                period_s,
                low_v: 10.0,
                high_v: 50.0,
                slew_v_per_s: slew,
                longest_s: 8.0,
            };
            for proposal in proposals(&rig) {
                assert!(proposal.period_s >= period_s, "{}", proposal.words);
                assert!(proposal.voltage_v.len() <= MOST_SAMPLES);
                assert!(
                    proposal.voltage_v.iter().all(|v| (10.0..=50.0).contains(v)),
                    "{}",
                    proposal.words
                );
                let fastest = proposal
                    .voltage_v
                    .windows(2)
                    .map(|v| (v[1] - v[0]).abs())
                    .fold(0.0, f64::max);
                assert!(fastest <= slew * proposal.period_s * (1.0 + 1e-9), "{}", proposal.words);
            }
        }
    }

    #[test]
    fn val_numbers_as_people_write_them() {
        assert_eq!(format!("{}", nice(0.012_34)), "0.012");
        assert_eq!(format!("{}", nice(4973.0)), "5000");
        assert_eq!(format!("{}", nice(503.2)), "500");
        assert_eq!(format!("{}", nice(0.75)), "0.75");
    }
}
