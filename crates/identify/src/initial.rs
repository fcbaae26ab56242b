//! The state in which a record finds the play operators: each record is a run of its own, and what happened before it
//! is not in the file.

use crate::columns::{Design, Run};
use crate::family::{Family, peak_to_peak};
use crate::period;
use crate::start_state::InitialState;

/// A periodic start counts only if the response repeats as well: first against second period, rms as a share of peak to
/// peak. A virgin first quarter lies 5 to 8 % off, 3 % over the period; a noisy small stroke scatters by one.
const SAME_RESPONSE: f64 = 0.02;

/// A slow drift moves a whole period by much the same, while what a start leaves behind dies away (3 to 1 for a logarithm):
/// the change from the first period to the second may fall by this share of its mean from the first quarter to the last.
const EVEN: f64 = 0.5;

fn mean(part: &[f64]) -> f64 {
    part.iter().sum::<f64>() / part.len().max(1) as f64
}

/// What white noise makes of the squares in a change from one period to another: neighbours differ by nothing else.
fn noise_in(change: &[f64]) -> f64 {
    change.windows(2).map(|d| 0.5 * (d[1] - d[0]).powi(2)).sum()
}

/// Whether a response repeats: first against second period of `samples`, but for a drift that shifts it as a whole.
fn repeats(output: &[f64], samples: usize) -> bool {
    let response = peak_to_peak(output);
    let change: Vec<f64> = (0..samples).map(|k| output[k + samples] - output[k]).collect();
    let rms_about = |middle: f64| mean(&change.iter().map(|d| (d - middle).powi(2)).collect::<Vec<_>>()).sqrt();
    if rms_about(0.0) < SAME_RESPONSE * response {
        return true;
    }
    let (shift, quarter) = (mean(&change), samples / 4);
    let dies_away = (mean(&change[..quarter]) - mean(&change[samples - quarter..])) * shift.signum();
    rms_about(shift) < SAME_RESPONSE * response && dies_away < EVEN * shift.abs()
}

/// A shift between two periods is the stage's from so many standard errors on.
const SHIFTED: f64 = 5.0;

/// Whether the stage rested before a record whose drive is periodic from its first sample, as far as what outlasts records tells:
/// over the record the response goes on as a whole to the side to which the drive has moved on average.
///
/// The plays forget a start within a period; creep that was at rest goes on for all of the record, creep that has settled about
/// the drive's mean does not.
pub fn rested(output: &[f64], samples: usize) -> bool {
    let periods = output.len() / samples.max(1);
    if periods < 2 {
        return false;
    }
    let (first, last) = (&output[..samples], &output[(periods - 1) * samples..periods * samples]);
    let change: Vec<f64> = first.iter().zip(last).map(|(before, after)| after - before).collect();
    let error = noise_in(&change).sqrt() / samples as f64;
    let shift = mean(&change);
    shift.abs() > SHIFTED * error && shift * (mean(first) - output[0]) > 0.0
}

/// What outlasts the far end of the first period: at most this share of the mean square before it.
const FORGOTTEN: f64 = 0.05;

/// Whether all that sets the first period apart from the second ends where the drive first reaches the far end of its range. There plays
/// forget the way that they came by (Mayergoyz 1991, section 1.1); creep and drift go on.
fn forgets(input: &[f64], output: &[f64], samples: usize) -> bool {
    let from = input[0];
    let away = |k: &usize| (input[*k] - from).abs();
    let Some(far) = (0..samples).max_by(|a, b| away(a).total_cmp(&away(b))) else {
        return false;
    };
    let change: Vec<f64> = (0..samples).map(|k| output[k + samples] - output[k]).collect();
    let noise = noise_in(&change) / samples as f64;
    let above_noise = |part: &[f64]| mean(&part.iter().map(|d| d * d).collect::<Vec<_>>()) - noise;
    let (before, after) = change.split_at(far);
    !before.is_empty() && above_noise(after) < FORGOTTEN * above_noise(before)
}

/// A first guess from the record alone: periodic where drive and response both repeat from the first sample on. Else at rest from above
/// where the input begins at the low end of its range, unless a first period on another branch contradicts it; else half way.
pub(crate) fn guess(input: &[f64], output: &[f64]) -> InitialState {
    let span = peak_to_peak(input);
    let periodic = period::detect(input).filter(|found| found.from == 0);
    if let Some(found) = periodic {
        if repeats(output, found.samples) {
            return InitialState::Periodic { samples: found.samples };
        }
        if forgets(input, output, found.samples) {
            return InitialState::Remanent { fraction: 0.5 };
        }
    }
    let low = input.iter().copied().fold(f64::INFINITY, f64::min);
    let starts_low = input.first().is_some_and(|&first| first - low <= 1e-3 * span);
    InitialState::Remanent {
        fraction: if starts_low { 0.0 } else { 0.5 },
    }
}

/// The error must fall by this share before another state than the guess is believed.
const BELIEVED: f64 = 0.02;

/// A periodic guess has been measured: the response repeats. Against it a remanent start must explain this share of what
/// does not repeat and is no noise, where the model's own shortcomings cancel: a true start explains nearly all of it, a
/// drift or creep that the model lacks is mimicked in part.
const BELIEVED_CHANGE: f64 = 0.6;

/// What does not repeat must stand out from the noise in it by this share; a few hundred samples scatter by a tenth.
const STANDS_OUT: f64 = 0.5;

/// Or this share of the whole error: plays wider than the record's swing, which hold an offset since before the record.
const BELIEVED_OFFSET: f64 = 0.5;

/// Leaves out of the fit what a record shows before its plays have settled, where its start is not known: neither periodic
/// nor at the low end of the drive. Less than half is left out; a record that settles later is fitted whole.
pub(crate) fn skip_unsettled(design: &Design, run: &mut Run<'_>) {
    if matches!(run.initial, InitialState::Remanent { fraction } if fraction > 0.0) {
        let settled = design.settled_from(run);
        run.fit_from = if settled < run.input.len() / 2 { settled } else { 0 };
    }
}

/// Whether the widest plays hold something over a record that the record does not show: its drive swings less than they are wide, and it
/// begins in the midst of it.
pub(crate) fn holds_a_level(design: &Design, input: &[f64], guess: InitialState) -> bool {
    if design.family == Family::Duhem {
        return false;
    }
    let thresholds = &design.thresholds;
    let widest = thresholds.iter().copied().fold(0.0, f64::max);
    let swing = peak_to_peak(input);
    let in_the_midst = matches!(guess, InitialState::Remanent { fraction } if fraction > 0.0);
    in_the_midst && swing > 0.0 && swing < widest
}

/// Chooses the initial state under which a fitted model explains the record best, from its very first sample.
pub(crate) fn choose(design: &Design, coefficients: &[f64], run: &Run<'_>) -> InitialState {
    choose_by(run.initial, run.output, false, |initial| {
        let from = Run { initial, ..*run };
        let mut modelled = Vec::with_capacity(run.input.len());
        design.simulate(coefficients, &from, |_, y| modelled.push(y));
        modelled
    })
}

/// What a state leaves unexplained.
#[derive(Clone, Copy)]
struct Misfit {
    /// Squared error over the record.
    whole: f64,
    /// The part of that which a constant would take.
    offset: f64,
    /// Squared error of the change from the first period to the second, about its mean.
    change: f64,
    /// The noise's part of that, from neighbouring samples.
    noise: f64,
}

/// Chooses the initial state under which `modelled` is closest to `measured`.
///
/// The guess stands unless a remanent start, found by a scan of its fraction and a golden-section search, explains the
/// record clearly better. For a periodic guess the scan is coarse where what differs is one period, and not where most of the error is
/// an offset, which plays wider than the swing hold.
pub(crate) fn choose_by(
    guess: InitialState,
    measured: &[f64],
    fades: bool,
    modelled: impl Fn(InitialState) -> Vec<f64>,
) -> InitialState {
    let misfit = |initial| {
        let error: Vec<f64> = measured.iter().zip(modelled(initial)).map(|(y, m)| y - m).collect();
        let (change, noise) = match guess {
            InitialState::Periodic { samples } => change(&error, samples),
            InitialState::Remanent { .. } => (0.0, 0.0),
        };
        Misfit {
            whole: error.iter().map(|e| e * e).sum(),
            offset: error.len() as f64 * mean(&error).powi(2),
            change,
            noise,
        }
    };
    let remanent = |fraction| misfit(InitialState::Remanent { fraction });
    let stands = misfit(guess);
    let periodic = matches!(guess, InitialState::Periodic { .. });
    let offset = stands.offset > BELIEVED_OFFSET * stands.whole;
    let steps = if periodic && !offset && !fades { 2 } else { 8 };
    let scanned = (0..=steps)
        .map(|i| f64::from(i) / f64::from(steps))
        .map(|fraction| (fraction, remanent(fraction).whole));
    let (mut best, mut least) = scanned.fold((0.0, f64::INFINITY), |a, b| if b.1 < a.1 { b } else { a });
    if least < 1.2 * stands.whole || !periodic || offset || fades {
        let width = 1.0 / f64::from(steps);
        let refined = golden_section((best - width).max(0.0), (best + width).min(1.0), 12, |fraction| {
            remanent(fraction).whole
        });
        if refined.1 < least {
            (best, least) = refined;
        }
    }
    let share = match guess {
        InitialState::Periodic { .. } if fades => BELIEVED,
        InitialState::Periodic { .. } => BELIEVED_OFFSET,
        InitialState::Remanent { .. } => BELIEVED,
    };
    let better = least < (1.0 - share) * stands.whole;
    let explains_change = || {
        let structure = stands.change - stands.noise;
        periodic
            && least < stands.whole
            && structure > STANDS_OUT * stands.noise
            && stands.change - remanent(best).change > BELIEVED_CHANGE * structure
    };
    if better || explains_change() {
        InitialState::Remanent { fraction: best }
    } else {
        guess
    }
}

/// Squared change of an error from the first period to the second, about its mean, and what white noise makes of it.
fn change(error: &[f64], samples: usize) -> (f64, f64) {
    let n = samples.min(error.len().saturating_sub(samples));
    let changes: Vec<f64> = (0..n).map(|k| error[k + samples] - error[k]).collect();
    let middle = mean(&changes);
    let about_mean = changes.iter().map(|d| (d - middle).powi(2)).sum();
    (about_mean, noise_in(&changes))
}

/// Golden-section search for the minimum of a function of one variable; `(argument, value)`.
pub(crate) fn golden_section(mut low: f64, mut high: f64, steps: u32, f: impl Fn(f64) -> f64) -> (f64, f64) {
    const RATIO: f64 = 0.618_033_988_749_894_8; // (sqrt 5 - 1) / 2
    let (mut a, mut b) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut fa, mut fb) = (f(a), f(b));
    for _ in 0..steps {
        if fa < fb {
            (high, b, fb) = (b, a, fa);
            a = high - RATIO * (high - low);
            fa = f(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + RATIO * (high - low);
            fb = f(b);
        }
    }
    if fa < fb { (a, fa) } else { (b, fb) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const PERIOD: usize = 200;

    /// Five periods from the lowest point on, with what a slow state adds, and a little noise.
    fn response(slow: impl Fn(usize) -> f64) -> Vec<f64> {
        let sample = |k: usize| {
            let noise = 1e-3 * ((k * 7919 % 1000) as f64 / 500.0 - 1.0);
            5.0 * (1.0 - (TAU * k as f64 / PERIOD as f64).cos()) + slow(k) + noise
        };
        (0..5 * PERIOD).map(sample).collect()
    }

    /// A wide play that stands elsewhere than at zero shifts a periodic record as a whole: its state is found, not only looked for at
    /// both ends and in the middle. A tenth of the swing is no reason to look.
    #[test]
    fn bva_an_offset_is_looked_into() {
        let guess = InitialState::Periodic { samples: PERIOD };
        let measured = response(|_| 0.0);
        let far_off = |state: InitialState| match state {
            InitialState::Periodic { .. } => response(|_| 9.0),
            InitialState::Remanent { fraction } => response(|_| 60.0 * (fraction - 0.2)),
        };
        let InitialState::Remanent { fraction } = choose_by(guess, &measured, false, far_off) else {
            panic!("the guess stood");
        };
        assert!((fraction - 0.2).abs() < 0.01, "{fraction}");
        let shape = |state: InitialState| match state {
            InitialState::Periodic { .. } => response(|k| if k % PERIOD < PERIOD / 2 { 0.5 } else { -0.3 }),
            InitialState::Remanent { .. } => response(|_| 60.0),
        };
        assert_eq!(choose_by(guess, &measured, false, shape), guess);
    }

    /// A first quarter on another branch is forgotten at the far end of the drive, and the record does not begin at rest from above; what
    /// goes on for the whole period is a slow state, which says nothing of the plays.
    #[test]
    fn val_a_virgin_start_is_no_rest_from_above() {
        let drive: Vec<f64> = (0..5 * PERIOD)
            .map(|k| 1.0 - (TAU * k as f64 / PERIOD as f64).cos())
            .collect();
        let half = PERIOD / 2;
        let virgin = |k: usize| {
            if k < half {
                -2.0 * (TAU * k as f64 / PERIOD as f64).sin()
            } else {
                0.0
            }
        };
        assert_eq!(
            guess(&drive, &response(virgin)),
            InitialState::Remanent { fraction: 0.5 }
        );
        let creep = |k: usize| 1.2 * (k as f64 + 1.0).ln();
        assert_eq!(guess(&drive, &response(creep)), InitialState::REST);
        assert_eq!(
            guess(&drive, &response(|_| 0.0)),
            InitialState::Periodic { samples: PERIOD }
        );
    }

    /// What approaches the mean of the drive over the record has rested; what stands there, what goes the other way, and what only
    /// moves about has not, nor can one period tell.
    #[test]
    fn val_rested_goes_on_to_where_the_drive_is() {
        let approach = |k: usize| 0.05 * (1.0 - (-(k as f64) / 2000.0).exp());
        assert!(rested(&response(approach), PERIOD));
        assert!(!rested(&response(|_| 0.05), PERIOD));
        assert!(!rested(&response(|k| -approach(k)), PERIOD));
        let upside_down: Vec<f64> = response(approach).iter().map(|y| -y).collect();
        assert!(rested(&upside_down, PERIOD));
        assert!(!rested(&response(approach)[..PERIOD + 50], PERIOD));
    }
}
