//! Errors that belong to the sample clock: instants that scatter, and what returns every so many samples.

use crate::diagnosis::{EffectParameter, Lock, LockTo, parameter};
use crate::witness::locks::{Course, Courses, squares};
use hysteron_identify::lagged::lagged_products;
use rayon::prelude::*;

/// Standard errors from which noise that grows with the speed squared is seen.
const SEEN: f64 = 5.0;

/// A position that bends by more than this share of the way between samples turns or steps.
const STRAIGHT: f64 = 0.05;

/// Differences of neighbours share samples: this many squares of them are worth one.
const SHARED: f64 = 5.0;

/// What returns is looked for at these distances, samples.
const SHORTEST: usize = 16;
const LONGEST: usize = 2000;

/// Largest squared second difference that counts, in means of all: one outlier must not decide.
const OUTLIER: f64 = 30.0;

/// Both, where they are seen; shares as weighted sums of squares.
pub(crate) fn locks(courses: &Courses<'_>) -> Vec<Lock> {
    let both = [scatter(courses), returning(courses)];
    both.into_iter()
        .flatten()
        .map(|(squares, parameter)| Lock {
            parameters: vec![parameter],
            ..Lock::new(LockTo::SampleClock, squares)
        })
        .collect()
}

/// Jitter: white noise whose variance is that of the instants times the speed squared.
fn scatter(courses: &Courses<'_>) -> Option<(f64, EffectParameter)> {
    let moving = courses.each.par_iter().filter(|c| c.moves());
    let slopes: Vec<Slope> = moving.filter_map(Slope::of).collect();
    let mut jitter_s2 = weighted(&slopes, |s| s.variance);
    let precision: f64 = slopes.iter().map(|s| 1.0 / s.variance).sum();
    if precision.is_nan() || precision <= 0.0 || jitter_s2 * precision.sqrt() < SEEN {
        return None;
    }
    // Scatter that is small by chance looks sure as well: what each record is worth follows from the scatter that all have.
    for _ in 0..4 {
        jitter_s2 = weighted(&slopes, |s| s.expected_variance(jitter_s2)).max(0.0);
    }
    let of_record = |c: &Course<'_>| {
        let speeds = (0..c.len()).map(|k| c.speed(k).powi(2)).sum::<f64>();
        c.weight * (jitter_s2 * speeds).min(squares(c.error_um))
    };
    let all = courses.each.iter().map(of_record).sum();
    Some((all, parameter("jitter_rms", jitter_s2.sqrt(), "s")))
}

/// Slope of a record's squared second differences over the squared speed.
struct Slope {
    /// Seconds squared.
    slope: f64,
    /// Of the slope, from how the squares scatter.
    variance: f64,
    /// The squares at rest.
    at_rest: f64,
    /// Sums of the squared deviations of the squared speed, times its powers 0, 1 and 2.
    sums: [f64; 3],
}

impl Slope {
    fn of(course: &Course<'_>) -> Option<Self> {
        let (y, e) = (&course.position_um, &course.unrepeated_um);
        // The mean of a few periods takes its part of what scatters.
        let kept = course
            .period
            .map_or(1.0, |p| 1.0 - p.samples as f64 / (course.len() - p.from) as f64);
        // The variance of a second difference of white noise is 1.5 times the noise's.
        let rows: Vec<(f64, f64)> = (2..course.len().saturating_sub(2))
            .filter(|&k| {
                let bend = (y[k] - 0.5 * (y[k - 1] + y[k + 1])).abs();
                bend <= STRAIGHT * 0.5 * (y[k + 1] - y[k - 1]).abs()
            })
            .map(|k| {
                let rough = (e[k] - 0.5 * (e[k - 1] + e[k + 1])).powi(2) / (1.5 * kept);
                (course.speed(k).powi(2), rough)
            })
            .collect();
        if rows.len() < 200 {
            return None;
        }
        let n = rows.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| rows.iter().map(of).sum::<f64>() / n;
        let (mx, my) = (mean(|r| r.0), mean(|r| r.1));
        let sums = [0, 1, 2].map(|power| rows.iter().map(|r| (r.0 - mx).powi(2) * r.0.powi(power)).sum::<f64>());
        let slope = rows.iter().map(|r| (r.0 - mx) * (r.1 - my)).sum::<f64>() / sums[0];
        let left: f64 = rows.iter().map(|r| (r.1 - my - slope * (r.0 - mx)).powi(2)).sum();
        let variance = SHARED * left / (n - 2.0) / sums[0];
        (variance.is_finite() && variance > 0.0).then_some(Self {
            slope,
            variance,
            at_rest: (my - slope * mx).max(0.0),
            sums,
        })
    }

    /// Variance of the slope where the scatter is this: the square of a Gaussian value scatters by twice its variance squared.
    fn expected_variance(&self, jitter_s2: f64) -> f64 {
        let [s0, s1, s2] = self.sums;
        let squares = self.at_rest.powi(2) * s0 + 2.0 * self.at_rest * jitter_s2 * s1 + jitter_s2.powi(2) * s2;
        SHARED * 2.0 * squares / s0.powi(2)
    }
}

fn weighted(slopes: &[Slope], variance: impl Fn(&Slope) -> f64) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for slope in slopes {
        let weight = 1.0 / variance(slope);
        (sum, weights) = (sum + weight * slope.slope, weights + weight);
    }
    sum / weights
}

/// What returns every so many samples in most records, whatever their drives.
fn returning(courses: &Courses<'_>) -> Option<(f64, EffectParameter)> {
    let alike: Vec<Vec<f64>> = courses.each.par_iter().map(alike).collect();
    let longest = alike.iter().map(Vec::len).max()?;
    let score = |lag: usize| alike.iter().filter_map(|a| a.get(lag)).sum::<f64>();
    let every = (SHORTEST..longest.min(LONGEST)).max_by(|&a, &b| score(a).total_cmp(&score(b)))?;
    let each: Vec<(f64, f64)> = courses.each.par_iter().map(|c| (c.weight, folded(c, every))).collect();
    let shares = courses.each.iter().zip(&each).filter(|(c, _)| c.len() > 4 * every);
    let (mut seen, mut of) = (0, 0);
    for (course, (_, taken)) in shares {
        of += 1;
        seen += usize::from(*taken > 0.1 * squares(course.error_um));
    }
    (of > 2 && 2 * seen > of).then(|| {
        let all = each.iter().map(|(weight, taken)| weight * taken).sum();
        (all, parameter("every", every as f64, "samples"))
    })
}

/// Autocorrelation of the squared second differences, clipped, about their mean; 1 at lag 0.
fn alike(course: &Course<'_>) -> Vec<f64> {
    let e = &course.unrepeated_um;
    let rough: Vec<f64> = e.windows(3).map(|w| (w[1] - 0.5 * (w[0] + w[2])).powi(2)).collect();
    let mean = rough.iter().sum::<f64>() / rough.len().max(1) as f64;
    let clipped: Vec<f64> = rough.iter().map(|r| r.min(OUTLIER * mean)).collect();
    let level = clipped.iter().sum::<f64>() / clipped.len().max(1) as f64;
    let centred: Vec<f64> = clipped.iter().map(|r| r - level).collect();
    let mut alike = lagged_products(&centred, &centred, 0, LONGEST.min(course.len() / 4));
    alike.truncate(course.len() / 4);
    let whole = alike.first().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
    alike.iter_mut().for_each(|a| *a /= whole);
    alike
}

/// Squares that the mean course over so many samples takes, beyond what noise would.
fn folded(course: &Course<'_>, every: usize) -> f64 {
    let e = &course.unrepeated_um;
    if e.len() < 4 * every {
        return 0.0;
    }
    let mut sums = vec![(0.0, 0.0); every];
    let mut before: Vec<f64> = Vec::with_capacity(e.len());
    // About the mean of the distance before and after: slower errors are no part of it.
    let mut running = vec![0.0; e.len() + 1];
    for (k, e) in e.iter().enumerate() {
        running[k + 1] = running[k] + e;
    }
    for k in 0..e.len() {
        let (from, to) = (k.saturating_sub(every / 2), (k + every / 2 + 1).min(e.len()));
        before.push(e[k] - (running[to] - running[from]) / (to - from) as f64);
    }
    for (k, e) in before.iter().enumerate() {
        let (sum, count) = &mut sums[k % every];
        (*sum, *count) = (*sum + e, *count + 1.0);
    }
    let taken: f64 = sums.iter().map(|(sum, count)| sum * sum / count).sum();
    let left = (squares(&before) - taken).max(0.0);
    let degrees = (e.len() - every) as f64;
    (taken - every as f64 * left / degrees).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::witness::made::{noise, traces};

    /// Instants that scatter by 20 us, and readings that do by 2 nm: at 1 Hz the noise is the larger, at 50 Hz the scatter.
    #[test]
    fn val_jitter_has_its_size() {
        for jitter_s in [5e-6, 20e-6] {
            let (traces, errors) = traces(|i, record| {
                let (mut noise, mut late) = (noise(i as u64), noise(100 + i as u64));
                let y = &record.position_um;
                (0..y.len())
                    .map(|k| {
                        let (before, after) = (k.saturating_sub(1), (k + 1).min(y.len() - 1));
                        let speed = (y[after] - y[before]) / ((after - before) as f64 * record.period_s);
                        jitter_s * late() * speed + 2e-3 * noise()
                    })
                    .collect()
            });
            let found = scatter(&Courses::new(&traces, errors.iter().map(Vec::as_slice))).unwrap();
            let ratio = found.1.value / jitter_s;
            assert!((ratio - 1.0).abs() < 0.05, "{jitter_s}: {ratio}");
        }
    }

    /// Three samples of every 204 are lost, counted on from record to record.
    #[test]
    fn val_drop_outs_have_their_distance() {
        let (traces, errors) = traces(|i, record| {
            let mut noise = noise(i as u64);
            let lost = |k: usize| if (k + 37 * i) % 204 < 3 { -0.1 } else { 0.0 };
            (0..record.len()).map(|k| lost(k) + 2e-3 * noise()).collect()
        });
        let (squares, every) = returning(&Courses::new(&traces, errors.iter().map(Vec::as_slice))).unwrap();
        assert_eq!(every.value, 204.0);
        assert!(squares > 0.0);
    }

    #[test]
    fn val_white_noise_is_no_fault_of_the_clock() {
        let (traces, errors) = traces(|i, record| {
            let mut noise = noise(i as u64);
            record.position_um.iter().map(|_| 2e-3 * noise()).collect()
        });
        let locks = locks(&Courses::new(&traces, errors.iter().map(Vec::as_slice)));
        assert!(locks.is_empty(), "{locks:?}");
    }
}
