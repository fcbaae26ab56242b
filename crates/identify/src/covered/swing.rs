//! The highest frequency at which records move a stage through a large part of its range: above it nothing tells what large references do.

/// A swing is large from this share of the range on: smaller ones are what small signals are looked for in.
const LARGE: f64 = 1.0 / 3.0;
/// What goes back by less than this share of the range is no turn: noise, ringing, a wiggle of band-limited noise.
const TURN: f64 = 0.05;
/// A period has so many samples at least: a jump is no swing.
const SAMPLES: f64 = 8.0;
/// So many periods are as short, or shorter: one alone is a move to another level and back.
const PERIODS: usize = 4;

/// That frequency, hertz; 0 where no record swings so far. Series have a sample period, seconds, and positions, micrometres.
///
/// A period is the time between the middles of two large swings the same way with one between them: noise moves these least, and a loop that is
/// not symmetrical does not move them.
pub(crate) fn swing_hz<'a>(series: impl Iterator<Item = (f64, &'a [f64])>, [low_um, high_um]: [f64; 2]) -> f64 {
    let span_um = high_um - low_um;
    if span_um.is_nan() || span_um <= 0.0 {
        return 0.0;
    }
    let mut found: Vec<f64> = Vec::new();
    for (period_s, position_um) in series {
        let turns = turns(position_um, TURN * span_um);
        let middles: Vec<Option<f64>> = turns
            .windows(2)
            .map(|ends| middle(position_um, [ends[0], ends[1]], LARGE * span_um))
            .collect();
        let periods = middles.windows(3).filter_map(|three| {
            three[1]?;
            Some(three[2]? - three[0]?)
        });
        let periods = periods.filter(|samples| *samples >= SAMPLES);
        found.extend(periods.map(|samples| 1.0 / (samples * period_s)));
    }
    found.sort_by(|a, b| b.total_cmp(a));
    found.get(PERIODS - 1).copied().unwrap_or(0.0)
}

/// Samples at which a series turns by more than `least`, its first and last with them.
fn turns(values: &[f64], least: f64) -> Vec<usize> {
    let mut turns = Vec::new();
    // Whether it rises is not known before the first turn.
    let (mut lowest, mut highest) = (0, 0);
    let mut rises = None;
    for (k, value) in values.iter().enumerate() {
        if *value < values[lowest] {
            lowest = k;
        }
        if *value > values[highest] {
            highest = k;
        }
        if rises != Some(false) && values[highest] - value > least {
            turns.push(highest);
            (rises, lowest) = (Some(false), k);
        } else if rises != Some(true) && value - values[lowest] > least {
            turns.push(lowest);
            (rises, highest) = (Some(true), k);
        }
    }
    turns.push(if rises == Some(false) { lowest } else { highest });
    turns
}

/// Where a swing from one turn to the next passes its middle, in samples; none of one that is not large.
fn middle(values: &[f64], [from, to]: [usize; 2], least: f64) -> Option<f64> {
    let (first, last) = (values.get(from)?, values.get(to)?);
    if (last - first).abs() < least {
        return None;
    }
    let level = 0.5 * (first + last);
    let swing = values.get(from..=to)?;
    let passes = |pair: &[f64]| (pair[0] - level) * (pair[1] - level) <= 0.0 && pair[0] != pair[1];
    let at = swing.windows(2).position(passes)?;
    Some((from + at) as f64 + (level - swing[at]) / (swing[at + 1] - swing[at]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const PERIOD_S: f64 = 20e-6;

    fn sine(hz: f64, peak_to_peak: f64, seconds: f64) -> Vec<f64> {
        let samples = (seconds / PERIOD_S) as usize;
        (0..samples)
            .map(|k| 5.0 - 0.5 * peak_to_peak * (TAU * hz * k as f64 * PERIOD_S).cos())
            .collect()
    }

    fn found(series: &[Vec<f64>]) -> f64 {
        swing_hz(series.iter().map(|values| (PERIOD_S, &values[..])), [0.0, 10.0])
    }

    /// A sine's own frequency, with noise of 0.5 % of the range about it as well.
    #[test]
    fn val_a_sine_has_its_frequency() {
        assert!((found(&[sine(100.0, 9.0, 0.1)]) / 100.0 - 1.0).abs() < 1e-3);
        let mut noisy = sine(100.0, 9.0, 0.1);
        let mut seed = 1_u64;
        for value in &mut noisy {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            *value += 0.05 * ((seed >> 40) as f64 / f64::from(1 << 24) - 0.5);
        }
        assert!((found(&[noisy]) / 100.0 - 1.0).abs() < 5e-3);
    }

    /// A third of the range is large, less is not; the slower record counts then.
    #[test]
    fn bva_a_swing_is_large_from_a_third_of_the_range_on() {
        for (peak_to_peak, hz) in [(3.4, 400.0), (3.3, 20.0)] {
            let series = [sine(20.0, 9.0, 0.25), sine(400.0, peak_to_peak, 0.1)];
            assert!((found(&series) / hz - 1.0).abs() < 1e-3, "{peak_to_peak} um");
        }
    }

    /// Six swings have four periods among them, five have three.
    #[test]
    fn bva_a_frequency_needs_four_periods() {
        assert!((found(&[sine(50.0, 9.0, 0.06)]) / 50.0 - 1.0).abs() < 1e-3);
        assert_eq!(found(&[sine(50.0, 9.0, 0.05)]), 0.0);
    }

    /// A sine whose way up is shorter than its way down has the frequency of both.
    #[test]
    fn val_a_wave_that_leans_has_its_frequency() {
        let leaning = |k: u32| {
            let phase = TAU * 100.0 * f64::from(k) * PERIOD_S;
            5.0 - 4.0 * (phase + 0.4 * phase.sin()).cos() + 0.5 * (2.0 * phase).cos()
        };
        assert!((found(&[(0..5000).map(leaning).collect()]) / 100.0 - 1.0).abs() < 1e-3);
    }

    /// Levels that are held tell how often they change, not how fast; codes that flicker and a single move tell nothing.
    #[test]
    fn val_jumps_and_moves_are_no_fast_swings() {
        let held = |level: f64| std::iter::repeat_n(level, 500);
        let levels: Vec<f64> = (0..20).flat_map(|k| held(if k % 2 == 0 { 1.0 } else { 9.0 })).collect();
        assert!((found(&[levels]) - 50.0).abs() < 1e-9); // there and back in 20 ms
        let flicker: Vec<f64> = (0..900).map(|k| if k % 2 == 0 { 1.0 } else { 9.0 }).collect();
        assert_eq!(found(&[flicker]), 0.0);
        assert_eq!(found(&[sine(500.0, 9.0, 0.001)]), 0.0);
        assert_eq!(found(&[Vec::new(), vec![f64::NAN; 10], vec![1.0; 10]]), 0.0);
    }
}
