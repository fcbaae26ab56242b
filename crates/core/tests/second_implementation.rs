//! The core against a second, naive implementation written from the paper's equations with no shared code, and `f32`
//! against `f64`.

#![expect(clippy::unwrap_used, reason = "a test that cannot build its subject fails")]

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::envelope::Envelope;
use hysteron_core::model::Hysteresis;
use hysteron_core::mpi::{Mpi, MpiCoefficients};
use hysteron_core::mrpi::Mrpi;
use hysteron_core::pi_model::Pi;
use hysteron_core::play_polynomial::{PlayPolynomial, PolynomialCoefficients};
use hysteron_core::real::Real;
use hysteron_core::thresholds::Thresholds;
use hysteron_core::wrpi::Wrpi;
use proptest::prelude::*;

const N: usize = 6;
const RATE_HZ: f64 = 50e3;
const RANGE: f64 = 2.0;

/// Random parameters of all models at once.
#[derive(Debug, Clone)]
struct Parameters {
    gaps: [f64; N],
    first: [f64; N],
    second: [f64; N],
    third: [f64; N],
    g: [f64; 5],
    alpha_s: f64,
    beta_s: f64,
}

impl Parameters {
    fn thresholds(&self) -> [f64; N] {
        let mut sum = 0.0;
        self.gaps.map(|gap| {
            sum += gap;
            sum
        })
    }
}

prop_compose! {
    fn parameters()(
        gaps in prop::array::uniform6(0.01..0.3),
        first in prop::array::uniform6(-1.0..1.0),
        second in prop::array::uniform6(-1.0..1.0),
        third in prop::array::uniform6(-1.0..1.0),
        g in prop::array::uniform5(-1.0..1.0),
        alpha_s in 0.0..5e-4,
        beta_s in 0.0..5e-4,
    ) -> Parameters {
        Parameters { gaps, first, second, third, g, alpha_s, beta_s }
    }
}

/// A wandering drive whose largest step is that of a 1 kHz sine over the range: |v'| <= 2 pi 1000.
fn drive() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-0.125..0.125_f64, 2..300).prop_map(|steps: Vec<f64>| {
        let mut v: f64 = 0.3;
        steps
            .into_iter()
            .map(|step| {
                v = f64::clamp(v + step, -1.5, 1.5);
                v
            })
            .collect()
    })
}

/// The paper's equations, sample by sample, with std's own max and min.
struct Naive {
    w: [f64; N],
    /// None before the first sample, which has no rate.
    last: Option<f64>,
}

impl Naive {
    fn new() -> Self {
        Self {
            w: [0.0; N],
            last: None,
        }
    }

    fn plays(&mut self, p: &Parameters, v: f64, alpha: f64, beta: f64) -> f64 {
        let rate = (v - self.last.unwrap_or(v)) * RATE_HZ;
        self.last = Some(v);
        let (left, right) = (v - alpha * rate.abs(), v + beta * rate.abs());
        for (w, r) in self.w.iter_mut().zip(p.thresholds()) {
            *w = f64::max(left - r, f64::min(right, *w));
        }
        rate
    }

    fn sum(&self, c: &[f64; N], power: i32) -> f64 {
        c.iter().zip(&self.w).map(|(c, w)| c * w.powi(power)).sum()
    }
}

fn bank<T: Real>(p: &Parameters) -> PlayBank<T, N> {
    let thresholds = Thresholds::new(p.thresholds().map(T::from_f64)).unwrap();
    PlayBank::new(
        thresholds,
        T::from_f64(-RANGE),
        T::from_f64(RANGE),
        T::from_f64(RATE_HZ),
    )
    .unwrap()
}

fn mpi_coefficients<T: Real>(p: &Parameters) -> MpiCoefficients<T, N> {
    MpiCoefficients {
        offset: T::from_f64(p.g[4]),
        cubic: T::from_f64(p.g[2]),
        linear: T::from_f64(p.g[0]),
        weights: p.first.map(T::from_f64),
    }
}

/// Outputs of all five models over a drive.
fn outputs<T: Real>(p: &Parameters, drive: &[f64]) -> Vec<[f64; 5]> {
    let c = mpi_coefficients::<T>(p);
    let pi = Pi::new(bank(p), c.offset, c.linear, c.weights).unwrap();
    let mpi = Mpi::new(bank(p), c).unwrap();
    let wrpi = Wrpi::new(bank(p), c, p.second.map(|l| T::from_f64(1e-3 * l))).unwrap();
    let envelope = Envelope {
        alpha_s: T::from_f64(p.alpha_s),
        beta_s: T::from_f64(p.beta_s),
    };
    let mrpi = Mrpi::new(bank(p), c, envelope).unwrap();
    let polynomial = PlayPolynomial::new(
        bank(p),
        PolynomialCoefficients {
            offset: c.offset,
            input_function: p.g.map(T::from_f64),
            linear: c.weights,
            quadratic: p.second.map(T::from_f64),
            cubic: p.third.map(T::from_f64),
        },
    )
    .unwrap();
    let mut states = [PlayState::virgin(); 5];
    drive
        .iter()
        .map(|&v| {
            let v = T::from_f64(v);
            let [a, b, c, d, e] = &mut states;
            [
                pi.step(a, v),
                mpi.step(b, v),
                wrpi.step(c, v),
                mrpi.step(d, v),
                polynomial.step(e, v),
            ]
            .map(T::to_f64)
        })
        .collect()
}

fn naive_outputs(p: &Parameters, drive: &[f64]) -> Vec<[f64; 5]> {
    let (mut fixed, mut moving) = (Naive::new(), Naive::new());
    let c = p.g[4];
    drive
        .iter()
        .map(|&v| {
            let rate = fixed.plays(p, v, 0.0, 0.0);
            moving.plays(p, v, p.alpha_s, p.beta_s);
            let cubic = p.g[2] * v.powi(3) + p.g[0] * v;
            let g: f64 = (1..).zip(p.g).map(|(power, c)| c * v.powi(power)).sum();
            let rate_weights = p.second.map(|l| 1e-3 * l);
            [
                c + p.g[0] * v + fixed.sum(&p.first, 1),
                c + cubic + fixed.sum(&p.first, 1),
                c + cubic + fixed.sum(&p.first, 1) + rate * fixed.sum(&rate_weights, 1),
                c + cubic + moving.sum(&p.first, 1),
                c + g + fixed.sum(&p.first, 1) + fixed.sum(&p.second, 2) + fixed.sum(&p.third, 3),
            ]
        })
        .collect()
}

/// Half a unit in the last place of `f32`, relative: what one rounding leaves.
const U: f64 = 1.0 / 16_777_216.0; // 2^-24

/// Bound of `|f32 - f64|` of the five models, from |v| <= 1.5, r_i <= 6 x 0.3 = 1.8, |coefficient| <= 1, N = 6,
/// |v'| <= 0.125 x 50e3 = 6250 a second, alpha, beta <= 5e-4 s, rate weights <= 1e-3.
///
/// Plays do not accumulate errors: each output is an old bound or a new one, rounded once. With the roundings of one
/// sample counted once each, to first order:
/// - rate: two inputs of 1.5 rounded to 1.5 U, their difference times 50e3: `3 U x 50e3 = 150e3 U`, and 3 more roundings
///   of 6250
/// - static play: input 1.5 U, threshold 1.8 U, difference 3.3 U: below `7 U`; |w| <= 3.3
/// - MRPI play: that, plus alpha x (error of the rate) and 3 roundings of alpha |v'| <= 3.125: `7 + 85 + 10 U`;
///   |w| <= 6.5
/// - a sum of terms whose magnitudes sum to S, each with a coefficient rounded once and at most N + 6 = 12 roundings on
///   its way through products and sums: `13 S U`, plus the coefficients times the errors of what they multiply
fn bound(model: usize) -> f64 {
    let n = N as f64;
    let rate_error = 150e3 + 3.0 * 6250.0;
    let (play, most) = (7.0, 3.3);
    // The offset and the cubic input function: 1 + 1.5 + 3.375, slope 1 + 3 x 1.5^2.
    let (fixed, fixed_error) = (1.0 + 1.5 + 3.375, 7.75 * 1.5);
    let static_sum = fixed + n * most;
    let static_error = fixed_error + n * play;
    U * match model {
        // PI and MPI
        0 | 1 => 13.0 * static_sum + static_error,
        // WRPI: sum l_i w_i <= 6 x 1e-3 x 3.3, times the rate, 3 roundings more
        2 => {
            let dynamic = 1e-3 * n * most;
            16.0 * (static_sum + dynamic * 6250.0) + static_error + dynamic * rate_error + 1e-3 * n * play * 6250.0
        }
        // MRPI
        3 => 13.0 * (fixed + n * 6.5) + fixed_error + n * (7.0 + 85.0 + 10.0),
        // Play-polynomial: g to the fifth power, 1.5 (1 + .. + 1.5^4) <= 19.8, slope 1 + 2 v + .. + 5 v^4 <= 56;
        // w + w^2 + w^3 <= 50.2, slope 1 + 2 w + 3 w^2 <= 40.3; 6 roundings more by Horner
        _ => 19.0 * (1.0 + 19.8 + n * 50.2) + 56.0 * 1.5 + n * 40.3 * play,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn val_core_equals_the_naive_implementation(p in parameters(), drive in drive()) {
        for (found, wanted) in outputs::<f64>(&p, &drive).iter().zip(naive_outputs(&p, &drive)) {
            for (found, wanted) in found.iter().zip(wanted) {
                // Some thirty roundings of 1.1e-16 each of terms that sum to 320 at most.
                prop_assert!((found - wanted).abs() <= 1e-12 * wanted.abs().max(1.0), "{found} {wanted}");
            }
        }
    }

    /// The derived [`bound`]: 2.4e-5 for PI and MPI, 3.7e-4 for WRPI, 7.2e-5 for MRPI, 4.8e-4 for the play-polynomial.
    #[test]
    fn prop_f32_stays_within_its_bound_of_f64(p in parameters(), drive in drive()) {
        for (single, double) in outputs::<f32>(&p, &drive).iter().zip(outputs::<f64>(&p, &drive)) {
            for (model, (single, double)) in single.iter().zip(double).enumerate() {
                prop_assert!((single - double).abs() <= bound(model), "model {model}: {single} {double}");
            }
        }
    }
}
