//! Creep: what the stack goes on doing after the voltage has come to rest.

use crate::effects::lag::coefficients;
use crate::effects::{Block, admit};
use crate::error::{ParamError, in_range};
use crate::real::Real;

/// Creep as a chain of Kelvin-Voigt elements, `y = u + sum c_i x_i` with `tau_i x_i' + x_i = u`.
///
/// The logarithmic law `y = y_0 (1 + gamma log10(t / t_0))` is the same chain with equal shares: see [`Creep::logarithmic`].
///
/// Slow states do not fit single precision at 50 kHz (for 100 s a step moves by 2e-7 of the deviation, the resolution of
/// `f32`), so they are advanced once every `divider` samples with the mean input of those samples.
///
/// # Units
/// Shares pure numbers (displacement that is still to come over the one that came at once), time constants in seconds.
/// Piezo stacks: 1 to 2 % a decade of time.
/// # Cost
/// N + 1 multiply-adds a step, 2 N more every `divider` samples.
/// # Reference
/// Croft, Shed, Devasia, J. Dyn. Syst. Meas. Control 123 (2001) 35 (the chain); Jung, Gweon, Rev. Sci. Instrum. 71 (2000)
/// 1896 (the logarithmic law).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Creep<T, const N: usize> {
    shares: [T; N],
    /// `1 - exp(-T_slow / tau_i)`.
    approach: [T; N],
    /// Part of the change within one slow step that arrives in it; 0 where several samples make one.
    through: [T; N],
    divider: u32,
    share_of_a_sample: T,
}

/// The elements of a creep chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CreepState<T, const N: usize> {
    elements: [T; N],
    last: T,
    sum: T,
    samples: u32,
}

impl<T: Real, const N: usize> Creep<T, N> {
    /// Builds a chain; with `divider` 1 it is exact for straight lines between samples.
    ///
    /// # Errors
    /// A share outside 0 to 10; time constants outside 1e-6 to 1e6 s; a divider outside 1 to 1000000; a sample rate
    /// outside 1e-3 to 1e7 Hz.
    #[cold]
    pub fn new(shares: [f64; N], tau_s: [f64; N], sample_rate_hz: f64, divider: u32) -> Result<Self, ParamError> {
        in_range("sample_rate_hz", None, sample_rate_hz, 1e-3, 1e7)?;
        in_range("divider", None, f64::from(divider), 1.0, 1e6)?;
        for (i, (&share, &tau)) in shares.iter().zip(&tau_s).enumerate() {
            in_range("share", Some(i + 1), share, 0.0, 10.0)?;
            in_range("tau_s", Some(i + 1), tau, 1e-6, 1e6)?;
        }
        let slow = sample_rate_hz / f64::from(divider);
        let both = tau_s.map(|tau| coefficients(tau * slow));
        Ok(Self {
            shares: shares.map(T::from_f64),
            approach: both.map(|(approach, _)| T::from_f64(approach)),
            through: both.map(|(_, through)| if divider == 1 { T::from_f64(through) } else { T::ZERO }),
            divider,
            share_of_a_sample: T::from_f64(1.0 / f64::from(divider)),
        })
    }

    /// The chain of the logarithmic law: `gamma` a decade of time, one element a decade from `first_tau_s` on.
    ///
    /// Steps at one a decade make the law's straight line in log t a staircase whose ripple is below 2 % of `gamma`.
    ///
    /// # Errors
    /// As [`Creep::new`].
    pub fn logarithmic(gamma: f64, first_tau_s: f64, sample_rate_hz: f64, divider: u32) -> Result<Self, ParamError> {
        let mut tau_s = [first_tau_s; N];
        let mut tau = first_tau_s;
        for cell in &mut tau_s {
            *cell = tau;
            tau *= 10.0;
        }
        Self::new([gamma; N], tau_s, sample_rate_hz, divider)
    }

    /// `sum c_i x_i`: what the elements add.
    #[inline(always)]
    fn crept(&self, elements: &[T; N]) -> T {
        let mut sum = T::ZERO;
        for (&share, &element) in self.shares.iter().zip(elements) {
            sum += share * element;
        }
        sum
    }
}

impl<T: Real, const N: usize> Block<T> for Creep<T, N> {
    type State = CreepState<T, N>;

    /// Crept to the end.
    fn rest_at(&self, input: T) -> Self::State {
        let input = admit(input, T::ZERO);
        CreepState {
            elements: [input; N],
            last: input,
            sum: T::ZERO,
            samples: 0,
        }
    }

    #[inline(always)]
    fn step(&self, state: &mut Self::State, input: T) -> T {
        let input = admit(input, state.last);
        state.sum += input * self.share_of_a_sample;
        state.samples += 1;
        if state.samples >= self.divider {
            // With several samples a step the mean is the input over the whole of it.
            let (from, to) = if self.divider == 1 {
                (state.last, input)
            } else {
                (state.sum, state.sum)
            };
            let coefficients = self.approach.iter().zip(&self.through);
            for (element, (&approach, &through)) in state.elements.iter_mut().zip(coefficients) {
                *element += approach * (from - *element) + through * (to - from);
            }
            state.sum = T::ZERO;
            state.samples = 0;
        }
        state.last = input;
        let mut output = input;
        for (&share, &element) in self.shares.iter().zip(&state.elements) {
            output += share * element;
        }
        output
    }
}

/// Undoes creep: `x = (u - sum c_i p_i) / (1 + sum c_i g_i)`, with `p_i` what each element would reach if `x` went back to 0 within the
/// sample and `g_i` the share of a change of `x` that arrives within its sample.
///
/// Fast elements are advanced every sample and undone exactly for straight lines; slow ones once every `divider` samples
/// with the mean of those samples, as in [`Creep`]. Of a fast element `p_i / (1 - g_i)` is remembered, which approaches `x` as the element
/// itself does: `z += b (x - z)`.
///
/// # Units
/// As [`Creep`].
/// # Cost
/// 2 FAST + 2 multiply-adds a step; 2 SLOW more every `divider` samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CreepInverse<T, const FAST: usize, const SLOW: usize> {
    /// `c_i (1 - g_i)`
    fast_shares: [T; FAST],
    /// `b_i = 1 - exp(-T / tau_i)`
    fast_approach: [T; FAST],
    slow: Creep<T, SLOW>,
    /// `1 / (1 + sum c_i g_i)` over the fast elements.
    at_once: T,
}

/// The numbers that a step of [`CreepInverse`] computes with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CreepInverseCoefficients<T, const FAST: usize, const SLOW: usize> {
    /// Share of a wanted position that is there at once.
    pub at_once: T,
    /// What each fast element has still to give.
    pub fast_shares: [T; FAST],
    /// How far it goes in a sample.
    pub fast_approach: [T; FAST],
    /// What each slow element has still to give.
    pub slow_shares: [T; SLOW],
    /// How far it goes in a step.
    pub slow_approach: [T; SLOW],
    /// Samples a step of the slow elements.
    pub divider: u32,
    /// One over that.
    pub share_of_a_sample: T,
}

/// State of [`CreepInverse`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CreepInverseState<T, const FAST: usize, const SLOW: usize> {
    fast: [T; FAST],
    slow: [T; SLOW],
    /// `sum c_i z_i` over the slow elements, and as far as they have moved on.
    crept_slowly: T,
    moved: T,
    /// Mean of the last `divider` samples, and of those since, as far as they have come.
    mean: T,
    next_mean: T,
    samples: u32,
    wanted: T,
}

impl<T: Real, const FAST: usize, const SLOW: usize> CreepInverse<T, FAST, SLOW> {
    /// Builds the inverse of a chain of fast elements (every sample) and slow ones (every `divider` samples).
    ///
    /// # Errors
    /// As [`Creep::new`], for either part; fewer samples a step than there are slow elements, of which one moves a sample.
    #[cold]
    pub fn new(
        [fast_shares, fast_tau_s]: [[f64; FAST]; 2],
        [slow_shares, slow_tau_s]: [[f64; SLOW]; 2],
        sample_rate_hz: f64,
        divider: u32,
    ) -> Result<Self, ParamError> {
        Creep::<T, FAST>::new(fast_shares, fast_tau_s, sample_rate_hz, 1)?;
        in_range("divider", None, f64::from(divider), SLOW as f64, 1e6)?;
        let through = fast_tau_s.map(|tau| coefficients(tau * sample_rate_hz).1);
        let mut arriving = 1.0;
        let mut shares = fast_shares;
        for (share, through) in shares.iter_mut().zip(through) {
            arriving += *share * through;
            *share *= 1.0 - through;
        }
        Ok(Self {
            fast_shares: shares.map(T::from_f64),
            fast_approach: fast_tau_s.map(|tau| T::from_f64(coefficients(tau * sample_rate_hz).0)),
            slow: Creep::new(slow_shares, slow_tau_s, sample_rate_hz, divider)?,
            at_once: T::from_f64(1.0 / arriving),
        })
    }

    /// The numbers of a step.
    pub fn coefficients(&self) -> CreepInverseCoefficients<T, FAST, SLOW> {
        CreepInverseCoefficients {
            at_once: self.at_once,
            fast_shares: self.fast_shares,
            fast_approach: self.fast_approach,
            slow_shares: self.slow.shares,
            slow_approach: self.slow.approach,
            divider: self.slow.divider,
            share_of_a_sample: self.slow.share_of_a_sample,
        }
    }

    /// Rest at `input` for ever, or at 0 where the stage has just been put at rest.
    pub fn rest_at(&self, input: T) -> CreepInverseState<T, FAST, SLOW> {
        let input = admit(input, T::ZERO);
        let slow = [input; SLOW];
        CreepInverseState {
            fast: [input; FAST],
            slow,
            crept_slowly: self.slow.crept(&slow),
            moved: T::ZERO,
            mean: input,
            next_mean: T::ZERO,
            samples: 0,
            wanted: input,
        }
    }

    /// One sample: the position before creep that gives the position wanted after it.
    #[inline(always)]
    pub fn step(&self, state: &mut CreepInverseState<T, FAST, SLOW>, wanted: T) -> T {
        let wanted = admit(wanted, state.wanted);
        state.wanted = wanted;
        let mut crept = state.crept_slowly;
        for (&z, &share) in state.fast.iter().zip(&self.fast_shares) {
            crept += share * z;
        }
        let before = (wanted - crept) * self.at_once;
        for (z, &approach) in state.fast.iter_mut().zip(&self.fast_approach) {
            *z += approach * (before - *z);
        }
        self.move_slow(state);
        state.next_mean += before * self.slow.share_of_a_sample;
        state.samples += 1;
        if state.samples >= self.slow.divider {
            (state.mean, state.next_mean) = (state.next_mean, T::ZERO);
            state.samples = 0;
        }
        before
    }

    /// One slow element a sample, so that no sample has to move them all.
    #[inline(always)]
    fn move_slow(&self, state: &mut CreepInverseState<T, FAST, SLOW>) {
        let i = state.samples as usize;
        if let (Some(z), Some(&approach), Some(&share)) = (
            state.slow.get_mut(i),
            self.slow.approach.get(i),
            self.slow.shares.get(i),
        ) {
            *z += approach * (state.mean - *z);
            state.moved += share * *z;
            if i + 1 == SLOW {
                (state.crept_slowly, state.moved) = (state.moved, T::ZERO);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After a step at rest each element approaches by its exponential.
    #[test]
    fn val_step_closed_form() {
        let creep = Creep::<f64, 2>::new([0.05, 0.1], [1.0, 20.0], 100.0, 1).unwrap();
        let mut state = creep.rest_at(0.0);
        creep.step(&mut state, 1.0);
        // The step is a ramp over the first sample: as if it came half a sample later.
        for k in 1..=2000 {
            let found = creep.step(&mut state, 1.0);
            let t = (f64::from(k) + 0.5) / 100.0;
            let wanted = 1.0 + 0.05 * (1.0 - (-t).exp()) + 0.1 * (1.0 - (-t / 20.0).exp());
            // (T / tau)^2 / 24 of the faster share: 2e-7
            assert!((found - wanted).abs() < 5e-7, "{t}: {found} {wanted}");
        }
    }

    /// Slow states at a five-hundredth of the rate in `f32` stay with the exact ones: a sample of 10 ms against 100 s,
    /// 1e-4 of the share, and rounding.
    #[test]
    fn val_divided_f32_follows_exact_f64() {
        let exact = Creep::<f64, 1>::new([0.1], [100.0], 50e3, 1).unwrap();
        let divided = Creep::<f32, 1>::new([0.1], [100.0], 50e3, 500).unwrap();
        let (mut a, mut b) = (exact.rest_at(0.0), divided.rest_at(0.0));
        for k in 0..1_000_000 {
            let wanted = exact.step(&mut a, 1.0);
            let found = divided.step(&mut b, 1.0);
            if k % 10_000 == 9_999 {
                assert!((f64::from(found) - wanted).abs() < 3e-5, "{k}: {found} {wanted}");
            }
        }
    }

    /// Well inside the range of the chain a decade of time adds gamma.
    #[test]
    fn val_logarithmic_law() {
        let creep = Creep::<f64, 6>::logarithmic(0.015, 1e-2, 1e3, 1).unwrap();
        let mut state = creep.rest_at(0.0);
        let mut at = std::vec::Vec::new();
        for k in 1..=100_000 {
            at.push((f64::from(k) * 1e-3, creep.step(&mut state, 1.0)));
        }
        let near = |t: f64| at.iter().find(|(time, _)| *time >= t).unwrap().1;
        for t in [0.1, 0.3, 1.0, 3.0, 10.0] {
            let decade = near(10.0 * t) - near(t);
            assert!((decade - 0.015).abs() < 0.05 * 0.015, "from {t} s: {decade}");
        }
    }

    #[test]
    fn prop_finite_for_every_input() {
        let creep = Creep::<f32, 2>::new([10.0, 0.0], [1e-6, 1e6], 50e3, 3).unwrap();
        let mut state = creep.rest_at(f32::NAN);
        for input in [1e30, f32::NAN, -1e30, f32::INFINITY, 1.0, -f32::MAX] {
            assert!(creep.step(&mut state, input).is_finite());
        }
    }

    #[test]
    fn refuse_negative_creep() {
        let refused = Creep::<f64, 2>::new([0.1, -0.1], [1.0, 10.0], 50e3, 1).unwrap_err();
        assert_eq!(std::format!("{refused}"), "share[2] = -0.1 must lie in 0 to 10");
        assert!(Creep::<f64, 1>::new([0.1], [0.0], 50e3, 1).is_err());
        assert!(Creep::<f64, 1>::new([0.1], [1.0], 50e3, 0).is_err());
    }

    /// Creep after its inverse is the identity: exactly for the fast elements, within the decimation for slow ones.
    #[test]
    fn val_inverse_undoes_creep() {
        let (fast, slow) = ([0.01, 0.02], [0.015, 0.03]);
        let (fast_s, slow_s) = ([1e-3, 2e-2], [1.0, 100.0]);
        let inverse = CreepInverse::<f64, 2, 2>::new([fast, fast_s], [slow, slow_s], 50e3, 50).unwrap();
        let single = CreepInverse::<f32, 2, 2>::new([fast, fast_s], [slow, slow_s], 50e3, 50).unwrap();
        let creep = Creep::<f64, 4>::new([0.01, 0.02, 0.015, 0.03], [1e-3, 2e-2, 1.0, 100.0], 50e3, 1).unwrap();
        let (mut a, mut b, mut c) = (inverse.rest_at(0.0), creep.rest_at(0.0), single.rest_at(0.0));
        for k in 0..500_000 {
            let wanted = 5.0 * (1.0 - (TAU_A_SAMPLE * f64::from(k)).cos()) + f64::from(k / 100_000);
            let before = inverse.step(&mut a, wanted);
            let found = creep.step(&mut b, before);
            // The element of 1 s has yet to make up to a millisecond's move: 1e-3 of at most 14 um, by its share of 0.015.
            assert!((found - wanted).abs() < 2.1e-4, "{k}: {found} {wanted}");
            let in_single = f64::from(single.step(&mut c, wanted as f32));
            // 10 um in f32: 5e-7 a rounding, slow states add some of them.
            assert!((in_single - before).abs() < 2e-5, "{k}: {in_single} {before}");
        }
    }

    /// 23 Hz at 50 kHz.
    const TAU_A_SAMPLE: f64 = core::f64::consts::TAU * 23.0 / 50e3;
}
