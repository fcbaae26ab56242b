//! Elements whose memory fades along the path of the voltage, by the widest vectors of the processor.
//!
//! `dz = |du| (u^k - z) / L`, k = 1, 2, 3: Coleman and Hodgdon's equation with a polynomial for its curve is a sum of such elements of one
//! length L and of powers of u; Dahl's is one of them. Several lengths come near the others of Duhem's kind.

use crate::basis::Basis;
use crate::moving_plays::Visit;
use crate::start_state::InitialState;
use hysteron_effects::family::FADING_STEP;

/// Powers that an element follows.
const POWERS: usize = 3;

/// Octaves of lengths: below an eighth of the range a memory is none, and above all of it none fades on a record.
const OCTAVES: f64 = 4.0;

/// What of the state before a period must fade over it before its repetition is believed, share.
const LEAST_FADED: f64 = 1e-6;

/// Fading elements on their way along a voltage.
pub(crate) struct Fading<'m, V, const N: usize> {
    /// Half the range over each length.
    pub per_half: [f64; N],
    pub basis: &'m Basis,
    pub initial: InitialState,
    pub stack_v: &'m [f64],
    pub run_in: usize,
    pub visit: V,
}

/// Lengths for a range of voltages, volts, ascending: spread evenly over the octaves from an eighth of the range to all of it.
pub(crate) fn lengths(elements: usize, span: f64) -> Vec<f64> {
    (0..elements)
        .map(|i| span * (OCTAVES * ((i as f64 + 0.5) / elements as f64 - 1.0)).exp2())
        .collect()
}

/// Elements in their states.
type States<const N: usize> = [[f64; N]; POWERS];

/// Most parts of one step: fifty half ranges, far beyond where what is followed is straight anyway.
const MOST_PARTS: f64 = 1000.0;

/// Goes along the path from one voltage to another: exact where what is followed is a straight line on each part of it.
#[inline(always)]
fn advance<const N: usize>(basis: &Basis, per_half: &[f64; N], [from_v, to_v]: [f64; 2], z: &mut States<N>) {
    let way = (to_v - from_v).abs() / basis.half();
    if way == 0.0 {
        return;
    }
    let parts = (way / FADING_STEP).ceil().clamp(1.0, MOST_PARTS);
    let (part, step_v) = (way / parts, (to_v - from_v) / parts);
    let mut from = basis.followed(from_v);
    let faded: [f64; N] = std::array::from_fn(|l| (-part * per_half[l]).exp());
    for k in 1..=parts as usize {
        let to = basis.followed(from_v + step_v * k as f64);
        for l in 0..N {
            let behind = 1.0 / (part * per_half[l]);
            for p in 0..POWERS {
                let lags = (to[p] - from[p]) * behind;
                z[p][l] = to[p] - lags + (z[p][l] - from[p] + lags) * faded[l];
            }
        }
        from = to;
    }
}

/// The states at `u` of a stage that is cycled over the whole range, on the way up and on the way down.
///
/// On a way up `z = P(u) + C e^(-w / L)` with `P` the polynomial that solves the equation and `w` the way since the turn; the constants of
/// both branches follow from what is continuous at the turns.
fn cycled<const N: usize>(per_half: &[f64; N], u: f64) -> [States<N>; 2] {
    let u = u.clamp(-1.0, 1.0);
    let of = |p: usize, l: usize| {
        let length = 1.0 / per_half[l];
        let end = (-2.0 / length).exp();
        let rising = |u: f64| solution(p + 1, u, length);
        let falling = |u: f64| solution(p + 1, u, -length);
        let (low, high) = (falling(-1.0) - rising(-1.0), rising(1.0) - falling(1.0));
        let up = (low + end * high) / (1.0 - end * end);
        let down = high + end * up;
        [
            rising(u) + up * (-(u + 1.0) / length).exp(),
            falling(u) + down * (-(1.0 - u) / length).exp(),
        ]
    };
    [0, 1].map(|branch| std::array::from_fn(|p| std::array::from_fn(|l| of(p, l)[branch])))
}

/// The states of elements of these lengths at 0 V, come down to in cycles over a range of voltages: what they hold of `v`, `v^2`, `v^3`.
pub(crate) fn at_rest(lengths: &[f64], [low, high]: [f64; 2]) -> Vec<[f64; POWERS]> {
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let of = |length: &f64| {
        let [_, down] = cycled(&[half / length], -middle / half);
        let [u, square, cube] = down.map(|lanes| lanes[0]);
        // Powers of `middle + half u`; what is held of 1 is 1.
        [
            middle + half * u,
            middle.powi(2) + 2.0 * middle * half * u + half.powi(2) * square,
            middle.powi(3)
                + 3.0 * middle.powi(2) * half * u
                + 3.0 * middle * half.powi(2) * square
                + half.powi(3) * cube,
        ]
    };
    lengths.iter().map(of).collect()
}

/// The polynomial solution of `length dz/du = u^k - z`.
fn solution(k: usize, u: f64, length: f64) -> f64 {
    // z = sum over j of (-length)^j d^j(u^k)/du^j
    let (mut sum, mut factor) = (0.0, 1.0);
    for j in 0..=k {
        sum += factor * u.powi((k - j) as i32);
        factor *= -length * (k - j) as f64;
    }
    sum
}

impl<V: Visit<N>, const N: usize> Fading<'_, V, N> {
    /// The states before the first sample.
    #[inline(always)]
    fn start(&self) -> States<N> {
        let first = self.stack_v.first().copied().unwrap_or(0.0);
        let [up, down] = cycled(&self.per_half, self.basis.about_the_middle(first));
        let middle = self.basis.followed(first).map(|value| [value; N]);
        let fraction = match self.initial {
            InitialState::Remanent { fraction } => fraction,
            InitialState::Periodic { .. } => 0.5,
        };
        let (mut z, to, share) = if fraction < 0.5 {
            (down, middle, 2.0 * fraction)
        } else {
            (middle, up, 2.0 * fraction - 1.0)
        };
        for (z, to) in z.as_flattened_mut().iter_mut().zip(to.as_flattened()) {
            *z += share * (to - *z);
        }
        z
    }

    /// The states to which a period that is repeated for ever leads.
    #[inline(always)]
    fn repeated(&self, start: States<N>) -> States<N> {
        let mut z = start;
        let mut way = 0.0;
        let mut last = self.stack_v.first().copied().unwrap_or(0.0);
        for &v in self.stack_v.iter().skip(1).take(self.run_in) {
            advance(self.basis, &self.per_half, [last, v], &mut z);
            way += (v - last).abs() / self.basis.half();
            last = v;
        }
        for l in 0..N {
            let kept = (-way * self.per_half[l]).exp();
            if 1.0 - kept > LEAST_FADED {
                for p in 0..POWERS {
                    z[p][l] = (z[p][l] - kept * start[p][l]) / (1.0 - kept);
                }
            }
        }
        z
    }
}

impl<V: Visit<N>, const N: usize> pulp::NullaryFnOnce for Fading<'_, V, N> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let mut z = self.start();
        if self.run_in > 0 {
            z = self.repeated(z);
        }
        let mut last = self.stack_v.first().copied().unwrap_or(0.0);
        for (k, &v) in self.stack_v.iter().enumerate() {
            advance(self.basis, &self.per_half, [last, v], &mut z);
            last = v;
            self.visit.functions(k, &z);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Family;
    use crate::moving_plays::LANES;

    const RANGE_V: [f64; 2] = [-10.0, 90.0];

    fn basis() -> Basis {
        Basis::new(Family::Duhem, RANGE_V)
    }

    /// Keeps what the elements hold at every sample.
    struct Kept<'k>(&'k mut Vec<States<LANES>>);

    impl Visit<LANES> for Kept<'_> {
        fn at(&mut self, _: usize, _: f64, _: &[f64; LANES]) {}

        fn functions(&mut self, _: usize, functions: &[[f64; LANES]; 3]) {
            self.0.push(*functions);
        }
    }

    fn held(lengths_v: &[f64], initial: InitialState, stack_v: &[f64], run_in: usize) -> Vec<States<LANES>> {
        let mut states = Vec::new();
        let moving = Fading {
            per_half: std::array::from_fn(|l| lengths_v.get(l).map_or(1.0, |length| 50.0 / length)),
            basis: &basis(),
            initial,
            stack_v,
            run_in,
            visit: Kept(&mut states),
        };
        pulp::NullaryFnOnce::call(moving);
        states
    }

    /// The equation itself, `dz = |du| (u^k - z) / L` with `u` from -1 to 1 over the range, by a thousand steps of the
    /// midpoint rule from one voltage to the next, after `before` was gone through.
    fn by_midpoints(length_v: f64, k: i32, before: &[f64], stack_v: &[f64]) -> Vec<f64> {
        let u = |v: f64| (v - 40.0) / 50.0;
        let mut z = 0.0;
        let mut last = before.first().or(stack_v.first()).copied().unwrap();
        let mut go = |v: f64, z: &mut f64| {
            for step in 0..1000 {
                let at = last + (v - last) * (f64::from(step) + 0.5) / 1000.0;
                let way = (v - last).abs() / 1000.0 / length_v;
                *z += way / (1.0 + 0.5 * way) * (u(at).powi(k) - *z);
            }
            last = v;
        };
        before.iter().for_each(|&v| go(v, &mut z));
        stack_v
            .iter()
            .map(|&v| {
                go(v, &mut z);
                z
            })
            .collect()
    }

    const LENGTHS_V: [f64; 2] = [12.0, 80.0];

    /// Steps of all sizes, from rest after cycles over the range: what is held is what the equation gives, to what a power bends on a twentieth of
    /// half the range.
    #[test]
    fn val_elements_follow_their_equation() {
        let stack_v = [-10.0, 3.0, 3.1, 70.0, 20.0, 90.0, 55.0, 55.0, -10.0, 40.0];
        let cycles: Vec<f64> = (0..12).map(|k| if k % 2 == 0 { 90.0 } else { -10.0 }).collect();
        let found = held(&LENGTHS_V, InitialState::REST, &stack_v, 0);
        for (l, length_v) in LENGTHS_V.into_iter().enumerate() {
            for k in 1..=3 {
                let wanted = by_midpoints(length_v, k, &cycles, &stack_v);
                for (i, wanted) in wanted.iter().enumerate() {
                    let own = found[i][k as usize - 1][l];
                    assert!(
                        (own - wanted).abs() < 1e-3,
                        "{length_v} V, power {k}, {i}: {own} {wanted}"
                    );
                }
            }
        }
    }

    /// Down from above, on the middle curve, up from below: 0, a half and 1 of a remanent state.
    #[test]
    fn val_states_before_a_record() {
        let at = |fraction: f64| held(&LENGTHS_V, InitialState::Remanent { fraction }, &[55.0], 0)[0];
        let cycles: Vec<f64> = (0..12).map(|k| if k % 2 == 0 { 90.0 } else { -10.0 }).collect();
        let [down, middle, up] = [0.0, 0.5, 1.0].map(at);
        for (l, length_v) in LENGTHS_V.into_iter().enumerate() {
            for k in 1..=3 {
                let p = k as usize - 1;
                let from_above = by_midpoints(length_v, k, &cycles, &[90.0, 55.0]);
                let from_below = by_midpoints(length_v, k, &cycles, &[55.0]);
                assert!((down[p][l] - from_above[1]).abs() < 1e-3, "{down:?} {from_above:?}");
                assert!((up[p][l] - from_below[0]).abs() < 1e-3, "{up:?} {from_below:?}");
                assert!((middle[p][l] - 0.3_f64.powi(k)).abs() < 1e-12);
            }
        }
    }

    /// A period that is repeated for ever: the closed form is what two hundred periods lead to, wherever they began.
    #[test]
    fn val_a_period_repeated_for_ever() {
        let period: Vec<f64> = (0..40)
            .map(|k| 50.0 - 15.0 * (std::f64::consts::TAU * f64::from(k) / 40.0).cos())
            .collect();
        let twice = period.repeat(2);
        let closed = held(&LENGTHS_V, InitialState::Periodic { samples: 40 }, &twice, 40);
        let long = period.repeat(200);
        let run = held(&LENGTHS_V, InitialState::REST, &long, 0);
        for (closed, run) in closed[40..].iter().zip(&run[199 * 40..]) {
            for p in 0..POWERS {
                for l in 0..LENGTHS_V.len() {
                    assert!((closed[p][l] - run[p][l]).abs() < 1e-9, "{closed:?} {run:?}");
                }
            }
        }
    }

    /// Powers of the voltage itself, of a stage at rest at 0 V.
    #[test]
    fn val_rest_in_powers_of_the_voltage() {
        let rest = at_rest(&LENGTHS_V, RANGE_V);
        let centred = held(&LENGTHS_V, InitialState::REST, &[0.0], 0)[0];
        for (l, [v, square, cube]) in rest.into_iter().enumerate() {
            let [u, u2, u3] = centred.map(|lanes| lanes[l]);
            // v = 40 + 50 u
            assert!((v - (40.0 + 50.0 * u)).abs() < 1e-9);
            assert!((square - (1600.0 + 4000.0 * u + 2500.0 * u2)).abs() < 1e-6);
            assert!((cube - (64e3 + 24e4 * u + 3e5 * u2 + 125e3 * u3)).abs() < 1e-4);
        }
    }

    /// A voltage that no stage has: the step ends, and a line goes on.
    #[test]
    fn bva_a_step_without_measure_ends() {
        let far = held(&LENGTHS_V, InitialState::REST, &[0.0, 1e30], 0)[1];
        assert!(far.as_flattened().iter().all(|z| z.is_finite()));
        assert!((far[0][0] / 2e28 - 1.0).abs() < 1e-9, "{}", far[0][0]);
    }

    #[test]
    fn val_lengths_by_hand() {
        // The middles of four octaves below 64 V.
        let wanted = [
            64.0 / 2_f64.powf(3.5),
            64.0 / 2_f64.powf(2.5),
            64.0 / 2_f64.powf(1.5),
            64.0 / 2_f64.sqrt(),
        ];
        for (found, wanted) in lengths(4, 64.0).into_iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
        assert_eq!(lengths(1, 64.0), [16.0]);
    }
}
