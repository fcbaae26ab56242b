//! Whether a candidate is significant, large enough to matter, and told from its rivals.

use crate::diagnosis::{EffectParameter, Level, RankedEffect};
use crate::missing::bench::{Bench, Trial};
use crate::missing::chain::Effect;
use crate::missing::hum::Hum;
use crate::missing::traces::Traces;
use hysteron_data::Dataset;
use hysteron_data::Role;
use hysteron_identify::effects::Effect as _;
use hysteron_identify::family::range;
use nalgebra::DVector;
use rayon::prelude::*;

/// Coarseness that a hysteresis of free shape leaves where nothing is missing, share of the stroke (0.02 to 0.08 % on Preisach
/// densities, 0.1 % behind rates): a fall below it proves nothing.
const COARSENESS: f64 = 1e-3;

/// The statistic must exceed this: two records whose squared error falls to a third.
pub(crate) const THRESHOLD: f64 = 2.0;

/// Gain in log-likelihood that must be exceeded: odds of 1 to 20 000 against chance, among some 40 forms tried.
const LEAST_GAIN: f64 = 10.0;

/// An effect that takes less of the squared error than this beyond what the coarseness explains leaves the main thing unnamed.
const LEAST_SHARE: f64 = 0.6;

/// A drift whose share of the squared error is above this leaves no room for jumps.
pub(crate) const DRIFT_SHARE: f64 = 0.9;

/// Hum must take this share of the squared error: a fixture that vibrates near the mains has a line there too.
const LEAST_HUM: f64 = 0.2;

/// Hum of this share is enough where nothing above the noise is left.
pub(crate) const HUM_ALONE: f64 = 0.3;

/// Records that must all drift the same way, at the least: nine do so by chance once in 256 times.
const ALIKE_IN: usize = 9;

/// An error of which more than this is left, percent of peak to peak, hides a medium effect (1 to 2 %) as large as a name.
const MUCH_LEFT_PERCENT: f64 = 1.2;

/// Then this share of the squared error must be taken.
const LARGE_SHARE: f64 = 0.8;

/// What an effect takes, rms over the records that move, must reach this, percent of peak to peak: an effect of 0.3 %
/// leaves 0.1 after its best mimic has absorbed what it can.
const TAKEN_PERCENT: f64 = 0.1;

/// Errors below this share of peak to peak, percent, are not looked into.
pub(crate) const MATTERS_PERCENT: f64 = 0.3;

/// What all comparisons start from.
pub(crate) struct Judge {
    floor_um2: f64,
    start: Vec<f64>,
    /// A hum that was taken from the records before the search.
    hum: Option<Hum>,
    /// Effects in the chain before anything was found.
    given: usize,
    moves: Vec<bool>,
    stroke_um2: Vec<f64>,
    /// Shortest sample period, seconds.
    finest_s: f64,
}

/// Sum over records of the logarithm of the squared error's fall, from one trial to another.
pub(crate) fn total(bench: &Bench<'_>, from: &Trial, to: &Trial) -> f64 {
    let floor = floor_um2(bench);
    from.held_out
        .iter()
        .zip(&to.held_out)
        .map(|(a, b)| ((floor + a) / (floor + b)).ln())
        .sum()
}

fn floor_um2(bench: &Bench<'_>) -> f64 {
    bench.noise_um.powi(2) + (COARSENESS * bench.traces.stroke_um).powi(2)
}

impl Judge {
    pub(crate) fn new(bench: &Bench<'_>, start: &Trial) -> Self {
        Self {
            floor_um2: floor_um2(bench),
            start: start.held_out.clone(),
            hum: None,
            given: start.effects.len(),
            moves: bench.traces.each.iter().map(|t| t.stroke_um > 0.0).collect(),
            stroke_um2: bench.traces.each.iter().map(|t| t.stroke_um.powi(2)).collect(),
            finest_s: bench
                .traces
                .each
                .iter()
                .map(|t| t.period_s)
                .fold(f64::INFINITY, f64::min),
        }
    }

    /// Mean squared error relative to each record's stroke, over the records that move, above the floor.
    fn excess(&self, held_out: &[f64]) -> f64 {
        held_out
            .iter()
            .zip(&self.stroke_um2)
            .zip(&self.moves)
            .filter(|(_, moves)| **moves)
            .map(|((h, s), _)| (h - self.floor_um2).max(0.0) / s)
            .sum()
    }

    /// All trials against the current one, best first, one entry an effect; the index is that of the trial.
    pub(crate) fn rank(
        &self,
        bench: &Bench<'_>,
        current: &Trial,
        trials: &[(&'static str, Trial)],
    ) -> Vec<(usize, RankedEffect)> {
        // A trial may come with another ridge than the current one, and gain by that alone: both are compared under the same.
        let mut ridges: Vec<f64> = trials
            .iter()
            .map(|t| t.1.ridge)
            .filter(|r| *r != current.ridge)
            .collect();
        ridges.sort_by(f64::total_cmp);
        ridges.dedup();
        let others: Vec<Trial> = ridges
            .par_iter()
            .map(|&ridge| bench.with_ridge(ridge).fit_to_the_end(&current.effects))
            .collect();
        let mut ranked: Vec<(usize, RankedEffect)> = Vec::new();
        for (index, (name, trial)) in trials.iter().enumerate() {
            let same_ridge = others.iter().find(|t| t.ridge == trial.ridge).unwrap_or(current);
            let rival = if total(bench, current, same_ridge) > 0.0 {
                same_ridge
            } else {
                current
            };
            let entry = self.entry(bench, rival, name, trial);
            match ranked.iter_mut().find(|r| r.1.effect == *name) {
                Some(old) if (old.1.significant, old.1.statistic) >= (entry.significant, entry.statistic) => {}
                Some(old) => *old = (index, entry),
                None => ranked.push((index, entry)),
            }
        }
        ranked.sort_by(|a, b| {
            (b.1.significant, b.1.statistic)
                .partial_cmp(&(a.1.significant, a.1.statistic))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        let least = ranked.first().map_or(f64::INFINITY, |r| r.1.statistic) - UNDECIDED;
        let close = ranked.partition_point(|r| r.1.significant && r.1.statistic > least);
        ranked[..close].sort_by(|a, b| b.1.log_likelihood_gain.total_cmp(&a.1.log_likelihood_gain));
        ranked
    }

    fn entry(&self, bench: &Bench<'_>, current: &Trial, name: &str, trial: &Trial) -> RankedEffect {
        let first = current.effects.len() == self.given;
        let pairs = || current.held_out.iter().zip(&trial.held_out);
        let statistic = pairs()
            .map(|(a, b)| ((self.floor_um2 + a) / (self.floor_um2 + b)).ln())
            .sum();
        let gain = pairs()
            .zip(&trial.effective)
            .map(|((a, b), n)| 0.5 * n * ((self.floor_um2 + a) / (self.floor_um2 + b)).ln())
            .sum();
        let (was, is) = (self.excess(&current.held_out), self.excess(&trial.held_out));
        let share = if was > 0.0 { 1.0 - is / was } else { 0.0 };
        let moving = self.moves.iter().filter(|m| **m).count().max(1) as f64;
        let taken_percent = 100.0 * ((was - is).max(0.0) / moving).sqrt();
        // The fit to all identification records, and its forecast of the others, must gain as well.
        let pooled = |t: &Trial| (t.identify_percent.powi(2) + t.validate_percent.powi(2)) / 2.0;
        let fallen_percent = (pooled(current) - pooled(trial)).max(0.0).sqrt();
        let added: Vec<&Effect> = trial
            .effects
            .iter()
            .filter(|e| !super::is_given(&current.effects, e))
            .collect();
        RankedEffect {
            effect: name.to_owned(),
            identify_percent: trial.identify_percent,
            validate_percent: trial.validate_percent,
            statistic,
            threshold: THRESHOLD,
            log_likelihood_gain: gain,
            effective_samples: trial.effective.iter().sum(),
            share,
            significant: statistic > THRESHOLD
                && gain > LEAST_GAIN
                // A first effect may be one of several; what comes on top of another must be a good part of what is left.
                && share > if first { 0.1 } else { 0.3 }
                && taken_percent.min(fallen_percent) > TAKEN_PERCENT
                && added.iter().all(|e| plausible(bench, e, trial)),
            level: Level::Physical,
            parameters: bench.parameters(trial, &added),
        }
    }

    /// Whether enough is left for another effect.
    pub(crate) fn worth_going_on(&self, trial: Option<&Trial>) -> bool {
        trial.is_some_and(|t| self.excess(&t.held_out) > 0.05 * self.excess(&self.start))
    }

    /// Counts a hum that was taken from the records before the search among what is explained.
    pub(crate) fn without(&mut self, hum: Hum) {
        self.hum = Some(hum);
    }

    /// Whether what was found takes most of the structure, and so much that no larger thing than itself can be left.
    pub(crate) fn explains_enough(&self, last: &Trial, left_percent: f64) -> bool {
        let (mut start, mut left) = (self.start.clone(), last.held_out.clone());
        if let Some(hum) = &self.hum {
            start.iter_mut().zip(&hum.taken_um2).for_each(|(s, t)| *s += t);
            left.iter_mut()
                .zip(&hum.untold_um2)
                .for_each(|(l, t)| *l = (*l - t).max(0.0));
        }
        let was = self.excess(&start);
        let share = if was > 0.0 { 1.0 - self.excess(&left) / was } else { 1.0 };
        share
            > if left_percent > MUCH_LEFT_PERCENT {
                LARGE_SHARE
            } else {
                LEAST_SHARE
            }
    }

    /// Whether what is left without a drift that was found goes the same way in every record that moves.
    pub(crate) fn drifts_alike(&self, start: &Trial, found: &[(&'static str, Trial)]) -> bool {
        let drifts = |trial: &Trial| trial.effects.contains(&Effect::ElapsedTime);
        let Some(place) = found
            .iter()
            .position(|(_, trial)| drifts(trial))
            .filter(|_| !drifts(start))
        else {
            return false;
        };
        let without = place.checked_sub(1).map_or(start, |before| &found[before].1);
        let slope = |residual: &DVector<f64>| {
            let middle = (residual.len() as f64 - 1.0) / 2.0;
            residual
                .iter()
                .enumerate()
                .map(|(k, r)| (k as f64 - middle) * r)
                .sum::<f64>()
        };
        let moving = without.residuals.iter().zip(&self.moves).filter(|(_, moves)| **moves);
        let rises: Vec<bool> = moving.map(|(residual, _)| slope(residual) > 0.0).collect();
        rises.len() >= ALIKE_IN && rises.iter().all(|rises_too| *rises_too == rises[0])
    }

    /// Hum as an entry of the ranking.
    pub(crate) fn hum(&self, bench: &Bench<'_>, last: &Trial, hum: &Hum) -> RankedEffect {
        let without: Vec<f64> = last
            .held_out
            .iter()
            .zip(&hum.taken_um2)
            .map(|(h, t)| (h - t).max(0.0))
            .collect();
        // A resting record has no stroke; its error counts by the largest one.
        let floor = (COARSENESS * bench.traces.stroke_um).powi(2);
        let statistic = last
            .held_out
            .iter()
            .zip(&without)
            .map(|(a, b)| ((floor + a) / (floor + b)).ln())
            .sum::<f64>();
        let sum = |v: &[f64]| -> f64 { v.iter().zip(&self.moves).filter(|(_, m)| **m).map(|(v, _)| v).sum() };
        let percent = |role: Role| {
            let squares: Vec<f64> = bench
                .traces
                .each
                .iter()
                .enumerate()
                .filter(|(_, t)| t.role == role && t.stroke_um > 0.0)
                .map(|(i, t)| {
                    let mean = super::bench::mean_square(&last.residuals[i]);
                    1e4 * (mean - hum.taken_um2[i]).max(0.0) / t.stroke_um.powi(2)
                })
                .collect();
            (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
        };
        let share = 1.0 - sum(&without) / sum(&last.held_out).max(f64::MIN_POSITIVE);
        RankedEffect {
            effect: "mains-hum".to_owned(),
            identify_percent: percent(Role::Identify),
            validate_percent: percent(Role::Validate),
            statistic,
            threshold: THRESHOLD,
            log_likelihood_gain: 0.5
                * last
                    .held_out
                    .iter()
                    .zip(&without)
                    .zip(&last.effective)
                    .map(|((a, b), n)| n * ((floor + a) / (floor + b)).ln())
                    .sum::<f64>(),
            effective_samples: last.effective.iter().sum(),
            share,
            significant: statistic > THRESHOLD && share > LEAST_HUM && 2 * hum.seen_in > hum.of && hum.of > 0,
            level: Level::Physical,
            parameters: vec![
                parameter("frequency", hum.frequency_hz, "Hz"),
                parameter("amplitude", hum.amplitude_um, "um"),
            ],
        }
    }

    /// Effects whose prediction is as good as the verdict's, within what these records can tell; all that are significant
    /// where the hysteresis' shape is not free to take its part.
    pub(crate) fn also_possible(&self, verdict: &str, ranking: &[RankedEffect], free: bool) -> Vec<String> {
        // The loops alone do not tell a bend of the drive from one of the sensor, nor either from the stage's own shape.
        let bends = |r: &&RankedEffect| r.level == Level::Shape && r.share > EQUIVALENT_SHARE;
        if verdict == "hysteresis-shape" {
            return ranking.iter().filter(bends).map(|r| r.effect.clone()).collect();
        }
        let Some(first) = ranking.iter().find(|r| r.effect == verdict && r.significant) else {
            return Vec::new();
        };
        // A dead band was seen, not fitted: no other effect stands for it.
        if verdict == "backlash" && first.level == Level::Physical {
            return Vec::new();
        }
        // A delay and a lag of the same length part in gain by (w tau)^2 / 2: below half a sample, not below the band's end.
        let short = |r: &RankedEffect| {
            r.parameters
                .iter()
                .all(|p| p.unit == "s" && p.value < 0.5 * self.finest_s)
        };
        let twins = |r: &RankedEffect| {
            let pair = ["delay", "first-order-lag"];
            pair.contains(&verdict) && pair.contains(&r.effect.as_str()) && short(first) && short(r)
        };
        let error = |r: &RankedEffect| r.identify_percent.hypot(r.validate_percent);
        let as_good = |r: &RankedEffect| {
            (first.statistic - r.statistic).abs() < UNDECIDED
                || r.statistic > AS_FAR * first.statistic
                    && r.log_likelihood_gain > AS_LIKELY * first.log_likelihood_gain
        };
        ranking
            .iter()
            .filter(|r| r.effect != verdict && r.level == first.level && r.effect != "mains-hum")
            .filter(|r| match r.level {
                Level::Physical => r.significant && (!free || twins(r) || as_good(r)),
                Level::Shape => bends(r) && !r.significant && error(r) < AS_GOOD * error(first),
            })
            .map(|r| r.effect.clone())
            .collect()
    }
}

/// Share of what the family lacks from which another bend is as good an explanation of the loops.
const EQUIVALENT_SHARE: f64 = 0.9;

/// ... unless it leaves this much more than the one that is named, as a ratio of errors.
const AS_GOOD: f64 = 1.5;

/// Rivals closer than this in the statistic, one record's squared error by a factor of 1.3, are ranked by likelihood: it counts
/// how white a residual is, which the fall of the squared error does not see (a delay beside a lag of the same length).
pub(crate) const UNDECIDED: f64 = 0.25;

/// Rivals whose statistic reaches this share of the best, and whose likelihood theirs, are not told apart.
const AS_FAR: f64 = 0.9;

/// Of those, gains in log-likelihood above this share of the first one's are not told apart.
const AS_LIKELY: f64 = 0.8;

/// Physical bounds on what was found.
fn plausible(bench: &Bench<'_>, effect: &Effect, trial: &Trial) -> bool {
    let of_effect = bench.coefficients_of(trial, effect);
    let last = of_effect.last().copied().unwrap_or(0.0);
    match effect {
        Effect::Temperature => moves_the_zero(bench, last),
        Effect::EndStop { .. } => last > 1.0 - super::bench::MOST_COMPLIANT,
        Effect::Mode { zeta, .. } => *zeta < 0.999 * super::candidates::MOST_DAMPING,
        Effect::RateEnvelope { up, down, .. } => up.max(*down) <= super::candidates::LARGEST_ENVELOPE_S,
        Effect::RateShift { up, down, exponent, .. } => {
            let peak = super::chain::peak_rate(&bench.traces.each);
            up.max(*down) * peak.powf(*exponent) <= super::candidates::LARGEST_ENVELOPE_S * peak
        }
        // The position at the start carries over one to one.
        Effect::StartOffset => (0.5..2.0).contains(&last),
        _ => true,
    }
}

/// Whether a position that follows the temperature also moves the zero at the records' starts, as heat does and creep does not.
fn moves_the_zero(bench: &Bench<'_>, um_per_k: f64) -> bool {
    let starts: Vec<_> = bench
        .traces
        .each
        .iter()
        .filter(|t| t.start_error_um.is_finite())
        .filter_map(|t| Some((t.start_offset_um, *t.temperature_c.as_ref()?.get(t.from)?)))
        .collect();
    if starts.len() < 4 {
        return true;
    }
    let n = starts.len() as f64;
    let (mean_um, mean_k) = starts.iter().fold((0.0, 0.0), |m, s| (m.0 + s.0 / n, m.1 + s.1 / n));
    let all: f64 = starts.iter().map(|s| (s.0 - mean_um).powi(2)).sum();
    let left: f64 = starts
        .iter()
        .map(|s| (s.0 - mean_um - um_per_k * (s.1 - mean_k)).powi(2))
        .sum();
    left < 0.5 * all
}

/// A parameter of an entry.
pub(crate) fn parameter(name: &str, value: f64, unit: &str) -> EffectParameter {
    EffectParameter {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
    }
}

/// An effect's parameters in words and units.
pub(crate) fn parameters(effect: &Effect, coefficients: &[f64]) -> Vec<EffectParameter> {
    let each = |names: &[&str], unit: &str| -> Vec<EffectParameter> {
        names
            .iter()
            .zip(coefficients)
            .map(|(name, &c)| parameter(name, c, unit))
            .collect()
    };
    match effect {
        Effect::Creep { taus_s } => {
            let of_tau = taus_s.iter().zip(coefficients).filter(|(_, c)| **c > 0.0);
            of_tau
                .map(|(tau, &c)| parameter(&format!("relative_creep_of_{tau:.3}_s"), c, ""))
                .collect()
        }
        Effect::LogGain => each(&["gain_fall_per_decade"], ""),
        Effect::Temperature => each(&["position_per_kelvin"], "um/K"),
        Effect::TemperatureGain => each(&["gain_per_kelvin"], "1/K"),
        Effect::StartOffset => each(&["share_of_start_offset"], ""),
        Effect::ElapsedTime => each(&["position_per_hour"], "um/h"),
        Effect::Cross => each(&["coupling"], "um a half span of the other drive"),
        Effect::SensorPowers => each(&["second_power", "third_power"], "um^(1-n)"),
        Effect::DrivePowers => each(&["second_power", "third_power", "fourth_power", "fifth_power"], "um"),
        Effect::Delay { delay_s } => vec![parameter("delay", *delay_s, "s")],
        Effect::LagBefore { tau_s } => vec![parameter("time_constant_before_hysteresis", *tau_s, "s")],
        Effect::LagAfter { tau_s } => vec![parameter("time_constant_after_hysteresis", *tau_s, "s")],
        Effect::Mode { frequency_hz, zeta } => {
            vec![
                parameter("frequency", *frequency_hz, "Hz"),
                parameter("damping_ratio", *zeta, ""),
            ]
        }
        Effect::Slew { per_s } => vec![parameter("limit", *per_s, "half spans of the drive/s")],
        Effect::ClipDrive { low, high } => {
            vec![
                parameter("lowest", *low, "half spans of the drive"),
                parameter("highest", *high, "half spans of the drive"),
            ]
        }
        Effect::RateShift { up, down, exponent, .. } => {
            let unit = if *exponent == 1.0 { "s" } else { "scaled" };
            vec![
                parameter("alpha", *up, unit),
                parameter("beta", *down, unit),
                parameter("exponent", *exponent, ""),
            ]
        }
        Effect::RateEnvelope { up, down, .. } => vec![parameter("alpha", *up, "s"), parameter("beta", *down, "s")],
        Effect::RateThreshold { growth } => vec![parameter("threshold_growth_per_decade", *growth, "")],
        Effect::EndStop { low_um, high_um } => vec![parameter("low", *low_um, "um"), parameter("high", *high_um, "um")],
        Effect::Backlash { width_um } => vec![parameter("width", *width_um, "um")],
        Effect::User { effect, values } => {
            let named = effect.description().parameters.iter().zip(values);
            named.map(|(p, &value)| parameter(p.name, value, p.unit)).collect()
        }
    }
}

/// Why records cannot answer, one sentence each; empty where they can.
pub(crate) fn cannot_answer(dataset: &Dataset, traces: &Traces, noise_um: f64) -> Vec<String> {
    let mut reasons = Vec::new();
    let moving: Vec<_> = traces.each.iter().filter(|t| t.stroke_um > 0.0).collect();
    if moving.is_empty() {
        reasons.push("nothing-moves".to_owned());
        return reasons;
    }
    if !moving.iter().any(|t| t.role == Role::Validate) {
        reasons.push("no-validation".to_owned());
    }
    if !moving.iter().any(|t| t.role == Role::Identify) {
        reasons.push("no-identification".to_owned());
    }
    // Below 30 the noise hides a medium effect (1 % of peak to peak) in every single sample.
    if traces.stroke_um < 30.0 * noise_um {
        reasons.push("all-noise".to_owned());
    }
    let samples: usize = moving.iter().map(|t| t.len() - t.from).sum();
    // A top that stands exactly still while the drive moves on.
    let stuck: usize = dataset.records.iter().map(stuck_at_extremes).sum();
    if stuck * 20 > samples {
        reasons.push("clipped".to_owned());
    }
    let kinds = distinct_excitations(&moving);
    if kinds < 2 {
        reasons.push("one-excitation".to_owned());
    }
    reasons
}

fn stuck_at_extremes(record: &hysteron_data::Record) -> usize {
    let (low, high) = range(record.position_um.iter().copied());
    if high <= low {
        return 0;
    }
    record.stuck_at(low) + record.stuck_at(high)
}

/// How many different things were played: sines of one frequency and amplitude count once, anything broad counts as two.
fn distinct_excitations(moving: &[&super::traces::Trace]) -> usize {
    let mut sines: Vec<(f64, f64)> = Vec::new();
    let mut broad = 0;
    for t in moving {
        let own = &t.drive[t.from..];
        match sine_of(own, t.period_s) {
            Some((f, a)) => {
                if !sines
                    .iter()
                    .any(|s| (s.0 / f - 1.0).abs() < 0.02 && (s.1 / a - 1.0).abs() < 0.02)
                {
                    sines.push((f, a));
                }
            }
            None => broad += 2,
        }
    }
    sines.len() + broad
}

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
    let f = (crossings.len() - 1) as f64 / (2.0 * (last - first) as f64 * period_s);
    // Least squares on the frequency found: what is no sine leaves more than 3 % of the amplitude.
    let omega = std::f64::consts::TAU * f * period_s;
    let (mut s, mut c) = (0.0, 0.0);
    for (k, v) in drive.iter().enumerate() {
        s += (v - middle) * (omega * k as f64).sin();
        c += (v - middle) * (omega * k as f64).cos();
    }
    let n = drive.len() as f64 / 2.0;
    let (s, c) = (s / n, c / n);
    let rest = drive
        .iter()
        .enumerate()
        .map(|(k, v)| (v - middle - s * (omega * k as f64).sin() - c * (omega * k as f64).cos()).powi(2))
        .sum::<f64>()
        / drive.len() as f64;
    (rest.sqrt() < 0.1 * amplitude).then_some((f, amplitude))
}
