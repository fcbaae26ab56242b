//! Lost motion after a reversal of the drive: a dead band needs no hysteresis model to be seen.
//!
//! Plays take lost motion in, since it is one; a stage's own loops set off at once where they turn, or gently.

use crate::diagnosis::{Before, Level, RankedEffect, parameter};
use crate::rules::MATTERS_PERCENT;
use crate::witness::traces::{Trace, Traces};
use hysteron_identify::EffectId;

/// Fastest drive that is looked at, spans a second: a millisecond of delay or lag is a hundredth of the span there.
const FASTEST_SPANS_PER_S: f64 = 10.0;

/// A drive turns where it goes back by this share of the span.
const TURN: f64 = 0.03;

/// A way before and after a reversal that is no dead band's own, share of the span.
const LEAST_WAY: f64 = 0.25;

/// Fewest reversals, and samples after one, that tell.
const FEWEST_REVERSALS: usize = 4;
const FEWEST_SAMPLES: usize = 10;

/// Samples after a reversal that are looked at.
const MOST_SAMPLES: usize = 400;

/// How many dead bands are tried, and their ends, shares of the span.
const BANDS: usize = 60;
const SMALLEST_BAND: f64 = 0.002;
const LARGEST_BAND: f64 = 0.2;

/// What is looked at, in dead bands.
const WINDOW: f64 = 2.5;

/// Within the band the position moves by less than this share of what it moves behind it, on the median of either direction.
const MOST_MOVED: f64 = 0.1;

/// Behind the band the position sets off with this share of its mean slope there: with all of it at the end of lost motion, with
/// half of it where a loop sets off along a parabola.
const LEAST_ONSET: f64 = 0.72;

/// The same band after every reversal: the middle half of them lie this close, as a share of the median.
const MOST_SPREAD: f64 = 0.5;

/// Lost motion is wider than so many steps of the position's converter, within which it stands still as well.
const LEAST_STEPS: f64 = 3.0;

/// The way after one reversal: drive and position against where they turned, in the direction of the drive, shares of the span and
/// micrometres.
struct Leg {
    rises: bool,
    way: Vec<f64>,
    moved_um: Vec<f64>,
}

/// One leg with a dead band: `moved = max(0, way - band) (slope + bend max(0, way - band))`.
struct Band {
    rises: bool,
    band: f64,
    /// Mean slope behind it, micrometres a span.
    mean_slope: f64,
    /// Slope at its end, as a share of that.
    onset: f64,
    /// Slope within it, as a share of that.
    moved: f64,
    /// Squared error, without a dead band and with it.
    without: f64,
    with: f64,
    samples: usize,
}

/// Lost motion: what the legs have in common.
struct LostMotion {
    /// Way of the drive over which the position stands still, volts.
    band_v: f64,
    /// What the position would move by over that way at the slope with which it sets off. Lost is no more: a stage's own slope grows
    /// after a reversal.
    largest_um: f64,
    /// Share of the slope behind the band with which the position moves within it.
    moved: f64,
    reversals: usize,
    samples: usize,
    /// Share of the squared error without a dead band that is left with it.
    left: f64,
}

/// Lost motion as an entry of the ranking, where the position stands still after every slow reversal.
pub(crate) fn find(traces: &Traces, left: &Before) -> Option<RankedEffect> {
    let lost = seen(traces)?;
    Some(RankedEffect {
        effect: EffectId::Backlash.into(),
        errors: *left,
        statistic: 1.0 - lost.moved,
        threshold: 1.0 - MOST_MOVED,
        log_likelihood_gain: -0.5 * lost.samples as f64 * lost.left.ln(),
        effective_samples: lost.samples as f64,
        share: 1.0 - lost.left,
        significant: true,
        level: Level::Physical,
        on_bound: false,
        parameters: vec![
            parameter("dead_band", lost.band_v, "V"),
            parameter("largest_width", lost.largest_um, "um"),
            parameter("reversals_looked_at", lost.reversals as f64, ""),
        ],
    })
}

/// The dead band behind every slow reversal, if there is one, abrupt at its end and of one width.
fn seen(traces: &Traces) -> Option<LostMotion> {
    let legs: Vec<Leg> = traces.each.iter().flat_map(legs).collect();
    let near: Vec<_> = legs.iter().map(|leg| leg.within(LEAST_WAY)).collect();
    let typical = best(bands(SMALLEST_BAND, LARGEST_BAND), |band| {
        Sums::of(near.iter().cloned().flatten(), band).solve().2
    });
    let found: Vec<Band> = legs.iter().filter_map(|leg| leg.band(typical)).collect();
    if found.len() < FEWEST_REVERSALS {
        return None;
    }
    let of = |value: fn(&Band) -> f64| quartiles(found.iter().map(value).collect());
    let [low, middle, high] = of(|b| b.band)?;
    let [_, onset, _] = of(|b| b.onset)?;
    let [_, largest_um, _] = of(|b| b.band * b.mean_slope * b.onset)?;
    let moved = |rises: bool| {
        let one_way = found.iter().filter(|b| b.rises == rises);
        quartiles(one_way.map(|b| b.moved).collect()).map(|[_, middle, _]| middle.abs())
    };
    let moved = moved(true)?.max(moved(false)?);
    let finest_um = traces.each.iter().map(finest_step_um).fold(f64::INFINITY, f64::min);
    let is_lost_motion = moved < MOST_MOVED
        && onset > LEAST_ONSET
        && high - low < MOST_SPREAD * middle
        && largest_um > MATTERS_PERCENT / 100.0 * traces.stroke_um
        && largest_um > LEAST_STEPS * finest_um;
    let sum = |value: fn(&Band) -> f64| found.iter().map(value).sum::<f64>();
    is_lost_motion.then(|| LostMotion {
        band_v: middle * 2.0 * traces.unit_v,
        largest_um,
        moved,
        reversals: found.len(),
        samples: found.iter().map(|b| b.samples).sum(),
        left: sum(|b| b.with) / sum(|b| b.without),
    })
}

/// The ways after the reversals of a slow record. Drives are scaled to -1 .. 1.
fn legs(trace: &Trace) -> Vec<Leg> {
    let drive = &trace.drive[trace.from..];
    let position = &trace.position_um[trace.from..];
    let fastest = drive.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max) / 2.0 / trace.period_s;
    if fastest > FASTEST_SPANS_PER_S {
        return Vec::new();
    }
    let turns = turns(drive);
    let ends: Vec<usize> = [0].into_iter().chain(turns).chain([drive.len() - 1]).collect();
    ends.windows(3)
        .filter_map(|at| {
            let [before, from, to] = [at[0], at[1], at[2]];
            let way = |a: usize, b: usize| (drive[b] - drive[a]) / 2.0;
            if way(before, from).abs() < LEAST_WAY || way(from, to).abs() < LEAST_WAY {
                return None;
            }
            let sign = way(from, to).signum();
            Some(Leg {
                rises: sign > 0.0,
                way: (from..=to).map(|k| sign * way(from, k)).collect(),
                moved_um: (from..=to).map(|k| sign * (position[k] - position[from])).collect(),
            })
        })
        .collect()
}

/// Where a drive turns: its last extreme samples, each followed by a way back of [`TURN`].
fn turns(drive: &[f64]) -> Vec<usize> {
    let mut turns = Vec::new();
    // The extremes since the last turn; a direction is known from the first turn on.
    let (mut highest, mut lowest, mut rises) = (0, 0, None);
    for (k, &v) in drive.iter().enumerate() {
        if v >= drive[highest] {
            highest = k;
        }
        if v <= drive[lowest] {
            lowest = k;
        }
        if rises != Some(false) && drive[highest] - v > 2.0 * TURN {
            turns.push(highest);
            (rises, lowest) = (Some(false), k);
        } else if rises != Some(true) && v - drive[lowest] > 2.0 * TURN {
            turns.push(lowest);
            (rises, highest) = (Some(true), k);
        }
    }
    turns
}

/// The smallest change of the position: a step of its converter, or what noise and averaging make of it.
fn finest_step_um(trace: &Trace) -> f64 {
    let changes = trace.position_um.windows(2).map(|w| (w[1] - w[0]).abs());
    // What decimal places leave of two equal codes is no step.
    let least = 1e-6 * trace.stroke_um.max(f64::MIN_POSITIVE);
    changes.filter(|step| *step > least).fold(f64::INFINITY, f64::min)
}

impl Leg {
    /// Way and move of some of the samples within a way.
    fn within(&self, reach: f64) -> impl Iterator<Item = (f64, f64)> + Clone {
        let n = self.way.iter().take_while(|way| **way < reach).count();
        let pairs = self.way.iter().copied().zip(self.moved_um.iter().copied());
        pairs.take(n).step_by(n.div_ceil(MOST_SAMPLES).max(1))
    }

    /// The dead band that fits this leg best, about as wide as the typical one.
    fn band(&self, typical: f64) -> Option<Band> {
        let near = self.within(WINDOW * typical);
        let samples = near.clone().count();
        if samples < FEWEST_SAMPLES {
            return None;
        }
        let band = best(bands(0.2 * typical, 1.8 * typical), |band| {
            Sums::of(near.clone(), band).solve().2
        });
        let (slope, _, with) = Sums::of(near.clone(), band).solve();
        let mean = |first: f64, reach: f64| {
            let (mut up, mut down) = (0.0, 0.0);
            for (way, moved_um) in near.clone().filter(|p| p.0 > first && p.0 < reach) {
                up += moved_um * (way - first);
                down += (way - first).powi(2);
            }
            up / down
        };
        let mean_slope = mean(band, f64::INFINITY);
        Some(Band {
            rises: self.rises,
            band,
            mean_slope,
            onset: slope / mean_slope,
            moved: mean(0.0, 0.9 * band) / mean_slope,
            without: Sums::of(near, 0.0).solve().2,
            with,
            samples,
        })
    }
}

/// Sums for least squares of a move on `u` and `u^2`, `u = max(0, way - band)`.
#[derive(Default)]
struct Sums {
    uu: f64,
    uuu: f64,
    uuuu: f64,
    zu: f64,
    zuu: f64,
    zz: f64,
}

impl Sums {
    fn of(pairs: impl Iterator<Item = (f64, f64)>, band: f64) -> Self {
        let mut sums = Self::default();
        for (way, z) in pairs {
            let u = (way - band).max(0.0);
            sums.uu += u * u;
            sums.uuu += u * u * u;
            sums.uuuu += u * u * u * u;
            sums.zu += z * u;
            sums.zuu += z * u * u;
            sums.zz += z * z;
        }
        sums
    }

    /// Slope, bend and squared error; without a slope where nothing lies behind the band.
    fn solve(&self) -> (f64, f64, f64) {
        let determinant = self.uu * self.uuuu - self.uuu * self.uuu;
        if determinant <= 1e-12 * self.uu * self.uuuu {
            return (0.0, 0.0, self.zz);
        }
        let slope = (self.zu * self.uuuu - self.zuu * self.uuu) / determinant;
        let bend = (self.zuu * self.uu - self.zu * self.uuu) / determinant;
        (slope, bend, (self.zz - slope * self.zu - bend * self.zuu).max(0.0))
    }
}

/// From the smallest band to the largest by equal factors.
fn bands(smallest: f64, largest: f64) -> impl Iterator<Item = f64> {
    (0..BANDS).map(move |k| smallest * (largest / smallest).powf(k as f64 / (BANDS - 1) as f64))
}

/// The band with the smallest squared error.
fn best(bands: impl Iterator<Item = f64>, squared_error: impl Fn(f64) -> f64) -> f64 {
    let each = bands.map(|band| (squared_error(band), band));
    each.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |best| best.1)
}

/// Lower quartile, median and upper quartile; `None` where a value is missing.
fn quartiles(mut values: Vec<f64>) -> Option<[f64; 3]> {
    if values.is_empty() || values.iter().any(|v| !v.is_finite()) {
        return None;
    }
    values.sort_by(f64::total_cmp);
    Some([1, 2, 3].map(|quarter| values[(values.len() - 1) * quarter / 4]))
}

#[cfg(test)]
mod tests {
    use super::turns;

    /// Drives in half spans: a turn counts from 0.06 on, at the last of equal extremes.
    #[test]
    fn val_turns_by_hand() {
        for (drive, wanted) in [
            (vec![-1.0, 0.0, 1.0, 1.0, 0.9, -1.0, -0.9], vec![0, 3, 5]),
            (vec![1.0, 0.99, 1.0, 0.5, 0.54, 0.5, 1.0], vec![2, 5]),
            (vec![0.0, 0.03, 0.0, -0.03], vec![]),
            (vec![0.0; 5], vec![]),
        ] {
            assert_eq!(turns(&drive), wanted, "{drive:?}");
        }
    }
}
