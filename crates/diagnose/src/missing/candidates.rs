//! The effects that can be missing, and the search for each one's parameters.

use crate::missing::bench::Bench;
use crate::missing::chain::{self, Effect};
use crate::missing::traces::Traces;
use crate::spectrum::periodogram;

/// A candidate: the name under which it is reported, and its forms.
pub(crate) struct Candidate {
    pub name: &'static str,
    pub search: fn(&Bench<'_>, &[Effect]) -> Vec<Vec<Effect>>,
}

/// All candidates whose effect is more than the shape of the loops.
pub(crate) const PHYSICAL: [Candidate; 9] = [
    Candidate {
        name: "delay",
        search: delay,
    },
    Candidate {
        name: "first-order-lag",
        search: lag,
    },
    Candidate {
        name: "resonance",
        search: resonance,
    },
    Candidate {
        name: "rate-dependence",
        search: rate,
    },
    Candidate {
        name: "slew-limit",
        search: slew,
    },
    Candidate {
        name: "saturation",
        search: saturation,
    },
    Candidate {
        name: "creep",
        search: creep,
    },
    Candidate {
        name: "thermal-drift",
        search: thermal,
    },
    Candidate {
        name: "cross-coupling",
        search: cross,
    },
];

/// Largest alpha and beta, seconds: fifty times the paper's.
pub(crate) const LARGEST_ENVELOPE_S: f64 = 1e-3;

/// Longest delay or lag searched, seconds: slow sensor filters reach 2 ms.
const LONGEST_S: f64 = 3e-3;

fn shortest(traces: &Traces) -> f64 {
    traces.each.iter().map(|t| t.period_s).fold(f64::INFINITY, f64::min)
}

/// Shortest step of the grids on which the records are run.
fn shortest_step(traces: &Traces) -> f64 {
    traces
        .each
        .iter()
        .map(|t| t.on_grid().period_s)
        .fold(f64::INFINITY, f64::min)
}

fn duration(traces: &Traces) -> f64 {
    traces
        .each
        .iter()
        .map(|t| t.period_s * t.len() as f64)
        .fold(0.0, f64::max)
}

/// Least of `f` over a positive parameter: a scan in equal ratios, then golden section beside the best.
fn least(low: f64, high: f64, scan: usize, refine: u32, f: impl Fn(f64) -> f64) -> (f64, f64) {
    let (a, b) = (low.ln(), high.ln());
    let step = (b - a) / (scan.max(2) - 1) as f64;
    let mut best = (f64::INFINITY, a);
    for k in 0..scan.max(2) {
        let x = a + step * k as f64;
        let value = f(x.exp());
        if value < best.0 {
            best = (value, x);
        }
    }
    let (mut low, mut high) = ((best.1 - step).max(a), (best.1 + step).min(b));
    const RATIO: f64 = 0.618_033_988_749_894_8; // (sqrt 5 - 1) / 2
    let (mut p, mut q) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut fp, mut fq) = (f(p.exp()), f(q.exp()));
    for _ in 0..refine {
        if fp < fq {
            (high, q, fq) = (q, p, fp);
            p = high - RATIO * (high - low);
            fp = f(p.exp());
        } else {
            (low, p, fp) = (p, q, fq);
            q = low + RATIO * (high - low);
            fq = f(q.exp());
        }
    }
    let last = if fp < fq { (fp, p) } else { (fq, q) };
    let (value, x) = if last.0 < best.0 { last } else { best };
    (x.exp(), value)
}

fn with(given: &[Effect], more: Effect) -> Vec<Effect> {
    given.iter().cloned().chain([more]).collect()
}

/// One-parameter forms: searched, then given back with the rest of the chain.
///
/// A rate dependence that the model has already may have taken the place of what is tried now: it is fitted again with it.
fn one(
    bench: &Bench<'_>,
    given: &[Effect],
    (low, high): (f64, f64),
    scan: usize,
    form: impl Fn(f64) -> Effect,
) -> Vec<Effect> {
    if !given.iter().any(Effect::is_rate) {
        let (x, _) = least(low, high, scan, 9, |x| bench.objective(&with(given, form(x))));
        return with(given, form(x));
    }
    let chain = |share: f64, x: f64| with(&slower(given, share), form(x));
    let mut best = (f64::INFINITY, low, 1.0);
    for share in [1.0, 0.4] {
        let (x, value) = least(low, high, scan, 0, |x| bench.objective(&chain(share, x)));
        if value < best.0 {
            best = (value, x, share);
        }
    }
    let mut step: f64 = (high / low).powf(1.0 / (scan - 1) as f64);
    for _ in 0..2 {
        let (share, value) = least(best.2 / 1.6, best.2 * 1.6, 3, 2, |share| {
            bench.objective(&chain(share, best.1))
        });
        if value < best.0 {
            best = (value, best.1, share);
        }
        let (x, value) = least((best.1 / step).max(low), (best.1 * step).min(high), 3, 4, |x| {
            bench.objective(&chain(best.2, x))
        });
        if value < best.0 {
            best = (value, x, best.2);
        }
        step = step.sqrt();
    }
    chain(best.2, best.1)
}

/// The chain with its rate dependence scaled.
fn slower(given: &[Effect], share: f64) -> Vec<Effect> {
    let mut chain = given.to_vec();
    for effect in &mut chain {
        if let Effect::RateShift { up, down, .. } | Effect::RateEnvelope { up, down, .. } = effect {
            *up *= share;
            *down *= share;
        }
    }
    chain
}

fn delay(bench: &Bench<'_>, given: &[Effect]) -> Vec<Vec<Effect>> {
    if given.iter().any(|e| matches!(e, Effect::Delay { .. })) {
        return Vec::new();
    }
    let low = shortest(bench.traces) / 20.0;
    vec![one(bench, given, (low, LONGEST_S.max(4.0 * low)), 7, |delay_s| {
        Effect::Delay { delay_s }
    })]
}

fn lag(bench: &Bench<'_>, given: &[Effect]) -> Vec<Vec<Effect>> {
    if given
        .iter()
        .any(|e| matches!(e, Effect::LagBefore { .. } | Effect::LagAfter { .. }))
    {
        return Vec::new();
    }
    let low = shortest(bench.traces) / 20.0;
    let range = (low, LONGEST_S.max(4.0 * low));
    vec![
        one(bench, given, range, 7, |tau_s| Effect::LagBefore { tau_s }),
        one(bench, given, range, 7, |tau_s| Effect::LagAfter { tau_s }),
    ]
}

/// Largest damping ratio of a resonance: more would imitate lag and delay.
pub(crate) const MOST_DAMPING: f64 = 0.1;

/// Steps of a fiftieth on the way from a line to a mode: to a quarter of the line's frequency beside it.
const MOST_STEPS: usize = 12;

fn resonance(bench: &Bench<'_>, given: &[Effect]) -> Vec<Vec<Effect>> {
    let nyquist = 0.5 / shortest_step(bench.traces);
    // A tenth of a cycle in the longest record is no vibration; a mode far above the last sampled frequency shows only as inertia.
    let low = (5.0 / duration(bench.traces)).max(20.0).min(nyquist / 2.0);
    let mode = |frequency_hz: f64, zeta: f64| with(given, Effect::Mode { frequency_hz, zeta });
    let (mut f, mut value) = least(low, nyquist, 24, 0, |f| bench.objective(&mode(f, 0.03)));
    let mut zeta = 0.03;
    let mut span: f64 = (nyquist / low).powf(1.0 / 23.0);
    // A light mode that rings has a valley of its own width, which the scan may step over: the residual's lines show it.
    for line in lines(bench, given, low, nyquist) {
        // A mode just past the band that drives it shows at the band's end.
        for at_hz in [line, 0.97 * line, 1.03 * line] {
            for light in [0.03, 0.006] {
                let at = bench.objective(&mode(at_hz, light));
                if at < value {
                    (f, zeta, value, span) = (at_hz, light, at, 1.02);
                }
            }
        }
    }
    // The strongest line of a forced record need not be the mode: on the way to it the error falls.
    for ratio in [1.0 / span, span] {
        for _ in 0..MOST_STEPS {
            let next = f * ratio;
            let at = if (low..=nyquist).contains(&next) {
                bench.objective(&mode(next, zeta))
            } else {
                f64::INFINITY
            };
            if at >= value {
                break;
            }
            (f, value) = (next, at);
        }
    }
    for _ in 0..2 {
        let (best, at) = least(f / span, f * span, 3, 7, |f| bench.objective(&mode(f, zeta)));
        if at < value {
            (f, value) = (best, at);
        }
        let (best, at) = least(0.002, MOST_DAMPING, 4, 3, |zeta| bench.objective(&mode(f, zeta)));
        if at < value {
            (zeta, value) = (best, at);
        }
        span = span.powf(0.25);
    }
    vec![mode(f, zeta)]
}

/// Records whose spectra are searched for lines, and lines of each.
const LINES: (usize, usize) = (3, 2);

/// The strongest lines of what is left, in the moving records in which most is left.
fn lines(bench: &Bench<'_>, given: &[Effect], low: f64, high: f64) -> Vec<f64> {
    let trial = bench.fit(given, None);
    let residuals = bench.full_residuals(&trial);
    let mut records: Vec<(f64, usize)> = (0..residuals.len())
        .filter(|&i| bench.traces.each[i].stroke_um > 0.0)
        .map(|i| (trial.held_out[i] / bench.traces.each[i].stroke_um.powi(2), i))
        .collect();
    records.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut found = Vec::new();
    for &(_, i) in records.iter().take(LINES.0) {
        let trace = &bench.traces.each[i];
        let own = &residuals[i][trace.from..];
        let bin_hz = 1.0 / (own.len() as f64 * trace.period_s);
        let mut power = periodogram(own);
        for (k, p) in power.iter_mut().enumerate() {
            let f = k as f64 * bin_hz;
            // Displacement weighs slow errors; a mode stands out in its acceleration.
            *p *= if (low..0.9 * high).contains(&f) { f * f } else { 0.0 };
        }
        for _ in 0..LINES.1 {
            let best = (0..power.len())
                .max_by(|&a, &b| power[a].total_cmp(&power[b]))
                .unwrap_or(0);
            if power.get(best).is_none_or(|p| *p <= 0.0) {
                break;
            }
            found.push(best as f64 * bin_hz);
            let wide = best / 20 + 2;
            power[best.saturating_sub(wide)..(best + wide).min(own.len() / 2)].fill(0.0);
        }
    }
    found
}

fn rate(bench: &Bench<'_>, given: &[Effect]) -> Vec<Vec<Effect>> {
    let has_rate = |e: &Effect| e.is_rate() || matches!(e, Effect::RateThreshold { .. } | Effect::LogGain);
    if given.iter().any(has_rate) {
        return Vec::new();
    }
    let peak = chain::peak_rate(&bench.traces.each).max(f64::MIN_POSITIVE);
    // From a shift of a thousandth of the span at the peak rate to the longest envelope at a rate of one in its time.
    let range = |exponent: f64| (2e-3 / peak.powf(exponent), LARGEST_ENVELOPE_S.powf(exponent));
    let shift = |exponent: f64, narrow: f64| {
        both_branches(bench, given, range(exponent), |up, down| Effect::RateShift {
            up,
            down,
            exponent,
            narrow,
        })
    };
    vec![
        both_branches(bench, given, range(1.0), |up, down| Effect::RateEnvelope {
            up,
            down,
            narrow: 0.0,
        }),
        shift(1.0, chain::NARROW),
        shift(1.0, 0.0),
        shift(0.5, 0.0),
        one(bench, given, (3e-3, 0.5), 4, |growth| Effect::RateThreshold { growth }),
        with(given, Effect::LogGain),
    ]
}

/// A rate dependence that may be stronger on one branch than on the other.
fn both_branches(
    bench: &Bench<'_>,
    given: &[Effect],
    (low, high): (f64, f64),
    form: impl Fn(f64, f64) -> Effect,
) -> Vec<Effect> {
    let chain = |up: f64, down: f64| with(given, form(up, down));
    let (both, _) = least(low, high, 6, 6, |x| bench.objective(&chain(x, x)));
    // One branch may be slower than the other: their ratio, then both again.
    let (ratio, _) = least(0.25, 4.0, 3, 5, |q| {
        bench.objective(&chain(both * q.sqrt(), both / q.sqrt()))
    });
    let (both, _) = least(both / 1.5, both * 1.5, 3, 4, |x| {
        bench.objective(&chain(x * ratio.sqrt(), x / ratio.sqrt()))
    });
    chain(both * ratio.sqrt(), both / ratio.sqrt())
}

/// The rate dependence of a model that has one, fitted anew on a base: eq. 9, or a shift of the plays' input.
pub(crate) fn rate_of_model(bench: &Bench<'_>, given: &[Effect]) -> Vec<Effect> {
    let peak = chain::peak_rate(&bench.traces.each).max(f64::MIN_POSITIVE);
    let range = (2e-3 / peak, LARGEST_ENVELOPE_S);
    let narrow = chain::NARROW;
    let envelope = both_branches(bench, given, range, |up, down| Effect::RateEnvelope {
        up,
        down,
        narrow,
    });
    let shift = both_branches(bench, given, range, |up, down| Effect::RateShift {
        up,
        down,
        exponent: 1.0,
        narrow,
    });
    if bench.objective(&envelope) < bench.objective(&shift) {
        envelope
    } else {
        shift
    }
}

fn slew(bench: &Bench<'_>, given: &[Effect]) -> Vec<Vec<Effect>> {
    if given.iter().any(|e| matches!(e, Effect::Slew { .. })) {
        return Vec::new();
    }
    let peak = chain::peak_rate(&bench.traces.each);
    if peak <= 0.0 {
        return Vec::new();
    }
    vec![one(bench, given, (0.2 * peak, 0.999 * peak), 12, |per_s| {
        Effect::Slew { per_s }
    })]
}

fn saturation(bench: &Bench<'_>, given: &[Effect]) -> Vec<Vec<Effect>> {
    if given
        .iter()
        .any(|e| matches!(e, Effect::ClipDrive { .. } | Effect::EndStop { .. }))
    {
        return Vec::new();
    }
    let (low_um, high_um) = chain::position_range(&bench.traces.each);
    let span = high_um - low_um;
    let mut forms = Vec::new();
    // Depth of the cut as a share of the span, from below or above, at the amplifier or at the stop.
    let depth = (2e-3, 0.4);
    forms.push(one(bench, given, depth, 8, |d| Effect::ClipDrive {
        low: -2.0,
        high: 1.0 - 2.0 * d,
    }));
    forms.push(one(bench, given, depth, 8, |d| Effect::ClipDrive {
        low: -1.0 + 2.0 * d,
        high: 2.0,
    }));
    // A hard stop cuts the measured range itself: it lies within its last hundredths, or further in where it gives way.
    let depths = || (0..28).map(|k| 2e-4 * 1.32f64.powi(k));
    let from_above = bench.best_stop(given, depths().map(|d| [low_um - span, high_um - d * span]));
    let from_below = bench.best_stop(given, depths().map(|d| [low_um + d * span, high_um + span]));
    for [low_um, high_um] in [from_above, from_below].into_iter().flatten() {
        forms.push(with(given, Effect::EndStop { low_um, high_um }));
    }
    forms
}

fn creep(bench: &Bench<'_>, given: &[Effect]) -> Vec<Vec<Effect>> {
    if given.iter().any(|e| matches!(e, Effect::Creep { .. })) {
        return Vec::new();
    }
    let taus_s = creep_taus(bench.traces);
    if taus_s.is_empty() {
        return Vec::new();
    }
    vec![with(given, Effect::Creep { taus_s })]
}

/// Time constants of creep: two a decade from 50 ms, where structural dynamics end, to three times the longest record.
pub(crate) fn creep_taus(traces: &Traces) -> Vec<f64> {
    let longest = 3.0 * duration(traces);
    (0..12)
        .map(|k| 0.05 * 10f64.powf(0.5 * f64::from(k)))
        .take_while(|&t| t < longest)
        .collect()
}

fn thermal(bench: &Bench<'_>, given: &[Effect]) -> Vec<Vec<Effect>> {
    if given.iter().any(|e| {
        matches!(
            e,
            Effect::Temperature | Effect::TemperatureGain | Effect::StartOffset | Effect::ElapsedTime
        )
    }) {
        return Vec::new();
    }
    let mut forms = Vec::new();
    if bench.traces.each.iter().any(|t| t.temperature_c.is_some()) {
        forms.push(with(given, Effect::Temperature));
        forms.push(with(given, Effect::TemperatureGain));
        forms.push(with(&with(given, Effect::Temperature), Effect::TemperatureGain));
    }
    if bench.traces.each.iter().any(|t| t.start_offset_um != 0.0) {
        forms.push(with(given, Effect::StartOffset));
    }
    if bench.traces.without_temperature() {
        forms.push(with(given, Effect::ElapsedTime));
    }
    forms
}

fn cross(bench: &Bench<'_>, given: &[Effect]) -> Vec<Vec<Effect>> {
    if given.iter().any(|e| matches!(e, Effect::Cross)) {
        return Vec::new();
    }
    if bench.traces.each.iter().any(|t| t.drive2.is_some()) {
        vec![with(given, Effect::Cross)]
    } else {
        Vec::new()
    }
}
