//! The error over frequency and amplitude: at which kind of motion the model fails.

use crate::breakdown::Sample;
use crate::comparison::{Stretch, SwingMap};
use std::ops::Range;

/// A motion back by less than this share of the record's stroke does not end a swing: ripple is not a swing of its own.
const TURN_SHARE: f64 = 0.02;
/// Nor does one by less than this many times the noise, which a modelled output from a measured drive carries.
const TURN_NOISE: f64 = 6.0;
/// Rows: each half as high as the one above it, so that swings from 1/64 of the widest on have a row of their own.
const ROWS: i32 = 6;

/// One way between two turning points.
struct Swing {
    samples: Range<usize>,
    frequency_hz: f64,
    amplitude: f64,
}

/// Error rms in cells of frequency and amplitude of the modelled output's swings, over all records that move.
///
/// A swing is the way from one turning point to the next; it is half a period of a motion of frequency `1 / (2 T)` and half
/// its height of amplitude. Ways that the record's ends cut off are left out, unless there is little else.
pub(crate) fn swing_map(samples: &[Sample<'_>], noise_rms: f64) -> SwingMap {
    let all: Vec<(usize, Swing)> = samples
        .iter()
        .enumerate()
        .filter(|(_, sample)| sample.weight > 0.0)
        .flat_map(|(record, sample)| {
            let modelled = &sample.compared.series.modelled;
            let found = swings(modelled, sample.record.period_s, noise_rms);
            found.into_iter().map(move |swing| (record, swing))
        })
        .collect();
    let of = |value: fn(&Swing) -> f64| {
        let values = || all.iter().map(|(_, swing)| value(swing));
        (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max))
    };
    let ((slowest, fastest), (_, widest)) = (of(|swing| swing.frequency_hz), of(|swing| swing.amplitude));
    if all.is_empty() || widest <= 0.0 {
        return SwingMap {
            frequency_edges_hz: Vec::new(),
            amplitude_edges_um: Vec::new(),
            rms_um: Vec::new(),
            worst: Vec::new(),
        };
    }
    let frequency_edges_hz = thirds_of_decades(slowest, fastest);
    let mut amplitude_edges_um = vec![0.0];
    amplitude_edges_um.extend((0..ROWS).rev().map(|row| widest / 2f64.powi(row)));
    let columns = frequency_edges_hz.len() - 1;
    let mut sums = vec![vec![(0.0, 0_u32); columns]; ROWS as usize];
    let mut worst: Vec<Vec<Option<(f64, Stretch)>>> = vec![vec![None; columns]; ROWS as usize];
    for (record, swing) in &all {
        let place =
            |edges: &[f64], value: f64| edges.partition_point(|&edge| edge <= value).clamp(1, edges.len() - 1) - 1;
        let row = place(&amplitude_edges_um, swing.amplitude);
        let column = place(&frequency_edges_hz, swing.frequency_hz);
        let compared = samples[*record].compared;
        let error = |k: usize| compared.series.measured[k] - compared.series.modelled[k];
        let squares: f64 = swing.samples.clone().map(|k| error(k).powi(2)).sum();
        let cell = &mut sums[row][column];
        cell.0 += squares;
        cell.1 += swing.samples.len() as u32;
        let mean = squares / swing.samples.len() as f64;
        let most = &mut worst[row][column];
        if most.as_ref().is_none_or(|(most, _)| mean > *most) {
            *most = Some((mean, Stretch::of(compared, swing.samples.start, swing.samples.end)));
        }
    }
    let cell = |&(squares, count): &(f64, u32)| (count > 0).then(|| (squares / f64::from(count)).sqrt());
    SwingMap {
        frequency_edges_hz,
        amplitude_edges_um,
        rms_um: sums.iter().map(|row| row.iter().map(cell).collect()).collect(),
        worst: worst
            .into_iter()
            .map(|row| row.into_iter().map(|most| most.map(|(_, stretch)| stretch)).collect())
            .collect(),
    }
}

/// Edges at 1, 2, 5, 10, 20 .. around `from` to `to`.
fn thirds_of_decades(from: f64, to: f64) -> Vec<f64> {
    let first = from.log10().floor() as i32;
    let steps = (first..).flat_map(|exponent| [1.0, 2.0, 5.0].map(|mantissa| mantissa * 10f64.powi(exponent)));
    let mut edges: Vec<f64> = Vec::new();
    for edge in steps {
        if edge <= from {
            edges.clear();
        }
        edges.push(edge);
        if edge > to {
            break;
        }
    }
    edges
}

/// The ways between turning points. A turning point is confirmed once the output has come back by the threshold.
fn swings(output: &[f64], period_s: f64, noise_rms: f64) -> Vec<Swing> {
    let low = output.iter().copied().fold(f64::INFINITY, f64::min);
    let high = output.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let threshold = (TURN_SHARE * (high - low)).max(TURN_NOISE * noise_rms);
    if high - low <= threshold {
        return Vec::new();
    }
    let mut turns = Vec::new();
    // The extreme since the last turning point, and the way that leads to it: not known at the start.
    let (mut least, mut most) = (0, 0);
    let mut rising = None;
    for (k, &y) in output.iter().enumerate() {
        if y > output[most] {
            most = k;
        }
        if y < output[least] {
            least = k;
        }
        if rising != Some(false) && output[most] - y > threshold {
            turns.push(most);
            (rising, least) = (Some(false), k);
        } else if rising != Some(true) && y - output[least] > threshold {
            turns.push(least);
            (rising, most) = (Some(true), k);
        }
    }
    if turns.len() < 2 {
        // A record that goes one way only is one swing.
        turns = vec![least.min(most), least.max(most)];
    } else if turns.len() > 3 && turns[0] == 0 {
        turns.remove(0);
    }
    turns
        .windows(2)
        .filter(|pair| pair[1] > pair[0])
        .map(|pair| Swing {
            samples: pair[0]..pair[1],
            frequency_hz: 0.5 / ((pair[1] - pair[0]) as f64 * period_s),
            amplitude: 0.5 * (output[pair[1]] - output[pair[0]]).abs(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(frequency_hz: f64, amplitude: f64, samples: usize, period_s: f64) -> Vec<f64> {
        let phase = |k: usize| std::f64::consts::TAU * frequency_hz * k as f64 * period_s;
        (0..samples).map(|k| amplitude * phase(k).sin()).collect()
    }

    #[test]
    fn val_swings_of_a_sine_have_its_frequency_and_amplitude() {
        for (frequency_hz, amplitude) in [(10.0, 1.0), (97.0, 0.02), (400.0, 30.0)] {
            let output = sine(frequency_hz, amplitude, 20_000, 1e-5);
            let found = swings(&output, 1e-5, 0.0);
            // Of a short record, the quarter of a period before the first crest is kept.
            let whole = if found.len() < 3 { &found[1..] } else { &found[..] };
            assert!(!whole.is_empty());
            for swing in whole {
                assert!(
                    (swing.frequency_hz / frequency_hz - 1.0).abs() < 0.02,
                    "{}",
                    swing.frequency_hz
                );
                assert!((swing.amplitude / amplitude - 1.0).abs() < 0.01, "{}", swing.amplitude);
            }
        }
    }

    #[test]
    fn val_ripple_and_noise_are_no_swings() {
        let mut output = sine(10.0, 1.0, 20_000, 1e-5);
        for (k, y) in output.iter_mut().enumerate() {
            *y += 0.005 * (k as f64 * 0.7).sin();
        }
        assert!(swings(&output, 1e-5, 0.0).len() <= 5);
        assert!(swings(&sine(1000.0, 0.01, 5000, 1e-5), 1e-5, 0.01).is_empty());
        assert!(swings(&[1.0; 10], 1e-3, 0.0).is_empty());
    }

    #[test]
    fn val_one_way_is_one_swing() {
        let found = swings(&(0..101).map(f64::from).collect::<Vec<_>>(), 0.01, 0.0);
        assert_eq!((found.len(), found[0].amplitude, found[0].frequency_hz), (1, 50.0, 0.5));
    }

    #[test]
    fn prop_edges_hold_every_frequency() {
        for (from, to) in [(1.0, 1.0), (0.3, 0.7), (9.99, 10.0), (2e-4, 3e5), (5.0, 20.0)] {
            let edges = thirds_of_decades(from, to);
            assert!(
                edges.len() >= 2 && edges[0] <= from && *edges.last().unwrap() > to,
                "{edges:?}"
            );
            assert!(
                edges[1] > from && edges[edges.len() - 2] <= to,
                "none is empty by design: {edges:?}"
            );
        }
    }
}
