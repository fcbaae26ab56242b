//! When a command has its effect: the converter's latency and the amplifier's lag.

use super::linear_part::LinearPart;
use hysteron_data::Record;

/// Most that a time constant changes from the middle of the range to its end, a share.
pub(super) const LARGEST_GROWTH: f64 = 0.5;
/// Most that the latency of records is off what is stated, samples.
pub(super) const MOST_OFF: f64 = 1.5;

/// The amplifier's lag: a time constant at a voltage behind it, and its growth a volt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AmplifierLag {
    pub tau_s: f64,
    pub about_v: f64,
    pub per_v: f64,
}

/// When a command has its effect: latency, the converter's hold included, and the amplifier's lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Timing {
    pub latency_s: f64,
    pub lag: AmplifierLag,
    /// Whether a structure behind it averages what the voltage does between the samples.
    pub averaged: bool,
}

impl Timing {
    /// With another time constant (s), growth (1/V), latency (s).
    pub(super) fn moved(self, [tau_s, per_v, latency_s]: [f64; 3]) -> Self {
        Self {
            latency_s: self.latency_s + latency_s,
            lag: AmplifierLag {
                tau_s: self.lag.tau_s + tau_s,
                per_v: self.lag.per_v + per_v,
                ..self.lag
            },
            ..self
        }
    }

    /// Samples after which a command begins to act, and the time until it does after them, seconds.
    fn whole_and_late(self, period_s: f64) -> (usize, f64) {
        let samples = (self.latency_s / period_s - 0.5).max(0.0);
        // A rounding below a whole number of samples is the whole number.
        let whole = (samples + 1e-9).floor();
        (whole as usize, (samples - whole).max(0.0) * period_s)
    }

    /// How much later the voltage at the sample is than its mean over the steps, seconds: behind a step it approaches the next, so that
    /// on a ramp it is late by `f T + L T exp(-f T / tau)` at a share f of the step, with `L = 1 / (1 - exp(-T / tau))`, and on average by
    /// `tau + T / 2`.
    fn late_at_the_sample_s(self, period_s: f64) -> f64 {
        let (_, late_s) = self.whole_and_late(period_s);
        let (since_s, tau_s) = (period_s - late_s, self.lag.tau_s);
        let decay = |time_s: f64| if tau_s > 0.0 { (-time_s / tau_s).exp() } else { 0.0 };
        since_s + period_s * decay(since_s) / (1.0 - decay(period_s)) - tau_s - 0.5 * period_s
    }
}

impl From<&LinearPart> for AmplifierLag {
    fn from(linear: &LinearPart) -> Self {
        let [about_v, per_v] = linear.lag_growth.unwrap_or_default();
        Self {
            tau_s: linear.lag_s,
            about_v,
            per_v,
        }
    }
}

impl AmplifierLag {
    /// The least that a time constant shrinks to, a share.
    const LEAST: f64 = 0.1;

    /// The way to a command that is held for a time.
    fn holding(self, time_s: f64) -> Held {
        Held {
            lag: self,
            time_s,
            left: (-time_s / self.tau_s).exp(),
        }
    }
}

/// A command that is held for a time.
struct Held {
    lag: AmplifierLag,
    time_s: f64,
    /// The share of the way that is left where the time constant has not grown.
    left: f64,
}

impl Held {
    /// Where a voltage arrives: with the time constant of the way's middle.
    fn after(&self, from_v: f64, to_v: f64) -> f64 {
        let AmplifierLag { tau_s, about_v, per_v } = self.lag;
        if tau_s <= 0.0 {
            return to_v;
        }
        let straight_v = to_v + (from_v - to_v) * self.left;
        if per_v == 0.0 {
            return straight_v;
        }
        let grown = |at_v: f64| (1.0 + per_v * (at_v - about_v)).max(AmplifierLag::LEAST);
        let times = self.time_s / tau_s;
        // With the time constant where it begins: the exponential of what that differs by, to its square.
        let more = times * (1.0 - 1.0 / grown(from_v));
        let arrives_v = to_v + (straight_v - to_v) * (1.0 + more * (1.0 + 0.5 * more));
        to_v + (from_v - to_v) * (-times / grown(0.5 * (from_v + arrives_v))).exp()
    }
}

/// The voltage behind latency, converter's hold and lag at each sample of a record: exact for a command that is held, then averaged where
/// a structure does.
pub(super) fn behind_lag(record: &Record, timing: Timing) -> Vec<f64> {
    let (voltage_v, period_s, lag) = (&record.voltage_v, record.period_s, timing.lag);
    let (whole, late) = timing.whole_and_late(period_s);
    let at = |k: usize, behind: usize| k.checked_sub(behind).map_or(0.0, |i| voltage_v[i]);
    let (first, then) = (lag.holding(late), lag.holding(period_s - late));
    let mut output = 0.0;
    let at_the_samples: Vec<f64> = (0..voltage_v.len())
        .map(|k| {
            let now = output;
            if late > 0.0 {
                output = first.after(output, at(k, whole + 1));
            }
            output = then.after(output, at(k, whole));
            now
        })
        .collect();
    if !timing.averaged {
        return at_the_samples;
    }
    let half_samples = 0.5 * timing.late_at_the_sample_s(period_s) / period_s;
    let last = at_the_samples.len().saturating_sub(1);
    let around = |k: usize| at_the_samples[(k + 1).min(last)] - at_the_samples[k.saturating_sub(1)];
    (0..at_the_samples.len())
        .map(|k| at_the_samples[k] + half_samples * around(k))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step of 1 V behind 1.5 samples of latency (one of computing, half of hold) and a lag.
    #[test]
    fn val_step_behind_the_lag() {
        let record = Record::new(
            "step.csv",
            hysteron_data::Role::Identify,
            20e-6,
            vec![1.0; 20],
            vec![0.0; 20],
        );
        let lag = AmplifierLag {
            tau_s: 60e-6,
            about_v: 0.0,
            per_v: 0.0,
        };
        let found = behind_lag(
            &record,
            Timing {
                latency_s: 30e-6,
                lag,
                averaged: false,
            },
        );
        for (k, v) in found.iter().enumerate() {
            let since_s = 20e-6 * (k as f64 - 1.0);
            let wanted = if since_s > 0.0 {
                1.0 - (-since_s / 60e-6).exp()
            } else {
                0.0
            };
            assert!((v - wanted).abs() < 1e-12, "{k}: {v} {wanted}");
        }
        // A quarter of a sample later.
        let found = behind_lag(
            &record,
            Timing {
                latency_s: 35e-6,
                lag,
                averaged: false,
            },
        );
        assert!((found[5] - (1.0 - (-75e-6_f64 / 60e-6).exp())).abs() < 1e-12);
    }

    /// A staircase of 1 V a sample behind a lag, followed in steps of a thousandth: less its mean over a sample, about the sample.
    #[test]
    fn val_at_the_sample_the_voltage_is_later_than_its_mean() {
        let period_s = 20e-6;
        for (latency_s, tau_s) in [(30e-6, 60e-6), (40e-6, 25e-6), (35e-6, 8e-6)] {
            let lag = AmplifierLag {
                tau_s,
                about_v: 0.0,
                per_v: 0.0,
            };
            let timing = Timing {
                latency_s,
                lag,
                averaged: true,
            };
            let arrives_s = latency_s - 0.5 * period_s;
            let step_s = 1e-3 * period_s;
            let mut path = vec![0.0];
            for k in 1..60_000 {
                let now_s = f64::from(k) * step_s - 0.5 * step_s;
                let command = ((now_s - arrives_s) / period_s).floor().max(0.0);
                let last = path[path.len() - 1];
                path.push(command + (last - command) * (-step_s / tau_s).exp());
            }
            // A ramp of 1 V a sample: volts behind it are samples behind it.
            let k = 50_000;
            let mean = path[k - 500..k + 500].iter().sum::<f64>() / 1000.0;
            let late_s = (mean - path[k]) * period_s;
            assert!(
                (timing.late_at_the_sample_s(period_s) - late_s).abs() < 2e-8,
                "{latency_s} {tau_s}: {late_s} {}",
                timing.late_at_the_sample_s(period_s)
            );
        }
    }

    /// A lag that grows, in steps of a thousandth of its time.
    #[test]
    fn val_a_growing_lag_is_followed() {
        let lag = AmplifierLag {
            tau_s: 30e-6,
            about_v: 50.0,
            per_v: 4e-3,
        };
        let mut exact = 20.0;
        for _ in 0..20_000 {
            exact += 1e-9 * (26.0 - exact) / (lag.tau_s * (1.0 + lag.per_v * (exact - lag.about_v)));
        }
        assert!((lag.holding(20e-6).after(20.0, 26.0) - exact).abs() < 2e-3, "{exact}");
        let constant = AmplifierLag { per_v: 0.0, ..lag };
        assert!((constant.holding(20e-6).after(20.0, 26.0) - exact).abs() > 0.1);
    }
}
