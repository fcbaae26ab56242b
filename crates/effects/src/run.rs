//! Blocks of the core over whole series, from rest or in periodic steady state.

use hysteron_core::effects::Block;
use hysteron_core::effects::lag::Lag;
use hysteron_core::effects::resonance::Mode;

/// Runs a block whose memory ends (a delay, a play, a limit): from rest, or twice through the run-in.
pub(crate) fn block<B: Block<f64>>(block: &B, run_in: usize, series: &mut [f64]) {
    let Some(&first) = series.first() else { return };
    let mut state = block.rest_at(first);
    for &value in &series[..run_in] {
        block.step(&mut state, value);
    }
    for value in series {
        *value = block.step(&mut state, *value);
    }
}

/// Runs a first-order lag: from rest, or in the steady state of the run-in's period, `y_0 = e / (1 - exp(-P T / tau))` with
/// `e` the response of one period from zero.
pub(crate) fn lag(tau_s: f64, period_s: f64, run_in: usize, series: &mut [f64]) {
    let (Some(&first), Ok(lag)) = (series.first(), Lag::<f64>::new(tau_s.clamp(0.0, 1e6), 1.0 / period_s)) else {
        return;
    };
    let mut state = lag.rest_at(first);
    if run_in > 0 && tau_s > 0.0 {
        let mut forced = lag.rest_at(first);
        forced.output = 0.0;
        let forced = series[1..=run_in].iter().fold(0.0, |_, &u| lag.step(&mut forced, u));
        state.output = forced / -(-(run_in as f64) * period_s / tau_s).exp_m1();
    }
    series[0] = state.output;
    for value in &mut series[1..] {
        *value = lag.step(&mut state, *value);
    }
}

/// Adds first-order lags of a series to it, `y += sum share_i lag_i[y]`, of many series of one length: from rest, or in the steady
/// state of the run-in's period. The steps are those of [`Lag`].
pub(crate) fn relaxations(elements: &[(f64, f64)], period_s: f64, from: usize, run_in: usize, series: &mut [Vec<f64>]) {
    const SIDE_BY_SIDE: usize = 8;
    let lags = |&(tau_s, share): &(f64, f64)| {
        let tau_s = tau_s.clamp(0.0, 1e6);
        let [approach, through] = Lag::<f64>::new(tau_s, 1.0 / period_s).ok()?.coefficients();
        let forgets = -(-(run_in as f64) * period_s / tau_s).exp_m1();
        Some(Relaxation {
            approach,
            keeps: 1.0 - approach,
            through,
            share,
            forgets: if tau_s > 0.0 { forgets } else { 1.0 },
        })
    };
    let lags: Vec<Relaxation> = elements.iter().filter_map(lags).collect();
    let (together, rest) = series.as_chunks_mut::<SIDE_BY_SIDE>();
    for lanes in together {
        // Many series keep a processor busy, two lags at a time.
        pulp::Arch::new().dispatch(Relaxed::<SIDE_BY_SIDE, 2> {
            lags: &lags,
            run_in,
            series: lanes.each_mut().map(|lane| &mut lane[from..]),
        });
    }
    for one in rest {
        pulp::Arch::new().dispatch(Relaxed::<1, 4> {
            lags: &lags,
            run_in,
            series: [&mut one[from..]],
        });
    }
}

/// `N` series and the lags that are added to them, `E` at a time: what stands in registers is `N E` states.
struct Relaxed<'s, const N: usize, const E: usize> {
    lags: &'s [Relaxation],
    run_in: usize,
    series: [&'s mut [f64]; N],
}

impl<const N: usize, const E: usize> pulp::NullaryFnOnce for Relaxed<'_, N, E> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        relax::<N, E>(self.lags, self.run_in, self.series);
    }
}

/// A lag that is added to its input.
#[derive(Clone, Copy, Default)]
struct Relaxation {
    approach: f64,
    /// One less that.
    keeps: f64,
    through: f64,
    share: f64,
    /// What one period of run-in leaves out of its state.
    forgets: f64,
}

/// Samples that are relaxed at once.
const BLOCK: usize = 64;

#[inline(always)]
fn relax<const N: usize, const E: usize>(lags: &[Relaxation], run_in: usize, mut series: [&mut [f64]; N]) {
    let n = series.each_ref().map(|lane| lane.len()).into_iter().min().unwrap_or(0);
    if n == 0 {
        return;
    }
    let first = series.each_ref().map(|lane| lane[0]);
    let mut groups: Vec<([Relaxation; E], [[f64; N]; E])> = lags
        .chunks(E)
        .map(|chunk| {
            let group = std::array::from_fn(|e| chunk.get(e).copied().unwrap_or_default());
            (group, [first; E])
        })
        .collect();
    if run_in > 0 {
        for (group, states) in &mut groups {
            let mut forced = ([[0.0; N]; E], first);
            for from in (1..=run_in.min(n - 1)).step_by(BLOCK) {
                let inputs = block_of(&series, from, (run_in + 1).min(n));
                advance(group, &mut forced, &inputs, |_, _| ());
            }
            for e in 0..E {
                for l in 0..N {
                    states[e][l] = if group[e].forgets > 0.0 {
                        forced.0[e][l] / group[e].forgets
                    } else {
                        first[l]
                    };
                }
            }
        }
    }
    for (group, states) in &groups {
        let slow = shares(group, states);
        series.iter_mut().zip(slow).for_each(|(lane, slow)| lane[0] += slow);
    }
    let mut last = first;
    for from in (1..n).step_by(BLOCK) {
        let inputs = block_of(&series, from, n);
        let mut added = [[0.0; N]; BLOCK];
        let mut after = last;
        for (group, states) in &mut groups {
            let mut state = (*states, last);
            advance(group, &mut state, &inputs, |k, slow| {
                for l in 0..N {
                    added[k][l] += slow[l];
                }
            });
            (*states, after) = state;
        }
        last = after;
        for (l, lane) in series.iter_mut().enumerate() {
            for (value, slow) in lane[from..(from + BLOCK).min(n)].iter_mut().zip(&added) {
                *value += slow[l];
            }
        }
    }
}

/// Some samples of each series, side by side.
#[inline(always)]
fn block_of<const N: usize>(series: &[&mut [f64]; N], from: usize, to: usize) -> ([[f64; N]; BLOCK], usize) {
    let count = BLOCK.min(to - from);
    let mut block = [[0.0; N]; BLOCK];
    for (l, lane) in series.iter().enumerate() {
        for (cell, &value) in block.iter_mut().zip(&lane[from..from + count]) {
            cell[l] = value;
        }
    }
    (block, count)
}

/// Lags over a block, from their outputs and the last input.
#[inline(always)]
fn advance<const N: usize, const E: usize>(
    group: &[Relaxation; E],
    (outputs, last): &mut ([[f64; N]; E], [f64; N]),
    (inputs, count): &([[f64; N]; BLOCK], usize),
    mut visit: impl FnMut(usize, [f64; N]),
) {
    for (k, input) in inputs.iter().enumerate().take(*count) {
        for e in 0..E {
            for l in 0..N {
                // Everything but one product and one sum is known before the last output.
                let towards = group[e].approach * last[l] + group[e].through * (input[l] - last[l]);
                outputs[e][l] = group[e].keeps * outputs[e][l] + towards;
            }
        }
        *last = *input;
        visit(k, shares(group, outputs));
    }
}

/// What lags add to their input.
#[inline(always)]
fn shares<const N: usize, const E: usize>(group: &[Relaxation; E], outputs: &[[f64; N]; E]) -> [f64; N] {
    std::array::from_fn(|l| (0..E).map(|e| group[e].share * outputs[e][l]).sum())
}

/// Series that a mode is run over side by side: each one's next sample waits for its last.
const LANES: usize = 4;

/// Runs a mode: from rest, or in the steady state of the run-in's period, `(1 - A^P) q_0 = e`.
pub(crate) fn mode(mode: &Mode<f64>, run_in: usize, series: &mut [f64]) {
    side_by_side(mode, run_in, [series]);
}

/// [`mode`] of many series of one length.
pub(crate) fn modes(mode: &Mode<f64>, run_in: usize, series: &mut [Vec<f64>]) {
    let (together, rest) = series.as_chunks_mut::<LANES>();
    for lanes in together {
        side_by_side(mode, run_in, lanes.each_mut().map(Vec::as_mut_slice));
    }
    for one in rest {
        self::mode(mode, run_in, one);
    }
}

fn side_by_side<const N: usize>(mode: &Mode<f64>, run_in: usize, mut series: [&mut [f64]; N]) {
    let n = series.each_ref().map(|lane| lane.len()).into_iter().min().unwrap_or(0);
    if n == 0 {
        return;
    }
    let mut states = series.each_ref().map(|lane| mode.rest_at(lane[0]));
    if run_in > 0 {
        let mut forced = states;
        for state in &mut forced {
            state.motion = [0.0; 2];
        }
        for k in 1..=run_in {
            for (state, lane) in forced.iter_mut().zip(&series) {
                mode.step(state, lane[k]);
            }
        }
        let [[a, b], [c, d]] = power(mode.free_motion(), run_in);
        let determinant = (1.0 - a) * (1.0 - d) - b * c;
        for (state, forced) in states.iter_mut().zip(forced) {
            let [e, f] = forced.motion;
            // A damped mode forgets: the determinant is above (2 pi zeta)^2 of a period.
            state.motion = [
                ((1.0 - d) * e + b * f) / determinant,
                (c * e + (1.0 - a) * f) / determinant,
            ];
        }
    }
    for (state, lane) in states.iter().zip(&mut series) {
        lane[0] = state.motion[0];
    }
    for k in 1..n {
        for (state, lane) in states.iter_mut().zip(&mut series) {
            lane[k] = mode.step(state, lane[k]);
        }
    }
}

fn power(mut base: [[f64; 2]; 2], mut exponent: usize) -> [[f64; 2]; 2] {
    let times = |x: [[f64; 2]; 2], y: [[f64; 2]; 2]| -> [[f64; 2]; 2] {
        std::array::from_fn(|i| std::array::from_fn(|j| x[i][0] * y[0][j] + x[i][1] * y[1][j]))
    };
    let mut result = [[1.0, 0.0], [0.0, 1.0]];
    while exponent > 0 {
        if exponent % 2 == 1 {
            result = times(result, base);
        }
        base = times(base, base);
        exponent /= 2;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sine(samples_a_period: usize, n: usize) -> Vec<f64> {
        (0..n)
            .map(|k| 2.0 + (TAU * k as f64 / samples_a_period as f64).sin())
            .collect()
    }

    /// A slow lag and a light mode over a few periods of run-in have not settled; in the steady state they give the closed
    /// form of a sine from the first sample: (w T)^2 / 12 = 8e-5 is what straight lines cost at 200 samples a period.
    #[test]
    fn val_periodic_steady_state_from_the_first_sample() {
        let (n, w) = (200, TAU / 200.0);
        for tau in [10.0, 1e4] {
            let mut y = sine(n, 3 * n);
            lag(tau, 1.0, n, &mut y);
            for (k, y) in y.iter().enumerate() {
                let wanted = 2.0 + (w * k as f64 - (w * tau).atan()).sin() / (1.0 + (w * tau).powi(2)).sqrt();
                assert!((y - wanted).abs() < 1e-4, "lag {tau}, {k}: {y} {wanted}");
            }
        }
        let (w0, zeta) = (2.3 * w, 1e-3);
        let mut y = sine(n, 3 * n);
        mode(&Mode::new(w0 / TAU, zeta, 1.0).unwrap(), n, &mut y);
        let (re, im) = (w0 * w0 - w * w, 2.0 * zeta * w0 * w);
        for (k, y) in y.iter().enumerate() {
            let wanted = 2.0 + w0 * w0 / re.hypot(im) * (w * k as f64 - im.atan2(re)).sin();
            assert!((y - wanted).abs() < 2e-4, "mode, {k}: {y} {wanted}");
        }
    }

    /// Side by side the arithmetic is that of one alone.
    #[test]
    fn val_many_series_are_each_as_alone() {
        let ring = Mode::new(0.13, 0.02, 1.0).unwrap();
        for run_in in [0, 40] {
            let mut together: Vec<Vec<f64>> = (3..10).map(|p| sine(p, 120)).collect();
            let mut alone = together.clone();
            modes(&ring, run_in, &mut together);
            alone.iter_mut().for_each(|series| mode(&ring, run_in, series));
            assert_eq!(together, alone);
        }
    }

    #[test]
    fn val_rest_stays_rest() {
        let mut y = vec![3.0; 50];
        lag(5.0, 1.0, 0, &mut y);
        mode(&Mode::new(0.1, 0.01, 1.0).unwrap(), 0, &mut y);
        assert!(y.iter().all(|y| (y - 3.0).abs() < 1e-12));
    }
}
