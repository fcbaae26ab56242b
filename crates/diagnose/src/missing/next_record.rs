//! Which short record would tell most: rivals are simulated on a catalogue of records, and the record on which the closest two
//! lie farthest apart is the one to take.

use crate::diagnosis::NextRecord;
use crate::missing::bench::{Bench, Trial};
use crate::missing::chain::{self, Effect};
use crate::missing::traces::Trace;
use crate::missing::user;
use hysteron_data::Role;
use nalgebra::DVector;
use std::f64::consts::{PI, TAU};

/// A record of the catalogue: words, sample period, drive from -1 to 1.
struct Proposal {
    words: &'static str,
    period_s: f64,
    drive: Vec<f64>,
}

/// The shortest record with all the catalogue's effects in it is not one: each of these shows something that the others do not.
fn catalogue() -> Vec<Proposal> {
    let series = |seconds: f64, period_s: f64, f: &dyn Fn(f64) -> f64| -> Vec<f64> {
        (0..(seconds / period_s).round() as usize)
            .map(|k| f(k as f64 * period_s))
            .collect()
    };
    // A rise of 20 ms from the low end, where every play's state is known.
    let rise = |to: f64, t: f64| -1.0 + (to + 1.0) * 0.5 * (1.0 - (PI * (t / 0.02).min(1.0)).cos());
    let fast = |f: f64| series(0.1, 2e-5, &move |t| -(TAU * f * t).cos());
    let multisine = |size: f64| {
        series(0.32, 2e-5, &move |t| {
            // Odd multiples of 20 Hz, spaced evenly on a logarithmic scale, phases after Schroeder (1970).
            let lines = 24;
            let sum: f64 = (0..lines)
                .map(|k| {
                    let wanted = 20.0 * 200f64.powf(f64::from(k) / f64::from(lines - 1));
                    let f = 20.0 * (2.0 * (wanted / 40.0).floor() + 1.0);
                    (TAU * f * t - PI * f64::from(k * k) / f64::from(lines)).cos()
                })
                .sum();
            let swing = if t > 0.02 { size * sum / 8.0 } else { 0.0 };
            (rise(0.0, t) + swing).clamp(-1.0, 1.0)
        })
    };
    vec![
        Proposal {
            words: "small multisine at mid voltage, 20 to 4000 Hz, 5 % of the range, 0.32 s",
            period_s: 2e-5,
            drive: multisine(0.05),
        },
        Proposal {
            words: "multisine at mid voltage, 20 to 4000 Hz, 30 % of the range, 0.32 s",
            period_s: 2e-5,
            drive: multisine(0.3),
        },
        Proposal {
            words: "sine 97 Hz, full range, 0.1 s",
            period_s: 2e-5,
            drive: fast(97.0),
        },
        Proposal {
            words: "sine 503 Hz, full range, 0.1 s",
            period_s: 2e-5,
            drive: fast(503.0),
        },
        Proposal {
            words: "steps of 10 ms to half and back to low voltage, held 15 s each",
            period_s: 2e-3,
            drive: series(30.0, 2e-3, &|t| {
                let up = ((t - 0.1) / 0.01).clamp(0.0, 1.0);
                let down = ((t - 15.1) / 0.01).clamp(0.0, 1.0);
                -1.0 + up - down
            }),
        },
        Proposal {
            words: "triangles 1 Hz at 100, 50, 25, 10 and 5 % of the range, 5 s",
            period_s: 5e-4,
            drive: series(5.0, 5e-4, &|t| {
                let size = [1.0, 0.5, 0.25, 0.1, 0.05][(t as usize).min(4)];
                let phase = t.fract();
                -1.0 + 2.0 * size * (1.0 - (2.0 * phase - 1.0).abs())
            }),
        },
    ]
}

/// A rival explanation.
struct Rival {
    name: String,
    effects: Vec<Effect>,
    coefficients: DVector<f64>,
}

/// The record to take next: between the verdict and what else is possible, or, where nothing was found, between effects of a
/// size that would just matter.
pub(crate) fn choose(
    bench: &Bench<'_>,
    verdict: &str,
    also: &[String],
    trials: &[(&'static str, Trial)],
    last: &Trial,
    unexplained_um: f64,
) -> Option<NextRecord> {
    if bench.traces.stroke_um <= 0.0 {
        return Some(first_of_all(bench));
    }
    let named: Vec<Rival> = trials
        .iter()
        .filter(|(name, _)| *name == verdict || also.iter().any(|a| a == name))
        .map(|(name, trial)| Rival {
            name: (*name).to_owned(),
            effects: trial.effects.clone(),
            coefficients: trial.coefficients.clone(),
        })
        .collect();
    let rivals = if also.is_empty() || named.len() < 2 {
        nominal(bench, last)
    } else {
        named
    };
    let sigma_um = bench.noise_um.hypot(unexplained_um).max(f64::MIN_POSITIVE);
    let (proposal, sigma, a, b) = catalogue()
        .into_iter()
        .filter_map(|proposal| {
            let outputs: Vec<Vec<f64>> = rivals.iter().map(|r| simulate(bench, r, &proposal)).collect();
            let (sigma, a, b) = closest(&outputs, sigma_um, &rivals)?;
            Some((proposal, sigma, a, b))
        })
        .max_by(|x, y| x.1.total_cmp(&y.1))?;
    Some(NextRecord {
        excitation: proposal.words.to_owned(),
        separates: vec![rivals[a].name.clone(), rivals[b].name.clone()],
        expected_sigma: sigma,
        file: None,
        sample_period_s: proposal.period_s,
        voltage_v: proposal
            .drive
            .iter()
            .map(|x| bench.traces.middle_v + x * bench.traces.unit_v)
            .collect(),
    })
}

/// Where nothing moved: a full sine.
fn first_of_all(bench: &Bench<'_>) -> NextRecord {
    let period_s = 1e-3;
    NextRecord {
        excitation: "sine 1 Hz over the range of the stage, 4 s".to_owned(),
        separates: Vec::new(),
        expected_sigma: 0.0,
        file: None,
        sample_period_s: period_s,
        voltage_v: (0..4000)
            .map(|k| bench.traces.middle_v - bench.traces.unit_v * (TAU * k as f64 * period_s).cos())
            .collect(),
    }
}

/// Effects of a size that would just matter, each on what was found.
fn nominal(bench: &Bench<'_>, last: &Trial) -> Vec<Rival> {
    let with = |name: &str, more: Option<Effect>, own: &[f64]| {
        let mut effects = last.effects.clone();
        effects.extend(more);
        let coefficients = last.coefficients.iter().copied().chain(own.iter().copied());
        let coefficients: Vec<f64> = coefficients.collect();
        Rival {
            name: name.to_owned(),
            effects,
            coefficients: DVector::from_vec(coefficients),
        }
    };
    let _ = bench;
    vec![
        with("nothing", None, &[]),
        with("delay", Some(Effect::Delay { delay_s: 3e-5 }), &[]),
        with("first-order-lag", Some(Effect::LagAfter { tau_s: 3e-5 }), &[]),
        with(
            "rate-dependence",
            Some(Effect::RateShift {
                up: 6e-5,
                down: 6e-5,
                exponent: 1.0,
                narrow: chain::NARROW,
            }),
            &[],
        ),
        with(
            "resonance",
            Some(Effect::Mode {
                frequency_hz: 1000.0,
                zeta: 0.02,
            }),
            &[],
        ),
    ]
}

fn simulate(bench: &Bench<'_>, rival: &Rival, proposal: &Proposal) -> Vec<f64> {
    let n = proposal.drive.len();
    let Some(scales) = bench.traces.each.first().map(|t| t.scales) else {
        return Vec::new();
    };
    let trace = Trace {
        scales,
        role: Role::Identify,
        period_s: proposal.period_s,
        drive: proposal.drive.clone(),
        position_um: vec![0.0; n],
        from: 0,
        rested: false,
        rows: Vec::new(),
        fraction: 0.0,
        temperature_c: None,
        drive2: None,
        stroke_um: 0.0,
        start_offset_um: 0.0,
        start_error_um: f64::INFINITY,
        finer: None,
    };
    let base = bench.base.columns();
    let plain = chain::simulate(&bench.base, &rival.effects, &trace, None, &rival.coefficients, base);
    let all = chain::width(&bench.base, &rival.effects);
    let mut modelled = chain::simulate(
        &bench.base,
        &rival.effects,
        &trace,
        Some(&plain),
        &rival.coefficients,
        all,
    );
    user::add_beyond(&rival.effects, &trace, Some(&plain), &mut modelled);
    modelled
}

/// The two rivals that lie closest together, rms over sigma, gain and offset free.
fn closest(outputs: &[Vec<f64>], sigma_um: f64, rivals: &[Rival]) -> Option<(f64, usize, usize)> {
    let mut least: Option<(f64, usize, usize)> = None;
    for a in 0..outputs.len() {
        for b in a + 1..outputs.len() {
            if rivals[a].name == rivals[b].name {
                continue;
            }
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
