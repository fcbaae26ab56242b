//! The opening of a measured hysteresis loop, and the weights of eq. 18.

use crate::family::peak_to_peak;
use crate::period::Periodic;

/// Opening of a periodic loop, percent: the largest difference of the output between the falling and the rising
/// branch at one input, over the output's peak to peak. `None` unless the drive has one rising and one falling branch
/// a period.
///
/// The paper gives hysteresis percents of 16.44 / 22.56 / 45.51 and no definition; this is the usual one (ISO/ASTM
/// style: maximum hysteresis error over full-scale output). Periods are averaged on a grid of 200 inputs.
pub fn opening_percent(input: &[f64], output: &[f64], periodic: Periodic) -> Option<f64> {
    const GRID: usize = 200;
    let Periodic { samples, from } = periodic;
    let span = peak_to_peak(&input[from..]);
    let stroke = peak_to_peak(&output[from..]);
    let low = input[from..].iter().copied().fold(f64::INFINITY, f64::min);
    if span <= 0.0 || stroke <= 0.0 {
        return None;
    }
    if !two_branches(&input[from..from + samples], span) {
        return None;
    }
    let mut sums = [[0.0; GRID]; 2];
    let mut counts = [[0u32; GRID]; 2];
    let last_whole = from + periodic.count(input.len()) * samples;
    for k in from.max(1)..last_whole {
        let (v0, v1, y0, y1) = (input[k - 1], input[k], output[k - 1], output[k]);
        if v0 == v1 {
            continue;
        }
        let branch = usize::from(v1 > v0);
        // Every grid input passed between the two samples, by linear interpolation.
        let cell = |v: f64| (v - low) / span * GRID as f64 - 0.5;
        let (a, b) = (cell(v0.min(v1)), cell(v0.max(v1)));
        for grid in (a.ceil().max(0.0) as usize)..=(b.floor().clamp(-1.0, GRID as f64 - 1.0) + 1.0) as usize {
            if grid == 0 && b < 0.0 || grid >= GRID || grid as f64 > b {
                continue;
            }
            let v = low + (grid as f64 + 0.5) / GRID as f64 * span;
            sums[branch][grid] += y0 + (y1 - y0) * (v - v0) / (v1 - v0);
            counts[branch][grid] += 1;
        }
    }
    let widest = (0..GRID)
        .filter(|&g| counts[0][g] > 0 && counts[1][g] > 0)
        .map(|g| (sums[0][g] / f64::from(counts[0][g]) - sums[1][g] / f64::from(counts[1][g])).abs())
        .fold(0.0, f64::max);
    Some(100.0 * widest / stroke)
}

/// Whether one period rises once and falls once (reversals below 2 % of the span are noise).
fn two_branches(period: &[f64], span: f64) -> bool {
    let mut reversals = 0;
    let (mut rising, mut extreme) = (None, period[0]);
    for &value in period.iter().chain(period) {
        match rising {
            None if (value - extreme).abs() > 0.02 * span => (rising, extreme) = (Some(value > extreme), value),
            Some(true) if value > extreme => extreme = value,
            Some(false) if value < extreme => extreme = value,
            Some(up) if (value - extreme).abs() > 0.02 * span => {
                (rising, extreme) = (Some(!up), value);
                reversals += 1;
            }
            _ => {}
        }
    }
    // Twice around: four reversals, one more or less at the seam.
    (3..=4).contains(&reversals)
}

/// Weights of eq. 18, `W_j = H_j / H_0`, with H_0 the smallest opening (the slowest record shows the least).
///
/// Records without a loop of two branches get weight 1.
pub fn weights(openings: &[Option<f64>]) -> Vec<f64> {
    let least = openings.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    openings
        .iter()
        .map(|opening| match opening {
            Some(h) if least > 0.0 => h / least,
            _ => 1.0,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn val_ellipse_opens_by_the_sine_of_its_phase() {
        for degrees in [9.46_f64, 13.04, 27.07] {
            let phase = degrees.to_radians();
            let input: Vec<f64> = (0..4000).map(|k| 1.0 - (TAU * f64::from(k) / 1000.0).cos()).collect();
            let output: Vec<f64> = (0..4000)
                .map(|k| 1.0 - (TAU * f64::from(k) / 1000.0 - phase).cos())
                .collect();
            let h = opening_percent(&input, &output, Periodic { samples: 1000, from: 0 }).unwrap();
            // At mid stroke the vertical opening of an ellipse is 2 sin(phase) of 2.
            assert!((h - 100.0 * phase.sin()).abs() < 0.02, "{degrees} degrees: {h}");
        }
    }

    #[test]
    fn val_paper_weights() {
        let w = weights(&[Some(16.44), Some(22.56), Some(45.51)]);
        assert!((w[1] - 1.37).abs() < 0.005 && (w[2] - 2.77).abs() < 0.005, "{w:?}");
    }

    #[test]
    fn refuse_loops_of_many_branches() {
        let input: Vec<f64> = (0..2000)
            .map(|k| {
                let x = TAU * f64::from(k) / 1000.0;
                0.25 * x.sin() + 0.3 * (3.0 * x).sin()
            })
            .collect();
        assert_eq!(
            opening_percent(&input, &input, Periodic { samples: 1000, from: 0 }),
            None
        );
    }
}
