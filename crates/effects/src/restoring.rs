//! A mode with a restoring force that is no straight line, over whole series: what three effects share.

use crate::compensator::{Compensation, Compensator, StageMode};
use crate::effect::{Bounds, Changes, Effect, Facts, Signals};
use crate::id::EffectId;
use hysteron_core::effects::Block;
use hysteron_core::effects::restoring::{Memory, RestoringMode, RestoringNumbers, RestoringState};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::TAU;

/// Damping of such a mode at most: friction leaves a drive far more damped than a flexure.
const MOST_DAMPING: f64 = 0.95;

/// Frequency and damping of the mode, from those of the straight one that an effect is a wider form of, then `more`.
pub(crate) fn bounds(effect: &dyn Effect, facts: &Facts, more: Vec<Bounds>) -> Result<Vec<Bounds>, String> {
    let of_mode = effect
        .widens()
        .map(|straight| straight.effect().bounds(facts))
        .transpose()?;
    let frequency = of_mode.into_iter().flatten().take(1);
    let damping = Bounds::new(1e-3, MOST_DAMPING, 0.01, 0.02);
    Ok(frequency.chain([damping]).chain(more).collect())
}

/// The starts of the straight mode, each made wider.
pub(crate) fn starts(effect: &dyn Effect, facts: &Facts, bounds: &[Bounds]) -> Vec<Vec<f64>> {
    let Some(mode) = effect.widens().map(EffectId::effect) else {
        return Vec::new();
    };
    let straight = mode
        .bounds(facts)
        .map(|own| mode.starts(facts, &own))
        .unwrap_or_default();
    let wider = straight
        .iter()
        .filter_map(|values| effect.widened(values, facts, bounds).into_iter().next());
    wider.collect()
}

/// Values within their bounds.
pub(crate) fn within(values: Vec<f64>, bounds: &[Bounds]) -> Vec<f64> {
    let pairs = values.into_iter().zip(bounds);
    pairs.map(|(value, b)| value.clamp(b.min, b.max)).collect()
}

/// A mode without any bend or memory.
pub(crate) fn straight(frequency_hz: f64, damping: f64) -> RestoringNumbers {
    RestoringNumbers {
        frequency_hz,
        damping,
        middle: 0.0,
        half: 1.0,
        stiffness: [0.0; 2],
        memory: Memory::default(),
    }
}

/// The mode over a series: from rest, or in the steady state that its run-in repeats to.
pub(crate) fn run(numbers: &RestoringNumbers, signals: &Signals<'_>, series: &mut [f64]) {
    let Ok(mode) = RestoringMode::<f64>::new(numbers, 1.0 / signals.period_s) else {
        return;
    };
    let Some(mut state) = begun(&mode, numbers, signals, series) else {
        return;
    };
    for value in series {
        *value = mode.step(&mut state, *value);
    }
}

/// What is left of a motion when it is forgotten: e to the minus this.
const FORGOTTEN: f64 = 9.2;

/// Times that a run-in is repeated at most.
const MOST_REPEATED: f64 = 300.0;

/// The state before the first sample.
fn begun(
    mode: &RestoringMode<f64>,
    numbers: &RestoringNumbers,
    signals: &Signals<'_>,
    series: &[f64],
) -> Option<RestoringState<f64>> {
    let mut state = mode.rest_at(*series.first()?);
    if signals.run_in > 0 {
        let forgets = numbers.damping * TAU * numbers.frequency_hz * signals.period_s * signals.run_in as f64;
        let times = (FORGOTTEN / forgets).ceil().clamp(1.0, MOST_REPEATED) as u32;
        for _ in 0..times {
            for &value in &series[..signals.run_in] {
                mode.step(&mut state, value);
            }
        }
    }
    Some(state)
}

/// What one sample makes of a small change: of displacement, rate and memory, and of the input before and at it.
type Linear = [[f64; 5]; 3];

/// Change of the input by which a change of rest is told, of half the stroke.
const SMALL: f64 = 1e-4;

/// Takes small changes of the series before the mode through it.
pub(crate) fn changes<'a>(numbers: &RestoringNumbers, signals: Signals<'_>, series: &[f64]) -> Changes<'a> {
    let none = || -> Changes<'a> { Box::new(|_| ()) };
    let Ok(mode) = RestoringMode::<f64>::new(numbers, 1.0 / signals.period_s) else {
        return none();
    };
    let Some(mut state) = begun(&mode, numbers, &signals, series) else {
        return none();
    };
    let begins = at_rest(&mode, series[0], numbers.half);
    let each: Vec<Linear> = series
        .iter()
        .map(|&input| mode.step_linearised(&mut state, input))
        .collect();
    let run_in = signals.run_in;
    Box::new(move |columns| {
        let period = (run_in > 0).then(|| &each[..run_in]);
        for column in columns {
            let first = column.first().copied().unwrap_or(0.0);
            let mut change = match period {
                Some(period) => repeated(period, &column[..period.len()]),
                None => begins.map(|part| part * first),
            };
            let mut before = match period {
                Some(period) => column[period.len() - 1],
                None => first,
            };
            for (value, linear) in column.iter_mut().zip(&each) {
                change = moved(linear, change, before, *value);
                before = *value;
                *value = change[0];
            }
        }
    })
}

/// [`changes`] of one.
pub(crate) fn change(numbers: &RestoringNumbers, signals: Signals<'_>, series: &[f64], change: &mut [f64]) {
    let mut column = [change.to_vec()];
    changes(numbers, signals, series)(&mut column);
    change.copy_from_slice(&column[0]);
}

/// How a controller undoes the straight part of such a mode.
pub(crate) fn undone(frequency_hz: f64, damping: f64, note: &'static str) -> Compensation {
    let mode = StageMode {
        frequency_hz,
        damping,
        share: 1.0,
    };
    Compensation::new(Compensator::Modes(vec![mode]), note)
}

/// Of rest, by a change of the input.
fn at_rest(mode: &RestoringMode<f64>, input: f64, half: f64) -> [f64; 3] {
    let rests = |input: f64| mode.rest_at(input).mode.motion[0];
    let step = SMALL * half;
    [(rests(input + step) - rests(input - step)) / (2.0 * step), 0.0, 0.0]
}

#[inline(always)]
fn moved(linear: &Linear, [q, p, z]: [f64; 3], before: f64, input: f64) -> [f64; 3] {
    linear.map(|[of_q, of_p, of_z, of_before, of_input]| {
        of_q * q + of_p * p + of_z * z + of_before * before + of_input * input
    })
}

/// The change before a period that repeats: what a period makes of it is itself.
fn repeated(period: &[Linear], column: &[f64]) -> [f64; 3] {
    let through = |start: [f64; 3], scale: f64| {
        let mut before = scale * column[column.len() - 1];
        period.iter().zip(column).fold(start, |change, (linear, value)| {
            let after = moved(linear, change, before, scale * value);
            before = scale * value;
            after
        })
    };
    let forced = through([0.0; 3], 1.0);
    let free = [0, 1, 2].map(|i| {
        let mut start = [0.0; 3];
        start[i] = 1.0;
        through(start, 0.0)
    });
    // (1 - F) x = forced; a motion that does not fade within a period has no such state.
    let open = Matrix3::from_fn(|i, j| f64::from(u8::from(i == j)) - free[j][i]);
    open.lu().solve(&Vector3::from(forced)).map_or([0.0; 3], Into::into)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signals(run_in: usize) -> Signals<'static> {
        Signals {
            period_s: 1e-3,
            run_in,
            rested: false,
            fraction: 0.0,
            at_stack_v: &[],
            temperature_c: None,
            voltage2_v: None,
            own: &[],
        }
    }

    fn numbers() -> RestoringNumbers {
        RestoringNumbers {
            middle: 5.0,
            half: 5.0,
            stiffness: [0.1, 0.4],
            memory: Memory {
                stiffness: 0.5,
                fading: 0.3,
                lean: -0.1,
                ..Memory::default()
            },
            ..straight(40.0, 0.05)
        }
    }

    fn drive(n: usize) -> Vec<f64> {
        (0..n).map(|k| 5.0 + 4.0 * (TAU * k as f64 / 100.0).sin()).collect()
    }

    /// A small change goes through as the difference of two runs does, from rest and where a period repeats.
    #[test]
    fn val_small_changes_go_through_as_differences_do() {
        for run_in in [0, 100] {
            let series = drive(400);
            let wiggle: Vec<f64> = (0..400).map(|k| (TAU * k as f64 / 50.0 + 0.3).cos()).collect();
            let mut column = [wiggle.clone()];
            changes(&numbers(), signals(run_in), &series)(&mut column);
            let at = |size: f64| {
                let mut shifted: Vec<f64> = series.iter().zip(&wiggle).map(|(y, w)| y + size * w).collect();
                run(&numbers(), &signals(run_in), &mut shifted);
                shifted
            };
            let (above, below) = (at(1e-4), at(-1e-4));
            let (mut off, mut all) = (0.0, 0.0);
            for k in 0..400 {
                let wanted = (above[k] - below[k]) / 2e-4;
                off += (column[0][k] - wanted).powi(2);
                all += wanted.powi(2);
            }
            assert!(off < 1e-4 * all, "{run_in}: {}", (off / all).sqrt());
        }
    }

    /// A period that repeats begins as it ends.
    #[test]
    fn val_a_period_repeats() {
        let mut series = drive(300);
        run(&numbers(), &signals(100), &mut series);
        for k in 0..100 {
            assert!((series[k] - series[k + 200]).abs() < 1e-3, "{k}");
        }
    }
}
