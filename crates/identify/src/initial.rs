//! The state in which a record finds the play operators: each record is a run of its own, and what happened before it
//! is not in the file.

use crate::columns::{Design, Run};
use crate::family::{peak_to_peak, range};
use crate::period;

/// The state of the play operators before the first sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum InitialState {
    /// The drive is periodic from the first sample and so is the response: one period is run beforehand.
    Periodic {
        /// Samples a period.
        samples: usize,
    },
    /// `w_i = v(0) - fraction * r_i`: 0 after coming down from above (and for the virgin start at 0 V of eq. 3), 1 after
    /// coming up from below, 0.5 when demagnetised.
    Remanent {
        /// From 0 to 1.
        fraction: f64,
    },
}

impl InitialState {
    /// Output of a play of this threshold before the first sample of `input`.
    ///
    /// Periodic records run one period from here, which leaves of it only the plays wider than the record's own span. What
    /// these hold must not depend on where in its period a record happens to begin: they are taken as at rest at zero,
    /// demagnetised where the drive swings to both sides, else having come down to it.
    pub(crate) fn before(self, input: &[f64]) -> impl Fn(f64) -> f64 {
        let first = input.first().copied().unwrap_or(0.0);
        let (at, fraction) = match self {
            Self::Remanent { fraction } => (first, fraction),
            Self::Periodic { samples } => {
                let (low, high) = range(input[..samples.min(input.len())].iter().copied());
                // Conditioning cycles to a side less than half as far leave what coming down to zero leaves.
                (0.0, if -low > 0.5 * high && low < 0.0 { 0.5 } else { 0.0 })
            }
        };
        move |threshold| at - fraction * threshold
    }
}

impl core::fmt::Display for InitialState {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Periodic { samples } => write!(f, "periodic, {samples} samples"),
            Self::Remanent { fraction } if *fraction == 0.0 => f.write_str("at rest from above"),
            Self::Remanent { fraction } => write!(f, "remanent {fraction:.3}"),
        }
    }
}

/// A periodic start counts only if the response repeats as well: first against second period, rms as a share of peak to
/// peak. A virgin first quarter lies 5 to 8 % off, 3 % over the period; a noisy small stroke scatters by one.
const SAME_RESPONSE: f64 = 0.02;

/// A first guess from the record alone: periodic where drive and response both repeat from the first sample on, else
/// the virgin start where the input begins at the low end of its range, else half way.
pub(crate) fn guess(input: &[f64], output: &[f64]) -> InitialState {
    let (span, response) = (peak_to_peak(input), peak_to_peak(output));
    if let Some(found) = period::detect(input)
        && found.from == 0
    {
        let samples = found.samples;
        let difference: f64 = (0..samples).map(|k| (output[k + samples] - output[k]).powi(2)).sum();
        if (difference / samples as f64).sqrt() < SAME_RESPONSE * response {
            return InitialState::Periodic { samples };
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

/// Leaves out of the fit what a record shows before its plays have settled, where its start is not known: neither periodic
/// nor at the low end of the drive. Less than half is left out; a record that settles later is fitted whole.
pub(crate) fn skip_unsettled(design: &Design, run: &mut Run<'_>) {
    if matches!(run.initial, InitialState::Remanent { fraction } if fraction > 0.0) {
        let settled = design.settled_from(run);
        run.fit_from = if settled < run.input.len() / 2 { settled } else { 0 };
    }
}

/// Chooses the initial state under which a fitted model explains the record best, from its very first sample.
pub(crate) fn choose(design: &Design, coefficients: &[f64], run: &Run<'_>) -> InitialState {
    choose_by(run.initial, |initial| {
        design.squared_error(
            coefficients,
            &Run {
                initial,
                fit_from: 0,
                ..*run
            },
        )
    })
}

/// Chooses the initial state with the smallest squared error.
///
/// The guess stands unless a remanent start, found by a scan of its fraction and a golden-section search, explains the
/// record clearly better. For a periodic guess the scan is coarse: what differs is one period.
pub(crate) fn choose_by(guess: InitialState, error: impl Fn(InitialState) -> f64) -> InitialState {
    let remanent = |fraction| error(InitialState::Remanent { fraction });
    let stands = error(guess);
    let steps = if matches!(guess, InitialState::Periodic { .. }) {
        2
    } else {
        8
    };
    let scanned = (0..=steps)
        .map(|i| f64::from(i) / f64::from(steps))
        .map(|fraction| (fraction, remanent(fraction)));
    let (mut best, mut least) = scanned.fold((0.0, f64::INFINITY), |a, b| if b.1 < a.1 { b } else { a });
    let promising = least < 2.0 * stands || steps > 2;
    if promising {
        let width = 1.0 / f64::from(steps);
        let refined = golden_section((best - width).max(0.0), (best + width).min(1.0), 12, remanent);
        if refined.1 < least {
            (best, least) = refined;
        }
    }
    if least < (1.0 - BELIEVED) * stands {
        InitialState::Remanent { fraction: best }
    } else {
        guess
    }
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
