//! Up to where lines of a response tell that a stage does what its model says: a mode below would have shown.

use realfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};

/// The band that small signals tell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SmallSignalBand {
    /// Up to here the measured response is the model's, hertz.
    pub up_to_hz: f64,
    /// The record that says so.
    pub record: String,
}

/// Width of a group of lines, ratio of its ends.
const GROUP: f64 = 1.1;
/// Least coherence of a group: half of the position's power comes from the drive.
const COHERENT: f64 = 0.5;
/// By how much the measured response may differ from the model's. A mode that the model lacks makes `1 / (1 - (f / f1)^2)` of a response:
/// it shows from half its frequency on.
const DIFFERS: f64 = 0.3;
/// Gap between two groups in which no mode hides: halfway into a gap of a quarter it makes four of one.
const GAP: f64 = 1.25;
/// Groups of a band at least: an octave.
const GROUPS: usize = 8;
/// Least and most of the mean gain that a stage has for small signals. The most is what loops are designed for; a piezo's slope after a turn
/// is half of the mean one and more.
const GAINS: [f64; 2] = [0.4, 1.3];
/// Least of it for a swing that opens no loop: what is left is the reversible part.
const REVERSIBLE: f64 = 0.25;
/// Such a swing is, for 70 % of its time, at most this share of the range. With a larger one a stage that moves so little may have a soft mode below the lowest line.
const OPENS_NO_LOOP: f64 = 0.015;
/// Most that small loops are late by, radians: the arc sine of an opening of 40 %.
const LATEST_RAD: f64 = 0.4;
/// About a mode of the model the two may differ: a design holds with modes a tenth off.
const ABOUT_A_MODE: f64 = 0.15;

/// A line, or a group of lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    pub hz: f64,
    /// Measured and modelled response to the drive, in one unit.
    pub measured: Complex64,
    pub modelled: Complex64,
    /// Power of the drive that both are times.
    pub drive: f64,
    /// Power of the position that the drive explains, and all of it.
    pub explained: f64,
    pub all: f64,
}

/// Highest frequency of the highest run of groups of lines in which the model does what the stage does; lines ascend.
///
/// Below the run there is no mode either: above a mode that the model lacks, a stage moves the other way or hardly at all. `swing` is the
/// drive's, as a share of the range.
pub(crate) fn highest_run(lines: &[Line], modes_hz: &[f64], swing: f64) -> Option<f64> {
    let gain = gain(lines, swing)?;
    let group_of = |hz: f64| (hz.ln() / GROUP.ln()).floor();
    let (mut best, mut groups, mut highest_hz) = (None, 0, 0.0);
    for group in lines.chunk_by(|a, b| group_of(a.hz) == group_of(b.hz)) {
        let (Some(first), Some(last)) = (group.first(), group.last()) else {
            continue;
        };
        let goes_on = groups > 0 && first.hz <= GAP * highest_hz;
        groups = match (agrees(group, gain, modes_hz), goes_on) {
            (false, _) => 0,
            (true, false) => 1,
            (true, true) => groups + 1,
        };
        highest_hz = last.hz;
        if groups >= GROUPS {
            best = Some(highest_hz);
        }
    }
    best
}

/// What the stage's gain for small signals is of the mean one, from the lower half of the octaves; none where it is out of all proportion.
///
/// Small loops are flatter than the range is, and late by their opening: a loop holds with gains up to 1.3 of the mean, with less it is
/// slower, and it has half a radian to spare.
fn gain(lines: &[Line], swing: f64) -> Option<Complex64> {
    let least = if swing <= OPENS_NO_LOOP { REVERSIBLE } else { GAINS[0] };
    let gain = mean_gain(lines)?;
    ((least..=GAINS[1]).contains(&gain.norm()) && gain.arg().abs() <= LATEST_RAD).then_some(gain)
}

/// The measured response over the modelled one, over the lower half of the octaves; none without lines.
pub(crate) fn mean_gain(lines: &[Line]) -> Option<Complex64> {
    let (first, last) = (lines.first()?, lines.last()?);
    let up_to_hz = (first.hz * last.hz).sqrt();
    let low = lines.iter().filter(|line| line.hz <= up_to_hz);
    let (along, own) = low.fold((Complex64::default(), 0.0), |(along, own), line| {
        (
            along + line.measured * line.modelled.conj(),
            own + line.modelled.norm_sqr(),
        )
    });
    Some(along / own)
}

/// Whether the model does in a group of lines what the stage does, but for a gain.
fn agrees(group: &[Line], gain: Complex64, modes_hz: &[f64]) -> bool {
    let missed: f64 = group
        .iter()
        .map(|line| (line.measured - gain * line.modelled).norm_sqr())
        .sum();
    let sum = |of: fn(&Line) -> f64| group.iter().map(of).sum::<f64>();
    let coherent = sum(|line| line.explained) >= COHERENT * sum(|line| line.all);
    let about_a_mode = modes_hz
        .iter()
        .any(|mode| group.iter().any(|line| (line.hz / mode - 1.0).abs() < ABOUT_A_MODE));
    let same = missed <= DIFFERS * DIFFERS * sum(|line| line.measured.norm_sqr());
    coherent && (same || about_a_mode)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines of a stage with a mode at `mode_hz`, of which a rigid model knows nothing.
    fn seen(mode_hz: f64, to_hz: f64) -> Vec<Line> {
        let hz = (2..).map(|k| 10.0 * f64::from(k)).take_while(|hz| *hz <= to_hz);
        hz.map(|hz| {
            let gain = 1.0 / (1.0 - (hz / mode_hz).powi(2));
            Line {
                hz,
                measured: Complex64::new(0.8 * gain, 0.0),
                modelled: Complex64::new(1.0, 0.0),
                drive: 1.0,
                explained: 0.64 * gain * gain,
                all: 0.64 * gain * gain,
            }
        })
        .collect()
    }

    /// `1 / (1 - x^2)` differs from 1 by 0.3 of itself at x = sqrt(0.3) = 0.55; a group is a tenth wide.
    #[test]
    fn val_a_mode_shows_from_half_its_frequency_on() {
        let told = highest_run(&seen(700.0, 2000.0), &[], 0.1).unwrap();
        assert!((0.5 * 700.0..0.6 * 700.0).contains(&told), "{told}");
        // Far below the mode everything is told.
        assert_eq!(highest_run(&seen(7000.0, 2000.0), &[], 0.1), Some(2000.0));
        // A model that has the mode is not told by lines beside it.
        assert_eq!(highest_run(&seen(700.0, 2000.0), &[700.0], 0.1), Some(told));
    }

    /// A swing of a hundredth of the range moves the reversible part alone. With a larger one, a stage that moves as little has a soft part that
    /// no line shows; one that moves by more than loops are designed for is not the model's.
    #[test]
    fn bva_gains_for_small_signals_on_both_sides() {
        let told = |gain: f64, swing: f64| {
            let mut lines = seen(7000.0, 2000.0);
            for line in &mut lines {
                line.modelled *= 0.8 / gain;
            }
            highest_run(&lines, &[], swing)
        };
        for (gain, swing, band) in [
            (0.27, 0.014, Some(2000.0)),
            (0.23, 0.014, None),
            (0.27, 0.016, None),
            (0.38, 0.1, None),
            (0.42, 0.1, Some(2000.0)),
            (1.27, 0.1, Some(2000.0)),
            (1.33, 0.1, None),
        ] {
            assert_eq!(told(gain, swing), band, "{gain}, {swing}");
        }
    }

    /// A sine and its harmonics leave gaps that a mode hides in.
    #[test]
    fn refuse_a_band_with_gaps() {
        let sparse: Vec<Line> = seen(7000.0, 2000.0).into_iter().step_by(30).collect();
        assert_eq!(highest_run(&sparse, &[], 0.1), None);
        // Nor do lines of which noise is the most.
        let noisy = seen(7000.0, 2000.0).into_iter().map(|line| Line {
            all: 3.0 * line.all,
            ..line
        });
        assert_eq!(highest_run(&noisy.collect::<Vec<_>>(), &[], 0.1), None);
    }
}
