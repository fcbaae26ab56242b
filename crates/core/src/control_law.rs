//! The combined control law (eq. 15): feedforward by a direct inverse plus PI feedback, through a limiter.

use crate::limiter::{Limiter, LimiterState};
use crate::model::Hysteresis;
use crate::pi_controller::{PiController, PiState};
use crate::real::{Real, rarely};

/// `v = v_ff + v_fb` (eq. 15): a direct inverse driven by the reference, a PI controller driven by the error.
///
/// # Units
/// Reference and measured position in the inverse's input unit, command in its output unit.
/// # Cost
/// That of the inverse, plus 2 multiply-adds, 4 additions and 3 compares; 6 compares more where the command meets a limit.
/// # Reference
/// The paper's eq. 15. Its figures 11 and 15 show feedback to help below 400 Hz and to hurt at 500 Hz;
/// [`PiController::weighted`] is there to fade it out.
/// # Example
/// ```
/// use hysteron_core::{bank::{PlayBank, PlayState}, control_law::ControlLaw, limiter::Limiter, mpi::{Mpi, MpiCoefficients}};
/// use hysteron_core::{pi_controller::PiController, thresholds::Thresholds};
/// let bank = PlayBank::new(Thresholds::new([0.5])?, -1.0, 11.0, 50e3)?; // micrometres in, volts out
/// let law = ControlLaw {
///     feedforward: Mpi::new(bank, MpiCoefficients { offset: 0.0, cubic: 0.0, linear: 12.0, weights: [-2.0] })?,
///     feedback: PiController::new(0.0, 3000.0, 50e3)?,
///     limiter: Limiter::new(-10.0, 130.0, 1e6, 50e3)?,
/// };
/// let mut state = law.start(PlayState::virgin(), 0.0);
/// let command_v: f64 = law.step(&mut state, 1.0, 0.9); // reference and reading
/// assert!(command_v > 11.0 && command_v < 12.0);
/// # Ok::<(), hysteron_core::error::ParamError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlLaw<T, F> {
    /// Direct inverse model; an `Option` that is `None` for feedback alone.
    pub feedforward: F,
    /// Feedback; [`PiController::none`] for open loop.
    pub feedback: PiController<T>,
    /// Limits of the command.
    pub limiter: Limiter<T>,
}

/// What the control law remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlState<T, S> {
    /// State of the inverse.
    pub feedforward: S,
    /// State of the PI controller.
    pub feedback: PiState<T>,
    /// State of the limiter.
    pub limiter: LimiterState<T>,
}

impl<T: Real, F: Hysteresis<T>> ControlLaw<T, F> {
    /// A state at rest with the command at `command`.
    pub fn start(&self, feedforward: F::State, command: T) -> ControlState<T, F::State> {
        ControlState {
            feedforward,
            feedback: PiState::default(),
            limiter: self.limiter.start_at(command),
        }
    }

    /// One sample: the command for a reference and a measured position. Finite and within limits for every input.
    #[inline(always)]
    pub fn step(&self, state: &mut ControlState<T, F::State>, reference: T, measured: T) -> T {
        let feedforward = self.feedforward.step(&mut state.feedforward, reference);
        self.step_feedback(state, feedforward, reference, measured)
    }

    /// As [`Self::step`] with another's feedforward, 0 for feedback alone. Cost: as above, without that of the inverse.
    #[inline(always)]
    pub fn step_feedback(&self, state: &mut ControlState<T, F::State>, feedforward: T, reference: T, measured: T) -> T {
        let asked = self.feedback.ask(&state.feedback, reference - measured);
        let command = feedforward + asked.output;
        if self.limiter.lets_through(&mut state.limiter, command) {
            self.feedback.take(&mut state.feedback, asked);
            return command;
        }
        rarely();
        let (asked, command, allowed) = if command.is_finite() {
            (asked, command, self.limiter.limit(&mut state.limiter, command))
        } else {
            // An error that is not finite, or not far from it, counts as none.
            let asked = self.feedback.ask(&state.feedback, T::ZERO);
            let command = feedforward + asked.output;
            (asked, command, self.limiter.step(&mut state.limiter, command))
        };
        self.feedback
            .take_limited(&mut state.feedback, asked, allowed - command);
        allowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bank::{PlayBank, PlayState};
    use crate::pi_model::Pi;
    use crate::thresholds::Thresholds;

    const RATE_HZ: f64 = 50e3;

    type Law = ControlLaw<f64, Option<Pi<f64, 1>>>;

    /// Feedforward `2 y_d` (a play of weight 0), feedback with gains of 0.5 and 1000 a second.
    fn law(slew_per_s: f64) -> Law {
        let bank = PlayBank::new(Thresholds::new([0.0]).unwrap(), -100.0, 100.0, RATE_HZ).unwrap();
        ControlLaw {
            feedforward: Some(Pi::new(bank, 0.0, 2.0, [0.0]).unwrap()),
            feedback: PiController::new(0.5, 1000.0, RATE_HZ).unwrap(),
            limiter: Limiter::new(0.0, 200.0, slew_per_s, RATE_HZ).unwrap(),
        }
    }

    /// Slew without meaning: the range in one sample.
    const FREE: f64 = 200.0 * RATE_HZ;

    /// Eq. 15 by hand: 2 x 10 + 0.5 x 1 + 1000 x 20 us x k.
    #[test]
    fn val_feedforward_plus_feedback() {
        let law = law(FREE);
        let mut state = law.start(PlayState::virgin(), 0.0);
        for k in 1..=50 {
            let command = law.step(&mut state, 10.0, 9.0);
            assert!((command - (20.5 + 0.02 * f64::from(k))).abs() < 1e-12);
        }
        let open = Law {
            feedback: PiController::none(),
            ..law
        };
        assert_eq!(open.step(&mut open.start(PlayState::virgin(), 0.0), 10.0, 9.0), 20.0);
        let closed = Law {
            feedforward: None,
            ..law
        };
        assert!((closed.step(&mut closed.start(PlayState::virgin(), 0.0), 10.0, 9.0) - 0.52).abs() < 1e-12);
    }

    /// Feedback out, in steps of the share: the error's part fades, the integral's stays, nothing winds up meanwhile.
    #[test]
    fn val_feedback_fades() {
        let law = law(FREE);
        let with = |share: f64| Law {
            feedback: law.feedback.weighted(share),
            ..law
        };
        let mut state = law.start(PlayState::virgin(), 0.0);
        for _ in 0..50 {
            law.step(&mut state, 10.0, 9.0); // the integral rises to 1
        }
        assert!((state.feedback.integral() - 1.0).abs() < 1e-12);
        for _ in 0..50_000 {
            assert!((with(0.0).step(&mut state, 10.0, 3.0) - 21.0).abs() < 1e-12);
        }
        // Half the error counts: 20 + 0.5 x 0.5 + 1 + 0.02 x 0.5.
        assert!((with(0.5).step(&mut state, 10.0, 9.0) - 21.26).abs() < 1e-12);
        for (given, used) in [(2.0, 1.0), (-1.0, 0.0), (f64::NAN, 0.0), (f64::INFINITY, 1.0)] {
            assert_eq!(law.feedback.weighted(given), law.feedback.weighted(used));
        }
    }

    /// A loop that was open is closed with an error standing: the command goes on from where it was.
    #[test]
    fn val_closes_without_a_bump() {
        let law = law(FREE);
        let open = Law {
            feedback: PiController::none(),
            ..law
        };
        let mut state = law.start(PlayState::virgin(), 0.0);
        let before = open.step(&mut state, 10.0, 8.5);
        law.feedback.start_at(&mut state.feedback, 0.0, 1.5);
        let after = law.step(&mut state, 10.0, 8.5);
        assert!((after - before).abs() < 1e-12, "{before} {after}");
    }

    /// A plant that follows at once, y = v / 2 - 5, and a reference 10 above it behind a slew limit of 1 kV/s: 20 V in
    /// 1000 samples. The feedback has to supply 10 V; unlimited, its integral would gather 0.02 x 5 x 1000 = 100 V on the
    /// way.
    #[test]
    fn val_slew_limit_does_not_wind_the_integral_up() {
        let slew = 1_000.0; // 0.02 a sample
        let law = law(slew);
        let mut state = law.start(PlayState::virgin(), 50.0);
        let target = 2.0 * (30.0 + 5.0); // y = 30
        let (mut command, mut highest) = (50.0_f64, 0.0_f64);
        for _ in 0..5000 {
            let next = law.step(&mut state, 30.0, command / 2.0 - 5.0);
            assert!((next - command).abs() <= slew / RATE_HZ + 1e-12);
            command = next;
            highest = highest.max(command);
        }
        assert!((command - target).abs() < 1e-6, "{command}");
        // It stops within 1 % of the step of 20 V.
        assert!(highest < target + 0.01 * 20.0, "{highest}");
    }

    /// Held against the range for a second, the command comes back with the first sample of the other sign.
    #[test]
    fn val_leaves_the_range_at_once() {
        let law = law(FREE);
        let mut state = law.start(PlayState::virgin(), 0.0);
        for _ in 0..50_000 {
            assert!(law.step(&mut state, 90.0, 0.0) <= 200.0);
        }
        assert!(state.limiter.limited());
        // 2 x 90 - 0.5 x 5 + integral: below the end as soon as the error turns.
        assert!(law.step(&mut state, 90.0, 95.0) < 200.0);
    }
}
