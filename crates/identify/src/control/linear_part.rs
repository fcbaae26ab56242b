//! The linear part of a stage: amplifier's lag and the structure's modes, from a small multisine about a bias.

use crate::covered::{Line, highest_run};
use crate::error::IdentifyError;
use crate::period;
use hysteron_data::Record;
use nalgebra::{DMatrix, DVector};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// One mode, `share w^2 / (s^2 + 2 zeta w s + w^2)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeOfStage {
    /// Natural frequency, hertz.
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Share of the static displacement; the shares sum to 1.
    pub share: f64,
}

/// Lag and modes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearPart {
    /// Time constant of the amplifier's lag, seconds.
    pub lag_s: f64,
    /// The voltage at which it is that (V), the middle of the records', and how much it grows with it (1/V); constant without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag_growth: Option<[f64; 2]>,
    /// None, one or two modes, lowest first.
    pub modes: Vec<ModeOfStage>,
}

impl LinearPart {
    /// The structure's response `M(j w)`; 1 for a rigid one.
    pub fn structure(&self, omega: f64) -> Complex64 {
        if self.modes.is_empty() {
            return Complex64::new(1.0, 0.0);
        }
        self.modes
            .iter()
            .map(|mode| {
                let w = TAU * mode.frequency_hz;
                mode.share * w * w / Complex64::new(w * w - omega * omega, 2.0 * mode.damping * w * omega)
            })
            .sum()
    }

    /// Lag and structure, `M(j w) / (1 + j w tau)`.
    pub fn response(&self, omega: f64) -> Complex64 {
        self.structure(omega) / Complex64::new(1.0, omega * self.lag_s)
    }

    /// Sets the lag to a time constant (s), at a voltage (V) where it grows from there (s/V); it is told about the middle of the range.
    pub(super) fn set_lag(&mut self, tau_s: f64, growth: Option<[f64; 2]>, middle_v: f64) {
        let [from_v, per_v] = growth.unwrap_or_default();
        self.lag_s = tau_s + per_v * (middle_v - from_v);
        self.lag_growth = (per_v != 0.0 && self.lag_s > 0.0).then(|| [middle_v, per_v / self.lag_s]);
    }

    /// Frequency (hertz) and damping ratio of the antiresonance between two modes: the zeros of
    /// `s_1 w_1^2 / D_1 + s_2 w_2^2 / D_2`. None for one mode, and where the zeros are not a damped pair (a second mode
    /// against the first).
    pub fn antiresonance(&self) -> Option<[f64; 2]> {
        let [first, second] = self.modes.as_slice() else {
            return None;
        };
        let (w1, w2) = (TAU * first.frequency_hz, TAU * second.frequency_hz);
        let (a, b) = (first.share * w1 * w1, second.share * w2 * w2);
        let square = w1 * w1 * w2 * w2 * (first.share + second.share) / (a + b);
        let middle = 2.0 * (a * second.damping * w2 + b * first.damping * w1) / (a + b);
        (square > 0.0 && middle > 0.0).then(|| [square.sqrt() / TAU, 0.5 * middle / square.sqrt()])
    }

    /// Share of a position at `omega` that may be led back through the structure: all where the stage moves by a tenth of
    /// its static answer and more, nothing below 3 % (far above a mode, in an antiresonance), half a cosine between; and
    /// nothing where there are fewer than six samples a period.
    pub fn usable_share(&self, omega: f64, sample_rate_hz: f64) -> f64 {
        let taper = |share: f64| 0.5 * (1.0 - (PI * share.clamp(0.0, 1.0)).cos());
        let moving = taper((self.structure(omega).norm() - 0.03) / 0.07);
        let sampled = taper((sample_rate_hz / 6.0 - omega / TAU) / (sample_rate_hz / 24.0));
        moving * sampled
    }
}

/// A frequency response at the lines of a periodic record.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrequencyResponse {
    /// Angular frequency, rad/s.
    pub omega: Vec<f64>,
    /// Position over command, micrometres per volt.
    pub gain: Vec<Complex64>,
    /// Standard deviation of each, from the scatter between periods.
    pub deviation: Vec<f64>,
}

/// What the small-signal fit found.
#[derive(Debug, Clone, PartialEq)]
pub struct SmallSignal {
    /// Lag (biased by the hysteresis of small loops, to be refined on large signals) and modes.
    pub linear: LinearPart,
    /// The latency that they stand behind, half a sample of hold included: as stated, or shorter.
    pub latency_s: f64,
    /// Static gain at the bias, micrometres per volt.
    pub gain_um_per_v: f64,
    /// Constant phase of hysteresis and creep, rad.
    pub phase_rad: f64,
    /// Rms of the relative misfit over the lines.
    pub misfit: f64,
    /// Share of lines with a scatter below a tenth of the response.
    pub clear_lines: f64,
    /// Up to where the lines are what was fitted, hertz; none where they are nowhere over an octave.
    pub told_to_hz: Option<f64>,
}

/// The response at the odd lines that the command has, periods averaged.
///
/// # Errors
/// A record that does not hold at least three whole periods.
pub fn frequency_response(record: &Record) -> Result<FrequencyResponse, IdentifyError> {
    let unusable = |reason: String| IdentifyError::Control { reason };
    let periodic = period::detect(&record.voltage_v).ok_or_else(|| {
        unusable(format!(
            "{}: the small multisine does not repeat; record at least three whole periods of it",
            record.file
        ))
    })?;
    let n = periodic.samples;
    let count = periodic.count(record.len());
    if count < 3 {
        return Err(unusable(format!(
            "{}: {count} whole periods of the small multisine; record at least 3",
            record.file
        )));
    }
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let spectrum = |values: &[f64]| {
        let mut time = values.to_vec();
        let mut lines = fft.make_output_vec();
        // Lengths are the plan's own.
        let _ = fft.process(&mut time, &mut lines);
        lines
    };
    let first = record.len() - count * n;
    let inputs = spectrum(&record.voltage_v[first..first + n]);
    let outputs: Vec<_> = record.position_um[first..].chunks_exact(n).map(spectrum).collect();
    let largest = inputs.iter().skip(1).map(|x| x.norm()).fold(0.0, f64::max);
    let mut found = FrequencyResponse::default();
    for k in 1..n / 2 {
        // Lines of the multisine stand far above the leakage of its rounding.
        if inputs[k].norm() < 0.01 * largest {
            continue;
        }
        let mean: Complex64 = outputs.iter().map(|y| y[k]).sum::<Complex64>() / count as f64;
        let scatter: f64 = outputs.iter().map(|y| (y[k] - mean).norm_sqr()).sum();
        let of_mean = (scatter / (count * (count - 1)) as f64).sqrt();
        found.omega.push(TAU * k as f64 / (n as f64 * record.period_s));
        found.gain.push(mean / inputs[k]);
        found.deviation.push(of_mean / inputs[k].norm());
    }
    if found.omega.len() < 20 {
        return Err(unusable(format!(
            "{}: {} lines; a small multisine needs at least 20",
            record.file,
            found.omega.len()
        )));
    }
    Ok(found)
}

/// The model of the small-signal response, `K (w / w_0)^-s e^(j phi) e^(-j w d) hold(w) M(j w) / (1 + j w tau)`.
struct Shape {
    delay_s: f64,
    period_s: f64,
    modes: usize,
}

/// Relative error that the model is allowed on every line: small loops are not quite linear.
const MODEL_ERROR: f64 = 5e-3;
/// What is damped more than this does not ring: it is no mode, whatever it takes of the misfit.
const OVERDAMPED: f64 = 0.5;
/// Longest lag that is looked for: 50 ohm into 8 uF.
pub(super) const LONGEST_LAG_S: f64 = 4e-4;
/// Shortest lag that is told from none, seconds.
const SHORTEST_LAG_S: f64 = 1e-6;
/// Share of the squares below which another latency is believed.
const CLEARLY: f64 = 0.5;
/// How much shorter than stated a latency is tried to be, samples: by as much as large signals may say.
const EARLIER_SAMPLES: [f64; 3] = [0.5, 1.0, 1.5];
/// Reference of the creep's slope, rad/s.
const SLOPE_FROM: f64 = TAU * 100.0;

impl Shape {
    fn linear(&self, p: &[f64]) -> LinearPart {
        let mode = |i: usize, share: f64| ModeOfStage {
            frequency_hz: p[i].exp(),
            damping: p[i + 1].exp(),
            share,
        };
        let modes = match self.modes {
            0 => Vec::new(),
            1 => vec![mode(4, 1.0)],
            _ => vec![mode(4, 1.0 - p[8]), mode(6, p[8])],
        };
        LinearPart {
            lag_s: p[3].exp(),
            lag_growth: None,
            modes,
        }
    }

    fn at(&self, linear: &LinearPart, p: &[f64], omega: f64) -> Complex64 {
        let half = 0.5 * omega * self.period_s;
        let hold = if half > 0.0 { half.sin() / half } else { 1.0 };
        let slope = (omega / SLOPE_FROM).ln() * p[2];
        Complex64::from_polar(hold * (p[0] - slope).exp(), p[1] - omega * self.delay_s) * linear.response(omega)
    }

    fn residual(&self, p: &[f64], data: &FrequencyResponse) -> DVector<f64> {
        let linear = self.linear(p);
        let values = data.omega.iter().zip(&data.gain).zip(&data.deviation);
        let both = values.flat_map(|((&omega, &gain), &deviation)| {
            let allowed = deviation.hypot(MODEL_ERROR * gain.norm());
            let miss = (self.at(&linear, p, omega) - gain) / allowed;
            [miss.re, miss.im]
        });
        DVector::from_iterator(2 * data.omega.len(), both)
    }

    /// Levenberg-Marquardt with differences; parameters are logarithms and small numbers, so one step size serves.
    fn minimise(&self, start: Vec<f64>, data: &FrequencyResponse) -> (Vec<f64>, f64) {
        const STEP: f64 = 1e-6;
        let mut p = start;
        let mut residual = self.residual(&p, data);
        let mut cost = residual.norm_squared();
        let mut damping = 1e-3;
        for _ in 0..60 {
            let columns: Vec<DVector<f64>> = (0..p.len())
                .map(|j| {
                    let mut moved = p.clone();
                    moved[j] += STEP;
                    (self.residual(&moved, data) - &residual) / STEP
                })
                .collect();
            let jacobian = DMatrix::from_columns(&columns);
            let normal = jacobian.tr_mul(&jacobian);
            let slope = jacobian.tr_mul(&residual);
            let mut improved = false;
            for _ in 0..8 {
                let mut damped = normal.clone();
                for i in 0..p.len() {
                    damped[(i, i)] *= 1.0 + damping;
                    damped[(i, i)] += 1e-12;
                }
                let Some(step) = damped.cholesky().map(|factor| factor.solve(&slope)) else {
                    damping *= 10.0;
                    continue;
                };
                let next: Vec<f64> = p.iter().zip(step.iter()).map(|(p, s)| p - s.clamp(-1.0, 1.0)).collect();
                let next_residual = self.residual(&next, data);
                let next_cost = next_residual.norm_squared();
                if next_cost < cost {
                    improved = cost - next_cost > 1e-9 * cost;
                    (p, residual, cost) = (next, next_residual, next_cost);
                    damping *= 0.3;
                    break;
                }
                damping *= 10.0;
            }
            if !improved {
                break;
            }
        }
        (p, cost)
    }
}

/// Fits lag and modes to a response whose latency is known. Where that asks for no lag, or for one that no amplifier has, latencies up to
/// a sample and a half shorter are tried, one that is clearly closer stands, and goes on to where least is left.
///
/// A constant phase and a gain that falls with frequency stand for hysteresis and creep of small loops; without them the lag
/// would take both. A second mode is taken where it explains at least a third of what one leaves, rings, and
/// lies below half the sample rate.
///
/// # Errors
/// A response that is mostly noise.
pub fn fit_small_signal(data: &FrequencyResponse, delay_s: f64, period_s: f64) -> Result<SmallSignal, IdentifyError> {
    let clear = data
        .gain
        .iter()
        .zip(&data.deviation)
        .filter(|(g, d)| **d < 0.1 * g.norm());
    let clear_lines = clear.count() as f64 / data.omega.len() as f64;
    if clear_lines < 0.2 {
        return Err(IdentifyError::Control {
            reason: format!(
                "only {:.0} % of the small multisine's lines stand out of the noise; take a larger one or more periods",
                100.0 * clear_lines
            ),
        });
    }
    let mut found = with_delay(data, delay_s, period_s);
    if !(SHORTEST_LAG_S..=LONGEST_LAG_S).contains(&found.linear().lag_s) {
        let shorter = EARLIER_SAMPLES.map(|samples| delay_s - samples * period_s);
        let others = shorter.into_iter().filter(|delay_s| *delay_s >= 0.0);
        for other in others.map(|delay_s| with_delay(data, delay_s, period_s)) {
            if other.cost < CLEARLY * found.cost {
                found = other;
            }
        }
        if found.shape.delay_s < delay_s {
            found = between_samples(data, found, period_s);
        }
    }
    let (p, linear) = (&found.parameters, found.linear());
    Ok(SmallSignal {
        told_to_hz: told_to_hz(data, &linear, |omega| found.shape.at(&linear, p, omega)),
        linear,
        latency_s: found.shape.delay_s,
        gain_um_per_v: p[0].exp(),
        phase_rad: (p[1] + PI).rem_euclid(TAU) - PI,
        misfit: found.misfit(data),
        clear_lines,
    })
}

/// Halvings of the step by which a latency goes to where least is left.
const HALVINGS: u32 = 7;

/// The latency about the one that was found at which least is left: 5 us beside it leave twenty times the squares under a mode of 4.5 kHz.
fn between_samples(data: &FrequencyResponse, mut found: Fitted, period_s: f64) -> Fitted {
    let mut step_s = 0.25 * period_s;
    for _ in 0..HALVINGS {
        let middle_s = found.shape.delay_s;
        for delay_s in [middle_s - step_s, middle_s + step_s] {
            if delay_s >= 0.0 {
                let other = with_delay(data, delay_s, period_s);
                if other.cost < found.cost {
                    found = other;
                }
            }
        }
        step_s *= 0.5;
    }
    found
}

/// A fitted shape, and what it leaves.
struct Fitted {
    shape: Shape,
    parameters: Vec<f64>,
    cost: f64,
}

impl Fitted {
    fn linear(&self) -> LinearPart {
        self.shape.linear(&self.parameters)
    }

    /// Rms of the relative misfit over the lines.
    fn misfit(&self, data: &FrequencyResponse) -> f64 {
        MODEL_ERROR * (self.cost / (2 * data.omega.len()) as f64).sqrt()
    }
}

/// Fits lag and modes behind a delay.
fn with_delay(data: &FrequencyResponse, delay_s: f64, period_s: f64) -> Fitted {
    let gains: Vec<f64> = data.gain.iter().map(|g| g.norm()).collect();
    let lowest = gains[..gains.len().min(20)].iter().sum::<f64>() / gains.len().min(20) as f64;
    let peak = (0..gains.len())
        .max_by(|&a, &b| gains[a].total_cmp(&gains[b]))
        .unwrap_or(0);
    let shape = |modes| Shape {
        delay_s,
        period_s,
        modes,
    };
    let with_lags = |modes: usize, rest: &[f64]| {
        [20e-6_f64, 60e-6, 150e-6]
            .iter()
            .map(|lag_s| {
                let mut start = vec![lowest.ln(), -0.05, 0.01, lag_s.ln()];
                start.extend_from_slice(rest);
                shape(modes).minimise(start, data)
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or_default()
    };
    // A peak twice as high as the static gain is a mode, a lag never raises the gain.
    let (mut modes, mut best) = if gains[peak] > 2.0 * lowest {
        let start = [(data.omega[peak] / TAU).ln(), 0.02_f64.ln()];
        (1, with_lags(1, &start))
    } else {
        (0, with_lags(0, &[]))
    };
    if modes == 1 {
        let two = second_mode(&shape(2), &best.0, data);
        let rings = |mode: &ModeOfStage| mode.frequency_hz < 0.5 / period_s && mode.damping < OVERDAMPED;
        if two.1 < best.1 * 2.0 / 3.0 && shape(2).linear(&two.0).modes.iter().all(rings) {
            (modes, best) = (2, two);
        }
    }
    Fitted {
        shape: shape(modes),
        parameters: best.0,
        cost: best.1,
    }
}

/// Up to where the response is what a fit says, hertz.
fn told_to_hz(data: &FrequencyResponse, linear: &LinearPart, fitted: impl Fn(f64) -> Complex64) -> Option<f64> {
    let each = data.omega.iter().zip(&data.gain).zip(&data.deviation);
    let lines: Vec<Line> = each
        .map(|((&omega, &gain), &deviation)| Line {
            hz: omega / TAU,
            measured: gain,
            modelled: fitted(omega),
            drive: 1.0,
            explained: gain.norm_sqr(),
            all: gain.norm_sqr() + deviation * deviation,
        })
        .collect();
    let modes_hz: Vec<f64> = linear.modes.iter().map(|mode| mode.frequency_hz).collect();
    // The fit has the gain of this response itself, whatever its swing.
    highest_run(&lines, &modes_hz, 1.0)
}

/// A second mode above the first, from the best of a grid of starts.
fn second_mode(shape: &Shape, one: &[f64], data: &FrequencyResponse) -> (Vec<f64>, f64) {
    let first_hz = one[4].exp();
    let highest_hz = data.omega.last().map_or(0.0, |w| w / TAU);
    let mut starts: Vec<(Vec<f64>, f64)> = Vec::new();
    let mut hz = 1.3 * first_hz;
    while hz < highest_hz {
        for share in [0.03, -0.03] {
            let mut start = one.to_vec();
            start.extend_from_slice(&[hz.ln(), one[5], share]);
            let cost = shape.residual(&start, data).norm_squared();
            starts.push((start, cost));
        }
        // A mode of 2 % damping is 4 % wide.
        hz *= 1.02;
    }
    starts.sort_by(|a, b| a.1.total_cmp(&b.1));
    starts
        .into_iter()
        .take(3)
        .map(|(start, _)| shape.minimise(start, data))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((one.to_vec(), f64::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stage behind a latency and a lag, to 12 kHz: stated as 40 us, both are found all the same, between half samples as well.
    #[test]
    fn val_a_mode_behind_a_latency_that_was_stated_too_long() {
        const PERIOD_S: f64 = 20e-6;
        for (delay_s, lag_s, mode_hz) in [(20e-6, 15e-6_f64, 8400.0_f64), (14.3e-6, 18e-6, 4547.0)] {
            let stage = Shape {
                delay_s,
                period_s: PERIOD_S,
                modes: 1,
            };
            let p = [0.1_f64.ln(), -0.04, 0.01, lag_s.ln(), mode_hz.ln(), 0.02_f64.ln()];
            let omega: Vec<f64> = (1..600).map(|k| TAU * 20.0 * f64::from(k)).collect();
            let linear = stage.linear(&p);
            let gain: Vec<Complex64> = omega.iter().map(|w| stage.at(&linear, &p, *w)).collect();
            let data = FrequencyResponse {
                deviation: gain.iter().map(|gain| 1e-3 * gain.norm()).collect(),
                omega,
                gain,
            };
            for stated_s in [40e-6, delay_s] {
                let found = fit_small_signal(&data, stated_s, PERIOD_S).unwrap();
                let [mode] = found.linear.modes.as_slice() else {
                    panic!("{found:?}")
                };
                // The last halving steps by 0.08 us, half a percent of the lag.
                assert!((found.latency_s - delay_s).abs() < 0.08e-6, "{found:?}");
                assert!((mode.frequency_hz / mode_hz - 1.0).abs() < 1e-3, "{found:?}");
                assert!((mode.damping / 0.02 - 1.0).abs() < 0.01, "{found:?}");
                assert!((found.linear.lag_s / lag_s - 1.0).abs() < 0.01, "{found:?}");
            }
        }
    }
}
